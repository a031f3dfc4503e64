"""A chart of steady-state amplitudes against solve_ivp to the steady state, and a backbone against shooting with it.

Run it as ``python -m tests.benchmarks.nonlinear`` on a quiet machine. It prints ratios of times by the wall clock;
nothing is asserted but agreement.
"""

from __future__ import annotations

from statistics import median
from time import perf_counter

import numpy as np
from scipy.integrate import solve_ivp

import cra_sym as cra
from cra_sym.figures.nonlinear import cubic_joint
from cra_sym.solvers.modal_polynomials import ModalPolynomials
from tests.nonlinear_models import sprung

SIDE, MODES, ZETA, PERIODS, CHECKED = 40, 3, 5e-3, 250, 3
BACKBONE = {"modes": 12, "harmonics": 9, "points": 200}
SHOT = (60, 90)  # points of the backbone that are shot too
EXCITATION = cra.JointStiffness(k_t=1.0)


def settled(system: cra.System, state: cra.SteadyState) -> float:
    """The peak at the tip after many periods from near an answer, as anyone would follow the modal equations."""
    polynomials = cra.nonlinear_modal_equations(system, MODES).polynomials
    (drive,) = EXCITATION.drives(system, MODES)
    coupling, tip = drive.stiffness, system.modes(MODES).displacement(1, 0)
    omega, damping = polynomials.omega, polynomials.damping
    (cubic,) = (term.tensor for term in polynomials.energies)
    varpi, size = state.angular_frequency, state.epsilon

    def rates(t, y):
        q, u = y[:MODES], y[MODES:]
        force = 4 * np.einsum("ijkl,j,k,l", cubic, q, q, q)
        pulse = size * np.cos(varpi * t)
        return np.concatenate([u, force - omega**2 * q - damping @ u - pulse * (coupling @ q)])

    half = state.coefficients.shape[1] // 2
    start = np.concatenate([0.9 * state.coefficients[:, : half + 1].sum(axis=1), np.zeros(MODES)])
    start[MODES:] = 0.9 * (state.coefficients[:, half + 1 :] * np.arange(1, half + 1)).sum(axis=1) * varpi / 2
    period = 4 * np.pi / varpi
    last = np.linspace((PERIODS - 1) * period, PERIODS * period, 200)
    scale = np.abs(start).max()
    run = solve_ivp(rates, (0, last[-1]), start, rtol=1e-7, atol=1e-10 * scale, t_eval=last, method="DOP853")
    return float(np.abs(tip @ run.y[:MODES]).max())


def chart(side: int = SIDE) -> dict[str, float]:
    """Compute the chart and follow some points; return times by the wall clock and their ratio."""
    arm = cra.Arm.nominal().replace(k_t=1e3)
    system = cubic_joint(arm, 1e9, ZETA)
    lower, upper = cra.stability_boundary(arm, EXCITATION, 0.4, (2, 2))
    frequency = np.linspace(float(2 * lower - upper), float(2 * upper - lower), side)
    options = {"excitation": EXCITATION, "modes": MODES, "period": 2}
    cra.steady_states(system, frequency[:2], epsilon=0.1, **options)  # derives, and finds the modes
    ours, theirs, worst, sizes = [], [], 0.0, np.linspace(0.05, 0.4, side)
    start = perf_counter()
    states = cra.steady_states(system, frequency, epsilon=sizes, **options)
    ours.append(perf_counter() - start)
    stable = [max((s for s in here if s.stable), key=lambda s: s.amplitude) for row in states for here in row]
    vibrating = [state for state in stable if state.amplitude > 0]
    for number in np.linspace(0, len(vibrating) - 1, CHECKED).round().astype(int):  # in turn: a slow moment hits both
        start = perf_counter()
        reached = settled(system, vibrating[number])
        theirs.append(perf_counter() - start)
        start = perf_counter()
        cra.steady_states(system, frequency, epsilon=sizes, **options)
        ours.append(perf_counter() - start)
        worst = max(worst, abs(reached / vibrating[number].amplitude - 1))
    assert worst < 1e-3, worst  # what is left of the transient
    return {
        "points": side**2,
        "answers": sum(len(here) for row in states for here in row),
        "points without a stable answer": side**2 - len(stable),
        "ms a point": 1e3 * median(ours) / side**2,
        "solve_ivp, s a point": float(np.mean(theirs)),
        "times as fast": float(np.mean(theirs)) * side**2 / median(ours),
    }


