# ruff: noqa: F821
# mypy: ignore-errors
"""Template of the compiled version of `cra_sym.solvers.waves`: the same steps, for blocks of lanes at once.

It is followed (see `waves.template`) by the largest multiplicity of a zero and functions of a lane: ``_value`` and
``_count``, for any regime or for waves of both signs, ``_regime`` and ``_branch``. For any regime all variants are
evaluated and one is selected, so that loops over lanes have no branch. These functions are long, so each is defined
once and called, not inlined.
"""

import numpy as np

_LANES = 128
_MOST_STEPS = 400
_EPS = 2.220446049250313e-16
_CALLED = ("_counts", "_values")  # not written out where they are called


def lowest_waves(out, evaluations, k, zeros):
    """Fill ``out`` (lanes, modes) with the lowest roots from coefficients ``k`` (entries, lanes).

    Returns 0, or one more than a lane in which the points did not reach enough roots, or -1 if a search did not settle.
    """
    modes, entries = out.shape[1], k.shape[0]
    most = 2 * modes + 64
    own, moved = np.empty((entries, _LANES)), np.empty((entries, _LANES))
    points, values = np.empty((most, _LANES)), np.empty((most, _LANES))
    counts, rigid = np.empty((most, _LANES), np.int64), np.empty(_LANES, np.int64)
    state = np.empty((8, _LANES))  # of roots on their way
    bracket, at = np.empty((4, _LANES)), np.empty((2, _LANES), np.int64)
    place, left = np.empty(_LANES, np.int64), np.empty(_LANES, np.int64)
    z = np.empty(_LANES)
    for first in range(0, out.shape[0], _LANES):
        size = min(_LANES, out.shape[0] - first)
        for entry in range(k.shape[0]):
            for lane in range(size):
                own[entry, lane] = k[entry, first + lane]
        for lane in range(size):
            rigid[lane] = zeros[first + lane]
        last = _counted(points, counts, values, own, rigid, modes, most, size)
        evaluations[1] += last * size
        if last == most:
            return 1 + first
        for number in range(modes):
            _bracketed(bracket, at, points, counts, values, number, last, size)
            evaluations[1] += _isolated(bracket, at, state, place, left, moved, own, rigid, number, size)
            _opened(bracket, state, moved, own, rigid, number, size)
            many = _started(z, state, bracket, at, place, rigid, number, size)
            for entry in range(k.shape[0]):
                for i in range(many):
                    moved[entry, i] = own[entry, place[i]]
            steps = _interpolated(z, state, place, left, moved, rigid, number, many, evaluations)
            if steps == _MOST_STEPS:
                return -1
            for lane in range(size):
                out[first + lane, number] = z[lane]
    _sort(out)
    return 0


def counts(numbers, values, z, k):
    """Fill in the number of roots below the points z, one in each lane, and the values there."""
    _counts(numbers, values, z, k, z.size)


def _deflated(value, z, zeros):
    for multiplicity in range(_MOST_ZEROS):
        value = value / (z if zeros > multiplicity else 1.0)
    return value


def _counted(points, counts, values, k, zeros, modes, most, size):
    """Count at one point after the other until every lane has enough roots; return the last point."""
    for point in range(most):
        for lane in range(size):
            z = _branch(k, lane, point + 0.0625)
            before = points[point - 1, lane] if point > 0 else 0.0
            further = z if (z > before) & (z < np.inf) else (4.0 * before if before > 0.0 else 1.0)
            points[point, lane] = further if point > 0 else 0.0
        _counts(counts[point], values[point], points[point], k, size)
        least = modes
        for lane in range(size):
            z, value = points[point, lane], values[point, lane]
            values[point, lane] = _deflated(value, z, zeros[lane])
            least = min(least, counts[point, lane])
        if point == 0:
            for lane in range(size):
                value = values[0, lane]
                counts[0, lane], values[0, lane] = zeros[lane], value if (zeros[lane] == 0) & (value > 0.0) else np.nan
        elif least >= modes:
            return point
    return most


