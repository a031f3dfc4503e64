"""Observed orders of convergence: each numerical method against exact results, for two sizes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import cast

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike, NDArray
from scipy.special import ellipk

import cra_sym as cra
from cra_sym.analysis.floquet_boundary import floquet_boundary
from cra_sym.solvers.floquet import Oscillation
from cra_sym.solvers.periodic import PeriodicSystem, monodromy
from cra_sym.solvers.stiffness import DynamicStiffness, exponential
from cra_sym.solvers.taylor import propagated
from cra_sym.symbols import L, t, v, x

__all__ = ["Order", "orders"]

_EI, _mass, _T = sp.symbols("EI m T", positive=True)
_BEAM = _mass * v.diff(t) ** 2 / 2 - _EI * v.diff(x, 2) ** 2 / 2
_STRING = _mass * v.diff(t) ** 2 / 2 - _T * v.diff(x) ** 2 / 2
_CLAMPED = (v.subs(x, 0), v.diff(x).subs(x, 0))
_FIXED = (v.subs(x, 0), v.subs(x, L))


@dataclass(frozen=True)
class Order:
    """Order of convergence of a method.

    Attributes
    ----------
    method, size, reference : str
        The method, the size that is varied, and the reference.
    theory, observed : float
        Power of the size with which the error falls; for harmonic balance decades for two more harmonics.

    Examples
    --------
    What :func:`orders` returns many of:

    >>> row = Order("the trapezoidal rule", "step", "the integral of x^2 from 0 to 1", 2.0, 2.0)
    >>> row.theory == row.observed
    True
    """

    method: str
    size: str
    reference: str
    theory: float
    observed: float


def orders() -> tuple[Order, ...]:
    """Measure the order of every numerical method of the package.

    Returns
    -------
    tuple of Order
        It takes some seconds.
    """
    return tuple(Order(*words, theory, measure()) for words, theory, measure in _ROWS)


def _power(sizes: ArrayLike, errors: ArrayLike) -> float:
    """Return the order from two errors."""
    size, error = np.log(np.abs(sizes)), np.log(np.abs(errors))
    return float((error[0] - error[1]) / (size[0] - size[1]))


def _ritz(density: sp.Expr, essential: Sequence[sp.Expr], elements: tuple[int, int]) -> float:
    model = cra.Model(density, fields=[v], x=x, domain=(0, L), t=t, essential=essential)
    values = dict.fromkeys((density.free_symbols | {L}) - {x, t}, 1.0)
    exact = model.natural_frequencies(values)[0]
    errors = [model.ritz(elements=n).natural_frequencies(values)[0] / exact - 1.0 for n in elements]
    return _power(elements, errors[::-1])


def _ritz_of_a_beam() -> float:
    return _ritz(_BEAM, _CLAMPED, (6, 12))


def _ritz_of_a_string() -> float:
    return _ritz(_STRING, _FIXED, (12, 24))


def _magnus() -> float:
    """Transfer along a string of mass 1/(1 + x)^2, whose solutions are sqrt(1 + x) times sines of log(1 + x)."""
    z = 9.0

    def system(
        z: NDArray[np.float64], rows: NDArray[np.intp], share: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        density = 1.0 / (1.0 + np.broadcast_to(share, (len(z), np.shape(share)[-1]))) ** 2
        a, da = np.zeros((2, *density.shape, 2, 2))
        a[..., 0, 1], a[..., 1, 0], da[..., 1, 0] = 1.0, -z[:, None] * density, -density
        return a, da

    def ends(z: NDArray[np.float64], rows: NDArray[np.intp]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return np.zeros((len(z), 2, 2)), np.zeros((len(z), 2, 2))

    def basis(place: float) -> NDArray[np.float64]:
        k, stretched = np.sqrt(z - 0.25), np.log(1.0 + place)
        sines = np.array([np.cos(k * stretched), np.sin(k * stretched)])
        slopes = 0.5 * sines + k * np.array([-sines[1], sines[0]])
        return np.array([np.sqrt(1.0 + place) * sines, slopes / np.sqrt(1.0 + place)])

    string = DynamicStiffness(system, ends, np.ones(1), 1, uniform=False)
    exact, errors = basis(1.0) @ np.linalg.inv(basis(0.0)), []
    for steps in (16, 32):
        total = np.eye(2)
        for k in range(steps):
            start, share = np.full((1, 1), k / steps), np.full((1, 1), 1 / steps)
            total = exponential(*string.exponent(np.array([z]), np.zeros(1, dtype=int), start, share))[0][0, 0] @ total
        errors.append(np.abs(total - exact).max())
    return _power((2.0, 1.0), errors)


def _records() -> float:
    middle, errors = np.linspace(0.013, 1.977, 4001), []
    for count in (101, 201):
        times = np.linspace(0.0, 2.0, count)
        motion = cra.BaseMotion.sampled(times, np.cos(3.0 * times), kind="acceleration")
        errors.append(np.max(np.abs(motion.kinematics(middle)[2] - np.cos(3.0 * middle))))
    return _power((2.0, 1.0), errors)


def _floquet_steps() -> float:
    """Three coupled and damped modes, of whose series eight terms are taken."""
    omega, coupling = np.array([1.0, 2.3, 4.1]), np.array([[0.7, 0.4, -0.2], [0.4, -0.9, 0.5], [-0.2, 0.5, 1.1]])
    drives = [(Oscillation(1, "cos", 0), (coupling, None, None, None))]
    system, _ = PeriodicSystem.of(np.diag(omega**2), np.diag(0.04 * omega), drives, 2.7, 0.3)
    exact, numbers = monodromy(system, 1e-13)[0], (24, 48)
    errors = [np.abs(list(propagated(system, steps, 8))[-1][..., 0] - exact).max() for steps in numbers]
    return _power(numbers[::-1], errors)


@cache
def _two_masses() -> cra.System:
    """Two masses on springs, of which one fluctuates: what is neglected is only the order of the expansion."""
    one, other = (sp.Function(name)(t) for name in ("q_1", "q_2"))
    k, c = sp.symbols("k c", positive=True)
    energy = (one.diff(t) ** 2 + other.diff(t) ** 2) / 2 - k * one**2 / 2 - c * (other - one) ** 2 / 2 - 2 * other**2
    model = cra.Model(0, fields=(), coordinates=[one, other], x=x, domain=(0, 1), t=t, left=energy)
    return model.at({k: 1.0, c: 0.5})


def _boundary(order: int) -> float:
    system, excitation, sizes, errors = _two_masses(), cra.Fluctuation(k=1.0), (0.08, 0.04), []
    for epsilon in sizes:
        exact = np.array(floquet_boundary(system, excitation, epsilon, (1, 2), 2))
        found = np.array(cra.stability_boundary(system, excitation, epsilon, (1, 2), order=order, modes=2))
        errors.append(np.abs(found - exact).max())
    return _power(sizes, errors)


def _oscillator(energy: sp.Expr) -> cra.Model:
    q = sp.Function("q")(t)
    potential = energy.subs(sp.Symbol("q"), q)
    return cra.Model(0, fields=(), coordinates=[q], x=x, domain=(0, 1), t=t, left=q.diff(t) ** 2 / 2 - potential)


def _slow_flow(order: int) -> float:
    """An oscillator with quadratic and cubic force, against harmonic balance at amplitudes whose ratio is 2."""
    q = sp.Symbol("q")
    model = _oscillator(q**2 / 2 + q**3 / 3 + q**4 / 2)
    flow, system = model.slow_flow(("free", 1), order), model.at({})
    bend = cast(sp.Expr, flow.backbone).subs(cra.slow_flow_values(flow, system))
    curve = cra.backbone(system, energy=np.array([0.05, 0.025]) ** 2 / 2, modes=1)
    sizes = np.abs(curve.coefficients[:, 0, curve.multiples.index(1)])
    slow = sp.lambdify(sp.Symbol("a", positive=True), bend)(sizes) * sizes**2
    return _power(sizes, curve.angular_frequency - 1.0 - slow)


def _harmonic_balance() -> float:
    """Return the decades gained by two more harmonics in the frequency of x'' + x + x^3 = 0 at a given energy."""
    q, energy = sp.Symbol("q"), 10.0
    system = _oscillator(q**2 / 2 + q**4 / 4).at({})
    top, quarter, _ = _cn(energy)
    exact = np.pi * np.sqrt(1.0 + top) / (2.0 * quarter)
    found = [
        cra.backbone(system, energy=[energy], modes=1, harmonics=harmonics).angular_frequency[0] for harmonics in (5, 7)
    ]
    return float(np.log10(abs(found[0] - exact) / abs(found[1] - exact)))


def _cn(energy: float) -> tuple[float, float, float]:
    """Return the squared amplitude of x = A cn, its quarter period in the argument, and the nome."""
    top = np.sqrt(1.0 + 4.0 * energy) - 1.0
    parameter = top / (2.0 * (1.0 + top))
    quarter = ellipk(parameter)
    return top, quarter, float(np.exp(-np.pi * ellipk(1.0 - parameter) / quarter))


def _truncation() -> float:
    """The tip of a clamped arm without an end effector on a base that shakes."""
    arm, rate, errors = cra.Arm.nominal().replace(m_e=0.0, k_t=np.inf, k_r=np.inf), 30.0, []
    exact = cra.frequency_response(arm, rate)
    for modes in (16, 32):
        modal = cra.modal_parameters(arm, modes)
        receptance = 1.0 / (modal.omega**2 + 2j * arm.zeta * modal.omega * rate - rate**2)
        errors.append(abs(-modal.participation * receptance @ cra.mode_shapes(arm, arm.L, modes) - exact))
    return _power((2.0, 1.0), errors)


def _manufactured() -> float:
    """A beam under the load that makes v = X(x) sin(3 t) its motion, by the derived equation of motion."""
    a, b = sp.symbols("a b")
    trial = x**4 * (1 + a * x + b * x**2)
    free = sp.solve([trial.diff(x, order).subs(x, 1) for order in (2, 3)], [a, b])
    shape, rate, F = sp.expand(trial.subs(free)), 3, sp.Function("F")(t)
    options = {"fields": [v], "x": x, "domain": (0, L), "t": t, "essential": _CLAMPED}
    (equation,) = cra.Model(_BEAM, **options).equations.field_equations
    load = equation.lhs if isinstance(equation, sp.Equality) else equation
    load = sp.expand(load.subs(v, shape * sp.sin(rate * t)).doit() / sp.sin(rate * t))
    loaded = cra.Model(_BEAM + load * F * v, **options)
    system = loaded.at({_EI: 1.0, _mass: 1.0, L: 1.0})
    history = {F: cra.Force(amplitude=1.0, angular_frequency=float(rate))}
    exact, errors = float(shape.subs(x, 1)) * np.sin(rate * 0.7), []
    for modes in (24, 48):
        found = cra.response(system, history, 0.7, 1.0, modes=modes, initial={v.diff(t): rate * shape})
        errors.append(float(found) - exact)
    return _power((2.0, 1.0), errors)


def _iwan() -> float:
    """The energy lost in a cycle by the Jenkins elements that stand for Iwan's, over amplitudes (root mean square)."""
    law = cra.Iwan(1.0, 1.0, chi=-0.5, beta=0.0)
    amplitude, errors = np.geomspace(0.05, 1.0, 401) * law.phi_max, []
    for number in (40, 80):
        stiffness, slip = law.elements(number)
        beyond = np.maximum(amplitude[:, None] - slip / stiffness, 0.0)
        errors.append(np.sqrt(np.mean(((4.0 * slip * beyond).sum(axis=-1) / law.loss(amplitude) - 1.0) ** 2)))
    return _power((2.0, 1.0), errors)


