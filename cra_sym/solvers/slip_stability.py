r"""Floquet multipliers of motions with elastic-slip elements, from the maps between events.

Between events the variation of a motion satisfies linear equations, with sticking elements as springs. When a slider
stops, its variation is that of the displacement at that reversal; sliders that never slip do not vary. The forces are
continuous at all events, so nothing else jumps.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cra_sym.solvers.harmonic_balance import Basis
from cra_sym.solvers.modal_polynomials import ModalPolynomials
from cra_sym.solvers.monodromy import beside_linear
from cra_sym.solvers.slip_balance import Elements
from cra_sym.solvers.slip_law import Cycle

__all__ = ["slip_multipliers"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Waves = Callable[[Array], Array]
"""Known functions at phases (samples,), shape (known functions, samples)."""
_TURN = 2.0 * np.pi
_ANGLE = 0.4  # largest phase of the fastest mode and the highest harmonic in one step of the coarsest integration
_LEVELS = 5
_GAUSS = 0.5 - np.sqrt(3.0) / 6.0
_FEWEST = 1e-12  # phase
_RADIUS, _DEGREE = 0.5, 13  # norm of an exponent, degree of its series: the first term left out is 0.5^14/14! = 7e-16


@dataclass(frozen=True, eq=False)
class _Motion:
    """A periodic motion and its variational equations."""

    equations: ModalPolynomials
    basis: Basis
    coefficients: Array
    frequency: float
    waves: Waves | None

    @property
    def constant(self) -> bool:
        terms = (*self.equations.energies, *self.equations.forces)
        return not any(term.positions or term.velocities for term in terms)

    def matrices(self, phase: Array) -> Array:
        """Return the matrices of the variations of (q, p) without elements at phases."""
        equations, n = self.equations, self.equations.modes
        if self.constant:
            found = np.zeros((phase.size, 2 * n, 2 * n))
            found[:, n:, n:] = -equations.damping
        else:
            q = self.basis.values(phase) @ self.coefficients.T
            v = self.frequency * self.basis.values(phase, 1) @ self.coefficients.T
            found = beside_linear(equations, q, v, None if self.waves is None else self.waves(phase))
        found[:, np.arange(n), n + np.arange(n)] += 1.0
        found[:, n + np.arange(n), np.arange(n)] -= equations.omega**2
        return found


def slip_multipliers(
    equations: ModalPolynomials,
    basis: Basis,
    coefficients: Array,
    frequency: float,
    elements: Elements,
    cycles: list[Cycle],
    waves: Waves | None = None,
    tolerance: float = 1e-9,
) -> Complex:
    """Return the multipliers of one motion, largest first, as many as the modes have states.

    Parameters
    ----------
    equations, basis
        As in :class:`cra_sym.solvers.slip_balance.SlipBalance`.
    coefficients : ndarray, shape (modes, functions)
    frequency : float
        Of the motion.
    elements : Elements
    cycles : list of Cycle
        Cycle of the elements on each displacement, of one row.
    waves : callable, optional
    tolerance : float
        Relative error of the map where equations are parametric or nonlinear.
    """
    motion = _Motion(equations, basis, coefficients, frequency, waves)
    spans = list(_spans(cycles))
    found = _map(motion, elements, spans, 1)
    if not motion.constant:
        for level in range(1, _LEVELS):
            finer = _map(motion, elements, spans, 2**level)
            settled = np.abs(finer - found).max() <= 15.0 * tolerance * np.abs(finer).max()
            found = finer + (finer - found) / 15.0  # of order four
            if settled:
                break
            found = finer
    values = np.linalg.eigvals(found)
    return np.asarray(values[np.argsort(-np.abs(values), kind="stable")][: 2 * equations.modes])


Span = tuple[float, float, list[NDArray[np.bool_]], list[NDArray[np.bool_]]]


def _spans(cycles: list[Cycle]) -> Iterator[Span]:
    """Yield (start, stop, sticking, stopped at the start) between events, the masks by displacement.

    Elements that never slip stick throughout.
    """
    events = {0.0, _TURN}
    for c in cycles:
        events |= {float(phase) % _TURN for phase in (*c.reversals[0], *c.onsets[0].ravel())}
    phases = sorted(events)
    kept = [phases[0]]
    for phase in phases[1:]:
        if phase - kept[-1] > _FEWEST:
            kept.append(phase)
    kept[-1] = _TURN
    before = [_sticking(c, 0.5 * (kept[-2] + kept[-1])) for c in cycles]
    for start, stop in itertools.pairwise(kept):
        now = [_sticking(c, 0.5 * (start + stop)) for c in cycles]
        yield start, stop, now, [a & ~b for a, b in zip(now, before, strict=True)]
        before = now


def _sticking(c: Cycle, phase: float) -> NDArray[np.bool_]:
    """Return whether each element sticks at a phase."""
    start, stop = c.reversals[0], c.ends[0]
    turned = np.where(phase < start[0], phase + _TURN, phase)
    number = int(np.flatnonzero((turned >= start) & (turned <= stop))[-1])
    return np.asarray(turned <= c.onsets[0, number])


def _map(motion: _Motion, elements: Elements, spans: list[Span], finer: int) -> Array:
    """Return the map of (q, p, sliders) over a period."""
    n, m = motion.equations.modes, len(elements.groups)
    counts = [k.size for k, _ in elements.groups]
    springs = [k for k, _ in elements.groups]
    joined = np.concatenate(springs)
    where = np.repeat(np.arange(m), counts)
    state = np.eye(2 * n + joined.size)
    steps = []
    for start, stop, sticking, _ in spans:
        stuck = np.array([k[mask].sum() for k, mask in zip(springs, sticking, strict=True)])
        steps.append((start, stop, *_coupled(elements, stuck)))
    maps = _propagators(motion, elements, steps, finer)
    for (_, _, sticking, stopped), (_, _, stiff, drive), step in zip(spans, steps, maps, strict=True):
        masks = np.concatenate(sticking)
        halted = np.concatenate(stopped)
        spread = np.zeros((m, joined.size))
        spread[where[masks], np.flatnonzero(masks)] = joined[masks]
        if halted.any():  # w = B q - R F, F = stiff B q - drive s, the sliders that stop not among s
            others = spread * ~halted
            q, z = state[:n], state[2 * n :]
            force = stiff @ (elements.rows @ q) - drive @ (others @ z)
            state[2 * n :][halted] = (elements.rows @ q - elements.coupling @ force)[where[halted]]
        moved = step[: 2 * n, : 2 * n] @ state[: 2 * n] + step[: 2 * n, 2 * n :] @ (spread @ state[2 * n :])
        state = np.concatenate([moved, state[2 * n :]])
    never = ~np.any([~np.concatenate(sticking) for _, _, sticking, _ in spans], axis=0)
    keep = np.concatenate([np.ones(2 * n, bool), ~never])
    return np.asarray(state[np.ix_(keep, keep)])


def _exponentials(exponents: Array, modes: int, fastest: float) -> Array:
    """Return the exponentials of many exponents, by scaling, Taylor's series and squaring of them all.

    Momenta are measured in the fastest frequency, so that the exponents of (q, p) are of the order of the phase of a
    step. The sliders' columns are nilpotent and do not limit the convergence.
    """
    scale = np.ones(exponents.shape[-1])
    scale[modes : 2 * modes] = max(fastest, 1e-300)
    scaled = exponents / scale[:, None] * scale
    most = np.abs(scaled[:, : 2 * modes, : 2 * modes]).sum(axis=-1).max()
    halvings = max(0, int(np.ceil(np.log2(max(most, _RADIUS) / _RADIUS))))
    scaled = scaled / 2**halvings
    one = np.eye(scale.size)
    found = one + scaled / _DEGREE
    for k in range(_DEGREE - 1, 0, -1):
        found = one + scaled @ found / k
    for _ in range(halvings):
        found = found @ found
    return np.asarray(found * scale[:, None] / scale)


def _coupled(elements: Elements, stuck: Array) -> tuple[Array, Array]:
    """Return the matrices of F = stiff B q - drive s with s the sums of k z over the sticking elements."""
    k = np.diag(stuck)
    inverse: Array = np.asarray(np.linalg.inv(np.eye(len(k)) + k @ elements.coupling), float)
    return inverse @ k, inverse


def _propagators(
    motion: _Motion, elements: Elements, steps: list[tuple[float, float, Array, Array]], finer: int
) -> list[Array]:
    """Return the maps of (q, p, s) between events."""
    n, b = motion.equations.modes, elements.rows
    size = 2 * n + len(b)
    fastest = max(float(motion.equations.omega.max()) / motion.frequency, float(motion.basis.orders.max()))
    parts = [
        1 if motion.constant else finer * max(1, int(np.ceil((stop - start) * fastest / _ANGLE)))
        for start, stop, _, _ in steps
    ]
    widths = np.repeat([(stop - start) / p for (start, stop, _, _), p in zip(steps, parts, strict=True)], parts)
    starts = np.concatenate([s + (e - s) * np.arange(p) / p for (s, e, _, _), p in zip(steps, parts, strict=True)])
    fixed = np.zeros((len(steps), size, size))
    for number, (_, _, stiff, drive) in enumerate(steps):
        fixed[number, n : 2 * n, :n] = -b.T @ stiff @ b
        fixed[number, n : 2 * n, 2 * n :] = b.T @ drive
    which = np.repeat(np.arange(len(steps)), parts)
    h = widths / motion.frequency

    def at(share: float) -> Array:
        whole = fixed[which].copy()
        whole[:, : 2 * n, : 2 * n] += motion.matrices(starts + share * widths)
        return whole * h[:, None, None]

    if motion.constant:
        exponent = at(0.5)
    else:  # Magnus, order four
        first, second = at(_GAUSS), at(1.0 - _GAUSS)
        exponent = 0.5 * (first + second) + np.sqrt(3.0) / 12.0 * (second @ first - first @ second)
    maps = _exponentials(exponent, n, float(motion.equations.omega.max()))
    found, at_step = [], 0
    for count in parts:
        whole = maps[at_step]
        for k in range(at_step + 1, at_step + count):
            whole = maps[k] @ whole
        found.append(whole)
        at_step += count
    return found
