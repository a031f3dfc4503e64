"""Numerical data of elastic-slip elements: their displacements in the modes, and static correction of omitted modes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cra_sym.model.hysteresis import Jenkins
from cra_sym.model.projection import Displacement, Load, project
from cra_sym.model.spatial import SpatialProblem
from cra_sym.model.values import flat_columns
from cra_sym.solvers.driven import driven_states
from cra_sym.solvers.remainder import moments, nodes

if TYPE_CHECKING:
    from cra_sym.model.slip_terms import SlipTerms
    from cra_sym.model.system import System

__all__ = ["SlipElements", "slip_elements", "slip_statics", "slip_terms_of"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SlipElements:
    r"""Jenkins elements on the displacements of a system, projected on its modes without the elements.

    The displacements are :math:`u = B q - R F`, with the modal coordinates q, the forces F of the elements on each
    displacement, and the static flexibility R of the omitted modes; the modal forces are :math:`-B^T F`.

    Attributes
    ----------
    stiffness, slip : ndarray, shape (..., elements)
        One entry for each Jenkins element, several for an Iwan element.
    where : ndarray of int, shape (elements,)
        Index of the displacement on which each acts.
    displacements : ndarray, shape (..., displacements, modes)
        B, of mass-normalised modes.
    flexibility : ndarray, shape (..., displacements, displacements)
        R, m/N.
    """

    stiffness: Array
    slip: Array
    where: NDArray[np.intp]
    displacements: Array
    flexibility: Array

    @property
    def rows(self) -> Array:
        """The displacement of every element in every mode, shape (..., elements, modes)."""
        return np.asarray(self.displacements[..., self.where, :])

    @property
    def total(self) -> Array:
        """Stiffness of all elements on each displacement, shape (..., displacements)."""
        number = self.displacements.shape[-2]
        return np.stack([self.stiffness[..., self.where == k].sum(axis=-1) for k in range(number)], axis=-1)

    def absorbed(self) -> SlipElements:
        """Return equivalent elements on B q that include the diagonal of the flexibility as springs in series.

        On first loading the force is piecewise linear in the displacement. In series with a spring it still is, and so
        it is that of other Jenkins elements with the same total slip force. Only the off-diagonal flexibility remains.
        """
        own = np.diagonal(self.flexibility, axis1=-2, axis2=-1)
        stiffness, slip = (np.array(np.broadcast_to(part, self._shape)) for part in (self.stiffness, self.slip))
        for k in range(own.shape[-1]):
            members = np.flatnonzero(self.where == k)
            order = np.argsort((slip / stiffness)[..., members], axis=-1, kind="stable")
            springs = np.take_along_axis(stiffness[..., members], order, axis=-1)
            sliders = np.take_along_axis(slip[..., members], order, axis=-1)
            left = np.flip(np.cumsum(np.flip(springs, -1), axis=-1), -1)  # stiffness while this one still sticks
            after = np.concatenate([left[..., 1:], np.zeros_like(left[..., :1])], axis=-1)
            places = sliders / springs
            forces = np.cumsum(sliders, axis=-1) + places * after
            flexibility = own[..., k, None]
            before, behind = (part / (1.0 + flexibility * part) for part in (left, after))
            new = before - behind
            np.put_along_axis(stiffness, members[order], new, axis=-1)
            np.put_along_axis(slip, members[order], new * (places + flexibility * forces), axis=-1)
        rest = self.flexibility * (1.0 - np.eye(own.shape[-1]))
        return SlipElements(stiffness, slip, self.where, self.displacements, rest)

    @property
    def _shape(self) -> tuple[int, ...]:
        return (*np.broadcast_shapes(self.stiffness.shape[:-1], self.flexibility.shape[:-2]), self.where.size)


def slip_elements(system: System, modes: int) -> SlipElements:
    """Return the elements of a system, see :meth:`cra_sym.model.system.System.slip_elements`."""
    if not system.model.pieces["hysteresis"]:
        raise ValueError("system: has no elastic-slip elements; give its model hysteresis=[..]")
    terms = slip_terms_of(system)
    stiffness, slip, where = [], [], []
    for element, displacement in zip(terms.at(system.parameters), terms.displacements, strict=True):
        single = isinstance(element, Jenkins)
        found = element.elements(1 if single else element.number)  # type: ignore[attr-defined]
        stiffness.append(np.broadcast_to(found[0], (*system.shape, found[0].shape[-1])))
        slip.append(np.broadcast_to(found[1], (*system.shape, found[1].shape[-1])))
        where += [displacement] * found[0].shape[-1]
    rows, flexibility = _projected(system, terms, modes)
    return SlipElements(
        np.concatenate(stiffness, axis=-1), np.concatenate(slip, axis=-1), np.array(where), rows, flexibility
    )


def _projected(system: System, terms: SlipTerms, modes: int) -> tuple[Array, Array]:
    """Return the displacements in the modes, and the flexibility of the omitted modes."""
    forced, base = _forced(system, terms), system.without_hysteresis
    loads = [forced.numerics("load", name) for name in terms.forces]
    rows = _rows(base, forced, loads, modes, system.shape)
    for k in range(len(loads)):
        if (np.abs(rows[..., k, :]).max(axis=-1) == 0.0).any():
            _, displacement, place = system.model.pieces["hysteresis"][terms.displacements.index(k)]
            raise ValueError(f"hysteresis: {displacement} at {place} is held, so nothing can slip there")
    return rows, _static_remainder(base, forced, loads, terms.forces, modes, system.shape)


def slip_terms_of(system: System) -> SlipTerms:
    """Return the elements of the system's model, compiled."""
    from cra_sym.model.slip_terms import slip_terms  # SymPy is there: a model with elements was made

    return slip_terms(system.model)


