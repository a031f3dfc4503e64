"""Charts and sensitivities of other systems, part of ``python -m tests.benchmarks``, and proofs.

``python -m tests.benchmarks.charts`` tries the proofs and writes ``charts.json`` beside this file: how many points of
two charts of the arm are proved, and how many against the growth rates; how many frequencies of random Timoshenko arms
are proved, and how far outside the enclosures the solver's values lie.
"""

from __future__ import annotations

import json
import platform
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any

import numpy as np
import sympy as sp

import cra_sym as cra
from cra_sym.symbols import L, t, v, x

SIDE, MODES, SEED = 200, 3, 20261130
EI, rhoA, rhoI, kGA, m, k, c, T, d = sp.symbols("EI rhoA rhoI kGA m k c T d")
psi = sp.Function("psi")(x, t)
PLACE: dict[str, Any] = {"x": x, "domain": (0, L), "t": t}
SHEAR = rhoA * v.diff(t) ** 2 / 2 + rhoI * psi.diff(t) ** 2 / 2 - EI * psi.diff(x) ** 2 / 2
TIMOSHENKO = cra.Model(
    SHEAR - kGA * (v.diff(x) - psi) ** 2 / 2,
    fields=[v, psi],
    left=-k * v**2 / 2,
    right=m * v.diff(t) ** 2 / 2,
    essential=[psi.subs(x, 0)],
    **PLACE,
)
DAMPED = cra.Model(
    rhoA * v.diff(t) ** 2 / 2 - EI * v.diff(x, 2) ** 2 / 2,
    fields=[v],
    left=-k * v**2 / 2,
    right=m * v.diff(t) ** 2 / 2,
    essential=[v.diff(x).subs(x, 0)],
    virtual_work=[(-d * v.diff(t), v, "right")],
    **PLACE,
)
BELT = cra.Model(
    rhoA * (v.diff(t) + c * v.diff(x)) ** 2 / 2 - T * v.diff(x) ** 2 / 2,
    fields=[v],
    essential=[v.subs(x, 0), v.subs(x, L)],
    **PLACE,
)


def systems() -> dict[str, tuple[cra.System, cra.Fluctuation]]:
    """Return the systems and what fluctuates."""
    beam = {EI: 1.0, rhoA: 1.0, L: 1.0, m: 0.2, k: 1e3}
    return {
        "the arm": (cra.Arm.nominal().replace(k_t=1e3), cra.JointStiffness()),
        "the arm, its mass": (cra.Arm.nominal().replace(k_t=1e3), cra.Fluctuation(rho=1.0)),
        "Timoshenko arm": (TIMOSHENKO.at({**beam, rhoI: 1e-3, kGA: 300.0}), cra.Fluctuation(k=1.0)),
        "arm with a damper": (DAMPED.at({**beam, d: 0.05}), cra.Fluctuation(k=1.0)),
        "moving belt": (BELT.at({rhoA: 1.0, c: 0.3, T: 1.0, L: 1.0}), cra.Fluctuation(T=1.0)),
        "Timoshenko arm, its mass": (TIMOSHENKO.at({**beam, rhoI: 1e-3, kGA: 300.0}), cra.Fluctuation(rhoA=1.0)),
        "moving belt, its mass": (BELT.at({rhoA: 1.0, c: 0.3, T: 1.0, L: 1.0}), cra.Fluctuation(rhoA=1.0)),
    }


def chart(system: cra.System) -> tuple[np.ndarray, np.ndarray]:
    """Return the excitation frequencies and the sizes of a chart."""
    omega = 2 * np.pi * cra.natural_frequencies(system.conservative_part, MODES)
    return np.linspace(omega[0], 2.2 * omega[-1], SIDE), np.linspace(0.0, 0.4, SIDE)[:, None]


def costs(rounds: int = 3) -> dict[str, float]:
    """Return what a chart costs beside the arm's, whose stiffness or mass oscillates too, compiled."""
    found: dict[str, float] = {}
    for name, (system, excitation) in systems().items():
        at, times = chart(system), []
        cra.growth_rate(system, excitation, at[0][:2], 0.1, MODES, backend="compiled")
        for _ in range(rounds):
            start = process_time()
            cra.growth_rate(system, excitation, *at, MODES, backend="compiled")
            times.append(process_time() - start)
        found[name] = min(times)
    arms = {name: found["the arm, its mass" if name.endswith("its mass") else "the arm"] for name in found}
    return {name: round(seconds / arms[name], 2) for name, seconds in found.items()}


