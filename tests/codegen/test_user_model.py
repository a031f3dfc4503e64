"""A model of one's own through every language."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

import pytest
from sympy import Function, symbols

import cra_sym as cra

COMMANDS = {
    "c": ("cc", ["make", "test"]),
    "fortran": (
        "gfortran",
        ["sh", "-c", "gfortran -std=f2008 -Wall -Wextra -Werror -o self_test model.f90 self_test.f90 && ./self_test"],
    ),
    "python": (sys.executable, [sys.executable, "self_test.py"]),
    "octave": ("octave", ["octave", "--norc", "--no-gui", "--quiet", "--eval", "self_test"]),
    "rust": ("cargo", ["cargo", "test", "--offline", "--quiet", "--", "--nocapture"]),
    "javascript": ("node", ["node", "self_test.mjs"]),
}


@pytest.fixture(scope="module")
def beam() -> cra.Model:
    x, t = symbols("x t", real=True)
    EI, rhoA, length, m, k = symbols("EI rhoA l m k", positive=True)
    v = Function("v")(x, t)
    density = rhoA * v.diff(t) ** 2 / 2 - EI * v.diff(x, 2) ** 2 / 2
    return cra.Model(
        density, fields=[v], x=x, domain=(0, length), t=t, left=-k * v**2 / 2, right=m * v.diff(t) ** 2 / 2,
        essential=[v.diff(x).subs(x, 0)],
    )  # fmt: skip


@pytest.mark.parametrize("language", COMMANDS)
def test_self_test_passes(language, beam, tmp_path):
    tool, command = COMMANDS[language]
    if shutil.which(tool) is None:
        pytest.skip(f"{language} needs {tool}")
    made = cra.export(language, tmp_path / "model", model=beam)
    assert "README.md" in made.files
    environment = os.environ | {"CARGO_TARGET_DIR": str(tmp_path / "target")}
    done = subprocess.run(command, cwd=tmp_path / "model", env=environment, capture_output=True, text=True, timeout=200)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-3000:]
    assert " 0 failures" in done.stdout


def test_a_model_without_real_form_is_refused(tmp_path):
    x, t = symbols("x t", real=True)
    T, rho, length, c = symbols("tension density l damper", positive=True)
    y = Function("y")(x, t)
    string = cra.Model(
        rho * y.diff(t) ** 2 / 2 - T * y.diff(x) ** 2 / 2, fields=[y], x=x, domain=(0, length), t=t,
        virtual_work=[(-c * y.diff(t), y, "right")],
    )  # fmt: skip
    with pytest.raises(ValueError, match="damped"):
        cra.export("c", tmp_path / "model", model=string)
    with pytest.raises(TypeError, match="allowed is a Model"):
        cra.export("c", tmp_path / "model", model="beam")  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())
