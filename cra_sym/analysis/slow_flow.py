"""Slow flow of a model by multiple scales, and the values of its symbols."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cra_sym import checks
from cra_sym.analysis.complex_flow import complex_flow
from cra_sym.analysis.complex_shapes import check_complex_modes
from cra_sym.analysis.nonlinear import MOST_NONLINEAR_MODES, nonlinear_modal_equations
from cra_sym.model.system import System

if TYPE_CHECKING:
    from sympy import Symbol

    from cra_sym.mechanics.slow_flow import SlowFlow
    from cra_sym.model.lagrangian import Model

__all__ = ["slow_flow", "slow_flow_values"]


def slow_flow(model: Model, resonance: Any, order: int = 1, modes: int | None = None) -> SlowFlow:
    """Return the slow evolution of amplitudes at a resonance, by multiple scales of the nonlinear modal equations.

    Parameters
    ----------
    model : Model
        Without natural modes (gyroscopic terms, forces that follow the motion) the modes are complex, see below.
    resonance : int or tuple
        ``n`` primary (varpi about omega_n); ``(n, n)``, ``(m, n)``, ``(m, -n)`` parametric (varpi about the sum or
        difference); ``('free', n)``; ``('superharmonic', n, k)`` (k varpi about omega_n); ``('subharmonic', n, k)``
        (varpi about k omega_n); ``('internal', m, n, k)`` (omega_n about k omega_m). Modes are counted from 1.
    order : {1, 2}
        1, the first order at which the amplitudes change: second in the amplitude where quadratic terms resonate, else
        third, including second-order effects of quadratic terms. 2, of ``('free', n)`` alone: the next term of the
        frequency as well, of fifth order in the amplitude.
    modes : int, optional
        Number of modes in the second-order solution; default: those of the resonance.

    Returns
    -------
    SlowFlow

    Raises
    ------
    ValueError
        Names the argument that is out of its range, or the term that is not polynomial.

    Notes
    -----
    Complex modes are those of :func:`cra_sym.eigenvalues`, for a primary or an internal resonance and for free motions.
    ``2 Re(phi A exp(i omega t))`` is their displacement, with the shapes phi of :func:`cra_sym.mode_shapes` with
    ``damped``. Each is an oscillator, and the forces on it, of second and third degree, depend on displacements (first
    number of ``Q21_1112``) and velocities (second number). The force f_n of a base that moves by w_1 at omega_n is
    ``2 omega_n / abs(phi_n)`` at the tip times :func:`cra_sym.forced_width`.

    Examples
    --------
    The clamped arm that does not stretch, to third order:

    >>> from sympy import Function, symbols
    >>> import cra_sym as cra
    >>> from cra_sym.symbols import L, t, v, x
    >>> stiffness, mass = symbols("stiffness mass", positive=True)
    >>> s = Function("s")(x, t)
    >>> arm = cra.Model(mass*(v.diff(t)**2 + s.diff(t)**2)/2 - stiffness*v.diff(x, 2)**2*(1 + v.diff(x)**2)/2,
    ...                 fields=[v], x=x, domain=(0, L), t=t, essential=[v.subs(x, 0), v.diff(x).subs(x, 0)],
    ...                 quadratures={s: v.diff(x)**2/2})
    >>> arm.slow_flow(("free", 1)).backbone
    -J_1111*omega_1/4 + 3*K_1111/(4*omega_1)
    """
    if model.pieces["hysteresis"]:
        raise ValueError(
            "model: must be without elastic-slip elements, which have no slow flow; use without_hysteresis"
        )
    from cra_sym.mechanics import free_vibration
    from cra_sym.mechanics import slow_flow as mechanics
    from cra_sym.model.slow_coefficients import slow_coefficients, slow_forces

    numbers = [abs(n) for n in (resonance if isinstance(resonance, tuple) else (resonance,)) if isinstance(n, int)]
    kind = resonance[0] if isinstance(resonance, tuple) and resonance and isinstance(resonance[0], str) else ""
    own = max(numbers[: {"internal": 2, "": 2}.get(kind, 1)], default=1)
    own = checks.count("resonance", own, high=MOST_NONLINEAR_MODES)
    total = own if modes is None else checks.count("modes", modes, low=own, high=MOST_NONLINEAR_MODES)
    if model.numerics("conservative_part") is not None:
        if kind not in ("free", "internal") and not isinstance(resonance, int):
            raise ValueError(
                f"resonance = {checks.shown(resonance)}: must be n, ('free', n) or ('internal', m, n, k) without "
                "natural modes; for others use steady_states and response_curves"
            )
        if order != 1:
            raise ValueError(f"order = {checks.shown(order)}: must be 1 without natural modes")
        return mechanics.slow_flow(resonance, slow_forces(model.numerics("nonlinear"), total), total)
    if checks.count("order", order, high=2) == 2:
        coefficients = slow_coefficients(model.numerics("nonlinear"), total, degree=6)
        return free_vibration.free_vibration(resonance, coefficients, total)
    return mechanics.slow_flow(resonance, slow_coefficients(model.numerics("nonlinear"), total), total)


@checks.default_floating_point
def slow_flow_values(flow: SlowFlow, system: System) -> dict[Symbol, float]:
    """Return the values of the symbols of a slow flow: frequencies, decay rates and coefficients.

    Parameters
    ----------
    flow : SlowFlow
    system : System
        Of the model of the flow; not a batch.

    Returns
    -------
    dict of Symbol to float
        ``sigma``, ``varpi``, forces f_n and couplings P_mn are not among them.

    Examples
    --------
    >>> from sympy import Symbol
    >>> import cra_sym as cra
    >>> k_3, arm = Symbol("k_3"), cra.Arm.nominal().replace(k_t=1e4)
    >>> v, left = arm.model.equations.fields[0], cra.paper_lagrangian()[1]
    >>> system = arm.model.replace(left=left - k_3 * v**4 / 4).at({**arm.values, "k_3": 1e9})
    >>> flow = system.model.slow_flow(("free", 1))
    >>> values = cra.slow_flow_values(flow, system)
    >>> print({symbol.name: round(value, 3) for symbol, value in values.items()})
    {'c_1': 0.0, 'omega_1': 15.227, 'K_1111': 3.263}
    """
    from cra_sym.mechanics.slow_flow import SlowFlow

    checks.instance("flow", flow, SlowFlow)
    checks.instance("system", system, System)
    found = sorted({s for e in flow.amplitude_equations for s in e.free_symbols}, key=str)
    numbers = [int(s.name[6:]) for s in found if s.name.startswith("omega_")]
    numbers += [n for c in flow.coefficients for n in c.indices]
    if system.conservative_part is not system:
        return _of_complex_modes(flow, found, system, max(numbers, default=1))
    equations = nonlinear_modal_equations(system, max(numbers, default=1)).polynomials
    values: dict[Symbol, float] = {}
    for symbol in found:
        if symbol.name.startswith("omega_"):
            values[symbol] = float(equations.omega[int(symbol.name[6:]) - 1])
        elif symbol.name.startswith("c_"):
            n = int(symbol.name[2:]) - 1
            values[symbol] = float(equations.damping[n, n]) / 2
    for c in flow.coefficients:
        terms = equations.forces if c.force else equations.energies
        entry = 0.0
        for term in terms:
            if (term.positions, term.velocities, term.causes) == (c.positions, c.velocities, ()):
                entry = float(term.tensor[tuple(np.array(c.indices) - 1)])
        values[c.symbol] = entry / float(c.factor)
    return values


def _of_complex_modes(flow: SlowFlow, found: Sequence[Symbol], system: System, modes: int) -> dict[Symbol, float]:
    """Return the values of the symbols of a flow of complex modes."""
    if system.shape:
        raise ValueError(
            f"system has the batch shape {system.shape}: must be a single one here; see System.parameter_sets"
        )
    if np.any(system.zeta):
        raise ValueError("zeta: must be 0 where modes are complex, which dampers of the model damp")
    check_complex_modes(system)
    s, forces = complex_flow(system, modes)
    values: dict[Symbol, float] = {}
    for symbol in found:
        name, _, number = symbol.name.partition("_")
        if name in ("omega", "c"):
            one = s[int(number) - 1]
            values[symbol] = float(one.imag if name == "omega" else -one.real)
    for c in flow.coefficients:
        own = np.array(c.indices) - 1
        own[1 + c.positions :] += modes  # velocities
        orders = len(set(itertools.permutations(own[1:])))
        values[c.symbol] = orders * float(forces[c.positions + c.velocities][tuple(own)])
    return values
