"""Mode shapes and modal quantities as numbers, from the derived kernels; dimensionless, for xi = x / L."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cra_sym.arm.spectrum import pair
from cra_sym.kernels import derived_kernel

__all__ = ["NEAR", "Modes", "modes_of"]

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

    def shape(self, xi: np.ndarray, derivative: int = 0) -> np.ndarray:
        """Return a derivative of every shape by xi at points that broadcast on a new last axis."""
        lam, xi = np.broadcast_arrays(self.lam[..., None], xi)
        near = lam**4 < NEAR
        result = np.empty(lam.shape)
        root, waves = (np.broadcast_to(x[..., None], (4, *lam.shape)) for x in (self.root, self.waves))
        result[near] = _near_shape(root[:, near], lam[near], xi[near], derivative)
        result[~near] = _far_shape(waves[:, ~near], lam[~near], xi[~near], derivative)
        return result


def modes_of(kappa_t: np.ndarray, kappa_r: np.ndarray, mu: np.ndarray, iota: np.ndarray, *, lam: np.ndarray) -> Modes:
    """Return the modes of arms, given all their first frequency parameters.

    Parameters
    ----------
    kappa_t, kappa_r, mu, iota : ndarray, shape (...)
    lam : ndarray, shape (..., modes)
    """
    values = [np.broadcast_to(value[..., None], lam.shape).ravel() for value in (kappa_t, kappa_r, mu, iota)]
    pairs = np.array([x for value in values for x in pair(value)])
    flat = lam.ravel()
    alpha, beta, tip, waves, mass, participation = (
        np.zeros((*lead, flat.size)) for lead in ((), (), (4,), (4,), (), ())
    )
    near = flat**4 < NEAR
    alpha[near], beta[near], tip[:, near] = _near(pairs[:, near], flat[near])
    alpha[~near], beta[~near], tip[:, ~near], waves[:, ~near] = _far(pairs[:, ~near], flat[~near])
    _rigid(alpha, beta, tip, (kappa_t == 0) & (kappa_r == 0), lam.shape, values[2])
    s_t, c_t, s_r, c_r = pairs[:4]
    z = flat**4
    root = np.array([c_t * alpha, c_r * beta, s_r * beta, -s_t * alpha])
    displacement, slope = _tip_state(tip, values[2], values[3], flat)
    invariant = np.where(
        near,
        root[2] ** 2 - 2 * root[1] * root[3] + z * root[0] ** 2,
        2 * z * (waves[0] ** 2 + waves[1] ** 2 + 4 * waves[2] * waves[3] * np.exp(-flat)),
    )
    rigid = z == 0
    with np.errstate(divide="ignore", invalid="ignore"):
        (mass,) = _MASS(*pairs[:4], alpha, beta, z, invariant, displacement, slope, values[2], values[3])
        participation = -root[3] / z  # the joint's force is what moves the arm
    a, s = root[0], root[1]
    mass = np.where(rigid, a * a + a * s + s * s / 3 + values[2] * (a + s) ** 2 + values[3] * s * s, mass)
    participation = np.where(rigid, a + s / 2 + values[2] * (a + s), participation)
    scale = np.where(displacement < 0, -1.0, 1.0) / np.sqrt(mass)
    strain = np.array([np.sqrt(s_t * c_t) * alpha, np.sqrt(s_r * c_r) * beta])
    parts = (
        flat,
        root * scale,
        np.array([displacement, slope]) * scale,
        waves * scale,
        strain * scale,
        participation * scale,
    )
    return Modes(*(x.reshape(*x.shape[:-1], *lam.shape) + 0.0 for x in parts))  # -0.0 becomes 0.0


def _near(pairs: np.ndarray, lam: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the amplitudes and the tip's state, from whichever tip condition cancels less."""
    z = lam**4
    krylov = _POLYNOMIALS(np.ones_like(z), z)
    rows = np.array(_TIP_ROWS(*pairs, z, *krylov)).reshape(2, 2, 2, -1)  # condition, amplitude, (entry, magnitude)
    entry, magnitude = rows[:, :, 0], rows[:, :, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        loss = np.where(magnitude > 0, magnitude / np.abs(entry), 1.0).max(axis=1)
    loss[~entry.any(axis=1)] = np.inf
    row = np.where(loss[0] <= loss[1], entry[0], entry[1])
    row /= np.maximum(np.abs(row).max(axis=0), np.finfo(float).tiny)
    alpha, beta = row[1], -row[0]
    return alpha, beta, np.array(_TIP_NEAR(*pairs[:4], alpha, beta, z, *krylov))


def _far(pairs: np.ndarray, lam: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the amplitudes, the tip's state and the wave amplitudes."""
    waving = lam, np.cos(lam), np.sin(lam), np.exp(-lam)
    alpha, beta, *waves = _AMPLITUDES_FAR(*pairs, *waving)
    scale = np.sqrt(waves[0] ** 2 + waves[1] ** 2)
    alpha, beta, *waves = (x / scale for x in (alpha, beta, *waves))
    return alpha, beta, np.array(_TIP_FAR(*waves, *waving)), np.array(waves)


def _rigid(
    alpha: np.ndarray, beta: np.ndarray, tip: np.ndarray, free: np.ndarray, shape: tuple[int, ...], mu: np.ndarray
) -> None:
    """Fill in the two-fold rigid-body mode of a free arm: translation, and rotation about the centre of mass."""
    for mode in range(min(2, shape[-1])):
        here = np.zeros(shape, dtype=bool)
        here[free, mode] = True
        here = here.ravel()
        alpha[here] = -(0.5 + mu[here]) / (1 + mu[here]) if mode else 1.0
        beta[here] = mode
        tip[0, here], tip[1, here] = alpha[here] + beta[here], beta[here]


def _tip_state(tip: np.ndarray, mu: np.ndarray, iota: np.ndarray, lam: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return displacement and slope at the tip; heavy end-effectors keep them small, and shear and moment know them."""
    z = lam**4
    with np.errstate(divide="ignore", invalid="ignore"):
        displacement = np.where(mu * z > 1 + lam**3, -tip[3] / (mu * z), tip[0])
        slope = np.where(iota * z > 1 + lam, tip[2] / (iota * z), tip[1])
    return displacement, slope


def _near_shape(root: np.ndarray, lam: np.ndarray, xi: np.ndarray, derivative: int) -> np.ndarray:
    z = lam**4
    solutions = _POLYNOMIALS(xi, z)
    return sum(root[j] * z ** ((derivative - j + 3) // 4) * solutions[(j - derivative) % 4] for j in range(4))


def _far_shape(waves: np.ndarray, lam: np.ndarray, xi: np.ndarray, derivative: int) -> np.ndarray:
    return _SHAPE_FAR(*waves, lam, xi)[derivative]
