"""A Lagrangian (Model), bound to values (System): equations, spectrum, modes and compiled derivations."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cra_sym.model.galerkin import Ritz
    from cra_sym.model.lagrangian import Model
    from cra_sym.model.system import System

__all__ = ["Model", "Ritz", "System"]

_HOME = {"Model": "lagrangian", "Ritz": "galerkin", "System": "system"}


def __getattr__(name: str) -> object:  # SymPy is loaded with Model only
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"cra_sym.model.{_HOME[name]}"), name)
