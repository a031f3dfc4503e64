"""A sweep on two worker processes, larger than the memory they may take, of which one is killed in the middle.

``python -m tests.campaigns.workers`` says how much was written, and what this process and the workers took.
"""

from __future__ import annotations

import argparse
import os
import resource
import signal
import sys
import tempfile
from pathlib import Path

import numpy as np

import cra_sym as cra

COLUMNS, CHUNK, LIMIT = 1024, 512, 350_000_000


def columns(arm: cra.Arm) -> np.ndarray:
    """Return many numbers an arm: the result is large, each costs little."""
    return np.multiply.outer(np.asarray(arm.k_t), np.arange(1.0, COLUMNS + 1))


def swept(folder: Path, number: int, limit: int) -> dict[str, float]:
    """Sweep on two workers, kill one, and return megabytes: of the result, of this process, the limit of a worker."""
    from distributed import Client, LocalCluster

    k_t = np.geomspace(1e2, 1e6, number)
    killed: list[int] = []
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, memory_limit=limit, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        submit = client.submit

        def kill_one(_: object) -> None:
            if not killed:
                killed.append(next(iter(cluster.workers.values())).pid)
                os.kill(killed[0], signal.SIGKILL)

        def submitted(*args: object, **options: object) -> object:
            future = submit(*args, **options)
            future.add_done_callback(kill_one)
            return future

        client.submit = submitted
        study = cra.sweep(cra.Arm.nominal(), columns, k_t=k_t, chunks=CHUNK, store=folder / "study.zarr", client=client)
        found = study.columns
        assert killed and found.shape == (number, COLUMNS)
        for start in range(0, number, CHUNK):
            part = found[start : start + CHUNK].to_numpy()
            np.testing.assert_array_equal(
                part, np.multiply.outer(k_t[start : start + CHUNK], np.arange(1.0, COLUMNS + 1))
            )
    unit = 1 if sys.platform == "darwin" else 1024
    more = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * unit
    return {"written": found.size * 8 / 1e6, "more in this process": more / 1e6, "limit of a worker": limit / 1e6}


def main() -> None:
    """Sweep, check and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arms", type=int, default=131_072)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = swept(Path(folder), options.arms, LIMIT)
    print(", ".join(f"{name} {value:.0f} MB" for name, value in found.items()))
    assert found["written"] > 2 * found["limit of a worker"] and found["more in this process"] < found["written"] / 4


if __name__ == "__main__":
    main()
