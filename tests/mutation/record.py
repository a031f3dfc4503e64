"""What became of the mutants of a module, in one file a module that a later run continues."""

from __future__ import annotations

import ast
import hashlib
import json
import random
from pathlib import Path
from typing import Any

from tests.mutation.mutants import Mutant
from tests.mutation.runner import Verdict

__all__ = ["Record"]

_NAMES = ("function", "before", "after")


class Record:
    """Counts of tried and caught mutants, and each survivor with the reason why it may survive.

    Mutants are tried in one shuffled order, so a longer run continues a shorter one: first one change at every site,
    then the others. The record of other code than the present starts anew, but for the reasons: those of survivors not
    tried again yet wait under ``former``.

    Parameters
    ----------
    directory : Path
        Holds ``room/name.json`` for each module.
    module : str
        As ``room/name``.
    source : str
        The module's present code.
    mutants : list of Mutant
        All of it.
    seed : int
        Of the order.
    again : bool
        Whether to start anew in any case.
    """

    def __init__(
        self, directory: Path, module: str, source: str, mutants: list[Mutant], seed: int, *, again: bool = False
    ) -> None:
        self._file = directory / f"{module}.json"
        known = json.loads(self._file.read_text(encoding="utf-8")) if self._file.exists() else {}
        explained = [s for s in (*known.get("survivors", []), *known.get("former", [])) if s["reason"]]
        self._reasons = {_change(s): s["reason"] for s in explained}
        self._order = _order(mutants, random.Random(f"{seed} {module}"))
        sites = len({mutant.path for mutant in mutants})
        fresh = {"code": _digest(source), "seed": seed, "sites": sites, "mutants": len(mutants)}
        counts = {"tried": 0, **{verdict.name.lower(): 0 for verdict in Verdict}, "survivors": []}
        same = not again and all(known.get(name) == value for name, value in fresh.items())
        anew = {**fresh, **counts, "closed": known.get("closed", []), "former": explained}
        self._data: dict[str, Any] = known if same else anew

    @property
    def sites(self) -> int:
        """How many places there are to change, each with one or two mutants."""
        return self._data["sites"]

    @property
    def share(self) -> float:
        """Which part of the module's mutants was tried."""
        return self._data["tried"] / max(1, self._data["mutants"])

    def drawn(self, sample: int | None) -> list[Mutant]:
        """Return the first mutants of the order, or all, without those that were tried before."""
        return self._order[self._data["tried"] : sample]

    def unexplained(self) -> list[Mutant]:
        """Return the survivors that have no reason yet."""
        holes = {_change(s) for s in self._data["survivors"] if not s["reason"]}
        return [mutant for mutant in self._order if mutant.change in holes]

    def add(self, mutant: Mutant, verdict: Verdict) -> None:
        """Write down what became of the next mutant of the order."""
        self._data["tried"] += 1
        self._data[verdict.name.lower()] += 1
        self._data["former"] = [s for s in self._data["former"] if _change(s) != mutant.change]
        if verdict is Verdict.SURVIVED:
            entry = dict(zip(_NAMES, mutant.change, strict=True))
            self._data["survivors"].append({**entry, "reason": self._reasons.get(mutant.change, "")})
        self._save()

    def close(self, mutant: Mutant, verdict: Verdict, by: str) -> None:
        """Write down what became of a survivor that was tried again, and which test notices it now."""
        if verdict is Verdict.SURVIVED:
            return
        self._data["survived"] -= 1
        self._data[verdict.name.lower()] += 1
        self._data["survivors"] = [s for s in self._data["survivors"] if _change(s) != mutant.change]
        self._data["closed"].append({**dict(zip(_NAMES, mutant.change, strict=True)), "by": by})
        self._save()

    def _save(self) -> None:
        if self._data["tried"] == self._data["mutants"]:
            self._data["former"] = []  # what is not there any more needs no reason
        self._file.parent.mkdir(parents=True, exist_ok=True)
        self._file.write_text(json.dumps(self._data, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def _order(mutants: list[Mutant], shuffle: random.Random) -> list[Mutant]:
    """Return the mutants shuffled, the first of every site before all others."""
    order = shuffle.sample(mutants, len(mutants))
    first = {mutant.path: mutant for mutant in reversed(order)}
    return sorted(order, key=lambda mutant: first[mutant.path] is not mutant)


def _change(entry: dict[str, str]) -> tuple[str, ...]:
    return tuple(entry[name] for name in _NAMES)


def _digest(source: str) -> str:
    """Return a hash of the code; comments, docstrings and the layout do not count."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)) and ast.get_docstring(node) is not None:
            node.body = node.body[1:] or [ast.Pass()]
    return hashlib.sha256(ast.unparse(tree).encode()).hexdigest()[:16]
