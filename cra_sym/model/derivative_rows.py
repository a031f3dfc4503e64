"""Rows that give the derivatives of a displacement from the state of a section, derived when they are asked for."""

from __future__ import annotations

from collections.abc import Sequence
from threading import Lock
from typing import TYPE_CHECKING

from cra_sym.cached import released_in_children
from cra_sym.kernels import Kernel, kernel

if TYPE_CHECKING:
    from sympy import Matrix, Symbol

    from cra_sym.mechanics import StateForm

__all__ = ["DerivativeRows"]

_TURN = released_in_children(Lock())  # one thread compiles rows for all
_LONGEST = 400  # operation count beyond which a further derivative of a coefficient takes too long


class DerivativeRows:
    """The rows c with ``D^order q = c (q, w, P)`` of one displacement, kernels of (x, parameter, *parameters).

    Parameters
    ----------
    form : StateForm
    place : int
        Of the displacement in a section.
    arguments : sequence of Symbol
        The parameter of the form and those of the model.
    """

    def __init__(self, form: StateForm, place: int, arguments: Sequence[Symbol]) -> None:
        from sympy import zeros

        row = zeros(1, form.system.rows)
        row[place] = 1
        self._found: list[Kernel] = []
        self._row: Matrix | None = None  # the last one, if it is to be differentiated
        if form.uniform:  # further rows follow from products with the system
            self._found.append(kernel(row, (form.x, *arguments), backend="numpy"))
            return
        self._row, self._form, self._arguments = row, form, (form.x, *arguments)

    def __len__(self) -> int:
        """Return how many rows have been compiled so far."""
        return len(self._found)

    def to(self, order: int) -> Sequence[Kernel]:
        """Return the rows of order 0 to ``order``, or all there are.

        Where coefficients vary along x these have derivatives between breakpoints; where they do not, it is one.
        """
        if len(self._found) <= order and self._row is not None:
            with _TURN:
                while len(self._found) <= order and self._row is not None:
                    self._compile_next(self._row)
        return self._found

    def _compile_next(self, row: Matrix) -> None:
        from cra_sym.mechanics.breakpoints import derivative

        form, before = self._form, len(self._found)
        if before:
            row = row.applyfunc(lambda entry: derivative(entry, form.x)) + row * form.system
        try:
            self._found.append(kernel(row, self._arguments, backend="numpy"))
        except ValueError:
            if not before:
                raise
            self._row = None  # the derivative of such a coefficient has no function
            return
        last = len(self._found) == 2 * len(form.displacements) + 3
        self._row = None if last or sum(entry.count_ops() for entry in row) > _LONGEST else row