def slip_statics(system: System, modes: int, causes: tuple[str, ...], watched: Load) -> Array:
    """Return the static contribution of the omitted modes to the displacements of the elements and to the output.

    Parameters
    ----------
    system : System
    modes : int
    causes : tuple of str
        Prescribed motions, by one unit of their acceleration, and forces.
    watched : Load
        Unit force on the displacement that is the output.

    Returns
    -------
    ndarray, shape (..., displacements + 1, displacements + causes)
        Displacements of the elements, then the output, per unit of force on the former and of each cause.
    """
    terms = slip_terms_of(system)
    forced = _forced(system, terms)
    outputs = [*(forced.numerics("load", name) for name in terms.forces), watched]
    return _static_remainder(system.without_hysteresis, forced, outputs, (*terms.forces, *causes), modes, system.shape)


def _forced(system: System, terms: SlipTerms) -> System:
    values = {symbol.name: system.values[symbol.name] for symbol in terms.forced.symbols}
    return terms.forced.at(values, tolerance=system.tolerance)


def _rows(base: System, forced: System, loads: list[Load], modes: int, shape: tuple[int, ...]) -> Array:
    """Return the modal forces of loads, shape (..., loads, modes)."""
    own = base.modes(modes)
    found = [np.broadcast_to(project(forced.domain, own, load), (*shape, modes)) for load in loads]
    return np.stack(found, axis=-2)


def _static_remainder(
    base: System, forced: System, outputs: list[Load], names: tuple[str, ...], modes: int, shape: tuple[int, ...]
) -> Array:
    """Return static displacements due to unit loads minus those of the first modes, shape (..., outputs, loads)."""
    most = base.most_modes
    number = most if not forced.numerics("sizes")[0] else min(modes + 1, most)
    of = _rows(base, forced, outputs, number, shape)
    by = _rows(base, forced, [forced.numerics("load", name) for name in names], number, shape)
    omega = np.broadcast_to(base.natural_frequencies(number), (*shape, number))
    if number == most:  # all modes are included
        compliance = np.where(omega > 0, 1.0 / np.where(omega > 0, omega, 1.0) ** 2, 0.0)[..., None, modes:]
        return np.asarray((of[..., modes:] * compliance) @ by[..., modes:].swapaxes(-1, -2))
    squares = omega.reshape(-1, number) ** 2
    flat = [part.reshape(len(squares), -1, number)[..., :modes] for part in (of, by)]
    products = np.einsum("rkm,rlm->rmkl", *flat)
    limit = squares[:, -1]
    receptance = _receptance(forced, names, outputs, nodes(limit))
    static, _ = moments(receptance, squares[:, :-1], products, limit)
    return np.asarray(static.reshape(*shape, len(outputs), len(names)))


def _receptance(forced: System, names: tuple[str, ...], loads: list[Load], z: Array) -> Array:
    """Return displacements by unit loads at omega^2 = z, shape (rows, nodes, of, by)."""
    columns = flat_columns(forced.parameters, forced.shape)
    columns = np.broadcast_to(columns, (len(columns), len(z)))
    found = np.zeros((*z.shape, len(loads), len(names)))
    for by, name in enumerate(names):
        problem: SpatialProblem = forced.numerics("driven", name)
        driven = problem.displacements + forced.numerics("driven_coordinate", name)
        for rows, left, some in problem.problems(columns):
            row = np.repeat(np.arange(len(rows)), z.shape[1])
            for of, load in enumerate(loads):
                values = columns[:, rows]
                factors = load.force.function(*values)
                for place, factor in zip(load.ends, factors, strict=True):
                    at, entry = _station(problem, load, place, left, some.length, values)
                    share = some.shares(at, left)
                    state = driven_states(some, z[rows].ravel(), row, share[row], driven, "motion")[:, 0, entry]
                    weight = np.broadcast_to(factor, len(rows))[:, None]
                    found[rows, :, of, by] += weight * state.reshape(len(rows), -1).real
    return found


def _station(
    problem: SpatialProblem, load: Load, place: Displacement, left: Array, length: Array, values: Array
) -> tuple[Array, int]:
    """Return the station of a displacement, shape (rows, 1), and its index in the state of a section there."""
    if place.where == "lumped":
        return left[:, None], problem.displacements + place.entry
    if place.where == "point":
        assert load.places is not None
        at = np.broadcast_to(load.places.function(*values)[place.number], len(left))
        return at[:, None], place.entry + place.order
    return (left if place.where == "left" else left + length)[:, None], place.entry
