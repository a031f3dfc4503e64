"""Random joints against their own frequencies: the true joint is among the solutions, and a wrong one never alone.

``python -m tests.campaigns.joints`` goes on where it was stopped; each trial is a line of the record.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

import cra_sym as cra
from tests.campaigns.trials import parser, results

RECORD = Path(__file__).with_name("joints.jsonl")
TRIALS = 500
SIGMA = 1e-5  # relative uncertainty that is stated for the exact frequencies
CLOSE = 1e-3  # of the next three frequencies, relative


def drawn(trial: int) -> tuple[float, float, int]:
    """Return the joint of a trial, k_t from 0.5 to 1e5 and k_r from 0.05 to 1e4, and how many frequencies are given."""
    rng = np.random.default_rng([17, trial])
    k_t, k_r = np.exp(rng.uniform(np.log([0.5, 0.05]), np.log([1e5, 1e4])))
    return float(k_t), float(k_r), int(rng.integers(2, 5))


def tried(trial: int) -> dict[str, object]:
    """Identify the joint of a trial; tell how far the next three frequencies of each solution are off."""
    k_t, k_r, number = drawn(trial)
    arm = cra.Arm.nominal()
    exact = cra.natural_frequencies(arm.replace(k_t=k_t, k_r=k_r), number + 3)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        fit = cra.identify_joint(arm, exact[:number], SIGMA * exact[:number])
    off = []
    for solution in fit.solutions:
        next_ones = cra.natural_frequencies(arm.replace(**solution.values), number + 3)[number:]
        off.append(float(np.max(np.abs(next_ones / exact[number:] - 1))))
    return {"trial": trial, "k_t": k_t, "k_r": k_r, "frequencies": number, "fits": fit.fits, "off": off}


def good(result: dict[str, object]) -> bool:
    """Tell whether the true joint is among the solutions."""
    off = result["off"]
    assert isinstance(off, list)
    return bool(result["fits"]) and min(off) < CLOSE


def main() -> None:
    """Run the trials that the record lacks."""
    options = parser(__doc__, TRIALS).parse_args()
    done = results(RECORD, options, ({"trial": trial} for trial in range(options.trials)), tried)
    bad = [result for result in done if not good(result)]
    several = sum(len(result["off"]) > 1 for result in done)
    print(f"{len(done)} joints: the true one is among the solutions of {len(done) - len(bad)}; {several} have several")
    for result in bad:
        print(result)
    raise SystemExit(bool(bad))


if __name__ == "__main__":
    main()
