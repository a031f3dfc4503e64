"""What is written to LLVM does what Python does with the same text."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cra_sym.kernels import compiled, has_compiler

pytestmark = pytest.mark.skipif(not has_compiler(), reason="Numba is an option")

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


REFUSED = {
    "with open(x) as f:\n        pass": "nothing like: with open",
    "return [x]": r"nothing like: \[x\]",
    "return x & 1.5": "BitAnd of double",
    "for i in range(2):\n        y = 0\n        y = x\n    return y": "double where i64 is expected",
    "for i in range(x.size):\n        x[i] = 0.0": "x is read-only",
    "for i in range(x.size):\n        y = np.empty(3)": "outside of loops",
    "return np.sort_complex(x)": "sort_complex",
}


@pytest.mark.parametrize("body", REFUSED)
def test_what_it_cannot_write_is_refused(body):
    import numba

    readonly = np.broadcast_to(1.0, (1,))
    value = readonly if ".size" in body else 1.5
    entry = compiled(f"import numpy as np\n\n\ndef entry(x):\n    {body}\n", {}).entry
    with pytest.raises(numba.errors.NumbaError, match=REFUSED[body]):
        entry(value)


def test_strides_are_refused(written):
    import numba

    with pytest.raises(numba.errors.NumbaError, match="contiguous"):
        written.rows(np.empty(4), np.ones((2, 4)).T, np.array([1, 1]))
