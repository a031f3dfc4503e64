"""Substitution of placeholders in the text of a template."""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib.resources import files

__all__ = ["template"]

_MARK = re.compile(r"__([A-Z]+(?:_[A-Z]+)*)__")


def template(module: str, marks: Mapping[str, object]) -> str:
    """Return the text of a module of the package with each placeholder ``__NAME__`` replaced.

    Parameters
    ----------
    module : str
        ``"cra_sym.room.module"``; it is read, never imported.
    marks : mapping of str to object
        Replacement of each placeholder ``NAME``, as text: a number, a list of arguments, one-line statements.

    Raises
    ------
    ValueError
        If the placeholders of the text are not those given.
    """
    room, _, name = module.rpartition(".")
    text = files(room).joinpath(f"{name}.py").read_text(encoding="utf-8")
    found = set(_MARK.findall(text))
    if found != set(marks):
        raise ValueError(f"{module} has the marks {sorted(found)}: given are {sorted(marks)}")
    return _MARK.sub(lambda match: str(marks[match[1]]), text)
