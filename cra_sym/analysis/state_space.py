"""Linear state-space systems for control design, from motions or forces to measurable outputs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from cra_sym.analysis.modes import participation
from cra_sym.analysis.signals import FREE, Input, Reader, states_of
from cra_sym.checks import count, default_floating_point, instance, real_array
from cra_sym.model.observables import Observable
from cra_sym.model.projection import Load, Projected, displaced_at, project
from cra_sym.model.routes import Modes
from cra_sym.model.system import MOST_MODES, System
from cra_sym.model.values import flat_columns
from cra_sym.model.vanishing import check_forces
from cra_sym.solvers.linear_system import LinearSystem
from cra_sym.solvers.lowest_motions import LowestMotions, lowest_motions

if TYPE_CHECKING:
    from sympy import Expr

__all__ = ["state_space"]

Array = NDArray[np.float64]
_OWN = 1e-10  # least share of its mass that a free motion has beside the modes: 1e-16 over it is the relative error


@default_floating_point
def state_space(
    system: System,
    modes: int = 3,
    input: str | Expr | Sequence[str | Expr] = "base_acceleration",
    outputs: Sequence[str | tuple[str, float] | Expr] | Mapping[str, str | tuple[str, float] | Expr] | None = None,
) -> LinearSystem:
    """Return the continuous-time state space from inputs to outputs, in modal coordinates.

    Parameters
    ----------
    system : System
        One set of values, not a batch.
    modes : int
        Modes kept, 1 to 1000. With gyroscopic forces or forces that follow the motion: the lowest complex modes, as
        many eigenvalues as that many oscillators have.
    input : str or Expr, or a sequence of them
        'base_acceleration': w'' (m/s2) of the only prescribed motion. 'drive_force': a force F (N) on that motion,
        which is then free; of an arm (m_b + m_e + rho A L) w'' + sum Gamma_i q_i'' = F. The acceleration of a
        prescribed motion, or a force of the Lagrangian, as w(t) or by its name. Or a displacement that a unit force
        acts on: a coordinate, a field or slope at any place such as ``v.subs(x, L/2)``, or a sum of them.
    outputs : sequence, or mapping of names to them, optional
        Names: of a field (at the right end), a coordinate, a prescribed motion; 'y', 'tip_velocity' and
        'tip_acceleration' of the first field there in the inertial frame, with the prescribed motions and the
        coordinates that carry all of it, as of a gantry; 'root_force', 'root_moment', 'tip_force' and 'tip_moment',
        the forces and moments that the structure exerts on its supports, for springs k_t v(0, t) and k_r v_x(0, t) (of
        another field u 'root_force_u'); of an arm 'strain', that of bending on the face turned to -v, h v_xx / 2, at
        the root. A pair ``('v', 0.3)`` or ``('strain', 0.3)`` takes a field or the strain at another place, m.
        Expressions linear in fields at places, coordinates, motions and their derivatives, of time up to the second,
        are outputs too, with parameters of the model as factors. Default: the first field.

    Returns
    -------
    LinearSystem
        A :class:`scipy.signal.StateSpace` with names; `discrete` and `to_control` are its methods. States: q_i and
        their rates; before them w and before these w', where the base is free or an output needs them. Of complex
        modes: w and w', and for each pair ``a +- i b`` of eigenvalues q_i_1 and q_i_2 with ``[[a, b], [-b, a]]``, for a
        real one q_i; modes that meet, as at flutter and in rigid motions, share a block.

    Raises
    ------
    TypeError, ValueError
        If ``system`` is not a :class:`System` or is a batch, its model does not have the motion, ``modes`` is not an
        integer from 1 to 1000, an input or output is not one of the above, or the inertia of a free motion is all
        that of the modes. Complex modes have no 'drive_force' and no forces at the ends: make the motion a coordinate
        that a force F(t) drives, and name the force of a spring as an expression such as ``k*v.subs(x, 0)``.

    Notes
    -----
    Constant loads are left out: states are measured from the equilibrium. An initial base velocity is the state q_i' =
    -Gamma_i w'(0+). ``scipy.signal.lsim`` interpolates its input linearly between the samples; ``discrete`` holds it.

    The omitted modes would add the sum of c_i b_i / (omega_i^2 - Omega^2) to the transfer function of a displacement or
    force, with the output and input factors c_i and b_i of mode i: for displacements it falls with the third power of
    the number of modes or faster; for the force at a rigid root only as its inverse, by the effective masses of the
    omitted modes.

    Examples
    --------
    >>> from cra_sym import Arm, state_space
    >>> state_space(Arm.nominal(), modes=2).A.shape
    (4, 4)
    >>> free = state_space(Arm.nominal(), 2, "drive_force", ["w", "tip_acceleration", ("strain", 0.1)])
    >>> free.input_names, free.output_names, free.D.round(3).ravel()
    (('drive_force',), ('w', 'tip_acceleration', 'strain(0.1)'), array([0.   , 0.058, 0.   ]))
    """
    instance("system", system, System)
    if system.shape:
        raise ValueError(f"system has shape {system.shape}: must be a single set of values, not a batch")
    modes = count("modes", modes, high=MOST_MODES)
    reader = _reader(system)
    wanted, driven = reader.outputs(outputs), reader.inputs(input)
    free, states = any(one.kind == "free" for one in driven), states_of(driven, wanted)
    if system.numerics("complex_modes") == "always" and system.conservative_part is not system:
        return _complex(system, modes, states, wanted, driven, free=free)
    motion = _equations(system, modes, states, driven, free=free)
    return _measured(system, modes, states, motion, wanted, driven)


# What is measured ------------------------------------------------------------------------------------------------


def _reader(system: System) -> Reader[Observable]:
    def place(name: str, given: Any) -> float:
        left, length = float(system.domain.left), float(system.domain.length)
        return float(real_array(name, given, low=left, high=left + length, unit="m"))

    known: Mapping[str, Observable] = system.numerics("named_observables")
    return Reader(
        system,
        known,
        system.section_quantities,
        system.domain.left,
        place,
        lambda given, argument: _read(system, given, argument),
    )


def _read(system: System, expression: Any, argument: str) -> Observable:
    from cra_sym.model.observables import observable

    found = observable(system.model, expression, argument)
    for name, value in system.values.items():
        if np.isinf(value) and name in map(str, expression.free_symbols):
            raise ValueError(
                f"{argument}: {name} = inf in {expression} must be finite; name the force, as 'root_force'"
            )
    return found


def _rows(system: System, found: Modes, of: Observable) -> tuple[list[Array], dict[tuple[str, int], float]]:
    """Return the rows of q, q' and q'' in an observable, and its factors of motions by (name, derivative)."""
    numbers = [float(number) for number in of.numbers.function(*system.domain.values)]
    rows = [np.zeros(found.omega.shape[-1]) for _ in range(3)]
    motions: dict[tuple[str, int], float] = {}
    for part, factor, place in zip(of.parts, numbers[: len(of.parts)], numbers[len(of.parts) :], strict=True):
        if part.kind == "motion":
            motions[part.name, part.time] = motions.get((part.name, part.time), 0.0) + factor
        elif part.kind == "force":
            rows[part.time] += factor * found.force(part.end, part.entry)
        elif part.kind == "coordinate":
            rows[part.time] += factor * found.coordinate(part.entry)
        else:
            rows[part.time] += factor * displaced_at(system.domain, found, part.entry, part.order, place)
    return rows, motions


