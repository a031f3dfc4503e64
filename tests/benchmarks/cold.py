"""Cold starts: seconds of processor and of wall time a new process takes, with and without what earlier ones left."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from time import perf_counter

from cra_sym.kernels import has_compiler

CALL = """
import numpy as np, cra_sym as cra
{before}
number = {arms}
rng = np.random.default_rng(0)
arm = cra.Arm.nominal().replace(k_t=10 ** rng.uniform(2, 6, number), k_r=10 ** rng.uniform(0, 5, number))
cra.natural_frequencies(arm)
"""

CASES = (
    ("one arm", 1, ""),
    ("1e6 arms", 1_000_000, ""),
    ("1e6 arms, NumPy alone", 1_000_000, "from cra_sym.kernels import parts; parts.has_compiler = lambda: False"),
)


def spent(code: str, cache: str) -> dict[str, float]:
    """Run a process and return what it took, all its threads and children counted."""
    before, start = os.times(), perf_counter()
    subprocess.run([sys.executable, "-c", code], check=True, env={**os.environ, "XDG_CACHE_HOME": cache})
    wall, after = perf_counter() - start, os.times()
    used = after.children_user + after.children_system - before.children_user - before.children_system
    return {"processor s": round(used, 2), "wall s": round(wall, 2)}


def measured() -> dict[str, dict[str, float]]:
    """Return the table; the second of two calls of the same size finds what the first left in the store."""
    table = {}
    with tempfile.TemporaryDirectory() as cache:
        table["import numpy"] = spent("import numpy", cache)
        table["import cra_sym and numpy"] = spent("import numpy, cra_sym", cache)
        for name, arms, before in CASES if has_compiler() else CASES[:2]:
            with tempfile.TemporaryDirectory() as empty:
                code = CALL.format(arms=arms, before=before)
                table[f"{name}, nothing stored"] = spent(code, empty)
                table[f"{name}, stored"] = spent(code, empty)
    return table
