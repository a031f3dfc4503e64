"""Frequency parameters to 40 digits by mpmath, straight from the boundary conditions; the package has no part in it."""

from __future__ import annotations

from itertools import permutations

import mpmath as mp
import numpy as np

_PERMUTATIONS = [
    (p, (-1) ** sum(p[i] > p[j] for i in range(4) for j in range(i + 1, 4))) for p in permutations(range(4))
]


def _pair(kappa):
    return (mp.mpf(1), mp.mpf(0)) if kappa == np.inf else (mp.mpf(kappa), mp.mpf(1))


def determinant(lam, kappa_t, kappa_r, mu, iota):
    """4 x 4 determinant of the boundary conditions in cos, sin, cosh, sinh; the stiffness pairs are (kappa, 1)."""
    b = mp.mpf(lam)
    c, s, ch, sh = mp.cos(b), mp.sin(b), mp.cosh(b), mp.sinh(b)
    (k_t, e_t), (k_r, e_r), mu, iota = _pair(kappa_t), _pair(kappa_r), mp.mpf(mu), mp.mpf(iota)
    root = [(1, 0, -1, 0), (0, 1, 0, -1), (1, 0, 1, 0), (0, 1, 0, 1)]  # derivatives 0 to 3 of the four functions
    tip = [(c, -s, -c, s), (s, c, -s, -c), (ch, sh, ch, sh), (sh, ch, sh, ch)]
    rows = [
        [e_t * b**3 * f[3] + k_t * f[0] for f in root],
        [e_r * b * f[2] - k_r * f[1] for f in root],
        [f[2] - iota * b**3 * f[1] for f in tip],
        [f[3] + mu * b * f[0] for f in tip],
    ]
    return sum(sign * rows[0][p[0]] * rows[1][p[1]] * rows[2][p[2]] * rows[3][p[3]] for p, sign in _PERMUTATIONS)


def refined(lam, *arm):
    """Return the zero of the determinant within 1e-7 of ``lam``, or None if there is no change of sign."""
    with mp.workdps(50 + int(lam) + (int(-8 * np.log10(lam)) if lam < 1 else 0)):
        a, b = mp.mpf(float(lam)) * (1 - mp.mpf(10) ** -7), mp.mpf(float(lam)) * (1 + mp.mpf(10) ** -7)
        f_a, f_b = determinant(a, *arm), determinant(b, *arm)
        if f_a * f_b >= 0:
            return None
        for _ in range(12):
            if f_a == f_b or abs(b - a) < abs(b) * mp.mpf(10) ** -36:
                break
            a, b, f_a = b, b - f_b * (b - a) / (f_b - f_a), f_b
            f_b = determinant(b, *arm)
        return b


def relative_errors(lam, *arms):
    """Return the relative errors of frequency parameters but rigid-body zeros; nan where one is not a zero."""
    arms = [np.broadcast_to(x, lam.shape[:-1]).ravel() for x in arms]
    errors = []
    for row, *arm in zip(lam.reshape(-1, lam.shape[-1]), *arms, strict=True):
        for value in row[row > 0]:
            exact = refined(value, *map(float, arm))
            errors.append(np.nan if exact is None else float(abs(value - exact) / exact))
    return np.array(errors)
