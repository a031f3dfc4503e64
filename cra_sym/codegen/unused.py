"""Removal of unneeded lines and unused parameters from texts in the restricted form."""

from __future__ import annotations

import ast
import re

__all__ = ["marked", "top_names", "without_unused"]

_MARKS = "DRIVEN|FORCED|LOADED|TIMED|LUMPED|LINKED|COUPLED|FREE|HELD|ACCELERATED|FROZEN|ARM"
_MARKED = re.compile(rf"( *)# ((?:(?:{_MARKS}): )+)(.*)")


def marked(text: str, marks: set[str]) -> str:
    """Return a text with the lines ``# MARK: statement`` as statements if all their marks are given, else removed."""
    lines = []
    for line in text.split("\n"):
        found = _MARKED.fullmatch(line)
        if found is None:
            lines.append(line)
        elif set(found[2].split(": ")[:-1]) <= marks:
            lines.append(found[1] + found[3])
    return "\n".join(lines)


def top_names(*texts: str) -> set[str]:
    """Return the names of constants, records and functions of texts, without leading underscores."""
    found = re.findall(r"^(?:# \w+: )*(?:def |class )?_*(\w+)(?: = |\(|:$)", "\n".join(texts), re.MULTILINE)
    return set(found)


def without_unused(text: str) -> str:
    """Return the text without parameters that private functions do not use, in their heads and in calls of them.

    Each call must be on one line, with arguments without commas, as in the texts of this package.
    """
    parts = re.split(r"\n(?=def )", text)
    unused = {part: _unused(part) for part in parts}
    while found := next(filter(None, (unused[part] for part in parts)), None):
        parts = [_without(part, *found) for part in parts]
        unused |= {part: _unused(part) for part in parts if part not in unused}
    return "\n".join(parts)


def _unused(text: str) -> tuple[str, int] | None:
    """Return a private function with the position of a parameter that it does not use."""
    for node in ast.parse(text).body:
        if isinstance(node, ast.FunctionDef) and node.name.startswith("_"):
            used = {n.id for statement in node.body for n in ast.walk(statement) if isinstance(n, ast.Name)}
            for at, argument in enumerate(node.args.args):
                if argument.arg not in used:
                    return node.name, at
    return None


def _without(text: str, name: str, place: int) -> str:
    found, end = [], 0
    for match in re.finditer(rf"\b{name}\(", text):
        depth, at, start, spans = 0, match.end(), match.end(), []
        while depth >= 0:
            letter = text[at]
            depth += (letter in "([") - (letter in ")]")
            if (letter == "," and depth == 0) or depth < 0:
                spans.append((start, at))
                start = at + 1
            at += 1
        kept = [text[a:b].strip() for number, (a, b) in enumerate(spans) if number != place]
        found.append(text[end : match.end()] + ", ".join(kept))
        end = spans[-1][1]
    return "".join(found) + text[end:]