_DECADES = -float(np.log10(_cn(10.0)[2]))  # the harmonics of cn fall with the nome
_Row = tuple[tuple[str, str, str], float, Callable[[], float]]
_ROWS: tuple[_Row, ...] = (
    (("Ritz, beam: eigenvalues", "element", "the characteristic function"), 4.0, _ritz_of_a_beam),
    (("Ritz, string: eigenvalues", "element", "the characteristic function"), 6.0, _ritz_of_a_string),
    (("dynamic stiffness: Magnus steps along x", "step", "solutions in closed form"), 6.0, _magnus),
    (("sampled motions: acceleration between samples", "sampling interval", "the function"), 2.0, _records),
    (
        ("Floquet: Taylor steps of order 8 of the monodromy matrix", "step", "the same with a tolerance of 1e-13"),
        8.0,
        _floquet_steps,
    ),
    (("Gauss rules over slip displacements: loss of an Iwan element", "1/elements", "closed form"), 2.0, _iwan),
    (("multiple scales, order 1: boundary", "epsilon", "bisection on Floquet exponents"), 2.0, lambda: _boundary(1)),
    (("multiple scales, order 2: boundary", "epsilon", "bisection on Floquet exponents"), 3.0, lambda: _boundary(2)),
    (("slow flow, order 1: backbone", "amplitude", "harmonic balance"), 4.0, lambda: _slow_flow(1)),
    (("slow flow, order 2: backbone", "amplitude", "harmonic balance"), 6.0, lambda: _slow_flow(2)),
    (("harmonic balance, Duffing: decades", "two harmonics", "elliptic functions"), _DECADES, _harmonic_balance),
    (("modal series: frequency response of the tip", "1/modes", "the boundary value problem"), 5.0, _truncation),
    (("modal series: motion under a manufactured load", "1/modes", "the chosen motion"), 5.0, _manufactured),
)
