"""What an export writes and when it does not."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import cra_sym as cra
from cra_sym.codegen import exporter
from cra_sym.codegen.library import Library
from tests import exported_models
from tests.codegen import kit


@pytest.fixture
def short(monkeypatch):
    """Exports of another text: how they are written is all that matters here."""
    monkeypatch.setattr(exporter, "arm_library", lambda name, *given: Library(name, "Constructs.", kit.TEXT, (), ()))


@pytest.fixture
def without_vectors(monkeypatch):
    """Exports of the arm without reference vectors."""
    monkeypatch.setattr(exporter, "arm_library", lambda name, real, *given: kit.arm_without_vectors(name, real))


def test_the_result_lists_what_was_written(short, tmp_path):
    made = cra.export("c", tmp_path / "out")
    assert {"cra.h", "README.md", "Makefile", "reference.txt"} <= set(made.files)
    assert "cra.h" in repr(made)
    assert made.digest in (tmp_path / "out" / "README.md").read_text()
    assert {*made.files, "manifest.json"} == {p.name for p in (tmp_path / "out").iterdir()}


DIGESTS = """
from cra_sym.codegen.exporter import _digest
from cra_sym.codegen.library import PRINTERS
from tests import exported_models
from tests.codegen.kit import model_without_vectors

library = model_without_vectors(exported_models.model("string on a base with a payload"))
digests = [_digest(library.texts(language)) for language in PRINTERS]
"""


def test_same_input_same_bytes():
    """In every language, whatever the order of sets: here, and in a process that orders them in its own way."""
    here: dict = {}
    exec(DIGESTS, here)
    command = [sys.executable, "-c", f"{DIGESTS}print(*digests)"]
    environment = os.environ | {"PYTHONHASHSEED": "1"}
    there = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout
    assert there.split() == here["digests"] and len(here["digests"]) == 7


def test_a_folder_with_content_is_left_alone(short, tmp_path):
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "mine.txt").write_text("mine")
    with pytest.raises(ValueError, match="not empty"):
        cra.export("c", folder)
    assert [p.name for p in folder.iterdir()] == ["mine.txt"]
    cra.export("c", folder, overwrite=True)
    assert (folder / "mine.txt").read_text() == "mine" and (folder / "cra.h").exists()
    cra.export("python", folder, overwrite=True)
    assert (folder / "mine.txt").exists() and not (folder / "cra.h").exists()
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("error", [ArithmeticError, KeyboardInterrupt])
@pytest.mark.parametrize("place", ["reference", "writing"])
def test_a_failed_export_leaves_everything_as_it_was(short, tmp_path, monkeypatch, error, place):
    cra.export("c", tmp_path / "old")
    (tmp_path / "old" / "mine.txt").write_text("mine")
    before = {path.name: path.read_bytes() for path in (tmp_path / "old").iterdir()}
    left = [3]

    def failing(*_, **__):
        left[0] -= 1 if place == "writing" else 3
        if left[0] <= 0:
            raise error

    monkeypatch.setattr(*((exporter, "arm_library") if place == "reference" else (Path, "write_text")), failing)
    for target, overwrite in (("old", True), ("new/deep", False)):
        left[0] = 3
        with pytest.raises(error):
            cra.export("fortran", tmp_path / target, overwrite=overwrite)
    assert {path.name: path.read_bytes() for path in (tmp_path / "old").iterdir()} == before
    assert [path.name for path in tmp_path.iterdir()] == ["old"]


def test_unknown_language_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"language = 'cobol': must be one of c, fortran"):
        cra.export("cobol", tmp_path / "out")
    assert not list(tmp_path.iterdir())


def test_two_arms_link_into_one_program(without_vectors, tmp_path):
    if shutil.which("g++") is None or shutil.which("make") is None:
        pytest.skip("needs g++ and make")
    for name in ("left", "right_one"):
        made = cra.export("c", tmp_path / name, name=name)
        assert {f"{name}.h", f"{name}_batch.c"} <= set(made.files)
        text = "".join((tmp_path / name / file).read_text() for file in made.files if file != "README.md")
        assert not re.search(r"\bcra_(?!sym)|CRA_", text)
        kit.run(["make", f"lib{name}.a", "CFLAGS=-O0", "SIMD="], tmp_path / name)
    (tmp_path / "main.cpp").write_text(
        '#include "left/left.h"\n#include "right_one/right_one.h"\n'
        "int main() { double one[2], two[2];\n"
        "  int bad = left_frequency_parameters(3, 0, 0.1, 0, 2, one) != LEFT_OK;\n"
        "  bad += right_one_frequency_parameters(3, 0, 0.1, 0, 2, two) != RIGHT_ONE_OK;\n"
        "  return bad || one[1] != two[1]; }\n"
    )
    libraries = ["left/libleft.a", "right_one/libright_one.a"]
    kit.run(["g++", "-Wall", "-Werror", "main.cpp", *libraries, "-lm", "-o", "main"], tmp_path)
    kit.run(["./main"], tmp_path)


@pytest.mark.parametrize("language", ["fortran", "python", "rust", "julia"])
def test_a_name_stands_in_front_of_everything(without_vectors, tmp_path, language):
    made = cra.export(language, tmp_path / "out", name="crane")
    assert not any("cra_" in file for file in made.files)
    text = "".join((tmp_path / "out" / file).read_text() for file in made.files if file != "README.md")
    assert not re.search(r"\bcra_(?!sym)|CRA_|CraArm", text)
    assert re.search(r"\bcrane", text)


@pytest.mark.parametrize(
    "options, message",
    [
        ({"modes": 0}, "modes = 0"), ({"input": "torque"}, "input = 'torque': must be one of base_acceleration"),
        ({"outputs": ["z"]}, "outputs = 'z': must be one of"), ({"version": "2.0"}, "version = '2.0': is that of FMI"),
        ({"language": None}, "language = None"), ({"directory": None}, "directory = None: must be a path"),
        ({"name": "../x"}, "name = '../x'"), ({"overwrite": "no"}, "overwrite = 'no': must be True or False"),
        ({"language": "fmu", "model": exported_models.model("tension")}, "'fmu': is that of a system"),
        ({"model": exported_models.model("tension"), "outputs": ["z"]}, "outputs = 'z': must be one of"),
    ],
)  # fmt: skip
def test_what_would_not_be_followed_is_refused(options, message, tmp_path):
    """In one line, and nothing is written."""
    with pytest.raises((TypeError, ValueError), match=message) as caught:
        cra.export(**({"language": "c", "directory": tmp_path / "out"} | options))
    assert "\n" not in str(caught.value) and not list(tmp_path.iterdir())


def test_what_has_no_single_precision_says_so(tmp_path):
    for language in ("python", "javascript", "octave", "julia"):
        with pytest.raises(ValueError, match=r"real = 'float32': .* has float64"):
            cra.export(language, tmp_path / "out", real="float32")
    assert not list(tmp_path.iterdir())
