"""The exported C solver for many arms, built with -O3 -march=native: what the compiled kernels are measured against."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np

from cra_sym.codegen.exporter import arm_sources

FLAGS = ["-std=c99", "-O3", "-march=native", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"]


def has_gcc() -> bool:
    """Return whether the twin can be built."""
    return shutil.which("gcc") is not None


def simd_width(text: str) -> int:
    """Return the widest vector registers, in bits, that the assembly multiplies doubles in."""
    found = re.findall(r"v(?:mul|f(?:n)?madd\d*)pd\s.*%([xyz])mm", text)
    return {"x": 128, "y": 256, "z": 512, "": 64}[max(found, default="", key=" xyz".index)]


def build(folder: Path) -> tuple[Callable[..., None], int]:
    """Return ``fill(out, kappa_t, kappa_r, mu, iota)`` and the SIMD width in bits."""
    for name, text in arm_sources("c").items():
        (folder / name).write_text(text, encoding="utf-8")
    sources, library = ["spectrum.c", "batch.c", "modes.c"], folder / "twin.so"
    command = ["gcc", *FLAGS, "-shared", "-fPIC", *sources, "-o", str(library), "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    command = ["gcc", *FLAGS, "-S", "batch.c", "-o", "-"]
    assembly = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
    function = ctypes.CDLL(str(library)).cra_frequency_parameters_batch
    pointer = np.ctypeslib.ndpointer(np.float64, flags="C")
    function.argtypes = [ctypes.c_size_t, *[pointer] * 4, ctypes.c_int, pointer]
    function.restype = ctypes.c_int

    def fill(out: np.ndarray, *groups: np.ndarray) -> None:
        if function(len(out), *groups, out.shape[1], out):
            raise ArithmeticError("a zero was not reached")

    return fill, simd_width(assembly.stdout)
