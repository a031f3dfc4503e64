"""Periodic forcing of nonlinear systems: excitations and drives as harmonic functions in the modal equations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cra_sym import checks
from cra_sym.analysis.modes import check_kind
from cra_sym.analysis.nonlinear import nonlinear_modal_equations
from cra_sym.model.excitations import DirectForce, Fluctuation, Parametric
from cra_sym.model.system import System
from cra_sym.solvers.floquet import Oscillation
from cra_sym.solvers.modal_polynomials import ModalPolynomials, TensorTerm, symmetrised

__all__ = ["Forced", "Wave", "forced"]

Array = NDArray[np.float64]


class Wave(NamedTuple):
    """A known function of time, factor varpi^power cos(order varpi t + phase).

    Attributes
    ----------
    order, power : int
    phase, factor : float
    small : bool
        Whether it has epsilon as a further factor.
    """

    order: int = 1
    power: int = 0
    phase: float = 0.0
    factor: float = 1.0
    small: bool = False

    @property
    def rate(self) -> Wave:
        """Its derivative by time."""
        turned = self.phase + 0.5 * np.pi
        return self._replace(power=self.power + 1, phase=turned, factor=self.order * self.factor)


@dataclass(frozen=True, eq=False)
class Forced:
    """Modal equations with their harmonic inputs.

    Attributes
    ----------
    equations : ModalPolynomials
    waves : tuple of Wave
        The known functions of the equations, by number.
    """

    equations: ModalPolynomials
    waves: tuple[Wave, ...]

    @property
    def order(self) -> int:
        """Highest multiple of the excitation frequency in a product of waves of one term."""
        terms = (*self.equations.energies, *self.equations.forces)
        return max((sum(self.waves[k].order for k in term.causes) for term in terms), default=0)

    @property
    def rests(self) -> bool:
        """Whether rest is a solution."""
        return not any(not t.positions and not t.velocities and t.tensor.any() for t in self.equations.forces)

    def causes(
        self, varpi: Array, phase: Array, period: int, epsilon: Array | float = 1.0, *, rates: bool = False
    ) -> Array:
        """Return the waves, or their rates, at phases of a period of ``period`` cycles (points, waves, samples)."""
        waves = [wave.rate if rates else wave for wave in self.waves]
        values = np.zeros((len(varpi), len(waves), phase.size))
        for k, wave in enumerate(waves):
            size = wave.factor * varpi**wave.power * (epsilon if wave.small else 1.0)
            values[:, k] = size[:, None] * np.cos(wave.order * period * phase + wave.phase)
        return values

    def first(self, modes: int) -> Forced:
        """Return the equations of the first modes alone."""
        return Forced(self.equations.first(modes), self.waves)


@dataclass
class _Collected:
    """Terms and waves collected so far."""

    energies: list[TensorTerm] = field(default_factory=list)
    forces: list[TensorTerm] = field(default_factory=list)
    waves: list[Wave] = field(default_factory=list)

    def number(self, wave: Wave) -> int:
        if wave not in self.waves:
            self.waves.append(wave)
        return self.waves.index(wave)


def forced(
    system: System,
    modes: int,
    excitation: Any = None,
    epsilon: Any = None,
    drive: Mapping[Any, Any] | None = None,
    zeta: Any = None,
    *,
    small: bool = False,
) -> Forced:
    """Return the modal equations of a system that is excited, driven, or both.

    Parameters
    ----------
    system : System
    modes : int
    excitation : Parametric, optional
    epsilon : float, optional
        With the excitation.
    drive : mapping of function of t, or its name, to float, optional
        Amplitudes of prescribed motions and forces proportional to cos(varpi t).
    zeta : array_like, optional
    small : bool
        Leave epsilon to :meth:`Forced.causes`.

    Raises
    ------
    TypeError, ValueError
        Names the argument.
    """
    whole = nonlinear_modal_equations(system, modes, zeta)
    found = _Collected()
    if (excitation is None) != (epsilon is None):
        raise ValueError("excitation, epsilon: both or neither must be given")
    direct: Sequence[DirectForce] = []
    if excitation is not None:
        checks.instance("excitation", excitation, Parametric)
        direct = excitation.forces(system, modes)
    beside = {name for name, _ in whole.causes} | {force.cause[0] for force in direct if force.cause is not None}
    amplitudes = _amplitudes(system, drive, beside)
    numbers = [found.number(_rate(amplitudes.get(name, 0.0), order)) for name, order in whole.causes]
    for own, terms in ((found.energies, whole.polynomials.energies), (found.forces, whole.polynomials.forces)):
        own += [term._replace(causes=tuple(numbers[k] for k in term.causes)) for term in terms]
    _add_loads(found, system, modes, amplitudes)
    if excitation is not None:
        size = checks.one_number("epsilon", epsilon, low=0.0, unit="1")
        _add_excitation(found, system, modes, excitation, size, small)
        _add_direct(found, direct, amplitudes, size, small)
    polynomials = whole.polynomials
    equations = ModalPolynomials(polynomials.omega, polynomials.damping, tuple(found.energies), tuple(found.forces))
    return Forced(equations, tuple(found.waves))


def _rate(amplitude: float, order: int) -> Wave:
    return Wave(1, order, 0.5 * np.pi * order, amplitude)


def _amplitudes(system: System, drive: Any, others: set[str]) -> dict[str, float]:
    given = checks.mapping("drive", drive, "functions of t to amplitudes")
    known = [*dict(system.numerics("causes")), *others]
    found = {}
    for key, value in given.items():
        name = key if isinstance(key, str) else getattr(getattr(key, "func", None), "__name__", str(key))
        if name not in known:
            raise ValueError(
                f"drive: {name} does not drive the model; what drives it is {', '.join(dict.fromkeys(known)) or 'none'}"
            )
        found[name] = checks.one_number(f"drive: {name}", value)
    return found


def _add_loads(found: _Collected, system: System, modes: int, amplitudes: Mapping[str, float]) -> None:
    """Add the linear inputs and the constant loads."""
    for name, kind in system.numerics("causes"):
        amplitude = amplitudes.get(name, 0.0)
        if not amplitude:
            continue
        check_kind("drive", name, kind)
        for order, load in system.numerics("loads", name).items():
            wave = _rate(amplitude, order)
            found.forces.append(TensorTerm(system.project(load, modes), 0, 0, (found.number(wave),)))
    constant = system.numerics("constant")
    if constant is not None:
        found.forces.append(TensorTerm(system.project(constant, modes), 0, 0))


def _add_excitation(
    found: _Collected, system: System, modes: int, excitation: Parametric, epsilon: float, small: bool
) -> None:
    _refuse_nonlinear(system, excitation)
    for drive in excitation.drives(system, modes):
        wave = (found.number(_wave(drive.oscillation, epsilon, small)),)
        for matrix, positions, velocities in ((drive.stiffness, 1, 0), (drive.damping, 0, 1)):
            if matrix is not None:
                found.forces.append(TensorTerm(-matrix, positions, velocities, wave))
        if drive.mass is not None:  # d/dt (g M v) comes from the Lagrangian g v M v/2
            found.energies.append(TensorTerm(symmetrised(drive.mass / 2, 0), 0, 2, wave))
        if drive.momentum is not None:  # d/dt (g B q) comes from the Lagrangian g v B q, apart from a force g B' v
            found.energies.append(TensorTerm(drive.momentum.T, 1, 1, wave))
            found.forces.append(TensorTerm(-drive.momentum.T, 0, 1, wave))


def _add_direct(
    found: _Collected,
    direct: Sequence[DirectForce],
    amplitudes: Mapping[str, float],
    epsilon: float,
    small: bool,
) -> None:
    """Add the forces of an excitation that act without any vibration, with the inputs that some multiply."""
    for oscillation, times, force, cause in direct:
        amplitude = 1.0 if cause is None else amplitudes.get(cause[0], 0.0)
        if amplitude:
            waves = [_wave(oscillation, epsilon if times else 1.0, small and times)]
            waves += [] if cause is None else [_rate(amplitude, cause[1])]
            found.forces.append(TensorTerm(force, 0, 0, tuple(found.number(wave) for wave in waves)))


def _wave(oscillation: Oscillation, size: float, small: bool) -> Wave:
    phase = 0.0 if oscillation.kind == "cos" else -0.5 * np.pi
    return Wave(oscillation.order, oscillation.power, phase, size, small)


def _refuse_nonlinear(system: System, excitation: Parametric) -> None:
    """Refuse a fluctuating parameter that occurs in nonlinear terms too, since these would not fluctuate."""
    terms = system.numerics("nonlinear")
    if terms is not None and isinstance(excitation, Fluctuation):
        both = [name for name in excitation.weights if name in terms.parameters]
        if both:
            raise ValueError(
                f"excitation = {excitation!r}: {both[0]} is in nonlinear terms too; give the fluctuating part a symbol "
                "of its own"
            )
