"""Frequencies of random arms: ours against a brentq loop and SciPy's vectorised solver, as ratios within one run.

    python tests/benchmarks/frequencies.py [arms]

The others are handed brackets that hold exactly one root each, which they could not know without a count.
"""

from __future__ import annotations

import math
import os
import statistics
import sys
import time
from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq, elementwise

import cra_sym
from cra_sym import Arm, modal_parameters, natural_frequencies
from cra_sym.arm import spectrum

MODES = 3
REPEATS = 5


def random_arms(size: int, seed: int = 0) -> tuple[np.ndarray, ...]:
    """Stiffness over seven and six decades around the interesting range, tip masses up to the arm's own."""
    rng = np.random.default_rng(seed)
    return 10 ** rng.uniform(-1, 6, size), 10 ** rng.uniform(-2, 4, size), rng.uniform(0, 1, size), np.zeros(size)


def frequency_equation(b, a_t, a_r, mu, xp=math):
    """The frequency equation as one would type it, in compliances."""
    c, s, ch, sh = xp.cos(b), xp.sin(b), xp.cosh(b), xp.sinh(b)
    p1, p2, u, v = c * ch, s * sh, c * sh + s * ch, s * ch - c * sh
    return (
        1 + p1 - (mu + a_r) * b * v - 2 * a_r * mu * b**2 * p2 - a_t * b**3 * u - 2 * a_t * mu * b**4 * p1
        + a_t * a_r * (b**4 * (1 - p1) + mu * b**5 * v)
    )  # fmt: skip


def brackets(lam: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points half-way between neighbouring roots; ``lam`` has one root more than asked for."""
    middle = (lam[:, :-1] + lam[:, 1:]) / 2
    return np.column_stack([lam[:, 0] / 2, middle[:, :-1]]), middle


def seconds(function: Callable[[], object]) -> list[float]:
    """Return the times of some runs, the first of which, with its warm-up, is thrown away."""
    times = []
    for _ in range(REPEATS + 1):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return times[1:]


def loop(low, high, a_t, a_r, mu):
    """Solve root by root."""
    return [
        [
            brentq(frequency_equation, low[i, j], high[i, j], args=(a_t[i], a_r[i], mu[i]), xtol=1e-14)
            for j in range(MODES)
        ]
        for i in range(len(low))
    ]


def measured(size: int) -> dict[str, tuple[float, float]]:
    """Return median and spread of the microseconds a set of three frequencies takes, by solver."""
    arms = random_arms(size)
    lam = spectrum.frequency_parameters(*arms, modes=MODES + 1, compile=True)
    low, high = brackets(lam)
    a_t, a_r, mu = 1 / arms[0], 1 / arms[1], arms[2]
    few, some = slice(0, max(size // 1000, 300)), slice(0, max(size // 20, 300))

    def elementwise_root(part: slice) -> np.ndarray:
        arguments = [np.repeat(x[part, None], MODES, axis=1) for x in (a_t, a_r, mu)]
        tolerances = {"xrtol": 1e-15, "xatol": 0.0, "fatol": 0.0}
        bracket = low[part], high[part]
        call = lambda b, t, r, m: frequency_equation(b, t, r, m, np)  # noqa: E731
        return elementwise.find_root(call, bracket, args=tuple(arguments), tolerances=tolerances).x

    def ours(part: slice, **options: object) -> np.ndarray:
        return spectrum.frequency_parameters(*(x[part] for x in arms), modes=MODES, **options)

    np.testing.assert_allclose(loop(low[few], high[few], a_t[few], a_r[few], mu[few]), lam[few, :MODES], rtol=1e-9)
    np.testing.assert_allclose(elementwise_root(some), lam[some, :MODES], rtol=1e-9)
    threads = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    runs: dict[str, tuple[slice, Callable[[slice], object]]] = {
        "brentq loop": (few, lambda part: loop(low[part], high[part], a_t[part], a_r[part], mu[part])),
        "scipy elementwise.find_root": (some, elementwise_root),
        "cra_sym, NumPy": (some, lambda part: ours(part, compile=False)),
        "cra_sym, compiled, 1 thread": (slice(None), lambda part: ours(part, compile=True, threads=1)),
        f"cra_sym, compiled, {threads} threads": (slice(None), lambda part: ours(part, compile=True, threads=threads)),
    }
    arm = Arm.nominal()
    mass = arm.rhoA * arm.L
    bending = arm.EI
    batch = arm.replace(k_t=arms[0] * bending / arm.L**3, k_r=arms[1] * bending / arm.L, m_e=arms[2] * mass)
    runs |= {
        "cra_sym, natural_frequencies": (slice(None), lambda part: natural_frequencies(batch)),
        "cra_sym, modal_parameters": (slice(None), lambda part: modal_parameters(batch)),
    }
    table = {}
    for name, (part, function) in runs.items():
        count = len(range(*part.indices(size)))
        times = [1e6 * t / count for t in seconds(lambda function=function, part=part: function(part))]
        table[name] = statistics.median(times), max(times) - min(times)
    return table


def evaluations_per_root(size: int, modes: int) -> float:
    """Return how often the determinant is evaluated for a root, counts at fixed points left out."""
    arms = random_arms(size)
    return spectrum._fill_compiled(np.empty((size, modes)), *arms) / (size * modes)


def main() -> None:
    """Print the table."""
    size = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    table = measured(size)
    reference = table["brentq loop"][0]
    print(f"three frequencies of {size} random arms, cra_sym {cra_sym.__version__}, numpy {np.__version__}")
    print(f"{'solver':38} {'us a set':>10} {'spread':>8} {'x loop':>8}")
    for name, (median, spread) in table.items():
        print(f"{name:38} {median:10.3f} {spread:8.3f} {reference / median:8.1f}")
    for modes in (3, 10):
        print(f"evaluations a root, {modes} modes: {evaluations_per_root(20_000, modes):.2f}")


if __name__ == "__main__":
    main()
