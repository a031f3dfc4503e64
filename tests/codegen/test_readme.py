"""Every export does what its README says: the examples are saved under their names, every command is run as written.

The self-tests among the commands compare with the reference vectors; the compilers' strictest flags are in the folders'
own build files.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest
import sympy as sp

import cra_sym as cra

PACKAGES = {
    "cc": "gcc", "make": "make", "cmake": "cmake", "gfortran": "gfortran", "fpm": "fpm (from PyPI)", "octave": "octave",
    "cargo": "cargo", "node": "nodejs", "npm": "npm", "python": "python3", "pip": "pip and a package index",
}  # fmt: skip
COMPILERS = ("cc", "gfortran")
LANGUAGES = ("c", "fortran", "python", "rust", "javascript", "octave")
BLOCK = re.compile(r"(?:Save as `([^`]+)`:\n\n)?```(\w+)\n(.*?)```\n", re.DOTALL)


class Step(NamedTuple):
    """A file to save, or a command to run in the folder."""

    file: str
    text: str


def steps(readme: str) -> list[Step]:
    found = []
    for name, kind, text in BLOCK.findall(readme):
        if kind == "sh":
            found += [Step("", line.split("#")[0].strip()) for line in text.splitlines()]
        else:
            assert name, f"no file name for:\n{text}"
            found.append(Step(name, text))
    return found


@pytest.fixture(scope="module")
def environment(tmp_path_factory) -> dict[str, str]:
    """No display, a clean Python environment, and the package manager of Fortran where Python's brought it."""
    clean = tmp_path_factory.mktemp("venv")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", clean], check=True, capture_output=True)
    pip = clean / "bin" / "pip"
    pip.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m pip --python "{clean}" "$@"\n')
    pip.chmod(0o755)
    paths = [str(clean / "bin"), os.environ["PATH"], str(Path(sys.executable).parent)]
    kept = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "PYTHONPATH", "CARGO_TARGET_DIR")}
    quick = {"CFLAGS": "-O1", "FFLAGS": "-O1", "CARGO_NET_OFFLINE": "true"}
    return kept | quick | {"PATH": os.pathsep.join(paths), "PYTHONWARNINGS": "error"}


def exported(language: str, folder: Path, model: cra.Model | None = None) -> Path:
    """Export to a folder; Octave, some hundred times slower than others, gets a share of the reference vectors."""
    cra.export(language, folder, model=model)
    if language == "octave":
        lines = (folder / "reference.txt").read_text().splitlines(keepends=True)
        (folder / "reference.txt").write_text("".join(lines[:: 48 if model is None else 24]))
    return folder


def has(command: str, environment: dict[str, str]) -> bool:
    tool = command.split()[0]
    if tool == "pip":
        return has_index(environment["PATH"])
    return tool.startswith("./") or shutil.which(tool, path=environment["PATH"]) is not None


@cache
def has_index(path: str) -> bool:
    """Whether pip reaches what it builds with."""
    probe = "pip download --quiet --no-deps --retries=0 --timeout=10 --dest=probe setuptools>=77"
    with tempfile.TemporaryDirectory() as folder:
        return (
            subprocess.run(probe.split(), env=os.environ | {"PATH": path}, capture_output=True, cwd=folder).returncode
            == 0
        )


def follow(folder: Path, environment: dict[str, str], left_out: tuple[str, ...] = ()) -> str:
    """Do what the README says; return what was printed. Skip, naming the packages, if tools are missing."""
    environment = environment | {"TMPDIR": str(folder.parent)}
    printed, missing = "", set()
    todo = steps((folder / "README.md").read_text())
    assert sum(not step.file for step in todo) >= 2
    without = any(text.split()[0] in COMPILERS and not has(text, environment) for file, text in todo if not file)
    for file, text in todo:
        if file:
            (folder / file).parent.mkdir(exist_ok=True)
            (folder / file).write_text(text)
        elif text.startswith(left_out):
            pass
        elif not has(text, environment):
            missing.add(PACKAGES[text.split()[0]])
        elif without and text.split()[0] in ("make", "cmake"):
            pass  # they call the compiler
        elif not (text.startswith("./") and not (folder / text[2:]).exists()):
            quiet = environment | ({"PYTHONWARNINGS": "default"} if text.startswith("pip") else {})
            done = subprocess.run(text, shell=True, cwd=folder, env=quiet, capture_output=True, text=True, timeout=300)
            assert done.returncode == 0, f"{text}\n{done.stdout[-2000:]}{done.stderr[-4000:]}"
            printed += done.stdout
    if missing:
        pytest.skip(f"the README's commands need {', '.join(sorted(missing))}")
    return printed


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_arm(language, tmp_path, environment):
    printed = follow(exported(language, tmp_path / "arm"), environment)
    assert re.search(r"\b2\.4\d", printed), "the example's first frequency"
    assert re.search(r"\b0 failures|test result: ok|100% tests passed", printed)


@pytest.fixture(scope="module")
def beam() -> cra.Model:
    x, t = sp.symbols("x t", real=True)
    names = "all isreal Number NAN inverse lambda end"  # each is taken in some language
    E, I_z, rho, area, k, length, m = sp.symbols(names, positive=True)
    summer, winter = (sp.Symbol(rf"\lambda_of_the_foundation_under_the_arm_in_{time}") for time in ("summer", "winter"))
    more = sum(sp.symbols("k_1:8"))  # a Fortran line ends at column 132
    v = sp.Function("v")(x, t)
    density = rho * area * v.diff(t) ** 2 / 2 - E * I_z * v.diff(x, 2) ** 2 / 2 - (summer + winter) * v**2 / 2
    return cra.Model(
        density, fields=[v], x=x, domain=(0, length), t=t, left=-(k + more) * v**2 / 2, right=m * v.diff(t) ** 2 / 2,
        essential=[v.diff(x).subs(x, 0)],
    )  # fmt: skip


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_model_of_ones_own(language, beam, tmp_path, environment):
    folder = exported(language, tmp_path / "model", beam)
    printed = follow(folder, environment, ("cmake", "pip"))  # they see to it that the arm is built
    assert re.search(r"\b0 failures|test result: ok|100% tests passed", printed)
    first = (folder / "reference.txt").read_text().splitlines()[0]
    expected = float(first.split()[-4])  # the third frequency: Octave shows five digits of the largest
    numbers = [float(word) for word in re.findall(r"-?\d+\.\d+(?:[eE][-+]?\d+)?", printed)]
    assert any(abs(number - expected) <= 1e-4 * abs(expected) for number in numbers), "the example's third number"
