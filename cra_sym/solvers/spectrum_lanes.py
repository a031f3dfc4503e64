# ruff: noqa: F821
# mypy: ignore-errors
"""Template of the compiled twin of `cra_sym.solvers.spectrum`: the same steps, for blocks of lanes at once.

This text is specialised by `cra_sym.kernels.compiled` with the functions it leaves open: ``coefficients``,
``power_series``, ``basis``, ``basis_near``, ``chain`` and ``derivatives`` of one family of functions.
"""

import numpy as np

_LANES = 128
_NEAR = 5.0
_TERMS = 10  # of the power series
_MOST_STEPS = 80


def frequency_parameters(out, evaluations, kappa_t, kappa_r, mu, iota):
    """Fill ``out`` (lanes, modes) with the fourth roots of the zeros; return whether every zero was reached."""
    modes = out.shape[1]
    points = 2 * modes + 42
    tables = np.empty((points, 7))  # lambda, z and the basis at the points where zeros are counted
    for k in range(points):
        lam = np.pi * ((k - 1) / 2 + 0.0625) if k else 0.0
        tables[k, 0], tables[k, 1] = lam, lam**4
        tables[k, 2], tables[k, 3], tables[k, 4], tables[k, 5], tables[k, 6] = _scaled_basis(lam, lam**4)
    pairs, k, h = np.empty((8, _LANES)), np.empty((12, _LANES)), np.empty((_TERMS, _LANES))
    counts, values = np.empty((points, _LANES), np.int64), np.empty((points, _LANES))
    right, zeros = np.empty(_LANES, np.int64), np.empty(_LANES, np.int64)
    z, previous, fresh, ahead = np.empty(_LANES), np.empty(_LANES), np.empty(_LANES), np.empty(_LANES)
    active = np.empty(_LANES, np.int64)
    reached = True
    for first in range(0, out.shape[0], _LANES):
        size = min(_LANES, out.shape[0] - first)
        _prepare(pairs, k, h, zeros, kappa_t, kappa_r, mu, iota, first, size)
        last = _counted(counts, values, pairs, zeros, tables, modes, size)
        for number in range(modes):
            _first_points(right, counts, number, last, size)
            _start(z, number, right, counts, values, tables, pairs, h, zeros, last, size)
            reached &= _climb(z, previous, fresh, ahead, active, evaluations, number, zeros, k, h, size)
            for lane in range(size):
                out[first + lane, number] = np.sqrt(np.sqrt(z[lane]))
    return reached


def _scaled_basis(lam, z):
    unit, p, q, r, s = basis(lam, exp(-lam))
    unit_near, p_near, q_near, r_near, s_near = basis_near(min(z, _NEAR))
    if z < _NEAR:
        return unit_near, p_near, q_near, r_near, s_near
    return unit, p, q, r, s


def _prepare(pairs, k, h, zeros, kappa_t, kappa_r, mu, iota, first, size):
    """Fill in the pairs (kappa, 1) / (1 + kappa), the determinant's coefficients and its power series."""
    for lane in range(size):
        t, r, m, j = kappa_t[first + lane], kappa_r[first + lane], mu[first + lane], iota[first + lane]
        pairs[0, lane], pairs[1, lane] = 1.0 if t == np.inf else t / (1.0 + t), 1.0 / (1.0 + t)
        pairs[2, lane], pairs[3, lane] = 1.0 if r == np.inf else r / (1.0 + r), 1.0 / (1.0 + r)
        pairs[4, lane], pairs[5, lane] = m / (1.0 + m), 1.0 / (1.0 + m)
        pairs[6, lane], pairs[7, lane] = j / (1.0 + j), 1.0 / (1.0 + j)
        zeros[lane] = (t == 0.0) + (r == 0.0)
    for lane in range(size):
        a = coefficients(
            pairs[0, lane], pairs[1, lane], pairs[2, lane], pairs[3, lane],
            pairs[4, lane], pairs[5, lane], pairs[6, lane], pairs[7, lane],
        )  # fmt: skip
        for i in range(12):
            k[i, lane] = a[i]
    for lane in range(size):
        a = power_series(
            k[0, lane], k[1, lane], k[2, lane], k[3, lane], k[4, lane], k[5, lane],
            k[6, lane], k[7, lane], k[8, lane], k[9, lane], k[10, lane], k[11, lane],
        )  # fmt: skip
        for i in range(_TERMS):
            h[i, lane] = a[i]
    for lane in range(size):
        for _ in range(zeros[lane]):
            for i in range(_TERMS - 1):
                h[i, lane] = h[i + 1, lane]
            h[_TERMS - 1, lane] = 0.0


