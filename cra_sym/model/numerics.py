"""Compiled derivations from a model's Lagrangian, each made once."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any

from cra_sym.kernels.derived import derived

if TYPE_CHECKING:
    from cra_sym.model.lagrangian import Model

__all__ = ["Numerics", "derive"]


class Numerics:
    """Compiled derivations of a model, by name; see :mod:`cra_sym.model.derivations`.

    Parameters
    ----------
    model : callable
        Returns the model; it is called only if a derivation is needed.
    path : str, optional
        ``"cra_sym.room.module:function"`` that returns the model, for a model of the package itself: a derivation that
        was made before is then read from the user's cache, without SymPy.
    """

    def __init__(self, model: Callable[[], Model], path: str | None = None) -> None:
        self._model, self._path = model, path
        self._made: dict[tuple[Any, ...], Any] = {}

    def __call__(self, name: str, *arguments: Any) -> Any:
        """Return ``cra_sym.model.derivations.<name>(model, *arguments)``, derived once."""
        key = name, *arguments
        if key not in self._made:
            if self._path is None:
                self._made[key] = _derivation(name)(self._model(), *arguments)
            else:
                self._made[key] = derived("cra_sym.model.numerics:derive", self._path, name, *arguments)
        return self._made[key]


def derive(path: str, name: str, *arguments: Any) -> Any:
    """Return a derivation of the model that the function at ``path`` returns."""
    module, _, function = path.partition(":")
    return _derivation(name)(getattr(import_module(module), function)(), *arguments)


def _derivation(name: str) -> Callable[..., Any]:
    derivation: Callable[..., Any] = getattr(import_module("cra_sym.model.derivations"), name)
    return derivation
