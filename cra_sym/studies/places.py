"""Locations of sweep stores: a folder, or a prefix in an object store."""

from __future__ import annotations

import os
import re
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cra_sym.extras import MissingExtraError, require
from cra_sym.files import OutputError, draft, path_of, writing

__all__ = ["AxisPlace", "Bucket", "Folder", "place_of"]

_OBJECTS = ("memory", "s3", "s3a", "gs", "gcs", "az", "abfs", "abfss", "adl", "oss")
"""Protocols of stores with atomic writes of objects."""


class AxisPlace(ABC):
    """Location of a store with atomic writes of metadata and chunks."""

    is_shared = True  # between processes

    @property
    @abstractmethod
    def name(self) -> str:
        """The location as an absolute path or a URL."""

    @abstractmethod
    def exists(self) -> bool:
        """Tell whether anything is there."""

    @abstractmethod
    def opened(self) -> Any:
        """Return the object for Zarr to open."""

    @abstractmethod
    def keys(self, array: str) -> set[str]:
        """Return the names of the stored chunks of an array."""

    @abstractmethod
    def new(self) -> AbstractContextManager[Any]:
        """Yield the object for Zarr to write a new store to."""

    @abstractmethod
    def writing(self) -> AbstractContextManager[None]:
        """Convert errors of the system to an OutputError that names the location."""


@dataclass(frozen=True)
class Folder(AxisPlace):
    """A directory of this machine."""

    path: Path

    @property
    def name(self) -> str:
        """The path."""
        return str(self.path)

    def exists(self) -> bool:
        """Tell whether anything but an empty folder is there."""
        try:
            return os.path.exists(self.path) and not (self.path.is_dir() and not any(self.path.iterdir()))
        except OSError:  # a folder that cannot be read counts as not empty
            return True

    def opened(self) -> Path:
        """Return the path."""
        return self.path

    def keys(self, array: str) -> set[str]:
        """Return the names of the stored chunks of an array."""
        files = (self.path / array).iterdir()
        return {file.name for file in files if file.stat().st_size}  # a power failure may leave empty ones

    def new(self) -> AbstractContextManager[Path]:
        """Yield a temporary folder that becomes the store at the end."""
        return draft(self.path)

    def writing(self) -> AbstractContextManager[None]:
        """Convert errors of the system to an OutputError that names the path."""
        return writing(self.path, self.path)


@dataclass(frozen=True)
class Bucket(AxisPlace):
    """A URL in an object store, through fsspec."""

    url: str

    @property
    def name(self) -> str:
        """The URL."""
        return self.url

    @property
    def is_shared(self) -> bool:  # type: ignore[override]
        """Whether other processes see it."""
        return not self.url.startswith("memory:")

    def exists(self) -> bool:
        """Tell whether anything is there."""
        files, root = self._files()
        return bool(files.exists(root))

    def opened(self) -> Any:
        """Return the store of Zarr."""
        return require("zarr.storage", "scale").FsspecStore.from_url(self.url)

    def keys(self, array: str) -> set[str]:
        """Return the names of the stored chunks of an array."""
        files, root = self._files()
        return {key.rpartition("/")[2] for key in files.find(f"{root}/{array}")}

    @contextmanager
    def new(self) -> Iterator[Any]:
        """Yield the store; one without complete metadata is refused later, not repaired."""
        with self.writing():
            yield self.opened()

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Convert errors of the object store to an OutputError that names the URL."""
        try:
            yield
        except OSError as error:
            raise OutputError(f"output = {self.url!r}: cannot be written ({error.strerror or error})") from None

    def _files(self) -> tuple[Any, str]:
        """Return the file system and the path in it."""
        found: tuple[Any, str] = require("fsspec.core", "scale").url_to_fs(self.url, use_listings_cache=False)
        return found


def place_of(store: str | Path) -> AxisPlace:
    """Return the place of a store, or raise an error that says what it must be.

    Raises
    ------
    MissingExtraError
        If the library that reaches an object store is not installed; it is named.
    TypeError, ValueError
        If it is neither a path nor the URL of an object store.
    """
    if not isinstance(store, str) or "://" not in store:
        if re.match(r"[A-Za-z][A-Za-z0-9+.-]+:/", str(store)):  # a path made from a URL has lost a slash
            raise ValueError(f"store = {str(store)!r}: must be a local path, or the URL of an object store as a text")
        return Folder(path_of("store", store))
    protocol = store.partition("://")[0]
    if protocol not in _OBJECTS:
        raise ValueError(
            f"store = {store!r}: must be a local path, or a URL of an object store ({', '.join(_OBJECTS)}), in which a "
            "region appears as a whole or not at all"
        )
    try:
        require("fsspec", "scale").get_filesystem_class(protocol)
    except MissingExtraError:
        raise
    except ImportError as error:
        raise MissingExtraError(f"store = {store!r}: a library beside fsspec is not installed ({error})") from None
    return Bucket(store.rstrip("/"))
