"""Interface of kernels for the compiler, and what it raises."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

__all__ = ["CompileError", "Generated"]


class CompileError(ValueError):
    """What has no machine code: a construct, a function, or the type of an argument."""


class Generated(Protocol):
    """Generated source and its layout; :class:`cra_sym.kernels.Kernel` is one."""

    backend: str | None

    @property
    def digest(self) -> str:
        """The hash of source, arguments and backend."""

    @property
    def source(self) -> str:
        """The generated module text."""

    @property
    def function(self) -> Callable[..., Any]:
        """The generated function."""

    @property
    def layout(self) -> Any:
        """Structure of the outputs."""
