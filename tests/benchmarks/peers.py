"""Peers' own packages beside this one: installed from the registry into a scratch environment, each timed there."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from tests.benchmarks.machine import summary

PACKAGES = ("scikit-fem", "openseespy")
CANNOT = {
    "vibration-toolbox": "ideal ends only (free, clamped, pinned, sliding): no springs, no tip mass",
    "ROSS": "round shafts on bearings: no rotational spring at an end",
}
_PATIENCE = 240  # seconds for an installation or a run


def measured(groups: tuple[np.ndarray, ...], lam: np.ndarray, elements: int, rounds: int) -> dict[str, Any]:
    """Return a row for each peer: microseconds a set and the largest difference from ``lam``, or why it did not run."""
    job = {"arms": np.column_stack(groups[:3]).tolist(), "modes": lam.shape[1], "elements": elements, "rounds": rounds}
    with tempfile.TemporaryDirectory() as folder:
        python = Path(folder) / ("Scripts" if sys.platform == "win32" else "bin") / "python"
        try:
            subprocess.run([sys.executable, "-m", "venv", folder], check=True, capture_output=True, timeout=_PATIENCE)
            install = [str(python), "-m", "pip", "install", "--quiet", "--only-binary", ":all:", *PACKAGES]
            subprocess.run(install, check=True, capture_output=True, timeout=_PATIENCE)
            run = subprocess.run(
                [str(python), str(Path(__file__).with_name("peers_job.py"))],
                input=json.dumps(job), capture_output=True, text=True, check=True, timeout=_PATIENCE,
            )  # fmt: skip
            rows = json.loads(next(line for line in run.stdout.splitlines() if line.startswith("{")))
        except (subprocess.SubprocessError, OSError, StopIteration) as error:
            return {name: {"failed": f"no environment: {type(error).__name__}"} for name in PACKAGES}
    return {name: _row(row, lam) for name, row in rows.items()}


def _row(row: dict[str, Any], lam: np.ndarray) -> dict[str, Any]:
    if "failed" in row:
        return row
    differs = float(np.max(np.abs(np.array(row["lam"]) / lam - 1)))
    times = summary([1e6 * t for t in row["seconds"]], len(lam))
    return {"version": row["version"], **times, "arms": len(lam), "differs by": differs}