def shot(polynomials: ModalPolynomials, start: np.ndarray, frequency: float) -> tuple[float, bool]:
    """Frequency and stability of the free motion of a given energy near a start at rest, by shooting.

    The variation that Newton's method needs is the monodromy matrix, which tells the stability too.
    """
    n, omega = polynomials.modes, polynomials.omega
    (cubic,) = (term.tensor for term in polynomials.energies)

    def rates(_, y):
        q, near = y[:n], y[2 * n :].reshape(2 * n, 2 * n)
        slope = cubic @ q @ q
        stiff = 12 * slope - np.diag(omega**2)
        turned = np.concatenate([near[n:], stiff @ near[:n]])
        return np.concatenate([y[n : 2 * n], 4 * slope @ q - omega**2 * q, turned.ravel()])

    y, period = np.append(start, np.zeros(n)), 2 * np.pi / frequency
    level, phase = polynomials.potential(start), np.append(np.zeros(n), start)
    for _ in range(8):
        scale = 1e-9 * np.abs(y).max()
        run = solve_ivp(rates, (0, period), np.append(y, np.eye(2 * n)), method="DOP853", rtol=1e-8, atol=scale)
        end, monodromy = run.y[: 2 * n, -1], run.y[2 * n :, -1].reshape(2 * n, 2 * n)
        pull = -rates(0, np.append(y, monodromy))[n : 2 * n]
        gap = [*(end - y), phase @ y, polynomials.potential(y[:n]) + y[n:] @ y[n:] / 2 - level]
        matrix = np.zeros((2 * n + 2, 2 * n + 1))
        matrix[: 2 * n, : 2 * n], matrix[: 2 * n, -1] = monodromy - np.eye(2 * n), rates(0, run.y[:, -1])[: 2 * n]
        matrix[-2, : 2 * n], matrix[-1, : 2 * n] = phase, np.append(pull, y[n:])
        step = np.linalg.lstsq(matrix, np.array(gap), rcond=None)[0]
        y, period = y - step[:-1], period - step[-1]
        if abs(step[-1]) < 1e-7 * period:
            break
    multipliers = np.linalg.eigvals(monodromy)
    others = multipliers[np.abs(multipliers - 1).argsort()[2:]]
    return 2 * np.pi / period, bool(np.abs(others).max() < 1 + 1e-4)


def curve() -> dict[str, float]:
    """Follow a backbone and shoot some of its points from their neighbours; return times and their ratio."""
    cra.backbone(sprung(), **{**BACKBONE, "points": 2})  # derives, and finds the modes
    start = perf_counter()
    found = cra.backbone(sprung(), **BACKBONE)
    ours = perf_counter() - start
    polynomials = cra.nonlinear_modal_equations(sprung(), BACKBONE["modes"]).polynomials
    theirs, worst = [], 0.0
    first = found.coefficients.sum(axis=-1)  # all there is at the instant of rest
    for point in SHOT:
        guess = 2 * first[point - 1] - first[point - 2]
        guess *= np.sqrt(found.energy[point] / polynomials.potential(guess))
        start = perf_counter()
        frequency, stable = shot(polynomials, guess, found.angular_frequency[point - 1])
        theirs.append(perf_counter() - start)
        worst = max(worst, float(abs(frequency / found.angular_frequency[point] - 1)))
        assert stable == found.stable[point]
    assert worst < 1e-3, worst  # what more harmonics would change
    return {
        "points": BACKBONE["points"],
        "s": ours,
        "shooting with solve_ivp, s a point": float(np.mean(theirs)),
        "differs by": worst,
        "times as fast": float(np.mean(theirs)) * BACKBONE["points"] / ours,
    }


def measured(quick: bool) -> dict[str, dict[str, float]]:
    """Measure both."""
    return {"a chart of steady states": chart(10 if quick else SIDE), "a backbone": curve()}


if __name__ == "__main__":
    print(measured(quick=False))
