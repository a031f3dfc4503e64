"""Random arms in every language that this machine can run: worst relative errors beside the package's numbers.

``python -m tests.campaigns.languages`` writes them to languages.json. Every language computes its errors itself; each
is known to be below one of the bounds, which go up by factors of 2.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np

import cra_sym as cra
from cra_sym.codegen.library import Check, Library
from cra_sym.codegen.vectors import FIELDS, random_arms
from tests.codegen import kit

RECORD = Path(__file__).with_name("languages.json")
SEED = 20261130
ARMS = 10_000
THINNED = {"octave": 50}  # some hundred times slower than the others
BOUNDS = [2.0**k * 1e-16 for k in range(1, 45)]
MODAL = (
    "omega", "participation", "root_displacement", "root_slope", "root_moment", "root_shear", "tip_displacement",
    "tip_slope",
)  # fmt: skip
EVALUATE = '''
def _evaluate(quantity: int, given: Row[float, 64], found: Mut[Row[float, 256]]) -> None:
    """Return the worst error of the frequency parameters, or of the modal quantities, each beside its largest."""
    worst = 0.0
    if quantity == 0:
        row = zeros(8)
        frequency_parameters(given[0], given[1], given[2], given[3], 8, row)
        for i in range(8):
            worst = max(worst, abs(row[i] - given[4 + i]) / max(given[4 + i], 1e-30))
    else:
        arm = Arm()
        _given_arm(given, arm)
        mode = records(Mode, 4)
        modes_of(arm, 4, mode)
        for number in range(8):
            largest_one = 1e-30
            for i in range(4):
                largest_one = max(largest_one, abs(given[11 + 4 * number + i]))
            for i in range(4):
                off = abs(_modal_quantity(mode[i], number) - given[11 + 4 * number + i])
                worst = max(worst, off / largest_one)
    found[0] = worst
'''


def library(real: str) -> Library:
    """Return the arm with a self-test that computes errors."""
    made = kit.arm_without_vectors("crane", real)
    start = made.text.index("def _evaluate(")
    end = made.text.index("def _example(")
    return replace(made, text=made.text[:start] + EVALUATE.lstrip() + "\n\n" + made.text[end:], batch=("", "", ""))


def lines(arms: int) -> list[list[tuple[float, ...]]]:
    """Return what is given for both quantities."""
    drawn = random_arms(arms, SEED)
    fields = np.array([[float(getattr(arm, name)) for name in FIELDS] for arm in drawn])
    together = cra.Arm(**dict(zip(FIELDS, fields.T, strict=True)))
    groups = np.column_stack([together.kappa_t, together.kappa_r, together.mu, together.iota])
    zeros = cra.frequency_parameters(*groups.T, modes=8)
    modal = cra.modal_parameters(together, 4)
    quantities = np.stack([getattr(modal, name) for name in MODAL], axis=1).reshape(arms, -1)
    rows = np.hstack([groups, zeros]), np.hstack([fields, quantities])
    return [[tuple(row) for row in table.tolist()] for table in rows]


def passes(language: str, folder: Path, checks: list[Check], *, says_why: bool = False) -> bool:
    """Return whether a self-test passes with these lines."""
    (folder / "reference.txt").write_text("".join(f"{check.line()}\n" for check in checks))
    try:
        for command in kit.COMMANDS[language][1]:
            kit.run(command, folder)
    except AssertionError:
        if says_why:
            raise
        return False
    return True


def worst(language: str, arms: int, real: str = "float64") -> list[float]:
    """Return bounds of the worst relative errors of frequency parameters and of modal quantities."""
    made, found = library(real), []
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for file, text in made.texts(language).items():
            (folder / file).parent.mkdir(parents=True, exist_ok=True)
            (folder / file).write_text(text)
        for quantity, given in enumerate(lines(arms)):
            passes(language, folder, [Check(quantity, given[0], (0.0,), 0.0, 1.0)], says_why=True)
            kept = given[:: THINNED.get(language, 1)]
            for bound in BOUNDS:
                if passes(language, folder, [Check(quantity, row, (0.0,), 0.0, bound) for row in kept]):
                    found.append(bound)
                    break
            else:
                raise ArithmeticError(f"{language}: an error above {BOUNDS[-1]:.1g}")
    return found


def main() -> None:
    """Measure every language."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arms", type=int, default=ARMS)
    arms = parser.parse_args().arms
    kinds = [(language, "float64") for language in kit.COMMANDS] + [(x, "float32") for x in ("c", "fortran", "rust")]
    result = {}
    for language, real in kinds:
        if kit.has(language):
            frequencies, modal = worst(language, arms, real)
            result[f"{language} {real}"] = {"frequency parameters": frequencies, "modal quantities": modal}
            print(f"{language:12} {real}: {frequencies:.1e} {modal:.1e}", flush=True)
    told = {"date": str(date.today()), "arms": arms, "thinned": THINNED, "worst": result}
    RECORD.write_text(json.dumps(told, indent=1) + "\n")


if __name__ == "__main__":
    main()
