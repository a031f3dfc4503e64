"""Accuracy of the results: stated values, measured when the site is built; the tests check the same table."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.special import ellipk, mathieu_a
from sympy import Function, Piecewise, symbols

import cra_sym as cra
from cra_sym.symbols import L, t, v, x

__all__ = ["ACCURACY", "AccuracyRow", "accuracy_table"]

_ARM = {"k_t": 1e4, "k_r": 1e3, "m_e": 0.05, "J_e": 1e-4}


@dataclass(frozen=True)
class AccuracyRow:
    """A quantity, its stated relative error, how that is measured, and the test with more cases."""

    quantity: str
    stated: float
    how: str
    measure: Callable[[], float]
    test: str


def _arms() -> Iterator[cra.Arm]:
    yield cra.Arm.nominal()
    yield cra.Arm.nominal().replace(**_ARM)


def _worst(found: object, exact: object) -> float:
    return float(np.max(np.abs(np.asarray(found) / np.asarray(exact) - 1.0)))


def _proved() -> float:
    worst = 0.0
    for arm in _arms():
        proof, found = cra.certify(arm, modes=8), cra.natural_frequencies(arm, modes=8)
        worst = max(worst, _worst(found, proof.lower), _worst(found, proof.upper))
    return worst


def _stepped_string() -> float:
    force, mass = symbols("force mass", positive=True)
    line = mass * Piecewise((1, x < L / 2), (4, True)) * v.diff(t) ** 2 / 2 - force * v.diff(x) ** 2 / 2
    ends = [v.subs(x, 0), v.subs(x, L)]
    model = cra.Model(line, fields=[v], x=x, domain=(0, L), t=t, essential=ends)
    found = 2 * np.pi * model.natural_frequencies({force: 1.0, mass: 1.0, L: 1.0}, modes=1)
    return _worst(found, 2 * np.arccos(1 / np.sqrt(3)))


def _damped_beam() -> float:
    stiffness, mass, drag = symbols("EI rhoA c", positive=True)
    beam = mass * v.diff(t) ** 2 / 2 - stiffness * v.diff(x, 2) ** 2 / 2
    clamped = [v.subs(x, 0), v.diff(x).subs(x, 0)]
    work = [(-drag * v.diff(t), v, "domain")]
    model = cra.Model(beam, fields=[v], x=x, domain=(0, L), t=t, essential=clamped, virtual_work=work)
    system = model.at({stiffness: 1.0, mass: 1.0, L: 1.0, drag: 0.3})
    found = cra.eigenvalues(system, modes=3)
    free = 2 * np.pi * model.replace(virtual_work=[]).natural_frequencies({stiffness: 1.0, mass: 1.0, L: 1.0}, 3)
    return _worst(found[found.imag > 0], -0.15 + 1j * np.sqrt(free**2 - 0.15**2))


def _scaled_stiffnesses() -> float:
    arm = cra.Arm.nominal().replace(**_ARM)
    log = cra.sensitivities(arm, modes=5).log
    return _worst(log["E"] + log["k_t"] + log["k_r"], 0.5)


def _moved(motion: cra.BaseMotion, tolerance: float) -> float:
    """Return the difference of the tip's motion from plain integration of the modal equations, over its peak."""
    arm, modes, times = cra.Arm.nominal().replace(**_ARM, zeta=0.01), 2, np.linspace(0.0, 0.4, 41)
    found = cra.tip_response(arm, motion, times, modes=modes)
    modal = cra.modal_parameters(arm, modes)
    omega, tip = modal.omega, cra.mode_shapes(arm, [arm.L], modes)[:, 0]

    def rate(time: float, state: np.ndarray) -> np.ndarray:
        q, p = state[:modes], state[modes:]
        force = -modal.participation * motion.acceleration(time)
        return np.concatenate([p, force - 2 * arm.zeta * omega * p - omega**2 * q])

    state = np.concatenate([np.zeros(modes), -modal.participation * motion.velocity(0.0)])
    plain = solve_ivp(rate, (0, times[-1]), state, "DOP853", times, rtol=tolerance, atol=1e-16).y[:modes]
    return float(np.abs(found - tip @ plain).max() / np.abs(found).max())


def _harmonic_motion() -> float:
    return _moved(cra.BaseMotion(velocity=0.1, acceleration=0.2, amplitude=1e-3, angular_frequency=30.0), 1e-12)


def _sampled_motion() -> float:
    times, arm = np.linspace(0.0, 0.5, 501), cra.Arm.nominal().replace(**_ARM)
    given = cra.BaseMotion(acceleration=0.5)
    recorded = cra.BaseMotion.sampled(times, given.acceleration(times) + 0 * times)
    first, second = (cra.tip_response(arm, motion, times, modes=5) for motion in (given, recorded))
    return float(np.abs(first - second).max() / np.abs(first).max())


def _static_deflection() -> float:
    arm = cra.Arm.nominal().replace(k_t=2e3, k_r=50.0)
    found = cra.frequency_response(arm, 1e-7, drive=v.subs(x, L))
    return _worst(found.real, arm.L**3 / (3 * arm.EI) + 1 / arm.k_t + arm.L**2 / arm.k_r)


def _oscillator(cubic: float = 0.0) -> cra.System:
    q, stiffness = Function("q")(t), symbols("k", positive=True)
    spring = stiffness * q**2 / 2 + cubic * q**4 / 4
    model = cra.Model(0, fields=(), coordinates=[q], x=x, domain=(0, 1), t=t, left=q.diff(t) ** 2 / 2 - spring)
    return model.at({stiffness: 1.0})


