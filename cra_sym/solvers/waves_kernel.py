# mypy: ignore-errors
"""Two waves a section as numbers: their columns at the ends, the determinant of the end conditions, and its count.

The functions hold nothing but arithmetic and selections. They take arrays of lanes, real or complex (NumPy), and this
text from the marker on is also a part of a compiled template, where they take numbers (`waves_lanes`).

State and convention. A section has the even part E and the odd part O of its state, ``E' = b O`` and ``O' = a E``, with
x in half lengths from mid-span. Then ``G = b a`` and ``a b`` have the same two eigenvalues mu; a wave number k has
``mu = -k^2``. E-columns are ``E = C v``, ``O = a S v`` and O-columns ``O = C u``, ``E = b S u`` with
``C = cosh(sqrt mu)`` and ``S = sinh(sqrt mu) / sqrt mu``, which are real at any mu; at the left end one part of each
column has the other sign. Matrices are tuples of their entries row by row.
"""

from __future__ import annotations

import numpy as np
from numpy import cos, exp, sin, where

__all__ = [
    "branch", "chain", "close_columns", "close_series", "conditions", "couplings", "distant_columns", "eigenvalues",
    "half_sums", "joined", "linear", "minors", "near_series", "pairs", "positive_root", "regime", "wave",
    "wave_numbers",
]  # fmt: skip
# the text that is compiled too begins here


def linear(k, z, first):
    """Return the entries of a matrix linear in z: four constants and four slopes from ``first`` on."""
    return (
        k[first] + z * k[first + 4], k[first + 1] + z * k[first + 5],
        k[first + 2] + z * k[first + 6], k[first + 3] + z * k[first + 7],
    )  # fmt: skip


def pairs(k, z, first):
    """Return what multiplies the displacement and the force in both conditions of an end."""
    return k[first] - z * k[first + 1], k[first + 2], k[first + 3] - z * k[first + 4], k[first + 5]


def couplings(k, z, first):
    """Return what multiplies the other displacement in both conditions of an end."""
    return k[first] - z * k[first + 1], k[first + 2] - z * k[first + 3]


def wave_numbers(a, b):
    """Return p, q and p^2 - q of ``mu^2 - 2 p mu + q``, and half the difference and the rest of (b a) and (a b)."""
    a11, a12, a21, a22 = a
    b11, b12, b21, b22 = b
    e11, e12, e21, e22 = b11 * a11 + b12 * a21, b11 * a12 + b12 * a22, b21 * a11 + b22 * a21, b21 * a12 + b22 * a22
    o11, o12, o21, o22 = a11 * b11 + a12 * b21, a11 * b12 + a12 * b22, a21 * b11 + a22 * b21, a21 * b12 + a22 * b22
    half = 0.5 * (e11 + e22)
    product = (a11 * a22 - a12 * a21) * (b11 * b22 - b12 * b21)
    e, o = 0.5 * (e22 - e11), 0.5 * (o22 - o11)
    return half, product, e * e + e12 * e21, e, e12, e21, o, o12, o21


def positive_root(value):
    """Return the square root, of a negative value 0."""
    return np.sqrt(where(value > 0.0, value, 0.0))


def regime(half, product, square):
    """Return whether both mu are small, and whether they are complex or close to each other."""
    near = (abs(half) < 0.5) & (abs(product) < 1.0)
    _, small = half_sums(half, product, square)
    close = (square < 0.25 * half * half) & ((half < 0.0) | (small < 4.0))
    return near, close | (square < 0.0)


def wave(m):
    """Return cosh(sqrt m) and sinh(sqrt m)/sqrt m, over exp(sqrt m) for positive m."""
    size = np.sqrt(where(m < 0.0, -m, m))
    decay = exp(where(m > 0.0, -size, 0.0 * size))
    twice = 0.5 * decay * decay
    series = 1.0 + m * (1 / 6 + m * (1 / 120 + m * (1 / 5040 + m * (1 / 362880 + m * (
        1 / 39916800 + m * (1 / 6227020800 + m * (1 / 1307674368000))
    )))))  # fmt: skip
    apart = where(m > 0.0, 0.5 - twice, sin(size)) / size
    return where(m > 0.0, 0.5 + twice, cos(size)), where((m < 0.25) & (m > -0.25), decay * series, apart)


def near_series(half, product, square):
    """Return C = c0 + c1 (G - p), S = s0 + s1 (G - p) by power series, and the exponent that scales a determinant."""
    c0, c1, s0, s1 = _COSH[9] + 0.0 * half, 0.0 * half, _SINH[9] + 0.0 * half, 0.0 * half
    for k in range(8, -1, -1):
        c0, c1 = _COSH[k] - product * c1, c0 + 2.0 * half * c1
        s0, s1 = _SINH[k] - product * s1, s0 + 2.0 * half * s1
    root = positive_root(square)
    together = positive_root(half + root) + positive_root(half - root)
    growth = where(square < 0.0, positive_root(2.0 * (half + positive_root(product))), together)
    return c0 + half * c1, c1, s0 + half * s1, s1, -2.0 * growth


