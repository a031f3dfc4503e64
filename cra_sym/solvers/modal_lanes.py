# ruff: noqa: B007, B018, F821, F841, RUF059
# mypy: ignore-errors
"""Template of the compiled twin of `cra_sym.solvers.one_wave_shapes`: the same, for blocks of lanes, mode by mode.

This text is specialised by `cra_sym.kernels.compiled` with the functions of one structure. Placeholders for sizes and
argument lists are capital letters between double underscores.
"""

import numpy as np

_NEAR = __NEAR__
_LANES = 64
_STEP = 16  # lanes are padded to a multiple of it, so that no loop needs a remainder
_FIRST = __FIRST__  # rows up to the amplitudes of waves, the momentum among them
_MOMENTUM = __MOMENTUM__
_WAVES = __WAVES_SIZE__
_RATES = __RATES_FROM__  # rows from here on follow from those before
_ROWS = __ROWS_SIZE__


def fill(table, row, units, lam, __GROUPS__, start, stop):
    """Fill ``table`` (rows, lanes, modes) from lane ``start`` to ``stop`` with the rows from ``row`` on.

    Each is multiplied by its entry in ``units`` (1 or lanes, rows).
    """
    line, b, w = np.empty((__LINE_SIZE__, _LANES)), np.empty(_LANES), np.empty((_ROWS, _LANES))
    apart = 0 if units.shape[0] == 1 else 1
    for first in range(start, stop, _LANES):
        real = min(_LANES, stop - first)
        size = (real + _STEP - 1) // _STEP * _STEP
        for lane in range(size):
            i = first + min(lane, real - 1)
            __PREPARE__
        for lane in range(size):
            __PREPARED__
        for number in range(lam.shape[1]):
            for lane in range(size):
                b[lane] = lam[first + min(lane, real - 1), number]
            near = 0
            for lane in range(size):
                near += _power(b[lane]) < _NEAR
            if near < size:
                for lane in range(size):
                    _far(w, b[lane], line, lane)
            if near > 0:
                for lane in range(size):
                    _near(w, b[lane], 1.0 if number == 0 else 0.0, line, lane)
            if row >= _RATES:
                for lane in range(size):
                    _rates(w, b[lane], line, lane)
            for j in range(table.shape[0]):
                for lane in range(real):
                    i = first + lane
                    table[j, i, number] = (w[row + j, lane] + 0.0) * units[i * apart, j]


def _power(lam):
    return __POWER__


def _far(w, lam, line, lane):
    cosine, sine, decay, z = cos(lam), sin(lam), exp(-lam), _power(lam)
    __LEFT__, __WAVES__ = amplitudes_far(__AMPLITUDES_FAR__)
    __RAW__ = tip_far(__TIP_FAR__)
    invariant, inverse = invariant_far(__INVARIANT_FAR__)[0], 1.0 / z
    __END__ = end_state(__END_STATE__)
    mass = generalised_mass(__GENERALISED_MASS__)[0]
    scale = (-1.0 if leading(__LEADING__)[0] < 0.0 else 1.0) / np.sqrt(mass)
    found, waves = rows(__ROWS__), (__WAVES__)
    for i in range(_FIRST):
        w[i, lane] = found[i] * scale
    for i in range(_WAVES):
        w[_FIRST + i, lane] = waves[i] * scale
    for i in range(_FIRST, _RATES - _WAVES):
        w[_WAVES + i, lane] = found[i] * scale


def _near(w, lam, first, line, lane):
    z = _power(lam)
    __KRYLOV__ = polynomials(1.0, z)
    __LEFT__ = __AMPLITUDES_NEAR__
    __RAW__ = tip_near(__TIP_NEAR__)
    still, rigid = z == 0.0, rigid_body(__RIGID_BODY__)
    __STILL__
    invariant, inverse = invariant_near(__INVARIANT_NEAR__)[0], 1.0 / z
    __END__ = end_state(__END_STATE__)
    mass = generalised_mass(__GENERALISED_MASS__)[0]
    mass = rigid[__RIGID_MASS__] if still else mass
    scale = (-1.0 if leading(__LEADING__)[0] < 0.0 else 1.0) / np.sqrt(mass)
    found = rows(__ROWS__)
    for i in range(_FIRST):
        w[i, lane] = found[i] * scale if z < _NEAR else w[i, lane]
    w[_MOMENTUM, lane] = rigid[__RIGID_MASS__ + 1] * scale if still else w[_MOMENTUM, lane]
    for i in range(_FIRST, _FIRST + _WAVES):
        w[i, lane] = 0.0 if z < _NEAR else w[i, lane]
    for i in range(_FIRST, _RATES - _WAVES):
        w[_WAVES + i, lane] = found[i] * scale if z < _NEAR else w[_WAVES + i, lane]


def _rates(w, lam, line, lane):
    square = __FREQUENCY__
    root = 1.0 / square
    found = rates(__RATES__)
    for i in range(_ROWS - _RATES):
        w[_RATES + i, lane] = found[i]


def _amplitudes_near(rows):
    """Return the amplitudes from whichever tip condition cancels less; each row entry comes with its magnitude."""
    first = _loss(rows[0], rows[1], rows[2], rows[3]) <= _loss(rows[4], rows[5], rows[6], rows[7])
    left, right = rows[0] if first else rows[4], rows[2] if first else rows[6]
    scale = 1.0 / max(abs(left), abs(right), 2.2250738585072014e-308)
    return right * scale, -left * scale


def _loss(left, left_magnitude, right, right_magnitude):
    one = left_magnitude / abs(left) if left_magnitude > 0.0 else 1.0
    two = right_magnitude / abs(right) if right_magnitude > 0.0 else 1.0
    return np.inf if (left == 0.0) & (right == 0.0) else max(one, two)
