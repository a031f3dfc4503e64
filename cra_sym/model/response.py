"""Vibration of a model in time: its modes, driven by prescribed motions and forces or let go from an initial state."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from sympy import Derivative, Expr, S, sympify
from sympy.core.function import AppliedUndef

from cra_sym.checks import broadcastable, mapping, real_array, shown
from cra_sym.kernels import derived_kernel
from cra_sym.mechanics.jets import Jet
from cra_sym.mechanics.weak import WeakForm
from cra_sym.model.projection import Load, ModalBasis
from cra_sym.solvers.coupled_modes import CoupledModes, coupled_response
from cra_sym.solvers.driven_modes import Start, check_start, driven_response
from cra_sym.solvers.modal_response import Oscillators
from cra_sym.solvers.motion import BaseMotion, Force

__all__ = ["History", "initial_state", "oscillation"]

History = BaseMotion | Force

_free = derived_kernel("cra_sym.model.oscillator:free_kernel", backend="numpy")
_forced = derived_kernel("cra_sym.model.oscillator:forced_kernel", backend="numpy")


def oscillation(
    basis: ModalBasis,
    weak: WeakForm,
    motion: Mapping[AppliedUndef, History] | None,
    rows: np.ndarray,
    shape: tuple[int, ...],
    t: Any,
    derivative: int,
    zeta: Any,
    start: Start,
    initial: Mapping[Expr, Expr] | None,
) -> np.ndarray:
    """Return the outputs ``rows`` (rows, modes, outputs) of the driven modes, shape (*shape, outputs, times)."""
    modes = basis.z.shape[1]
    damping = basis.damping(weak.inside, weak.ends)
    check_start(start)
    histories = mapping("motion", motion, "functions of t to BaseMotion or Force")
    initial = mapping("initial", initial, "fields and coordinates to expressions in x")
    ratio = np.atleast_1d(
        real_array("zeta", zeta, low=0.0, high=np.nextafter(1.0, 0.0), allowed="real numbers in [0, 1)")
    )
    if ratio.shape[-1] not in (1, modes):
        raise ValueError(f"zeta has shape {ratio.shape}: its last axis must have one value, or one for each mode")
    omega = np.sqrt(basis.z).reshape(*shape, modes)
    broadcastable(values=omega[..., 0], zeta=ratio[..., 0])
    output = np.swapaxes(rows, 1, 2).reshape(*shape, -1, modes)
    damping = damping.reshape(*shape, modes, modes)

    def answer(gamma: np.ndarray, motion: BaseMotion, begin: Start, state: Any = None) -> np.ndarray:
        gamma = gamma.reshape(*shape, modes)
        if damping.any():
            coupled = CoupledModes(omega, ratio, damping, gamma, output)
            return coupled_response(coupled, motion, t, derivative, begin, state)
        free = Oscillators(omega, ratio, gamma, output, _free, _forced)
        return driven_response(free, motion, t, derivative, begin, state)

    still = np.zeros(basis.z.shape)
    q, u = (initial_state(basis, weak, initial, order).reshape(*shape, modes) for order in (0, 1))
    total = np.zeros(1)
    if q.any() or u.any() or not histories:
        total = answer(still, BaseMotion(), "base", (q, u))
    for inside, ends, history in _loads(weak, histories):
        gamma = -basis.project(inside, ends)
        force = isinstance(history, Force)
        profile = history.profile if isinstance(history, Force) else history
        total = total + answer(gamma, profile, "base" if force else start)
    return total


def initial_state(basis: ModalBasis, weak: WeakForm, initial: Mapping[Expr, Expr], order: int) -> np.ndarray:
    """Return the modal displacements (order 0) or velocities (1) of given fields at t = 0: products with the mass."""
    space = weak.variation.space
    given: dict[int, Expr] = {}
    for key, value in initial.items():
        function = key.expr if isinstance(key, Derivative) else key
        if function not in space.unknowns or key not in (function, function.diff(space.t)):
            allowed = ", ".join(f"{u}, {u.diff(space.t)}" for u in space.unknowns)
            raise ValueError(f"initial: {key} is none of {allowed}")
        number, value = space.unknowns.index(function), sympify(value, strict=True)
        known = {*basis.spatial.symbols, *([space.x] if space.is_field(number) else [])}
        if value.free_symbols - known or value.atoms(AppliedUndef):
            raise ValueError(f"initial: {key} = {value}: allowed is an expression in {', '.join(map(str, known))}")
        if order == int(isinstance(key, Derivative)):
            given[number] = value

    def momentum(form: Any) -> dict[Jet, Expr]:
        load: dict[Jet, Expr] = {}
        for (p, q), entry in form.items():
            if 2 in entry and q.unknown in given:
                value = given[q.unknown].diff(space.x, q.space)
                if q.place is not None:
                    value = value.subs(space.x, space.ends[q.place])
                load[p] = load.get(p, S.Zero) + entry[2] * value
        return load

    return basis.project(momentum(weak.inside), momentum(weak.ends))


def _loads(weak: WeakForm, histories: Mapping[AppliedUndef, History]) -> Iterator[tuple[Load, Load, History]]:
    """Yield the loads (inside, at the ends) of one unit of each history, and of what is constant in time."""
    space = weak.variation.space
    loads = [{jet: space.restore(e).expand() for jet, e in w.items()} for w in (weak.inside_load, weak.end_load)]
    found = {function for load in loads for e in load.values() for function in e.atoms(AppliedUndef)}
    for function in sorted({*found, *histories}, key=str):
        if function not in found:
            names = ", ".join(sorted(map(str, found))) or "nothing"
            raise ValueError(f"motion: {function} does not drive the model; what drives it is {names}")
        if function not in histories:
            raise ValueError(f"motion: no history for {function}; allowed are a Force or a BaseMotion")
        if not isinstance(histories[function], Force | BaseMotion):
            raise TypeError(f"motion: {function} = {shown(histories[function])}: allowed are a Force or a BaseMotion")
        force = isinstance(histories[function], Force)
        cause = function if force else function.diff(space.t, 2)
        for term in (term for load in loads for e in load.values() for term in e.as_ordered_terms()):
            if term.has(function) and (term / cause).has(space.t):
                cure = "a BaseMotion drives by its acceleration: measure the fields from the frame that moves"
                cure = "give a BaseMotion" if force else cure
                raise ValueError(f"load {term} is no multiple of {cause}; {cure}")
        inside, ends = ({jet: e.coeff(cause) for jet, e in load.items() if e.has(function)} for load in loads)
        yield inside, ends, histories[function]
    still = dict.fromkeys(found, S.Zero)
    inside, ends = ({jet: e.subs(still).doit() for jet, e in load.items()} for load in loads)
    if any((*inside.values(), *ends.values())):
        yield inside, ends, Force(1.0)