# What drives -----------------------------------------------------------------------------------------------------


def _equations(
    system: System, modes: int, states: Sequence[str], driven: Sequence[Input[Observable]], *, free: bool
) -> tuple[Array, Array]:
    """Return accelerations by (z, z') and by the inputs, of z = (motions that are states, q)."""
    first, size = len(states), len(states) + modes
    omega = system.natural_frequencies(modes)
    mass, damping, stiffness = np.eye(size), np.zeros((size, size)), np.zeros((size, size))
    damping[first:, first:] = np.diag(2 * float(system.zeta) * omega)
    stiffness[first:, first:] = np.diag(omega**2)
    dampers = system.numerics("damping")
    if dampers is not None:
        damping[first:, first:] += Projected(system.domain, system.modes(modes), dampers)["damping"]
    if free:
        own = system.numerics("carried", states[0]).function(*system.domain.values)
        mass[0, 0], damping[0, 0], stiffness[0, 0] = (float(value) for value in own)
        mass[0, 1:] = mass[1:, 0] = participation(system, modes, states[0])
        _check_inertia(states[0], mass[0, 0], mass[0, 1:])
    for order, column, load in _support_loads(system, states, driven):
        (stiffness, damping)[order][first:, column] = -system.project(load, modes)
    push = np.stack([_push(system, modes, states, one, free=free) for one in driven], axis=-1)
    found = np.asarray(np.linalg.solve(mass, np.hstack([-stiffness, -damping, push])), dtype=np.float64)
    return found[:, : 2 * size], found[:, 2 * size :]


