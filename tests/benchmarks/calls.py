"""Calls of a kernel as a user makes them, beside SymEngine's LLVM and JAX: ``python -m tests.benchmarks.calls``.

Every route evaluates the determinant of `tests.benchmarks.kernel`, from arrays to a new array, in one process of its
own, with all processors and with one. The peers are installed from the registry into a scratch environment, which sees
this package by PYTHONPATH; where that is impossible, or with ``--here``, those run that can be imported.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from importlib import metadata
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np
import sympy as sp

from cra_sym.kernels import has_compiler, kernel
from tests.benchmarks import peers
from tests.benchmarks.kernel import ARGUMENTS, SEED, characteristic
from tests.benchmarks.machine import in_rounds, processors, summary

SIZES = (1_000, 10_000, 100_000, 1_000_000, 4_000_000)
LEAST_LANES = 10_000  # from where on the kernel is compiled in its first call
KERNEL, NUMPY = "cra.kernel", "cra.kernel, NumPy"
PEERS = {"SymEngine, LLVM": "symengine", "JAX": "jax"}
_PATIENCE = 600  # seconds for a run

Route = Callable[..., np.ndarray]


def by_symengine(expression: sp.Expr) -> Route:
    """Return SymEngine's function; it takes one array whose last axis counts the arguments."""
    import symengine

    made = symengine.Lambdify(ARGUMENTS, [expression], backend="llvm", cse=True)
    return lambda *values: made(np.stack(values, axis=-1))[..., 0]


def by_jax(expression: sp.Expr) -> Route:
    """Return JAX's function, in double precision; its result is brought to NumPy."""
    import jax

    jax.config.update("jax_enable_x64", True)
    made = jax.jit(sp.lambdify(ARGUMENTS, expression, "jax", cse=True))
    return lambda *values: np.asarray(made(*values))


def found(expression: sp.Expr) -> tuple[dict[str, Route], dict[str, str]]:
    """Return the routes that are there, and why the others are not."""
    routes: dict[str, Route] = {
        KERNEL: kernel(expression, ARGUMENTS),
        NUMPY: kernel(expression, ARGUMENTS, backend="numpy"),
    }
    absent: dict[str, str] = {}
    for (name, package), make in zip(PEERS.items(), (by_symengine, by_jax), strict=True):
        try:
            routes[name] = make(expression)
        except Exception as error:  # whatever a foreign package does when it is not wanted here
            absent[name] = f"{package}: {type(error).__name__}: {error}"
    return routes, absent


def job(sizes: tuple[int, ...]) -> dict[str, Any]:
    """Time first, second and later calls in this process; every size has an expression that nobody has compiled."""
    rng, expression, lanes, absent = np.random.default_rng(SEED), characteristic(), {}, {}
    for number, size in enumerate(sizes):
        routes, absent = found(expression * (number + 2))
        values = [rng.uniform(0.5, 20, size), *(rng.uniform(0, 1, size) for _ in range(3))]
        exact, scale = routes[NUMPY](*values), np.abs(values[0]) ** 5
        rows: dict[str, Any] = {}
        for name, route in routes.items():
            start = perf_counter()
            result = route(*values)
            first = perf_counter() - start
            assert np.max(np.abs(result - exact) / np.maximum(np.abs(exact), scale)) < 1e-13, name
            start = perf_counter()
            route(*values)
            rows[name] = {"first": first, "second": perf_counter() - start}
        timed = {name: partial(route, *values) for name, route in routes.items()}
        for name, times in in_rounds(timed, max(7, min(101, 3_000_000 // size))).items():
            rows[name] |= summary(times)
        lanes[str(size)] = rows
    versions = {p: metadata.version(p) for p in PEERS.values() if not any(why.startswith(p) for why in absent.values())}
    return {"lanes": lanes, "absent": absent, "versions": versions, "overhead us": overhead(expression)}


def overhead(expression: sp.Expr) -> float | None:
    """Return the microseconds of a compiled call of few lanes: the largest of one, ten and a hundred, and a number."""
    if not has_compiler():
        return None
    made, found = kernel(expression, ARGUMENTS, backend="compiled"), []
    for shape in ((), (1,), (10,), (100,)):
        values = [np.full(shape, 0.5) if shape else 0.5 for _ in ARGUMENTS]
        found.append(1e6 * median(in_rounds({"": partial(made, *values)}, 1001)[""]))
    return max(found)


def measured(sizes: tuple[int, ...] = SIZES, *, here: bool = False) -> dict[str, Any]:
    """Return the times of a process that may use all processors, and of one that is bound to one."""
    python, why = sys.executable, {}
    if not here:
        try:
            python = peers.environment(tuple(PEERS.values()))
        except (subprocess.SubprocessError, OSError) as error:
            why = {"scratch environment": type(error).__name__}
    runs = []
    for name, count in (("all processors", processors()), ("1 processor", 1)):
        if count == 1 and not hasattr(os, "sched_setaffinity"):
            continue
        with tempfile.TemporaryDirectory() as cache:
            settings = {**os.environ, "XDG_CACHE_HOME": cache, "PYTHONPATH": os.pathsep.join(["", *sys.path])}
            command = [python, "-m", "tests.benchmarks.calls", "--job", str(count), *map(str, sizes)]
            done = subprocess.run(command, check=True, capture_output=True, text=True, timeout=_PATIENCE, env=settings)
        case = json.loads(done.stdout.splitlines()[-1])
        runs.append({"name": name, **case, "absent": case["absent"] | why})
    return {"runs": runs}


def table(report: dict[str, Any]) -> list[str]:
    """Return the report as lines of Markdown."""
    lines = []
    for case in report["runs"]:
        head = f"| lanes, {case['name']} | route | first ms | second ms | later ms | quartiles | times cra.kernel |"
        lines += ["", head, "| --: | --- " + "| --: " * 5 + "|"]
        for size, rows in case["lanes"].items():
            for name, row in rows.items():
                first, second, later, low, high = (
                    f"{1e3 * row[key]:.3g}" for key in ("first", "second", "median", "low", "high")
                )
                times = row["median"] / rows[KERNEL]["median"]
                lines.append(f"| {size} | {name} | {first} | {second} | {later} | {low} to {high} | {times:.2f} |")
        if case["overhead us"] is not None:
            lines += ["", f"A compiled call of at most 100 lanes takes {case['overhead us']:.3g} µs."]
        lines += ["", *(f"- not run: {name}: {why}" for name, why in case["absent"].items())]
    return lines[1:]


def main(arguments: list[str]) -> None:
    """Run a job, or print the table of all."""
    if arguments[:1] == ["--job"]:
        count, *sizes = map(int, arguments[1:])
        if hasattr(os, "sched_setaffinity"):
            os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:count])
        print(json.dumps(job(tuple(sizes))))
    else:
        print("\n".join(table(measured(here="--here" in arguments))))


if __name__ == "__main__":
    main(sys.argv[1:])
