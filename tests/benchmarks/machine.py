"""The machine a benchmark ran on: names, versions, and the floor below which nothing can go."""

from __future__ import annotations

import os
import platform
import statistics
import subprocess
from collections.abc import Callable, Mapping
from importlib import metadata
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import sympy as sp

from cra_sym.kernels import compiled, has_compiler, kernel, lanes

PACKAGES = ("numpy", "scipy", "sympy", "llvmlite")


def processors() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def description() -> dict[str, Any]:
    """Return processor, its SIMD extensions, load, and the versions of all that takes part."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    model = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "")
    flags = next((line for line in lines if line.startswith("flags")), "").split()
    gcc = subprocess.run(["gcc", "-dumpfullversion"], capture_output=True, text=True, check=False).stdout.strip()
    return {
        "processor": model or platform.processor() or platform.machine(),
        "processors": processors(),
        "SIMD": next((name for name in ("avx512f", "avx2", "sse2") if name in flags), platform.machine()),
        "load when started": round(os.getloadavg()[0], 2) if hasattr(os, "getloadavg") else None,
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "gcc": gcc,
        **{name: metadata.version(name) for name in PACKAGES if name != "llvmlite" or has_compiler()},
    }


def in_rounds(routes: Mapping[str, Callable[[], object]], rounds: int, numbers: int = 0) -> dict[str, list[float]]:
    """Time every route once a round, after a first time that does not count: a slow moment hits all of them alike.

    Before each, ``numbers`` doubles are written and freed. A virtual machine may hand memory that has been free for two
    seconds back to its host, and getting it again is up to thirty times as slow as a first write of memory that it has.
    """
    for route in routes.values():
        route()
    times: dict[str, list[float]] = {name: [] for name in routes}
    for _ in range(rounds):
        for name, route in routes.items():
            np.ones(numbers)
            start = perf_counter()
            route()
            times[name].append(perf_counter() - start)
    return times


def summary(times: list[float], share: float = 1.0) -> dict[str, float]:
    """Return median and quartiles of times, divided by what was done in each."""
    low, _, high = statistics.quantiles(times, n=4) if len(times) > 1 else times * 3
    return {"median": statistics.median(times) / share, "low": low / share, "high": high / share}


def floor() -> dict[str, float]:
    """Return the cost of a sine with cosine and an exponential (ns), compiled and in NumPy, and the copying rate."""
    size, big = 1 << 14, 1 << 23
    x, out, source, target = np.linspace(0.5, 20, size), np.empty(size), np.ones(big), np.empty(big)
    routes: dict[str, Callable[[], object]] = {
        "sin + cos + exp, NumPy (ns)": lambda: np.add(np.sin(x) + np.cos(x), np.exp(-x), out=out),
        "copying (GB/s)": lambda: np.copyto(target, source),
        "writing memory of the system's (GB/s)": lambda: np.ones(big),
    }
    if has_compiler():
        y = sp.Symbol("y")
        made = kernel(sp.sin(y) + sp.cos(y) + sp.exp(-y), (y,), backend="numpy")
        fill = compiled(lanes._template([True], 1, True), {"evaluate": made}).fill
        routes["sin + cos + exp, compiled (ns)"] = lambda: fill(out, x)
    medians = {name: statistics.median(times) for name, times in in_rounds(routes, 15).items()}
    moved = {"copying (GB/s)": 2 * source.nbytes, "writing memory of the system's (GB/s)": source.nbytes}
    rates = {name: number / medians.pop(name) / 1e9 for name, number in moved.items()}
    return {**{name: 1e9 * median / size for name, median in medians.items()}, **rates}
