"""Export of a model of one's own: its characteristic function with the derivative by the angular frequency."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
import sympy as sp

from cra_sym.checks import instance
from cra_sym.codegen.frozen import stated
from cra_sym.codegen.library import Check, Library, source
from cra_sym.codegen.printers import FormPrinter
from cra_sym.codegen.program import Function, function, scalars
from cra_sym.codegen.real_forms import characteristic_pair
from cra_sym.codegen.vectors import SEED, TOLERANCE
from cra_sym.model import Model

__all__ = ["model_library"]

_POINTS = 40
_MOST = 64  # numbers in a line of the reference vectors


def model_library(model: Model, name: str) -> Library:
    """Return a model's characteristic function as a library.

    Raises
    ------
    TypeError
        If it is not a Model.
    ValueError
        If its characteristic function has no real closed form: dampers, several wave numbers or varying coefficients.
    """
    instance("model", model, Model)
    return _library(model, name)


@lru_cache(maxsize=4)
def _library(model: Model, name: str) -> Library:
    pair, plain, arguments = _characteristic(model)
    made = function(
        "characteristic",
        "Compute the characteristic function and its derivative by the first argument, both times one positive factor.",
        pair,
        scalars(arguments),
    )
    if len(made.arguments) > _MOST:
        raise ValueError(f"model: has {len(made.arguments)} parameters; at most {_MOST - 1} can be exported")
    given = ", ".join(f"given[{i}]" for i in range(len(made.arguments)))
    checks = tuple(_checks(made, pair, plain))
    sample = ", ".join(map(repr, checks[1].given))
    rest = source("characteristic_check").replace("GIVEN", given).replace("SAMPLE", sample)
    text = FormPrinter.text_of(made, "characteristic", checked=True)
    text = f"{FormPrinter.helped(text)}{text}\n\n{rest}"
    summary = f"The characteristic function of a {repr(model).strip('<>')}".replace("\\", "")
    units = ["rad/s", *[""] * len(made.arguments)]
    rows = "".join(
        f"| `{a.name}` | {unit} | {a.symbols[0]} |\n" for a, unit in zip(made.arguments, units, strict=False)
    )
    readme = (
        "The zeros of `characteristic` in its first argument are the natural angular frequencies, on both sides of a\n"
        "cut-off frequency; the factor keeps it finite. Parameters it does not depend on are left out.\n\n"
        f"| argument | unit | symbol |\n| --- | --- | --- |\n{rows}"
    )
    return Library(name, summary, text, stated(model), checks, readme)


def _characteristic(model: Model) -> tuple[list[sp.Expr], list[sp.Expr], tuple[sp.Symbol, ...]]:
    """Return the exported functions, those they were made from, and their arguments."""
    if model.state_form.damped:
        raise ValueError(
            "a damped model has a complex characteristic function: exported code computes with real numbers; "
            "give system= with the model at its values"
        )
    modal = model.separate()
    waves = modal.basis.wave_numbers
    if None in waves.values() or len(waves) > 1:
        raise ValueError(
            f"wave numbers {', '.join(map(str, waves))}: with one in closed form the characteristic function is real"
            " at every frequency, and only then it can be exported; give system= with the model at its values"
        )
    pair = characteristic_pair(modal.characteristic_function, waves, modal.frequency)
    value = modal.characteristic_function.xreplace(waves)
    return pair, [value, sp.diff(value, modal.frequency)], (modal.frequency, *model.symbols)


def _checks(made: Function, pair: list[sp.Expr], plain: list[sp.Expr]) -> Iterator[Check]:
    """Yield reference vectors of 40 digits; each is compared with the function as it was derived, and none is dropped.

    Raises
    ------
    ArithmeticError
        If one disagrees.
    """
    import mpmath

    rng = np.random.default_rng(SEED)
    names = [a.symbols[0] for a in made.arguments]
    functions = [sp.lambdify(names, e, "mpmath") for e in (*pair, *plain)]
    for number in range(_POINTS):
        inputs = [float(f"{x:.6g}") for x in rng.uniform(0.5, 2.0, len(names))]
        inputs[0] = float(f"{inputs[0] * 10 ** rng.uniform(-2, 4):.6g}") if number else 0.0
        with mpmath.workdps(40):
            value, rate = (f(*map(mpmath.mpf, inputs)) for f in functions[:2])
        with mpmath.workdps(120):  # near 0 the function as derived loses 60 digits
            beside = [mpmath.mpf(inputs[0] or 1e-15), *map(mpmath.mpf, inputs[1:])]  # as derived it is 0/0 at 0
            near, climb, whole, slope = (f(*beside) for f in functions)
            if abs(climb * whole - near * slope) > 1e-18 * (abs(climb * whole) + abs(near * slope)):
                raise ArithmeticError(f"the characteristic function in real arithmetic is wrong at {inputs}")
        outputs = float(value), float(rate)
        size = max(abs(outputs[0]), abs(outputs[1]) * max(inputs[0], 1.0))
        yield Check(0, tuple(inputs), outputs, TOLERANCE, 1e2 * TOLERANCE * size)
