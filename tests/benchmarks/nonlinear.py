"""A chart of steady-state amplitudes against solve_ivp to the steady state at some of its points, in one run.

Run it as ``python -m tests.benchmarks.nonlinear``. It prints ratios of processor times; nothing is asserted but
agreement.
"""

from __future__ import annotations

from time import process_time

import numpy as np
from scipy.integrate import solve_ivp

import cra_sym as cra
from cra_sym.figures.nonlinear import cubic_joint

SIDE, MODES, ZETA, PERIODS, CHECKED = 40, 3, 5e-3, 250, 3
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


def measured(side: int = SIDE) -> dict[str, float]:
    """Compute the chart and follow some points; return processor times and their ratio."""
    arm = cra.Arm.nominal().replace(k_t=1e3)
    system = cubic_joint(arm, 1e9, ZETA)
    lower, upper = cra.stability_boundary(arm, EXCITATION, 0.4, (2, 2))
    frequency = np.linspace(float(2 * lower - upper), float(2 * upper - lower), side)
    options = {"excitation": EXCITATION, "modes": MODES, "period": 2}
    cra.steady_states(system, frequency[:2], epsilon=0.1, **options)  # derives, and finds the modes
    start = process_time()
    chart = cra.steady_states(system, frequency, epsilon=np.linspace(0.05, 0.4, side), **options)
    ours = (process_time() - start) / side**2
    stable = [max((s for s in here if s.stable), key=lambda s: s.amplitude) for row in chart for here in row]
    vibrating = [state for state in stable if state.amplitude > 0]
    theirs, worst = [], 0.0
    for number in np.linspace(0, len(vibrating) - 1, CHECKED).round().astype(int):
        start = process_time()
        reached = settled(system, vibrating[number])
        theirs.append(process_time() - start)
        worst = max(worst, abs(reached / vibrating[number].amplitude - 1))
    assert worst < 1e-3, worst  # what is left of the transient
    return {
        "points": side**2,
        "answers": sum(len(here) for row in chart for here in row),
        "points without a stable answer": side**2 - len(stable),
        "processor ms a point": 1e3 * ours,
        "solve_ivp, processor s a point": float(np.mean(theirs)),
        "ratio": float(np.mean(theirs) / ours),
    }


if __name__ == "__main__":
    print(measured())
