# ruff: noqa: F821
# mypy: ignore-errors
"""Template of the compiled twin of `cra_sym.model.modal`: the same steps, for blocks of arms, mode by mode.

This text is specialised by `cra_sym.kernels.compiled` with the functions it leaves open, the kernels of `modal`.
"""

import numpy as np

_NEAR = 25.0
_LANES = 64
_STEP = 16  # lanes worked on are a multiple of it, so that no loop needs a remainder
_ROWS = 23
_RATES = 13  # rows from here on follow from those before


def fill(table, row, units, lam, kappa_t, kappa_r, mu, iota, start, stop):
    """Fill ``table`` (rows, arms, modes) from arm ``start`` to ``stop`` with the rows of `modal` from ``row`` on.

    Each is multiplied by its entry in ``units`` (1 or arms, rows).
    """
    arm, b, w = np.empty((15, _LANES)), np.empty(_LANES), np.empty((_ROWS, _LANES))
    apart = 0 if units.shape[0] == 1 else 1
    for first in range(start, stop, _LANES):
        real = min(_LANES, stop - first)
        size = (real + _STEP - 1) // _STEP * _STEP
        for lane in range(size):
            i = first + min(lane, real - 1)
            arm[0, lane], arm[2, lane], arm[8, lane], arm[9, lane] = kappa_t[i], kappa_r[i], mu[i], iota[i]
        for lane in range(size):
            _prepare(arm, lane)
        for number in range(lam.shape[1]):
            for lane in range(size):
                b[lane] = lam[first + min(lane, real - 1), number]
            near = 0
            for lane in range(size):
                near += b[lane] * b[lane] * b[lane] * b[lane] < _NEAR
            if near < size:
                for lane in range(size):
                    _far(w, b[lane], arm, lane)
            if near > 0:
                for lane in range(size):
                    _near(w, b[lane], number, arm, lane)
            if row >= _RATES:
                for lane in range(size):
                    _rates(w, b[lane], arm, lane)
            for j in range(table.shape[0]):
                for lane in range(real):
                    i = first + lane
                    table[j, i, number] = (w[row + j, lane] + 0.0) * units[i * apart, j]


def _prepare(arm, lane):
    """Fill in the pairs (kappa, 1) / (1 + kappa), and what else the modes of an arm have in common."""
    t, r, m, j = arm[0, lane], arm[2, lane], arm[8, lane], arm[9, lane]
    arm[0, lane], arm[1, lane] = 1.0 if t == np.inf else t / (1.0 + t), 1.0 / (1.0 + t)
    arm[2, lane], arm[3, lane] = 1.0 if r == np.inf else r / (1.0 + r), 1.0 / (1.0 + r)
    arm[4, lane], arm[5, lane] = m / (1.0 + m), 1.0 / (1.0 + m)
    arm[6, lane], arm[7, lane] = j / (1.0 + j), 1.0 / (1.0 + j)
    arm[10, lane], arm[11, lane] = 1.0 / m, 1.0 / j
    arm[12, lane], arm[13, lane] = np.sqrt(arm[0, lane] * arm[1, lane]), np.sqrt(arm[2, lane] * arm[3, lane])
    arm[14, lane] = (0.5 + m) / (1.0 + m)  # from the joint to the centre of mass


def _far(w, lam, arm, lane):
    s_t, c_t, s_r, c_r = arm[0, lane], arm[1, lane], arm[2, lane], arm[3, lane]
    cosine, sine, decay, z = cos(lam), sin(lam), exp(-lam), lam * lam * lam * lam
    alpha, beta, a, b, c, d = amplitudes_far(
        s_t, c_t, s_r, c_r, arm[4, lane], arm[5, lane], arm[6, lane], arm[7, lane], lam, cosine, sine, decay
    )
    tip, slope, moment, shear = tip_far(a, b, c, d, lam, cosine, sine, decay)
    tip, slope = _tip(tip, slope, moment, shear, lam, z, arm, lane)
    invariant = 2.0 * z * (a * a + b * b + 4.0 * c * d * decay)
    mass = generalised_mass(s_t, c_t, s_r, c_r, alpha, beta, z, invariant, tip, slope, arm[8, lane], arm[9, lane])[0]
    scale = (-1.0 if tip < 0.0 else 1.0) / np.sqrt(mass)
    alpha, beta = alpha * scale, beta * scale
    w[0, lane], w[1, lane], w[2, lane] = tip * scale, slope * scale, s_t * alpha * (1.0 / z)
    w[3, lane], w[4, lane], w[5, lane], w[6, lane] = c_t * alpha, c_r * beta, s_r * beta, -s_t * alpha
    w[7, lane], w[8, lane], w[9, lane], w[10, lane] = a * scale, b * scale, c * scale, d * scale
    w[11, lane], w[12, lane] = arm[12, lane] * alpha, arm[13, lane] * beta


