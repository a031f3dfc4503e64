"""Rendering of the templates of a language, and the filters available in them."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import Any

__all__ = ["DIGEST", "licence", "rendered"]

#: Placeholder of the content hash until all texts are rendered.
DIGEST = "@content-hash@"


@cache
def _environment() -> Any:
    from jinja2 import Environment, StrictUndefined

    return Environment(undefined=StrictUndefined, keep_trailing_newline=True, trim_blocks=True, lstrip_blocks=True)


def rendered(folder: str, values: dict[str, Any]) -> dict[str, str]:
    """Return the texts of all templates of a folder, by the name of the file to write."""
    texts = {}
    root = files("cra_sym.codegen").joinpath("templates", folder)
    for path, text in sorted(_templates(root)):
        texts[path.removesuffix(".jinja")] = _environment().from_string(text).render(values)
    return texts


def _templates(root: Any, prefix: str = "") -> list[tuple[str, str]]:
    found = []
    for entry in root.iterdir():
        if entry.is_dir():
            found += _templates(entry, f"{prefix}{entry.name}/")
        elif entry.name.endswith(".jinja"):
            found.append((prefix + entry.name, entry.read_text(encoding="utf-8")))
    return found


def licence() -> str:
    """Return the licence of generated code."""
    return files("cra_sym.codegen").joinpath("templates", "LICENSE.txt").read_text(encoding="utf-8")
