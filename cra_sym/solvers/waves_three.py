# mypy: ignore-errors
"""Numerical waves of a block of three: the wave whose mu is farthest from the others, and a block of two.

State and convention are those of `waves_kernel`. With signs s (1 of an even, -1 of an odd displacement) a problem
without dampers has ``a^T = s a s`` and ``b^T = s b s``, so that one matrix of rank one, the adjugate of ``G - mu``,
gives the vectors ``b a v = mu v`` and ``a b u = mu u`` and both complements that the other two waves live in.
"""

from __future__ import annotations

import numpy as np
from numpy import exp

from .waves_kernel import (
    COSH_TERMS,
    SINH_TERMS,
    columns_of_one,
    growth,
    positive_root,
    total,
    wave,
    wave_numbers,
    where,
)

__all__ = ["alone", "joined_columns", "near_columns", "near_functions", "three_waves"]

_ORDERS = (0, 1, 2), (1, 0, 2), (2, 1, 0)
_STEPS = 6  # Newton's, from at most 1.5 times the root down to rounding


def _product(a, b):
    return tuple(total([a[3 * i + k] * b[3 * k + j] for k in range(3)]) for i in range(3) for j in range(3))


def _cofactors(m):
    """Return the adjugate of a matrix."""
    rows = (1, 2), (0, 2), (0, 1)

    def minor(i, j):
        (r1, r2), (c1, c2) = rows[i], rows[j]
        value = m[3 * r1 + c1] * m[3 * r2 + c2] - m[3 * r1 + c2] * m[3 * r2 + c1]
        return value if (i + j) % 2 == 0 else -value

    return tuple(minor(j, i) for i in range(3) for j in range(3))


def _symmetric_functions(g):
    """Return trace, sum of the principal minors and determinant."""
    adjugate = _cofactors(g)
    return (
        g[0] + g[4] + g[8],
        adjugate[0] + adjugate[4] + adjugate[8],
        total([g[j] * adjugate[3 * j] for j in range(3)]),
    )


def _less(g, value):
    return tuple(entry - value if at in (0, 4, 8) else entry for at, entry in enumerate(g))


def _ordered(m, order):
    return tuple(m[3 * i + j] for i in order for j in order)


def _chosen(masks, values):
    """Return the values of one of three orders."""
    second, third = masks
    return where(third, values[2], where(second, values[1], values[0]))


def alone(a, b, signs):
    """Split a block of three: the single wave, and the other two in their own coordinates.

    Returns
    -------
    near : whether all mu are small
    mu, pair : the single mu, and `wave_numbers` of the others
    matrices : a and b of the others, four entries each
    vectors : alpha, beta, v, y, u and r of ``a v = alpha u``, ``b u = beta v`` and the complements, two entries each
    masks : whether the second or the third coordinate is the pivot
    basis : the determinant of all vectors, at E and at O
    """
    g = _product(b, a)
    trace, second, third = _symmetric_functions(g)
    near = (abs(trace) < 1.0) & (abs(second) < 1.0) & (abs(third) < 1.0)
    shifted = _less(g, trace / 3.0)
    _, sum_, product = _symmetric_functions(shifted)
    size = where(product < 0.0, -product, product)
    least = 1e-300
    cube = exp(np.log(where(size > least, size, least)) / 3.0)
    above = positive_root(cube * cube - where(sum_ < 0.0, sum_, 0.0))
    root = where((sum_ > 0.0) & (cube * sum_ > size), size / where(sum_ > 0.0, sum_, 1.0), above)
    root = where(size > least, root, positive_root(-sum_))
    for _ in range(_STEPS):
        slope = 3.0 * root * root + sum_
        root = where(slope > 0.0, (2.0 * root * root * root + size) / where(slope > 0.0, slope, 1.0), root)
    adjugate = _cofactors(_less(shifted, where(product < 0.0, -root, root)))
    sizes = abs(adjugate[0]), abs(adjugate[4]), abs(adjugate[8])
    masks = (sizes[1] > sizes[0]), (sizes[2] > sizes[0]) & (sizes[2] > sizes[1])
    n = _chosen(masks, [_ordered(adjugate, order) for order in _ORDERS])
    sign = [_chosen(masks, [signs[order[0]] * signs[order[j]] for order in _ORDERS]) for j in (1, 2)]
    a, b = (_chosen(masks, [_ordered(m, order) for order in _ORDERS]) for m in (a, b))
    v, y = (n[3] / n[0], n[6] / n[0]), (n[1] / n[0], n[2] / n[0])
    u, r = (sign[0] * y[0], sign[1] * y[1]), (sign[0] * v[0], sign[1] * v[1])
    basis = 1.0 + (y[0] * v[0] + y[1] * v[1])
    alpha, beta = _form(r, a, v) / basis, _form(y, b, u) / basis
    matrices = (*_rest(a, y), *_rest(b, r))
    pair = wave_numbers(matrices[:4], matrices[4:])
    return near, alpha * beta, pair, matrices, (alpha, beta, *v, *y, *u, *r), masks, basis * basis


