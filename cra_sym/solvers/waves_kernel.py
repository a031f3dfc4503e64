# mypy: ignore-errors
"""Numerical waves of a section: columns of one or two waves at the ends, end conditions, determinants, the count.

The functions contain only arithmetic and selections. They take arrays of lanes, real or complex, or terms of a text to
be compiled (`straight`).

State and convention. A section has the even part E and the odd part O of its state, ``E' = b O`` and ``O' = a E``, with
x in half lengths from mid-span. Then ``G = b a`` and ``a b`` have the same eigenvalues mu; a wave number k has
``mu = -k^2``. E-columns are ``E = C v``, ``O = a S v`` and O-columns ``O = C u``, ``E = b S u`` with
``C = cosh(sqrt mu)`` and ``S = sinh(sqrt mu) / sqrt mu``, which are real at any mu; at the left end one part of each
column has the other sign. Matrices are tuples of their entries row by row. Displacements coupled inside form
blocks of one, two or three; those of three are in `waves_three`.
"""

from __future__ import annotations

from functools import reduce
from itertools import combinations
from operator import add

import numpy as np
from numpy import cos, exp, sin

from .straight import Exact


def where(condition, value, otherwise):
    """Return one of two values, lane by lane; an Exact condition selects one of them at once."""
    if isinstance(condition, bool):
        return value if condition else otherwise
    if isinstance(value, tuple):
        return tuple(np.where(condition, *both) for both in zip(value, otherwise, strict=True))
    return np.where(condition, value, otherwise)


def total(terms):
    """Return the sum of terms."""
    return reduce(add, terms)


def linear(k, z, first, block, n):
    """Return the entries of a block of a matrix linear in z: constants from ``first`` on, then slopes."""
    places = [first + n * i + j for i in range(*block) for j in range(*block)]
    return tuple(k[place] + z * k[place + n * n] for place in places)


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
    """Return the square root, 0 for a negative value."""
    return np.sqrt(where(value > 0.0, value, 0.0))


def regime(half, product, square):
    """Return whether both mu are small, whether they are complex or close together, whether they differ in sign."""
    near = (abs(half) < 0.5) & (abs(product) < 1.0)
    _, small = half_sums(half, product, square)
    close = (square < 0.25 * half * half) & ((half < 0.0) | (small < 4.0)) | (square < 0.0)
    return near, close, product < 0.0


def wave(m):
    """Return cosh(sqrt m) and sinh(sqrt m)/sqrt m, over exp(sqrt m) for positive m."""
    if hasattr(m, "called"):
        return m.called("_wave", 2)
    if isinstance(m, np.ndarray) and (m > 0.25).all():
        return rising(m)
    if isinstance(m, np.ndarray) and (m < -0.25).all():
        return turning(m)
    return wave_anywhere(m)


def wave_anywhere(m):
    """Return `wave` for m of any size and sign."""
    size = np.sqrt(where(m < 0.0, -m, m))
    decay = exp(where(m > 0.0, -size, 0.0 * size))
    twice = 0.5 * decay * decay
    apart = where(m > 0.0, 0.5 - twice, sin(size)) / size
    return where(m > 0.0, 0.5 + twice, cos(size)), where((m < 0.25) & (m > -0.25), decay * small_sinh(m), apart)


def rising(m):
    """Return `wave` for positive m."""
    size = np.sqrt(m)
    decay = exp(-size)
    twice, small = 0.5 * decay * decay, m < 0.25
    apart = (0.5 - twice) / size
    if isinstance(small, np.ndarray) and not small.any():
        return 0.5 + twice, apart
    return 0.5 + twice, where(small, decay * small_sinh(m), apart)


def turning(m):
    """Return `wave` for negative m."""
    size, small = np.sqrt(-m), m > -0.25
    apart = sin(size) / size
    if isinstance(small, np.ndarray) and not small.any():
        return cos(size), apart
    return cos(size), where(small, small_sinh(m), apart)


def small_sinh(m):
    """Return sinh(sqrt m)/sqrt m by its series, for small m."""
    return 1.0 + m * (1 / 6 + m * (1 / 120 + m * (1 / 5040 + m * (1 / 362880 + m * (
        1 / 39916800 + m * (1 / 6227020800 + m * (1 / 1307674368000))
    )))))  # fmt: skip


