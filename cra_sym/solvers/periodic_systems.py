"""Batches of second-order equations with periodic coefficients, the input of :mod:`cra_sym.solvers.periodic`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from cra_sym.solvers.floquet import Oscillation, flat

__all__ = ["LIGHTEST", "PeriodicSystem", "Sizes", "Swing"]

Array = NDArray[np.float64]
LIGHTEST = 1e-3
"""Least share of the mass that remains, in estimates."""
_Four: TypeAlias = tuple[Array | None, Array | None, Array | None, Array | None]
_SAME = 1e-14
"""Relative size of off-diagonal entries below which a matrix counts as diagonal."""


@dataclass(frozen=True)
class Swing:
    """One oscillating term; matrices (N, N, points) or (N, N, 1), None if zero.

    Attributes
    ----------
    oscillation : Oscillation
    size : ndarray, shape (points,)
        epsilon times the power of varpi.
    stiffness, damping, momentum, mass : ndarray or None
        K_r, C_r, B_r, M_r.
    compliance : ndarray, shape (points,), optional
        lambda_r, of a term whose only matrix is the stiffness.
    """

    oscillation: Oscillation
    size: Array
    stiffness: Array | None
    damping: Array | None
    momentum: Array | None
    mass: Array | None
    compliance: Array | None = None

    @property
    def only_stiffness(self) -> bool:
        """Whether only the stiffness oscillates."""
        return self.damping is None and self.momentum is None and self.mass is None

    def take(self, index: NDArray[np.intp]) -> Swing:
        """Return some of the systems."""
        matrices = (self.stiffness, self.damping, self.momentum, self.mass)
        k, c, b, m = (_some(matrix, index) for matrix in matrices)
        soft = None if self.compliance is None else self.compliance[index]
        return Swing(self.oscillation, self.size[index], k, c, b, m, soft)


@dataclass(frozen=True)
class PeriodicSystem:
    """A flat batch of systems, the batch axis last.

    Attributes
    ----------
    stiffness, damping : ndarray, shape (N, N, points) or (N, N, 1)
        K and C.
    swings : tuple of Swing
    period : ndarray, shape (points,)
    """

    stiffness: Array
    damping: Array
    swings: tuple[Swing, ...]
    period: Array

    @classmethod
    def of(
        cls,
        stiffness: Any,
        damping: Any,
        drives: Sequence[tuple[Oscillation, Sequence[Any]]],
        angular_frequency: Any,
        epsilon: Any,
        compliance: Any = None,
    ) -> tuple[PeriodicSystem, tuple[int, ...]]:
        """Return the batch and its shape.

        Parameters
        ----------
        stiffness, damping : array_like, shape (..., N, N)
        drives : sequence of (oscillation, (stiffness, damping, momentum, mass))
            Matrices (..., N, N) or None.
        angular_frequency, epsilon : array_like, shape (...)
            varpi, rad/s, positive; epsilon.
        compliance : array_like, shape (..., R), optional
            lambda_r of each drive, whose only matrix is then the stiffness.
        """
        soft = np.zeros(0) if compliance is None else np.asarray(compliance, float)
        given = [np.asarray(m, float) for m in (stiffness, damping)]
        some = [np.asarray(m, float) for _, matrices in drives for m in matrices if m is not None]
        varpi, epsilon = np.asarray(angular_frequency, float), np.asarray(epsilon, float)
        shape = np.broadcast_shapes(
            *(m.shape[:-2] for m in (*given, *some)), varpi.shape, epsilon.shape, soft.shape[:-1]
        )

        def columns(matrix: Any) -> Array | None:
            if matrix is None:
                return None
            matrix = np.asarray(matrix, float)
            single = matrix.size == matrix.shape[-1] * matrix.shape[-2]
            return matrix.reshape(*matrix.shape[-2:], 1) if single else flat(matrix, shape, 2)

        frequency, size = flat(varpi, shape, 0), flat(epsilon, shape, 0)
        waves = _joined(drives) if compliance is None else drives
        swings = tuple(
            Swing(
                wave,
                size * frequency**wave.power,
                *cast(_Four, tuple(map(columns, matrices))),
                None if compliance is None else flat(soft[..., r], shape, 0),
            )
            for r, (wave, matrices) in enumerate(_in_phase(waves))
        )
        whole = [columns(matrix) for matrix in given]
        assert whole[0] is not None and whole[1] is not None
        batch = cls(whole[0], whole[1], swings, 2 * np.pi / frequency)
        batch.check_mass()
        batch.check_compliance()
        return batch, shape

    def take(self, index: NDArray[np.intp]) -> PeriodicSystem:
        """Return some of the systems."""
        stiffness, damping = (_some(matrix, index) for matrix in (self.stiffness, self.damping))
        assert stiffness is not None and damping is not None
        return PeriodicSystem(stiffness, damping, tuple(s.take(index) for s in self.swings), self.period[index])

    def check_mass(self) -> None:
        """Raise an error if the mass may not be positive throughout the period."""
        total = np.zeros_like(self.period)
        for swing in self.swings:
            if swing.mass is not None:
                total = total + np.abs(swing.size) * np.linalg.norm(np.moveaxis(swing.mass, -1, 0), 2, axis=(-2, -1))
        if (total >= 1.0).any():
            raise ValueError(
                f"epsilon: the mass fluctuates by {total.max():.3g} times itself; must be less than once, so that it "
                "stays positive"
            )

    def check_compliance(self) -> None:
        """Raise an error if the stiffness in series may vanish within the period."""
        for swing in self.swings:
            if swing.compliance is not None and (np.abs(swing.size * swing.compliance) >= 1.0).any():
                raise ValueError(
                    f"epsilon: a spring that fluctuates by {np.abs(swing.size).max():.3g} times itself and the static "
                    "flexibility of the omitted modes cancel each other within the period; must be less, or take more "
                    "modes"
                )

    def parity(self) -> NDArray[np.int8] | None:
        """Return signs of q by which the first half of a period gives the second, None if there are none.

        With all cosines even in time, these signs must transpose the constant matrices and the oscillating stiffnesses
        and masses, and transform every oscillating damping matrix to the transpose of its momentum matrix.
        """
        if any(s.oscillation.kind == "sin" for s in self.swings):
            return None
        pairs = [
            (m, m) for m in (self.stiffness, self.damping, *(m for s in self.swings for m in (s.stiffness, s.mass)))
        ]
        pairs += [(s.damping, s.momentum) for s in self.swings]
        size = len(self.stiffness)
        same, opposite = np.zeros((2, size, size), bool)  # signs of two
        for matrix, other in pairs:
            if matrix is None and other is None:
                continue
            if matrix is None or other is None:
                return None
            turned = other.swapaxes(0, 1)
            there = ((matrix != 0) | (turned != 0)).any(axis=-1)
            even, odd = ((matrix == sign * turned).all(axis=-1) for sign in (1, -1))
            if (there & ~even & ~(odd & ~np.eye(size, dtype=bool))).any():
                return None
            same, opposite = same | (there & even), opposite | (there & ~even)
        signs = np.zeros(size, np.int8)
        while not signs.all():
            fresh = [int(np.argmin(signs != 0))]
            signs[fresh] = 1
            while fresh:
                row = fresh.pop()
                for sign, joined in ((1, same[row]), (-1, opposite[row])):
                    found = np.nonzero(joined & (signs == 0))[0]
                    signs[found] = sign * signs[row]
                    fresh.extend(found.tolist())
        product = signs[:, None] * signs
        return None if (same & (product < 0)).any() or (opposite & (product > 0)).any() else signs

    @property
    def conservative(self) -> bool:
        """Whether p + C q / 2 are the canonical momenta of a Hamiltonian, for the momenta p of the equations."""
        pairs = [(self.stiffness, self.stiffness, 1), (self.damping, self.damping, -1)]
        for s in self.swings:
            pairs += [(m, m, 1) for m in (s.stiffness, s.mass) if m is not None]
            if (s.damping is None) != (s.momentum is None):
                return False
            if s.damping is not None and s.momentum is not None:
                pairs.append((s.damping, s.momentum, -1))
        return all(bool((matrix == sign * other.swapaxes(0, 1)).all()) for matrix, other, sign in pairs)

    @property
    def reversible(self) -> bool:
        """Whether the motions backwards in time are motions: nothing depends on velocities, and all waves are even."""
        only = all(s.damping is None and s.momentum is None and s.oscillation.kind == "cos" for s in self.swings)
        return only and not self.damping.any()

    def in_axes_of_mass(self, parity: NDArray[np.int8] | None = None) -> tuple[PeriodicSystem, Array | None]:
        """Return the system in axes that make all oscillating masses diagonal, and these axes, or None.

        With the signs of :meth:`parity` each axis is one of coordinates of one sign, so that the signs hold there too.
        """
        masses = [s.mass[..., 0] for s in self.swings if s.mass is not None and s.mass.shape[-1] == 1]
        if not masses or len(masses) < sum(s.mass is not None for s in self.swings):
            return self, None
        if not all(np.array_equal(mass, mass.T) for mass in masses):
            return self, None
        mixed, axes = np.zeros((2, *masses[0].shape))
        for k, mass in enumerate(masses, 1):
            mixed += mass / (k + np.linalg.norm(mass))
        for sign in (1,) if parity is None else (1, -1):
            some_axes = np.arange(len(axes)) if parity is None else np.nonzero(parity == sign)[0]
            part = np.ix_(some_axes, some_axes)
            axes[part] = np.linalg.eigh(mixed[part])[1]

        def turned(matrix: Array) -> Array:
            return np.asarray(np.einsum("ji,jkp,kl->ilp", axes, matrix, axes))

        def some(matrix: Array | None) -> Array | None:
            return None if matrix is None else turned(matrix)

        one = np.eye(len(axes))[..., None]

        for mass in masses:
            off = axes.T @ mass @ axes
            if np.abs(off - np.diag(np.diag(off))).max() > _SAME * np.linalg.norm(mass):
                return self, None
        swings = tuple(
            Swing(
                *(s.oscillation, s.size, some(s.stiffness), some(s.damping), some(s.momentum)),
                None if s.mass is None else one * turned(s.mass),
                s.compliance,
            )
            for s in self.swings
        )
        return PeriodicSystem(turned(self.stiffness), turned(self.damping), swings, self.period), axes

    def rate(self, *, still: bool = False) -> Array:
        """Return a bound of the rate of all motions, 1/s, shape (points,); ``still``: without what oscillates."""
        sizes = self.sizes()
        if still:
            sizes = Sizes(sizes.still, *(0.0 * part for part in sizes[1:]))
        light = 1.0 / np.maximum(1.0 - sizes.mass.sum(axis=0), LIGHTEST)
        own, swung = sizes.still, sizes.damping.sum(axis=0) + sizes.momentum.sum(axis=0)
        turns = max((s.oscillation.order for s in self.swings), default=1)
        swung_stiffness = (sizes.stiffness / np.maximum(1.0 - sizes.softness, LIGHTEST)).sum(axis=0)
        moved = np.sqrt((own[0] + swung_stiffness) * light) + (own[1] + swung) * light
        return np.asarray(moved + 2 * np.pi * turns / self.period)

    def sizes(self) -> Sizes:
        """Return norms of the constant and of the oscillating matrices."""
        points = self.period.size
        still = np.array([np.broadcast_to(norm_bound(m), points) for m in (self.stiffness, self.damping)])

        def rows(name: str) -> Array:
            found = [np.abs(s.size) * np.broadcast_to(norm_bound(getattr(s, name)), points) for s in self.swings]
            return np.array(found).reshape(len(self.swings), points)

        softness = [np.zeros(points) if s.compliance is None else np.abs(s.size * s.compliance) for s in self.swings]
        soft = np.array(softness).reshape(len(self.swings), points)
        return Sizes(still, rows("stiffness"), rows("damping"), rows("momentum"), rows("mass"), soft)


class Sizes(NamedTuple):
    """Norms of a batch: ``still`` of K and C, shape (2, points); of the oscillating matrices one row per term.

    ``softness`` is the largest of lambda_r times epsilon times the oscillation.
    """

    still: Array
    stiffness: Array
    damping: Array
    momentum: Array
    mass: Array
    softness: Array


def _joined(
    drives: Sequence[tuple[Oscillation, Sequence[Any]]],
) -> list[tuple[Oscillation, list[Any]]]:
    """Return one drive for each oscillation, its matrices summed."""
    found: dict[Oscillation, list[Any]] = {}
    for wave, matrices in drives:
        sums = found.setdefault(wave, [None] * len(matrices))
        for k, matrix in enumerate(matrices):
            if matrix is not None:
                sums[k] = matrix if sums[k] is None else np.asarray(sums[k]) + matrix
    return list(found.items())


def _in_phase(drives: Sequence[tuple[Oscillation, Any]]) -> list[tuple[Oscillation, Any]]:
    """Return sines of one frequency as cosines, a quarter of a period later, which are even in time."""
    if {wave.kind for wave, _ in drives} == {"sin"} and len({wave.order for wave, _ in drives}) == 1:
        return [(wave._replace(kind="cos"), matrices) for wave, matrices in drives]
    return list(drives)


def _some(matrix: Array | None, index: NDArray[np.intp]) -> Array | None:
    return matrix if matrix is None or matrix.shape[-1] == 1 else matrix[..., index]


def norm_bound(matrix: Array | None) -> Array:
    """Return a bound of the spectral norm, shape (points,) or (1,)."""
    if matrix is None:
        return np.zeros(1)
    sizes = np.abs(matrix)
    sums = np.sqrt(sizes.sum(axis=1).max(axis=0) * sizes.sum(axis=0).max(axis=0))
    return np.asarray(np.fmin(sums, np.sqrt((sizes**2).sum(axis=(0, 1)))))
