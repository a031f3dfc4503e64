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
    return np.multiply.outer(np.asarray(arm.k_t), np.arange(1.0, 513.0))

def sweep(number, name):
    axes = {"k_t": np.geomspace(1e2, 1e6, number)}
    return cra.sweep(cra.Arm.nominal(), columns, **axes, chunks=1024, store=pathlib.Path(sys.argv[1]) / name)

def most_so_far():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)

sweep(2048, "first")  # libraries and pools are there now
before = most_so_far()
study = sweep(49_152, "second")
grown = most_so_far() - before
print(json.dumps([study.columns.nbytes, grown, float(study.columns[-1, -1])]))
"""


def test_a_sweep_larger_than_the_memory_it_takes(tmp_path):
    """What the process takes at its peak grows by less than a quarter of what the sweep writes."""
    command = [sys.executable, "-c", PROCESS, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    written, grown, last = json.loads(done.stdout)
    assert written == 49_152 * 512 * 8
    assert grown < written / 4, f"{grown / 1e6:.0f} MB for {written / 1e6:.0f} MB"
    assert last == pytest.approx(512e6)
