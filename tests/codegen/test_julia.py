"""Exported Julia, parsed with a grammar: no Julia is run."""

from __future__ import annotations

import re

import pytest
import sympy as sp

import cra_sym as cra
from tests.codegen import kit

tree_sitter = pytest.importorskip("tree_sitter", reason="needs tree-sitter")
tree_sitter_julia = pytest.importorskip("tree_sitter_julia", reason="needs tree-sitter-julia")


def parsed(text: str):
    return tree_sitter.Parser(tree_sitter.Language(tree_sitter_julia.language())).parse(text.encode()).root_node


def test_the_grammar_sees_an_error():
    assert parsed("function f(x\n  x +\nend").has_error


def test_every_file_parses():
    texts = kit.arm_without_vectors("crane").texts("julia")
    sources = [name for name in texts if name.endswith(".jl")]
    assert len(sources) == 2
    for name in sources:
        assert not parsed(texts[name]).has_error, name
    assert "Parsed, not run" in texts["README.md"]


def test_a_model_of_ones_own_parses(tmp_path):
    x, t = sp.symbols("x t")
    tension, mass, length, spring = sp.symbols("DomainError all end lambda")  # each has a meaning in Julia or Python
    y = sp.Function("y")(x, t)
    density = mass * y.diff(t) ** 2 / 2 - tension * y.diff(x) ** 2 / 2
    string = cra.Model(density, fields=[y], x=x, domain=(0, length), t=t, left=-spring * y**2 / 2)
    folder = tmp_path / "model"
    made = cra.export("julia", folder, model=string)
    texts = {name: (folder / name).read_text() for name in made.files if name.endswith(".jl")}
    assert sorted(texts) == ["src/model.jl", "test/runtests.jl"]
    for name, text in texts.items():
        assert not parsed(text).has_error, name
    fields = texts["src/model.jl"].partition("struct Parameters\n")[2].partition("\nend")[0]
    assert not {"DomainError", "all", "end", "lambda"} & set(re.findall(r"\w+(?=::)", fields)) and "::" in fields
    readme = (folder / "README.md").read_text()
    assert "Parsed, not run" in readme
    assert not parsed(readme.partition("```julia\n")[2].partition("```")[0]).has_error
