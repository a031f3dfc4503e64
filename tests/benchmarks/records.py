"""What a record of motion and a store of a sweep cost, beside SciPy's simulation and Zarr alone.

``python -m tests.benchmarks.records`` prints both ratios: routes take turns, and the best time of each counts.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

import cra_sym as cra

SAMPLES, MODES, REGIONS, PIECE = 1_000_000, 5, 100, 100


def best(routes: Mapping[str, Callable[[], Any]], rounds: int) -> dict[str, float]:
    """Return the best time of each route, in seconds; they take turns."""
    found = dict.fromkeys(routes, np.inf)
    for _ in range(rounds):
        for name, route in routes.items():
            start = perf_counter()
            route()
            found[name] = min(found[name], perf_counter() - start)
    return found


def records(samples: int = SAMPLES, rounds: int = 3) -> dict[str, float]:
    """Time the tip's response to a record of acceleration, and `scipy.signal.lsim` on the same state space."""
    from scipy.signal import lsim

    arm, rate = cra.Arm.nominal().replace(zeta=0.01), 2000.0
    t, record = np.arange(samples) / rate, np.random.default_rng(1).normal(size=samples)
    space = cra.state_space(arm, MODES)
    answers: dict[str, np.ndarray] = {}

    def ours() -> None:
        motion = cra.BaseMotion.sampled(None, record, sampling_rate=rate)
        answers["ours"] = cra.tip_response(arm, motion, t, MODES)

    def theirs() -> None:
        answers["theirs"] = lsim(space, record, t)[1]

    found = best({"cra_sym": ours, "scipy lsim": theirs}, rounds)
    v = answers["theirs"] if answers["theirs"].ndim == 1 else answers["theirs"][:, 0]
    # both are exact for a record that is linear between its samples: rounding of a million steps
    assert np.abs(answers["ours"] - v).max() < 1e-6 * np.abs(v).max()
    return {**found, "times as fast": found["scipy lsim"] / found["cra_sym"]}


def stores(rounds: int = 7) -> dict[str, float]:
    """Time a sweep into a store, and Zarr alone with the same chunks; what the sweep computes costs nothing."""
    import zarr

    k_t = np.geomspace(1e2, 1e6, REGIONS * PIECE)
    values, number = np.random.default_rng(1).random((k_t.size, 3)), iter(range(10**6))

    def prepared(arm: cra.Arm) -> np.ndarray:
        return np.zeros(3) + np.asarray(arm.k_t)[..., None]

    with tempfile.TemporaryDirectory() as folder:

        def swept() -> None:
            cra.sweep(cra.Arm.nominal(), prepared, k_t=k_t, chunks=PIECE, store=Path(folder) / f"sweep {next(number)}")

        def alone() -> None:
            place = f"{folder}/zarr {next(number)}"
            group = zarr.open_group(place, mode="w", zarr_format=2)
            array = group.create_array("values", shape=values.shape, chunks=(PIECE, 3), dtype=float)
            group.create_array("k_t", data=k_t)
            zarr.consolidate_metadata(place, zarr_format=2)
            for start in range(0, k_t.size, PIECE):
                array[start : start + PIECE] = values[start : start + PIECE]

        found = best({"cra_sym": swept, "zarr alone": alone}, rounds)
    return {**found, "times zarr": found["cra_sym"] / found["zarr alone"]}


def measured(quick: bool = False) -> dict[str, dict[str, float]]:
    """Measure both."""
    return {"records": records(SAMPLES // 10 if quick else SAMPLES), "stores": stores(3 if quick else 7)}


def note(report: Mapping[str, Mapping[str, float]]) -> list[str]:
    """Return the rows of a table."""
    record, store = report["records"], report["stores"]
    return [
        "| what | cra_sym, s | beside it, s | ratio |",
        "| --- | --: | --: | --: |",
        f"| a record of motion, {MODES} modes, beside lsim | {record['cra_sym']:.3g} | {record['scipy lsim']:.3g} "
        f"| {record['times as fast']:.2f} times as fast |",
        f"| a sweep into {REGIONS} regions, beside Zarr alone | {store['cra_sym']:.3g} | {store['zarr alone']:.3g} "
        f"| {store['times zarr']:.2f} times as long |",
    ]


def main() -> None:
    """Print the table."""
    print("\n".join(note(measured())))


if __name__ == "__main__":
    main()
