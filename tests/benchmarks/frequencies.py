"""Frequencies of random arms: this package's routes, a brentq loop, SciPy's vectorised solver, elements, C.

The root finders of SciPy are handed brackets that hold exactly one root each, which they could not know without a
count. Slow routes solve a part of the arms; what is compared is the time of a set of frequencies.
"""

from __future__ import annotations

import math
import statistics
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import brentq, elementwise

import cra_sym as cra
from cra_sym.codegen.arm_family import arm_family
from cra_sym.kernels import has_compiler
from cra_sym.kernels.parts import in_parts
from tests.benchmarks import c_twin, elements, peers
from tests.benchmarks.machine import in_rounds, processors, summary

SEED = 20261122
LOOP, FREQUENCIES = "brentq loop", "natural_frequencies"
MODAL = (
    "omega", "participation", "root_displacement", "root_slope", "root_moment", "root_shear", "tip_displacement",
    "tip_slope",
)  # fmt: skip
SENSITIVITIES = ("df_dk_t", "df_dk_r", "log_k_t", "log_k_r")


def random_arms(size: int, seed: int = SEED, *, inert: bool = False) -> tuple[np.ndarray, ...]:
    """Stiffness over seven and six decades around the interesting range, tip masses up to the arm's own.

    The tip's rotary inertia is none, or spread over six decades up to the arm's own about its root.
    """
    rng = np.random.default_rng(seed)
    arms = 10 ** rng.uniform(-1, 6, size), 10 ** rng.uniform(-2, 4, size), rng.uniform(0, 1, size)
    return *arms, 10 ** rng.uniform(-6, 0, size) if inert else np.zeros(size)


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


def elements_for(modes: int) -> int:
    """Return a number of elements for a relative error about 1e-6; more would lose it again to rounding."""
    return 4 * modes + 12


class Case:
    """Random arms with every route to their frequencies.

    Parameters
    ----------
    size, modes : int
    folder : Path
        Where the C twin is built.
    """

    def __init__(self, size: int, modes: int, folder: Path) -> None:
        self.size, self.modes, self.groups = size, modes, random_arms(size)
        lam = arm_family().frequency_parameters(*self.groups, modes=modes + 1)
        self.lam, self.brackets = lam[:, :modes], brackets(lam)
        kappa_t, kappa_r, mu, _ = self.groups
        self.compliant = 1 / kappa_t, 1 / kappa_r, mu
        arm = cra.Arm.nominal()
        stiffness = {"k_t": kappa_t * arm.EI / arm.L**3, "k_r": kappa_r * arm.EI / arm.L}
        self.arms = arm.replace(**stiffness, m_e=mu * arm.rhoA * arm.L)
        self.twins: dict[str, tuple[c_twin.Fill, c_twin.Fill, int]] = {}
        if c_twin.has_gcc():
            self.twins = {"exported C": c_twin.build(folder), "exported C, wide": c_twin.build(folder, c_twin.WIDE)}

    def loop(self, number: int) -> np.ndarray:
        """Solve root by root."""
        low, high = self.brackets
        return np.array([
            [brentq(frequency_equation, low[i, j], high[i, j], args=arguments, xtol=1e-14) for j in range(self.modes)]
            for i, arguments in enumerate(zip(*(x[:number].tolist() for x in self.compliant), strict=True))
        ])  # fmt: skip

    def vectorised(self, number: int) -> np.ndarray:
        """Solve with SciPy's vectorised bracketing solver."""
        arguments = tuple(np.repeat(x[:number, None], self.modes, axis=1) for x in self.compliant)
        tolerances = {"xrtol": 1e-15, "xatol": 0.0, "fatol": 0.0}
        ends = self.brackets[0][:number], self.brackets[1][:number]
        call = lambda b, t, r, m: frequency_equation(b, t, r, m, np)  # noqa: E731
        return elementwise.find_root(call, ends, args=arguments, tolerances=tolerances).x

    def by_elements(self, number: int) -> np.ndarray:
        """Solve a dense eigenvalue problem for each arm."""
        rows = zip(*(x[:number].tolist() for x in self.groups[:3]), strict=True)
        return np.array([elements.parameters(*row, self.modes, elements_for(self.modes)) for row in rows])

    def ours(self, number: int, **options: Any) -> np.ndarray:
        """Solve by this package."""
        return arm_family().frequency_parameters(*(x[:number] for x in self.groups), modes=self.modes, **options)

    def in_c(self, number: int, fill: c_twin.Fill, threads: int = 1) -> np.ndarray:
        """Solve by exported C."""
        result = np.empty((number, self.modes))

        def part(lanes: slice) -> None:
            fill(result[lanes], *(x[lanes] for x in self.groups))

        in_parts(part, number, self.modes, threads=threads, compiled=True)
        return result

    def routes(self) -> dict[str, tuple[int, Callable[[int], Any]]]:
        """Return name -> (number of arms, function of that number)."""
        few, some, two = min(self.size, 300), min(self.size, 20_000), processors()
        found: dict[str, tuple[int, Callable[[int], Any]]] = {
            LOOP: (few, self.loop),
            f"dense elements, {elements_for(self.modes)} of them": (min(self.size, 100), self.by_elements),
            "scipy elementwise.find_root": (some, self.vectorised),
            "cra_sym, NumPy": (some, lambda n: self.ours(n, compile=False)),
        }
        if has_compiler():
            found["cra_sym, compiled, 1 thread"] = self.size, lambda n: self.ours(n, compile=True, threads=1)
            name = f"cra_sym, compiled, {two} threads"
            found[name] = self.size, lambda n: self.ours(n, compile=True, threads=two)
        for twin, (fill, one_by_one, _) in self.twins.items():
            for threads in (1, two):
                name = f"{twin}, {threads} thread{'s' * (threads > 1)}"
                found[name] = self.size, lambda n, fill=fill, threads=threads: self.in_c(n, fill, threads)
            if "wide" not in twin:
                found[f"{twin}, one arm after the other"] = some, lambda n, fill=one_by_one: self.in_c(n, fill)
        return found

    def quantities(self) -> dict[str, tuple[int, Callable[[int], Any]]]:
        """Return the public functions over all arms, on as many threads as they take, every array of ours looked at.

        An arm keeps its modes: each call gets a new one.
        """

        if has_compiler():
            few, family = [x[:3] for x in self.groups], arm_family()
            family.modes(*few, lam=self.lam[:3], compile=True).quantities(family.layout.left)  # makes machine code

        def modal(_: int) -> list[np.ndarray]:
            found = cra.modal_parameters(self.arms.replace(), self.modes)
            return [getattr(found, name) for name in MODAL]

        def sensitive(_: int) -> list[np.ndarray]:
            found = cra.sensitivities(self.arms.replace(), self.modes)
            return [getattr(found, name) for name in SENSITIVITIES]

        return {
            FREQUENCIES: (self.size, lambda n: cra.natural_frequencies(self.arms.replace(), self.modes)),
            "modal_parameters": (self.size, modal),
            "sensitivities": (self.size, sensitive),
        }


