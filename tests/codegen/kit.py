"""Every construct and operator of the restricted form in one text, with traps for printers, and a runner of folders."""

from __future__ import annotations

import math
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

import cra_sym as cra
from cra_sym.codegen import arm_library, user_model
from cra_sym.codegen.library import Check, Library

TEXT = '''
PI = 3.141592653589793  # half a turn
COUNT = 3  # of a table
TABLE = (0.1, -2.5, 1e-300)
WHOLE = (4, -7, 11)


class Box:
    """A record of one of each."""

    size: float  # m
    number: int
    flag: bool
    row: Row[float, COUNT]  # some numbers
    whole: Row[int, 2]


def brackets(a: float, b: float, c: float) -> float:
    """Return sums and quotients whose brackets matter."""
    total = a - (b - c)
    total += a / (b * c) + a * (b / c) - a / b / c  # not the same
    total = total * (a + b) - -(a * b) - (-a) * b
    total -= (a - b) * (a + b) / (c + 3.0)
    return total / 1e-5 + -(-(-c))


def halves(k: int) -> float:
    """Return what a printer may divide before it converts."""
    return float(k - 1) / 2.0 + float(k // 3) / float(k % 5 + 1) - float(-k) * 0.5


def whole_numbers(k: int, n: int) -> int:
    """Return integer arithmetic."""
    m = k // (n + 1) * n - (k + n) % 7 * (3 - (k - 1))
    return min(m, abs(k - 2 * n)) - max(-m, n) + int(float(m) / 2.0 - 0.7)


def chosen(a: float, b: float, flag: bool) -> float:
    """Return nested choices and conditions."""
    if a > b and not flag:
        answer = 1.0
    elif a == b or (flag and a != 0.0):
        answer = 2.0 if a < 1.0 else 3.0 if b < 1.0 else 4.0
    else:
        answer = -1.0
    same = (a > 0.0) == (b > 0.0)
    other = (a > 0.0) != flag
    if same == other:
        answer = answer * 2.0
    if not (a <= b or b <= a):  # not a number
        answer = 100.0
    return answer if same or not other else answer + 0.5


def loops(n: int, limit: float) -> float:
    """Return what loops of all kinds sum up to."""
    total = 0.0
    for i in range(n):
        if i == 2:
            continue
        for j in range(i, -1, -1):
            if j * 3 > n + i:
                break
            total += float(j) * 1.25 - total / 7.0
    for i in range(1, n + 1):
        total = total * 0.75 + float(i)
    step = 1.0
    # a comment that stands alone
    while total > limit and step > 1e-3:
        step = step * 0.5
        before = total
        total = total - step * before
    return total


def _fill(item: Mut[Box], start: float, factors: Row[float, COUNT]) -> None:
    for i in range(COUNT):
        item.row[i] = start * factors[i] + TABLE[i]
    item.size = item.row[0] - item.row[2]
    item.number += WHOLE[1] + 1
    item.flag = item.size > 0.0


def make_box(start: float, item: Out[Box]) -> None:
    """Make a item."""
    factors = zeros(COUNT)
    factors[0] = 1.0
    factors[COUNT - 1] = start
    _fill(item, start, factors)
    item.whole[0] = COUNT
    item.whole[1] = item.number
    size = item.size
    _fill(item, size, TABLE)


def _root(x: float) -> float:
    if x < 0.0:
        raise InvalidArgument("x must be in [0, inf)")
    return sqrt(x)


def roots(x: float, n: int, found: Out[Row[float, n]]) -> int:
    """Return x, its root, the root of that and so on, and how many were not 1."""
    if n < 1:
        raise InvalidArgument("n must be positive")
    value = x
    steps = 0
    for i in range(n):
        found[i] = value
        value = _root(value)
        if value != 1.0:
            steps += 1
    if steps == 13:
        raise NotConverged
    return steps


def boxes(start: float, n: int, made: Out[Row[Box, n]]) -> None:
    """Make a row of boxes, each from the one before."""
    value = start
    for i in range(n):
        make_box(value, made[i])
        value = made[i].row[1] - 0.5 * made[i].size


def functions(x: float, a: float, out: Mut[Row[float, 24]]) -> None:
    """Put in every function; x in (-1, 1), a in (0, inf)."""
    out[0] = sqrt(a)
    out[1] = exp(x)
    out[2] = expm1(x)
    out[3] = log(a)
    out[4] = log1p(a)
    out[5] = sin(100.0 * x)
    out[6] = cos(100.0 * x)
    out[7] = tan(x)
    out[8] = asin(x)
    out[9] = acos(x)
    out[10] = atan(a)
    out[11] = sinh(x)
    out[12] = cosh(x)
    out[13] = tanh(x)
    out[14] = asinh(x)
    out[15] = acosh(2.0 + a)
    out[16] = atanh(x)
    out[17] = floor(10.0 * x)
    out[18] = ceil(10.0 * x)
    out[19] = abs(x)
    out[20] = atan2(x, -a)
    out[21] = pow(a, x)
    out[22] = min(x, a) - max(x, a)
    out[23] = 1.0 if isfinite(x * a) and isfinite(PI) else 0.0


def traps(a: float, b: float, k: int, n: int, row: Mut[Row[float, 12]]) -> None:
    """Put in what precedence, long lines and text may spoil; it isn't "100 %" safe otherwise."""
    if a < 0.0:
        raise InvalidArgument("a: isn't 100 % \\"positive\\" \\\\n")
    row[0] = -pow(a, 2.0) - pow(-a, 2.0) * -b + pow(a, -b) / pow(pow(a, b), -0.5) - pow(a, pow(b, 0.5))
    row[1] = (-a) * b - -a * -b - (a - (-b)) / -(a + b) + -1e-3
    row[2] = (1.0 if a > b else 2.0 if a == b else 3.0) * 2.0 - (a if not (a > b and b > 0.5) else -b) * 3.0
    row[3] = 1.0 if (1.0 if a > b else -1.0) > 0.0 else (0.5 if (not a > b) == (k > n) else 0.25)
    row[4] = float(k) / float(n) if float(k) < a * float(n) else float(k - (n - 1)) * 0.5 - float(k % n * n) / 3.0
    row[5] = float(k // n * n + k % n - k // (n + 1) % n) + (-float(k)) - float(-k + n * -1)
    for i in range(3):
        pair = zeros(2)
        pair[0] += a + float(i)
        pair[1] -= b
        row[6] += pair[0] * pair[1]
    # lines so long that some languages break them: a sum, an update, a choice, a condition and a call
    one = a * b * 1.0000000001
    row[7] = one + one * 1.000000001 + one * 1.000000002 + one * 1.000000003 - one * 1.000000004 / (a + b + 1.0) + one
    row[7 + int(float(n) * 0.0)] -= one + one * 1.000000001 + one * 1.000000002 - one * 1.000000003 * (a + b + 1.0)
    row[8] = one + one * 1.000000001 + one * 1.00000002 if one + one * 1.00000001 > b * 1.00000003 + a else b * a - one
    if one + one * 1.000000001 + one * 1.000000002 > b * 1.000000003 + a * 1.000000004 and not (a > 3.0 and b > 4.0):
        row[9] = brackets(one + one * 1.000000001, one * 1.000000002 + b * 1.000000003, a * a * 1.000000004 + b * b)
    while row[10] < a * 1.000000001 + b * 1.000000002 and row[10] * 1.000000003 < 2.0 and not (row[10] > a * 1e9 + b):
        row[10] += 0.25 + a * 1e-3
    row[11] = max(min(a, b), -max(-a, abs(-b))) - min(a, -b) + floor(-a) * ceil(-b)


def _evaluate(quantity: int, given: Row[float, 64], found: Mut[Row[float, 256]]) -> None:
    if quantity == 0:
        found[0] = brackets(given[0], given[1], given[2])
    elif quantity == 1:
        found[0] = halves(int(given[0]))
        found[1] = float(whole_numbers(int(given[0]), int(given[1])))
    elif quantity == 2:
        found[0] = chosen(given[0], given[1], given[2] > 0.0)
    elif quantity == 3:
        found[0] = loops(int(given[0]), given[1])
    elif quantity == 4:
        item = Box()
        make_box(given[0], item)
        found[0] = item.size
        found[1] = float(item.number)
        found[2] = float(item.whole[1] + item.whole[0])
        for i in range(COUNT):
            found[3 + i] = item.row[i]
        found[6] = 1.0 if item.flag else 0.0
    elif quantity == 5:
        row = zeros(6)
        steps = roots(given[0], int(given[1]), row)
        for i in range(int(given[1])):
            found[i] = row[i]
        found[6] = float(steps)
    elif quantity == 6:
        values = zeros(24)
        functions(given[0], given[1], values)
        for i in range(24):
            found[i] = values[i]
    elif quantity == 7:
        trapped = zeros(12)
        traps(given[0], given[1], int(given[2]), int(given[3]), trapped)
        for i in range(12):
            found[i] = trapped[i]
'''


