"""Does the suite notice every wrong sign, exponent and constant? ``python -m tests.mutation --help``.

Each mutant runs the checks and tests that watch over its module, quickest first, in a process of its own. Verdicts go
to ``results.json`` beside this file: counts a module with the seed, and every survivor with the reason why it may
survive. One without a reason is a hole in the suite, and the exit code says so.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import sys
import time
from pathlib import Path

from tests.mutation.runner import Laboratory, Verdict
from tests.mutation.watch import watched_modules

RESULTS = Path(__file__).with_name("results.json")


def main() -> int:
    """Run and record; return 1 if a mutant survives without a reason."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__)
    parser.add_argument("modules", nargs="*", metavar="MODULE", help="such as arm/energy (all)")
    parser.add_argument("--sample", type=int, metavar="N", help="this many mutants a module, drawn at random (all)")
    parser.add_argument("--seed", type=int, default=20261122, help="of the draw (%(default)s)")
    parser.add_argument("--checks", action="store_true", help="only the equations' own checks, no other tests")
    parser.add_argument("--results", type=Path, default=RESULTS, help="where verdicts go (%(default)s)")
    options = parser.parse_args()
    known = watched_modules()
    if unknown := set(options.modules) - set(known):
        parser.error(f"unknown: {', '.join(unknown)}; known are {', '.join(known)}")
    modules = options.modules or known
    laboratory = Laboratory(tests=not options.checks)
    if not laboratory.control(modules):
        raise SystemExit("the package as it is fails its tests")
    return 1 if sum(_examine(laboratory, module, options) for module in modules) else 0


def _examine(laboratory: Laboratory, module: str, options: argparse.Namespace) -> int:
    """Examine a module's mutants, or a sample; return how many survive without a reason."""
    drawn = pool = laboratory.mutants(module)
    if options.sample is not None and options.sample < len(pool):
        drawn = random.Random(f"{options.seed} {module}").sample(pool, options.sample)
    verdicts = []
    for mutant in drawn:
        start = time.process_time() + sum(os.times()[2:4])
        verdict = laboratory.examine(module, mutant)
        verdicts.append((mutant, verdict))
        seconds = time.process_time() + sum(os.times()[2:4]) - start
        print(f"{verdict.name.lower():9} {seconds:5.1f} s  {module} {mutant.function}: {mutant.after}", flush=True)
    return record(options.results, module, len(pool), verdicts, options.seed)


def record(file: Path, module: str, mutants: int, verdicts: list, seed: int) -> int:
    """Write a module's counts and survivors; return the number of survivors that have no reason yet."""
    results = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    known = results.get(module, {}).get("survivors", [])
    reasons = {(s["function"], s["before"], s["after"]): s["reason"] for s in known}
    examined = {mutant.change for mutant, _ in verdicts}
    survivors = [s for s in known if (s["function"], s["before"], s["after"]) not in examined]
    for mutant, verdict in verdicts:
        if verdict is Verdict.SURVIVED:
            names = ("function", "before", "after")
            reason = reasons.get(mutant.change, "")
            survivors.append({**dict(zip(names, mutant.change, strict=True)), "reason": reason})
    counts = {v.name.lower(): sum(verdict is v for _, verdict in verdicts) for v in Verdict}
    results[module] = {"seed": seed, "mutants": mutants, "tried": len(verdicts), **counts, "survivors": survivors}
    file.write_text(json.dumps(results, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return sum(not s["reason"] for s in survivors)


if __name__ == "__main__":
    sys.exit(main())