def measured(size: int, modes: int, rounds: int) -> dict[str, Any]:
    """Return microseconds a set, errors against our own values and ratios to the loop."""
    with tempfile.TemporaryDirectory() as folder:
        case = Case(size, modes, Path(folder))
        routes, quantities = case.routes(), case.quantities()
        errors = {
            name: float(np.max(np.abs(function(number) / case.lam[:number] - 1)))
            for name, (number, function) in routes.items()
        }
        jobs, times = routes | quantities, {}
        calls = {name: (lambda f=function, n=number: f(n)) for name, (number, function) in jobs.items()}  # type: ignore[misc]
        times |= in_rounds({name: calls[name] for name in routes}, rounds)
        times |= in_rounds({name: calls[name] for name in quantities}, 3 * rounds, 20 * size * modes)
        rows = {name: summary([1e6 * t for t in times[name]], number) for name, (number, _) in jobs.items()}
        number = min(size, 100)
        others = peers.measured(tuple(x[:number] for x in case.groups), case.lam[:number], elements_for(modes), rounds)
        widths = {name: width for name, (*_, width) in case.twins.items()}
    for name, row in rows.items():
        row["arms"] = jobs[name][0]
        if name in errors:
            row["differs by"] = errors[name]
    for name in quantities:  # measured one after the other
        pairs = zip(times[name], times[FREQUENCIES], strict=True)
        rows[name]["times the frequencies"] = statistics.median(own / alone for own, alone in pairs)
    rows |= {
        f"{name} {row['version']}, {elements_for(modes)} elements": row
        for name, row in others.items()
        if "median" in row
    }
    for row in rows.values():
        row["times the loop"] = rows[LOOP]["median"] / row["median"]
    absent = {name: row["failed"] for name, row in others.items() if "failed" in row} | peers.CANNOT
    sets = {"no rotary inertia": False, "with rotary inertia": True} if has_compiler() else {}
    evaluations = {name: evaluations_per_root(min(size, 20_000), modes, inert) for name, inert in sets.items()}
    return {"modes": modes, "rows": rows, "evaluations a root": evaluations, "C vector bits": widths, "absent": absent}


def growth(most: int) -> dict[str, dict[str, list[list[float]]]]:
    """Return, by route, (arms or modes, seconds, quartiles): more and more arms of three modes, and modes of arms."""
    paths = {"NumPy": False, "compiled, 1 thread": True} if has_compiler() else {"NumPy": False}
    numbers = [10**n for n in range(2, round(math.log10(most)) + 1)]
    many, few = random_arms(most), random_arms(300)
    found: dict[str, dict[str, list[list[float]]]] = {"arms": {}, "modes": {}}
    for name, compile in paths.items():

        def spent(groups: tuple[np.ndarray, ...], modes: int, compile: bool = compile) -> list[float]:
            solve = arm_family().frequency_parameters
            route = {"": lambda: solve(*groups, modes=modes, compile=compile, threads=1)}
            return list(summary(in_rounds(route, 3)[""]).values())

        affordable = [n for n in numbers if compile or n <= 1_000_000]
        found["arms"][name] = [[n, *spent(tuple(x[:n] for x in many), 3)] for n in affordable]
        found["modes"][name] = [[n, *spent(few, n)] for n in (1, 3, 10, 30, 100, 300, 1000)]
    return found


def evaluations_per_root(size: int, modes: int, inert: bool) -> float:
    """Return how often the determinant is evaluated for a root, counts at fixed points left out."""
    found = arm_family().fill_compiled(np.empty((size, modes)), *random_arms(size, inert=inert))
    return found / (size * modes)
