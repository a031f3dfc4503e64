# mypy: ignore-errors
"""Template of the compiled version of the inner loop of `cra_sym.solvers.floquet`: the same steps, in one pass each.

This text is compiled by `cra_sym.kernels.compiled`. The batch axis is innermost, so that its loops vectorise.
"""

import numpy as np


def propagate(drifts, h, kicks, commutator, swings, coupling, compliance, epsilon, state):
    """Propagate ``state`` in place; arguments as `cra_sym.solvers.floquet.Loop` has them."""
    stages, modes, points = kicks.size, coupling.shape[1], h.size
    total, weight = np.empty((modes, modes, points)), np.empty(points)
    force, again = np.empty((modes, 1, points)), np.empty((modes, 1, points))
    for step in range(len(swings)):
        for stage in range(stages):
            _drift(drifts[stages if stage == 0 and step > 0 else stage], state, weight)
            _stiffness(coupling, compliance, epsilon, swings[step, stage], weight, total)
            for j in range(2 * modes):
                _apply(total, state, j, force)
                for k in range(points):
                    weight[k] = -kicks[stage] * h[k]
                _add(state, j, weight, force)
                if 2 * stage == stages - 1:
                    _apply(total, force, 0, again)
                    for k in range(points):
                        weight[k] = commutator * h[k] ** 3
                    _add(state, j, weight, again)
    _drift(drifts[0], state, weight)


def _stiffness(coupling, compliance, epsilon, waves, weight, total):
    for r in range(len(coupling)):
        soft, size = compliance[r], epsilon[r]
        for k in range(weight.size):
            swing = size[k] * waves[r]
            weight[k] = swing / (1.0 + soft[k] * swing)
        for i in range(len(total)):
            for n in range(len(total)):
                p, out = coupling[r, i, n], total[i, n]
                for k in range(weight.size):
                    out[k] = p[k] * weight[k] + (out[k] if r else 0.0)


def _apply(matrix, columns, j, out):
    for i in range(len(matrix)):
        total = out[i, 0]
        for n in range(len(matrix)):
            c, q = matrix[i, n], columns[n, j]
            for k in range(total.size):
                total[k] = c[k] * q[k] + (total[k] if n else 0.0)


def _add(state, j, weight, term):
    for i in range(len(term)):
        p, f = state[len(term) + i, j], term[i, 0]
        for k in range(weight.size):
            p[k] += weight[k] * f[k]


def _drift(m, state, moved):
    modes = m.shape[2]
    for i in range(modes):
        m00, m01, m10, m11 = m[0, 0, i], m[0, 1, i], m[1, 0, i], m[1, 1, i]
        for j in range(2 * modes):
            q, p = state[i, j], state[modes + i, j]
            for k in range(moved.size):
                moved[k] = m00[k] * q[k] + m01[k] * p[k]
                p[k] = m10[k] * q[k] + m11[k] * p[k]
            for k in range(moved.size):
                q[k] = moved[k]
