"""Rows that give the derivatives of a displacement from the state of a section, derived when they are asked for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from cra_sym.kernels import Kernel, kernel

if TYPE_CHECKING:
    from sympy import Symbol

    from cra_sym.mechanics import StateForm

__all__ = ["DerivativeRows"]

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
        self._form, self._place, self._arguments = form, place, arguments
        self._found: list[Kernel] = []
        self._further = self._derived()

    def __len__(self) -> int:
        """Return how many rows have been derived so far."""
        return len(self._found)

    def to(self, order: int) -> Sequence[Kernel]:
        """Return the rows of order 0 to ``order``, or all there are.

        Where coefficients vary along x these have derivatives between breakpoints; where they do not, order 0 alone is
        kept, since further rows follow from products with the system.
        """
        while len(self._found) <= order:
            row = next(self._further, None)
            if row is None:
                break
            self._found.append(row)
        return self._found

    def _derived(self) -> Iterator[Kernel]:
        from sympy import zeros

        from cra_sym.mechanics.breakpoints import derivative

        form = self._form
        row = zeros(1, form.system.rows)
        row[self._place] = 1
        for order in range(1 if form.uniform else 2 * len(form.displacements) + 3):
            if order:
                row = row.applyfunc(lambda entry: derivative(entry, form.x)) + row * form.system
            try:
                yield kernel(row, (form.x, *self._arguments), backend="numpy")
            except ValueError:
                if order == 0:
                    raise
                return  # the derivative of such a coefficient has no function
            if not form.uniform and sum(entry.count_ops() for entry in row) > _LONGEST:
                return
