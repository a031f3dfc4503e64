"""Moves with an elastic-slip element: exact events, over a batch, against solve_ivp with events, in one run.

Run it as ``python -m tests.benchmarks.slipping``. It prints ratios of processor times; nothing is asserted but
agreement.
"""

from __future__ import annotations

from time import perf_counter

import numpy as np
from scipy.integrate import solve_ivp

import cra_sym as cra

MOVES, MODES, SECONDS, SLOW = 1000, 5, 2.0, 2
MOVE = cra.BaseMotion.trapezoid(0.3, 0.5, 2.0)


def integrated(omega, zeta, gamma, row, flexibility, stiffness, slip):
    """The tip's modal displacements at the end, as anyone would follow them."""
    k = stiffness / (1 + stiffness * flexibility)
    y, force, state, now, events = np.zeros(2 * MODES), 0.0, 0, 0.0, 0
    knots = [t for t in MOVE.terms[0].knots if 0 < t < SECONDS]
    for end in [*np.unique(knots), SECONDS]:
        along = float(MOVE.acceleration((now + end) / 2))
        while now < end:
            begin, start = row @ y[:MODES], force

            def held(q, state=state, begin=begin, start=start):
                return start + k * (row @ q - begin) if state == 0 else state * slip

            def rates(t, y, along=along, held=held):
                q, u = y[:MODES], y[MODES:]
                return np.concatenate([u, -(omega**2) * q - 2 * zeta * omega * u - gamma * along - row * held(q)])

            if state == 0:
                watched = [lambda t, y, side=side, held=held: slip - side * held(y[:MODES]) for side in (1, -1)]
            else:
                watched = [lambda t, y, state=state: state * (row @ y[MODES:])]
            for event in watched:
                event.terminal, event.direction = True, -1
            run = solve_ivp(rates, (now, end), y, rtol=1e-8, atol=1e-11, events=watched)
            y, now, force = run.y[:, -1], run.t[-1], held(run.y[:MODES, -1])
            if run.status == 1:
                state = (1 if run.t_events[0].size else -1) if state == 0 else 0
                force, events = np.sign(force) * slip, events + 1
    return y[:MODES], events


def measured() -> dict[str, float]:
    """Follow the moves and a few of them by solve_ivp; return times by the wall clock and their ratio."""
    arm = cra.Arm.nominal().replace(k_t=1e3, zeta=0.005)
    joint = cra.BoltedJoint(rest=1e3, roughness=1e-4)
    slipping = joint.on(arm.replace(k_r=np.inf), np.linspace(1.0, 6.0, MOVES))
    cra.tip_response(slipping, MOVE, SECONDS, modes=MODES)  # derives, and finds the modes
    times = []
    for _ in range(3):
        start = perf_counter()
        found = cra.tip_response(slipping, MOVE, SECONDS, modes=MODES)
        times.append((perf_counter() - start) / MOVES)
    ours = float(np.median(times))
    base, elements = slipping.without_hysteresis, slipping.slip_elements(MODES)
    parameters = cra.modal_parameters(base, MODES)
    omega, gamma, tip = parameters.omega, parameters.participation, parameters.tip_displacement
    start, reference, events = perf_counter(), [], 0
    for i in np.linspace(0, MOVES - 1, SLOW, dtype=int):
        q, number = integrated(
            omega[i], 0.005, gamma[i], elements.displacements[i, 0], elements.flexibility[i, 0, 0],
            elements.stiffness[i, 0], elements.slip[i, 0],
        )  # fmt: skip
        reference.append(tip[i] @ q - found[i])
        events += number
    theirs = (perf_counter() - start) / SLOW
    differs = float(np.abs(reference).max() / np.abs(found).max())
    assert differs < 1e-4  # the integrator keeps 1e-8 a step over some thousand steps
    return {
        "ms a move": 1e3 * ours,
        "solve_ivp: ms a move": 1e3 * theirs,
        "events a move": events / SLOW,
        "differs by": differs,
        "times as fast": theirs / ours,
    }


if __name__ == "__main__":
    print(measured())
