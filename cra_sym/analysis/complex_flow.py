"""Nonlinear equations of complex modes, as those of oscillators whose forces depend on displacements and velocities.

With ``z' = s z + n(z)``, ``s = -c + i omega``, the displacement ``q = z + conj(z)`` of a mode and
``p = i omega (z - conj(z))`` obey ``q' = p + a(q, p) - c q`` and ``p' = -omega^2 q + b(q, p) - c p``. Elimination of p
to third order leaves ``q'' + 2 c q' + omega^2 q = F(q, q')``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.complex_shapes import shapes_and_tests
from cra_sym.analysis.eigenvalues import eigenvalues
from cra_sym.model.modal_equations import projected_terms
from cra_sym.model.system import System
from cra_sym.solvers.modal_polynomials import TensorTerm, symmetrised

__all__ = ["ComplexFlow", "complex_flow"]

Array = NDArray[np.float64]


class ComplexFlow(NamedTuple):
    """Oscillators that stand for complex modes.

    Attributes
    ----------
    s : ndarray of complex, shape (modes,)
        Eigenvalues, rad/s.
    forces : dict of int to ndarray, shape (modes, 2 modes, ..., 2 modes)
        By degree, 2 and 3: tensors of F in the displacements and then the velocities, symmetric.
    """

    s: NDArray[np.complex128]
    forces: dict[int, Array]


def complex_flow(system: System, modes: int) -> ComplexFlow:
    """Return the oscillators of the first complex modes that oscillate, with the displacement ``2 Re(phi z)`` each.

    Raises
    ------
    ValueError
        If the Lagrangian has terms of third degree with velocities, or there are not so many modes.
    """
    s = eigenvalues(system, modes)
    omega, motions = s.imag, shapes_and_tests(system, s)
    nothing, unit = np.zeros((modes, modes)), np.eye(modes)
    turn = np.block([[nothing, unit], [-np.diag(omega**2), nothing]])
    place = np.zeros((4 * modes, 2 * modes))
    place[: 2 * modes] = np.diag(np.append(np.ones(modes), 1.0 / omega))
    along = [place, place @ turn, place @ turn @ turn]
    energies, forces, *_ = projected_terms(system, motions)
    pushed = {degree: np.zeros((2 * modes,) * (degree + 1)) for degree in (2, 3)}
    for terms, of in ((energies, _of_energy), (forces, _of_force)):
        for term in terms:
            degree = term.positions + term.velocities - (terms is energies)
            if degree in pushed and not term.causes:
                pushed[degree] += symmetrised(of(term, along, modes), degree, 1)
    first, second = ({d: f[part] for d, f in pushed.items()} for part in (slice(modes), slice(modes, None)))
    a = {d: 2 * f for d, f in first.items()}
    b = {d: -2 * omega[(slice(None), *(None,) * d)] * f for d, f in second.items()}
    found = {d: b[d] + symmetrised(d * np.tensordot(a[d], turn, axes=1), d, 1) for d in a}
    both, shift = np.concatenate([a[2], b[2]]), np.concatenate([0 * a[2], a[2]])
    beyond = 2 * np.tensordot(a[2], both, axes=1) - 2 * np.tensordot(found[2], shift, axes=1)
    found[3] = found[3] + symmetrised(beyond, 3, 1)
    return ComplexFlow(s, found)


def _of_energy(term: TensorTerm, along: Sequence[Array], modes: int) -> Array:
    """Return dL/dq - d/dt dL/dv of a term on the tests, in displacements and velocities of the oscillators."""
    place, rate, second = along
    test, p, v = _tests(modes), term.positions, term.velocities
    if p + v == 3 and v:
        raise ValueError(
            "system: the Lagrangian has terms of third degree with velocities, which a slow flow of complex modes does "
            "not take; use steady_states, response_curves or backbone"
        )
    total = np.zeros((2 * modes,) * (p + v))
    if p:
        total += p * _contracted(term.tensor, [test, *[place] * (p - 1), *[rate] * v])
    if p and v:
        part = _contracted(term.tensor, [rate, *[place] * (p - 1), *[rate] * (v - 1), test])
        total -= v * p * np.moveaxis(part, -1, 0)
    if v > 1:
        part = _contracted(term.tensor, [*[place] * p, second, *[rate] * (v - 2), test])
        total -= v * (v - 1) * np.moveaxis(part, -1, 0)
    return total


def _of_force(term: TensorTerm, along: Sequence[Array], modes: int) -> Array:
    """Return a force of the virtual work on the tests."""
    return _contracted(term.tensor, [_tests(modes), *[along[0]] * term.positions, *[along[1]] * term.velocities])


def _tests(modes: int) -> Array:
    return np.eye(4 * modes)[:, 2 * modes :]


def _contracted(tensor: Array, matrices: Sequence[Array]) -> Array:
    """Return a tensor with each axis transformed by a matrix."""
    for matrix in matrices:  # the first axis goes to the end, so that all come round
        tensor = np.tensordot(tensor, matrix, axes=(0, 0))
    return tensor
