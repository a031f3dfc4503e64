"""One expression with every operator, constant and function, through every printer and tool-chain."""

from __future__ import annotations

import pytest
import sympy as sp
from sympy.codegen.cfunctions import expm1, log1p

from cra_sym.codegen.library import Check, Library
from cra_sym.codegen.printers import FormPrinter
from cra_sym.codegen.program import _REWRITTEN, function, new_name, plain, scalars
from tests.codegen import kit

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


EVALUATE = """
def _evaluate(quantity: int, given: Row[float, 64], found: Mut[Row[float, 256]]) -> None:
    many = zeros(COUNT)
    if quantity == 0:
        coverage(given[0], given[1], given[2], given[3], many)
        for i in range(COUNT):
            found[i] = many[i]
    else:
        one = branched(given[0], given[1], given[2])
        found[0] = one
"""


def library() -> Library:
    text = "\n\n".join(FormPrinter.text_of(f, f.name, checked=f is WHOLE) for f in (WHOLE, BRANCHED))
    text = f"COUNT = {len(COVERAGE)}\n\n{FormPrinter.helped(text)}{text}\n{EVALUATE}"
    checks = [Check(0, p, tuple(expected(p)), 2e-14, 1e-14) for p in POINTS]
    checks += [
        Check(1, p[:3], (p[0] * p[2] if p[0] > p[1] else p[1] / p[2] if p[0] < 0 else p[2],), 1e-15) for p in POINTS
    ]
    return Library("printed", "Everything.", text, ("Nothing.",), tuple(checks))


@pytest.mark.parametrize("language", kit.COMMANDS)
def test_every_function_means_the_same(language, tmp_path):
    kit.needs(language)
    kit.passes(library(), language, tmp_path)


def test_julia_parses():
    tree_sitter = pytest.importorskip("tree_sitter", reason="needs tree-sitter")
    grammar = pytest.importorskip("tree_sitter_julia", reason="needs tree-sitter-julia")
    text = library().texts("julia")["src/printed.jl"]
    assert not tree_sitter.Parser(tree_sitter.Language(grammar.language())).parse(text.encode()).root_node.has_error


def test_a_function_without_equivalent_is_refused():
    f = function("f", "", sp.zeta(x), scalars([x]))
    with pytest.raises(ValueError, match="zeta"):
        FormPrinter.text_of(f, "f", checked=False)


def test_names_are_valid_everywhere():
    taken: set[str] = set()
    names = [
        new_name(wish, taken) for wish in ("lambda", "end", "E", "e", "A", "a", "x1", "sin", "2x", "_k", "k__t", "λ")
    ]
    assert len({n.lower() for n in names}) == len(names)
    assert not {"lambda", "end", "sin", "x1"} & set(names)
    assert all(n.isascii() and n[0].isalpha() and "__" not in n for n in names)


def test_a_missing_argument_is_named():
    with pytest.raises(ValueError, match="not arguments: y"):
        function("f", "", x + y, scalars([x]))


@pytest.mark.parametrize("kind", [kind for kind in _REWRITTEN if kind is not sp.ITE])
def test_what_is_rewritten_keeps_its_value(kind):
    u = sp.Symbol("u")
    for value in (1.7, 2.4) if kind in (sp.asec, sp.acsc) else (-1.3, -0.05, 0.05, 0.4, 1.7):
        expression = kind(u, sp.Rational(1, 2)) if kind is sp.Heaviside else kind(u)
        assert not plain(expression).has(kind)
        assert float(plain(expression).subs(u, value)) == pytest.approx(float(expression.subs(u, value)), rel=1e-14)
