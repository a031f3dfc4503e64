"""Frequencies of any Lagrangian: beams with two wave numbers against a brentq loop, others against the paper's arm.

The beams are solved by the solver itself and by the public function of a System. The loop is that of `frequencies`:
SciPy's brentq root by root, handed brackets that hold exactly one root each, on the characteristic function of the
model that SymPy's lambdify makes of it, in complex arithmetic: a wave number is real or imaginary. Without brackets, a
user has to scan first.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any
from unittest import mock

import numpy as np
import sympy as sp
from scipy.optimize import brentq

import cra_sym as cra
from cra_sym import symbols as s
from cra_sym.kernels import compiled, has_compiler
from cra_sym.kernels.parts import in_parts
from cra_sym.kernels.plain import functions_of
from cra_sym.solvers.waves import QUICK, Functions, Search, UniformProblem, formulas, lowest_waves, template
from tests.benchmarks.machine import in_rounds, processors, summary

SEED = 20261130
LOOP, SCAN = "brentq loop", "scan and brentq loop"
PUBLIC, PUBLIC_NUMPY = "natural_frequencies", "natural_frequencies, NumPy"
ARM, ARM_AS_MODEL, STRING = "cra.Arm", "the arm's Lagrangian as a Model", "a string"
MODES, POINTS = 3, 120

x, t = sp.symbols("x t")
L, T, K, G, I, k_t, k_r, m_e = sp.symbols("L T K G I k_t k_r m_e", positive=True)
k_b, k_p = sp.symbols("k_b k_p")
v, theta = sp.Function("v")(x, t), sp.Function("theta")(x, t)
w, p = sp.Function("w")(t), sp.Function("p")(t)
KINETIC, BENDING, HALF = v.diff(t) ** 2 / 2, v.diff(x, 2) ** 2 / 2, sp.Rational(1, 2)
JOINT, TIP = -HALF * k_t * v**2, HALF * m_e * v.diff(t) ** 2


@dataclass(frozen=True)
class Family:
    """A model with EI = rhoA = L = 1, and the values of its symbols."""

    model: cra.Model
    values: dict[str, np.ndarray]


def families(size: int, seed: int = SEED) -> dict[str, Family]:
    """Return beams with random joints and tip masses, as those of `frequencies`."""
    rng = np.random.default_rng(seed)
    joints = {"k_t": 10 ** rng.uniform(-1, 6, size), "k_r": 10 ** rng.uniform(-2, 4, size)}
    joints |= {"m_e": rng.uniform(0, 1, size)}
    inertia = 10 ** rng.uniform(-4, -1.5, size)  # radius of gyration squared; shear stiffness of a solid section

    def model(density: sp.Expr, slope: sp.Expr, fields: tuple[sp.Expr, ...]) -> cra.Model:
        left = JOINT - HALF * k_r * slope**2
        return cra.Model(density, fields=fields, x=x, domain=(0, 1), t=t, left=left, right=TIP)

    thick = KINETIC + HALF * I * theta.diff(t) ** 2 - theta.diff(x) ** 2 / 2 - HALF * G * (v.diff(x) - theta) ** 2
    return {
        "tension": Family(
            model(KINETIC - BENDING - HALF * T * v.diff(x) ** 2, v.diff(x), (v,)),
            {**joints, "T": 10 ** rng.uniform(-2, 4, size)},
        ),
        "foundation with end mass": Family(
            model(KINETIC - BENDING - HALF * K * v**2, v.diff(x), (v,)),
            {**joints, "K": 10 ** rng.uniform(-2, 4, size)},
        ),
        "Timoshenko with end mass and spring": Family(
            model(thick, theta, (v, theta)), {**joints, "I": inertia, "G": 1 / (3 * inertia)}
        ),
    }


def problem(values: dict[str, np.ndarray]) -> UniformProblem:
    """Return the input of the solver: E = (v, M), O = (V, theta)."""
    size = len(values["k_t"])
    a, b = np.zeros((2, 2, size, 2, 2))
    zero = np.zeros(size)
    a[0, :, 0, 0], a[1, :, 0, 0], a[0, :, 1, 1] = values.get("K", zero), -1.0, 1.0
    b[0, :, 0, 0], b[0, :, 0, 1] = 1.0 / values["G"] if "G" in values else 0.0, 1.0
    b[0, :, 1, 0], b[0, :, 1, 1], b[1, :, 1, 1] = -1.0, values.get("T", zero), -values.get("I", zero)
    stiffness = np.stack([values["k_t"], values["k_r"], zero, zero], axis=1)
    mass = np.stack([zero, zero, values["m_e"], zero], axis=1)
    return UniformProblem(np.ones(size), a, b, stiffness, mass)


@cache
def _determinant(model: cra.Model) -> Callable[..., float]:
    """Return the model's characteristic function of omega and its symbols; its wave numbers are complex numbers."""
    modal = model.separate()
    expression = modal.characteristic_function.xreplace(modal.basis.wave_numbers)
    functions = {name: getattr(cmath, name) for name in ("sqrt", "sin", "cos", "sinh", "cosh")}
    made = sp.lambdify((modal.frequency, *model.symbols), expression, modules=[functions], cse=True)
    return lambda omega, *values: made(complex(omega), *values).real


