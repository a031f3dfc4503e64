"""A sweep into a store on one machine, and what that says of many."""

from __future__ import annotations

import tempfile
from pathlib import Path
from time import perf_counter

import numpy as np

import cra_sym as cra

NODES = 100


def measured(most: int) -> dict[str, float]:
    """Return arms a second through a store, bytes an arm, and the seconds a region costs beside its arms."""
    side, pieces = round(most**0.5), 2
    axes = {"k_t": np.geomspace(1e2, 1e6, side), "k_r": np.geomspace(1e0, 1e5, side)}
    cra.natural_frequencies(cra.Arm.nominal().replace(k_t=np.ones(100_000)))  # machine code is there from now on
    with tempfile.TemporaryDirectory() as folder:
        seconds = []
        for number in (pieces, 4 * pieces):
            start = perf_counter()
            study = cra.sweep(cra.Arm.nominal(), **axes, chunks=-(-side // number), store=Path(folder) / str(number))
            seconds.append(perf_counter() - start)
        size = study.natural_frequencies.nbytes / side**2
    region = max(seconds[1] - seconds[0], 0.0) / ((4 * pieces) ** 2 - pieces**2)
    return {"arms": side**2, "seconds": seconds[0], "bytes an arm": size, "seconds a region": region}


def note(found: dict[str, float]) -> str:
    """Work out what a hundred such machines would do: regions share nothing, so only the storage can be in the way."""
    rate = found["arms"] / found["seconds"]
    traffic = NODES * rate * found["bytes an arm"]
    return (
        f"A sweep of {found['arms']:.2g} arms into a store took {found['seconds']:.2g} s: {rate:.2g} arms a second, "
        f"three frequencies each, and {1e3 * found['seconds a region']:.2g} ms more for each further region. Regions "
        f"share nothing, so {NODES} such machines would do {NODES * rate * 3600:.2g} arms in an hour as long as their "
        f"storage takes {traffic / 1e9:.2g} GB/s (before compression), and a machine that dies costs the regions "
        f"it had in hand."
    )
