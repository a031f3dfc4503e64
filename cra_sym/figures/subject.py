"""Properties of the system shown in a figure: names with units, ranges of parameters, a place that moves."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cra_sym.analysis.eigenvalues import oscillating_frequencies
from cra_sym.analysis.modes import mode_shapes
from cra_sym.analysis.sensitivities import sensitivities
from cra_sym.arm.parameters import Arm
from cra_sym.checks import instance, one_axis, shown
from cra_sym.model.excitations import Fluctuation, Parametric
from cra_sym.model.system import System
from cra_sym.symbols import row

if TYPE_CHECKING:
    from sympy.core.function import AppliedUndef

__all__ = [
    "arm_or_nominal",
    "around",
    "default_excitation",
    "field_label",
    "fields",
    "leading_parameter",
    "moving_place",
    "over_what_is_stable",
    "parameter_label",
    "parameter_name",
    "parameters_of",
    "positive",
    "rigid_body_modes",
    "rigid_ends",
    "several",
    "single",
    "span",
    "unknowns",
    "with_unit",
]

Array = NDArray[np.float64]
_STILL = 1e-9  # of the largest displacement: a place that a mode does not move


def single(system: System) -> System:
    """Return a system, or raise an error for anything else or a batch."""
    instance("system", system, System)
    if system.shape:
        raise ValueError(f"system has shape {system.shape}: must be a single set of values, not a batch")
    return system


@overload
def arm_or_nominal(arm: Arm | None, **values: float) -> Arm: ...
@overload
def arm_or_nominal(arm: System | None, **values: float) -> System: ...
def arm_or_nominal(arm: System | None, **values: float) -> System:
    """Return an arm given, or the nominal one with some values replaced."""
    return Arm.nominal().replace(**values) if arm is None else single(arm)


def several(name: str, values: ArrayLike, of: str, least: int = 2, **limits: Any) -> Array:
    """Return an axis of numbers, or raise an error that names the field if they are too few."""
    axis = np.atleast_1d(one_axis(name, values, of, **limits))
    if axis.size < least:
        raise ValueError(f"{name} = {shown(values)}: must hold at least {least} value{'s' * (least > 1)}")
    return axis


positive = partial(several, low=0.0, open_low=True)


def parameters_of(system: System) -> Arm:
    """Return the arm with the parameters of a system, or refuse one that lacks some.

    Raises
    ------
    ValueError
        If the system has not all the parameters of an arm.
    """
    if isinstance(system, Arm):
        return system
    names = Arm.nominal().values
    missing = [name for name in names if name not in system.values]
    if missing:
        raise ValueError(
            f"system has no parameter {missing[0]!r}: this figure is of an arm, with {', '.join(names)}; "
            "'frequencies', 'mode_shapes', 'response', 'residual_vibration', 'zones' and others show any system"
        )
    return Arm(**{name: system.values[name] for name in names}, zeta=system.zeta)


def fields(system: System) -> dict[str, AppliedUndef | None]:
    """Return the fields by their names in LaTeX; an arm's without its derivation."""
    if isinstance(system, Arm):
        return {"v": None}
    from sympy import Symbol, latex

    return {latex(Symbol(field.func.__name__)): field for field in system.model.equations.fields}


def unknowns(system: System) -> list[str]:
    """Return the names in LaTeX of the fields, or of the coordinates where there is no field."""
    from sympy import Symbol, latex

    known = list(fields(system))
    return known or [latex(Symbol(q.func.__name__)) for q in system.model.equations.coordinates]


def field_label(system: System) -> tuple[str, str]:
    """Return the labels of the axis along the domain and of a field, with units if known."""
    if isinstance(system, Arm):
        return "position along the arm $x$ / m", " / kg$^{-1/2}$"
    return f"${system.model.equations.x}$", ""


def parameter_label(system: System, name: str) -> str:
    """Return the axis label of a parameter, with its unit."""
    return with_unit(*parameter_name(system, name))


def parameter_name(system: System, name: str) -> tuple[str, str]:
    """Return the symbol of a parameter in LaTeX and its unit, '1' if it is not known."""
    if isinstance(system, Arm):
        return f"${row(name).latex}$", row(name).unit
    from sympy import Symbol, latex

    return f"${latex(Symbol(name))}$", system.model.units.get(name, "1")


def with_unit(quantity: str, unit: str) -> str:
    """Return a quantity over its unit."""
    if unit == "1":
        return quantity
    unit = unit.replace("^2", "²").replace("^3", "³").replace("^4", "⁴")
    return f"{quantity} / ({unit})" if {" ", "/"} & {*unit} else f"{quantity} / {unit}"


