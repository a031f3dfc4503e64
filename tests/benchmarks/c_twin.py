"""The frequency solver in C: the steps of ``lanes.c`` around kernels printed by SymPy, built with -O3 -march=native."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import sympy as sp

from cra_sym.arm import characteristic
from tests.benchmarks.kernel import C_FUNCTIONS, powers

FLAGS = ["-O3", "-march=native", "-fno-math-errno", "-fno-trapping-math", "-shared", "-fPIC"]
KERNELS = ("coefficients", "power_series", "basis", "basis_near", "chain", "derivatives")


def has_gcc() -> bool:
    """Return whether the twin can be built."""
    return shutil.which("gcc") is not None


def printed(name: str) -> str:
    """Print a derived kernel as a C function that fills ``out``."""
    expressions, arguments = getattr(characteristic, name)()
    steps, results = sp.cse(expressions)
    named = {"user_functions": {name: f"{name}_" for name in ("sin", "cos", "exp")}}
    lines = [f"  double {symbol} = {sp.ccode(value, **named)};" for symbol, value in steps]
    lines += [f"  out[{index}] = {sp.ccode(value, **named)};" for index, value in enumerate(results)]
    head = ", ".join(f"double {argument}" for argument in arguments)
    return f"static inline void {name}({head}, double *restrict out) {{\n{powers(chr(10).join(lines))}\n}}\n"


def source() -> str:
    """Return the whole program."""
    terms = len(characteristic.power_series()[0])
    parts = ["#include <stdlib.h>", C_FUNCTIONS, *map(printed, KERNELS), f"#define TERMS {terms}"]
    return "\n".join([*parts, Path(__file__).with_name("lanes.c").read_text(encoding="utf-8")])


def simd_width(text: str) -> int:
    """Return the widest vector registers, in bits, that the assembly multiplies doubles in."""
    found = re.findall(r"v(?:mul|f(?:n)?madd\d*)pd\s.*%([xyz])mm", text)
    return {"x": 128, "y": 256, "z": 512, "": 64}[max(found, default="", key=" xyz".index)]


def build(folder: Path) -> tuple[Callable[..., int], int]:
    """Return ``fill(out, kappa_t, kappa_r, mu, iota)``, which counts evaluations, and the SIMD width in bits."""
    text, library = folder / "twin.c", folder / "twin.so"
    text.write_text(source(), encoding="utf-8")
    subprocess.run(["gcc", *FLAGS, str(text), "-o", str(library), "-lm"], check=True)
    assembly = subprocess.run(["gcc", *FLAGS, "-S", str(text), "-o", "-"], check=True, capture_output=True, text=True)
    function = ctypes.CDLL(str(library)).frequency_parameters
    pointer = np.ctypeslib.ndpointer(np.float64, flags="C")
    function.argtypes = [pointer, ctypes.c_long, ctypes.c_long, *[pointer] * 4, ctypes.POINTER(ctypes.c_long)]
    function.restype = ctypes.c_int

    def fill(out: np.ndarray, *groups: np.ndarray) -> int:
        evaluations = ctypes.c_long(0)
        if not function(out, *out.shape, *groups, ctypes.byref(evaluations)):
            raise ArithmeticError("a zero was not reached")
        return evaluations.value

    return fill, simd_width(assembly.stdout)
