"""Run every notebook through on the versions at hand: ``python -m tests.notebooks.gate [NOTEBOOK...]``.

Nothing is stored or compared; a cell that raises, such as an assertion that does not hold, fails the gate.
"""

from __future__ import annotations

import platform
import sys
from importlib import metadata
from pathlib import Path

from cra_sym.report.notebooks import NotebookError, execute, find_notebooks

LIBRARIES = ("sympy", "numpy", "scipy", "numba", "matplotlib")


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
    sys.exit(min(main(sys.argv[1:]), 1))
