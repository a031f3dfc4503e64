"""Bad values in every argument of every public function, of an arm and of other systems: refused by name, or done.

``python -m tests.campaigns.attacks`` tries all of them and lists what comes out that is neither.
"""

from __future__ import annotations

import argparse
import itertools
import os
import tempfile
import time
import warnings
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

import numpy as np
import sympy as sp

import cra_sym as cra
from cra_sym.symbols import k_t, m_e, t, v, w, x

TENSION, MASS, STIFF, DAMPER = sp.symbols("T mass B c")


class Quantity:
    """What a library of units hands over, with its documented attributes."""

    magnitude, units = 1.0, "kilogram ** 9"
    dimensionality: Mapping[str, int] = {"[mass]": 9}

    def to_base_units(self) -> Quantity:
        """Return the quantity in base units."""
        return self

    def unit_items(self) -> list[tuple[str, int]]:
        """Return units and their powers."""
        return [("kilogram", 9)]

    def to(self, unit: str) -> Quantity:
        """Return the quantity in a unit."""
        return self

    def __float__(self) -> float:
        return 1.0


POOL: Mapping[str, Any] = {
    "None": None, "text": "k_t", "empty text": "", "bytes": b"1", "nan": np.nan, "inf": np.inf, "-inf": -np.inf,
    "complex": 1 + 2j, "True": True, "zero": 0, "minus one": -1, "half": 0.5, "tiny": 5e-324, "huge": 1e300,
    "a huge integer": 10**400, "2**70": 2**70, "no numbers": [], "nothing in two axes": np.ones((0, 3)),
    "ragged": [1.0, [2.0]], "three": np.array([1.0, 2.0, 3.0]), "column": [[1.0], [2.0]],
    "many axes": np.ones((1,) * 33), "masked": np.ma.masked_array([1.0, 2.0], mask=[False, True]),
    "wholly masked": np.ma.masked, "objects": np.array([None, 1.0]), "truth values": [True, False],
    "symbol": sp.Symbol("a"), "expression": x + t, "nan of SymPy": sp.nan, "zoo": sp.zoo, "field": v,
    "unit": Quantity(), "date": np.datetime64("2020-01-01"), "mapping": {}, "odd mapping": {3: "x"}, "set": {1, 2},
    "class": int, "function": len, "object": object(), "ellipsis": ..., "generator": "generator",
    "pair": (1, 2), "texts": ("a", "b"), "range": range(3), "structured": np.zeros(2, [("a", float)]),
}  # fmt: skip
"""Names of bad values, and these; ``generator`` is made anew for each call."""


def _model(density: Any, **options: Any) -> cra.Model:
    return cra.Model(density, fields=[v], prescribed=[w], x=x, domain=(0, 1), t=t, **options)


@cache
def systems() -> dict[str, cra.System]:
    """Return an arm and other systems: a string, a beam with tension and a damper, and one that varies along x."""
    moving = (v + w).diff(t) ** 2 / 2
    end = {"left": -k_t * v**2 / 2, "right": m_e * moving}
    beam = {"essential": [v.subs(x, 0), v.diff(x).subs(x, 0)], "right": m_e * moving}
    wire = _model(MASS * moving - TENSION * v.diff(x) ** 2 / 2, **end)
    tight = _model(
        MASS * moving - STIFF * v.diff(x, 2) ** 2 / 2 - TENSION * v.diff(x) ** 2 / 2, **beam,
        virtual_work=[(-DAMPER * v.diff(t), v, "right")],
    )  # fmt: skip
    wedge = _model(MASS * moving - STIFF * (1 - x / 2) ** 3 * v.diff(x, 2) ** 2 / 2, **beam)
    return {
        "arm": cra.Arm.nominal().replace(k_t=1e3, k_r=50.0, zeta=0.01),
        "wire": wire.at({"T": 4.0, "mass": 1.0, "k_t": 1e3, "m_e": 0.1}, zeta=0.01),
        "tight": tight.at({"T": 4.0, "mass": 1.0, "B": 1.0, "m_e": 0.1, "c": 0.1}),
        "wedge": wedge.at({"mass": 1.0, "B": 1.0, "m_e": 0.1}, zeta=0.01),
    }


