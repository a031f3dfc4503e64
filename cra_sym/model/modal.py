"""Mode shapes and modal quantities as numbers, from the derived kernels; dimensionless, for xi = x / L."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.resources import files
from typing import Any

import numpy as np

from cra_sym.kernels import Kernel, compiled, derived_kernel
from cra_sym.model.spectrum import flattened, in_parts, pair, wants_compiler

__all__ = [
    "COMPLIANCES",
    "ENDS",
    "INERTIAS",
    "NEAR",
    "SPRINGS",
    "STRAIN",
    "Modes",
    "modes_of",
    "near_shape",
    "tip_factors",
]

NEAR = 25.0  # shapes.NEAR; a test holds the two together

_POLYNOMIALS, _TIP_ROWS, _TIP_NEAR, _AMPLITUDES_FAR, _TIP_FAR, _SHAPE_FAR, _MASS = (
    derived_kernel(f"cra_sym.model.shapes:{name}")
    for name in ("polynomials", "tip_rows", "tip_near", "amplitudes_far", "tip_far", "shape_far", "generalised_mass")
)


ENDS, STATE, STRAIN = slice(0, 7), slice(3, 11), slice(11, 13)
"""Rows of a table of modes: tip (2), participation and root (4); root and waves (4); strain (2)."""
SPRINGS, COMPLIANCES, INERTIAS = slice(13, 17), slice(17, 19), slice(19, 23)
"""Rows of rates: by kappa_t and kappa_r, then logarithmic; by their inverses; by mu and iota, then logarithmic."""
_ROWS = 13  # of a table without the rates


@dataclass(frozen=True, eq=False)
class Modes:
    """Modes of unit generalised mass, phi(1) >= 0; what is asked for has one entry a mode and is computed then.

    Attributes
    ----------
    lam : ndarray, shape (..., modes)
        Frequency parameter.
    groups : tuple of ndarray, shape (arms,)
        kappa_t, kappa_r, mu and iota.
    compile, threads
        As in `cra_sym.model.spectrum.frequency_parameters`, decided.
    """

    lam: np.ndarray
    groups: tuple[np.ndarray, ...]
    compile: bool
    threads: int | None

    def quantities(self, rows: slice, units: Sequence[float | np.ndarray] | None = None) -> np.ndarray:
        """Return some of the rows of the table, each times its unit, which is a number or has the shape of the batch.

        The table holds phi and phi' at the tip; the integral of phi over the arm, the tip mass included; phi and its
        first three derivatives at the joint; the coefficients of cos, sin, exp(-lam xi), exp(-lam (1 - xi)) where lam^4
        is over `NEAR`; and the square roots of kappa phi^2 and of kappa phi'^2 at the joint, signed, 0 for infinite
        stiffness. Rates follow from these by first-order perturbation: those of z = lam^4 by a parameter, over lam^2,
        and half of those of ln z by its logarithm.
        """
        shape = rows.stop - rows.start, *self.lam.shape
        if not self.compile:
            table = (self._table[rows] if rows.stop <= _ROWS else self._rates(rows)).reshape(shape)
            return table if units is None else table * _columns(units, self.lam.shape[:-1])
        lam = np.ascontiguousarray(self.lam).reshape(-1, shape[-1])
        by_arm = np.ones((1, shape[0])) if units is None else _columns(units, self.lam.shape[:-1])
        by_arm = np.ascontiguousarray(by_arm.reshape(shape[0], -1).T)
        table = np.empty((shape[0], *lam.shape))
        fill = _template().fill

        def fill_part(part: slice) -> None:
            fill(table, rows.start, by_arm, lam, *self.groups, part.start, part.stop)

        in_parts(fill_part, *lam.shape, threads=self.threads, compiled=True)
        return table.reshape(shape)

    @cached_property
    def _table(self) -> np.ndarray:
        """All quantities by NumPy, block by block."""
        modes, lam, table = self.lam.shape[-1], self.lam.reshape(-1), np.empty((_ROWS, self.lam.size))

        def fill_part(part: slice) -> None:
            roots = slice(part.start * modes, part.stop * modes)
            _fill(table[:, roots], lam[roots], modes, *(x[part] for x in self.groups))

        in_parts(fill_part, len(self.groups[0]), modes, threads=None, compiled=False)
        return table

    def _rates(self, rows: slice) -> np.ndarray:
        tip, slope, _, displacement, turn, moment, shear = self._table[ENDS]
        by_t, by_r = self._table[STRAIN]
        square = self.lam.reshape(-1) ** 2
        mu, iota = (np.repeat(value, self.lam.shape[-1]) for value in self.groups[2:])
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            springs = displacement**2 / square, turn**2 / square, (by_t / square) ** 2 / 2, (by_r / square) ** 2 / 2
            compliances = -(shear**2) / square, -(moment**2) / square
        inertias = -(tip**2) * square, -(slope**2) * square, -mu * tip**2 / 2, -iota * slope**2 / 2
        return np.array([*springs, *compliances, *inertias][rows.start - _ROWS : rows.stop - _ROWS])

    @cached_property
    def state(self) -> np.ndarray:
        """phi and its first three derivatives at the joint, and the four coefficients of waves."""
        return self.quantities(STATE)

    def lanes(self, part: slice) -> Modes:
        """Return some of the arms, the batch axes taken as one."""
        modes = self.lam.shape[-1]
        some = Modes(self.lam.reshape(-1, modes)[part], tuple(x[part] for x in self.groups), self.compile, self.threads)
        if not self.compile:  # the table is there or will be needed
            some.__dict__["_table"] = self._table.reshape(_ROWS, -1, modes)[:, part].reshape(_ROWS, -1)
        return some

    def shape(self, xi: np.ndarray, derivative: int = 0) -> np.ndarray:
        """Return a derivative of every shape by xi at points that broadcast on a new last axis."""
        lam, xi = np.broadcast_arrays(self.lam[..., None], xi)
        near = lam**4 < NEAR
        result = np.empty(lam.shape)
        state = np.broadcast_to(self.state[..., None], (8, *lam.shape))
        result[near] = near_shape(state[:4, near], lam[near] ** 4, xi[near], derivative)
        result[~near] = _far_shape(state[4:, ~near], lam[~near], xi[~near], derivative)
        return result


def _columns(units: Sequence[float | np.ndarray], shape: tuple[int, ...]) -> np.ndarray:
    """Return the units of rows as an array (rows, ..., 1), or (rows, 1) if they are the same for the whole batch."""
    if all(np.ndim(unit) == 0 for unit in units):
        return np.array(units).reshape(-1, *(1 for _ in shape), 1)
    return np.array([np.broadcast_to(unit, shape) for unit in units])[..., None]


def modes_of(
    kappa_t: np.ndarray,
    kappa_r: np.ndarray,
    mu: np.ndarray,
    iota: np.ndarray,
    *,
    lam: np.ndarray,
    compile: bool | None = None,
    threads: int | None = None,
) -> Modes:
    """Return the modes of arms, given all their first frequency parameters.

    Parameters
    ----------
    kappa_t, kappa_r, mu, iota : ndarray, shape (...)
    lam : ndarray, shape (..., modes)
    compile, threads
        As in `cra_sym.model.spectrum.frequency_parameters`.
    """
    groups = flattened(kappa_t, kappa_r, mu, iota)
    compile = wants_compiler(lam.size, _template_parts) if compile is None else compile
    return Modes(lam, groups, compile, threads)


def _fill(table: np.ndarray, lam: np.ndarray, modes: int, *groups: np.ndarray) -> None:
    """Fill the rows of the table for every mode."""
    kappa_t, kappa_r, mu, iota = (np.repeat(value, modes) for value in groups)
    pairs = np.array([x for value in (kappa_t, kappa_r, mu, iota) for x in pair(value)])
    _fill_from_pairs(table, lam, modes, pairs, mu, iota)


def _fill_from_pairs(
    table: np.ndarray, lam: np.ndarray, modes: int, pairs: np.ndarray, mu: np.ndarray, iota: np.ndarray
) -> None:
    """Fill the table; complex values carry a derivative along in their imaginary parts, see `tip_factors`."""
    alpha, beta, tip, waves = (np.zeros((*rows, lam.size), lam.dtype) for rows in ((), (), (4,), (4,)))
    near = lam**4 < NEAR
    alpha[near], beta[near], tip[:, near] = _near(pairs[:, near], lam[near])
    alpha[~near], beta[~near], tip[:, ~near], waves[:, ~near] = _far(pairs[:, ~near], lam[~near])
    s_t, c_t, s_r, c_r = pairs[:4]
    _rigid(alpha, beta, tip, modes, s_t + s_r == 0, mu)
    root = np.array([c_t * alpha, c_r * beta, s_r * beta, -s_t * alpha])
    displacement, slope = _tip_state(tip, mu, iota, lam)
    invariant = _invariant(near, root, waves, lam)
    with np.errstate(divide="ignore", invalid="ignore"):
        (mass,) = _MASS.function(*pairs[:4], alpha, beta, lam**4, invariant, displacement, slope, mu, iota)
        participation = -root[3] / lam**4  # the joint's force is what moves the arm
    a, s, rigid = root[0], root[1], lam == 0
    mass = np.where(rigid, a * a + a * s + s * s / 3 + mu * (a + s) ** 2 + iota * s * s, mass)
    participation = np.where(rigid, a + s / 2 + mu * (a + s), participation)
    table[0], table[1], table[2], table[3:7], table[7:11] = displacement, slope, participation, root, waves
    table[11], table[12] = np.sqrt(s_t * c_t) * alpha, np.sqrt(s_r * c_r) * beta
    table *= np.where(displacement < 0, -1.0, 1.0) / np.sqrt(mass)
    table += 0.0  # -0.0 becomes 0.0


def tip_factors(lam: np.ndarray, pairs: np.ndarray, mu: np.ndarray, iota: np.ndarray) -> np.ndarray:
    """Return the integral of phi over the arm, tip mass included, times phi at the tip: a pure number of each mode.

    Parameters
    ----------
    lam : ndarray, shape (..., modes)
    pairs : ndarray, shape (8, ..., modes)
        (value, 1) / (1 + value) of kappa_t, kappa_r, mu and iota.
    mu, iota : ndarray, shape (..., modes)

    Notes
    -----
    Analytic in all of them: a change along the frequency equation, put as a tiny imaginary part, comes back as the
    derivative in the imaginary part, with no difference taken.
    """
    table = np.empty((_ROWS, lam.size), lam.dtype)
    flat = [value.reshape(-1) for value in (lam, mu, iota)]
    _fill_from_pairs(table, flat[0], lam.shape[-1], pairs.reshape(8, -1), flat[1], flat[2])
    return (table[2] * table[0]).reshape(lam.shape)


def _invariant(near: np.ndarray, root: np.ndarray, waves: np.ndarray, lam: np.ndarray) -> np.ndarray:
    """Return what `shapes.generalised_mass` says is the same at every point, from what describes the shape best."""
    from_root = root[2] ** 2 - 2 * root[1] * root[3] + lam**4 * root[0] ** 2
    from_waves = 2 * lam**4 * (waves[0] ** 2 + waves[1] ** 2 + 4 * waves[2] * waves[3] * np.exp(-lam))
    return np.where(near, from_root, from_waves)


def _near(pairs: np.ndarray, lam: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the amplitudes and the tip's state, from whichever tip condition cancels less."""
    z = lam**4
    krylov = _POLYNOMIALS.function(np.ones_like(z), z)
    rows = np.array(_TIP_ROWS.function(*pairs, z, *krylov)).reshape(
        2, 2, 2, -1
    )  # condition, amplitude, (entry, magnitude)
    entry, magnitude = rows[:, :, 0], rows[:, :, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        loss = np.where(magnitude > 0, magnitude / np.abs(entry), 1.0).max(axis=1)
    loss[~entry.any(axis=1)] = np.inf
    row = np.where(loss[0] <= loss[1], entry[0], entry[1])
    row /= np.maximum(np.abs(row).max(axis=0), np.finfo(float).tiny)
    alpha, beta = row[1], -row[0]
    return alpha, beta, np.array(_TIP_NEAR.function(*pairs[:4], alpha, beta, z, *krylov))


def _far(pairs: np.ndarray, lam: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the amplitudes, the tip's state and the wave amplitudes."""
    waving = lam, np.cos(lam), np.sin(lam), np.exp(-lam)
    alpha, beta, *waves = _AMPLITUDES_FAR.function(*pairs, *waving)
    scale = np.sqrt(waves[0] ** 2 + waves[1] ** 2)
    alpha, beta, *waves = (x / scale for x in (alpha, beta, *waves))
    return alpha, beta, np.array(_TIP_FAR.function(*waves, *waving)), np.array(waves)


def _rigid(alpha: np.ndarray, beta: np.ndarray, tip: np.ndarray, modes: int, free: np.ndarray, mu: np.ndarray) -> None:
    """Fill in the two-fold rigid-body mode of a free arm: translation, and rotation about the centre of mass."""
    number = np.arange(alpha.size) % modes
    one, two = free & (number == 0), free & (number == 1)
    alpha[one], beta[one] = 1.0, 0.0
    alpha[two], beta[two] = -(0.5 + mu[two]) / (1 + mu[two]), 1.0
    rigid = one | two
    tip[0, rigid], tip[1, rigid] = alpha[rigid] + beta[rigid], beta[rigid]


def _tip_state(tip: np.ndarray, mu: np.ndarray, iota: np.ndarray, lam: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return displacement and slope at the tip; heavy end-effectors keep them small, and shear and moment know them."""
    z = lam**4
    with np.errstate(divide="ignore", invalid="ignore"):
        displacement = np.where(mu * z > 1 + lam**3, -tip[3] / (mu * z), tip[0])
        slope = np.where(iota * z > 1 + lam, tip[2] / (iota * z), tip[1])
    return displacement, slope


def near_shape(root: np.ndarray, z: np.ndarray, xi: np.ndarray, derivative: int) -> np.ndarray:
    """Return a derivative by xi of the solution with the given state (4, ...) at the root, for z up to `NEAR`."""
    solutions = _POLYNOMIALS.function(xi, z)
    return sum(root[j] * z ** ((derivative - j + 3) // 4) * solutions[(j - derivative) % 4] for j in range(4))


def _far_shape(waves: np.ndarray, lam: np.ndarray, xi: np.ndarray, derivative: int) -> np.ndarray:
    return _SHAPE_FAR.function(*waves, lam, xi)[derivative]


@cache
def _template() -> Any:
    return compiled(*_template_parts())


@cache
def _template_parts() -> tuple[str, dict[str, Kernel]]:
    text = files("cra_sym.model").joinpath("modal_lanes.py").read_text(encoding="utf-8")
    names = "polynomials", "tip_rows", "tip_near", "amplitudes_far", "tip_far", "generalised_mass"
    kernels = _POLYNOMIALS, _TIP_ROWS, _TIP_NEAR, _AMPLITUDES_FAR, _TIP_FAR, _MASS
    return text, dict(zip(names, kernels, strict=True))
