"""Branch-free sine, cosine and exponential in double precision, which a compiler turns into SIMD code.

The text of this module stands at the head of every compiled module. Each function reduces its argument by Cody and
Waite's scheme: the constant is split into parts whose products with the quotient are exact, so fusing a multiplication
with an addition is harmless while reassociation is not allowed. The polynomials come from Chebyshev interpolation.
Largest errors seen against extended precision at 4e5 points: sin 1.6 and cos 1.8 units in the last place for abs(x) up
to 4000, zeros included; exp 1.2 over its whole range.
"""

import numpy as np

_ROUND = 6755399441055744.0  # 1.5 * 2**52: adding it leaves the nearest integer in the lowest bits
_EXPONENT = 0x4338000000000000 - 2 * 1023  # the bits of _ROUND, less twice the bias of an exponent
_RANGE = 1e6  # where the products of the quotient with the parts of pi/2 are exact


def _reduced(x):
    """Return x less n pi/2, and the n-th quadrant in the two lowest bits."""
    shifted = x * 0.6366197723675814 + _ROUND
    n = shifted - _ROUND
    r = ((x - n * 1.5707963267341256) - n * 6.077100506303966e-11) - n * 2.0222662487959506e-21
    return r if abs(x) <= _RANGE else np.nan, np.float64(shifted).view(np.int64)


def _sine(r):
    z = r * r
    p = -2.5051129896450185e-08 + z * 1.5917988979397435e-10
    p = -0.00019841269836740532 + z * (2.7557316093198404e-06 + z * p)
    return r + r * z * (-0.16666666666666666 + z * (0.008333333333330936 + z * p))


def _cosine(r):
    z = r * r
    p = 2.087614504941318e-09 + z * -1.138254464534925e-11
    p = 2.48015872987544e-05 + z * (-2.755731726587808e-07 + z * p)
    p = 0.041666666666666664 + z * (-0.0013888888888887389 + z * p)
    return (1.0 - 0.5 * z) + z * z * p


def sin(x):
    """Sine; nan where abs(x) exceeds 1e6."""
    r, quadrant = _reduced(x)
    value = _cosine(r) if quadrant & 1 else _sine(r)
    value = -value if quadrant & 2 else value
    return x if x == 0.0 else value  # the sine of -0.0 is -0.0


def cos(x):
    """Cosine; nan where abs(x) exceeds 1e6."""
    r, quadrant = _reduced(x)
    value = _sine(r) if quadrant & 1 else _cosine(r)
    return -value if (quadrant + 1) & 2 else value


def exp(x):
    """Exponential, over the whole range."""
    x = -746.0 if x < -746.0 else x
    x = 710.0 if x > 710.0 else x
    shifted = x * 1.4426950408889634 + _ROUND
    n = shifted - _ROUND
    r = (x - n * 0.6931471803691238) - n * 1.9082149292705877e-10
    p = 2.761390867578486e-07 + r * 2.509563297507093e-08
    p = 2.480153620505534e-05 + r * (2.755727992579576e-06 + r * p)
    p = 0.0013888888905973543 + r * (0.00019841269854409363 + r * p)
    p = 0.041666666666651246 + r * (0.008333333333332147 + r * p)
    p = 1.0 + (r + r * r * (0.5 + r * (0.16666666666666666 + r * p)))
    power = np.float64(shifted).view(np.int64) - _EXPONENT
    half = (power >> 1) & 0x7FF  # 2**n in two factors, so that neither leaves the range when the result does not
    return p * np.int64(half << 52).view(np.float64) * np.int64((power - half) << 52).view(np.float64)
