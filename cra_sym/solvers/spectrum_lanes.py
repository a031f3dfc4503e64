# ruff: noqa: B018, F821, F841
# mypy: ignore-errors
"""Template of the compiled version of `cra_sym.solvers.spectrum`: the same steps, for blocks of lanes at once.

This text is specialised by `cra_sym.kernels.compiled` with the functions ``coefficients``,
``power_series``, ``basis``, ``basis_near``, ``chain`` and ``derivatives`` of one family. Placeholders for sizes and
argument lists are capital letters between double underscores.
"""

import numpy as np

_LANES = 128
_NEAR = __NEAR__
_MOST_NEAR = __MOST_NEAR__  # zeros below that
_SERIES = __COEFFICIENTS__  # from here on a lane's rows hold its power series; before, the determinant's coefficients
_ROWS = _SERIES + __TERMS__
_MOST_STEPS = 80


def frequency_parameters(out, evaluations, __GROUPS__):
    """Fill ``out`` (lanes, modes) with lambda of the zeros; return whether every zero was reached."""
    modes = out.shape[1]
    points = 2 * modes + 42
    tables = np.empty((points, 2 + __BASIS_SIZE__))  # lambda, z and the basis at the points where zeros are counted
    for k in range(points):
        lam = np.pi * ((k - 1) / 2 + 0.0625) if k else 0.0
        z_k = _power(lam)
        __BASIS__ = _scaled_basis(lam, z_k)
        values_k = lam, z_k, __BASIS__
        for i in range(2 + __BASIS_SIZE__):
            tables[k, i] = values_k[i]
    pairs, k = (
        np.empty((__PARAMETERS__, _LANES)),
        np.zeros((2 * _ROWS, _LANES)),
    )  # of all lanes; then of those still on their way
    counts, values = np.empty((points, _LANES), np.int64), np.empty((points, _LANES))
    fewest, most = np.empty(points, np.int64), np.empty(points, np.int64)  # zeros below a point in any lane
    right, zeros = np.empty(_LANES, np.int64), np.empty(_LANES, np.int64)
    crowded, around = np.empty(_LANES, np.int64), np.empty((8, _LANES))
    z, place, lower = np.empty(_LANES), np.empty(_LANES), np.empty(_LANES)
    step, previous = np.empty(_LANES), np.empty(_LANES)
    active, left = np.empty(_LANES, np.int64), np.empty(_LANES, np.int64)
    reached = True
    for first in range(0, out.shape[0], _LANES):
        size = min(_LANES, out.shape[0] - first)
        _prepare(pairs, k, zeros, __GROUPS__, first, size)
        last = _counted(counts, values, fewest, most, pairs, zeros, tables, modes, size)
        reached &= fewest[last] >= modes
        low = high = 0
        for number in range(modes):
            while low < last and most[low] <= number:
                low += 1
            while high < last and fewest[high] <= number:
                high += 1
            _first_points(right, counts, number, low, high, size)
            _start(z, crowded, around, number, right, counts, values, tables, pairs, k, zeros, last, size)
            reached &= _climb(z, place, lower, step, previous, active, left, evaluations, number, zeros, k, size)
            for lane in range(size):
                z[lane] = _root(z[lane])
            for lane in range(size):
                out[first + lane, number] = z[lane]
    return reached


def _root(z):
    return __ROOT__


def _power(lam):
    return __POWER__


def _scaled_basis(lam, z):
    __BASIS__ = basis(lam, exp(-lam))
    __BASIS_NEAR__ = basis_near(min(z, _NEAR))
    if z < _NEAR:
        return __BASIS_NEAR__
    return __BASIS__


def _prepare(pairs, k, zeros, __GROUPS__, first, size):
    """Fill in (kappa, mu, 1) / (1 + kappa + mu), the determinant's coefficients and its power series."""
    for lane in range(size):
        i = first + lane
        __PREPARE__
        zeros[lane] = __RIGID_BODY_MODES__
    for lane in range(size):
        a = coefficients(__OF_COEFFICIENTS__)
        for i in range(_SERIES):
            k[i, lane] = a[i]
    for lane in range(size):
        a = power_series(__OF_POWER_SERIES__)
        for i in range(__TERMS__):
            k[_SERIES + i, lane] = a[i]
    for lane in range(size):
        for _ in range(zeros[lane]):
            for i in range(_SERIES, _ROWS - 1):
                k[i, lane] = k[i + 1, lane]
            k[_ROWS - 1, lane] = 0.0


