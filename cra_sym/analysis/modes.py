"""Natural frequencies and mode shapes of any system, and its participation factors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np
from numpy.typing import NDArray

from cra_sym import checks
from cra_sym.analysis.complex_shapes import of_complex_modes
from cra_sym.analysis.eigenvalues import eigenvalues
from cra_sym.model.routes import Modes
from cra_sym.model.spanned_stiffness import check_range
from cra_sym.model.system import MOST_MODES, System
from cra_sym.si import Numbers

if TYPE_CHECKING:
    from sympy.core.function import AppliedUndef

    from cra_sym.model.lagrangian import Model

__all__ = [
    "displaced",
    "mode_shapes",
    "natural_frequencies",
    "section_place",
]

Array = NDArray[np.float64]
_MOST_DERIVATIVES = 20


@checks.default_floating_point
def natural_frequencies(system: System, modes: int = 3) -> Array:
    """Return the natural frequencies (30), Hz.

    Dampers are left out: these are the frequencies of the conservative structure.

    Parameters
    ----------
    system : System
        An :class:`cra_sym.Arm` or any other.
    modes : int
        How many, 1 to 1000; rigid-body modes count, with frequency 0.

    Returns
    -------
    ndarray, shape (..., modes)
        Ascending and complete; ``...`` is ``system.shape``.

    Raises
    ------
    TypeError, ValueError
        If ``system`` is not a :class:`System`, ``modes`` is not an integer from 1 to 1000, the structure has buckled or
        has fewer natural frequencies, or its forces are not conservative.

    Examples
    --------
    >>> from cra_sym import Arm
    >>> print(natural_frequencies(Arm.nominal().replace(m_e=0)).round(3))
    [ 2.448 15.339 42.95 ]
    """
    checks.instance("system", system, System)
    return system.natural_frequencies(modes) / (2 * np.pi)


def section_place(system: System, field: Any = None, *, lumped: bool = False) -> int:
    """Return the position of a field among the displacements of a section; the first one by default.

    With ``lumped`` it may be a lumped coordinate: these come after the displacements, see `displaced`.

    Raises
    ------
    ValueError
        If it is not a field of the model.
    """
    if field is None:
        return 0
    form = system.model.state_form
    known = [*system.model.equations.fields, *(form.coordinates if lumped else ())]
    if not any(field is one or (isinstance(field, type(one)) and field == one) for one in known):
        allowed = f"one of {', '.join(map(str, known))}" if known else "None, as the model has no fields"
        raise ValueError(f"field = {checks.shown(field)}: must be {allowed}")
    return [*form.displacements, *form.coordinates].index(field)


def displaced(system: System, modes: Modes, place: int, x: Array | None = None, derivative: int = 0) -> Array:
    """Return what `section_place` found in every mode: at the right end, (..., modes), or at places x, (..., modes, x).

    A lumped coordinate is the same at all places.
    """
    own = system.numerics("sizes")[0]
    if place >= own:
        value = modes.coordinate(place - own)
        return value if x is None else np.repeat(value[..., None], x.shape[-1], axis=-1)
    return modes.displacement(1, place) if x is None else modes.shape(place, derivative, x)


@overload
def mode_shapes(system: System, x: Numbers | None = None, modes: int = 3, derivative: int = 0, *,
                field: AppliedUndef | None = None, damped: Literal[False] = False,
                oscillating: bool = True) -> Array:  # fmt: skip
    """Return real mode shapes."""


@overload
def mode_shapes(system: System, x: Numbers | None = None, modes: int = 3, derivative: int = 0, *,
                field: AppliedUndef | None = None, damped: bool,
                oscillating: bool = True) -> Array | NDArray[np.complex128]:  # fmt: skip
    """Return complex mode shapes if ``damped``."""


@checks.default_floating_point
def mode_shapes(
    system: System,
    x: Numbers | None = None,
    modes: int = 3,
    derivative: int = 0,
    *,
    field: AppliedUndef | None = None,
    damped: bool = False,
    oscillating: bool = True,
) -> Array | NDArray[np.complex128]:
    """Return the mass-normalised mode shapes (25), or their derivatives by x, positive at the right end.

    Where the first field of a mode is zero at the right end, the next displacement of the section there, such as the
    slope of a beam, is positive; where all are zero (a clamped beam, a held string), the field next to that end is.

    Parameters
    ----------
    system : System
    x : array_like, optional
        Points in the domain, m: a number or one axis of points, the same for the whole batch. A lumped coordinate has
        no place, and needs none.
    modes : int
        How many, 1 to 1000, rigid-body modes included.
    derivative : int
        Order of the derivative by x, 0 to 20.
    field : applied undefined function, optional
        A field (default: the first), or a lumped coordinate.
    damped : bool
        Complex shapes phi of the motions ``phi exp(s t)`` of :func:`cra_sym.eigenvalues`: with dampers, gyroscopic
        forces and forces that follow the motion. They are normalised to ``conj(phi)' M phi = 1``, with the phase that
        makes real and positive the quantity that is positive for real modes. Without such forces they are the same.
    oscillating : bool
        Leave out the shapes of real eigenvalues, as in :func:`cra_sym.eigenvalues`.

    Returns
    -------
    ndarray, shape (..., modes) or (..., modes, len(x))
        In kg^-1/2 m^-derivative for a displacement in m; complex if ``damped``.

    Raises
    ------
    TypeError, ValueError
        If ``x`` does not hold real numbers, has more than one axis or a point outside the domain of any member of the
        batch, or another argument is out of its range.

    Examples
    --------
    >>> from cra_sym import Arm, mode_shapes
    >>> mode_shapes(Arm.nominal(), [0.0, 0.5, 1.0], modes=2).round(2)
    array([[ 0.  ,  1.37,  4.03],
           [ 0.  , -2.89,  3.97]])
    """
    checks.instance("system", system, System)
    derivative = checks.count("derivative", derivative, low=0, high=_MOST_DERIVATIVES)
    modes = checks.count("modes", modes, high=MOST_MODES)
    checks.instance("damped", damped, bool)
    place = section_place(system, field, lumped=True)
    points = checked_places(system, x, place)
    if derivative and (points is None or place >= system.numerics("sizes")[0]):
        raise ValueError(f"derivative = {derivative}: must be 0 of a lumped coordinate, which has no place")
    every = None if points is None else np.atleast_1d(points)

    def seen(one: System, own: Modes) -> Array:
        return displaced(one, own, place, every, derivative)

    shapes: Array | NDArray[np.complex128]
    with np.errstate(all="ignore"):
        if not damped:
            shapes = seen(system, system.modes(modes))
        elif system.numerics("conservative"):
            shapes = np.asarray(seen(system, system.modes(modes)), dtype=complex)
        else:
            shapes = of_complex_modes(system, eigenvalues(system, modes, oscillating=oscillating), seen)
    check_range(shapes)
    return shapes if points is None or points.ndim else shapes[..., 0]


def checked_places(system: System, x: Numbers | None, place: int) -> Array | None:
    """Return places in the domain, or None where none are given of a lumped coordinate, which needs none."""
    if x is None and place < system.numerics("sizes")[0]:
        raise ValueError("x = None: must be places in the domain; only lumped coordinates, chosen by field=, have none")
    points = None if x is None else checks.one_axis("x", x, "places", unit="m")
    if points is not None:
        check_places(system, points)
    return points


def check_places(system: System, points: Array, name: str = "x", cure: str = "leave it out") -> None:
    """Raise a ValueError unless all points lie in the domain of every member of the batch."""
    if not system.numerics("sizes")[0]:
        raise ValueError(
            f"{name}: the model has coordinates alone, which have no place; {cure}, with field= for another than the "
            "first"
        )
    left, length = system.domain.left, system.domain.length
    low, high = np.max(left), np.min(left + length)
    slack = 1e-12 * np.max(length)
    if points.size and not (points.min() >= low - slack and points.max() <= high + slack):
        bad = points.min() if points.min() < low - slack else points.max()
        raise ValueError(f"{name} = {bad:g} must be in the domain, [{low:g}, {high:g}]")


def check_kind(argument: str, name: str, kind: str) -> None:
    """Raise an error that names the argument unless an input of that kind (see `causes`) is a linear load."""
    if kind not in ("force", "motion", "support"):
        raise ValueError(f"{argument}: the load {kind} must be a multiple of {name}, its velocity or its acceleration")


def only_motion(system: System | Model, *, support: bool = False) -> str:
    """Return the name of the only prescribed motion of a model.

    Parameters
    ----------
    system : System or Model
    support : bool
        Whether it may act by its displacement and velocity too, or by one of these alone.

    Raises
    ------
    ValueError
        If there is none, or more than one.
    """
    causes = system.numerics("causes")
    motions = [name for name, kind in causes if kind == "motion" or (support and kind == "support")]
    if support and len(causes) == 1:
        motions = [name for name, _ in causes]
    if len(motions) != 1:
        found = ", ".join(motions) or "none"
        if not motions and causes:
            others = ", ".join(name for name, _ in causes)
            found += f", but is driven by {others}; name what drives it, or measure the fields from the moving frame"
        raise ValueError(f"the model must have one prescribed motion that acts by its acceleration; it has {found}")
    return str(motions[0])


def participation(system: System, modes: int, motion: str | None = None) -> Array:
    """Return the participation of the modes in a prescribed motion, kg^1/2, shape (..., modes)."""
    load = system.project(system.numerics("load", motion or only_motion(system)), modes)
    return np.negative(load, out=load)


def driver_of(system: System, motion: str | None) -> str:
    """Return the name of a prescribed motion or force, by default of the only motion; it must be a single load.

    Raises
    ------
    ValueError
        If nothing of that name drives the model, or it acts by more than its acceleration or its value.
    """
    causes = dict(system.numerics("causes"))
    driver = only_motion(system) if motion is None else checks.choice("motion", motion, causes)
    if causes[driver] not in ("motion", "force"):
        raise ValueError(
            f"motion = {driver}: acts by its displacement or its velocity too, so the modes have no single "
            "participation in it; must be a motion that acts by its acceleration alone, or a force"
        )
    return driver