def _growth() -> float:
    varpi, depth = 2.0, 0.3
    found = cra.growth_rate(_oscillator(), cra.Fluctuation(k=1.0), varpi, depth, modes=1)

    def rate(time: float, state: np.ndarray) -> list[float]:
        return [state[1], -(1 + depth * np.cos(varpi * time)) * state[0]]

    period = 2 * np.pi / varpi
    columns = [solve_ivp(rate, (0, period), row, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1] for row in np.eye(2)]
    return _worst(found, np.log(np.abs(np.linalg.eigvals(np.array(columns))).max()) / period)


def _tongue(order: int) -> float:
    """Return the error of the lower edge of the first tongue at a depth of 0.1 against Mathieu's characteristic."""
    depth = 0.1
    lower, _ = cra.stability_boundary(
        _oscillator(), cra.Fluctuation(k=1.0), depth, resonance=(1, 1), order=order, modes=1
    )
    # x'' + (1 + depth cos varpi t) x = 0: a = 4 / varpi^2, q = 2 depth / varpi^2, on the branch a_1(q)
    edge = 2.0
    for _ in range(40):
        edge = 2 / np.sqrt(float(mathieu_a(1, 2 * depth / edge**2)))
    return _worst(lower, edge)


def _duffing() -> float:
    found = cra.backbone(_oscillator(1.0), amplitude=1.0, modes=1).angular_frequency
    return _worst(found, np.pi * np.sqrt(2.0) / (2 * ellipk(0.25)))


def _shaped() -> float:
    arm = cra.Arm.nominal().replace(**_ARM)
    move = cra.BaseMotion.trapezoid(distance=0.3, v_max=0.5, a_max=2.0)
    shaper = cra.input_shaper(cra.modal_parameters(arm, 1).omega[0])
    shaped = cra.residual_vibration(arm, move.shaped(*shaper), modes=1)
    return float(shaped / cra.residual_vibration(arm, move, modes=1))


def _identified() -> float:
    arm = cra.Arm.nominal().replace(k_t=2e3, k_r=40.0)
    fit = cra.identify_joint(cra.Arm.nominal(), cra.natural_frequencies(arm, modes=3), uncertainty=1e-6)
    return max(_worst(fit.k_t, 2e3), _worst(fit.k_r, 40.0))


ACCURACY = (
    AccuracyRow(
        "natural frequencies, coefficients constant along x", 1e-14,
        "against proved enclosures of eight modes of two arms", _proved, "tests/analysis/test_certification.py",
    ),
    AccuracyRow(
        "natural frequencies, coefficients vary along x", 1e-10,
        "a string of two densities, in closed form; `system.accuracy` estimates it, `tolerance` sets it",
        _stepped_string, "tests/model/test_along_x.py",
    ),
    AccuracyRow(
        "complex eigenvalues", 1e-10,
        "a beam with damping along it, of which the characteristic equation is quadratic", _damped_beam,
        "tests/model/test_eigenvalues.py",
    ),
    AccuracyRow(
        "sensitivities", 1e-11,
        "scaled stiffnesses scale the squares of the frequencies: the logarithmic rates sum to one half",
        _scaled_stiffnesses, "tests/analysis/test_sensitivities.py",
    ),
    AccuracyRow(
        "responses to motions in formulas, of the modes kept", 1e-8,
        "against integration of the modal equations with the relative tolerance 1e-12", _harmonic_motion,
        "tests/solvers/test_modal_response.py",
    ),
    AccuracyRow(
        "responses to records", 1e-10, "a motion in a formula against its own samples", _sampled_motion,
        "tests/solvers/test_records.py",
    ),
    AccuracyRow(
        "frequency response", 1e-11, "against the static deflection of the arm and its joint", _static_deflection,
        "tests/analysis/test_frequency_response.py",
    ),
    AccuracyRow(
        "growth rates, Floquet exponents", 1e-7, "Mathieu's equation against plain integration over a period", _growth,
        "tests/solvers/test_floquet.py",
    ),
    AccuracyRow(
        "boundaries by multiple scales, order 1, depth 0.1", 3e-3, "against Mathieu's characteristic values",
        lambda: _tongue(1), "tests/analysis/test_stability.py",
    ),
    AccuracyRow(
        "boundaries by multiple scales, order 2, depth 0.1", 3e-4, "against Mathieu's characteristic values",
        lambda: _tongue(2), "tests/analysis/test_stability.py",
    ),
    AccuracyRow(
        "backbones", 1e-8, "Duffing's oscillator against its elliptic integral; each answer has its own estimates",
        _duffing, "tests/analysis/test_backbone.py",
    ),
    AccuracyRow(
        "input shapers: what is left of the mode", 1e-10, "a shaped move over a plain one", _shaped,
        "tests/analysis/test_shaping.py",
    ),
    AccuracyRow(
        "identified stiffnesses, exact frequencies given", 1e-7, "the stiffnesses the frequencies were made with",
        _identified, "tests/analysis/test_identification.py",
    ),
)  # fmt: skip
"""Rows of the page on accuracy."""


def accuracy_table() -> str:
    """Measure everything and return it as a table in Markdown."""
    lines = ["| quantity | stated | measured | how; where more is tested |", "| --- | --- | --- | --- |"]
    for row in ACCURACY:
        measured = f"{row.measure():.0e}"
        lines.append(f"| {row.quantity} | {row.stated:.0e} | {measured} | {row.how}; `{row.test.rpartition('/')[2]}` |")
    return "\n".join(lines) + "\n"
