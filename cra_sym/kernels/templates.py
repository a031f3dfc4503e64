"""The one way in which the text of a template becomes the text of a module: marked names are replaced."""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib.resources import files

__all__ = ["template"]

_MARK = re.compile(r"__([A-Z]+(?:_[A-Z]+)*)__")


def template(module: str, marks: Mapping[str, object]) -> str:
    """Return the text of a module of the package with each ``__NAME__`` replaced by what ``NAME`` stands for.

    Parameters
    ----------
    module : str
        ``"cra_sym.room.module"``; it is read, never imported.
    marks : mapping of str to object
        What stands in the place of a mark, as text: a number, a list of arguments, statements of one line.

    Raises
    ------
    ValueError
        If the marks of the text are not those given.
    """
    room, _, name = module.rpartition(".")
    text = files(room).joinpath(f"{name}.py").read_text(encoding="utf-8")
    found = set(_MARK.findall(text))
    if found != set(marks):
        raise ValueError(f"{module} has the marks {sorted(found)}: given are {sorted(marks)}")
    return _MARK.sub(lambda match: str(marks[match[1]]), text)