def half_sums(half, product, square):
    """Return sigma^2 and d^2, in order of size, of square roots sigma +- d of complex or neighbouring mu."""
    root = positive_root(product)
    big = 0.5 * (half + where(half < 0.0, -root, root))
    return big, 0.25 * square / big


def close_series(big, small, big_c, big_s, small_c, small_s):
    """Return what `near_series` does from the cosh and sinh of sigma and d."""
    gap = big - small
    s0 = (big * big_s * small_c - small * big_c * small_s) / gap
    s1 = 0.5 * (big_c * small_s - big_s * small_c) / gap
    both = where(big > 0.0, small, 0.0)
    return big_c * small_c, 0.5 * big_s * small_s, s0, s1, 4.0 * positive_root(both)


def close_columns(a, b, half, product, square, e, e12, e21, o, o12, o21, c0, c1, s0, s1):
    """Return E and O of the E-columns, O and E of the O-columns at the right end, in the basis of unit vectors."""
    a11, a12, a21, a22 = a
    b11, b12, b21, b22 = b
    f11, f12, f21, f22 = s0 - s1 * e, s1 * e12, s1 * e21, s0 + s1 * e
    h11, h12, h21, h22 = s0 - s1 * o, s1 * o12, s1 * o21, s0 + s1 * o
    return (
        c0 - c1 * e, c1 * e12, c1 * e21, c0 + c1 * e,
        a11 * f11 + a12 * f21, a11 * f12 + a12 * f22, a21 * f11 + a22 * f21, a21 * f12 + a22 * f22,
        c0 - c1 * o, c1 * o12, c1 * o21, c0 + c1 * o,
        b11 * h11 + b12 * h21, b11 * h12 + b12 * h22, b21 * h11 + b22 * h21, b21 * h12 + b22 * h22,
    )  # fmt: skip


def eigenvalues(half, product, square):
    """Return the mu of larger size and the other one, without cancellation."""
    root = positive_root(square)
    big = half + where(half < 0.0, -root, root)
    return big, product / where(big == 0.0, 1.0, big)


def multiple(m, v1, v2, u1, u2):
    """Return t of ``m v = t u`` for vectors that are parallel, from the component that cancels least."""
    m11, m12, m21, m22 = m
    first, second = m11 * v1 + m12 * v2, m21 * v1 + m22 * v2
    size1, size2 = abs(m11 * v1) + abs(m12 * v2), abs(m21 * v1) + abs(m22 * v2)
    take_first = (abs(first) * size2 > abs(second) * size1) | (size2 == 0.0)
    return where(take_first, first, second) / where(take_first, u1, u2)


def distant_columns(a, b, half, product, square, e, e12, e21, o, o12, o21, big_c, big_s, small_c, small_s):
    """Return the columns in the basis of eigenvectors, each over its exponential, and the basis' determinant."""
    root = positive_root(square)
    same = (e < 0.0) == (half < 0.0)
    c1, s1 = where(same, big_c, small_c), where(same, big_s, small_s)
    c2, s2 = where(same, small_c, big_c), where(same, small_s, big_s)
    w, wo = e + where(e < 0.0, -root, root), o + where(o < 0.0, -root, root)
    v11, v22, x12, x21 = e12 / w, -e21 / w, o12 / wo, -o21 / wo
    match = (o < 0.0) == (e < 0.0)
    u11, u21, u12, u22 = where(match, x12, 1.0), where(match, 1.0, x21), where(match, 1.0, x12), where(match, x21, 1.0)
    t1, t2 = s1 * multiple(a, v11, 1.0, u11, u21), s2 * multiple(a, 1.0, v22, u12, u22)
    r1, r2 = s1 * multiple(b, u11, u21, v11, 1.0), s2 * multiple(b, u12, u22, 1.0, v22)
    basis = (1.0 - v11 * v22) * (1.0 - x12 * x21)
    return (
        v11 * c1, c2, c1, v22 * c2, t1 * u11, t2 * u12, t1 * u21, t2 * u22,
        u11 * c1, u12 * c2, u21 * c1, u22 * c2, r1 * v11, r2, r1, r2 * v22,
        where(match, basis, -basis),
    )  # fmt: skip


def conditions(pair, couplings, columns, second):
    """Return the two conditions of an end on the four columns.

    ``pair`` is what multiplies E[0], O[0], E[1] and O[1] there, ``couplings`` what multiplies the other displacement in
    each condition, and ``second`` the second displacement on the columns.
    """
    e1, o1, e2, o2 = pair
    t1, t2 = couplings
    e11, e12, e21, e22, o11, o12, o21, o22, p11, p12, p21, p22, q11, q12, q21, q22 = columns
    x1, x2, y1, y2 = second
    return (
        (
            e1 * e11 + o1 * o11 + t1 * x1,
            e1 * e12 + o1 * o12 + t1 * x2,
            o1 * p11 + e1 * q11 + t1 * y1,
            o1 * p12 + e1 * q12 + t1 * y2,
        ),
        (
            e2 * e21 + o2 * o21 + t2 * e11,
            e2 * e22 + o2 * o22 + t2 * e12,
            o2 * p21 + e2 * q21 + t2 * q11,
            o2 * p22 + e2 * q22 + t2 * q12,
        ),
    )


