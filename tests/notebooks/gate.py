"""Run every notebook through on the versions at hand: ``python -m tests.notebooks.gate [NOTEBOOK...]``.

Nothing is stored or compared; a cell that raises, such as an assertion that does not hold, fails the gate. With
``--requirements oldest`` or ``newest`` it prints what to install before, the package among it, from the ranges in
``pyproject.toml``.
"""

from __future__ import annotations

import platform
import re
import sys
import tomllib
from argparse import ArgumentParser
from importlib import metadata
from pathlib import Path

from cra_sym.report.notebooks import NotebookError, execute, find_notebooks

ROOT = Path(__file__).resolve().parents[2]
LIBRARIES = ("sympy", "numpy", "scipy", "llvmlite", "matplotlib")


def requirements(which: str) -> list[str]:
    """Return the dependencies, the oldest or the newest in their ranges; tools of notebooks and tests as they come."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    project, tools = settings["project"], settings["dependency-groups"]["test"]
    extras = project["optional-dependencies"]
    ranges = project["dependencies"]
    if which == "oldest":
        ranges = [re.sub(r">=([\d.]+)", r"==\1.*", entry, count=1) for entry in ranges]
    names = ("notebooks", "site", "certify", "scale", "explore", "control")
    wanted = (line for extra in names for line in extras[extra])
    return [*ranges, *wanted, *tools, "-e ."]


def main(names: list[str]) -> int:
    """Execute the notebooks; return how many fail."""
    print("Python", platform.python_version(), *(f"{name} {metadata.version(name)}" for name in LIBRARIES), flush=True)
    failed = 0
    for path in map(Path, names) if names else find_notebooks():
        try:
            execute(path)
        except NotebookError as error:
            failed += 1
            print(f"FAILED  {error}", flush=True)
        else:
            print(f"passed  {path.name}", flush=True)
    return failed


if __name__ == "__main__":
    parser = ArgumentParser("python -m tests.notebooks.gate", description=__doc__)
    parser.add_argument("notebooks", metavar="NOTEBOOK", nargs="*", help="by default all")
    parser.add_argument("--requirements", choices=("oldest", "newest"), help="print what to install, and run nothing")
    asked = parser.parse_args()
    if asked.requirements:
        print(*requirements(asked.requirements), sep="\n")
    else:
        sys.exit(min(main(asked.notebooks), 1))
