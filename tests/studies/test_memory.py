"""A sweep into a store takes the memory of its regions, not that of its result."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

pytest.importorskip("zarr", reason="the extra 'scale' brings zarr")
pytest.importorskip("resource", reason="the peak of a process is asked the Unix way")

PROCESS = """
import json, pathlib, resource, sys
import numpy as np
import cra_sym as cra

def columns(arm):
    "Many numbers an arm: the result is large, each costs little."
    return np.multiply.outer(np.asarray(arm.k_t), np.arange(1.0, 1025.0))

def sweep(number, name):
    axes = {"k_t": np.geomspace(1e2, 1e6, number)}
    return cra.sweep(cra.Arm.nominal(), columns, **axes, chunks=1024, store=pathlib.Path(sys.argv[1]) / name)

def most_so_far():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)

sweep(4096, "first")  # libraries and pools are there now
before = most_so_far()
study = sweep(12_288, "second")
small = most_so_far() - before
status = pathlib.Path("/proc/self/status")
if status.exists():  # the system refuses what goes beyond a quarter of the next result
    taken = next(int(line.split()[1]) << 10 for line in status.read_text().splitlines() if line.startswith("VmData"))
    allowed = taken + 49_152 * 1024 * 8 // 4
    resource.setrlimit(resource.RLIMIT_DATA, (allowed, allowed))
study = sweep(49_152, "third")
large = most_so_far() - before
print(json.dumps([study.columns.nbytes, small, large, float(study.columns[-1, -1])]))
"""


def test_a_sweep_larger_than_the_memory_it_may_take(tmp_path):
    """It goes through where a quarter of its result is all the memory left, and four times the arms take no more."""
    command = [sys.executable, "-c", PROCESS, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    written, small, large, last = json.loads(done.stdout)
    assert written == 49_152 * 1024 * 8
    assert large < small + written / 10, f"{small / 1e6:.0f} MB, then {large / 1e6:.0f} MB of {written / 1e6:.0f} MB"
    assert last == pytest.approx(1024e6)