@cache
def arm_without_vectors(name: str, real: str = "float64") -> Library:
    """Return the arm's library without the package's reference vectors, which take seconds."""
    with patch.object(arm_library, "_checks", lambda real, in_time: ()):
        return arm_library._usual.__wrapped__(name, real, arm_library._MODES)


@cache
def model_without_vectors(model: cra.Model, name: str = "span", real: str = "float64") -> Library:
    """Return a model's library without its reference vectors, which take seconds."""
    with patch.object(user_model, "model_checks", lambda written, values: ()):
        return user_model._usual.__wrapped__(model, name, real, user_model.KEPT)


SIZES = {0: 1, 1: 2, 2: 1, 3: 1, 4: 7, 5: 7, 6: 24, 7: 12}
EDGE = [0.0, -0.0, 1.0, -1.0, 5e-324, 2.2250738585072014e-308, 1e-200, 1e12, 1.7e308, 0.1, 1 / 3, math.inf, -math.inf]


def points() -> list[tuple[int, tuple[float, ...], bool]]:
    """Return quantity, input and whether it is refused."""
    rng = np.random.default_rng(11)
    found: list[tuple[int, tuple[float, ...], bool]] = []
    for a in (*EDGE[2:11], *rng.normal(size=3)):
        a, b, c = float(a), float(rng.choice(EDGE[2:11])), float(rng.uniform(0.5, 2.0))
        found.append((0, (a, b, c), False))
    found += [(1, (k, n), False) for k in (7, 1, 12, 100, 1001) for n in (0, 2, 5)]
    found += [(2, (a, b, f), False) for a in (*EDGE, math.nan) for b in (0.0, 1.5, math.nan) for f in (0.0, 1.0)]
    found += [(3, (n, limit), False) for n in (0, 1, 2, 5, 9) for limit in (0.0, 0.37, 100.0)]
    found += [(4, (x,), False) for x in (0.0, 1.0, -3.7, 1e-300, 1e300, 0.1)]
    found += [(5, (x, n), False) for x in (0.0, 1.0, 2.0, 1e300, 5e-324) for n in (1, 6)]
    found += [(5, (-1.0, 2), True), (5, (4.0, 0), True), (5, (-math.inf, 3), True)]
    found += [(6, (x, a), False) for x in (-0.9, -1e-9, 1e-300, 0.3, 0.99) for a in (1e-12, 0.5, 3.0, 1e6)]
    found += [(7, (a, b, k, n), False) for a, b in ((0.3, 0.7), (2.5, 2.5), (3.5, 0.1)) for k, n in ((7, 3), (2, 5))]
    found += [(7, (-1.0, 1.0, 1, 1), True)]
    return found