def _count(pairs, lane, lam, z, __BASIS__):
    __LINKS__ = chain(__OF_CHAIN__)
    turns = lam * (1 / np.pi)
    number = np.int64(turns)
    number = _linked(number, link_0, -1 if turns - number < 0.5 else 1)
    __COUNT__
    return number, __LAST_LINK__


def _linked(number, value, change):
    """Return the number, changed where the sign of the value is not that of ``(-1)**number``."""
    return number + (change if (number + (value > 0)) & 1 == 0 else 0)


def _counted(counts, values, fewest, most, pairs, zeros, tables, modes, size):
    """Count at one point after the other until every lane has enough zeros; return the last point."""
    fewest[0], most[0] = modes, 0
    for lane in range(size):
        counts[0, lane], values[0, lane] = zeros[lane], np.nan
        fewest[0], most[0] = min(fewest[0], zeros[lane]), max(most[0], zeros[lane])
    for point in range(1, tables.shape[0]):
        lam, z, __BASIS__ = tables[point]
        least, largest = modes, 0
        for lane in range(size):
            number, value = _count(pairs, lane, lam, z, __BASIS__)
            counts[point, lane], values[point, lane] = number, value
            least, largest = min(least, number), max(largest, number)
        fewest[point], most[point] = least, largest
        if least >= modes:
            return point
    return tables.shape[0] - 1


def _first_points(right, counts, number, low, high, size):
    """Find the first point with more than ``number`` zeros below; no lane has it before ``low`` or after ``high``."""
    for lane in range(size):
        right[lane] = low
    for point in range(low, high):
        for lane in range(size):
            right[lane] += counts[point, lane] <= number


def _start(z, crowded, around, number, right, counts, values, tables, pairs, k, zeros, last, size):
    """Start every lane close to its zero, from the values gathered at points around the zero."""
    for lane in range(size):
        point = max(right[lane], 1)
        around[0, lane], around[1, lane] = values[max(point - 2, 0), lane], values[point - 1, lane]
        around[2, lane], around[3, lane] = values[point, lane], values[min(point + 1, last), lane]
        around[4, lane], around[5, lane], around[6, lane] = tables[point - 1, 0], tables[point - 1, 1], tables[point, 1]
        around[7, lane] = counts[point, lane] - number  # zeros from the wanted one to the point
        crowded[lane] = (counts[point - 1, lane] != number) | (counts[point, lane] != number + 1) | (point == 1)
    for lane in range(size):
        z[lane] = _by_phase(around, right[lane], last, lane)
    if number < 4:  # there are no more than two zeros at 0
        for lane in range(size):
            lower, second = number - zeros[lane], _second(k, around[5, lane], around[6, lane], lane)
            known = (lower <= 0) | ((lower == 1) & (right[lane] < 3) & (around[7, lane] == 1.0) & (second > 0.0))
            guess = min(_first(k, lane), around[6, lane]) if lower == 0 else second
            z[lane] = (0.0 if lower < 0 else guess) if known else z[lane]
            crowded[lane] = 0 if known else crowded[lane]
    for lane in range(size):
        if crowded[lane]:
            z[lane] = _between(pairs, lane, number, right[lane], counts, tables)


def _between(pairs, lane, number, point, counts, tables):
    """Return one end of an interval, halved until it has no other zero on that side of the wanted one."""
    below, above, low, high = counts[point - 1, lane], counts[point, lane], tables[point - 1, 1], tables[point, 1]
    while below < number and number + 1 < above:
        middle = np.sqrt(low * high) if low > 0 else high / 16
        lam = _root(middle)
        __BASIS__ = _scaled_basis(lam, middle)
        counted, _ = _count(pairs, lane, lam, middle, __BASIS__)
        if counted <= number:
            low, below = middle, counted
        else:
            high, above = middle, counted
    return low if below == number else high


