"""Steady states of systems with elastic-slip elements: starting points, number of harmonics, multipliers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cra_sym import checks
from cra_sym.analysis.modes import section_place
from cra_sym.analysis.nonlinear import samples, watched
from cra_sym.analysis.periodic_forcing import Forced, Wave, forced
from cra_sym.cached import cached_property
from cra_sym.model.excitations import Fluctuation, LagrangianTerms
from cra_sym.model.projection import Displacement, Load
from cra_sym.model.slip_elements import slip_statics, slip_terms_of
from cra_sym.model.system import System
from cra_sym.solvers.harmonic_balance import Basis, peak
from cra_sym.solvers.slip_balance import Elements, SlipBalance, stuck
from cra_sym.solvers.slip_stability import slip_multipliers

__all__ = ["SlipProblem", "elements_of"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
FIRST, MOST = 15, 127
"""Default number of harmonics: first trial, and largest."""
LED = 63
"""Harmonics up to which solutions are continued from softer elements."""
ACCURACY = 3e-7
"""Target for the relative change of a motion by twice as many harmonics."""
_SMALLEST, _LARGEST, _STEP, _PHASES, _ITERATIONS = 0.01, 100.0, 2.0, 3, 14
"""Amplitudes of starts over that at which the last element slips, their ratio, phases, iterations from each."""
_SHARES = (1.0, 0.3, 0.0)  # shares of the elements' stiffness whose mode shapes are tried
_SAMPLED = 9
_FAR = 0.4
_SAME = 1e-6
_HELD = 1e-9  # largest force on a rigid-body mode over that of all sliders


def elements_of(system: System, modes: int) -> Elements:
    """Return the elements of a system, with the static flexibility of the omitted modes included."""
    found = system.slip_elements(modes).absorbed()
    groups = [
        (found.stiffness[found.where == k], found.slip[found.where == k]) for k in range(len(found.displacements))
    ]
    return Elements(found.displacements, tuple(groups), found.flexibility)


class Watched(NamedTuple):
    """An output displacement: its modal part, and the static contribution of omitted modes."""

    modes: Array
    elements: Array
    waves: Array


def watched_load(system: System, place: Any, field: Any) -> Load:
    """Return a unit force on the output displacement, by default the tip."""
    base = system.without_hysteresis
    coordinates = list(base.model.linearised.coordinates)
    if field is None and not base.model.linearised.fields:
        field = coordinates[0]
    left, right = float(base.domain.left), float(base.domain.left) + float(base.domain.length)
    at = right if place is None else float(checks.real_array("place", place, unit="m"))
    if field in coordinates:
        where = Displacement("lumped", coordinates.index(field), 0)
    elif at in (left, right):
        where = Displacement("left" if at == left else "right", section_place(base, field), 0)
    else:
        where = Displacement("point", section_place(base, field), 0, 0)
    return Load.unit(where, at, slip_terms_of(system).forced.symbols)


def statics_of(system: System, modes: int, causes: tuple[str, ...], place: Any, field: Any) -> Array:
    """Return :func:`cra_sym.model.slip_elements.slip_statics` for the output, cached."""

    def found(number: int) -> Array:
        return slip_statics(system, number, causes, watched_load(system, place, field))

    return np.asarray(system.cached(f"statics of {causes} at {place} {field}", modes, found))


def driven_by(drive: Any, system: System) -> dict[str, tuple[float, int]]:
    """Return amplitude and order of the time derivative of each linear input, by name."""
    kinds = dict(system.numerics("causes"))
    given = {key if isinstance(key, str) else key.func.__name__: float(value) for key, value in (drive or {}).items()}
    for name in given:
        if kinds.get(name) == "support":
            raise ValueError(
                f"drive: {name} acts by its displacement or velocity, which a system with elastic-slip elements leaves "
                "out; measure the fields from the moving frame"
            )
    return {
        name: (value, 2 if kinds[name] == "motion" else 0)
        for name, value in given.items()
        if value and kinds.get(name) in ("motion", "force")
    }


@dataclass(frozen=True, eq=False)
class SlipProblem:
    """A driven system with elements, truncated to a number of modes and harmonics.

    Attributes
    ----------
    arguments : mapping
        Arguments that the problem was made from.
    rows : Watched
    driven : Forced
    balance : SlipBalance
    period : int
    """

    arguments: Mapping[str, Any]
    rows: Watched
    driven: Forced
    balance: SlipBalance
    period: int

    @classmethod
    def of(cls, *, place: Any, field: Any, harmonics: int | None, period: int, **arguments: Any) -> SlipProblem:
        """Return the problem; ``harmonics`` None is the first trial number."""
        system, modes = arguments["system"], arguments["modes"]
        if system.shape:
            raise ValueError(
                f"system has the batch shape {system.shape}: must be a single one here; see System.parameter_sets"
            )
        own = {**arguments, "system": system.without_hysteresis}
        own["excitation"] = _without_elements(system, arguments.get("excitation"))
        driven = forced(**own)
        if _pushes_rigid(driven):
            raise ValueError("system: a constant load moves a rigid-body mode, which sliders alone hold")
        options = {**arguments, "place": place, "field": field, "harmonics": harmonics, "period": period}
        whole = FIRST if harmonics is None else harmonics
        basis = Basis.whole(whole, samples(driven.equations.degree, whole, driven.order * period))
        elements, given = elements_of(system, modes), driven_by(arguments.get("drive"), system)
        found = statics_of(system, modes, tuple(given), place, field)
        m = len(elements.groups)
        statics = np.zeros((m + 1, len(driven.waves)))
        for number, (amplitude, power) in enumerate(given.values()):
            wave = Wave(1, power, 0.5 * np.pi * power, amplitude)
            if wave in driven.waves:
                statics[:, driven.waves.index(wave)] += found[:, m + number]
        balance = SlipBalance(driven.equations, basis, elements, statics[:m])
        rows = Watched(watched(own["system"], modes, place, field), found[m, :m], statics[m])
        return cls(options, rows, driven, balance, period)

    def richer(self, harmonics: int, more_modes: int = 0) -> SlipProblem:
        """Return the problem with another number of harmonics, and more modes."""
        options = dict(self.arguments)
        most = options["system"].without_hysteresis.most_modes
        options |= {"harmonics": harmonics, "modes": min(options["modes"] + more_modes, most)}
        return self.of(**options)

    @property
    def basis(self) -> Basis:
        """Constant and harmonics."""
        return self.balance.basis

    @property
    def harmonics(self) -> int:
        """Number of harmonics."""
        return len(self.basis.sines)

    @property
    def unique(self) -> bool:
        """Whether the solution is unique: with constant coefficients the difference of two solutions loses energy."""
        return self.balance.constant

    @property
    def fastest(self) -> float:
        """Largest natural frequency with all elements stuck."""
        return float(np.sqrt(np.linalg.eigvalsh(stuck(self.balance.equations, self.balance.elements)).max()))

    def coefficients(self, unknowns: Array) -> Array:
        """Return modal coefficients, shape (points, modes, functions)."""
        return np.asarray(self.balance.coefficients(unknowns))

    def _causes(self, varpi: Array) -> Array:
        return self.driven.causes(varpi, self.basis.phase, self.period)

    def solved(self, starts: Array, varpi: Array, floor: float = 0.0) -> tuple[Array, NDArray[np.bool_]]:
        """Return solutions from starts, and which converged; if none does, a unique one is found by continuation."""
        alike = np.unique(varpi, return_inverse=True)[1] if self.unique else None
        frequency, causes = varpi / self.period, self._causes(varpi)
        found, good = self.balance.newton(starts, frequency, causes, alike=alike)
        if alike is not None and self.harmonics <= LED:
            left = np.flatnonzero(~np.isin(alike, alike[good]))
            left = left[np.unique(alike[left], return_index=True)[1]]
            if left.size:
                found[left], good[left] = self.balance.stiffened(frequency[left], causes[left])
        rigid = self.balance.equations.omega == 0.0
        if rigid.any():  # a static equilibrium of this part is undetermined
            pull = np.abs(self.coefficients(found)[:, rigid, 0]).max(axis=1) * (varpi / self.period) ** 2
            sliders = sum(float(f.sum()) for _, f in self.balance.elements.groups)
            good = good & (pull <= _HELD * sliders * np.abs(self.balance.elements.rows).max())
        return found, good

    def multipliers(self, unknowns: Array, varpi: Array) -> Complex:
        """Return Floquet multipliers over a period of each solution, shape (points, 2 modes)."""
        found = np.zeros((len(unknowns), 2 * self.balance.equations.modes), complex)
        coefficients, displacements = self.coefficients(unknowns), self.balance.displacements(unknowns)
        for k, frequency in enumerate(varpi):

            def waves(phase: Array, at: Array = varpi[k : k + 1]) -> Array:
                return np.asarray(self.driven.causes(at, phase, self.period)[0])

            cycles = self.balance.elements.cycles(displacements[k : k + 1])
            found[k] = slip_multipliers(
                self.balance.equations,
                self.basis,
                coefficients[k],
                float(frequency / self.period),
                self.balance.elements,
                cycles,
                waves,
            )
        return found

    def peaks(self, unknowns: Array, varpi: Array) -> Array:
        """Return the peak of the output in a period of each solution."""
        w = self.balance.displacements(unknowns)
        force = self.balance.forces(w.reshape(len(w), -1))[0].reshape(w.shape)
        series = self.rows.modes @ self.coefficients(unknowns) - self.rows.elements @ force
        series = series + self.rows.waves @ self.balance.waves(self._causes(varpi))
        return peak(self.basis, np.ones(1), series[:, None])[0]

    def loss(self, unknowns: Array) -> float:
        """Return the energy dissipated by sliders in a period of a solution, J."""
        cycles = self.balance.elements.cycles(self.balance.displacements(unknowns[None]))
        return float(sum(c.loss[0] for c in cycles))

    def changed(self, more_modes: int, more_harmonics: int, unknowns: Array, varpi: float) -> float:
        """Return the relative change of the motion with more modes, or with twice as many harmonics.

        Where the next doubling of the harmonics does not converge, it is the change by the last one.
        """
        own, at = self.coefficients(unknowns[None]), np.array([varpi])
        if not own.any():
            return 0.0
        if not more_harmonics:
            return self._apart(self.richer(min(self.harmonics, LED), more_modes), own, at)
        found = self._apart(self.richer(2 * self.harmonics + 1), own, at)
        return found if np.isfinite(found) else self._apart(self.richer(max(self.harmonics // 2, 1)), own, at)

    def _apart(self, other: SlipProblem, own: Array, varpi: Array) -> float:
        """Return the relative difference from the solution of another problem started here; inf where there is none."""
        start = np.zeros((1, other.balance.equations.modes, other.basis.size))
        h, n, m = min(self.harmonics, other.harmonics), self.balance.equations.modes, other.harmonics
        start[:, :n, : h + 1] = own[..., : h + 1]
        start[:, :n, m + 1 : m + 1 + h] = own[..., self.harmonics + 1 : self.harmonics + 1 + h]
        found, good = other.solved(other.balance.start(start), varpi)
        return float(np.linalg.norm(other.coefficients(found) - start) / np.linalg.norm(own)) if good[0] else np.inf

    def settled(self, found: list[list[Array]], varpi: Array) -> tuple[SlipProblem, list[list[Array]]]:
        """Return the problem with as many harmonics as its solutions need, and these; itself if the number is given."""
        problem, open_ = self, self.arguments["harmonics"] is None
        where = np.array([k for k, answers in enumerate(found) for _ in answers], int)
        unknowns = np.array([answer for answers in found for answer in answers])
        if not where.size or not unknowns.any():
            return self, found
        before = np.full(len(unknowns), np.inf)
        while open_ and problem.harmonics < MOST:
            rich = problem.richer(min(2 * problem.harmonics + 1, MOST))
            start = rich.balance.embedded(unknowns, problem.harmonics)
            after, good = rich.solved(start, varpi[where])
            if self.unique and not good.all():
                break  # estimated change by more harmonics
            size = np.linalg.norm(start, axis=1)
            change = np.linalg.norm(after - start, axis=1) / np.where(size > 0, size, 1.0)
            unknowns, problem = np.where(good[:, None], after, start), rich
            left = change * np.minimum(
                change / np.where(before > 0, before, 1.0), 1.0
            )  # estimated change by the next doubling
            open_, before = bool((np.where(np.isfinite(before), left, change) > ACCURACY).any()), change
        return problem, [list(unknowns[where == k]) for k in range(len(found))]

    # ----------------------------------------------------------------------------------------------------- starts

    def seeds(self, varpi: Array, order: NDArray[np.intp]) -> tuple[NDArray[np.intp], Array, float]:
        """Return starts: rest, all stuck, none stuck, and single shapes with many amplitudes and phases.

        Returns
        -------
        where : ndarray of int, shape (starts,)
            The frequency each start belongs to.
        starts : ndarray, shape (starts, unknowns)
        size : float
            Modal amplitude at which elements slip.
        """
        count, size = len(varpi), self._size
        shares = () if self.driven.rests else (1.0, 0.0)
        frequency, causes = varpi / self.period, self._causes(varpi)
        where = [np.arange(count)] * len(shares)
        starts = [self.balance.stuck_motion(frequency, causes, share) for share in shares]
        if self.driven.rests or not self.balance.constant:
            where.append(np.arange(count))
            starts.append(np.zeros((count, self.balance.size)))
        if not self.balance.constant:
            picked = order[np.unique(np.linspace(0, count - 1, _SAMPLED).round().astype(int))]
            for share in _SHARES:
                shapes = np.linalg.eigh(stuck(self.balance.equations, self.balance.elements, share))[1]
                for shape in shapes.T:
                    for at in picked:
                        found = self._alone(shape, float(varpi[at]))
                        where.append(np.full(len(found), at))
                        starts.append(found)
        return np.concatenate(where), np.concatenate(starts), size

    @cached_property
    def _size(self) -> float:
        rows = np.abs(self.balance.elements.rows)
        return float(self.balance.elements.limit / rows.max())

    def _alone(self, shape: Array, varpi: float) -> Array:
        """Return solutions in one shape with its nearest harmonic, from a grid of amplitudes and phases."""
        equations, elements = self.balance.equations.along(shape), self.balance.elements.along(shape)
        stiff, free = np.sqrt(stuck(equations, elements)[0, 0]), float(equations.omega[0])
        frequency = varpi / self.period
        harmonic = int(np.clip(round(float(stiff) / frequency), 1, self.harmonics))
        if min(abs(harmonic * frequency - one) / max(one, 1e-300) for one in (float(stiff), free)) > _FAR:
            return np.empty((0, self.balance.size))
        alone = Forced(equations, self.driven.waves)
        number = samples(equations.degree, harmonic, alone.order * self.period)
        basis = Basis((0, harmonic), (harmonic,), number)
        small = SlipBalance(equations, basis, elements)
        smallest, largest = max(elements.limit, _SMALLEST * elements.reach), _LARGEST * elements.reach
        number = int(np.ceil(np.log(largest / smallest) / np.log(_STEP)))
        sizes = np.geomspace(0.3 * smallest, largest, number) / max(np.abs(elements.rows).max(), 1e-300)
        mirrored = self.driven.rests and equations.odd  # reversed displacements are a solution too
        phases = (1 if mirrored else 2) * np.pi * (np.arange(_PHASES) + 0.3) / _PHASES
        starts = np.zeros((number * _PHASES, 1, basis.size))
        starts[:, 0, 1] = np.multiply.outer(sizes, np.cos(phases)).ravel()
        starts[:, 0, 2] = np.multiply.outer(sizes, np.sin(phases)).ravel()
        causes = np.repeat(alone.causes(np.array([varpi]), basis.phase, self.period), len(starts), axis=0)
        found, good = small.newton(
            small.start(starts), np.full(len(starts), frequency), causes, tolerance=1e-5, most=_ITERATIONS
        )
        kept: list[Array] = []
        for answer in small.coefficients(found[good])[:, 0]:
            if not any(np.linalg.norm(answer - other) <= 1e-3 * np.linalg.norm(answer) for other in kept):
                kept.append(answer)
        if mirrored:
            kept += [-answer for answer in kept]
        whole = np.zeros((len(kept), shape.size, self.basis.size))
        for k, answer in enumerate(kept):
            whole[k][:, [0, harmonic, self.harmonics + harmonic]] = np.outer(shape, answer)
        return self.balance.start(whole)


def _pushes_rigid(driven: Forced) -> bool:
    rigid = driven.equations.omega == 0.0
    still = [t for t in driven.equations.forces if not (t.positions or t.velocities or t.causes)]
    return bool(rigid.any()) and any(np.abs(term.tensor[rigid]).max() > 0 for term in still)


def _without_elements(system: System, excitation: Any) -> Any:
    """Return an excitation of the system without its elements."""
    if isinstance(excitation, LagrangianTerms) and excitation == system.model.excitation:
        return system.model.without_hysteresis.excitation
    if isinstance(excitation, Fluctuation):
        symbols = {
            symbol.name
            for element, _, _ in system.model.pieces["hysteresis"]
            for value in element.parameters.values()
            for symbol in getattr(value, "free_symbols", ())
        }
        both = [name for name in excitation.weights if name in symbols]
        if both:
            raise ValueError(
                f"excitation = {excitation!r}: {both[0]} is of an elastic-slip element, which must not fluctuate"
            )
    return excitation
