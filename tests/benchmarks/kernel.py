"""One evaluation of the arm's characteristic function by several routes: ``python -m tests.benchmarks.kernel [lanes]``.

The function is a determinant derived here, in one array pass over random arms, on one thread. Every route evaluates the
same expression. Rounds are interleaved, so a slow moment of the machine hits every route alike; what counts are ratios
of the medians. The C code is compiled with ``gcc -O3 -march=native``, once with the C library's functions and once
with the package's branch-free ones in C: the latter is the floor that compiled kernels are measured against.
"""

from __future__ import annotations

import ctypes
import json
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from time import perf_counter

import numpy as np
import sympy as sp

from cra_sym.kernels import compiled, has_compiler, kernel, lanes

SEED, ROUNDS = 20261122, 25
b, a_t, a_r, mu = ARGUMENTS = sp.symbols("b a_t a_r mu", positive=True)

C_FUNCTIONS = """
#include <math.h>
#include <stdint.h>
#include <string.h>
static inline int64_t bits(double x) { int64_t k; memcpy(&k, &x, 8); return k; }
static inline double value(int64_t k) { double x; memcpy(&x, &k, 8); return x; }
static const double shift = 6755399441055744.0;
static inline double sine(double r) {
  double z = r * r, p = -2.5051129896450185e-08 + z * 1.5917988979397435e-10;
  p = -0.00019841269836740532 + z * (2.7557316093198404e-06 + z * p);
  return r + r * z * (-0.16666666666666666 + z * (0.008333333333330936 + z * p)); }
static inline double cosine(double r) {
  double z = r * r, p = 2.087614504941318e-09 + z * -1.138254464534925e-11;
  p = 2.48015872987544e-05 + z * (-2.755731726587808e-07 + z * p);
  p = 0.041666666666666664 + z * (-0.0013888888888887389 + z * p);
  return (1.0 - 0.5 * z) + z * z * p; }
static inline double circular(double x, int64_t turn) {
  double n = (x * 0.6366197723675814 + shift) - shift;
  double r = ((x - n * 1.5707963267341256) - n * 6.077100506303966e-11) - n * 2.0222662487959506e-21;
  int64_t quadrant = bits(x * 0.6366197723675814 + shift) + turn;
  double s = sine(r), c = cosine(r), y = quadrant & 1 ? c : s;
  y = fabs(x) <= 1e6 ? y : NAN;
  return quadrant & 2 ? -y : y; }
static inline double sin_(double x) { return circular(x, 0); }
static inline double cos_(double x) { return circular(x, 1); }
static inline double exp_(double x) {
  x = x < -746.0 ? -746.0 : x; x = x > 710.0 ? 710.0 : x;
  double shifted = x * 1.4426950408889634 + shift, n = shifted - shift;
  double r = (x - n * 0.6931471803691238) - n * 1.9082149292705877e-10;
  double p = 2.761390867578486e-07 + r * 2.509563297507093e-08;
  p = 2.480153620505534e-05 + r * (2.755727992579576e-06 + r * p);
  p = 0.0013888888905973543 + r * (0.00019841269854409363 + r * p);
  p = 0.041666666666651246 + r * (0.008333333333332147 + r * p);
  p = 1.0 + (r + r * r * (0.5 + r * (0.16666666666666666 + r * p)));
  int64_t power = bits(shifted) - (0x4338000000000000 - 2046), half = (power >> 1) & 0x7FF;
  return p * value(half << 52) * value((power - half) << 52); }
"""


def characteristic() -> sp.Expr:
    """Derive the determinant of a jointed beam with a tip mass, scaled by e^-b; a_t and a_r are compliances."""
    xi, c, s, decay = sp.symbols("xi c s E")
    shapes = [sp.cos(b * xi), sp.sin(b * xi), sp.exp(-b * xi), sp.exp(b * (xi - 1))]

    def row(condition: Callable[[Callable[[int], sp.Expr]], sp.Expr], end: int) -> list[sp.Expr]:
        return [condition(lambda n, f=shape: (f.diff(xi, n) / b**n).subs(xi, end)) for shape in shapes]

    matrix = sp.Matrix(
        [
            row(lambda d: d(0) + a_t * b**3 * d(3), 0),
            row(lambda d: d(1) - a_r * b * d(2), 0),
            row(lambda d: d(2), 1),
            row(lambda d: d(3) + mu * b * d(0), 1),
        ]
    ).subs({sp.cos(b): c, sp.sin(b): s, sp.exp(-b): decay})
    polynomial = sp.rem(matrix.det(method="berkowitz").expand(), c**2 + s**2 - 1, c)
    grouped = sp.collect(polynomial, [a_t, a_r, mu], sp.factor)
    return grouped.subs({c: sp.cos(b), s: sp.sin(b), decay: sp.exp(-b)})


