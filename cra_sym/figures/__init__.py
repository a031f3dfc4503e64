"""One function a figure: it takes data or a system and optional axes, returns the Figure and sets nothing global."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.resources import files
from inspect import cleandoc, signature
from threading import RLock
from typing import TYPE_CHECKING, Any

from cra_sym.cached import released_in_children
from cra_sym.checks import choice, instance, shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from cra_sym.model.system import System

__all__ = [
    "ANIMATIONS",
    "FIGURES",
    "STYLE",
    "animate",
    "described",
    "draw",
    "shows_an_arm",
    "shows_any_system",
    "styled",
]

_TURN = released_in_children(RLock())  # Matplotlib's settings are those of the process: one thread draws at a time

FIGURES = {
    "fig01": "cra_sym.figures.robot:figure_1",
    "fig02": "cra_sym.figures.joint:figure_2",
    "fig03": "cra_sym.figures.modes:figure_3",
    "fig04": "cra_sym.figures.modes:figure_4",
    "fig05": "cra_sym.figures.sensitivity:figure_5",
    "fig06": "cra_sym.figures.responses:figure_6",
    "fig07": "cra_sym.figures.responses:figure_7",
    "fig08": "cra_sym.figures.responses:figure_8",
    "fig09": "cra_sym.figures.responses:figure_9",
    "fig10": "cra_sym.figures.responses:figure_10",
    "fig11": "cra_sym.figures.stability:figure_11",
    "fig11_axial": "cra_sym.figures.stability:figure_11_axial",
    "fig12": "cra_sym.figures.stability:figure_12",
    "fig12_axial": "cra_sym.figures.stability:figure_12_axial",
    "zone_widths": "cra_sym.figures.boundaries:figure_widths",
    "zones": "cra_sym.figures.stability:figure_zones",
    "combinations": "cra_sym.figures.stability:figure_combinations",
    "accuracy": "cra_sym.figures.boundaries:figure_accuracy",
    "inside_tongues": "cra_sym.figures.nonlinear:figure_inside_tongues",
    "shaken_along": "cra_sym.figures.large_amplitudes:figure_shaken_along",
    "shaken_across": "cra_sym.figures.large_amplitudes:figure_shaken_across",
    "backbone": "cra_sym.figures.nonlinear:figure_backbone",
    "slip_loop": "cra_sym.figures.slipping:figure_slip_loop",
    "slip_amplitude": "cra_sym.figures.slipping:figure_slip_amplitude",
    "preload": "cra_sym.figures.slipping:figure_preload",
    "preload_tongues": "cra_sym.figures.slipping:figure_preload_tongues",
    "frequency_response": "cra_sym.figures.vibration:figure_frequency_response",
    "residual_vibration": "cra_sym.figures.vibration:figure_residual_vibration",
    "input_shaping": "cra_sym.figures.vibration:figure_input_shaping",
    "frequencies": "cra_sym.figures.modes:figure_frequencies",
    "response": "cra_sym.figures.responses:figure_response",
    "mode_shapes": "cra_sym.figures.modes:figure_mode_shapes",
    "derivation": "cra_sym.figures.derivation:figure_derivation",
}
"""Name of a figure -> the function that draws it; called with no arguments, it draws the paper's case."""

ANIMATIONS = {
    "moving_arm": "cra_sym.figures.animation:moving_arm",
    "moving_modes": "cra_sym.figures.animation:moving_modes",
    "jumping_arm": "cra_sym.figures.sweep_film:jumping_arm",
}
"""Name of an animation -> the function that returns it as an SVG document."""

STYLE = str(files(__name__) / "style.mplstyle")
"""The one style: ``with plt.style.context(STYLE): ...``."""


@contextmanager
def styled() -> Iterator[None]:
    """Draw in the one style what is drawn within, one thread at a time."""
    from matplotlib import style

    with _TURN, style.context(STYLE):
        yield


def draw(name: str, system: System | None = None, **options: Any) -> Figure:
    """Draw one figure of ``FIGURES`` in the house style, of the system given or of the paper's arm.

    Parameters
    ----------
    name : str
        Some show any system, such as 'frequencies', 'mode_shapes', 'response', 'residual_vibration' and 'zones'; the
        others of `shows_an_arm` one with the parameters of an arm, whose Lagrangian may be another; 'fig04' an arm.
    system : System, optional
        A single one. An arm is one.
    **options
        Further arguments of the figure's function, such as ``parameter="k_t"`` of 'frequencies' or ``excitation=``.

    Raises
    ------
    TypeError, ValueError
        If there is no such figure or it does not take an option, or a system is given to one that shows none, or lacks
        the parameters of an arm where those are needed.

    Examples
    --------
    >>> from cra_sym import Arm
    >>> draw("frequencies", Arm.nominal(), parameter="m_e").axes[0].get_xlabel().endswith("/ kg")
    True
    """
    choice("figure", name, FIGURES)
    taken = signature(_function(name)).parameters
    unknown = [option for option in options if option not in taken or option in ("system", "arm")]
    if unknown:
        raise TypeError(f"{unknown[0]} = {shown(options[unknown[0]])}: {name!r} takes {', '.join(taken) or 'nothing'}")
    subject: dict[str, System] = {}
    if system is not None:
        if not shows_an_arm(name):
            raise ValueError(f"figure = {name!r}: it shows no arm, so none can be given")
        from cra_sym.figures.subject import parameters_of
        from cra_sym.model.system import System

        instance("system", system, System)
        if not shows_any_system(name):
            parameters_of(system)
        subject = {"system" if shows_any_system(name) else "arm": system}
    with styled():
        figure: Figure = _function(name)(**subject, **options)
        return figure


def shows_an_arm(name: str) -> bool:
    """Tell whether a figure of ``FIGURES`` can be drawn of an arm other than the paper's."""
    return bool({"arm", "system"} & signature(_function(name)).parameters.keys())


def shows_any_system(name: str) -> bool:
    """Tell whether a figure of ``FIGURES`` can be drawn of any system."""
    return "system" in signature(_function(name)).parameters


def animate(name: str) -> str:
    """Return one animation of ``ANIMATIONS``, an SVG document.

    Raises
    ------
    ValueError
        If there is no such animation.
    """
    choice("animation", name, ANIMATIONS)
    return str(_function(name)())


def described(name: str) -> tuple[str, str]:
    """Return the summary and the remaining text of a figure or an animation, from the docstring of its function."""
    text = cleandoc(_function(name).__doc__ or "").partition("\n\nParameters\n")[0].replace("``", "")
    first, more = (" ".join(part.split()) for part in (text + "\n\n").split("\n\n", 1))
    shown = re.sub("^(Draw|Show) ", "", first)
    return re.sub(r"^\w(?=[a-z ])", lambda letter: letter[0].upper(), shown), more


def _function(name: str) -> Callable[..., Any]:
    homes = {**FIGURES, **ANIMATIONS}
    choice("figure", name, homes)
    module, function = homes[name].split(":")
    found: Callable[..., Any] = getattr(import_module(module), function)
    return found
