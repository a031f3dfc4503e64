"""Private cache of generated text and machine code, which returns verified entries only.

An entry is a file of the current user in a directory of the current user, both closed to everybody else. Its first line
holds the SHA-256 of key and content. A file is read once and never imported, so the bytes
returned are the bytes verified. Anything unexpected counts as a miss.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import secrets
import stat
import sys
from pathlib import Path

__all__ = ["directory", "load", "save"]

_LARGEST = 1 << 26  # bytes, far above the size of any entry


def directory() -> Path:
    """Return the platform's cache directory of this user, which need not exist.

    Raises
    ------
    RuntimeError
        If the user has no home directory.
    """
    root: str | Path
    if sys.platform == "win32":
        root = os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local"
    elif sys.platform == "darwin":
        root = Path.home() / "Library" / "Caches"
    else:
        root = os.environ.get("XDG_CACHE_HOME", "")
        root = root if os.path.isabs(root) else Path.home() / ".cache"
    return Path(root) / "cra_sym"


def load(key: str) -> bytes | None:
    """Return the content stored under ``key``, or None if there is no verified one."""
    try:
        path = _private_directory() / _name(key)
        flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
        with open(os.open(path, flags), "rb") as file:
            status = os.fstat(file.fileno())
            if not (stat.S_ISREG(status.st_mode) and status.st_nlink == 1 and _is_private(status)):
                return None
            data = file.read(_LARGEST)
    except (OSError, RuntimeError, ValueError):
        return None
    tag, _, content = data.partition(b"\n")
    return content if secrets.compare_digest(tag, _tag(key, content)) else None


def save(key: str, content: bytes) -> bool:
    """Store ``content`` under ``key``; return whether that was possible.

    An incomplete file counts as a miss and is replaced by the next save, so a killed process leaves nothing else
    behind.
    """
    path = None
    try:
        path = _private_directory() / _name(key)
        path.unlink(missing_ok=True)
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
        with open(os.open(path, flags, 0o600), "wb") as file:
            file.write(_tag(key, content) + b"\n" + content)
    except FileExistsError:  # another process is saving it now
        return False
    except (OSError, RuntimeError, ValueError):
        if path is not None:
            with contextlib.suppress(OSError):
                path.unlink()
        return False
    return True


def _private_directory() -> Path:
    path = directory()
    with contextlib.suppress(FileExistsError):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.mkdir(mode=0o700)
    status = path.lstat()
    if not (stat.S_ISDIR(status.st_mode) and _is_private(status)):
        raise PermissionError(f"{path} is not a private directory of this user")
    return path


def _is_private(status: os.stat_result) -> bool:
    if not hasattr(os, "geteuid"):  # Windows: the local application data folder is closed by its access list
        return True
    return status.st_uid == os.geteuid() and not status.st_mode & 0o077


def _name(key: str) -> str:
    return hashlib.sha256(key.encode()).hexdigest()


def _tag(key: str, content: bytes) -> bytes:
    return hashlib.sha256(key.encode() + b"\n" + content).hexdigest().encode()
