"""Every exported language against its reference vectors, with its own tool-chain and strictest flags."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

import pytest

import cra_sym as cra

# language: the program needed, the package that has it, and the command of the folder's README
TOOLS = {
    "python": (sys.executable, "python3", [sys.executable, "-W", "error", "self_test.py"]),
    "fortran": ("gfortran", "gfortran", ["make", "test"]),
    "octave": ("octave", "octave", ["octave", "--norc", "--no-gui", "--quiet", "--eval", "self_test"]),
    "rust": ("cargo", "cargo", ["cargo", "test", "--offline", "--quiet", "--", "--nocapture"]),
    "javascript": ("node", "nodejs", ["node", "self_test.mjs"]),
}


@pytest.mark.parametrize("language", TOOLS)
def test_self_test_passes(language, tmp_path):
    program, package, command = TOOLS[language]
    if shutil.which(program) is None:
        pytest.skip(f"{language} needs the package {package}")
    cra.export(language, tmp_path / language)
    environment = {k: v for k, v in os.environ.items() if k != "DISPLAY"} | {
        "CARGO_TARGET_DIR": str(tmp_path / "target")
    }
    done = subprocess.run(
        command, cwd=tmp_path / language, env=environment, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]
    assert " 0 failures" in done.stdout
