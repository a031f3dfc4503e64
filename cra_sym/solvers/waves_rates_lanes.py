# ruff: noqa: F821
# mypy: ignore-errors
"""Template of the compiled version of `cra_sym.solvers.waves_rates.root_rates`: the same, for blocks of lanes at once.

It is followed (see `waves_rates.rate_template`) by functions of a lane, ``_regime``, and of lanes in one regime,
``_rates_in``.
"""

import numpy as np

_LANES = 128


def rates(out, k, z):
    """Fill ``out`` (entries, modes, rows) with dz/dk from coefficients ``k`` (entries, rows) and z (modes, rows)."""
    entries, rows = k.shape[0], k.shape[1]
    own, moved, found = np.empty((entries, _LANES)), np.empty((entries, _LANES)), np.empty((entries, _LANES))
    regime, place, there = np.empty(_LANES, np.int64), np.empty(_LANES, np.int64), np.empty(_LANES)
    for first in range(0, rows, _LANES):
        size = min(_LANES, rows - first)
        for entry in range(entries):
            for lane in range(size):
                own[entry, lane] = k[entry, first + lane]
        for number in range(z.shape[0]):
            for lane in range(size):
                regime[lane] = np.int64(_regime(own, lane, z[number, first + lane]))
            for kind in range(_KINDS):
                many = 0
                for lane in range(size):
                    place[many] = lane
                    many += regime[lane] == kind
                for i in range(many):
                    there[i] = z[number, first + place[i]]
                for entry in range(entries):
                    for i in range(many):
                        moved[entry, i] = own[entry, place[i]]
                _rates_in(found, moved, there, kind, many)
                for entry in range(entries):
                    for i in range(many):
                        out[entry, number, first + place[i]] = found[entry, i]