def _form(left, m, right):
    rows = [m[3 * i] + m[3 * i + 1] * right[0] + m[3 * i + 2] * right[1] for i in range(3)]
    return rows[0] + left[0] * rows[1] + left[1] * rows[2]


def _rest(m, y):
    return tuple(m[3 * i + j] - y[j - 1] * m[3 * i] for i in (1, 2) for j in (1, 2))


def near_columns(a, b, signs, square=1.0):
    """Return the columns of a block of three at small mu in the basis of unit vectors, by power series.

    With ``square`` = x^2 they are those at x, without a factor x in O of the E-columns and in E of the others.
    """
    c, s, _ = near_functions(a, b, signs, square)
    return (*c, *_product(a, s), *_reflected(c, signs), *_product(s, b))


def near_functions(a, b, signs, square):
    """Return cosh(sqrt G x) and sinh(sqrt G x) / (sqrt G x) of ``G = b a``, and the second of ``a b``."""
    g = _product(b, a)
    first, second, third = _symmetric_functions(g)
    first, second, third = first * square, second * square * square, third * square * square * square
    g = tuple(entry * square for entry in g)
    twice, found = _product(g, g), []
    for terms in (COSH_TERMS, SINH_TERMS):
        c0, c1, c2 = terms[-1], 0.0 * first, 0.0 * first
        for term in terms[-2::-1]:
            c0, c1, c2 = term + third * c2, c0 - second * c2, c1 + first * c2
        rest = [c1 * e1 + c2 * e2 for e1, e2 in zip(g, twice, strict=True)]
        found.append(tuple(c0 + entry if at in (0, 4, 8) else entry for at, entry in enumerate(rest)))
    c, s = found
    return c, s, _reflected(s, signs)


def _reflected(m, signs):
    return tuple(signs[i] * signs[j] * m[3 * j + i] for i in range(3) for j in range(3))


def joined_columns(single, pair, vectors, masks):
    """Return the columns of a block of three from those of the single wave and of the other two."""
    _, _, *rest = vectors
    v, y, u, r = (rest[i : i + 2] for i in range(0, 8, 2))
    found = []
    for part, (lead, out) in enumerate(((v, y), (u, r), (u, r), (v, y))):
        one, others = single[part], pair[4 * part : 4 * part + 4]
        top = one, *(-(out[0] * others[j] + out[1] * others[2 + j]) for j in range(2))
        rows = top, (lead[0] * one, *others[:2]), (lead[1] * one, *others[2:])
        found += _chosen(masks, [sum((rows[order.index(i)] for i in range(3)), ()) for order in _ORDERS])
    return tuple(found)


def three_waves(a, b, signs, split, columns_of_two, kind="any"):
    """Return the columns of a block of three and their basis, in a given regime or in any."""
    near, mu, pair, matrices, vectors, masks, basis = split
    together = ()
    if kind in ("any", "series"):
        half, product, square = pair[:3]
        exponent = -2.0 * (positive_root(mu) + growth(half, product, square))
        together = near_columns(a, b, signs), exp(-exponent)
        if kind == "series":
            return together
    single = columns_of_one(*vectors[:2], *wave(mu))
    two, factor = columns_of_two(matrices[:4], matrices[4:], pair, kind)
    apart = joined_columns(single, two, vectors, masks), factor * basis
    return apart if kind != "any" else (where(near, together[0], apart[0]), where(near, together[1], apart[1]))
