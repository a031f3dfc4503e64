"""One expression with every operator, constant and function, through every printer and tool-chain."""

from __future__ import annotations

import shutil
import subprocess
import sys

import numpy as np
import pytest
import sympy as sp
from sympy.codegen.cfunctions import expm1, log1p

from cra_sym.codegen.languages import LANGUAGES
from cra_sym.codegen.program import christen, function, scalars

x, y = sp.symbols("x y", real=True)
a, b = sp.symbols("a b", positive=True)

COVERAGE = [
    x + y - a * b / 7,
    -(x + y) / (x * y),
    sp.Rational(1, 3) * x - sp.Rational(2, 7),
    sp.Rational(10**20 + 1, 3 * 10**19) + 2**60 * x + sp.Float("0.1") * y,
    x**2 + x**3 + y**-2 + a**5 / b**4,
    sp.sqrt(a) + 1 / sp.sqrt(b) + a ** sp.Rational(1, 3) + a**b + b ** sp.Rational(-3, 2),
    sp.pi * x + sp.E * y + sp.GoldenRatio + sp.EulerGamma + sp.Catalan,
    sp.exp(-a) + expm1(x) + sp.log(a) + log1p(b) + sp.log(a, 10),
    sp.sin(x) + sp.cos(y) + sp.tan(x) + sp.asin(x / 4) + sp.acos(y / 4) + sp.atan(x) + sp.atan2(y, x),
    sp.sinh(x) + sp.cosh(y) + sp.tanh(x) + sp.asinh(x) + sp.acosh(1 + a) + sp.atanh(x / 4),
    sp.sec(x) + sp.csc(x) + sp.cot(a) + sp.sech(x) + sp.csch(x) + sp.coth(a) + sp.sinc(x),
    abs(x) + sp.sign(y) + sp.floor(3 * x) + sp.ceiling(3 * y) + sp.Heaviside(x) + sp.Heaviside(-a),
    sp.Max(x, y, a) - sp.Min(x, y, b, 1),
    sp.Piecewise((x, (x < y) & ~(a >= b)), (y, sp.Ne(x, y) | (a <= 1)), (a, True)),
    sp.Piecewise((sp.sqrt(a), sp.Eq(x, 0)), (sp.sin(x) / x, x > 0), (-y, True)),
]
POINTS = [(0.5, -0.75, 1.25, 2.5), (-1.5, 0.25, 0.75, 0.3), (0.9, 0.9, 2.0, 3.0), (1e-3, -2.0, 12.0, 1.5)]

WHOLE = function("coverage", "Everything.", COVERAGE, scalars([x, y, a, b]))
BRANCHED = function(
    "branched", "Branches.", sp.Piecewise((x * a, x > y), (y / a, x < 0), (a, True)), scalars([x, y, a])
)


def expected(point) -> list[float]:
    values = dict(zip((x, y, a, b), map(sp.Float, point), strict=True))
    return [float(sp.N(e.subs(values), 20)) for e in COVERAGE]


CC = "cc -std=c99 -pedantic -Wall -Wextra -Wconversion -Werror -O1 -o run coverage.c -lm && ./run"
GFORTRAN = "gfortran -std=f2008 -Wall -Wextra -Werror -o run coverage.f90 && ./run"
PROGRAMS = {
    "python": (sys.executable, "coverage.py", [sys.executable, "coverage.py"]),
    "c": ("cc", "coverage.c", ["sh", "-c", CC]),
    "fortran": ("gfortran", "coverage.f90", ["sh", "-c", GFORTRAN]),
    "octave": ("octave", "run_it.m", ["octave", "--norc", "--no-gui", "--quiet", "run_it.m"]),
    "rust": ("rustc", "coverage.rs", ["sh", "-c", "rustc -o run coverage.rs && ./run"]),
    "javascript": ("node", "coverage.mjs", ["node", "coverage.mjs"]),
}  # fmt: skip