def small_sinh_with_rate(m):
    """Return `small_sinh` and its derivative."""
    value, rate = SINH_TERMS[9], 0.0
    for term in SINH_TERMS[8::-1]:
        value, rate = term + m * value, value + m * rate
    return value, rate


def near_series(half, product, square):
    """Return C = c0 + c1 (G - p), S = s0 + s1 (G - p) by power series, and the exponent that scales a determinant."""
    c0, c1, s0, s1 = COSH_TERMS[9] + 0.0 * half, 0.0 * half, SINH_TERMS[9] + 0.0 * half, 0.0 * half
    for k in range(8, -1, -1):
        c0, c1 = COSH_TERMS[k] - product * c1, c0 + 2.0 * half * c1
        s0, s1 = SINH_TERMS[k] - product * s1, s0 + 2.0 * half * s1
    return c0 + half * c1, c1, s0 + half * s1, s1, -2.0 * growth(half, product, square)


def growth(half, product, square):
    """Return the sum of the real parts of both square roots of mu."""
    root = positive_root(square)
    together = positive_root(half + root) + positive_root(half - root)
    return where(square < 0.0, positive_root(2.0 * (half + positive_root(product))), together)


def half_sums(half, product, square):
    """Return sigma^2 and d^2, in order of size, of square roots sigma +- d of complex or neighbouring mu."""
    root = positive_root(product)
    big = 0.5 * (half + where(half < 0.0, -root, root))
    return big, 0.25 * square / big


def close_series(big, small, big_c, big_s, small_c, small_s):
    """Return the result of `near_series` from the cosh and sinh of sigma and d."""
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
    terms = (m11 * v1, m12 * v2), (m21 * v1, m22 * v2)
    first, second = (one + other for one, other in terms)
    if all(isinstance(one, Exact) or isinstance(other, Exact) for one, other in terms):
        take_first = second == 0.0  # nothing cancels
    else:
        size1, size2 = (abs(one) + abs(other) for one, other in terms)
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


def condition(k, z, first, motions, forces):
    """Return one condition on all columns: factors of motions, linear in z, and of forces from ``first`` on."""
    size = len(motions)
    factors = [k[first + j] - z * k[first + size + j] for j in range(size)]
    factors += [k[first + 2 * size + j] for j in range(len(forces))]
    rows = [*motions, *forces]
    return tuple(total([x * row[c] for x, row in zip(factors, rows, strict=True)]) for c in range(len(rows[0])))


def grown(minors, row, size):
    """Return the minors with one more row, by ordered sets of columns, from those of ``size`` rows."""
    width = len(row)
    place = {columns: at for at, columns in enumerate(combinations(range(width), size))}

    def minor(columns):
        terms = [minors[place[columns[:at] + columns[at + 1 :]]] * row[columns[at]] for at in range(size + 1)]
        return total(terms[size::-2]) - total(terms[size - 1 :: -2])

    return tuple(minor(columns) for columns in combinations(range(width), size + 1))


def minors(rows):
    """Return the minors of rows, by ordered sets of columns; 1 for no rows."""
    found = rows[0] if rows else (Exact(1),)
    for size in range(1, len(rows)):
        found = grown(found, rows[size], size)
    return found


def joined(upper, lower, size, width, sign=1.0, turned=()):
    """Return a determinant times a sign from the minors of its first ``size`` rows and of the others (Laplace).

    The other rows have the opposite sign in the columns ``turned``.
    """
    place = {columns: at for at, columns in enumerate(combinations(range(width), width - size))}
    signed = [Exact(0)], [Exact(0)]
    for minor, columns in zip(upper, combinations(range(width), size), strict=True):
        rest = tuple(c for c in range(width) if c not in columns)
        turns = sum(columns) - size * (size - 1) // 2 + sum(c in turned for c in rest) + (sign < 0.0)
        signed[turns % 2].append(minor * lower[place[rest]])
    return total(signed[0]) - total(signed[1])


def adaptable(value, number, change):
    """Return the number, changed where the sign of the value is not that of ``(-1)**number``."""
    half = 0.5 * number
    return where((value == 0.0) | ((value > 0.0) == (half == np.floor(half))), number, number + change)


