"""Peers' own packages beside this one: installed from the registry into a scratch environment, each timed there."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from tests.benchmarks.machine import summary

PACKAGES = ("scikit-fem", "openseespy")
CANNOT = {  # what the sources of these versions say
    "vibration-toolbox 0.6.10": "euler_beam_modes has six pairs of ideal ends (bctype 1 to 6): no springs, no tip mass",
    "ROSS 2.3.0": "the matrix of a BearingElement, its spring to the ground, is translational, and the rotational"
    " stiffness of a CouplingElement joins two nodes: no elastic clamping",
}
_PATIENCE = 240  # seconds for an installation or a run


def measured(groups: tuple[np.ndarray, ...], lam: np.ndarray, elements: int, rounds: int) -> dict[str, Any]:
    """Return a row for each peer: microseconds a set and the largest difference from ``lam``, or why it did not run."""
    job = {"arms": np.column_stack(groups[:3]).tolist(), "modes": lam.shape[1], "elements": elements, "rounds": rounds}
    command = [str(Path(__file__).with_name("peers_job.py"))]
    try:
        done = _run([environment(PACKAGES), *command], input=json.dumps(job), text=True)
        rows = json.loads(next(line for line in done.stdout.splitlines() if line.startswith("{")))
    except (subprocess.SubprocessError, OSError, StopIteration) as error:
        return {name: {"failed": f"no environment: {type(error).__name__}"} for name in PACKAGES}
    return {name: _row(row, lam) for name, row in rows.items()}


def _run(command: list[str], **options: Any) -> subprocess.CompletedProcess:
    return subprocess.run(command, check=True, capture_output=True, timeout=_PATIENCE, **options)


_folder = tempfile.TemporaryDirectory(prefix="peers")  # goes with the process


@cache
def environment(packages: tuple[str, ...]) -> str:
    """Make a scratch environment with these packages and return its Python.

    Raises
    ------
    subprocess.SubprocessError, OSError
        If that is not possible, without a registry for instance.
    """
    folder = Path(_folder.name) / packages[0]
    _run([sys.executable, "-m", "venv", str(folder)])
    python = str(folder / ("Scripts" if sys.platform == "win32" else "bin") / "python")
    _run([python, "-m", "pip", "install", "--quiet", "--only-binary", ":all:", *packages])
    return python


def _row(row: dict[str, Any], lam: np.ndarray) -> dict[str, Any]:
    if "failed" in row:
        return row
    differs = float(np.max(np.abs(np.array(row["lam"]) / lam - 1)))
    times = summary([1e6 * t for t in row["seconds"]], len(lam))
    return {"version": row["version"], **times, "arms": len(lam), "differs by": differs}
