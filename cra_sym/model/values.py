"""Parameter values as a user gives them: by symbol or by name, numbers or arrays, checked against the model."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from sympy import Add, Expr, Symbol, sympify
from sympy.core.function import AppliedUndef

from cra_sym.checks import broadcastable, real_array, shown
from cra_sym.mechanics import HamiltonResult

__all__ = ["Values", "parameters"]


@dataclass(frozen=True)
class Values:
    """Flat arrays of all parameter sets.

    Attributes
    ----------
    symbols : tuple of Symbol
    columns : ndarray, shape (symbols, rows)
    shape : tuple of int
        Common shape of what was given; its size is the number of rows.
    """

    symbols: tuple[Symbol, ...]
    columns: np.ndarray
    shape: tuple[int, ...]

    @classmethod
    def read(cls, symbols: Iterable[Symbol], given: Mapping[Any, Any]) -> Values:
        """Match values to symbols; each error names the symbol."""
        symbols = tuple(symbols)
        if not isinstance(given, Mapping):
            raise TypeError(f"values = {shown(given)}: allowed is a mapping from symbols or their names to numbers")
        by_name = {symbol.name: symbol for symbol in symbols}
        found: dict[str, np.ndarray] = {}
        for key, value in given.items():
            name = key if isinstance(key, str) else getattr(key, "name", str(key))
            if name not in by_name:
                raise ValueError(f"values: {key} does not occur in the model; it has {', '.join(by_name) or 'none'}")
            if name in found:
                raise ValueError(f"values: {name} is given twice")
            if isinstance(value, Expr) and value.is_extended_real:
                value = float(value)
            try:
                found[name] = real_array(name, value, allow_infinite=True)
            except TypeError as error:
                raise ValueError(str(error)) from None
        missing = [name for name in by_name if name not in found]
        if missing:
            raise ValueError(f"values: no value for {', '.join(missing)}")
        shape = broadcastable(**found)
        rows = int(np.prod(shape))
        columns = np.empty((len(symbols), rows))
        for column, symbol in zip(columns, symbols, strict=True):
            column[:] = np.broadcast_to(found[symbol.name], shape).ravel()
        return cls(symbols, columns, shape)

    def patterns(self) -> list[tuple[np.ndarray, tuple[int, ...]]]:
        """Return, for each pattern of infinite values, the rows and the positions of the infinite symbols."""
        infinite = np.isinf(self.columns)
        if (self.columns == -np.inf).any():
            name = self.symbols[int(np.nonzero((self.columns == -np.inf).any(axis=1))[0][0])].name
            raise ValueError(f"{name} = -inf: allowed are real numbers, and inf for the stiffness of an end")
        kinds, where = np.unique(infinite, axis=1, return_inverse=True)
        return [
            (np.nonzero(where.ravel() == k)[0], tuple(np.nonzero(kinds[:, k])[0].tolist()))
            for k in range(kinds.shape[1])
        ]

    def take(self, rows: np.ndarray, finite: tuple[int, ...] = ()) -> np.ndarray:
        """Return the columns of some rows, with zero for the symbols whose infinity is handled elsewhere."""
        columns = self.columns[:, rows].copy()
        columns[list(finite)] = 0.0
        return columns


def parameters(given: Iterable[Expr], result: HamiltonResult) -> tuple[Symbol, ...]:
    """Return every symbol of the expressions but x and t, by name; refuse an undeclared field and two of a name."""
    expressions = [sympify(part, strict=True) for part in given]
    own = {result.x, result.t}
    known = {f.func for f in (*result.fields, *result.coordinates)}
    for term in (term for e in expressions for term in Add.make_args(e)):
        for function in term.atoms(AppliedUndef):
            if function.func not in known and own <= function.free_symbols:
                raise ValueError(f"term {term}: {function} is not one of the fields {list(map(str, result.fields))}")
    found = sorted({s for e in expressions for s in e.free_symbols} - own, key=lambda s: (s.name, str(s)))
    for first, second in itertools.pairwise(found):
        if first.name == second.name:
            raise ValueError(f"two different symbols are named {first.name}: their assumptions differ")
    return tuple(found)