def calls(name: str) -> dict[str, dict[str, Any]]:
    """Return good arguments of each public function that takes a system."""
    system = systems()[name]
    motion, move = cra.BaseMotion(velocity=0.1), cra.BaseMotion.trapezoid(0.1, 0.2, 1.0)
    excitation = {"arm": cra.JointStiffness(k_t=1.0), "wire": cra.Fluctuation(k_t=1.0)}.get(
        name, cra.Fluctuation(T=0.5) if name == "tight" else cra.Fluctuation(B=0.5)
    )
    by = {"arm": "k_r", "wire": "T", "tight": "T", "wedge": "B"}[name]
    excited = {"system": system, "excitation": excitation, "angular_frequency": 28.0, "epsilon": 0.05, "modes": 2}
    measured = cra.natural_frequencies(system, 2)
    found: dict[str, dict[str, Any]] = {
        "natural_frequencies": {"system": system, "modes": 2},
        "mode_shapes": {"system": system, "x": 0.5, "modes": 2, "derivative": 1},
        "modal_parameters": {"system": system, "modes": 2},
        "sensitivities": {"system": system, "modes": 2, "by": (by,)},
        "response": {"system": system, "motion": motion, "t": [0.0, 0.1], "x": 0.5, "modes": 2, "derivative": 0,
                     "zeta": 0.01, "start": "base"},
        "tip_response": {"system": system, "motion": motion, "t": 0.1, "modes": 2, "derivative": 0, "zeta": 0.01,
                         "start": "inertial"},
        "residual_vibration": {"system": system, "motion": move, "modes": 2, "zeta": 0.0},
        "frequency_response": {"system": system, "angular_frequency": [5.0, 9.0], "x": 0.5},
        "state_space": {"system": system, "modes": 2, "input": "base_acceleration"},
        "identify": {"system": system, "measured": measured, "uncertainty": 0.01, "unknown": (by,), "modes": (1, 2),
                     "prior": {"mass" if name != "arm" else "E": (1.0 if name != "arm" else 6.9e10, 0.1)}},
        "growth_rate": excited,
        "floquet_exponents": excited,
        "stability_boundary": {"system": system.replace(zeta=0.0), "excitation": excitation, "epsilon": 0.01,
                               "resonance": (1, 1), "order": 1, "modes": 2},
        "sweep": {"system": system, "quantity": "natural_frequencies", "modes": 2, "chunks": None, "store": None,
                  "client": None, "m_e": [0.1, 0.2]},
        "certify": {"system": system, "modes": 1},
        "certify_eigenvalues": {"system": system, "modes": 1},
    }  # fmt: skip
    if name == "arm":
        found["residual_vibration_gradient"] = {"system": system, "motion": move, "by": ("k_r", "duration"), "modes": 2}
    if name != "arm":
        found["at"] = {"values": dict(system.values), "zeta": 0.01}
    found["replace"] = dict(system.values) | {"zeta": 0.01}
    return found


def places() -> Iterator[tuple[str, str, str]]:
    """Yield system, function and argument of every place that is attacked."""
    for name in systems():
        for function, arguments in calls(name).items():
            yield from ((name, function, argument) for argument in arguments)


def attacked(name: str, function: str, argument: str, bad: str, *, inside: bool = False) -> str | None:
    """Call with one bad value; return what came out if it is neither a result nor a refusal that names its cause."""
    value = (i for i in range(3)) if bad == "generator" else POOL[bad]
    arguments = dict(calls(name)[function])
    good = arguments[argument]
    if inside and isinstance(good, dict):
        value = dict(good) | {next(iter(good)): value}
    elif inside and isinstance(good, (list, tuple)):
        value = type(good)([*good[:-1], value])
    elif inside:
        return None
    if argument == "quantity" and callable(value):
        return None  # a function of the user's, with errors of its own
    arguments[argument] = value
    system = systems()[name]
    called = {"at": system.model.at, "replace": system.replace}.get(function) or getattr(cra, function)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", UserWarning)  # those of the package
        try:
            result = called(**arguments)
        except (TypeError, ValueError) as error:
            return _judged(str(error), argument)
        except Exception as error:
            return f"{type(error).__name__}: {error}"
    return _silent(result)


def _judged(text: str, argument: str) -> str | None:
    if "\n" in text or not 10 < len(text) < 600:
        return f"not one line: {text[:200]!r}"
    told = ("must ", "values", "shape", "modes", argument, "system", "motion", "excitation", "resonance", "units")
    foreign = (
        "operand",
        "unsupported",
        "unexpected keyword",
        "object is not",
        "cannot convert",
        "could not",
        "invalid",
    )
    if any(word in text for word in foreign) or not any(word in text for word in told):
        return f"not by name: {text!r}"
    return None


def _silent(result: Any) -> str | None:
    """Return what is wrong with a result: numbers that are none."""
    try:
        numbers = np.asarray(result)
    except Exception:
        return None
    return "a result of objects" if numbers.dtype.kind == "O" and isinstance(result, np.ndarray) else None


def attacks() -> list[tuple[str, str, str, str, bool]]:
    """Return every attack: system, function, argument, bad value, whether it is put inside a good one."""
    return [(*place, bad, inside) for place, bad, inside in itertools.product(places(), POOL, (False, True))]


def main() -> None:
    """Try all attacks, or those of a share of the time, in a seeded order."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=np.inf, help="of the processor")
    parser.add_argument("--seed", type=int, default=17)
    options = parser.parse_args()
    every = attacks()
    order = np.random.default_rng(options.seed).permutation(len(every))
    bad: dict[str, list[str]] = {}
    os.chdir(tempfile.mkdtemp())  # a text is a path where a store is asked for
    start, number = time.process_time(), 0
    for index in order:
        number += 1
        name, function, argument, value, inside = every[index]
        found = attacked(name, function, argument, value, inside=inside)
        if found:
            bad.setdefault(f"{function}({argument}): {found[:150]}", []).append(f"{name} {value}{' inside' * inside}")
        if time.process_time() - start > options.seconds:
            break
    print(f"{number} of {len(every)} attacks, {sum(map(len, bad.values()))} neither refused by name nor done")
    for what, cases in sorted(bad.items()):
        print(f"{what}\n    {len(cases)}: {'; '.join(cases[:4])}")
    raise SystemExit(bool(bad))


if __name__ == "__main__":
    main()
