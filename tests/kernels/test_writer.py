"""What is written to LLVM does what Python does with the same text."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from cra_sym.kernels import compiled, has_compiler
from cra_sym.kernels.generated import CompileError

pytestmark = pytest.mark.skipif(not has_compiler(), reason="llvmlite is an option")

TEMPLATE = '''
import numpy as np

_LIMIT = 3


def numbers(x, n):
    """Arithmetic of doubles, integers and conditions, each widened where it has to be."""
    a, b = x / 2, -x
    c = a if x > 1 else 0
    big = (n & 1 == 0) + (n > 2) + (x != x)
    power = n ** 3 + x ** -2 + x ** 2.5 + 2 ** 3
    both = 0.5 < x <= 2.0 and not (n == 1 or x == 7.0)
    p, q = (a, n) if both else (b, -n)
    return a, b, c, big, power, both, p, q, n // 3, n % 3, n << 2, n >> 1, abs(b), min(x, 2, n), max(x, n), np.int64(x)


def branches(x, n):
    """Loops of all kinds, a parameter that is assigned, two ways out."""
    total = 0.0
    for i in range(n):
        if i == _LIMIT:
            continue
        total += i * x
        for j in range(2, -1, -1):
            total -= j
    while x < 4.0:
        x = 2.0 * x
        n += 1
    i = n
    for i in range(_LIMIT):
        total += i
    if total > 100.0:
        return n, total
    elif total < -1.0:
        total = np.sqrt(-total) + np.arctan2(1.0, x)
    return i + n, total


def rows(out, matrix, picked):
    """Arrays, their rows, new arrays, integers in them; nothing is given back."""
    sums, counts = np.zeros(matrix.shape[0]), np.empty((2, len(picked)), np.int64)
    for k in range(picked.size):
        counts[0, k] = picked[k]
        counts[1, k] = k > 0
    for i in range(len(matrix)):
        row = matrix[i]
        for k in range(row.size):
            sums[i] += row[k] * counts[0, k] + counts[1, k]
        first, second = row
        out[i] = sums[i] + _difference(first, second)


def _difference(a, b):
    c = (a, b)
    total = 0.0
    for i in range(2):
        total += (1 - 2 * i) * c[i]
    return total


def nothing(x):
    """Does nothing."""
'''


@pytest.fixture(scope="module")
def written():
    return compiled(TEMPLATE, {})


@pytest.fixture(scope="module")
def plain():
    names = {}
    exec(TEMPLATE, names)
    return names


@pytest.mark.parametrize(("x", "n"), [(0.75, 5), (2.0, 1), (7.0, 2), (1.5, 10), (0.5, 4)])
@pytest.mark.parametrize("name", ["numbers", "branches"])
def test_numbers_and_branches(written, plain, name, x, n):
    got, wanted = getattr(written, name)(x, n), plain[name](x, n)
    np.testing.assert_allclose(got, wanted, rtol=1e-15)


def test_not_a_number_is_unlike_itself(written):
    assert written.numbers(math.nan, 1)[3] == 1


def test_arrays(written, plain):
    matrix, picked = np.random.default_rng(1).normal(size=(6, 2)), np.array([3, -2])
    got, wanted = np.empty(6), np.empty(6)
    matrix.flags.writeable = False
    assert written.rows(got, matrix, picked) is None
    plain["rows"](wanted, matrix, picked)
    np.testing.assert_allclose(got, wanted, rtol=1e-15)
    assert written.nothing(1.0) is None


def test_new_arrays_are_given_back(written):
    resource = pytest.importorskip("resource", reason="the peak of a process is asked the Unix way")
    matrix, picked, out = np.ones((200_000, 2)), np.array([1, 1]), np.empty(200_000)
    written.rows(out, matrix, picked)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in range(100):  # of 1.6 MB each
        written.rows(out, matrix, picked)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 20_000


EDGES = '''
import numpy as np


def doubles(x, y):
    """What nan, infinities and signed zeros go through: every result is one rounded operation, or none."""
    less, more = (x < y) + 0, 2 * (x >= y) + (x > y)
    alike, unlike = 2 * (x == y) + (x <= y <= 1.5), 2 * (x != y) + (not x) + 4 * (not x < y)
    ranked = ((x > 0.0) < (y > 0.0)) + 2 * max(x > 0.0, y > 0.0) + 4 * ((x > 0.0) <= (y > 0.0))
    picked, other = x if x else y, (y if x == x and y == y else -x)
    return less, more, alike, unlike, ranked, picked, other, max(x, y), min(x, y, 1.0), abs(x), 1 / x, x / y, x**2


def integers(n, m):
    """Signs in divisions and shifts; a name that is read where only an earlier round assigns it."""
    before = total = 0
    for k in range(n, -3, -2):
        total = 10 * total + k
        if k % 3 == 1:
            continue
        before = k
    return before, total, n // 3, n % 3, -n // 8, -n % 8, n >> 1, n << 5, n & m, n | m, n**3, n / m, abs(n - m)


def rounds(n):
    """A helper makes an array in some rounds only."""
    total = 0.0
    for k in range(n):
        total = 2.0 * total + _last(k % 2, k)
    a, b = total, 1.0
    for i in range(3):
        a, b = b, a
        if n > 1:
            i = -i
        b += i
    return a, b


def _last(odd, k):
    if odd == 1:
        a = np.zeros(3)
        a[2] += k
        return a[2]
    else:
        return -1.0
'''


def test_edges_of_arithmetic():
    entries, names = compiled(EDGES, {}), {}
    exec(EDGES, names)
    values = [np.float64(value) for value in (0.0, -0.0, 1.5, -2.5, math.inf, -math.inf, math.nan)]
    numbers = [-9, -7, -1, 1, 2, 8]
    for name, arguments in (("doubles", (values, values)), ("integers", (numbers, numbers)), ("rounds", (numbers,))):
        for given in itertools.product(*arguments):
            with np.errstate(all="ignore"):
                wanted = np.array(names[name](*given), float)
            got = np.array(getattr(entries, name)(*given), float)
            np.testing.assert_array_equal(got, wanted, err_msg=f"{name}{given}")
            known = ~np.isnan(wanted)
            np.testing.assert_array_equal(np.signbit(got[known]), np.signbit(wanted[known]), err_msg=f"{name}{given}")


REFUSED = {
    "with open(x) as f:\n        pass": "nothing like: with open",
    "return [x]": r"nothing like: \[x\]",
    "return x & 1.5": "BitAnd of double",
    "for i in range(2):\n        y = 0\n        y = x\n    return y": "double where i64 is expected",
    "for i in range(x.size):\n        x[i] = 0.0": "x is read-only",
    "for i in range(x.size):\n        y = np.empty(3)": "outside of loops",
    "return np.sort_complex(x)": "sort_complex",
    "return x // 2": "FloorDiv of double",
    "return 6 % np.int64(x)": "Mod by anything but a constant",
    "return np.int64(x) // -2": "FloorDiv by anything but a constant",
    "return 1 << np.int64(x)": "LShift by anything but a constant",
    "return np.int64(x) << 64": "LShift by anything but a constant",
    "return np.int64(x) ^ 1": "nothing like: return",
    "return np.int64(x) + 2**63": "9223372036854775808 where i64 is expected",
    "return x or 2.0": "nothing like: x or 2.0",
    "return x + 1 / 0": "nothing like: return",
    "return max((x, 1.0))": "nothing like: return",
    "return entry(x)": "nothing like: return",
    "return unknown(x)": "nothing like: return",
    "return entry": "is not a number",
    "return x\n    return 0.0": "nothing like: return x",
    "y = x > 0.0\n    if x > 1.0:\n        y = 5\n    return y": "5 where i1 is expected",
    "if x > 1.0:\n        return x > 2.0\n    return 5": "5 where i1 is expected",
    "if x > 1.0:\n        return x": "all ways out return as much",
    "if x > 1.0:\n        return x\n    return x, x": "all ways out return as much",
    "if x > 1.0:\n        return x\n    return (x,)": "all ways out return as much",
    "if x > 0.0:\n        y = (1.0, x)\n    else:\n        y = (2.0, x)\n    return y[0]": "y has no value yet",
    "y = 1.0\n    if x > 0.0:\n        y = (2.0, x)\n    return 0.0": "y is assigned again",
    "y = (1.0, x)\n    while x > 0.0:\n        y = (y[1], y[0])\n    return y[0]": "y is assigned again",
    "for k in range(9):\n        if k > 0:\n            x = np\n        np = x\n    return x": "np has no value yet",
    "for k in range(3):\n        x += k\n    else:\n        x = 0.0\n    return x": "nothing like: for k in",
    "while x > 3.0:\n        x -= 1.0\n    else:\n        x = 0.0\n    return x": "nothing like: while x",
    "for k in range(0, 9, np.int64(x)):\n        x += k\n    return x": "in constant steps",
    "for k in range(x):\n        x += k\n    return x": "ranges are of integers",
    "return x[-1] + x.size": "count from the start",
    "return x[x[0]] + x.size": "indices are integers",
    "y = np.zeros((2, x.size))\n    if x[0] > 0.0:\n        y[1] = 1.0\n    return y": r"y\[1\] is not one element",
    "y = np.zeros(2, np.int32)\n    if x > 0.0:\n        y[0] = 1\n    return y[0]": "neither np.float64 nor",
}


@pytest.mark.parametrize("body", REFUSED)
def test_what_it_cannot_write_is_refused(body):
    readonly = np.broadcast_to(1.0, (1,))
    value = readonly if ".size" in body else 1.5
    entry = compiled(f"import numpy as np\n\n\ndef entry(x):\n    {body}\n", {}).entry
    with pytest.raises(CompileError, match=REFUSED[body]):
        entry(value)


def test_strides_are_refused(written):
    with pytest.raises(CompileError, match="contiguous"):
        written.rows(np.empty(4), np.ones((2, 4)).T, np.array([1, 1]))


CALLED = '''
import numpy as np

_CALLED = ("_filled",)


def fill(out, x):
    """Rows of arrays and single arrays, a constant and a number, from two places each; and what it refuses."""
    for row in range(out.shape[0]):
        _filled(out[row], x, row)
    _filled(out[0], x, 7)
    _filled(out[1], x, out.shape[1])


def _filled(out, x, n):
    for lane in range(out.size):
        out[lane] = x[lane] * x[lane] + n
'''


def test_a_function_that_is_called_is_written_once():
    """It does the same, and is refused where only what is written out at each call can be."""
    out, x, expected = np.zeros((3, 5)), np.arange(5.0), np.zeros((3, 5))
    compiled(CALLED, {}).fill(out, x)
    names: dict = {}
    exec(CALLED, names)
    names["fill"](expected, x)
    np.testing.assert_array_equal(out, expected)
    with pytest.raises(CompileError, match="must return nothing"):
        compiled(CALLED + "    return n\n", {}).fill(out, x)