def minors(first, second):
    """Return the six 2 x 2 minors of the two conditions of an end on the four columns."""
    x11, x12, y11, y12 = first
    x21, x22, y21, y22 = second
    return (
        x11 * x22 - x12 * x21, y11 * y22 - y12 * y21,
        x11 * y21 - x21 * y11, x11 * y22 - x21 * y12, x12 * y21 - x22 * y11, x12 * y22 - x22 * y12,
    )  # fmt: skip


def joined(right, left):
    """Return the 4 x 4 determinant from the minors of both ends."""
    x, y, m11, m12, m21, m22 = right
    v, w, n11, n12, n21, n22 = left
    return (x * w + y * v) + ((m11 * n22 + m22 * n11) - (m12 * n21 + m21 * n12))


def adaptable(value, number, change):
    """Return the number, changed where the sign of the value is not that of ``(-1)**number``."""
    return where((value == 0.0) | ((value > 0.0) == ((number & 1) == 0)), number, number + change)


def reference(half, product, square, slope, product_slope, shear, value):
    """Return the count with E = 0 at both ends, where motions are sines and cosines; its determinant gives parity.

    ``slope`` and ``product_slope`` are the derivatives of p and q by z: a branch omega(k) that falls takes away.
    """
    big, small = eigenvalues(half, product, square)
    real = square >= 0.0
    turns1 = positive_root(where(real, -big, 0.0)) * (2 / np.pi)
    turns2 = positive_root(where(real, -small, 0.0)) * (2 / np.pi)
    whole1, whole2 = np.int64(turns1), np.int64(turns2)
    rest1, rest2 = turns1 - whole1, turns2 - whole2
    sign = where(half < 0.0, -1.0, 1.0)
    falls1 = (2.0 * slope * big - product_slope) * sign > 0.0
    falls2 = (2.0 * slope * small - product_slope) * sign < 0.0
    way1, way2 = where(falls1, -1, 1), where(falls2, -1, 1)
    number = way1 * whole1 + way2 * whole2 + where(shear, 1, 0)
    distance1, distance2 = where(rest1 < 0.5, rest1, 1.0 - rest1), where(rest2 < 0.5, rest2, 1.0 - rest2)
    first = (distance1 < distance2) & (turns1 > 0.5) | (turns2 < 0.5)
    up = where(where(first, rest1, rest2) < 0.5, -1, 1)
    return adaptable(value, number, up * where(first, way1, way2))


def chain(columns, second, right, left, basis, half, product, square, slope, product_slope, shear, odd):
    """Return the count by a chain of end conditions, and the last determinant.

    From E = 0 at both ends, one condition at a time becomes what it is, the second of an end first: where the other
    displacement is held, their coupling is idle. Free to sprung takes 0 or 1 away, or adds it where inertia outweighs
    the spring; held to whatever it is gives 0 or 1 more.
    """
    fixed1 = columns[0], columns[1], columns[12], columns[13]
    fixed2 = columns[2], columns[3], columns[14], columns[15]
    right1, right2 = conditions(right[0], right[1], columns, second)
    left1, left2 = conditions(left[0], left[1], columns, second)
    held, half_right, whole_right = minors(fixed1, fixed2), minors(fixed1, right2), minors(right1, right2)
    half_left, whole_left = minors(fixed1, left2), minors(left1, left2)
    number = reference(half, product, square, slope, product_slope, shear, joined(held, held) * basis)
    number = adaptable(joined(half_right, held) * basis, number, where(odd & (right[0][3] > 0.0), -1, 1))
    number = adaptable(joined(whole_right, held) * basis, number, 1)
    number = adaptable(joined(whole_right, half_left) * basis, number, where(odd & (left[0][3] > 0.0), -1, 1))
    value = joined(whole_right, whole_left)
    return adaptable(value * basis, number, 1), value / basis


def branch(wave, trace0, trace1, trace2, product0, product1, product2):
    """Return the lowest z whose motions have the square wave number ``wave`` (in 1 / half length squared)."""
    c0 = (wave + trace0) * wave + product0
    c1, c2 = wave * trace1 + product1, wave * trace2 + product2
    inside = c1 * c1 - 4.0 * c0 * c2
    return 2.0 * c0 / (-c1 + positive_root(inside))


_COSH = (
    1.0, 1 / 2, 1 / 24, 1 / 720, 1 / 40320, 1 / 3628800, 1 / 479001600, 1 / 87178291200, 1 / 20922789888000,
    1 / 6402373705728000,
)  # fmt: skip
_SINH = (
    1.0, 1 / 6, 1 / 120, 1 / 5040, 1 / 362880, 1 / 39916800, 1 / 6227020800, 1 / 1307674368000, 1 / 355687428096000,
    1 / 121645100408832000,
)  # fmt: skip