def reference(library: Library, points: list[tuple[int, tuple[float, ...], bool]], sizes) -> list[Check]:
    """Return what plain Python answers, bit by bit."""
    texts = library.texts("python")
    names: dict = {}
    exec(compile(texts[f"{library.name}.py"], library.name, "exec"), names)
    test = texts["self_test.py"]
    exec(test[test.index("import *") + len("import *") : test.index("def agree")], names)
    checks = []
    for quantity, given, refused in points:
        found = [0.0] * 256
        try:
            names["_evaluate"](quantity, [*given, *[0.0] * (64 - len(given))], found)
            assert not refused, (quantity, given)
        except ValueError:
            assert refused, (quantity, given)
            found = []
        checks.append(Check(quantity, given, tuple(found[: sizes[quantity]]), refused=refused))
    return checks


def bits(library: Library) -> list[Check]:
    """Return a share of a library's checks with what plain Python answers."""
    points = [(c.quantity, c.given, c.refused) for c in library.checks[::7]]
    return reference(library, points, dict.fromkeys(range(64), 256))


COMMANDS = {
    "python": ("python3", [[sys.executable, "self_test.py"]]),
    "c": ("cc", [["make", "test", "SIMD="]]),
    "fortran": ("gfortran", [["make", "test"]]),
    "rust": ("cargo", [["cargo", "test", "--quiet", "--offline", "--test", "reference", "--", "--nocapture"]]),
    "javascript": ("node", [["node", "self_test.mjs"]]),
    "octave": ("octave", [["octave", "--norc", "--no-gui", "--quiet", "self_test.m"]]),
}  # fmt: skip


def write(texts: Mapping[str, str], folder: Path) -> Path:
    """Write files, with their folders."""
    for name, text in texts.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


def run(command: list[str], folder: Path) -> str:
    """Run a command, which must succeed, and return what it printed; compilers optimise little, to the same bits."""
    environment = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "PYTHONPATH")}
    environment |= {"CARGO_TARGET_DIR": str(folder / "target"), "CFLAGS": "-O1", "FFLAGS": "-O1"}
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, env=environment)
    assert done.returncode == 0, f"{command}\n{done.stdout[-3000:]}{done.stderr[-6000:]}"
    return done.stdout + done.stderr


def has(language: str) -> bool:
    return shutil.which(COMMANDS[language][0]) is not None


def needs(language: str) -> None:
    """Skip a test where a language cannot be run."""
    if not has(language):
        pytest.skip(f"{language} needs {COMMANDS[language][0]}")


def passes(library: Library, language: str, folder: Path) -> str:
    """Run the self-test of a library in a language, which must pass; return what it printed."""
    write(library.texts(language), folder)
    for command in COMMANDS[language][1]:
        printed = run(command, folder)
    assert f"{len(library.checks)} checks, 0 failures" in printed  # no reference point is dropped
    return printed
