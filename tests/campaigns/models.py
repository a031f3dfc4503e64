"""Random parameters of exported models in every language: worst relative errors beside the package's numbers.

``python -m tests.campaigns.models`` writes a line for each model and language. Every language computes its errors by
itself; each is known to be below one of the bounds, which go up by factors of 2. Modal quantities are compared where
all frequencies are apart by a part in a thousand: a mode turns by rounding over the distance of its neighbour (Davis
and Kahan, SIAM J. Numer. Anal. 7, 1970), so what both sides know of it beside a close one is that much less, and of
equal ones it is any mixture. Of frequencies none is left out.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

import cra_sym as cra
from cra_sym.codegen.library import Check, Library
from cra_sym.codegen.model_checks import largest
from cra_sym.codegen.user_model import model_library, model_text
from tests import exported_models
from tests.campaigns.languages import BOUNDS, THINNED, passes
from tests.codegen import kit

RECORD = Path(__file__).with_name("models.jsonl")
TRIALS = 1000
APART = 1e-3
REFUSED = 2  # quantity of what the package refuses: the exported code has to
EVALUATE = '''
def _evaluate(quantity: int, given: Row[float, 64], found: Mut[Row[float, 256]]) -> None:
    """Return the worst error of four frequencies, or of displacements of the ends beside the largest along x."""
    parameters = Parameters()
    _given_parameters(given, parameters)
    worst = 0.0
    if quantity == 1:
        modes = records(Mode, 4)
        modes_of(parameters, 4, modes)
        for at in range(DISPLACEMENTS):
            first = PARAMETER_COUNT + 9 * at
            for i in range(4):
                left = modes[i].left_displacement[at] - given[first + i]
                right = modes[i].right_displacement[at] - given[first + 4 + i]
                worst = max(worst, max(abs(left), abs(right)) / given[first + 8])
    else:
        row = zeros(4)
        natural_frequencies(parameters, 4, row)
        for i in range(4):
            expected = given[PARAMETER_COUNT + i]
            worst = max(worst, abs(row[i] - expected) / (expected if expected > 0.0 else 1e-300))
    found[0] = worst
'''


def library(name: str) -> Library:
    """Return a model with a self-test that computes errors."""
    made = model_library(exported_models.model(name), "span")
    start, end = made.text.index("def _evaluate("), made.text.index("def _example(")
    return replace(made, text=made.text[:start] + EVALUATE.lstrip() + "\n\n" + made.text[end:])


def lines(name: str, trials: int) -> Iterator[tuple[int, tuple[float, ...]]]:
    """Yield quantity and what is given: frequencies, displacements of both ends, or what is refused."""
    model = exported_models.model(name)
    written = model_text(model)
    for number in range(trials):
        values = exported_models.drawn(name, number)
        system = model.at({s.name: value for s, value in zip(model.symbols, values, strict=True)})
        try:
            found = np.asarray(cra.natural_frequencies(system, 5))
        except ValueError:
            yield REFUSED, tuple(values)
            continue
        yield 0, (*values, *found[:4].tolist())
        if (np.diff(found) > APART * found[1:]).all():
            modes = system.modes(4)
            ends = [[modes.displacement(end, at) for end in (0, 1)] for at in written.form.order]
            sizes = largest(written, system).max(axis=1)
            rows = [[*np.ravel(end).tolist(), float(size)] for end, size in zip(ends, sizes, strict=True)]
            yield 1, (*values, *(value for row in rows for value in row))


def worst(made: Library, language: str, given: list[tuple[int, tuple[float, ...]]]) -> dict[str, object]:
    """Return bounds of the worst relative errors in a language."""
    kept = given[:: THINNED.get(language, 1)]
    found: dict[str, object] = {}
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for file, text in made.texts(language).items():
            (folder / file).parent.mkdir(parents=True, exist_ok=True)
            (folder / file).write_text(text)
        refused = [Check(0, row, (), refused=True) for quantity, row in kept if quantity == REFUSED]
        passes(language, folder, refused or [Check(0, given[0][1], (0.0,), 0.0, 1.0)], says_why=True)
        for quantity, words in enumerate(("frequencies", "displacements")):
            rows = [row for which, row in kept if which == quantity]
            below = (b for b in BOUNDS if passes(language, folder, [Check(quantity, r, (0.0,), 0.0, b) for r in rows]))
            found |= {words: next(below, None), f"{words} compared": len(rows)}
    return found | {"refused": len(refused)}


def main() -> None:
    """Run what the record lacks."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=TRIALS)
    parser.add_argument("--models", nargs="*", default=list(exported_models.NAMES))
    parser.add_argument("--languages", nargs="*", default=[one for one in kit.COMMANDS if kit.has(one)])
    parser.add_argument("--again", action="store_true", help="start anew")
    options = parser.parse_args()
    if options.again:
        RECORD.unlink(missing_ok=True)
    kept = RECORD.read_text().splitlines() if RECORD.exists() else []
    done = {(one["model"], one["language"]) for one in map(json.loads, kept)}
    for name in options.models:
        wanted = [one for one in options.languages if (name, one) not in done]
        made, given = (library(name), list(lines(name, options.trials))) if wanted else (None, [])
        for language in wanted:
            assert made is not None
            result = {"model": name, "language": language, "trials": options.trials} | worst(made, language, given)
            print(json.dumps(result), flush=True)
            with RECORD.open("a", encoding="utf-8") as file:
                file.write(json.dumps(result) + "\n")


if __name__ == "__main__":
    main()