def program(language: str) -> str:
    """Return a program that prints all outputs at all points, one a line, then those of the branches."""
    text = "\n\n".join(LANGUAGES[language].function(f) for f in (WHOLE, BRANCHED))
    helpers = LANGUAGES[language].helped(text)
    n, arguments = len(COVERAGE), [", ".join(f"{v!r}" for v in p) for p in POINTS]
    short = [", ".join(f"{v!r}" for v in p[:3]) for p in POINTS]
    if language == "python":
        calls = [f"print(*coverage({p}), sep='\\n')" for p in arguments] + [f"print(branched({p}))" for p in short]
        return "\n".join(["import math", helpers, text, *calls])
    if language == "c":
        calls = [f'coverage({p}, out); for (int i = 0; i < {n}; i++) printf("%.17g\\n", out[i]);' for p in arguments]
        calls += [f'printf("%.17g\\n", branched({p}));' for p in short]
        return (
            "#include <math.h>\n#include <stdio.h>\n"
            + text
            + f"\nint main(void) {{ double out[{n}];\n"
            + "\n".join(calls)
            + "\nreturn 0; }\n"
        )
    if language == "fortran":
        typed = [", ".join(f"{v!r}_dp" for v in p) for p in POINTS]
        calls = [f"call coverage({p}, out)\nprint '(es25.16e3)', out" for p in typed]
        calls += [f"print '(es25.16e3)', branched({', '.join(p.split(', ')[:3])})" for p in typed]
        head = "program run\nuse, intrinsic :: iso_fortran_env, only: dp => real64\nimplicit none\n"
        return head + f"real(dp) :: out({n})\n" + "\n".join(calls) + f"\ncontains\n{helpers}\n{text}\nend program\n"
    if language == "octave":
        calls = [f"printf('%.17g\\n', coverage({p}));" for p in arguments] + [
            f"printf('%.17g\\n', branched({p}));" for p in short
        ]
        return "1;\n" + helpers + "\n" + text + "\n" + "\n".join(calls) + "\n"
    if language == "rust":
        calls = [f'for v in coverage({p}) {{ println!("{{:e}}", v); }}' for p in arguments] + [
            f'println!("{{:e}}", branched({p}));' for p in short
        ]
        return (
            "#![deny(warnings)]\n#![allow(unused_parens, clippy::all)]\n"
            + text
            + "\nfn main() {\n"
            + "\n".join(calls)
            + "\n}\n"
        )
    calls = [f"for (const v of coverage({p})) console.log(v);" for p in arguments] + [
        f"console.log(branched({p}));" for p in short
    ]
    return text + "\n" + "\n".join(calls) + "\n"


@pytest.mark.parametrize("language", PROGRAMS)
def test_every_function_means_the_same(language, tmp_path):
    tool, name, command = PROGRAMS[language]
    if shutil.which(tool) is None:
        pytest.skip(f"{language} needs {tool}")
    (tmp_path / name).write_text(program(language))
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr[-4000:]
    got = [float(word) for word in done.stdout.split()]
    wanted = [value for point in POINTS for value in expected(point)]
    wanted += [p[0] * p[2] if p[0] > p[1] else p[1] / p[2] if p[0] < 0 else p[2] for p in POINTS]
    np.testing.assert_allclose(got, wanted, rtol=2e-14, atol=1e-14)


def test_julia_parses():
    tree_sitter = pytest.importorskip("tree_sitter", reason="needs tree-sitter")
    grammar = pytest.importorskip("tree_sitter_julia", reason="needs tree-sitter-julia")
    text = "\n".join(LANGUAGES["julia"].function(f) for f in (WHOLE, BRANCHED))
    assert not tree_sitter.Parser(tree_sitter.Language(grammar.language())).parse(text.encode()).root_node.has_error


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_function_without_equivalent_is_refused(language):
    f = function("f", "", sp.zeta(x), scalars([x]))
    with pytest.raises(ValueError, match="zeta"):
        LANGUAGES[language].function(f)


def test_names_are_valid_everywhere():
    taken: set[str] = set()
    names = [
        christen(wish, taken) for wish in ("lambda", "end", "E", "e", "A", "a", "x1", "sin", "2x", "_k", "k__t", "λ")
    ]
    assert len({n.lower() for n in names}) == len(names)
    assert not {"lambda", "end", "sin", "x1"} & set(names)
    assert all(n.isascii() and n[0].isalpha() and "__" not in n for n in names)


def test_a_missing_argument_is_named():
    with pytest.raises(ValueError, match="not arguments: y"):
        function("f", "", x + y, scalars([x]))
