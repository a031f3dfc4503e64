"""Random columns, most of which buckle on the grid of the search, against their own frequencies.

``python -m tests.campaigns.columns`` tells each trial whose column is not among the solutions.
"""

from __future__ import annotations

import argparse
import warnings

import numpy as np
import sympy as sp

import cra_sym as cra

TRIALS = 50
SIGMA = 1e-5  # relative uncertainty that is stated for the exact frequencies
CLOSE = 1e-3  # of the given frequencies and the next two, relative
UNKNOWN = (("P", "kr"), ("P", "k"), ("P", "EI"))
DECADES = {"P": 2.0, "EI": 2.0, "k": 3.0, "kr": 3.0}  # to each side of the values
VALUES = {"l": 1.2, "m": 0.2, "EI": 5.0, "P": 1.0, "k": 1e3, "kr": 50.0, "M": 0.05}


def column() -> cra.System:
    """Return a column under an axial load P on two springs, with a mass at its free end."""
    x, t, length, mass, stiffness, load, k, kr, end = sp.symbols("x t l m EI P k kr M")
    v = sp.Function("v")(x, t)
    bent = load * v.diff(x) ** 2 / 2 - stiffness * v.diff(x, 2) ** 2 / 2
    return cra.Model(
        mass * v.diff(t) ** 2 / 2 + bent, fields=[v], x=x, domain=(0, length), t=t,
        left=-k * v**2 / 2 - kr * v.diff(x) ** 2 / 2, right=end * v.diff(t) ** 2 / 2,
    ).at(VALUES)  # fmt: skip


def drawn(system: cra.System, trial: int) -> tuple[cra.System, tuple[str, ...], np.ndarray, int]:
    """Return a stable column, the names of what is unknown, its frequencies, and how many of them are given."""
    rng = np.random.default_rng([23, trial])
    while True:
        names = UNKNOWN[int(rng.integers(len(UNKNOWN)))]
        values = {name: VALUES[name] * 10.0 ** rng.uniform(-DECADES[name], DECADES[name]) for name in names}
        number = int(rng.integers(2, 5))
        true = system.replace(**values)
        try:
            return true, names, cra.natural_frequencies(true, number + 2), number
        except ValueError:  # it buckles
            continue


def tried(system: cra.System, trial: int) -> float:
    """Identify a column; return how far the frequencies of the nearest solution are off, inf if none fits."""
    true, names, exact, number = drawn(system, trial)
    start = true.replace(**{name: VALUES[name] for name in names})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        fit = cra.identify(start, exact[:number], SIGMA * exact[:number], unknown=names)
    off = [
        np.max(np.abs(cra.natural_frequencies(start.replace(**solution.values), number + 2) / exact - 1))
        for solution in fit.solutions
    ]
    return float(min(off)) if fit.fits else np.inf


def main() -> None:
    """Try all columns."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=TRIALS)
    system, trials = column(), parser.parse_args().trials
    bad = [(trial, off) for trial in range(trials) if not (off := tried(system, trial)) < CLOSE]
    print(f"{trials} columns: the true one is among the solutions of {trials - len(bad)}")
    for trial, off in bad:
        print(f"trial {trial}: off by {off:.2g}")
    raise SystemExit(bool(bad))


if __name__ == "__main__":
    main()
