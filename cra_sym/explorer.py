"""The arm under sliders: its mode shapes, its response and its zones of instability follow each of them at once.

The state is plain numbers named by the nomenclature, so everything but the sliders works without any widget library.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable
from functools import cached_property
from io import BytesIO
from typing import Any, NamedTuple

import numpy as np

from cra_sym.arm.excitations import JointStiffness
from cra_sym.arm.parameters import Arm
from cra_sym.checks import instance, real_array, shown
from cra_sym.extras import MissingExtraError, require
from cra_sym.figures.live import LiveFigure
from cra_sym.figures.modes import figure_mode_shapes
from cra_sym.figures.responses import figure_response
from cra_sym.figures.stability import AXIAL, JOINT, figure_zones
from cra_sym.model.excitations import AxialBase
from cra_sym.solvers.motion import BaseMotion
from cra_sym.symbols import row

__all__ = ["Explorer", "explore"]

_ARM = ("k_t", "k_r", "m_e")
_MOTION = {"v_m": "velocity", "a_m": "acceleration", "B": "amplitude", "varpi": "angular_frequency", "psi": "phase"}
_START = {"v_m": 0.0, "a_m": 0.1, "B": 1e-3, "varpi": 10.0, "psi": 0.0, "epsilon": 0.3}
_EXCITATIONS = {"joint stiffness fluctuates": JOINT, "base shakes along the arm": AXIAL}
_SWING = 24  # pictures of one swing of the mode shapes
_SIZE = (8.6, 2.9)
_TIME = np.linspace(0.0, 2.0, 1601)

#: First value, last value and number of steps; stiffnesses run through decades and end in a rigid joint.
_RANGES: dict[str, tuple[float, float, int]] = {
    "k_t": (1e1, 1e6, 50),
    "k_r": (1e0, 1e5, 50),
    "m_e": (0.0, 0.02, 40),
    "v_m": (0.0, 0.3, 30),
    "a_m": (0.0, 1.0, 50),
    "B": (0.0, 5e-3, 50),
    "varpi": (0.0, 60.0, 120),
    "psi": (0.0, 2 * np.pi, 48),
    "epsilon": (0.01, 0.6, 59),
}


class _View(NamedTuple):
    """A picture, the names it depends on, and the arguments it is drawn with."""

    reads: frozenset[str]
    figure: LiveFigure
    arguments: Callable[[], dict[str, Any]]


class Explorer:
    """What :func:`explore` returns: it shows itself in a notebook, with sliders or as a picture.

    Attributes
    ----------
    values : dict
        The present values by their names in the nomenclature, SI units.
    """

    def __init__(self, arm: Arm, excitation: Any, values: dict[str, Any]) -> None:
        self._given, self._excitations = arm, dict(_EXCITATIONS)
        if not isinstance(excitation, JointStiffness | AxialBase) or excitation.shape:
            raise TypeError(f"excitation = {shown(excitation)}: must be a single JointStiffness or AxialBase")
        if excitation not in self._excitations.values():
            self._excitations["as given"] = excitation
        self.excitation, self.swing = excitation, 0.0
        self.values = {name: getattr(arm, name) for name in _ARM} | _START
        self._pictures: dict[str, bytes] = {}
        self._check(values)
        self.values |= {name: float(value) for name, value in values.items()}

    @property
    def arm(self) -> Arm:
        """The arm as the sliders stand."""
        return self._given.replace(**{name: self.values[name] for name in _ARM})

    @property
    def motion(self) -> BaseMotion:
        """The base's motion as the sliders stand."""
        return BaseMotion(**{field: self.values[name] for name, field in _MOTION.items()})

    @cached_property
    def views(self) -> dict[str, _View]:
        """The pictures: mode shapes, response, zones."""
        modes = LiveFigure(figure_mode_shapes, 3, _SIZE, sharey=True)
        zones = LiveFigure(figure_zones, 3, _SIZE, sharey=True)
        return {
            "modes": _View(frozenset({*_ARM, "swing"}), modes, self._modes),
            "response": _View(frozenset({*_ARM, *_MOTION}), LiveFigure(figure_response, 1, _SIZE), self._response),
            "zones": _View(frozenset({*_ARM, "epsilon", "excitation"}), zones, self._zones),
        }

    def _modes(self) -> dict[str, Any]:
        return {"system": self.arm, "phase": self.swing}

    def _response(self) -> dict[str, Any]:
        return {"system": self.arm, "motion": self.motion, "t": _TIME}

    def _zones(self) -> dict[str, Any]:
        coarse = {"points": 17, "tolerance": 1e-4}  # growth to about 1e-4 of its largest: a picture's worth
        return {"system": self.arm, "excitation": self.excitation, "epsilon": self.values["epsilon"], **coarse}

    def _set(self, **changes: Any) -> None:
        """Change values, ``excitation`` or ``swing`` by name, and redraw what depends on them."""
        values = {name: float(value) for name, value in changes.items() if name in _RANGES}
        self._check(values)
        self.values |= values
        self.excitation = changes.get("excitation", self.excitation)
        self.swing = changes.get("swing", self.swing)
        for name, view in self.views.items():
            if view.reads & changes.keys():
                self._draw(name)

    def _check(self, values: dict[str, Any]) -> None:
        unknown = set(values) - set(_RANGES)
        if unknown:
            raise TypeError(f"{', '.join(sorted(unknown))}: must be among {', '.join(_RANGES)}")
        for name, value in values.items():
            shape = real_array(name, value, allow_infinite=True).shape
            if shape:
                raise ValueError(f"{name} has shape {shape}: must be one number")
        self._given.replace(**{name: values[name] for name in _ARM if name in values})
        BaseMotion(**{_MOTION[name]: values[name] for name in _MOTION if name in values})
        if "epsilon" in values:
            real_array("epsilon", values["epsilon"], low=0.0, high=1.0, open_low=True)

    def _draw(self, name: str) -> None:
        view = self.views[name]
        self._pictures[name] = view.figure.redraw(**view.arguments())
        if "images" in self.__dict__:
            self.images[name].value = self._pictures[name]

    def picture(self) -> bytes:
        """Return all pictures below one another as one PNG."""
        from PIL import Image

        for name in self.views.keys() - self._pictures.keys():
            self._draw(name)
        parts = [Image.open(BytesIO(self._pictures[name])) for name in self.views]
        whole, top = Image.new("RGB", (parts[0].width, sum(part.height for part in parts)), "white"), 0
        for part in parts:
            whole.paste(part, (0, top))
            top += part.height
        stored = BytesIO()
        whole.save(stored, "PNG")
        return stored.getvalue()

    # The sliders ------------------------------------------------------------------------------------------------

    @cached_property
    def sliders(self) -> dict[str, Any]:
        """A slider a value, labelled by the nomenclature.

        Raises
        ------
        MissingExtraError
            If ipywidgets, from the extra ``explore``, is not installed.
        """
        return {name: self._slider(name) for name in _RANGES}

    def _slider(self, name: str) -> Any:
        widgets, entry, value = require("ipywidgets", "explore"), row(name), self.values[name]
        common: dict[str, Any] = {
            "description": f"${entry.latex}$ {_divisor(entry.unit)}",
            "tooltip": entry.meaning,
            "style": {"description_width": "8em"},
            "layout": {"width": "24em"},
        }
        low, high, steps = _RANGES[name]
        if name in ("k_t", "k_r"):
            grid = sorted({*np.geomspace(low, high, steps + 1).round(6).tolist(), np.inf, value})
            options = [("rigid" if np.isinf(k) else f"{k:.3g}", k) for k in grid]
            slider = widgets.SelectionSlider(options=options, value=value, **common)
        else:
            common |= {"min": min(low, value), "max": max(high, value), "step": (high - low) / steps}
            slider = widgets.FloatSlider(value, readout_format=".3g", **common)
        slider.observe(lambda change: self._set(**{name: change["new"]}), "value")
        return slider

    @cached_property
    def images(self) -> dict[str, Any]:
        """The pictures as widgets."""
        widgets = require("ipywidgets", "explore")
        for name in self.views.keys() - self._pictures.keys():
            self._draw(name)
        look: dict[str, Any] = {"format": "png", "layout": {"width": f"{90 * _SIZE[0]:.0f}px", "max_width": "100%"}}
        return {name: widgets.Image(value=self._pictures[name], **look) for name in self.views}

    @cached_property
    def panel(self) -> Any:
        """Sliders and pictures as one widget.

        Raises
        ------
        MissingExtraError
            If ipywidgets, from the extra ``explore``, is not installed.
        """
        widgets = require("ipywidgets", "explore")
        choice = widgets.Dropdown(options=self._excitations, value=self.excitation, layout={"width": "24em"})
        choice.observe(lambda change: self._set(excitation=change["new"]), "value")
        play = widgets.Play(min=0, max=_SWING - 1, interval=120, repeat=True, tooltip="let the mode shapes swing")
        play.observe(lambda change: self._set(swing=2 * np.pi * change["new"] / _SWING), "value")
        columns: list[tuple[Any, list]] = [(_ARM, [play]), (_MOTION, []), (("epsilon",), [choice])]
        boxes = [widgets.VBox([*(self.sliders[name] for name in names), *more]) for names, more in columns]
        controls = widgets.HBox(boxes, layout={"flex_flow": "row wrap"})
        return widgets.VBox([controls, *self.images.values()])

    def __repr__(self) -> str:
        told = (
            f"{name} = {value:.4g} {row(name).unit.removesuffix('1')}".rstrip() for name, value in self.values.items()
        )
        return f"explorer: {', '.join(told)}"

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> dict[str, Any]:
        """Show the sliders where the extra ``explore`` is installed, and a picture of the same state elsewhere."""
        shown: dict[str, Any] = {"text/plain": repr(self), "image/png": b64encode(self.picture()).decode("ascii")}
        try:
            return self.panel._repr_mimebundle_() | shown
        except MissingExtraError:
            return shown


