"""Does the suite notice every wrong operator, constant, comparison and missing statement? See ``--help``.

Each mutant runs the checks and tests that watch over its module, quickest first, in a process of its own. What became
of them goes to ``results`` (not under version control), a file a module: counts with the seed, and every survivor,
beside which the reason why it may survive can be written. One without a reason is a hole in the suite, and the exit
code says so. A run continues the one before it; ``--minutes`` bounds it and begins with what was tried least, so that
a run every night goes round the package. ``--sites`` ends when every place was changed once, the whole run makes every
change. A mutant takes some 2 s of processor time, a survivor more.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

from tests.mutation.mutants import Mutant
from tests.mutation.record import Record
from tests.mutation.runner import Laboratory, Verdict
from tests.mutation.watch import watched_modules

RESULTS = Path(__file__).with_name("results")
TURN = 5  # mutants of one module before the next has its turn


def main() -> int:
    """Run and record; return 1 if a mutant survives without a reason."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__)
    parser.add_argument("modules", nargs="*", metavar="MODULE", help="such as arm/lagrangian (all)")
    parser.add_argument("--minutes", type=float, default=float("inf"), metavar="T", help="of this run (no bound)")
    parser.add_argument("--sample", type=int, metavar="N", help="the first N of a module, in random order (all)")
    parser.add_argument("--sites", action="store_true", help="one change at every place, not every change")
    parser.add_argument("--seed", type=int, default=20261122, help="of the order (%(default)s)")
    parser.add_argument("--again", action="store_true", help="do not continue the run before: start anew")
    parser.add_argument("--holes", action="store_true", help="only survivors without a reason, again")
    parser.add_argument("--checks", action="store_true", help="only the checks of its own equations, no tests")
    parser.add_argument("--results", type=Path, default=RESULTS, metavar="DIR", help="where verdicts go")
    options = parser.parse_args()
    known = watched_modules()
    if unknown := set(options.modules) - set(known):
        parser.error(f"unknown: {', '.join(unknown)}; known are {', '.join(known)}")
    laboratory = Laboratory(tests=not options.checks)
    records = {}
    for module in options.modules or known:
        records[module] = Record(
            options.results, module, *laboratory.mutants(module), options.seed, again=options.again
        )
    _run(laboratory, records, options)
    return int(any(record.unexplained() for record in records.values()))


def _run(laboratory: Laboratory, records: dict[str, Record], options: argparse.Namespace) -> None:
    """Examine the mutants of modules in turn, those that were tried least first, until all are done or time is up."""
    end = time.monotonic() + 60.0 * options.minutes
    left = {module: _waiting(record, options) for module, record in records.items()}
    while left := {module: mutants for module, mutants in left.items() if mutants}:
        module = min(left, key=lambda name: records[name].share)
        turn, left[module] = left[module][:TURN], left[module][TURN:]
        for mutant in turn:
            if time.monotonic() > end:
                return
            verdict, by = _verdict(laboratory, module, mutant)
            if options.holes:
                records[module].close(mutant, verdict, by)
            else:
                records[module].add(mutant, verdict)


def _waiting(record: Record, options: argparse.Namespace) -> list[Mutant]:
    if options.holes:
        return record.unexplained()
    return record.drawn(record.sites if options.sites else options.sample)


def _verdict(laboratory: Laboratory, module: str, mutant: Mutant) -> tuple[Verdict, str]:
    start = _seconds()
    verdict, by = laboratory.examine(module, mutant)
    spent = _seconds() - start
    print(f"{verdict.name.lower():9} {spent:5.1f} s  {module} {mutant.function}: {mutant.after}  [{by}]", flush=True)
    return verdict, by


def _seconds() -> float:
    return time.process_time() + sum(os.times()[2:4])


if __name__ == "__main__":
    sys.exit(main())
