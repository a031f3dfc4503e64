"""Interactive exploration of any system: mode shapes, response and zones of instability follow the sliders.

The state is plain numbers with the names of the parameters, so only the sliders need a widget library.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable
from io import BytesIO
from typing import Any, NamedTuple

import numpy as np

from cra_sym.arm.parameters import Arm
from cra_sym.cached import cached_property
from cra_sym.checks import instance, one_number, real_array, shown
from cra_sym.extras import MissingExtraError, require
from cra_sym.figures import styled
from cra_sym.figures.live import LiveFigure
from cra_sym.figures.modes import figure_mode_shapes
from cra_sym.figures.responses import figure_response
from cra_sym.figures.stability import AXIAL, JOINT, figure_zones
from cra_sym.figures.subject import (
    around,
    default_excitation,
    fields,
    parameter_name,
    rigid_body_modes,
    single,
    span,
    with_unit,
)
from cra_sym.model.excitations import Parametric
from cra_sym.model.system import System
from cra_sym.solvers.motion import BaseMotion
from cra_sym.symbols import row

__all__ = ["Explorer", "explore"]

_ARM = ("k_t", "k_r", "m_e", "J_e", "L", "b", "h", "E", "rho")
_MOTION = {"v_m": "velocity", "a_m": "acceleration", "B": "amplitude", "varpi": "angular_frequency", "psi": "phase"}
_START = {"v_m": 0.0, "a_m": 0.1, "B": 1e-3, "varpi": 10.0, "psi": 0.0, "epsilon": 0.3}
_OF_AN_ARM = {"joint stiffness fluctuates": JOINT, "base shakes along the arm": AXIAL}
_SWING = 24  # frames of one cycle of the mode shapes
_SIZE = (8.6, 2.9)
_DECADES = 1.5  # to each side of the first value of a parameter of an elastic-slip element

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
    """A picture, the names it depends on, and its arguments."""

    reads: frozenset[str]
    figure: LiveFigure
    arguments: Callable[[], dict[str, Any]]


class Explorer:
    """The result of :func:`explore`, displayed in a notebook with sliders or as a picture.

    Attributes
    ----------
    values : dict
        The present values by their names, SI units.
    """

    def __init__(self, system: System, excitation: Any, values: dict[str, Any]) -> None:
        self._given = system
        self._names = _ARM if isinstance(system, Arm) else tuple(system.values)
        self._excitations, self.excitation = _choices(system, excitation)
        own = [kind for _, kind in system.numerics("causes")] == ["motion"]
        self._motion = {name: field for name, field in _MOTION.items() if own and name not in self._names}
        start = {name: _START[name] for name in (*self._motion, "epsilon") if name not in self._names}
        self.swing = 0.0
        self.values: dict[str, float] = {name: float(system.values[name]) for name in self._names} | start
        self._pictures: dict[str, bytes] = {}
        self._check(values)
        self.values |= {name: float(value) for name, value in values.items()}
        self._times = np.linspace(0.0, 2.0 if isinstance(system, Arm) else span(system), 1601)

    @property
    def system(self) -> System:
        """The system at the present values of the sliders."""
        return self._given.replace(**{name: self.values[name] for name in self._names})

    @property
    def motion(self) -> BaseMotion | None:
        """The motion of the base at the present values; None unless a prescribed motion is the only input."""
        given = {field: self.values[name] for name, field in self._motion.items()}
        return BaseMotion(**given) if given else None

    @cached_property
    def views(self) -> dict[str, _View]:
        """The pictures: mode shapes, response, zones."""
        system, found = self._given, {}
        rows, columns = len(fields(system)), min(3, system.most_modes)
        if rows or system.conservative_part is system:  # of coordinates alone complex modes have no picture
            found["modes"] = _View(
                frozenset({*self._names, "swing"}),
                LiveFigure(
                    figure_mode_shapes, max(rows, 1), columns, (_SIZE[0], _SIZE[1] * max(rows, 1)), sharey="row"
                ),
                lambda: {"system": self.system, "phase": self.swing},
            )
        found["response"] = _View(
            frozenset({*self._names, *self._motion}),
            LiveFigure(figure_response, 1, 1, _SIZE),
            lambda: {"system": self.system, "motion": self.motion, "t": self._times},
        )
        if self._excitations:
            zones = LiveFigure(figure_zones, 1, self._zones_shown, _SIZE, sharey=True)
            found["zones"] = _View(frozenset({*self._names, "epsilon", "excitation"}), zones, self._zones)
        return found

    @property
    def _zones_shown(self) -> int:
        """The number of elastic modes whose zones are shown."""
        return min(3, self._given.most_modes - rigid_body_modes(self._given))

    def _zones(self) -> dict[str, Any]:
        coarse = {
            "points": 17,
            "tolerance": 1e-4,
        }  # growth rates to about 1e-4 of the largest, sufficient for a picture
        epsilon = self.values["epsilon"] if "epsilon" not in self._names else _START["epsilon"]
        return {"system": self.system, "excitation": self.excitation, "epsilon": epsilon, **coarse}

    def _set(self, **changes: Any) -> None:
        """Change values, ``excitation`` or ``swing`` by name, and redraw what depends on them."""
        values = {name: float(value) for name, value in changes.items() if name in self.values}
        self._check(values)
        with styled():  # JupyterLab may move one slider in another thread than the next
            self.values |= values
            self.excitation = changes.get("excitation", self.excitation)
            self.swing = changes.get("swing", self.swing)
            for name, view in self.views.items():
                if view.reads & changes.keys():
                    self._redraw(name)

    def _check(self, values: dict[str, Any]) -> None:
        unknown = set(values) - set(self.values)
        if unknown:
            raise TypeError(f"{', '.join(sorted(unknown))}: must be among {', '.join(self.values)}")
        for name, value in values.items():
            one_number(name, value, allow_infinite=True)
        self._given.replace(**{name: values[name] for name in self._names if name in values})
        BaseMotion(**{self._motion[name]: values[name] for name in self._motion if name in values})
        if "epsilon" in values and "epsilon" not in self._names:
            real_array("epsilon", values["epsilon"], low=0.0, high=1.0, open_low=True)

    def _redraw(self, name: str) -> None:
        """Draw a picture, or say why there is none, such as for a length that leaves a mass outside."""
        try:
            self._draw(name)
        except (ValueError, ArithmeticError) as error:
            self._show(name, self.views[name].figure.remark(str(error)))

    def _draw(self, name: str) -> None:
        view = self.views[name]
        self._show(name, view.figure.redraw(**view.arguments()))

    def _show(self, name: str, picture: bytes) -> None:
        self._pictures[name] = picture
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
        """One slider per value, labelled by the nomenclature.

        Raises
        ------
        MissingExtraError
            If ipywidgets, from the extra ``explore``, is not installed.
        """
        return {name: self._slider(name) for name in self.values}

    def _slider(self, name: str) -> Any:
        widgets, value = require("ipywidgets", "explore"), self.values[name]
        symbol, unit, meaning = self._named(name)
        common: dict[str, Any] = {
            "description": with_unit(symbol, unit),
            "tooltip": meaning,
            "style": {"description_width": "8em"},
            "layout": {"width": "24em"},
        }
        grid = self._grid(name)
        options = [("rigid" if np.isinf(one) else f"{one:.3g}", one) for one in grid]
        slider = widgets.SelectionSlider(options=options, value=value, **common)
        slider.observe(lambda change: self._set(**{name: change["new"]}), "value")
        return slider

    def _grid(self, name: str) -> list[float]:
        """Return where the slider may stand, in ascending order: the present value is among them, exactly."""
        value, (low, high, steps) = self.values[name], self._range(name)
        stiffness = name in self._names and name in self._given.numerics("stiffnesses")
        if stiffness:
            grid = np.geomspace(low, high, steps + 1)
        elif name in self._by_decades and value > 0:
            grid = value * np.geomspace(10**-_DECADES, 10**_DECADES, steps + 1)
        else:
            grid = np.linspace(min(low, value), max(high, value), steps + 1)
        others = grid[~np.isclose(grid, value, rtol=1e-5, atol=0.0)]
        ends = {value, np.inf} if stiffness else {value}
        return sorted({float(f"{one:.8g}") for one in others} | ends)

    @cached_property
    def _by_decades(self) -> set[str]:
        """The parameters of elastic-slip elements: stiffness, slip force, or a preload that both depend on."""
        elements = (element for element, _, _ in self._given.model.pieces["hysteresis"])
        values = (value for element in elements for value in element.parameters.values())
        return {symbol.name for value in values for symbol in getattr(value, "free_symbols", ())} & {*self._names}

    def _named(self, name: str) -> tuple[str, str, str]:
        """Return symbol, unit and meaning of a value."""
        if name not in self._names or isinstance(self._given, Arm):
            entry = row(name)
            return f"${entry.latex}$", entry.unit, entry.meaning
        return (*parameter_name(self._given, name), f"parameter {name} of the model")

    def _range(self, name: str) -> tuple[float, float, int]:
        if name in _RANGES and (name not in self._names or isinstance(self._given, Arm)):
            return _RANGES[name]
        try:
            values = around(self._given, name)
        except ValueError:  # a parameter of value 0 that affects no frequency
            return 0.0, 1.0, 50
        low, high = float(values.min()), float(values.max())
        return low, high, 50

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
        choices = []
        if self._excitations:
            choice = widgets.Dropdown(options=self._excitations, value=self.excitation, layout={"width": "24em"})
            choice.observe(lambda change: self._set(excitation=change["new"]), "value")
            choices = [choice]
        play = widgets.Play(min=0, max=_SWING - 1, interval=120, repeat=True, tooltip="let the mode shapes swing")
        play.observe(lambda change: self._set(swing=2 * np.pi * change["new"] / _SWING), "value")
        amplitude = [name for name in ("epsilon",) if name in self.values and name not in self._names]
        columns: list[tuple[Any, list[Any]]] = [(self._names, [play]), (self._motion, []), (amplitude, choices)]
        boxes = [widgets.VBox([*(self.sliders[name] for name in names), *more]) for names, more in columns]
        controls = widgets.HBox(boxes, layout={"flex_flow": "row wrap"})
        return widgets.VBox([controls, *self.images.values()])

    def __repr__(self) -> str:
        units = {name: self._named(name)[1].removesuffix("1") for name in self.values}
        texts = (f"{name} = {value:.4g} {units[name]}".rstrip() for name, value in self.values.items())
        return f"explorer: {', '.join(texts)}"

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> dict[str, Any]:
        """Show the sliders where the extra ``explore`` is installed, and a picture of the same state elsewhere."""
        shown: dict[str, Any] = {"text/plain": repr(self), "image/png": b64encode(self.picture()).decode("ascii")}
        try:
            sliders: dict[str, Any] = self.panel._repr_mimebundle_()
            return sliders | shown
        except MissingExtraError:
            return shown


def _choices(system: System, given: Any) -> tuple[dict[str, Any], Any]:
    """Return the excitations to choose from in the picture of the zones, by label, and the initial one."""
    if given is not None and (not isinstance(given, Parametric) or given.shape):
        raise TypeError(f"excitation = {shown(given)}: must be a single Fluctuation, JointStiffness or AxialBase")
    if isinstance(system, Arm):
        choices: dict[str, Any] = dict(_OF_AN_ARM)
    else:
        try:
            choices = {"as by default": default_excitation(system)}
        except ValueError:  # nothing can fluctuate
            choices = {}
    if given is not None and given not in choices.values():
        choices["as given"] = given
    return choices, given if given is not None else next(iter(choices.values()), None)


def explore(system: System | None = None, *, excitation: Parametric | None = None, **values: float) -> Explorer:
    """Return an interactive view of a system, to be displayed as the last expression of a notebook cell.

    The sliders need the extra ``explore`` (ipywidgets); without it the notebook shows a picture of the same state.

    Parameters
    ----------
    system : System, optional
        By default the nominal arm with an elastic joint, k_t = 1e4 N/m and k_r = 1e3 N m/rad. There is a slider for
        each parameter, for an arm k_t, k_r, m_e, J_e, L, b, h, E and rho.
    excitation : Fluctuation, JointStiffness or AxialBase, optional
        Excitation in the picture of the zones.
    values : float
        Start values of the parameters by name; of the base's motion, if that is all that drives, v_m, a_m, B, varpi and
        psi; and epsilon. Names and units of these are those of the nomenclature.

    Raises
    ------
    TypeError, ValueError
        If a name is unknown, a value is not allowed, or ``system`` is not a :class:`System` or is a batch.

    Examples
    --------
    >>> from cra_sym import explore
    >>> view = explore(k_t=1e3, B=2e-3, L=1.2)
    >>> view.system.k_t, view.system.L, view.motion
    (1000.0, 1.2, <BaseMotion of shape (): piecewise, harmonic>)
    """
    given = Arm.nominal().replace(k_t=1e4, k_r=1e3) if system is None else system
    instance("system", given, System)
    return Explorer(single(given), excitation, values)