def _count(pairs, lane, lam, z, unit, p, q, r, s):
    both_pinned, sprung, massive, translating, rotating = chain(
        pairs[0, lane], pairs[1, lane], pairs[2, lane], pairs[3, lane],
        pairs[4, lane], pairs[5, lane], pairs[6, lane], pairs[7, lane], z, unit, p, q, r, s,
    )  # fmt: skip
    turns = lam * (1 / np.pi)
    number = np.int64(turns)
    change = -1 if turns - number < 0.5 else 1
    number += 0 if (both_pinned > 0) == (number & 1 == 0) else change
    number -= 0 if (sprung > 0) == (number & 1 == 0) else 1
    number += 0 if (massive > 0) == (number & 1 == 0) else 1
    number += 0 if (translating > 0) == (number & 1 == 0) else 1
    number += 0 if (rotating > 0) == (number & 1 == 0) else 1
    return number, rotating


def _counted(counts, values, pairs, zeros, tables, modes, size):
    """Count at one point after the other until every lane has enough zeros; return the last point."""
    for lane in range(size):
        counts[0, lane], values[0, lane] = zeros[lane], np.nan
    for point in range(1, tables.shape[0]):
        lam, z, unit, p, q, r, s = tables[point]
        fewest = modes
        for lane in range(size):
            number, value = _count(pairs, lane, lam, z, unit, p, q, r, s)
            counts[point, lane], values[point, lane] = number, value
            fewest = min(fewest, number)
        if fewest >= modes:
            return point
    return tables.shape[0] - 1


def _first_points(right, counts, number, last, size):
    """Find the first point with more than ``number`` zeros below: at most some three intervals of pi to either side."""
    low, high = max(0, 2 * number - 8), min(last, 2 * number + 8)
    for lane in range(size):
        right[lane] = low
    for point in range(low, high + 1):
        for lane in range(size):
            right[lane] += counts[point, lane] <= number


def _start(z, number, right, counts, values, tables, pairs, h, zeros, last, size):
    for lane in range(size):
        k = right[lane]
        if number < zeros[lane]:
            z[lane] = 0.0
            continue
        below, above, low, high = counts[k - 1, lane], counts[k, lane], tables[k - 1, 1], tables[k, 1]
        if number == zeros[lane]:
            z[lane] = min(abs(h[0, lane]) / np.sqrt(h[1, lane] ** 2 - 2.0 * h[0, lane] * h[2, lane]), high)
        elif number == zeros[lane] + 1 and k < 3 and above == number + 1 and _second(h, lane, low, high) > 0.0:
            z[lane] = _second(h, lane, low, high)
        elif below == number and above == number + 1 and k > 1:
            z[lane] = _by_phase(lane, k, tables, values, last)
        else:
            while below < number and number + 1 < above:
                middle = np.sqrt(low * high) if low > 0 else high / 16
                lam = np.sqrt(np.sqrt(middle))
                unit, p, q, r, s = _scaled_basis(lam, middle)
                counted, _ = _count(pairs, lane, lam, middle, unit, p, q, r, s)
                if counted <= number:
                    low, below = middle, counted
                else:
                    high, above = middle, counted
            z[lane] = low if below == number else high