def _check_inertia(name: str, mass: float, shared: Array) -> None:
    """Raise if all inertia of a free motion is that of the modes, so that rounding would decide on its acceleration."""
    own = mass - float(shared @ shared)
    if not own > _OWN * mass:
        raise ValueError(
            f"input: {FREE!r}: {name} has no mass of its own beside that of {len(shared)} modes ({max(own, 0.0):.1g} "
            f"of {mass:.4g}), which must be above {_OWN:g} of it; give {name} a mass, or take fewer modes"
        )


def _support_loads(
    system: System, states: Sequence[str], driven: Sequence[Input[Observable]]
) -> Iterator[tuple[int, int, Load]]:
    """Yield the loads by displacement (order 0) and velocity (1) of moving supports, with the state they belong to."""
    for one in driven:
        if one.kind == "support":
            for order, load in system.numerics("loads", one.name).items():
                if order < 2:
                    yield order, states.index(one.name), load


def _push(system: System, modes: int, states: Sequence[str], one: Input[Observable], *, free: bool) -> Array:
    """Return the generalised force of a unit of an input on (motions that are states, q)."""
    base, q = np.zeros(len(states)), np.zeros(modes)
    if one.kind == "free":
        base[0] = 1.0
    elif one.kind == "motion":
        base[:] = [name == one.name for name in states]
        q = -participation(system, modes, one.name)
    elif one.kind == "support":
        base[:] = [name == one.name for name in states]
        loads = system.numerics("loads", one.name)
        q = system.project(loads[2], modes) if 2 in loads else q
    elif one.kind == "force":
        q = system.project(system.numerics("load", one.name), modes)
    else:
        assert one.displacement is not None
        (q, _, _), motions = _rows(system, system.modes(modes), one.displacement)
        if free:
            base[0] = motions.get((states[0], 0), 0.0)
    return np.concatenate([base, q])


def _measured(
    system: System,
    modes: int,
    states: Sequence[str],
    accelerations: tuple[Array, Array],
    wanted: Mapping[str, Observable],
    driven: Sequence[Input[Observable]],
) -> LinearSystem:
    """Return the linear system of the equations and the outputs."""
    by_state, by_input = accelerations
    size = len(by_state)
    A = np.vstack([np.hstack([np.zeros((size, size)), np.eye(size)]), by_state])
    B = np.vstack([np.zeros_like(by_input), by_input])
    C, D = np.zeros((len(wanted), 2 * size)), np.zeros((len(wanted), len(driven)))
    for k, of in enumerate(wanted.values()):
        modal, motions = _rows(system, system.modes(modes), of)
        rows = [np.array([*(motions.get((name, time), 0.0) for name in states), *modal[time]]) for time in range(3)]
        C[k] = np.concatenate(rows[:2]) + rows[2] @ by_state
        D[k] = rows[2] @ by_input
        D[k] += [motions.get((one.name, 2), 0.0) * (one.kind == "motion" and one.name not in states) for one in driven]
    names = [*states, *(f"q_{mode + 1}" for mode in range(modes))]
    return LinearSystem(
        A, B, C, D, [*names, *(f"{name}_rate" for name in names)], [one.label for one in driven], list(wanted)
    )


# Without natural modes -------------------------------------------------------------------------------------------