def _tip(tip, slope, moment, shear, lam, z, arm, lane):
    heavy, inert = arm[8, lane] * z > 1.0 + lam * lam * lam, arm[9, lane] * z > 1.0 + lam
    tip = -shear * (arm[10, lane] * (1.0 / z)) if heavy else tip
    slope = moment * (arm[11, lane] * (1.0 / z)) if inert else slope
    return tip, slope


def _near(w, lam, number, arm, lane):
    s_t, c_t, s_r, c_r, mu, iota = arm[0, lane], arm[1, lane], arm[2, lane], arm[3, lane], arm[8, lane], arm[9, lane]
    z = lam * lam * lam * lam
    k0, k1, k2, k3 = polynomials(1.0, z)
    alpha, beta = _amplitudes_near(
        tip_rows(
            s_t, c_t, s_r, c_r, arm[4, lane], arm[5, lane], arm[6, lane], arm[7, lane], z, k0, k1, k2, k3
        )
    )  # fmt: skip
    free = (z == 0.0) & (s_t == 0.0) & (s_r == 0.0)
    alpha = (1.0 if number == 0 else -arm[14, lane]) if free else alpha  # rotation is about the centre of mass
    beta = (0.0 if number == 0 else 1.0) if free else beta
    tip, slope, moment, shear = tip_near(s_t, c_t, s_r, c_r, alpha, beta, z, k0, k1, k2, k3)
    tip, slope = _tip(tip, slope, moment, shear, lam, z, arm, lane)
    at, turn, bend, push = c_t * alpha, c_r * beta, s_r * beta, -s_t * alpha
    invariant = bend * bend - 2.0 * turn * push + z * at * at
    mass = generalised_mass(s_t, c_t, s_r, c_r, alpha, beta, z, invariant, tip, slope, mu, iota)[0]
    still = at * at + at * turn + turn * turn / 3.0 + mu * (at + turn) * (at + turn) + iota * turn * turn
    mass = mass if z > 0.0 else still
    scale = (-1.0 if tip < 0.0 else 1.0) / np.sqrt(mass)
    participation = -push * (1.0 / z) if z > 0.0 else at + turn / 2.0 + mu * (at + turn)
    found = (
        tip, slope, participation, at, turn, bend, push, 0.0, 0.0, 0.0, 0.0, arm[12, lane] * alpha, arm[13, lane] * beta
    )  # fmt: skip
    for i in range(_RATES):
        w[i, lane] = found[i] * scale if z < _NEAR else w[i, lane]


def _rates(w, lam, arm, lane):
    square = lam * lam
    inverse = 1.0 / square
    w[13, lane], w[14, lane] = w[3, lane] * w[3, lane] * inverse, w[4, lane] * w[4, lane] * inverse
    by_t, by_r = w[11, lane] * inverse, w[12, lane] * inverse
    w[15, lane], w[16, lane] = 0.5 * (by_t * by_t), 0.5 * (by_r * by_r)
    w[17, lane], w[18, lane] = -(w[6, lane] * w[6, lane]) * inverse, -(w[5, lane] * w[5, lane]) * inverse
    w[19, lane], w[20, lane] = -(w[0, lane] * w[0, lane]) * square, -(w[1, lane] * w[1, lane]) * square
    w[21, lane] = -0.5 * (arm[8, lane] * (w[0, lane] * w[0, lane]))
    w[22, lane] = -0.5 * (arm[9, lane] * (w[1, lane] * w[1, lane]))


def _amplitudes_near(rows):
    """Return the amplitudes from whichever tip condition cancels less; each row entry comes with its magnitude."""
    first = _loss(rows[0], rows[1], rows[2], rows[3]) <= _loss(rows[4], rows[5], rows[6], rows[7])
    left, right = rows[0] if first else rows[4], rows[2] if first else rows[6]
    scale = 1.0 / max(abs(left), abs(right), 2.2250738585072014e-308)
    return right * scale, -left * scale


def _loss(left, left_magnitude, right, right_magnitude):
    one = left_magnitude / abs(left) if left_magnitude > 0.0 else 1.0
    two = right_magnitude / abs(right) if right_magnitude > 0.0 else 1.0
    return np.inf if (left == 0.0) & (right == 0.0) else max(one, two)