def rigid_ends(system: System) -> System:
    """Return the system with every spring of an end rigid."""
    return system.replace(**dict.fromkeys(system.numerics("stiffnesses"), np.inf))


def leading_parameter(system: System) -> str:
    """Return the first stiffness of an end, or else the parameter that most affects the first elastic frequency."""
    ends = system.numerics("stiffnesses")
    if ends:
        return str(next(iter(ends)))
    found = sensitivities(system.basis, _first_elastic(system))
    return max(found.log, key=lambda name: float(np.nan_to_num(np.abs(found.log[name][-1]))))


def _first_elastic(system: System) -> int:
    part = system.basis
    most = min(7, part.most_modes)
    return next((modes for modes in range(1, most) if part.natural_frequencies(modes)[-1] > 0), most)


def rigid_body_modes(system: System) -> int:
    """Return the number of modes of frequency zero among the first six."""
    return int((oscillating_frequencies(system, min(6, system.most_modes)) == 0).sum())


def around(system: System, name: str, narrowing: int = 0, points: int = 81) -> Array:
    """Return values of a parameter over which the frequencies change: decades of a stiffness of an end.

    Each ``narrowing`` takes the square root of the range factor.

    Raises
    ------
    ValueError
        If it is 0 and no frequency depends on it.
    """
    value, stiff = float(system.values[name]), name in system.numerics("stiffnesses")
    far = (1e3 if stiff else 2.0) ** 0.5**narrowing
    if 0 < abs(value) < np.inf:
        return (np.geomspace if stiff else np.linspace)(value / far, far * value, points)
    found = sensitivities(system.basis, _first_elastic(system) + 2, [name])
    rate = np.abs(found.compliance[name] if np.isinf(value) else found.rate[name])
    good = (rate > 0) & np.isfinite(rate) & (found.frequency > 0)
    if not good.any():
        raise ValueError(f"values: must be given, as no frequency depends on {name} = {value:g}")
    reach = float(
        (found.frequency[good] / rate[good]).min()
    )  # factor that to first order would halve or double a frequency
    middle = 1 / reach if np.isinf(value) else reach
    return np.geomspace(middle / far, middle * far, points) if stiff else np.linspace(0.0, (far - 1) * reach, points)


def over_what_is_stable(
    system: System, name: str, modes: int, narrowing: int = 0, points: int = 81
) -> tuple[Array, Array]:
    """Return values of a parameter and the frequencies there, Hz, over a range where nothing buckles.

    Raises
    ------
    ValueError
        As `around`, or if the structure has buckled even for the smallest range.
    """
    for more in range(narrowing, 5):
        values = around(system, name, more, points)
        try:
            return values, oscillating_frequencies(system.replace(**{name: values}), modes) / (2 * np.pi)
        except ValueError:
            if more == 4:
                raise
    raise AssertionError


def moving_place(system: System, modes: int = 3) -> float:
    """Return the right end, or, where no mode moves the first field there, the place that the first mode moves most."""
    left = float(system.domain.left)
    x = np.linspace(left, left + float(system.domain.length), 201)
    if not fields(system):  # coordinates alone
        return float(x[-1])
    shapes = np.abs(mode_shapes(system.basis, x, modes))
    shown = shapes[max(_first_elastic(system) - 1, 0) if _first_elastic(system) <= modes else 0]
    held = shapes[:, -1].max() <= _STILL * shapes.max()
    return float(x[np.argmax(shown)] if held else x[-1])


def span(system: System, periods: float = 5.0) -> float:
    """Return the duration of about that many periods of the first elastic mode, s, to one digit."""
    modes = _first_elastic(system)
    omega = system.basis.natural_frequencies(modes)[-1]
    return float(f"{2 * np.pi * periods / omega:.0e}") if omega > 0 else 1.0


def default_excitation(system: System) -> Parametric:
    """Return the default excitation: that of the Lagrangian, of the springs of the ends, or of another stiffness.

    Raises
    ------
    ValueError
        If no parameter can fluctuate.
    """
    own = getattr(system.model, "excitation", None)
    if own is not None:
        return own  # type: ignore[no-any-return]
    able = [n for n, value in system.values.items() if 0 < value < np.inf and not system.numerics("fluctuation", n)]
    springs = [name for name in able if name in system.numerics("stiffnesses")]
    if not able:
        raise ValueError("excitation: must be given, as no stiffness of the model can fluctuate by itself")
    found = sensitivities(system.basis, _first_elastic(system), springs or able)
    return Fluctuation({max(found.log, key=lambda name: float(np.nan_to_num(found.log[name][-1]))): 1.0})
