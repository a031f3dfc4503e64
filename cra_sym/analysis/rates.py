"""Derivatives by the name of the parameter, computed on use."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from cra_sym.analysis.sensitivities import Sensitivities

__all__ = ["Rates"]

_Value = TypeVar("_Value", bound=NDArray[np.inexact[Any]])


class Rates(Mapping[str, _Value], Generic[_Value]):
    """One kind of derivatives of the frequencies or eigenvalues, by the name of the parameter; computed on use."""

    def __init__(self, found: Sensitivities, kind: str, names: Sequence[str]) -> None:
        self._found, self._kind, self._names = found, kind, tuple(names)

    def __getitem__(self, name: str) -> _Value:
        if name not in self._names:
            raise KeyError(name)
        value: _Value = getattr(self._found, f"_{self._kind}")(name)
        return value

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Rates):
            return NotImplemented
        return (self._found, self._kind, self._names) == (other._found, other._kind, other._names)

    def __hash__(self) -> int:
        return hash((self._kind, self._names))

    def __contains__(self, name: object) -> bool:
        return name in self._names  # that of Mapping would compute the value

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({dict(self)!r})"