def _complex(
    system: System,
    modes: int,
    states: Sequence[str],
    wanted: Mapping[str, Observable],
    driven: Sequence[Input[Observable]],
    *,
    free: bool,
) -> LinearSystem:
    """Return the linear system of the lowest complex modes."""
    if free:
        raise ValueError(
            f"input: {FREE!r} needs natural modes, which gyroscopic forces and forces that follow the motion leave "
            f"none; make {driven[0].name} a coordinate that a force F(t) drives, and give input='F'"
        )
    _check_complex(system, wanted)
    ((_, problem),) = system.numerics("pencil").problems(flat_columns(system.parameters, ()))
    motions = lowest_motions(problem, modes, float(system.zeta), whole=True).in_blocks()
    push = np.stack([_complex_push(system, motions, one) for one in driven], axis=-1)
    carried, size = 2 * len(states), len(motions.system)
    A, B = np.zeros((carried + size,) * 2), np.zeros((carried + size, len(driven)))
    A[carried:, carried:], B[carried:] = motions.system, push
    for row, name in enumerate(states):
        A[row, len(states) + row] = 1.0
        B[len(states) + row] = [one.kind in ("motion", "support") and one.name == name for one in driven]
    for order, column, load in _support_loads(system, states, driven):
        A[carried:, order * len(states) + column] = _pushed(system, motions, load)
    C, D = np.zeros((len(wanted), len(A))), np.zeros((len(wanted), len(driven)))
    for k, of in enumerate(wanted.values()):
        by_basis, prescribed = _rows(system, motions.basis, of)
        by_state = [row @ motions.shapes for row in by_basis]
        # a sum of modes whose rates are those of the state: its accelerations follow the forces at once
        C[k, carried:] = by_state[0] + (by_state[1] + by_state[2] @ motions.system) @ motions.system
        D[k] = by_state[2] @ motions.system @ push
        C[k, :carried] = [prescribed.get((name, time), 0.0) for time in range(2) for name in states]
        D[k] += [prescribed.get((one.name, 2), 0.0) * (one.kind in ("motion", "support")) for one in driven]
    names = [*states, *(f"{name}_rate" for name in states), *_names(motions)]
    return LinearSystem(A, B, C, D, names, [one.label for one in driven], list(wanted))


def _check_complex(system: System, wanted: Mapping[str, Observable]) -> None:
    """Raise if complex modes do not tell an output."""
    orders = system.numerics("pencil").orders
    top = np.repeat(np.cumsum(orders), orders)
    for name, of in wanted.items():
        for part in of.parts:
            if part.kind == "force":
                raise ValueError(
                    f"outputs: {name!r} needs natural modes, which gyroscopic forces and forces that follow the motion "
                    "leave none; name the force of a spring as an expression such as k*v.subs(x, 0)"
                )
            if part.kind == "field" and part.entry + part.order > top[part.entry]:
                raise ValueError(
                    f"outputs: {name!r} has a derivative by x beyond those in the energies, which complex modes do not "
                    f"have; must be at most {top[part.entry] - part.entry}"
                )


def _complex_push(system: System, motions: LowestMotions, one: Input[Observable]) -> Array:
    """Return the rate of the state of complex modes per unit of an input."""
    if one.displacement is not None:
        (acts, _, _), _ = _rows(system, motions.basis, one.displacement)
        return motions.push @ acts
    if one.kind != "support":
        return _pushed(system, motions, system.numerics("load", one.name))
    loads = system.numerics("loads", one.name)
    return _pushed(system, motions, loads[2]) if 2 in loads else np.zeros(len(motions.system))


def _pushed(system: System, motions: LowestMotions, load: Load) -> Array:
    """Return the rate of the state of complex modes per unit of a load."""
    check_forces(system, load, system.numerics("pencil"))
    return np.asarray(motions.push @ project(system.domain, motions.basis, load))


def _names(motions: LowestMotions) -> list[str]:
    """Return names of the states, by the blocks of the matrix."""
    joined = motions.system != 0.0
    _, block = connected_components(joined | joined.T, directed=False)
    return [
        f"q_{number + 1}" if (block == number).sum() == 1 else f"q_{number + 1}_{(block[:place] == number).sum() + 1}"
        for place, number in enumerate(block)
    ]
