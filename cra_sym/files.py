"""Writing without regret: everything is made under a temporary name beside its place, then moved there in one step."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from secrets import token_hex

__all__ = ["OutputError", "staged_directory", "write_text"]

_MANIFEST = "manifest.json"


class OutputError(ValueError):
    """An output place that cannot be used; the message names it and says why."""


def write_text(path: str | Path, text: str) -> None:
    """Write ``text`` as UTF-8 so that ``path`` holds either its old content or all of the new."""
    path = Path(path)
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}-") as folder:
        draft = Path(folder) / path.name
        draft.write_text(text, encoding="utf-8", newline="\n")
        os.replace(draft, path)


def _files(folder: Path) -> Iterator[str]:
    return (path.relative_to(folder).as_posix() for path in folder.rglob("*") if not path.is_dir())


def _check_replaceable(target: Path) -> None:
    """Raise unless ``target`` is absent, empty, or holds only what an earlier run listed in its manifest."""
    if not os.path.lexists(target):
        return
    if target.is_symlink() or not target.is_dir():
        raise OutputError(f"output = {str(target)!r}: is not a directory")
    try:
        made = {*json.loads((target / _MANIFEST).read_text(encoding="utf-8"))["files"], _MANIFEST}
    except (OSError, ValueError, KeyError, TypeError):
        made = set()
    foreign = next((name for name in _files(target) if name not in made), None)
    if foreign is not None:
        raise OutputError(
            f"output = {str(target)!r}: holds {foreign!r}, which cra_sym did not write;"
            " allowed are a new or empty directory and an earlier output"
        )


@contextmanager
def staged_directory(target: str | Path) -> Iterator[Path]:
    """Give a temporary sibling of ``target`` to write into; at the end of the block it becomes ``target``.

    The sibling carries a ``manifest.json`` that lists its files. An earlier output at ``target`` is replaced as a
    whole, once everything new is complete; a directory with anything else in it is refused before any work.

    Parameters
    ----------
    target : path
        Directory to make; its parents are made too.

    Raises
    ------
    OutputError
        If ``target`` cannot be written or holds files that an earlier output did not put there.
    """
    target = Path(os.path.abspath(target))
    _check_replaceable(target)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        stage = target.with_name(f".{target.name}-{token_hex(4)}")
        stage.mkdir()
    except OSError as error:
        raise OutputError(f"output = {str(target)!r}: cannot be written ({error.strerror or error})") from None
    try:
        yield stage
        write_text(stage / _MANIFEST, json.dumps({"files": sorted(_files(stage))}, indent=1) + "\n")
        _check_replaceable(target)
        old = stage.with_name(stage.name + "-old")
        if target.exists():
            os.rename(target, old)
        os.rename(stage, target)
        shutil.rmtree(old, ignore_errors=True)
    finally:
        shutil.rmtree(stage, ignore_errors=True)
