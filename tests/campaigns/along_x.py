"""Coefficients that vary along x, at random: every frequency agrees with another method, or is refused.

Stepped beams (2 to 9 steps, ratios to 1e3) against transfer matrices in 30 digits, smooth profiles against shooting,
and whatever coefficients SymPy can write against Ritz's method. ``python -m tests.campaigns.along_x`` goes on where it
was stopped; each trial is a line of the record.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp
from mpmath import mp, mpf

import cra_sym as cra
from tests.campaigns.trials import parser, results
from tests.solvers.test_stress import continuum, frequencies, shot, smooth, stepped, stepped_condition

RECORD = Path(__file__).with_name("along_x.jsonl")
TRIALS = 200
WORST = 1e-9  # relative error of a frequency
x, t = sp.symbols("x t")
v = sp.Function("v")(x, t)


def stepped_beam(trial: int) -> dict[str, Any]:
    """Return the largest distance of three frequencies of a stepped beam from roots in 30 digits, and the estimate."""
    lengths, bendings, masses, spring, tip = stepped(np.random.default_rng([31, trial]))
    edges = np.concatenate([[0.0], np.cumsum(lengths)])
    edges[-1] = 1.0

    def pick(values: Any) -> Callable[[Any], Any]:
        return lambda places: values[np.clip(np.searchsorted(edges, places) - 1, 0, len(values) - 1)]

    problem = continuum({("W", 0): pick(bendings), ("M", 0): pick(masses)}, edges, [*spring, 0, 0], [0, 0, tip, 0])
    found, accuracy, _ = frequencies(problem, 3)
    errors = []
    with mp.workdps(30):
        data = (*map(list, (np.diff(edges), bendings, masses)), list(map(mpf, spring)), mpf(tip))
        for w in map(mpf, map(float, found)):
            h = w * mpf(10) ** -12
            low, here, high = (stepped_condition(w + d, *data) for d in (-h, 0, h))
            errors.append(float(abs(here * 2 * h / (high - low)) / w))
    return {"error": max(errors), "accuracy": accuracy}


def smooth_profile(trial: int) -> dict[str, Any]:
    """Return the same of a smooth tapered beam under tension, by DOP853 whose own error is some 1e-12."""
    bending, mass, tension = smooth(np.random.default_rng([32, trial]))
    inf = np.inf
    problem = continuum({("W", 0): bending, ("M", 0): mass, ("R", 1): tension}, [0.0, 1.0], [inf, inf, 0, 0], [0.0] * 4)
    try:
        found, accuracy, _ = frequencies(problem, 3)
    except ValueError as error:
        return {"refused": str(error)}
    errors = []
    for w in found:
        h = 1e-6 * w
        low, here, high = (shot(w + d, bending, mass, tension) for d in (-h, 0.0, h))
        errors.append(float(abs(here * 2 * h / (high - low)) / w))
    return {"error": max(errors), "accuracy": accuracy}


def written(generator: np.random.Generator, depth: int = 2) -> sp.Expr:
    """Return a random positive expression in x, smooth or not."""

    def number(low: float, high: float) -> sp.Rational:
        return sp.Rational(int(1000 * generator.uniform(low, high)), 1000)

    place, steep, size = number(0.1, 0.9), number(1, 30), number(0.2, 3)
    z = steep * (x - place)
    leaves: list[Callable[[], sp.Expr]] = [
        lambda: 1 + size * x,
        lambda: sp.exp(number(-3, 3) * x),
        lambda: 1 + size * sp.exp(-(z**2)),
        lambda: sp.Rational(3, 2) + sp.tanh(z),
        lambda: 2 + sp.sin(steep * x),
        lambda: 1 + size / (1 + z**2),
        lambda: sp.sqrt(1 + size * x**2),
        lambda: sp.Piecewise((1, x < place), (1 + size, True)),
        lambda: 1 + size * sp.Heaviside(x - place),
        lambda: 1 + size * sp.Abs(x - place),
        lambda: sp.Max(sp.Rational(1, 2), size * x),
        lambda: 1 + size * sp.floor(sp.Integer(int(generator.integers(2, 9))) * x),
        lambda: 2 + sp.sign(x - place),
        lambda: 1 + size * sp.SingularityFunction(x, place, 1),
        lambda: cra.stations(x, [(0, 1), (place, 1 + size), (1, number(0.3, 2))]),
        lambda: 1 + size * sp.Piecewise((1, (x > place / 2) & (x < place)), (0, True)),
        lambda: 1 + size * sp.Mod(3 * x, 1),
        lambda: 1 + size * sp.log(1 + steep * x),
    ]
    if depth == 0 or generator.random() < 0.4:
        return leaves[int(generator.integers(len(leaves)))]()
    first, second = written(generator, depth - 1), written(generator, depth - 1)
    return (first + second, first * second, first / second)[int(generator.integers(3))]


def coefficients(trial: int) -> dict[str, Any]:
    """Compare a beam or a string with random coefficients to Ritz's method."""
    generator = np.random.default_rng([33, trial])
    stiffness, mass, order = written(generator), written(generator), int(generator.integers(1, 3))
    density = mass * v.diff(t) ** 2 / 2 - stiffness * v.diff(x, order) ** 2 / 2
    held = [v.subs(x, 0), v.subs(x, 1)] if generator.random() < 0.5 or order == 1 else [v.subs(x, 0)]
    held += [v.diff(x).subs(x, 0)] if len(held) == 1 else []
    case = {"stiffness": str(stiffness), "mass": str(mass), "order": order}
    try:
        system = cra.Model(density, fields=[v], x=x, domain=(0, 1), t=t, essential=held).at({})
        check = system.check(3)
    except ValueError as error:
        return case | {"refused": str(error)}
    difference, expected = float(check.difference), float(check.expected)
    # elements converge on what is not smooth within them as they like: a tenth of what halving changes is not an error
    return case | {"difference": difference, "expected": expected, "agrees": abs(difference) <= 3.0 * expected + 1e-9}


KINDS = {"stepped beams": stepped_beam, "smooth profiles": smooth_profile, "coefficients": coefficients}


def good(result: dict[str, Any]) -> bool:
    """Tell whether a trial is right, or refused."""
    return "refused" in result or bool(result.get("agrees", result.get("error", np.inf) < WORST))


def main() -> None:
    """Run the trials that the record lacks."""
    made = parser(__doc__, TRIALS)
    made.add_argument("--kind", choices=KINDS, action="append")
    options = made.parse_args()
    wanted = ({"kind": kind, "trial": trial} for kind in options.kind or KINDS for trial in range(options.trials))
    done = results(RECORD, options, wanted, lambda kind, trial: KINDS[kind](trial))
    for kind in KINDS:
        mine = [result for result in done if result["kind"] == kind]
        worst = max((result.get("error", abs(result.get("difference", 0.0))) for result in mine), default=0.0)
        refused = sum("refused" in result for result in mine)
        print(f"{kind}: {len(mine)} tried, {refused} refused, worst {worst:.1e}")
    bad = [result for result in done if not good(result)]
    for result in bad:
        print(result)
    raise SystemExit(bool(bad))


if __name__ == "__main__":
    main()
