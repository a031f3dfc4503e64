"""Random Lagrangians exported to C: what is built passes its self-test, or the model is refused.

The grammar is that of `tests.campaigns.lagrangians`, uniform along x and with a symbol for each number, so that the
exported functions take them as parameters; bases that move and payloads on springs are added. The self-test compares
counts, frequencies, modes, sensitivities, responses and the characteristic function with the package's numbers.
``python -m tests.campaigns.exports`` goes on where it was stopped; each trial is a line of the record.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any
from unittest.mock import patch

import sympy as sp

import cra_sym as cra
from cra_sym.codegen import model_checks
from cra_sym.codegen.user_model import model_library
from tests.campaigns.lagrangians import Grammar, t, v
from tests.campaigns.trials import parser, results
from tests.codegen import kit

RECORD = Path(__file__).with_name("exports.jsonl")
TRIALS = 100
base, payload = sp.Function("w")(t), sp.Function("q")(t)


class Uniform(Grammar):
    """Energies of constant coefficients, each a symbol."""

    def __init__(self, trial: int) -> None:
        super().__init__(trial)
        self._numbers = 0

    def number(self, low: float = 0.1, high: float = 10.0) -> sp.Expr:
        """Return the next symbol."""
        self._numbers += 1
        return sp.Symbol(f"p_{self._numbers}")

    def coefficient(self) -> sp.Expr:
        """Return a constant one."""
        return self.number()

    def inside(self) -> list[tuple[sp.Expr, sp.Expr]]:
        """Return nothing: energies between the ends are not exported."""
        return []

    def model(self) -> dict[str, Any]:
        """Return the arguments of a model, perhaps on a moving base and with a payload at the tip."""
        made = super().model()
        if self.chance(0.3):
            inertia, spring = self.number(), self.number()
            made["right"] += inertia * payload.diff(t) ** 2 / 2 - spring * (v - payload) ** 2 / 2
            made["coordinates"] = [payload]
        if self.chance(0.4):
            moved = {q.diff(t): q.diff(t) + base.diff(t) for q in (v, payload)}
            made |= {part: made[part].xreplace(moved) for part in ("density", "left", "right")}
            made["prescribed"] = [base]
        return made


def tried(trial: int, points: int = 3) -> dict[str, Any]:
    """Build and run the self-test in C; return how many lines it compared, or why the model was refused."""
    arguments = Uniform(trial).model()
    model = cra.Model(arguments.pop("density"), **arguments)
    told = {"parameters": len(model.symbols), "driven": "prescribed" in arguments}
    try:
        with patch.object(model_checks, "_POINTS", points):
            library = model_library(model, "span")
    except ValueError as error:
        return {**told, "refused": str(error)}
    with tempfile.TemporaryDirectory() as folder:
        try:
            kit.passes(library, "c", Path(folder))
        except AssertionError as error:
            return {**told, "failed": str(error)[:3000]}
    return {**told, "checks": len(library.checks)}


def main() -> None:
    """Run the trials that the record lacks."""
    options = parser(__doc__, TRIALS).parse_args()
    done = results(RECORD, options, ({"trial": trial} for trial in range(options.trials)), tried)
    refused, bad = ([line for line in done if word in line] for word in ("refused", "failed"))
    print(f"{len(done)} models: {len(refused)} refused, {len(bad)} failed")
    for line in (*bad, *refused):
        print(line)
    raise SystemExit(bool(bad))


if __name__ == "__main__":
    main()