def _divisor(unit: str) -> str:
    if unit == "1":
        return ""
    unit = unit.replace("^2", "²")
    return f"/ ({unit})" if {" ", "/"} & {*unit} else f"/ {unit}"


def explore(arm: Arm | None = None, *, excitation: Any = JOINT, **values: Any) -> Explorer:
    """Return the arm under sliders, to be shown as the last expression of a notebook cell.

    The sliders need the extra ``explore`` (ipywidgets); without it the notebook shows a picture of the same state.

    Parameters
    ----------
    arm : Arm, optional
        By default the nominal one with an elastic joint, k_t = 1e4 N/m and k_r = 1e3 N m/rad.
    excitation : JointStiffness or AxialBase
        What fluctuates in the picture of the zones.
    values : float
        Start values of k_t, k_r, m_e, v_m, a_m, B, varpi, psi, epsilon: names and units of the nomenclature.

    Raises
    ------
    TypeError, ValueError
        If a name is unknown, a value is not allowed, or the arm is a batch.

    Examples
    --------
    >>> from cra_sym import explore
    >>> view = explore(k_t=1e3, B=2e-3)
    >>> view.arm.k_t, view.motion
    (1000.0, <BaseMotion of shape (): piecewise, harmonic>)
    """
    arm = Arm.nominal().replace(k_t=1e4, k_r=1e3) if arm is None else arm
    instance("arm", arm, Arm)
    if arm.shape:
        raise ValueError(f"arm has shape {arm.shape}: must be a single one")
    return Explorer(arm, excitation, values)
