"""Does the suite notice every wrong sign, exponent and constant? ``python -m tests.mutation --help``.

Each mutant runs the checks and tests that watch over its module, quickest first, in a process of its own. What became
of them goes to ``results`` (not under version control), a file a module: counts with the seed, and every survivor,
beside which the reason why it may survive can be written. One without a reason is a hole in the suite, and the exit
code says so. A run continues the one before it;
``--sites`` ends when every sign, exponent and constant was changed once, the whole run changes the constants the other
way too. A mutant takes some 2 s of processor time, a survivor more.
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


def main() -> int:
    """Run and record; return 1 if a mutant survives without a reason."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__)
    parser.add_argument("modules", nargs="*", metavar="MODULE", help="such as arm/lagrangian (all)")
    parser.add_argument("--sample", type=int, metavar="N", help="the first N of a module, in random order (all)")
    parser.add_argument("--sites", action="store_true", help="one change at every site, not every change")
    parser.add_argument("--seed", type=int, default=20261122, help="of the order (%(default)s)")
    parser.add_argument("--again", action="store_true", help="do not continue the run before: start anew")
    parser.add_argument("--holes", action="store_true", help="only survivors without a reason, again")
    parser.add_argument("--checks", action="store_true", help="only the checks of its own equations, no tests")
    parser.add_argument("--results", type=Path, default=RESULTS, metavar="DIR", help="where verdicts go")
    options = parser.parse_args()
    known = watched_modules()
    if unknown := set(options.modules) - set(known):
        parser.error(f"unknown: {', '.join(unknown)}; known are {', '.join(known)}")
    modules = options.modules or known
    laboratory = Laboratory(tests=not options.checks)
    return 1 if sum(_examine(laboratory, module, options) for module in modules) else 0


def _examine(laboratory: Laboratory, module: str, options: argparse.Namespace) -> int:
    """Examine a module's mutants, or some; return how many survive without a reason."""
    source, mutants = laboratory.mutants(module)
    record = Record(options.results, module, source, mutants, options.seed, again=options.again)
    if options.holes:
        for mutant in record.unexplained():
            record.close(mutant, *_verdict(laboratory, module, mutant))
    else:
        for mutant in record.drawn(record.sites if options.sites else options.sample):
            record.add(mutant, _verdict(laboratory, module, mutant)[0])
    return len(record.unexplained())


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
