"""Writing without regret: everything is made under a temporary name beside its place, then moved there in one step."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
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
    paths = (path for path in folder.rglob("*") if path.is_symlink() or not path.is_dir())
    return (path.relative_to(folder).as_posix() for path in paths)


def _listed(target: Path) -> set[str]:
    """Return the files that an earlier run put into ``target``, as its manifest says."""
    try:
        return {*json.loads((target / _MANIFEST).read_text(encoding="utf-8"))["files"], _MANIFEST}
    except (OSError, ValueError, KeyError, TypeError):
        return set()


def _check_replaceable(target: Path, keep: bool) -> None:
    """Raise unless ``target`` is absent or a directory, of which every file was made earlier or is to be kept."""
    if not os.path.lexists(target):
        return
    if target.is_symlink() or not target.is_dir():
        raise OutputError(f"output = {str(target)!r}: is not a directory")
    made = _listed(target)
    foreign = next((name for name in _files(target) if name not in made), None)
    if foreign is not None and not keep:
        raise OutputError(
            f"output = {str(target)!r}: holds {foreign!r}, which cra_sym did not write;"
            " allowed are a new or empty directory and an earlier output"
        )


@contextmanager
def staged_directory(target: str | Path, *, keep: bool = False) -> Iterator[Path]:
    """Give a temporary sibling of ``target`` to write into; at the end of the block it becomes ``target``.

    The sibling carries a ``manifest.json`` that lists its files. An earlier output at ``target`` is replaced as a
    whole, once everything new is complete; a directory with anything else in it is refused before any work. Whatever
    ends the block early, ``target`` and the directories around it stay as they were.

    Parameters
    ----------
    target : path
        Directory to make; its parents are made too.
    keep : bool
        Whether files that no earlier output put into ``target`` are carried over instead of refused. Of two files of
        one name the new one stays.

    Raises
    ------
    OutputError
        If ``target`` cannot be written or holds files that an earlier output did not put there.
    """
    target = Path(os.path.abspath(target))
    _check_replaceable(target, keep)
    made = [folder for folder in target.parents if not folder.exists()]
    stage = target.with_name(f".{target.name}-{token_hex(4)}")
    complete = False
    try:
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            stage.mkdir()
        except OSError as error:
            raise OutputError(f"output = {str(target)!r}: cannot be written ({error.strerror or error})") from None
        yield stage
        write_text(stage / _MANIFEST, json.dumps({"files": sorted(_files(stage))}, indent=1) + "\n")
        _check_replaceable(target, keep)
        if keep:
            _carry_over(target, stage)
        _swap(stage, target)
        complete = True
    finally:
        shutil.rmtree(stage, ignore_errors=True)
        for folder in () if complete else made:
            with suppress(OSError):
                folder.rmdir()


def _carry_over(target: Path, stage: Path) -> None:
    """Copy what is in ``target``, was not made by an earlier run and is not made now."""
    earlier = _listed(target)
    for name in _files(target):
        place = stage / name
        if name in earlier or (os.path.lexists(place) and not place.is_dir()):
            continue
        try:
            if place.is_dir():
                raise IsADirectoryError("a folder of that name is made")
            place.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(target / name, place, follow_symlinks=False)
        except (OSError, shutil.Error) as error:
            raise OutputError(f"output = {str(target)!r}: {name!r} cannot be kept ({error})") from None


def _swap(stage: Path, target: Path) -> None:
    """Put ``stage`` in the place of ``target``; whatever goes wrong, ``target`` is the old one or the new."""
    old = stage.with_name(f"{stage.name}-old")
    try:
        if target.exists():
            os.rename(target, old)
        os.rename(stage, target)
    except BaseException:
        if old.exists() and not target.exists():
            os.rename(old, target)
        raise
    finally:
        if target.exists():
            shutil.rmtree(old, ignore_errors=True)
