"""The exported C solver for many arms, built with -O3 -march=native: what the compiled kernels are measured against."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from cra_sym.codegen.arm_library import arm_library

WIDE = "-mprefer-vector-width=512"
FLAGS = ["-std=c99", "-O3", "-march=native", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"]


def has_gcc() -> bool:
    """Return whether the twin can be built."""
    return shutil.which("gcc") is not None


def simd_width(text: str) -> int:
    """Return the widest vector registers, in bits, that the assembly multiplies doubles in."""
    found = re.findall(r"v(?:mul|f(?:n)?madd\d*)pd\s.*%([xyz])mm", text)
    return {"x": 128, "y": 256, "z": 512, "": 64}[max(found, default="", key=" xyz".index)]


#: One arm after the other, as a program that knows nothing of batches would ask.
ONE_BY_ONE = """
#include <stddef.h>
#include "cra.h"
int one_by_one(size_t n, const double *kt, const double *kr, const double *mu, const double *io, int modes, double *out)
{
    for (size_t i = 0; i < n; i++)
        if (cra_frequency_parameters(kt[i], kr[i], mu[i], io[i], modes, out + i * modes)) return 1;
    return 0;
}
"""
Fill = Callable[..., None]


def build(folder: Path, *more: str) -> tuple[Fill, Fill, int]:
    """Return ``fill(out, kappa_t, kappa_r, mu, iota)`` by batches and one by one, and the SIMD width in bits."""
    for name, text in {**arm_library("cra").texts("c"), "one_by_one.c": ONE_BY_ONE}.items():
        (folder / name).write_text(text, encoding="utf-8")
    flags, library = [*FLAGS, *more], folder / f"twin{''.join(more)}.so"
    sources = ["cra.c", "cra_batch.c", "one_by_one.c"]
    command = ["gcc", *flags, "-shared", "-fPIC", *sources, "-o", str(library), "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    command = ["gcc", *flags, "-S", "cra_batch.c", "-o", "-"]
    assembly = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
    loaded = ctypes.CDLL(str(library))
    routes = [_filling(loaded[name]) for name in ("cra_frequency_parameters_batch", "one_by_one")]
    return routes[0], routes[1], simd_width(assembly.stdout)


def _filling(function: Any) -> Fill:
    pointer = np.ctypeslib.ndpointer(np.float64, flags="C")
    function.argtypes = [ctypes.c_size_t, *[pointer] * 4, ctypes.c_int, pointer]
    function.restype = ctypes.c_int

    def fill(out: np.ndarray, *groups: np.ndarray) -> None:
        if function(len(out), *groups, out.shape[1], out):
            raise ArithmeticError("a zero was not reached")

    return fill