def reference(waves, shear, value):
    """Return the count with E = 0 at both ends, where motions are sines and cosines; its determinant gives the parity.

    ``waves`` are triples: a mu, whether it is real, and whether its branch omega(k) falls, which lowers the count.
    ``shear`` is the number of motions that are uniform along x.
    """
    number, nearest = shear, None
    for mu, real, falls in waves:
        turns = positive_root(where(real, -mu, 0.0)) * (2 / np.pi)
        whole, way = np.floor(turns), where(falls, -1.0, 1.0)
        rest = turns - whole
        number = number + way * whole
        distance = where(rest < 0.5, rest, 1.0 - rest)
        distance = where(turns > 0.5, distance, 1.0)
        change = where(rest < 0.5, -way, way)
        if nearest is None:
            nearest, best = distance, change
        else:
            closer = distance < nearest
            nearest, best = where(closer, distance, nearest), where(closer, change, best)
    return adaptable(value, number, best)


def columns_of_one(a, b, c, s):
    """Return the columns of a block of one."""
    return c, a * s, c, b * s


def elementary(table, z):
    """Return the elementary symmetric functions of the mu of a block, and their derivatives by z."""
    return (
        tuple(c0 + z * (c1 + z * (c2 + z * c3)) for c0, c1, c2, c3 in table),
        tuple(c1 + z * (2.0 * c2 + 3.0 * z * c3) for c0, c1, c2, c3 in table),
    )


def branch(wave, table):
    """Return the lowest z of a block whose motions have the square wave number ``wave`` (in 1 / half length squared).

    It is the lowest root of a polynomial with real roots only: Laguerre's step is exact for degrees one and two; for
    degree three, three steps approximate it from below.
    """
    size, z = len(table), 0.0
    row = list(zip((1.0, 0.0, 0.0, 0.0), *table, strict=True))
    c0, c1, c2, c3 = (reduce(lambda found, entry: found * wave + entry, entries[1:], entries[0]) for entries in row)
    value, first, second = c0, c1, 2.0 * c2
    for step in range(1 if size < 3 else 3):
        if step:
            value, first = c0 + z * (c1 + z * (c2 + z * c3)), c1 + z * (2.0 * c2 + 3.0 * z * c3)
            second = 2.0 * c2 + 6.0 * z * c3
        rate = first / value
        if size == 1:
            return -1.0 / rate
        inside = (size - 1.0) * ((size - 1.0) * rate * rate - size * second / value)
        root = positive_root(inside)
        z = z + size / (where(value < 0.0, -root, root) - rate)
    return z


def two_waves(a, b, waves, kind="any"):
    """Return the columns of a block of two and their basis, in a given regime or in any."""
    half, product, square = waves[:3]
    near, close, _ = regime(half, product, square) if kind == "any" else (kind == "near", kind == "close", False)
    if kind == "near":
        series = near_series(half, product, square)
    else:
        pair = where(close, half_sums(half, product, square), eigenvalues(half, product, square))
        functions = (*wave(pair[0]), *wave(pair[1]))
        if kind == "mixed":
            functions = waves_of_both_signs(*pair)
        if close is False:
            distant = distant_columns(a, b, *waves, *functions)
            return distant[:16], distant[16]
        series = close_series(*pair, *functions)
        if kind == "any":
            series = where(near, near_series(half, product, square), series)
    together = close_columns(a, b, *waves, *series[:4]), exp(-series[4])
    if kind != "any":
        return together
    distant = distant_columns(a, b, *waves, *functions)
    either = near | close
    return where(either, together[0], distant[:16]), where(either, together[1], distant[16])


def waves_of_both_signs(big, small):
    """Return `wave` for two m of opposite sign."""
    first = big > 0.0
    positive, negative = where(first, big, small), where(first, small, big)
    if hasattr(positive, "called"):
        pairs = positive.called("_rising", 2), negative.called("_turning", 2)
    else:
        pairs = rising(positive), turning(negative)
    return (*where(first, pairs[0], pairs[1]), *where(first, pairs[1], pairs[0]))


def determinant(rows):
    """Return the determinant of a square matrix from its rows."""
    (found,) = minors(rows)
    return found


COSH_TERMS = (
    1.0, 1 / 2, 1 / 24, 1 / 720, 1 / 40320, 1 / 3628800, 1 / 479001600, 1 / 87178291200, 1 / 20922789888000,
    1 / 6402373705728000,
)  # fmt: skip
SINH_TERMS = (
    1.0, 1 / 6, 1 / 120, 1 / 5040, 1 / 362880, 1 / 39916800, 1 / 6227020800, 1 / 1307674368000, 1 / 355687428096000,
    1 / 121645100408832000,
)  # fmt: skip
