"""Exported Julia, parsed with a grammar: no Julia is run."""

from __future__ import annotations

import pytest

import cra_sym as cra
from cra_sym.codegen import exporter

tree_sitter = pytest.importorskip("tree_sitter", reason="needs tree-sitter")
tree_sitter_julia = pytest.importorskip("tree_sitter_julia", reason="needs tree-sitter-julia")


def parsed(text: str):
    return tree_sitter.Parser(tree_sitter.Language(tree_sitter_julia.language())).parse(text.encode()).root_node


def test_the_grammar_sees_an_error():
    assert parsed("function f(x\n  x +\nend").has_error


def test_every_file_parses(tmp_path, monkeypatch):
    monkeypatch.setattr(exporter, "_reference", lambda everything: "# nothing\n")
    made = cra.export("julia", tmp_path / "julia")
    sources = [name for name in made.files if name.endswith(".jl")]
    assert len(sources) == 2
    for name in sources:
        assert not parsed((tmp_path / "julia" / name).read_text()).has_error, name
    assert "Parsed, not run" in (tmp_path / "julia" / "README.md").read_text()
