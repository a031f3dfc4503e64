"""The solver against proved enclosures over many arms: ``python -m tests.benchmarks.certification [arms] [modes]``.

Writes ``certification.json`` beside this file: how many frequencies were tried, how many enclosures were proved, how
wide they are, how far outside them the solver's values lie and how many of them by more than `TOLERANCE`, with the
seed, the versions and the kernels' sources that were certified.
"""

from __future__ import annotations

import json
import platform
import sys
from importlib import metadata
from pathlib import Path

import numpy as np
from tqdm import tqdm

import cra_sym as cra
from cra_sym.kernels.derived import fingerprint

SEED = 20261122
TOLERANCE = 4e-15
BATCH = 100
SPECIAL = {"k_t": (0.0, np.inf, 1e-9, 1e12), "k_r": (0.0, np.inf, 1e-9, 1e12), "m_e": (0.0, 1e6), "J_e": (0.0, 1e6)}
RANGES = {"k_t": (-9, 12), "k_r": (-9, 12), "m_e": (-6, 6), "J_e": (-9, 6), "L": (-1, 1)}


def arms(rng: np.random.Generator, number: int) -> cra.Arm:
    """Random arms; half of their stiffnesses and inertias are structured extremes."""
    values = {name: 10 ** rng.uniform(*ends, number) for name, ends in RANGES.items()}
    for name, special in SPECIAL.items():
        values[name] = np.where(rng.random(number) < 0.5, rng.choice(special, number), values[name])
    return cra.Arm.nominal().replace(**values)


def main(number: int = 100_000, modes: int = 10) -> dict[str, object]:
    """Certify ``number`` arms and return the summary, which is written on the way as well."""
    rng = np.random.default_rng(SEED)
    proved, beyond, widest, farthest, summary = 0, 0, 0.0, 0.0, {}
    for done in tqdm(range(BATCH, number + 1, BATCH), disable=None):
        arm = arms(rng, BATCH)
        frequency = cra.natural_frequencies(arm, modes=modes)
        certificate = cra.certify(arm, modes=modes)
        unit = np.where(frequency > 0, frequency, 1.0)
        outside = np.maximum(frequency - certificate.upper, certificate.lower - frequency) / unit
        proved += int(certificate.complete.sum()) * modes
        beyond += int((outside > TOLERANCE).sum())
        widest = max(widest, float(np.nanmax((certificate.upper - certificate.lower) / unit)))
        farthest = max(farthest, float(np.nanmax(outside)))
        summary = {
            "seed": SEED,
            "arms": done,
            "modes": modes,
            "frequencies": done * modes,
            "proved": proved,
            "widest enclosure, relative": widest,
            "farthest solver value outside, relative": farthest,
            f"solver values more than {TOLERANCE:g} outside": beyond,
            "sources": fingerprint()[:16],
            "versions": {name: metadata.version(name) for name in ("python-flint", "numpy", "sympy")},
            "python": platform.python_version(),
        }
        Path(__file__).with_suffix(".json").write_text(json.dumps(summary, indent=1) + "\n")
    return summary


if __name__ == "__main__":
    print(json.dumps(main(*map(int, sys.argv[1:])), indent=1))