class Case:
    """One family with every route to its frequencies."""

    def __init__(self, family: Family) -> None:
        known = family.model.numerics("route").known
        self.family, self.problem = family, replace(problem(family.values), known=known)
        omega = np.sqrt(lowest_waves(self.problem.take(slice(0, 20_000)), MODES + 1))
        middle = 0.5 * (omega[:, :-1] + omega[:, 1:])
        self.omega = omega[:, :MODES]
        self.brackets = np.column_stack([0.5 * omega[:, 0], middle[:, :-1]]), middle
        self.determinant = _determinant(family.model)

    def loop(self, number: int) -> np.ndarray:
        """Solve root by root; nan where the function has no change of sign."""
        names = [symbol.name for symbol in self.family.model.symbols]
        columns = [self.family.values[name][:number].tolist() for name in names]
        low, high = self.brackets
        result = np.full((number, MODES), np.nan)
        for i, arguments in enumerate(zip(*columns, strict=True)):
            for j in range(MODES):
                try:
                    result[i, j] = brentq(self.determinant, low[i, j], high[i, j], args=arguments, xtol=1e-14)
                except ValueError:
                    continue
        return result

    def scan(self, number: int) -> np.ndarray:
        """Solve as one has to without a count: brackets from the signs at many points, up to the last root."""
        names = [symbol.name for symbol in self.family.model.symbols]
        columns = [self.family.values[name][:number].tolist() for name in names]
        result = np.full((number, MODES), np.nan)
        for i, arguments in enumerate(zip(*columns, strict=True)):
            points = (np.linspace(0.0, math.sqrt(self.brackets[1][i, -1]), POINTS + 1)[1:] ** 2).tolist()
            signs = [self.determinant(omega, *arguments) > 0.0 for omega in points]
            changes = [j for j in range(POINTS - 1) if signs[j] != signs[j + 1]][:MODES]
            for mode, j in enumerate(changes):
                result[i, mode] = brentq(self.determinant, points[j], points[j + 1], args=arguments, xtol=1e-14)
        return result

    def ours(self, number: int) -> np.ndarray:
        """Solve by this package in NumPy."""
        return np.sqrt(lowest_waves(self.problem.take(slice(0, number)), MODES, None, self.functions))

    def compiled(self, number: int, threads: int) -> np.ndarray:
        """Solve by this package, compiled."""
        result = np.empty((number, MODES))

        def fill(part: slice) -> None:
            result[part] = np.sqrt(lowest_waves(self.problem.take(part), MODES, self.search))

        in_parts(fill, number, MODES, threads=threads, compiled=True)
        return result

    @cached_property
    def functions(self) -> Functions:
        """The formulas for NumPy, as the model of the family has them."""
        assert self.problem.known is not None
        return functions_of(formulas(self.problem.structure, self.problem.known), QUICK)

    @cached_property
    def search(self) -> Search:
        """The compiled twin for the family, as its model has it."""
        return compiled(template(self.problem.structure, self.problem.known), {}).lowest_waves  # type: ignore[no-any-return]

    def public(self, number: int) -> np.ndarray:
        """Solve as a user does."""
        system = self.family.model.at({name: values[:number] for name, values in self.family.values.items()})
        return 2 * np.pi * cra.natural_frequencies(system, MODES)

    def public_numpy(self, number: int) -> np.ndarray:
        """Solve as a user without a compiler does."""
        with mock.patch("cra_sym.model.waves.wants_compiler", return_value=False):
            return self.public(number)

    def routes(self) -> dict[str, tuple[int, Callable[[int], np.ndarray]]]:
        """Return name -> (number of sets, function of that number)."""
        size = len(self.problem.length)
        found: dict[str, tuple[int, Callable[[int], np.ndarray]]] = {
            LOOP: (min(size, 300), self.loop),
            SCAN: (min(size, 100), self.scan),
            "cra_sym, NumPy": (min(size, 20_000), self.ours),
            PUBLIC_NUMPY: (min(size, 20_000), self.public_numpy),
            PUBLIC: (size, self.public),
        }
        if has_compiler():
            for threads in sorted({1, processors()}):
                name = f"cra_sym, compiled, {threads} thread{'s' * (threads > 1)}"
                found[name] = size, lambda n, threads=threads: self.compiled(n, threads)  # type: ignore[misc]
        return found


