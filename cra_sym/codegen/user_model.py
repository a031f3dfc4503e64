"""Export of a model of one's own: its characteristic function with the derivative by the angular frequency."""

from __future__ import annotations

import numpy as np
import sympy as sp

from cra_sym.codegen.languages import LANGUAGES
from cra_sym.codegen.program import Function, function, scalars
from cra_sym.codegen.rendering import common_values, rendered
from cra_sym.codegen.vectors import SEED, TOLERANCE, Check, written
from cra_sym.kernels import kernel
from cra_sym.model import Model

__all__ = ["model_texts"]

_POINTS = 40


def model_texts(name: str, model: Model) -> dict[str, str]:
    """Return the texts of a model's export, by file.

    Raises
    ------
    TypeError
        If it is not a Model.
    ValueError
        If its characteristic function has no real closed form: dampers, several wave numbers or varying coefficients.
    """
    if not isinstance(model, Model):
        raise TypeError(f"model = {model!r}: must be a Model")
    language = LANGUAGES[name]
    expressions, arguments = _characteristic(model)
    made = function(
        "evaluate",
        "The expressions, shared parts computed once.",
        expressions,
        scalars(arguments),
    )
    used = made.arguments
    text = language.function(made)
    values = common_values(language) | {
        "function": text,
        "helpers": language.helped(text),
        "parameters": [a.name for a in used],
        "nomenclature": [(a.name, "rad/s" if i == 0 else "", str(a.symbols[0])) for i, a in enumerate(used)],
        "model": repr(model).strip("<>").replace("\\", ""),  # it stands in comments and docstrings
    }
    checks = _checks(made, expressions)
    values["sample"] = [repr(x) for x in checks[0].inputs]
    texts = rendered(f"model/{name}", values) | rendered("model/common", values)
    texts["reference.txt"] = written(checks, values["model"])
    texts["LICENSE"] = values["licence"]
    return texts


def _characteristic(model: Model) -> tuple[list[sp.Expr], tuple[sp.Symbol, ...]]:
    if model.state_form.damped:
        raise ValueError(
            "a damped model has a complex characteristic function: exported code computes with real numbers"
        )
    modal = model.separate()
    waves = modal.basis.wave_numbers
    if None in waves.values() or len(waves) > 1:
        raise ValueError(
            f"wave numbers {', '.join(map(str, waves))}: with one in closed form the characteristic function is real"
            " at every frequency, and only then it can be exported"
        )
    value = modal.characteristic_function.xreplace(waves)
    return [value, sp.diff(value, modal.frequency)], (modal.frequency, *model.symbols)


def _checks(made: Function, expressions: list[sp.Expr]) -> list[Check]:
    rng = np.random.default_rng(SEED)
    evaluate = kernel(expressions, tuple(a.symbols[0] for a in made.arguments))
    checks = []
    for _ in range(_POINTS):
        inputs = [float(f"{x:.6g}") for x in rng.uniform(0.5, 2.0, len(made.arguments))]
        inputs[0] = float(f"{inputs[0] * 10 ** rng.uniform(-1, 1.3):.6g}")
        outputs = tuple(float(x) for x in evaluate(*inputs))
        if np.isfinite(outputs).all():
            checks.append(Check("characteristic", tuple(inputs), outputs, TOLERANCE * max(map(abs, outputs))))
    if not checks:
        raise ValueError("the characteristic function is not real and finite at any of the points tried")
    return checks
