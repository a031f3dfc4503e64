"""Every back end prints every construct of the restricted form, and computes the bits of plain Python."""

from __future__ import annotations

from dataclasses import replace

import pytest

from cra_sym.codegen.library import PRINTERS, Library
from cra_sym.kernels.form import FormError
from cra_sym.kernels.form_parse import parse
from tests.codegen import kit

# the mathematical functions of these are not those of C's library; all else is the same arithmetic
OWN_FUNCTIONS = {"rust": 9e-16, "javascript": 9e-16}


@pytest.fixture(scope="module")
def library() -> Library:
    empty = Library("kit", "Every construct.", kit.TEXT, ("Nothing.",), ())
    checks = kit.reference(empty, kit.points(), kit.SIZES)
    return replace(empty, checks=tuple(checks))


@pytest.mark.parametrize("language", kit.COMMANDS)
def test_bits_are_those_of_plain_python(language, library, tmp_path):
    kit.needs(language)
    loss = OWN_FUNCTIONS.get(language, 0.0)
    checks = tuple(replace(c, relative=loss if c.quantity == 6 else 0.0) for c in library.checks)
    kit.passes(replace(library, checks=checks), language, tmp_path)


def test_julia_parses(library):
    tree_sitter = pytest.importorskip("tree_sitter", reason="needs tree-sitter")
    grammar = pytest.importorskip("tree_sitter_julia", reason="needs tree-sitter-julia")
    parser = tree_sitter.Parser(tree_sitter.Language(grammar.language()))
    for name, text in library.texts("julia").items():
        assert not name.endswith(".jl") or not parser.parse(text.encode()).root_node.has_error, text


@pytest.mark.parametrize("language", PRINTERS)
def test_comments_travel(language, library):
    text = "".join(text for name, text in library.texts(language).items() if not name.startswith("self_test"))
    for words in ("half a turn", "not the same", "a comment that stands alone", "not a number", "some numbers"):
        assert words in text, words


REFUSED = {
    "x = a + 1": "types that do not fit",
    "x = a / 2.0\n    x = 1": "keeps its type",
    "x = y": "y has no value yet",
    "a = 1.0": "given and stays",
    "row[0] = 1.0": "read only",
    "x = g(out)": "statement of its own|not defined",
    "x = n / n": "integers have|integers",
    "f(a, n, row, out)": "not defined above",
    "for i in range(n):\n        i = 2": "something else|given|loop",
    "for i in range(n):\n        a2 = 1.0\n    x = i": "i has no value yet",
    "x = a if n else a": "condition",
    "x = [a]": "not in the restricted form",
    "x = zeros(n)": "length of a local row is a constant",
    "fill(out, out)": "given twice",
    "x = a < 1.0 < 2.0": "restricted form",
    "x = 1.0 + fails(a)": "statement of its own",
    "import os": "restricted form",
    "lambda_ = lambda: 1": "restricted form",
    "x = a ** 2.0": "floats have",
}


@pytest.mark.parametrize("statement", REFUSED)
def test_what_is_not_in_the_form_is_refused(statement):
    text = (
        "def fill(one: Out[Row[float, 3]], other: Mut[Row[float, 3]]) -> None:\n    one[0] = other[0]\n\n"
        "def fails(x: float) -> float:\n    if x > 0.0:\n        raise Bad\n    return x\n\n"
        f"def f(a: float, n: int, row: Row[float, 3], out: Out[Row[float, 3]]) -> None:\n    {statement}\n"
    )
    with pytest.raises(FormError, match=REFUSED[statement]):
        parse(text)


def test_a_way_out_without_a_value_is_refused():
    with pytest.raises(FormError, match="not every way out"):
        parse("def f(a: float) -> float:\n    if a > 0.0:\n        return a\n")
