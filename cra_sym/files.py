"""Atomic writes of files and folders: written under a temporary name next to the target, then renamed."""

from __future__ import annotations

import errno
import json
import os
import re
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from reprlib import repr as brief

try:
    import fcntl
except ImportError:  # Windows: no locks; abandoned folders are recognised by age only
    fcntl = None  # type: ignore[assignment]

__all__ = ["OutputError", "draft", "path_of", "staged_directory", "write_text", "writing"]

_MANIFEST = "manifest.json"
_MAKER = {"made by": "cra_sym"}  # marks our manifest.json among others of that name
_OLD = ".replaced"
_PATIENCE = 60.0  # seconds; locks are held briefly
_WRITERS = 2.0  # seconds; threads of a library may still write into a folder that is given up
_ABANDONED = 86_400.0  # seconds; longer than any run, where folders cannot be locked
_DISK = {getattr(errno, name, 0) for name in ("ENOSPC", "EDQUOT", "EFBIG", "EROFS", "EIO", "ENXIO", "ENODEV", "ESTALE")}


class OutputError(ValueError):
    """An output location that cannot be used; the message names it and the reason."""

    exit_code = 2


@contextmanager
def draft(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path of the same name to write a file to; at the end of the block it replaces ``path``.

    ``path`` has either its old content or all of the new; its parents are created.

    Raises
    ------
    OutputError
        If ``path`` cannot be written.
    """
    path = path_of("output", path)
    with _stage(path) as place:
        yield place
        with writing(path):
            _copy_mode(path, place)
            os.replace(place, path)


def write_text(path: str | Path, text: str) -> None:
    """Write ``text`` as UTF-8 so that ``path`` holds either its old content or all of the new.

    Raises
    ------
    OutputError
        If ``path`` cannot be written.
    """
    with draft(path) as place:
        place.write_text(text, encoding="utf-8", newline="\n")


def _files(folder: Path) -> Iterator[str]:
    def refuse(error: OSError) -> None:
        if not isinstance(error, FileNotFoundError):  # what cannot be looked into is not empty
            raise OutputError(f"output = {str(folder)!r}: {str(error.filename)!r} cannot be read ({error.strerror})")

    for place, folders, files in os.walk(folder, onerror=refuse):
        paths = (Path(place, name) for name in (*folders, *files))
        yield from (p.relative_to(folder).as_posix() for p in paths if p.name in files or p.is_symlink())


def _listed(target: Path) -> set[str]:
    """Return the files that an earlier run put into ``target``, as its manifest says."""
    path = target / _MANIFEST
    try:
        manifest = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
        return {*manifest["files"], _MANIFEST} if manifest.items() >= _MAKER.items() else set()
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return set()


def _check_replaceable(target: Path, keep: bool) -> None:
    """Raise an error unless ``target`` is absent, or a directory with only earlier outputs or files to keep."""
    if not os.path.lexists(target):
        return
    if target.is_symlink() or not target.is_dir():
        raise OutputError(f"output = {str(target)!r}: is not a directory")
    if target.is_mount():
        raise OutputError(f"output = {str(target)!r}: is a mount point, which cannot be replaced; name a folder in it")
    with suppress(OSError):
        if Path.cwd().is_relative_to(target.resolve()):
            raise OutputError(f"output = {str(target)!r}: is the working folder or holds it; name another")
    made = _listed(target)
    foreign = next((name for name in _files(target) if name not in made), None)
    if foreign is not None and not keep:
        raise OutputError(
            f"output = {str(target)!r}: holds {foreign!r}, which cra_sym did not write;"
            " must be a new or empty directory, or an earlier output"
        )


@contextmanager
def staged_directory(target: str | Path, *, keep: bool = False) -> Iterator[Path]:
    """Yield a temporary sibling of ``target`` to write into; at the end of the block it replaces ``target``.

    A ``manifest.json`` in it lists its files. An earlier output at ``target`` is replaced atomically once the new one
    is complete; a directory with any other files is refused at the start. If the block ends early, ``target`` and its
    parents are unchanged. Of several processes that write to the same target, the last one wins. Remains of a killed
    process are removed by the next one that writes there, or after a day where folders cannot be locked.

    Parameters
    ----------
    target : path
        Directory to create, with its parents.
    keep : bool
        Whether other files in ``target`` are kept instead of refused. A new file replaces an old one of the same name.

    Raises
    ------
    OutputError
        If ``target`` cannot be written or holds files that an earlier output did not put there.
    """
    target = path_of("output", target)
    with _stage(target) as folder:
        with _alone_at(target):
            _check_replaceable(target, keep)
        folder.mkdir()
        yield folder
        write_text(folder / _MANIFEST, json.dumps({**_MAKER, "files": sorted(_files(folder))}, indent=1) + "\n")
        with _alone_at(target):
            _check_replaceable(target, keep)
            if keep:
                _carry_over(target, folder)
            _swap(folder, target)


def _carry_over(target: Path, folder: Path) -> None:
    """Link or copy the files of ``target`` that are neither from an earlier run nor written now."""
    earlier = _listed(target)
    for name in _files(target):
        place = folder / name
        if name in earlier or (os.path.lexists(place) and not place.is_dir()):
            continue
        try:
            if place.is_dir():
                raise IsADirectoryError("a folder of that name is made")
            place.parent.mkdir(parents=True, exist_ok=True)
            try:
                os.link(target / name, place, follow_symlinks=False)  # a hard link, independent of size
            except (OSError, NotImplementedError):
                shutil.copy2(target / name, place, follow_symlinks=False)
        except (OSError, shutil.Error) as error:
            raise OutputError(f"output = {str(target)!r}: {name!r} cannot be kept ({error})") from None


def _swap(folder: Path, target: Path) -> None:
    """Replace ``target`` by ``folder``; the old one is removed with the stage, or restored on an error."""
    _copy_mode(target, folder)
    if target.exists():
        os.rename(target, folder.parent / _OLD)
    os.rename(folder, target)


def _copy_mode(old: Path, new: Path) -> None:
    """Copy the permissions of the old file or folder to its replacement."""
    with suppress(OSError):
        shutil.copymode(old, new)


# Stages, and locks between processes --------------------------------------------------------------------


def path_of(name: str, path: str | Path) -> Path:
    """Return an absolute path, existing or not, ~ expanded, or raise an error that names the argument."""
    try:
        made = Path(os.path.abspath(os.path.expanduser(path)))
        os.lstat(made)
    except OSError:
        pass
    except (TypeError, ValueError) as error:
        kind = TypeError if isinstance(error, TypeError) else ValueError
        raise kind(f"{name} = {brief(path)}: must be a path ({error})") from None
    return made


@contextmanager
def writing(target: Path, inside: Path | None = None) -> Iterator[None]:
    """Convert write errors of the system to an OutputError for ``target``.

    With ``inside`` only those for paths in ``target``, and those of a full or failing disk.
    """
    try:
        yield
    except OutputError as error:
        raise OutputError(str(error).replace(str(inside), str(target)) if inside else str(error)) from None
    except OSError as error:
        place, reason = error.filename, error.strerror or error
        if isinstance(error, shutil.Error):  # from copying a folder: (from, to, reason) of each file
            _, place, reason = error.args[0][0]
        if inside is None or (error.errno in _DISK if place is None else str(place).startswith(str(inside))):
            said = f"output = {str(target)!r}: cannot be written ({reason})"
            raise OutputError(said.replace(str(inside), str(target))) from None
        raise


@contextmanager
def _stage(target: Path) -> Iterator[Path]:
    """Yield a path for ``target`` in a locked temporary folder next to it, which is removed at the end.

    On an error, parents that were created for it are removed too.
    """
    made = [folder for folder in target.parents if not os.path.exists(folder)]
    stage = target.parent / f".{target.name}.cra_sym-{os.urandom(4).hex()}"
    lock, complete = None, False
    try:
        with writing(target):
            target.parent.mkdir(parents=True, exist_ok=True)
            with _alone_at(target):
                _clear_abandoned(target)
                stage.mkdir()
                lock = _locked(stage, 0.0)
        with writing(target, stage / target.name):
            yield stage / target.name
        complete = True
    finally:
        try:
            _clear(stage, target, [] if complete else made)
        except BaseException:  # interrupted by a signal: try again, as a second signal is ignored
            _clear(stage, target, [] if complete else made)
            raise
        finally:
            _unlock(lock)


def _clear(stage: Path, target: Path, made: list[Path]) -> None:
    with _alone_at(target):
        _discard(stage, target)
    for folder in made:
        with suppress(OSError):
            folder.rmdir()


@contextmanager
def _alone_at(target: Path) -> Iterator[None]:
    """Hold the lock on names next to ``target``; after a time-out go on without it."""
    lock = None
    with suppress(BlockingIOError):
        lock = _locked(target.parent, _PATIENCE)
    try:
        yield
    finally:
        _unlock(lock)


def _clear_abandoned(target: Path) -> None:
    """Remove the stages of ``target`` without a running process; an old output in one is restored."""
    pattern = re.compile(re.escape(f".{target.name}.cra_sym-") + "[0-9a-f]{8}")
    for stage in [path for path in target.parent.iterdir() if pattern.fullmatch(path.name)]:
        with suppress(BlockingIOError):  # in use
            lock = _locked(stage, 0.0)
            if lock is not None or time.time() - stage.stat().st_mtime > _ABANDONED:
                _discard(stage, target)
            _unlock(lock)


def _discard(stage: Path, target: Path) -> None:
    """Remove a stage; an old output that was not replaced is restored first."""
    with suppress(OSError):
        if (stage / _OLD).exists() and not os.path.lexists(target):
            os.rename(stage / _OLD, target)
        end = time.monotonic() + _WRITERS
        while True:
            shutil.rmtree(stage, ignore_errors=True)
            if not stage.exists() or time.monotonic() > end:
                break
            time.sleep(0.005)


def _locked(folder: Path, patience: float) -> int | None:
    """Lock a folder until it is unlocked or the process ends; return None where that is not possible.

    Raises
    ------
    BlockingIOError
        If another process still holds it after ``patience`` seconds.
    """
    if fcntl is None:
        return None
    held, end = None, time.monotonic() + patience
    try:
        held = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)  # do not block on a named pipe
        while True:
            try:
                fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
                return held
            except BlockingIOError:
                if time.monotonic() > end:
                    raise
                time.sleep(0.005)
    except BaseException as error:
        _unlock(held)
        if isinstance(error, OSError) and not isinstance(error, BlockingIOError):
            return None
        raise


def _unlock(lock: int | None) -> None:
    if lock is not None:
        os.close(lock)
