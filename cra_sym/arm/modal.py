"""Mode shapes and modal quantities as numbers, from the derived kernels; dimensionless, for xi = x / L."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from cra_sym.arm.spectrum import in_parts, pair, wants_compiler
from cra_sym.kernels import Kernel, compiled, derived_kernel

__all__ = ["NEAR", "Modes", "modes_of", "near_shape", "tip_factors"]

NEAR = 25.0  # shapes.NEAR; a test holds the two together

_POLYNOMIALS, _TIP_ROWS, _TIP_NEAR, _AMPLITUDES_FAR, _TIP_FAR, _SHAPE_FAR, _MASS = (
    derived_kernel(f"cra_sym.arm.shapes:{name}")
    for name in ("polynomials", "tip_rows", "tip_near", "amplitudes_far", "tip_far", "shape_far", "generalised_mass")
)


@dataclass(frozen=True)
class Modes:
    """Modes of unit generalised mass, phi(1) >= 0; every array has one entry a mode.

    Attributes
    ----------
    lam : ndarray
        Frequency parameter.
    root : ndarray, shape (4, ...)
        phi and its first three derivatives at the joint.
    tip : ndarray, shape (2, ...)
        phi and phi' at the tip.
    waves : ndarray, shape (4, ...)
        Coefficients of cos, sin, exp(-lam xi), exp(-lam (1 - xi)), where lam^4 is over `NEAR`.
    strain : ndarray, shape (2, ...)
        Square roots of kappa phi^2 and of kappa phi'^2 at the joint, signed; 0 for infinite stiffness.
    participation : ndarray
        Integral of phi over the arm, the tip mass included.
    """

    lam: np.ndarray
    root: np.ndarray
    tip: np.ndarray
    waves: np.ndarray
    strain: np.ndarray
    participation: np.ndarray

    def lanes(self, part: slice) -> Modes:
        """Return some of the arms, the batch axes taken as one."""
        modes = self.lam.shape[-1]
        values = (getattr(self, field.name) for field in fields(self))
        return Modes(*(x.reshape(*x.shape[: x.ndim - self.lam.ndim], -1, modes)[..., part, :] for x in values))

    def shape(self, xi: np.ndarray, derivative: int = 0) -> np.ndarray:
        """Return a derivative of every shape by xi at points that broadcast on a new last axis."""
        lam, xi = np.broadcast_arrays(self.lam[..., None], xi)
        near = lam**4 < NEAR
        result = np.empty(lam.shape)
        root, waves = (np.broadcast_to(x[..., None], (4, *lam.shape)) for x in (self.root, self.waves))
        result[near] = near_shape(root[:, near], lam[near] ** 4, xi[near], derivative)
        result[~near] = _far_shape(waves[:, ~near], lam[~near], xi[~near], derivative)
        return result


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
        As in `cra_sym.arm.spectrum.frequency_parameters`.
    """
    groups = [np.ascontiguousarray(value).reshape(-1) for value in (kappa_t, kappa_r, mu, iota)]
    modes = lam.shape[-1]
    rows, table = lam.reshape(-1, modes), np.empty((13, lam.size))
    compile = wants_compiler(lam.size, _template_parts) if compile is None else compile
    fill = _template().fill if compile else _fill

    def fill_part(part: slice) -> None:
        columns = table[:, part.start * modes : part.stop * modes]
        fill(columns, rows[part].reshape(-1), modes, *(x[part] for x in groups))

    in_parts(fill_part, len(rows), modes, threads=threads if compile else None, compiled=compile)
    parts = table[:4], table[4:6], table[6:10], table[10:12], table[12]
    return Modes(lam, *(x.reshape(*x.shape[:-1], *lam.shape) for x in parts))


def _fill(table: np.ndarray, lam: np.ndarray, modes: int, *groups: np.ndarray) -> None:
    """Fill the rows of the table: root (4), tip (2), waves (4), strain (2) and participation of every mode."""
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
    table[:4], table[4], table[5], table[6:10] = root, displacement, slope, waves
    table[10], table[11], table[12] = np.sqrt(s_t * c_t) * alpha, np.sqrt(s_r * c_r) * beta, participation
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
    table = np.empty((13, lam.size), lam.dtype)
    flat = [value.reshape(-1) for value in (lam, mu, iota)]
    _fill_from_pairs(table, flat[0], lam.shape[-1], pairs.reshape(8, -1), flat[1], flat[2])
    return (table[12] * table[4]).reshape(lam.shape)


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
    text = files("cra_sym.arm").joinpath("modal_lanes.py").read_text(encoding="utf-8")
    names = "polynomials", "tip_rows", "tip_near", "amplitudes_far", "tip_far", "generalised_mass"
    kernels = _POLYNOMIALS, _TIP_ROWS, _TIP_NEAR, _AMPLITUDES_FAR, _TIP_FAR, _MASS
    return text, dict(zip(names, kernels, strict=True))
