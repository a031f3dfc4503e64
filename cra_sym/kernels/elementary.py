"""Branch-free elementary functions in double precision, which a compiler turns into SIMD code.

The text of this module is put at the head of every compiled module. Sine, cosine and exponential reduce their argument
by Cody and Waite's scheme: the constant is split into parts whose products with the quotient are exact, so fusing a
multiplication with an addition is harmless while reassociation is not allowed. Their polynomials come from Chebyshev
interpolation, those of sinh and log are Taylor's. Largest errors seen against extended precision at 4e5 points: sin 1.6
and cos 1.8 units in the last place for abs(x) up to 4000, zeros included; exp 1.2 over its whole range.
"""

import numpy as np

_ROUND = 6755399441055744.0  # 1.5 * 2**52: adding it leaves the nearest integer in the lowest bits
_EXPONENT = 0x4338000000000000 - 2 * 1023  # the bits of _ROUND, less twice the bias of an exponent
_LN2, _LN2_REST = 0.6931471803691238, 1.9082149292705877e-10  # the first has 21 bits to spare
_HALF_ROOT = int(np.float64(0.5**0.5).view(np.int64))  # the bits of the smallest significand that log uses unscaled
_SMALLEST = 2.0**-1022  # normal number
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


def tan(x):
    """Tangent; nan where abs(x) exceeds 1e6."""
    r, quadrant = _reduced(x)
    s, c = _sine(r), _cosine(r)
    value = (-c if quadrant & 1 else s) / (s if quadrant & 1 else c)
    return x if x == 0.0 else value


def _grown(x, doublings):
    """Return exp(x) times a power of two, over the whole range."""
    x = -746.0 if x < -746.0 else x
    x = 712.0 if x > 712.0 else x
    shifted = x * 1.4426950408889634 + _ROUND
    n = shifted - _ROUND
    r = (x - n * _LN2) - n * _LN2_REST
    p = 2.761390867578486e-07 + r * 2.509563297507093e-08
    p = 2.480153620505534e-05 + r * (2.755727992579576e-06 + r * p)
    p = 0.0013888888905973543 + r * (0.00019841269854409363 + r * p)
    p = 0.041666666666651246 + r * (0.008333333333332147 + r * p)
    p = 1.0 + (r + r * r * (0.5 + r * (0.16666666666666666 + r * p)))
    power = np.float64(shifted).view(np.int64) - _EXPONENT + doublings
    half = (power >> 1) & 0x7FF  # 2**n in two factors, so that neither leaves the range when the result does not
    return p * np.int64(half << 52).view(np.float64) * np.int64((power - half) << 52).view(np.float64)


def exp(x):
    """Exponential, over the whole range."""
    return _grown(x, 0)


def cosh(x):
    """Hyperbolic cosine, over the whole range."""
    half = _grown(abs(x), -1)
    return half + 0.25 / half


def _sinh_near(x):
    """Return the hyperbolic sine by its series, for abs(x) below 2."""
    z = x * x
    p = 1.0 / 51090942171709440000.0 + z * (1.0 / 25852016738884976640000.0)
    p = 1.0 / 355687428096000.0 + z * (1.0 / 121645100408832000.0 + z * p)
    p = 1.0 / 6227020800.0 + z * (1.0 / 1307674368000.0 + z * p)
    p = 1.0 / 362880.0 + z * (1.0 / 39916800.0 + z * p)
    p = 1.0 / 6.0 + z * (1.0 / 120.0 + z * (1.0 / 5040.0 + z * p))
    return x + x * z * p


def sinh(x):
    """Hyperbolic sine, over the whole range."""
    half = _grown(abs(x), -1)
    far = half - 0.25 / half
    far = far if x > 0.0 else -far
    return _sinh_near(x) if abs(x) < 2.0 else far


def tanh(x):
    """Hyperbolic tangent, over the whole range."""
    far = 1.0 - 2.0 / (_grown(2.0 * abs(x), 0) + 1.0)
    far = far if x > 0.0 else -far
    return _sinh_near(x) / cosh(x) if abs(x) < 0.55 else far


def log(x):
    """Natural logarithm, over the whole range."""
    normal = x >= _SMALLEST
    bits = np.float64(x if normal else x * 18014398509481984.0).view(np.int64)
    power = (bits - _HALF_ROOT) >> 52
    f = np.int64(bits - (power << 52)).view(np.float64) - 1.0
    n = (np.int64(power + 0x4338000000000000).view(np.float64) - _ROUND) - (0.0 if normal else 54.0)
    s = f / (2.0 + f)
    z = s * s
    p = 2.0 / 17.0 + z * (2.0 / 19.0 + z * (2.0 / 21.0 + z * (2.0 / 23.0)))
    p = 2.0 / 11.0 + z * (2.0 / 13.0 + z * (2.0 / 15.0 + z * p))
    p = z * (2.0 / 3.0 + z * (2.0 / 5.0 + z * (2.0 / 7.0 + z * (2.0 / 9.0 + z * p))))
    square = 0.5 * f * f
    value = n * _LN2 - ((square - (s * (square + p) + n * _LN2_REST)) - f)
    value = value if x < np.inf else x
    return value if x > 0.0 else (-np.inf if x == 0.0 else np.nan)
