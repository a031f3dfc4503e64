"""Properties that are computed once, and locks, of which neither stops a process that is forked beside a thread."""

from __future__ import annotations

import functools
import os
from typing import Any, Protocol, Self, TypeVar, overload

__all__ = ["cached_property", "released_in_children"]

Value = TypeVar("Value")


class _Lock(Protocol):
    def acquire(self) -> bool: ...

    def release(self) -> None: ...


Held = TypeVar("Held", bound=_Lock)


class cached_property(functools.cached_property[Value]):
    """``functools.cached_property`` as Python 3.12 has it: without a lock.

    That of Python 3.11 is held for all instances while one is computed, and a child process that is forked meanwhile
    waits for it forever.
    """

    @overload
    def __get__(self, instance: None, owner: type[Any] | None = None) -> Self: ...

    @overload
    def __get__(self, instance: object, owner: type[Any] | None = None) -> Value: ...

    def __get__(self, instance: object, owner: type[Any] | None = None) -> Self | Value:
        """Return the value, computed on first use."""
        if instance is None:
            return self
        assert self.attrname is not None
        value = instance.__dict__[self.attrname] = self.func(instance)
        return value


def released_in_children(lock: Held) -> Held:
    """Return a lock that no other thread holds at a fork, so that child processes find it released."""
    if hasattr(os, "register_at_fork"):  # not on Windows
        os.register_at_fork(before=lock.acquire, after_in_parent=lock.release, after_in_child=lock.release)
    return lock
