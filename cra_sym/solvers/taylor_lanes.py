# mypy: ignore-errors
"""Template of the compiled version of `cra_sym.solvers.taylor`: the same series, a few systems at a time.

This text is compiled by `cra_sym.kernels.compiled`. The innermost axis has all columns of the states of ``chunk``
systems, so that its loops vectorise and what they read stays in the cache.
"""

import numpy as np


def propagate(
    kinds,
    targets,
    starts,
    sources,
    swings,
    shared,
    values,
    first_inverse,
    inverse,
    kept,
    rows,
    moved,
    waves,
    counts,
    sizes,
    soft_rows,
    soft,
    h,
    rate,
    limit,
    least,
    order,
    chunk,
    out,
):
    """Write the maps over all steps to ``out``; arguments as `cra_sym.solvers.taylor_operations.Loop` has them."""
    columns, width = out.shape[1], out.shape[1] * chunk
    size, force = columns // 2, columns
    own, own_h, own_rate = np.empty((len(values), width)), np.empty(width), np.empty(width)
    own_sizes, state = np.empty((len(sizes), width)), np.empty((columns, width))
    vectors, total = np.empty((kept + order * rows, width)), np.empty(width)
    start, ratio = np.empty(width), np.empty(width)
    own_soft, softened = np.empty((len(soft), width)), np.empty((len(soft), order, width))
    done = 0
    while done < h.size:
        first = min(done, h.size - chunk)
        for e in range(len(values)):
            if shared[e] > 0:
                own[e, 0] = values[e, 0]
            elif values.shape[1] > 1:
                _spread(values[e], first, chunk, own[e])
        _spread(h, first, chunk, own_h)
        _spread(rate, first, chunk, own_rate)
        for r in range(len(sizes)):
            _spread(sizes[r], first, chunk, own_sizes[r])
        for r in range(len(soft)):
            _spread(soft[r], first, chunk, own_soft[r])
        for i in range(columns):
            for j in range(columns):
                for k in range(chunk):
                    state[i, j * chunk + k] = 1.0 if i == j else 0.0
        known = least
        for step in range(len(waves)):
            for e in range(inverse.shape[1]):
                _spread(inverse[step, e], first, chunk, own[first_inverse + e])
            for r in range(len(soft_rows)):
                if soft_rows[r] >= 0:
                    _soften(waves[step, r], own_soft[soft_rows[r]], softened[soft_rows[r]])
            for i in range(columns):
                for k in range(width):
                    vectors[i, k] = state[i, k]
            _norms(vectors, size, own_rate, start)
            term, going, before, last = 0, 1, np.inf, np.inf
            while term < order and going > 0:
                shift = term * rows
                for o in range(len(kinds)):
                    target = vectors[targets[o] + (shift if targets[o] >= kept else 0)]
                    if kinds[o] < 2:
                        _combine(own, shared, sources, starts[o], starts[o + 1], kinds[o], vectors, kept, shift, target)
                    else:
                        r, e = swings[o], starts[o]
                        if soft_rows[r] < 0:
                            _series(vectors, rows, sources[e], term, waves[step, r], counts[r], total)
                        else:
                            _soft_series(vectors, rows, sources[e], term, softened[soft_rows[r]], total)
                        _scale(total, own[e, 0], own_sizes[r], kinds[o] - 2, target)
                term += 1
                for i in range(size):
                    q, p, u, f = vectors[i], vectors[size + i], vectors[moved + i], vectors[force + i]
                    q_end, p_end, share = state[i], state[size + i], 1.0 / term
                    for k in range(width):
                        fraction = own_h[k] * share
                        q[k] = u[k] * fraction
                        p[k] = -f[k] * fraction
                        q_end[k] += q[k]
                        p_end[k] += p[k]
                if limit > 0.0 and term + 3 >= known:
                    _norms(vectors, size, own_rate, ratio)
                    largest = 0.0
                    for k in range(width):
                        largest = max(largest, ratio[k] / start[k])
                    largest = np.sqrt(largest)
                    if before < np.inf and largest < before and largest * np.sqrt(largest / before) <= limit:
                        going = 0
                    before, last = last, largest
            known = max(least, term)
        for i in range(columns):
            for j in range(columns):
                for k in range(chunk):
                    out[first + k, i, j] = state[i, j * chunk + k]
        done += chunk


def _spread(values, first, chunk, wide):
    """Repeat the values of the systems for every column."""
    start = 0
    while start < wide.size:
        for k in range(chunk):
            wide[start + k] = values[first + k]
        start += chunk


