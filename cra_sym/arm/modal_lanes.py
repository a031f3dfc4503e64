# ruff: noqa: F821
# mypy: ignore-errors
"""Template of the compiled twin of `cra_sym.arm.modal`: the same steps, in blocks of modes.

This text is specialised by `cra_sym.kernels.compiled` with the functions it leaves open, the kernels of `modal`.
"""

import numpy as np

_NEAR = 25.0
_BLOCK = 256


def fill(table, lam, modes, kappa_t, kappa_r, mu, iota):
    """Fill the rows of ``table``: root (4), tip (2), waves (4), strain (2) and participation of every mode."""
    arm, w, state, place = np.empty((5, _BLOCK)), np.empty((13, _BLOCK)), np.empty(13), np.empty(_BLOCK, np.int64)
    for first in range(0, lam.size, _BLOCK):
        far = 0
        for i in range(first, min(first + _BLOCK, lam.size)):
            lane, z = i // modes, lam[i] * lam[i] * lam[i] * lam[i]
            if z < _NEAR:
                _near(state, lam[i], i % modes, kappa_t[lane], kappa_r[lane], mu[lane], iota[lane])
                for row in range(13):
                    table[row, i] = state[row] + 0.0
            else:
                arm[0, far], arm[1, far], arm[2, far], arm[3, far] = kappa_t[lane], kappa_r[lane], mu[lane], iota[lane]
                arm[4, far], place[far] = lam[i], i
                far += 1
        for i in range(far):
            _far(w, i, arm[4, i], arm[0, i], arm[1, i], arm[2, i], arm[3, i])
        for row in range(13):
            for i in range(far):
                table[row, place[i]] = w[row, i] + 0.0


def _pair(kappa):
    return 1.0 if kappa == np.inf else kappa / (1.0 + kappa), 1.0 / (1.0 + kappa)


def _far(w, i, lam, kappa_t, kappa_r, mu, iota):
    (s_t, c_t), (s_r, c_r), (s_mu, c_mu), (s_iota, c_iota) = _pair(kappa_t), _pair(kappa_r), _pair(mu), _pair(iota)
    cosine, sine, decay, z = cos(lam), sin(lam), exp(-lam), lam * lam * lam * lam
    alpha, beta, a, b, c, d = amplitudes_far(s_t, c_t, s_r, c_r, s_mu, c_mu, s_iota, c_iota, lam, cosine, sine, decay)
    tip, slope, moment, shear = tip_far(a, b, c, d, lam, cosine, sine, decay)
    tip = -shear / (mu * z) if mu * z > 1.0 + lam * lam * lam else tip
    slope = moment / (iota * z) if iota * z > 1.0 + lam else slope
    invariant = 2.0 * z * (a * a + b * b + 4.0 * c * d * decay)
    mass = generalised_mass(s_t, c_t, s_r, c_r, alpha, beta, z, invariant, tip, slope, mu, iota)[0]
    scale = (-1.0 if tip < 0.0 else 1.0) / np.sqrt(mass)
    alpha, beta = alpha * scale, beta * scale
    w[0, i], w[1, i], w[2, i], w[3, i] = c_t * alpha, c_r * beta, s_r * beta, -s_t * alpha
    w[4, i], w[5, i] = tip * scale, slope * scale
    w[6, i], w[7, i], w[8, i], w[9, i] = a * scale, b * scale, c * scale, d * scale
    w[10, i], w[11, i], w[12, i] = np.sqrt(s_t * c_t) * alpha, np.sqrt(s_r * c_r) * beta, s_t * alpha / z


def _near(w, lam, number, kappa_t, kappa_r, mu, iota):
    (s_t, c_t), (s_r, c_r), (s_mu, c_mu), (s_iota, c_iota) = _pair(kappa_t), _pair(kappa_r), _pair(mu), _pair(iota)
    z = lam * lam * lam * lam
    k0, k1, k2, k3 = polynomials(1.0, z)
    if z == 0.0 and kappa_t == 0.0 and kappa_r == 0.0:
        alpha, beta = (1.0, 0.0) if number == 0 else (-(0.5 + mu) / (1.0 + mu), 1.0)
    else:
        alpha, beta = _amplitudes_near(tip_rows(s_t, c_t, s_r, c_r, s_mu, c_mu, s_iota, c_iota, z, k0, k1, k2, k3))
    tip, slope, moment, shear = tip_near(s_t, c_t, s_r, c_r, alpha, beta, z, k0, k1, k2, k3)
    w[0], w[1], w[2], w[3] = c_t * alpha, c_r * beta, s_r * beta, -s_t * alpha
    tip = -shear / (mu * z) if mu * z > 1.0 + lam * lam * lam else tip
    slope = moment / (iota * z) if iota * z > 1.0 + lam else slope
    invariant = w[2] * w[2] - 2.0 * w[1] * w[3] + z * w[0] * w[0]
    if z > 0.0:
        mass = generalised_mass(s_t, c_t, s_r, c_r, alpha, beta, z, invariant, tip, slope, mu, iota)[0]
        w[12] = -w[3] / z
    else:
        mass = w[0] * w[0] + w[0] * w[1] + w[1] * w[1] / 3.0 + mu * (w[0] + w[1]) ** 2 + iota * w[1] * w[1]
        w[12] = w[0] + w[1] / 2.0 + mu * (w[0] + w[1])
    w[4], w[5], w[6], w[7], w[8], w[9] = tip, slope, 0.0, 0.0, 0.0, 0.0
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