def _counts(counts, values, z, k, size):
    """Fill in the number of roots below the points z, and the values there."""
    for lane in range(size):
        number, value = _count_any(k, lane, z[lane])
        counts[lane], values[lane] = np.int64(number), value


def _bracketed(bracket, at, points, counts, values, number, last, size):
    """Gather the points around the wanted root, the counts and the values there."""
    for lane in range(size):
        at[0, lane] = 0
    for point in range(last):
        for lane in range(size):
            at[0, lane] += counts[point, lane] <= number
    for lane in range(size):
        right = at[0, lane]
        left = max(right - 1, 0)
        low, high, before = points[left, lane], points[right, lane], bracket[1, lane]
        closer = (number > 0) & (at[1, lane] == number) & (low < before) & (before < high)  # where the last root ended
        bracket[0, lane], bracket[1, lane] = before if closer else low, high
        bracket[2, lane], bracket[3, lane] = bracket[3, lane] if closer else values[left, lane], values[right, lane]
        at[0, lane], at[1, lane] = number if closer else counts[left, lane], counts[right, lane]


def _is_crowded(bracket, at, number, lane):
    wide = bracket[1, lane] - bracket[0, lane] > 4.0 * _EPS * bracket[1, lane]
    return wide & ((at[0, lane] < number) | (at[1, lane] > number + 1))


def _isolated(bracket, at, state, place, left, moved, k, zeros, number, size):
    """Shrink brackets until each holds its root alone, or no number between its ends; return the number of counts."""
    many, counted = 0, 0
    for lane in range(size):
        place[many] = lane
        many += _is_crowded(bracket, at, number, lane) & (zeros[lane] <= number)
    for entry in range(k.shape[0]):
        for i in range(many):
            moved[entry, i] = k[entry, place[i]]
    steps = 0
    while (many > 0) & (steps < _MOST_STEPS):
        steps += 1
        counted += many
        for i in range(many):
            low, high = bracket[0, place[i]], bracket[1, place[i]]
            state[0, i] = np.sqrt(low * high) if low > 0.0 else high / 64.0
        _counts(left, state[1], state[0], moved, many)
        for i in range(many):
            lane, middle, found = place[i], state[0, i], left[i]
            low, high = bracket[0, lane], bracket[1, lane]
            value = _deflated(state[1, i], middle, zeros[lane])
            up = found <= number
            bracket[0, lane], bracket[1, lane] = middle if up else low, high if up else middle
            bracket[2, lane], bracket[3, lane] = value if up else bracket[2, lane], bracket[3, lane] if up else value
            at[0, lane], at[1, lane] = found if up else at[0, lane], at[1, lane] if up else found
        still = 0
        for i in range(many):
            left[still] = i
            still += _is_crowded(bracket, at, number, place[i])
        for i in range(still):
            place[i] = place[left[i]]
        for entry in range(k.shape[0]):
            for i in range(still):
                moved[entry, i] = moved[entry, left[i]]
        many = still
    return counted