def measured(size: int, rounds: int) -> dict[str, dict[str, Any]]:
    """Return for each family microseconds a set, ratios to the loop and the largest relative difference from it."""
    report: dict[str, dict[str, Any]] = {}
    for name, family in families(size).items():
        case = Case(family)
        routes = case.routes()
        times = in_rounds({route: (lambda f=f, n=n: f(n)) for route, (n, f) in routes.items()}, rounds)  # type: ignore[misc]
        rows: dict[str, Any] = {}
        for route, (number, _) in routes.items():
            rows[route] = {**summary([1e6 * seconds for seconds in times[route]], number), "sets": number}
        for row in rows.values():
            row["times the loop"] = rows[LOOP]["median"] / row["median"]
        for route in (PUBLIC, PUBLIC_NUMPY):
            found = case.public(len(case.omega)) if route == PUBLIC else case.public_numpy(len(case.omega))
            rows[route]["differs by"] = float(np.max(np.abs(found / case.omega - 1)))
        found = case.loop(min(size, 300))
        different = np.abs(found / case.omega[: len(found)] - 1)
        rows[LOOP]["differs by"] = float(np.nanmax(different))
        rows[LOOP]["not found"] = int(np.isnan(different).sum())
        report[name] = rows
    return report


def models(size: int, rounds: int, seed: int = SEED) -> dict[str, dict[str, float]]:
    """Return microseconds a set for the arm and for other models, with random ends.

    The arm's Lagrangian as a Model; a string; a beam that a base mass carries, with a payload on a spring; two beams
    whose ends a carriage joins.
    """
    rng = np.random.default_rng(seed)
    ends = {"k_t": 10 ** rng.uniform(-1, 6, size), "m_e": rng.uniform(0, 1, size)}
    turning = {"k_r": 10 ** rng.uniform(-2, 4, size)}
    arm = cra.Arm.nominal()
    density, left, right = cra.paper_lagrangian()
    as_model = cra.Model(density, fields=[s.v], prescribed=[s.w], x=s.x, domain=(0, s.L), t=s.t, left=left, right=right)
    numbers = {"E": arm.E, "I_z": arm.I, "rho": arm.rho, "A": arm.A, "L": arm.L, "m_b": arm.m_b, "J_e": arm.J_e}
    string = cra.Model(KINETIC - HALF * T * v.diff(x) ** 2, fields=[v], x=x, domain=(0, L), t=t, left=JOINT, right=TIP)
    lumped = {"k_b": 10 ** rng.uniform(0, 4, size), "k_p": 10 ** rng.uniform(0, 4, size), "m_e": ends["m_e"]}
    systems: dict[str, Callable[[], cra.System]] = {
        ARM: lambda: arm.replace(**ends, **turning),
        ARM_AS_MODEL: lambda: as_model.at({**numbers, **ends, **turning}),
        STRING: lambda: string.at({"T": 1.0, "L": 1.0, **ends}),
        "a beam on a base mass with a payload": lambda: carried().at({**lumped, **ends, **turning, "L": 1.0}),
        "two beams joined by a carriage": lambda: gantry().at({**lumped, "L": 1.0}),
    }
    found = cra.natural_frequencies(systems[ARM](), MODES)
    different = np.abs(cra.natural_frequencies(systems[ARM_AS_MODEL](), MODES) / found - 1)
    assert different.max() < 1e-12
    routes = {name: (lambda make=make: cra.natural_frequencies(make(), MODES)) for name, make in systems.items()}  # type: ignore[misc]
    times = in_rounds(routes, rounds)
    report = {name: summary([1e6 * seconds for seconds in times[name]], size) for name in systems}
    for row in report.values():
        row["times the arm"] = row["median"] / report[ARM]["median"]
    return report