def _first(k, lane):
    """Return the end point of the first step from z = 0."""
    return abs(k[_SERIES, lane]) / np.sqrt(k[_SERIES + 1, lane] ** 2 - 2.0 * k[_SERIES, lane] * k[_SERIES + 2, lane])


def _second(k, low, high, lane):
    """Return the larger zero of the first three terms of the power series if it is apart from the other, else 0."""
    square = k[_SERIES + 1, lane] ** 2
    discriminant = square - 4.0 * k[_SERIES, lane] * k[_SERIES + 2, lane]
    z = (abs(k[_SERIES + 1, lane]) + np.sqrt(max(discriminant, 0.0))) / (2.0 * abs(k[_SERIES + 2, lane]))
    return z if (discriminant > 0.1 * square) & (low < z) & (z < high) else 0.0


def _by_phase(around, right, last, lane):
    before, left, here, after = around[0, lane], around[1, lane], around[2, lane], around[3, lane]
    after = after if right < last else left
    growth = np.sqrt((here * here + after * after) / (before * before + left * left))
    growth = np.sqrt(growth) if right < last else growth
    opposite = abs(left) * (growth if right > 2 else 1.0)
    share = opposite / (opposite + abs(here))
    product = share * (1.0 - share)
    turn = share + product * (1.0 - 2.0 * share) * (-0.3664 - product * (0.3404 + product * 1.5))
    lam = around[4, lane] + turn * (np.pi / 2)
    return _power(lam)


def _step(z, lower, even, k, row, lane):
    """Return Ostrowski's step towards the zero, less what lower zeros take from it; k from ``row`` on is the lane's."""
    lam = _root(z)
    __BASIS__ = basis(lam, exp(-lam))
    value, first, second = derivatives(__OF_DERIVATIVES__)
    near_value, near_first, near_second = k[row + _ROWS - 1, lane], 0.0, 0.0
    for i in range(_ROWS - 2, _SERIES - 1, -1):
        near_second = near_second * z + near_first
        near_first = near_first * z + near_value
        near_value = near_value * z + k[row + i, lane]
    near = z < _NEAR
    value = near_value if near else value
    first = near_first if near else first
    second = 2.0 * near_second if near else second
    share = value / z if near else value
    whole = first * first - value * second
    rest = whole - (lower * share * share if lower > 0.0 else 0.0)
    step = (1.0 if near else z) * abs(value) / np.sqrt(rest if rest > 1e-3 * whole else whole)
    step = 0.0 if value == 0.0 else step
    return step if (value > 0.0) == even else -step


def _climb(z, place, lower, step, previous, active, left, evaluations, number, zeros, k, size):
    """Climb to the zeros: twice with all lanes, then with those that are not there yet, moved side by side."""
    for lane in range(size):
        place[lane], lower[lane], active[lane] = z[lane], number - zeros[lane], lane
    rows = _SERIES if number > _MOST_NEAR else _ROWS
    many, row = size, 0
    for turn in range(_MOST_STEPS):
        for i in range(many):
            previous[i] = step[i]
            step[i] = _step(place[i], lower[i], number & 1 == 0, k, row, i)
            place[i] += step[i]
        evaluations[0] += many
        if turn == 0:
            continue
        for i in range(many):
            z[active[i]] = 0.0 if lower[i] < 0.0 else place[i]
        still = 0
        for i in range(many):
            left[still] = i
            still += (lower[i] >= 0.0) & (not _there(abs(step[i]), abs(previous[i]), place[i]))
        many = still
        if many == 0:
            return True
        for i in range(many):
            j = left[i]
            active[i], place[i], lower[i], step[i] = active[j], place[j], lower[j], step[j]
        for entry in range(rows):
            for i in range(many):
                k[_ROWS + entry, i] = k[row + entry, left[i]]
        row = _ROWS
    return False


def _there(step, previous, z):
    ratio = step / previous
    return ((step * ratio * ratio * ratio <= 1e-15 * z) & (step <= 0.1 * z)) | (step <= 1e-13 * z)
