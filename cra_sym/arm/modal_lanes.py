# ruff: noqa: F821
# mypy: ignore-errors
"""Template of the compiled twin of `cra_sym.arm.modal`: the same steps, one mode at a time.

This text is specialised by `cra_sym.kernels.compiled` with the functions it leaves open, the kernels of `modal`.
"""

import numpy as np

_NEAR = 25.0


def fill(table, lam, modes, kappa_t, kappa_r, mu, iota):
    """Fill the rows of ``table``: root (4), tip (2), waves (4), strain (2) and participation of every mode."""
    w = np.empty(13)
    for index in range(lam.size):
        lane = index // modes
        _mode(w, lam[index], index - lane * modes, kappa_t[lane], kappa_r[lane], mu[lane], iota[lane])
        for row in range(13):
            table[row, index] = w[row] + 0.0


def _mode(w, lam, number, kappa_t, kappa_r, mu, iota):
    s_t, c_t = 1.0 if kappa_t == np.inf else kappa_t / (1.0 + kappa_t), 1.0 / (1.0 + kappa_t)
    s_r, c_r = 1.0 if kappa_r == np.inf else kappa_r / (1.0 + kappa_r), 1.0 / (1.0 + kappa_r)
    s_mu, c_mu, s_iota, c_iota = mu / (1.0 + mu), 1.0 / (1.0 + mu), iota / (1.0 + iota), 1.0 / (1.0 + iota)
    z = lam * lam * lam * lam
    a, b, c, d, invariant = 0.0, 0.0, 0.0, 0.0, 0.0
    if z >= _NEAR:
        cosine, sine, decay = cos(lam), sin(lam), exp(-lam)
        alpha, beta, a, b, c, d = amplitudes_far(
            s_t, c_t, s_r, c_r, s_mu, c_mu, s_iota, c_iota, lam, cosine, sine, decay
        )
        scale = 1.0 / np.sqrt(a * a + b * b)
        alpha, beta, a, b, c, d = alpha * scale, beta * scale, a * scale, b * scale, c * scale, d * scale
        tip, slope, moment, shear = tip_far(a, b, c, d, lam, cosine, sine, decay)
        invariant = 2.0 * z * (a * a + b * b + 4.0 * c * d * decay)
    else:
        k0, k1, k2, k3 = polynomials(1.0, z)
        if z == 0.0 and kappa_t == 0.0 and kappa_r == 0.0:
            alpha, beta = (1.0, 0.0) if number == 0 else (-(0.5 + mu) / (1.0 + mu), 1.0)
        else:
            alpha, beta = _amplitudes_near(tip_rows(s_t, c_t, s_r, c_r, s_mu, c_mu, s_iota, c_iota, z, k0, k1, k2, k3))
        tip, slope, moment, shear = tip_near(s_t, c_t, s_r, c_r, alpha, beta, z, k0, k1, k2, k3)
    w[0], w[1], w[2], w[3] = c_t * alpha, c_r * beta, s_r * beta, -s_t * alpha
    if z < _NEAR:
        invariant = w[2] * w[2] - 2.0 * w[1] * w[3] + z * w[0] * w[0]
    if mu * z > 1.0 + lam * lam * lam:
        tip = -shear / (mu * z)
    if iota * z > 1.0 + lam:
        slope = moment / (iota * z)
    if z > 0.0:
        mass = generalised_mass(s_t, c_t, s_r, c_r, alpha, beta, z, invariant, tip, slope, mu, iota)[0]
        w[12] = -w[3] / z
    else:
        mass = w[0] * w[0] + w[0] * w[1] + w[1] * w[1] / 3.0 + mu * (w[0] + w[1]) ** 2 + iota * w[1] * w[1]
        w[12] = w[0] + w[1] / 2.0 + mu * (w[0] + w[1])
    w[4], w[5], w[6], w[7], w[8], w[9] = tip, slope, a, b, c, d
    w[10], w[11] = np.sqrt(s_t * c_t) * alpha, np.sqrt(s_r * c_r) * beta
    scale = (-1.0 if tip < 0.0 else 1.0) / np.sqrt(mass)
    for row in range(13):
        w[row] *= scale


def _amplitudes_near(rows):
    """Return the amplitudes from whichever tip condition cancels less; each row entry comes with its magnitude."""
    one = _loss(rows[0], rows[1], rows[2], rows[3])
    two = _loss(rows[4], rows[5], rows[6], rows[7])
    left, right = (rows[0], rows[2]) if one <= two else (rows[4], rows[6])
    scale = 1.0 / max(abs(left), abs(right), 2.2250738585072014e-308)
    return right * scale, -left * scale


def _loss(left, left_magnitude, right, right_magnitude):
    if left == 0.0 and right == 0.0:
        return np.inf
    return max(
        left_magnitude / abs(left) if left_magnitude > 0.0 else 1.0,
        right_magnitude / abs(right) if right_magnitude > 0.0 else 1.0,
    )