@cache
def carried() -> cra.Model:
    """Return a beam that a base mass on a spring carries through a joint, with a payload on a spring at its tip."""
    base = HALF * w.diff(t) ** 2 - HALF * k_b * w**2 + JOINT - HALF * k_r * v.diff(x) ** 2
    tip = HALF * m_e * p.diff(t) ** 2 - HALF * k_p * (v + w - p) ** 2
    kinetic = HALF * (v + w).diff(t) ** 2
    return cra.Model(kinetic - BENDING, fields=[v], coordinates=[w, p], x=x, domain=(0, L), t=t, left=base, right=tip)


@cache
def gantry() -> cra.Model:
    """Return two clamped beams whose tips a carriage joins by springs."""
    u = sp.Function("u")(x, t)
    density = KINETIC - BENDING + HALF * u.diff(t) ** 2 - u.diff(x, 2) ** 2
    tip = HALF * m_e * p.diff(t) ** 2 - HALF * k_b * (v - p) ** 2 - HALF * k_p * (u - p) ** 2
    clamped = [part.subs(x, 0) for field in (v, u) for part in (field, field.diff(x))]
    return cra.Model(density, fields=[v, u], coordinates=[p], x=x, domain=(0, L), t=t, right=tip, essential=clamped)


def table(waves: dict[str, dict[str, Any]], others: dict[str, dict[str, float]]) -> list[str]:
    """Return both reports as lines of Markdown."""
    lines = []
    for title, rows in waves.items():
        lines += ["", f"| {title}: route | sets | µs a set | quartiles | times the loop | differs by |"]
        lines += ["| --- " + "| --: " * 5 + "|"]
        for route, row in rows.items():
            differs = f"{row['differs by']:.0e}" if "differs by" in row else ""
            lines.append(
                f"| {route} | {row['sets']} | {row['median']:.3g} | {row['low']:.3g} to {row['high']:.3g} "
                f"| {row['times the loop']:.1f} | {differs} |"
            )
    lines += ["", "| model, natural_frequencies | µs a set | quartiles | times the arm |", "| --- | --: | --: | --: |"]
    for name, other in others.items():
        low, high = other["low"], other["high"]
        lines.append(f"| {name} | {other['median']:.3g} | {low:.3g} to {high:.3g} | {other['times the arm']:.2f} |")
    return lines[1:]


def main() -> None:
    """Measure and print."""
    print("\n".join(table(measured(1_000_000, 5), models(1_000_000, 7))))


if __name__ == "__main__":
    main()