def _opened(bracket, state, moved, k, zeros, number, size):
    """Replace lower ends at z = 0 where the value is not known by small z on the same side of the root."""
    for lane in range(size):
        if (bracket[0, lane] == 0.0) & (not bracket[2, lane] == bracket[2, lane]) & (zeros[lane] <= number):
            share, before = 1e-3, 0
            while (before == 0) & (share > 1e-300):
                z = share * bracket[1, lane]
                for entry in range(k.shape[0]):
                    moved[entry, 0] = k[entry, lane]
                state[5, 0] = z
                _values(state, moved, 1)
                value = _deflated(state[7, 0], z, zeros[lane])
                side = 0 if (value > 0.0) == ((number & 1) == 0) else 2
                before = 1 - side // 2
                bracket[side // 2, lane], bracket[2 + side // 2, lane] = z, value
                share *= 1e-3


def _started(z, state, bracket, at, place, zeros, number, size):
    """Set the searches of roots that are alone in their brackets side by side; return how many there are."""
    many = 0
    sign = 1.0 if (number & 1) == 0 else -1.0
    for lane in range(size):
        low, high = bracket[0, lane], bracket[1, lane]
        at_low, at_high = sign * bracket[2, lane], sign * bracket[3, lane]
        found = low if at_low <= 0.0 else (high if at_high >= 0.0 else 0.5 * (low + high))
        z[lane] = 0.0 if zeros[lane] > number else found
        alone = (at[0, lane] == number) & (at[1, lane] == number + 1) & (at_low > 0.0) & (at_high < 0.0)
        nearest = at_low < -at_high
        x1, f1 = low if nearest else high, at_low if nearest else at_high
        x2, f2 = high if nearest else low, at_high if nearest else at_low
        place[many] = lane
        state[0, many], state[1, many], state[2, many], state[3, many] = x1, x2, f1, f2
        wave = 0.5 * (np.sqrt(np.sqrt(low)) + np.sqrt(np.sqrt(high)))
        state[4, many] = (wave**4 - x1) / (x2 - x1) if low > 0.0 else f1 / (f1 - f2)
        many += alone & (zeros[lane] <= number)
    return many


def _interpolated(z, state, place, left, k, zeros, number, many, evaluations):
    """Search all roots at once, then those that are not found yet, moved side by side; return the number of steps."""
    sign = 1.0 if (number & 1) == 0 else -1.0
    steps = 0
    while (many > 0) & (steps < _MOST_STEPS):
        steps += 1
        evaluations[0] += many
        for i in range(many):
            state[5, i] = state[0, i] + state[4, i] * (state[1, i] - state[0, i])
        _values(state, k, many)
        for i in range(many):
            x1, x2, f1, f2 = state[0, i], state[1, i], state[2, i], state[3, i]
            step = state[4, i] * (x2 - x1)
            x = state[5, i]
            f = sign * _deflated(state[7, i], x, zeros[place[i]])
            same = (f > 0.0) == (f1 > 0.0)
            x3, f3 = x1 if same else x2, f1 if same else f2
            x2, f2 = x2 if same else x1, f2 if same else f1
            width = x2 - x
            xi, phi = (x - x2) / (x3 - x2), (f - f2) / (f3 - f2)
            quadratic = (phi * phi < xi) & ((1.0 - phi) ** 2 < 1.0 - xi)
            smooth = f / (f2 - f) * f3 / (f2 - f3) + (x3 - x) / width * f / (f3 - f) * f2 / (f3 - f2)
            least = min(_EPS * abs(x) / abs(width), 0.5)
            share = max(min(smooth if quadratic else 0.5, 1.0 - least), least)
            following = abs(share * width)
            settled = quadratic & (following < 0.1 * abs(x)) & (following * following <= 1e-15 * x * abs(step))
            done = settled | (f == 0.0) | (abs(width) <= 2.0 * _EPS * abs(x))
            state[0, i], state[1, i], state[2, i], state[3, i], state[4, i] = x, x2, f, f2, share
            state[5, i] = x if f == 0.0 else x + share * width
            state[6, i] = done
        still = 0
        for i in range(many):
            z[place[i]] = state[5, i]
            left[still] = i
            still += state[6, i] == 0.0
        if still < many:
            for i in range(still):
                j = left[i]
                place[i] = place[j]
                state[0, i], state[1, i], state[2, i] = state[0, j], state[1, j], state[2, j]
                state[3, i], state[4, i] = state[3, j], state[4, j]
            for entry in range(k.shape[0]):
                for i in range(still):
                    k[entry, i] = k[entry, left[i]]
        many = still
    return steps


def _values(state, k, many):
    """Fill in the determinants where the searches are."""
    others = 0
    for i in range(many):
        others += _regime(k, i, state[5, i]) != 2.0
    if others == 0:
        for i in range(many):
            state[7, i] = _value_mixed(k, i, state[5, i])
    else:
        for i in range(many):
            state[7, i] = _value_any(k, i, state[5, i])


def _sort(out):
    """Put neighbours in order that rounding exchanged."""
    for lane in range(out.shape[0]):
        for number in range(1, out.shape[1]):
            for back in range(number, 0, -1):
                low, high = out[lane, back - 1], out[lane, back]
                out[lane, back - 1], out[lane, back] = min(low, high), max(low, high)