def _second(h, lane, low, high):
    """Return the larger zero of the first three terms of the power series if it is apart from the other, else 0."""
    square = h[1, lane] ** 2
    discriminant = square - 4.0 * h[0, lane] * h[2, lane]
    z = (abs(h[1, lane]) + np.sqrt(max(discriminant, 0.0))) / (2.0 * abs(h[2, lane]))
    return z if discriminant > 0.1 * square and low < z < high else 0.0


def _by_phase(lane, k, tables, values, last):
    left, here = values[k - 1, lane], values[k, lane]
    amplitude = left * left + here * here
    growth = 1.0
    if k > 2:
        growth = amplitude / (values[k - 2, lane] ** 2 + left * left)
        if k < last:
            growth *= (here * here + values[k + 1, lane] ** 2) / amplitude
        else:
            growth *= growth
        growth = np.sqrt(np.sqrt(growth))
    turn = np.arctan2(abs(left) * growth, abs(here)) * (2 / np.pi)
    lam = tables[k - 1, 0] + turn * (tables[k, 0] - tables[k - 1, 0])
    return lam**4


def _step(z, lower, k, h, lane):
    """Return the function, up to a positive factor, and Ostrowski's step less what lower zeros take from it."""
    lam = np.sqrt(np.sqrt(z))
    unit, p, q, r, s = basis(lam, exp(-lam))
    value, first, second = derivatives(
        k[0, lane], k[1, lane], k[2, lane], k[3, lane], k[4, lane], k[5, lane],
        k[6, lane], k[7, lane], k[8, lane], k[9, lane], k[10, lane], k[11, lane], z, unit, p, q, r, s,
    )  # fmt: skip
    near_value, near_first, near_second = h[_TERMS - 1, lane], 0.0, 0.0
    for i in range(_TERMS - 2, -1, -1):
        near_second = near_second * z + near_first
        near_first = near_first * z + near_value
        near_value = near_value * z + h[i, lane]
    near = z < _NEAR
    value = near_value if near else value
    first = near_first if near else first
    second = 2.0 * near_second if near else second
    factor = 1.0 if near else z
    share = value * factor / z if lower > 0 else 0.0
    whole = first * first - value * second
    rest = whole - lower * share * share
    step = factor * abs(value) / np.sqrt(rest if rest > 1e-3 * whole else whole)
    return value, 0.0 if value == 0.0 else step


def _climb(z, previous, fresh, ahead, active, evaluations, number, zeros, k, h, size):
    """Climb to the zeros: twice with all lanes, then with those that are not there yet."""
    even = number & 1 == 0
    for _ in range(2):
        for lane in range(size):
            value, step = _step(z[lane], number - zeros[lane], k, h, lane)
            previous[lane], ahead[lane] = ahead[lane], step
            z[lane] += step if (value > 0) == even else -step
    left = 0
    for lane in range(size):
        if number < zeros[lane]:
            z[lane] = 0.0
        elif not _there(ahead[lane], previous[lane], z[lane]):
            active[left] = lane
            previous[lane] = ahead[lane]
            left += 1
    evaluations[0] += 2 * size
    for _ in range(_MOST_STEPS):
        if left == 0:
            return True
        evaluations[0] += left
        for i in range(left):
            lane = active[i]
            value, ahead[i] = _step(z[lane], number - zeros[lane], k, h, lane)
            fresh[i] = z[lane] + (ahead[i] if (value > 0) == even else -ahead[i])
        still = 0
        for i in range(left):
            lane = active[i]
            z[lane] = fresh[i]
            if not _there(ahead[i], previous[lane], z[lane]):
                active[still] = lane
                still += 1
            previous[lane] = ahead[i]
        left = still
    return False


def _there(step, previous, z):
    ratio = step / previous
    return (step * ratio * ratio * ratio <= 1e-15 * z and step <= 0.1 * z) or step <= 1e-13 * z