def _norms(vectors, size, rate, out):
    for k in range(out.size):
        out[k] = 0.0
    for i in range(size):
        q, p = vectors[i], vectors[size + i]
        for k in range(out.size):
            out[k] += (rate[k] * q[k]) * (rate[k] * q[k]) + p[k] * p[k]


def _combine(values, shared, sources, start, stop, added, vectors, kept, shift, target):
    """Set the target to a linear combination of vectors, or add it."""
    e = start
    if added == 0 and start == stop:
        for k in range(target.size):
            target[k] = 0.0
    elif added == 0:
        vector = vectors[sources[e] + (shift if sources[e] >= kept else 0)]
        if shared[e] == 0:
            factors = values[e]
            for k in range(target.size):
                target[k] = factors[k] * vector[k]
            e += 1
        elif e + 1 < stop and shared[e + 1] > 0:
            other = vectors[sources[e + 1] + (shift if sources[e + 1] >= kept else 0)]
            a, b = values[e, 0], values[e + 1, 0]
            for k in range(target.size):
                target[k] = a * vector[k] + b * other[k]
            e += 2
        else:
            factor = values[e, 0]
            for k in range(target.size):
                target[k] = factor * vector[k]
            e += 1
    while e < stop:
        vector = vectors[sources[e] + (shift if sources[e] >= kept else 0)]
        if shared[e] == 0:
            factors = values[e]
            for k in range(target.size):
                target[k] += factors[k] * vector[k]
            e += 1
        elif e + 1 < stop and shared[e + 1] > 0:
            other = vectors[sources[e + 1] + (shift if sources[e + 1] >= kept else 0)]
            a, b = values[e, 0], values[e + 1, 0]
            for k in range(target.size):
                target[k] += a * vector[k] + b * other[k]
            e += 2
        else:
            factor = values[e, 0]
            for k in range(target.size):
                target[k] += factor * vector[k]
            e += 1


def _series(vectors, rows, source, term, wave, count, total):
    """Set ``total`` to a coefficient of the product of a wave and the series whose coefficients are kept."""
    stop, now = min(count, term + 1), source + term * rows
    j = (stop + 3) % 4 + 1  # what is left makes whole fours
    here, a = vectors[now], wave[0]
    if j == 1:
        for k in range(total.size):
            total[k] = a * here[k]
    elif j == 2:
        one, b = vectors[now - rows], wave[1]
        for k in range(total.size):
            total[k] = a * here[k] + b * one[k]
    elif j == 3:
        one, two, b, c = vectors[now - rows], vectors[now - 2 * rows], wave[1], wave[2]
        for k in range(total.size):
            total[k] = (a * here[k] + b * one[k]) + c * two[k]
    else:
        one, two, three = vectors[now - rows], vectors[now - 2 * rows], vectors[now - 3 * rows]
        b, c, d = wave[1], wave[2], wave[3]
        for k in range(total.size):
            total[k] = (a * here[k] + b * one[k]) + (c * two[k] + d * three[k])
    while j < stop:
        a, b, c, d = wave[j], wave[j + 1], wave[j + 2], wave[j + 3]
        p, q = vectors[now - j * rows], vectors[now - (j + 1) * rows]
        r, s = vectors[now - (j + 2) * rows], vectors[now - (j + 3) * rows]
        for k in range(total.size):
            total[k] += (a * p[k] + b * q[k]) + (c * r[k] + d * s[k])
        j += 4


def _soften(wave, soft, out):
    """Set the coefficients of a wave w to those of w / (1 + soft w)."""
    for j in range(len(out)):
        row = out[j]
        for k in range(soft.size):
            row[k] = 0.0
        for i in range(1, j + 1):
            a, before = wave[i], out[j - i]
            for k in range(soft.size):
                row[k] += a * before[k]
        a, b = wave[j], wave[0]
        for k in range(soft.size):
            row[k] = (a - soft[k] * row[k]) / (1.0 + soft[k] * b)


def _soft_series(vectors, rows, source, term, waves, total):
    """As `_series`, with a wave for every system."""
    for k in range(total.size):
        total[k] = 0.0
    for j in range(term + 1):
        wave, p = waves[j], vectors[source + (term - j) * rows]
        for k in range(total.size):
            total[k] += wave[k] * p[k]


def _scale(total, sign, sizes, added, target):
    """Set the target to the sizes times ``total``, or add it."""
    if added == 0:
        for k in range(target.size):
            target[k] = sign * sizes[k] * total[k]
    else:
        for k in range(target.size):
            target[k] += sign * sizes[k] * total[k]
