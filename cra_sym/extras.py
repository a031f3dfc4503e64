"""Optional libraries: imported where they are needed, with an error that names the extra to install."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

__all__ = ["MissingExtraError", "require"]


class MissingExtraError(ImportError):
    """A library of an optional extra is not installed; the message names the extra."""

    exit_code = 2


def require(module: str, extra: str) -> ModuleType:
    """Import and return ``module``, or raise an error that names the extra that installs it.

    Raises
    ------
    MissingExtraError
        If the module cannot be imported.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise MissingExtraError(
            f"{module} is not installed: it comes with the extra {extra!r}, pip install 'cra_sym[{extra}]'"
        ) from error
