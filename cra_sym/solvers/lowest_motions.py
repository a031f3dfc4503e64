"""The lowest complex modes of one parameter set as a real linear system: an invariant subspace of the pencil.

Bases of the right and the left invariant subspace come from ordered real Schur forms, so that coalescing modes, as at
critical damping and at flutter, need no special case.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, eigvals, schur, solve
from scipy.sparse.csgraph import connected_components

from cra_sym.cached import cached_property

from .pencil import SHIFT, Array, GeneralContinuum, Reduced, reduced
from .pencil_refine import matched, meshes, sequence
from .stress_mesh import rule

__all__ = ["BasisModes", "LowestMotions", "lowest_motions", "modal_damping"]

_SETTLED = 1e-9
"""Relative difference of the eigenvalues on two meshes."""
_MIDDLE, _ASTRAY = 2, 1e-2  # mesh for all motions, and relative difference beyond which an eigenvalue is spurious
_OBLIQUE = 3.0
"""Largest accepted norm of the projection on the motions; it is 1 for orthogonal modes, as without dampers."""
_SAME = 1e-6  # relative difference of moduli that count as equal: a pair is not split
_AT_ONCE = 1e3  # decay rate over the last oscillating eigenvalue requested
_TOGETHER = 1e-3  # relative distance of eigenvalues that share a block
_STILL = 1e-5  # modulus over the largest below which an eigenvalue may be a zero, known to half its digits
_SLANTED = 1e8  # condition number beyond which motions are not separated into blocks
_LIGHT = 1e-7  # square root of a mass, relative to the largest, below which a coordinate has none


@dataclass(frozen=True, eq=False)
class BasisModes:
    """The coordinates of the pencil of one parameter set, with the interface of modes."""

    problem: Reduced

    @property
    def omega(self) -> Array:
        """Placeholder array with one entry per coordinate; only its shape is used."""
        return np.zeros(self.problem.root_mass.shape[1])

    @cached_property
    def _motions(self) -> Array:
        return np.asarray(self.problem.motions[0])

    @cached_property
    def _ends(self) -> Array:
        return np.asarray(self._motions @ self.problem.columns.ends[self.problem.sets[0]].T)

    def displacement(self, end: int, place: int) -> Array:
        """Return a displacement of an end section, or a coordinate where there is no field, shape (k,)."""
        continuum = self.problem.columns.problem
        if not continuum.displacements:
            return self.coordinate(place)
        return self._ends[:, end * (continuum.displacements + continuum.lumped) + place]

    def force(self, end: int, place: int) -> Array:
        """Raise: the coordinates of a basis have no natural forces of their own."""
        raise NotImplementedError

    def coordinate(self, number: int) -> Array:
        """Return a lumped coordinate, shape (k,)."""
        return self._ends[:, self.problem.columns.problem.displacements + number]

    def shape(self, place: int, derivative: int, x: Array) -> Array:
        """Return a derivative of a displacement, up to the highest in the energies, at places, shape (k, stations)."""
        columns = self.problem.columns
        tops, field = columns.problem.tops(), 0
        while tops[field] < place:
            field += 1
        over = place + derivative - tops[field]
        if over > 1:
            raise ValueError(
                f"derivative = {derivative}: complex shapes with supports at interior places, or coefficients that "
                f"vary finely, have derivatives up to {derivative - over + 1}"
            )
        jet = field if over > 0 else len(tops) + place + derivative
        values = columns.jets[jet]
        own = self.problem.sets[0] if len(values) > 1 else 0
        values = np.broadcast_to(values[own], (values.shape[1], *columns.grid.x.shape[1:]))
        values = np.tensordot(self._motions, values, axes=1)
        ends, half = columns.grid.ends[self._grid_row], columns.grid.half[self._grid_row]
        piece = np.searchsorted(ends[1:-1], x, side="right")
        local = np.clip((x - 0.5 * (ends[piece] + ends[piece + 1])) / half[piece], -1.0, 1.0)
        spectrum = rule(columns.mesh.points).spectrum
        table = np.polynomial.legendre.legvander(local, len(spectrum) - 1) @ spectrum
        found: Array = (values[:, piece] * table).sum(axis=-1)
        return found

    @cached_property
    def _grid_row(self) -> int:
        return int(self.problem.sets[0]) if len(self.problem.columns.grid.ends) > 1 else 0

    def integral(self, place: int) -> None:
        """Return None: only quadrature gives integrals."""
        return None

    def stations(self) -> tuple[Array, Array]:
        """Return points and weights of a quadrature that respects the breakpoints, shape (points,)."""
        columns = self.problem.columns
        row = self.problem.sets[0] if len(columns.weights) > 1 else 0
        return columns.grid.x[self._grid_row].ravel(), columns.weights[row]


@dataclass(frozen=True, eq=False)
class LowestMotions:
    """The motions of the lowest complex modes: ``y' = system y + push f`` for forces f on the coordinates of the basis.

    Attributes
    ----------
    basis : BasisModes
    system : ndarray, shape (r, r)
        1/s.
    push : ndarray, shape (r, k)
    shapes : ndarray, shape (k, r)
        Coordinates of the basis for a unit of each y.
    start : ndarray, shape (r, k)
        y for a unit of each momentum of given displacements, ``M d``; that of given velocities is ``push``.
    oblique : float
        Norm, by the energies, of the projection of states on these motions: one if the others are orthogonal to them.
    """

    basis: BasisModes
    system: Array
    push: Array
    shapes: Array
    start: Array
    oblique: float

    @property
    def eigenvalues(self) -> NDArray[np.complex128]:
        """Eigenvalues s, rad/s."""
        return np.asarray(eigvals(self.system))

    def in_blocks(self) -> LowestMotions:
        """Return the same motions with a block of ``system`` for each mode, by ascending modulus of its eigenvalues.

        A pair ``a +- i b`` has ``[[a, b], [-b, a]]``, a real eigenvalue its number. Modes that meet, as at critical
        damping, at flutter and in rigid motions, share a block; motions that cannot be told apart stay as they are.
        """
        s = self.eigenvalues
        bases = [_invariant(self.system, s, number) for number in _together(s)]
        turn = np.hstack(bases)
        if turn.shape != self.system.shape or np.linalg.cond(turn) > _SLANTED:
            return self
        into = np.linalg.inv(turn)
        own = block_diag(*(np.ones((basis.shape[1],) * 2) for basis in bases)) > 0
        system = np.where(own, into @ self.system @ turn, 0.0)
        return replace(self, system=system, push=into @ self.push, shapes=self.shapes @ turn, start=into @ self.start)


def _together(s: NDArray[np.complex128]) -> list[NDArray[np.intp]]:
    """Return the numbers of the eigenvalues that lie together, conjugates included, by ascending modulus."""
    size = np.abs(s)
    upper = s.real + 1j * np.abs(s.imag)
    reach = np.maximum(_TOGETHER * np.minimum(size[:, None], size), _STILL * size.max())
    _, label = connected_components(np.abs(upper[:, None] - upper) <= reach, directed=False)
    groups = [np.flatnonzero(label == group) for group in range(label.max(initial=-1) + 1)]
    return sorted(groups, key=lambda group: float(size[group].min()))


def _invariant(system: Array, s: NDArray[np.complex128], group: NDArray[np.intp]) -> Array:
    """Return a basis of the motions of some of the eigenvalues; in that of a pair they are ``[[a, b], [-b, a]]``."""

    def own(real: float, imaginary: float) -> bool:
        return bool(np.abs(s - complex(real, imaginary)).argmin() in group)

    block, basis, number = schur(system, sort=own)
    basis = basis[:, :number]
    if number == 2 and block[0, 1] * block[1, 0] < 0.0:
        basis = basis * np.array([1.0, np.copysign(np.sqrt(-block[1, 0] / block[0, 1]), block[0, 1])])
    return np.asarray(basis)


def lowest_motions(problem: GeneralContinuum, modes: int, zeta: float, *, whole: bool = False) -> LowestMotions:
    """Return the motions of the 2 ``modes`` lowest eigenvalues, or one more where that would split a pair.

    With dampers of the strains (Kelvin-Voigt) eigenvalues accumulate and none of these can be omitted. Then all motions
    of a basis in which the first oscillating ones have converged are returned, except those that decay almost at once.

    Parameters
    ----------
    problem : GeneralContinuum
        Of one parameter set.
    modes : int
    zeta : float
        Modal damping ratio of the structure without dampers.
    whole : bool
        Return all motions of a basis for that many undamped modes where the eigenvalues do not converge or the modes
        are ill-conditioned: with an end that absorbs the waves, or nearly so, there are no eigenvalues, or the modes
        are almost linearly dependent.

    Raises
    ------
    ValueError
        If the eigenvalues do not converge, or modal damping is given for a structure without natural modes.
    """
    ((_, chosen, mesh, _),) = meshes(problem, 2 * modes, 1e-10)
    before: NDArray[np.complex128] | None = None
    worst, middle = np.inf, None
    for turn, finer in enumerate(sequence(mesh)):
        (one,) = reduced(chosen, finer)
        first, second = one.pencil()
        first, second = first[0], second[0]
        second[: len(one.stiffness[0]), : len(one.stiffness[0])] += modal_damping(one, zeta)
        s = _all_eigenvalues(first, second)
        if turn == _MIDDLE:
            middle = one, first, second, 2.0 * float(np.abs(s[-1]))
        if one.columns.resists_strains:
            swinging = s[s.imag > _SAME * np.abs(s)][:modes]
            if before is not None and (len(swinging) or turn > 1):
                worst = float((np.abs(matched(swinging[None], before[None])[0] / swinging - 1.0)).max(initial=0.0))
                if worst < _SETTLED:
                    radius = _AT_ONCE * float(np.abs(swinging[-1])) if len(swinging) else np.inf
                    return _invariant_subspaces(one, first, second, min(radius, 2.0 * float(np.abs(s[-1]))))
            before = s
            continue
        number = _cutoff(s, 2 * modes)
        if before is not None:
            near = matched(s[None, :number], before[None])[0]
            scale = np.maximum(np.abs(s[:number]), 1e-3)
            # coalescing eigenvalues are accurate to half the digits
            worst = float((np.abs(near - s[:number]) / scale).max())
            if worst < _SETTLED or _power_sum_difference(near, s[:number]) < _SETTLED:
                beyond = s[number] if number < len(s) else 4.0 * s[-1]
                found = _invariant_subspaces(one, first, second, float(np.sqrt(np.abs(s[number - 1] * beyond))))
                if not whole or found.oblique < _OBLIQUE:
                    return found
                return _invariant_subspaces(one, first, second, 2.0 * float(np.abs(s[-1])))
        before = s
        if whole and turn > _MIDDLE and worst > _ASTRAY:
            break
    if whole and middle is not None:
        return _invariant_subspaces(*middle)
    raise ValueError(
        f"modes = {modes}: the eigenvalues of so many modes converge to {worst:.1g} only; ask for fewer modes. An end "
        "that absorbs the waves leaves none"
    )


def _all_eigenvalues(first: Array, second: Array) -> NDArray[np.complex128]:
    """Return all eigenvalues by ascending modulus, in units of the rate."""
    mu = np.linalg.eigvals(np.linalg.solve(first + SHIFT * second, second))
    mu = mu[np.abs(mu) > 1e-13 * np.abs(mu).max()]
    s = SHIFT - 1.0 / mu
    return np.asarray(s[np.argsort(np.abs(s), kind="stable")], dtype=complex)


def _cutoff(s: NDArray[np.complex128], least: int) -> int:
    """Return the number of the lowest eigenvalues to take so that the next one has a larger modulus."""
    if len(s) < least:
        raise ValueError(f"modes = {least // 2}: the model has only {len(s)} eigenvalues")
    size, number = np.abs(s), least
    while number < len(s) - 1 and size[number] <= size[number - 1] * (1.0 + _SAME) + 1e-6:
        number += 1
    return number


def _power_sum_difference(near: NDArray[np.complex128], s: NDArray[np.complex128]) -> float:
    """Return the relative difference of the sums of s and of s^2, which are accurate where eigenvalues coalesce."""
    size = np.abs(s).sum()
    return float(max(abs((near - s).sum()) / size, abs((near**2 - s**2).sum()) / size**2))


def modal_damping(one: Reduced, zeta: float) -> Array | float:
    """Return the damping matrix of a ratio of every mode of the structure without dampers, in units of the rate."""
    if not zeta:
        return 0.0
    stiffness, root = one.stiffness[0], one.root_mass[0]
    elastic = len(root) - one.rigid
    k = stiffness[:elastic, :elastic]
    size, frame = np.linalg.eigh(0.5 * (k + k.T))
    if np.abs(stiffness - stiffness.T).max() > 1e-9 * np.abs(stiffness).max() or (size <= 0.0).any():
        raise ValueError("zeta: a structure whose forces have no potential has no natural modes to damp; use dampers")
    half = (frame * np.sqrt(size)) @ frame.T
    inverse = (frame / np.sqrt(size)) @ frame.T
    value, turn = np.linalg.eigh(inverse @ (root[:elastic, None] ** 2 * inverse))
    found = np.zeros_like(stiffness)
    found[:elastic, :elastic] = 2.0 * zeta * half @ ((turn * np.sqrt(np.maximum(value, 0.0))) @ turn.T) @ half
    return np.asarray(found)


def _invariant_subspaces(one: Reduced, first: Array, second: Array, radius: float) -> LowestMotions:
    rate, k = float(one.rate[0]), one.root_mass.shape[1]
    shifted = first + SHIFT * second

    def lowest(real: float, imaginary: float) -> bool:
        mu = complex(real, imaginary)
        return mu != 0.0 and abs(SHIFT - 1.0 / mu) <= radius

    # (A + shift B)^-1 B has the motions as invariant subspace, (A + shift B)^-T B^T the test functions
    _, right, number = schur(solve(shifted, second), sort=lowest)
    _, left, same = schur(solve(shifted.T, second.T), sort=lowest)
    if number != same:
        raise ArithmeticError("modes: the eigenvalues lie too close together to be told apart; ask for other modes")
    right, left = right[:, :number], left[:, :number]
    project = left.T @ second
    inverse = np.linalg.inv(project @ right)
    system = -inverse @ (left.T @ first @ right)
    root = one.root_mass[0]
    light = root < _LIGHT * root.max()
    per_root = np.where(light, 0.0, 1.0 / np.where(light, 1.0, root))
    units = np.zeros((len(first), k))  # w = (d, e, g) of static displacements
    units[:k] = np.diag(per_root**2)
    units[2 * k :] = np.maximum(one.constants[0], 1.0)[:, None] * (first[2 * k :, :k] @ units[:k])
    return LowestMotions(
        BasisModes(one),
        rate * system,
        rate * inverse @ left[:k].T,
        right[:k],
        rate**2 * inverse @ (project @ units),
        float(np.linalg.norm(right @ (inverse @ project), 2)),
    )
