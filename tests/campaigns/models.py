"""Random parameters of six exported models: every language's frequencies against the package's.

``python -m tests.campaigns.models`` writes a line for each model and language: trials, and failures at 1e-11.
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
from cra_sym.codegen.library import Check
from cra_sym.codegen.user_model import model_library
from tests import exported_models
from tests.codegen import kit

RECORD = Path(__file__).with_name("models.jsonl")
TRIALS = 1000
TOLERANCE = 1e-11  # three wave numbers lose some digits beyond 1e-12


def checks(name: str, trials: int) -> Iterator[Check]:
    """Yield the first four frequencies of random parameters; what the package refuses must be refused."""
    model = exported_models.model(name)
    for number in range(trials):
        values = exported_models.drawn(name, number)
        system = model.at({s.name: value for s, value in zip(model.symbols, values, strict=True)})
        try:
            found = np.asarray(cra.natural_frequencies(system, 4))
        except ValueError:
            yield Check(0, (*values, 4.0), (), refused=True)
            continue
        yield Check(0, (*values, 4.0), tuple(found), TOLERANCE)


def tried(name: str, language: str, trials: int) -> dict[str, object]:
    """Run the self-test of a language on random parameters of a model."""
    made = replace(model_library(exported_models.model(name), "span"), checks=tuple(checks(name, trials)))
    with tempfile.TemporaryDirectory() as folder:
        for file, text in made.texts(language).items():
            path = Path(folder) / file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        try:
            for command in kit.COMMANDS[language][1]:
                kit.run(command, Path(folder))
        except AssertionError as error:
            return {"model": name, "language": language, "trials": trials, "failed": str(error)[-2000:]}
    return {"model": name, "language": language, "trials": trials, "failed": ""}


def main() -> None:
    """Run what the record lacks."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=TRIALS)
    parser.add_argument("--languages", nargs="*", default=[one for one in kit.COMMANDS if kit.has(one)])
    parser.add_argument("--again", action="store_true", help="start anew")
    options = parser.parse_args()
    if options.again:
        RECORD.unlink(missing_ok=True)
    lines = RECORD.read_text().splitlines() if RECORD.exists() else []
    done = {(one["model"], one["language"]) for one in map(json.loads, lines)}
    for name in exported_models.NAMES:
        for language in options.languages:
            if (name, language) not in done:
                result = tried(name, language, options.trials)
                print(json.dumps(result), flush=True)
                with RECORD.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(result) + "\n")


if __name__ == "__main__":
    main()
