"""Exported Rust: clean for its linter, in both precisions."""

from __future__ import annotations

import shutil

import pytest

from tests import exported_models
from tests.codegen import kit

MODELS = {"float64": "string on a base with a payload", "float32": "Timoshenko with end mass and spring"}


@pytest.mark.parametrize("real", MODELS)
def test_clippy_says_nothing(real, tmp_path):
    """With four lints allowed by name, which ask for other conditions, loops and arguments."""
    if shutil.which("cargo-clippy") is None:
        pytest.skip("needs cargo clippy")
    model = exported_models.model(MODELS[real])
    for made in (kit.arm_without_vectors("crane", real), kit.model_without_vectors(model, "span", real)):
        folder = kit.write(made.texts("rust"), tmp_path / made.name)
        assert (folder / "Cargo.toml").read_text().count('"allow"') <= 4
        kit.run(["cargo", "clippy", "--offline", "--quiet", "--tests", "--", "-D", "warnings"], folder)
