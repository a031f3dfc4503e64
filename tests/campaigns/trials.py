"""Trials of a campaign, each a line of its record: a run goes on where the one before was stopped."""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

__all__ = ["parser", "results"]


def parser(about: str | None, trials: int) -> argparse.ArgumentParser:
    """Return the options of every such campaign."""
    made = argparse.ArgumentParser(description=about)
    made.add_argument("--trials", type=int, default=trials, help="%(default)s")
    made.add_argument("--minutes", type=float, default=math.inf, help="begin no further trial after that time")
    made.add_argument("--again", action="store_true", help="start anew")
    return made


def results(
    record: Path, options: argparse.Namespace, wanted: Iterable[dict[str, Any]], tried: Callable[..., dict[str, Any]]
) -> list[dict[str, Any]]:
    """Return the lines of the record after the trials that it lacks; ``tried`` takes what ``wanted`` says of each."""
    if options.again:
        record.unlink(missing_ok=True)
    done: list[dict[str, Any]] = []
    if record.exists():
        done = [json.loads(line) for line in record.read_text(encoding="utf-8").splitlines()]
    begun = time.monotonic()
    with record.open("a", encoding="utf-8") as file:
        for one in wanted:
            if any(one.items() <= line.items() for line in done) or time.monotonic() - begun > 60 * options.minutes:
                continue
            done.append({**one, **tried(**one)})
            file.write(json.dumps(done[-1]) + "\n")
            file.flush()
    return done