def proofs() -> dict[str, dict[str, float]]:
    """Return how much of two charts of the arm is proved, and how many points against the growth rates."""
    arm = cra.Arm.nominal().replace(k_t=1e3)
    found = {}
    for excitation in (cra.JointStiffness(), cra.AxialBase(0.01)):
        at = chart(arm)
        start = process_time()
        proved = cra.certify_stability(arm, excitation, *at, MODES)
        seconds = process_time() - start
        grown = cra.growth_rate(arm, excitation, *at, MODES, tolerance=1e-12)
        against = ((proved == "stable") & (grown > 1e-7)) | ((proved == "unstable") & (grown == 0))
        found[repr(excitation)] = {
            "points": proved.size,
            "decided": float((proved != "undecided").mean()),
            "unstable": int((proved == "unstable").sum()),
            "against the growth rates": int(against.sum()),
            "processor s": round(seconds, 1),
        }
    return found


def timoshenko(number: int = 1000, modes: int = 5) -> dict[str, float]:
    """Return how many frequencies of random Timoshenko arms are proved."""
    rng = np.random.default_rng(SEED)
    spans = {rhoI: (-5, -2), kGA: (1.5, 4), m: (-3, 1), k: (0, 6)}
    arms = TIMOSHENKO.at({EI: 1.0, rhoA: 1.0, L: 1.0} | {s: 10 ** rng.uniform(*e, number) for s, e in spans.items()})
    frequency = cra.natural_frequencies(arms, modes)
    start = process_time()
    certificate = cra.certify(arms, modes)
    seconds = process_time() - start
    outside = np.maximum(frequency - certificate.upper, certificate.lower - frequency) / frequency
    return {
        "arms": number,
        "modes": modes,
        "proved": int(certificate.complete.sum()) * modes,
        "widest enclosure, relative": float(np.nanmax((certificate.upper - certificate.lower) / frequency)),
        "farthest solver value outside, relative": float(np.nanmax(outside)),
        "processor s": round(seconds, 1),
    }


def sensitivities(sets: int = 300, rounds: int = 15) -> dict[str, float]:
    """Return what the rates of frequencies by all parameters cost, the frequencies included, over the latter alone."""
    rng = np.random.default_rng(SEED)
    beam = rhoA * v.diff(t) ** 2 / 2 - EI * v.diff(x, 2) ** 2 / 2
    ends = {"left": -k * (v**2 + v.diff(x) ** 2) / 2, "right": m * v.diff(t) ** 2 / 2}
    held = [v.subs(x, 0), v.diff(x).subs(x, 0), psi.subs(x, 0)]
    twisted = beam + rhoI * psi.diff(t) ** 2 / 2 + d * v.diff(t) * psi.diff(t) - kGA * psi.diff(x) ** 2 / 2
    models = {
        "the arm's Lagrangian as a Model": cra.Model(beam, fields=[v], **ends, **PLACE),
        "tension": cra.Model(beam - T * v.diff(x) ** 2 / 2, fields=[v], **ends, **PLACE),
        "foundation": cra.Model(beam - c * v**2 / 2, fields=[v], **ends, **PLACE),
        "string": cra.Model(
            rhoA * v.diff(t) ** 2 / 2 - T * v.diff(x) ** 2 / 2, fields=[v], left=-k * v**2 / 2, **PLACE
        ),
        "Timoshenko": TIMOSHENKO,
        "bending and torsion": cra.Model(twisted, fields=[v, psi], essential=held, right=ends["right"], **PLACE),
    }
    spans = {
        "EI": (0, 1),
        "k": (1, 5),
        "m": (-2, 0),
        "T": (0, 2),
        "c": (0, 2),
        "rhoI": (-2, -1),
        "kGA": (2, 4),
        "d": (-3, -2),
    }
    values = {"L": 1.0, "rhoA": 1.0} | {name: 10 ** rng.uniform(*span, sets) for name, span in spans.items()}
    found = {"the arm": cra.Arm.nominal().replace(k_t=values["k"], k_r=values["k"], m_e=values["m"])}
    for name, model in models.items():
        found[name] = model.at({symbol.name: values[symbol.name] for symbol in model.symbols})

    def rates(system: cra.System) -> None:
        result = cra.sensitivities(system, MODES)
        for name in result.rate:
            result.rate[name], result.log[name]

    def seconds(function: Callable[..., Any], system: cra.System, *more: Any) -> float:
        times = []
        for _ in range(rounds + 1):
            fresh, start = system.replace(), process_time()
            function(fresh, *more)
            times.append(process_time() - start)
        return median(times[1:])

    return {
        name: round(seconds(rates, system) / seconds(cra.natural_frequencies, system, MODES), 2)
        for name, system in found.items()
    }


def main() -> dict[str, Any]:
    """Measure, write and return both."""
    summary = {
        "proved charts": proofs(),
        "proved Timoshenko arms": timoshenko(),
        "seed": SEED,
        "versions": {name: metadata.version(name) for name in ("python-flint", "numpy", "sympy")},
        "python": platform.python_version(),
    }
    Path(__file__).with_suffix(".json").write_text(json.dumps(summary, indent=1) + "\n")
    return summary


if __name__ == "__main__":
    print(json.dumps(main(), indent=1))