def c_route(expression: sp.Expr, own: bool, folder: Path) -> Callable[..., None]:
    """Compile the expression as a C loop and return a function (out, b, a_t, a_r, mu)."""
    steps, (result,) = sp.cse([expression])
    printer = {"user_functions": {name: f"{name}_" for name in ("sin", "cos", "exp")}} if own else {}
    body = "".join(f"    double {name} = {sp.ccode(value, **printer)};\n" for name, value in steps)
    names = [str(symbol) for symbol in ARGUMENTS]
    declared = ", ".join(f"const double *restrict {name}_" for name in names)
    loaded = "".join(f"    double {name} = {name}_[lane];\n" for name in names)
    body = powers(body + f"    out[lane] = {sp.ccode(result, **printer)};\n")
    loop = f"  for (long lane = 0; lane < lanes; lane++) {{\n{loaded}{body}  }}\n"
    text = f"{C_FUNCTIONS}void fill(double *restrict out, {declared}, long lanes) {{\n{loop}}}\n"
    source, library = folder / f"route{own}.c", folder / f"route{own}.so"
    source.write_text(text)
    flags = ["-O3", "-march=native", "-fno-math-errno", "-fno-trapping-math", "-shared", "-fPIC"]
    subprocess.run(["gcc", *flags, str(source), "-o", str(library), "-lm"], check=True)
    fill = ctypes.CDLL(str(library)).fill
    pointer = np.ctypeslib.ndpointer(np.float64, flags="C")
    fill.argtypes, fill.restype = [pointer] * 5 + [ctypes.c_long], None
    return lambda out, *values: fill(out, *values, out.size)


def powers(text: str) -> str:
    """Replace pow by products: the C library's pow would be no fair opponent."""
    return re.sub(r"pow\((\w+), (\d+)\)", lambda match: f"({'*'.join([match[1]] * int(match[2]))})", text)


def routes(expression: sp.Expr, folder: Path) -> dict[str, Callable[..., object]]:
    """Return name -> function (out, b, a_t, a_r, mu)."""
    numpy_kernel = kernel(expression, ARGUMENTS, backend="numpy")
    lambdified = sp.lambdify(ARGUMENTS, expression, "numpy", cse=True)
    found: dict[str, Callable[..., object]] = {
        "NumPy, lambdify": lambda out, *values: lambdified(*values),
        "NumPy, kernel": lambda out, *values: numpy_kernel(*values),
    }
    if has_compiler():
        template = lanes._template([True] * 4, 1, True)
        fill = compiled(template, {"evaluate": numpy_kernel}).fill
        found["compiled, platform's functions"] = compiled(template, {"evaluate": numpy_kernel}, elementary=False).fill
        found["compiled, kernel"] = fill
    if shutil.which("gcc"):
        found["C, platform's functions"] = c_route(expression, False, folder)
        found["C, branch-free functions"] = c_route(expression, True, folder)
    found["memory traffic alone"] = lambda out, *values: np.add(values[0], values[1], out=out)
    return found


def main(size: int = 1 << 16) -> dict[str, object]:
    """Time every route and return the table."""
    rng = np.random.default_rng(SEED)
    values = [rng.uniform(0.5, 20, size), *(rng.uniform(0, 1, size) for _ in range(3))]
    out, expression = np.empty(size), characteristic()
    with tempfile.TemporaryDirectory() as name:
        found = routes(expression, Path(name))
        check = kernel(expression, ARGUMENTS, backend="numpy")(*values)
        for title, route in found.items():
            result = route(out, *values)
            if "memory" not in title:
                result = result if isinstance(result, np.ndarray) else out
                scale = np.maximum(np.abs(check), values[0] ** 5)
                assert np.max(np.abs(result - check) / scale) < 1e-13, title
        times = {title: [] for title in found}
        for _ in range(ROUNDS):
            for title, route in found.items():
                start = perf_counter()
                route(out, *values)
                times[title].append((perf_counter() - start) / size * 1e9)
    floor = np.median(times.get("C, branch-free functions", times["NumPy, kernel"]))
    table = {
        title: {
            "median ns": round(float(np.median(t)), 2),
            "quartiles ns": [round(float(q), 2) for q in np.quantile(t, [0.25, 0.75])],
            "ratio to C": round(float(np.median(t) / floor), 2),
        }
        for title, t in times.items()
    }
    versions = {p: metadata.version(p) for p in ("numpy", "sympy", "llvmlite") if p != "llvmlite" or has_compiler()}
    machine = {"machine": platform.machine(), "cores": os.cpu_count(), "python": platform.python_version()}
    return {"lanes": size, "rounds": ROUNDS, "seed": SEED, "table": table, "versions": versions, **machine}


if __name__ == "__main__":
    report = main(*map(int, sys.argv[1:]))
    for title, row in report["table"].items():
        print(f"{title:30}{row['median ns']:>9} ns   {row['ratio to C']:>7} x C   quartiles {row['quartiles ns']}")
    Path(__file__).with_suffix(".json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
