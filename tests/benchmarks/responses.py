"""Long responses: the closed form on a uniform grid against NumPy broadcasting and against solve_ivp, in one run.

Run it as ``python tests/benchmarks/responses.py``. It prints ratios; nothing is asserted but agreement.
"""

from time import perf_counter

import numpy as np
from scipy.integrate import solve_ivp

import cra_sym as cra
from cra_sym import Arm, BaseMotion

SETS, TIMES, MODES, SLOW = 1000, 10_000, 5, 2


def broadcast(parameters, v, a, B, varpi, psi, t):
    """The same closed form as anyone would write it, off resonance: one sine and cosine a set, mode and time."""
    w, G, tip = (
        value[..., None] for value in (parameters.omega, parameters.participation, parameters.tip_displacement)
    )
    v, a, B, varpi, psi = (np.asarray(value)[..., None, None] for value in (v, a, B, varpi, psi))
    sine, cosine = np.sin(w * t), np.cos(w * t)
    strike = -(v + B * varpi * np.cos(psi)) * sine / w - a * (1 - cosine) / w**2
    driven = np.sin(varpi * t + psi) - np.sin(psi) * cosine - varpi / w * np.cos(psi) * sine
    return (tip * G * (strike + B * varpi**2 * driven / (w**2 - varpi**2))).sum(-2)


def integrated(parameters, v, a, B, varpi, psi, t):
    """solve_ivp at the tolerance that a plot needs."""
    w, G, tip = (value[0] for value in (parameters.omega, parameters.participation, parameters.tip_displacement))

    def rates(time, y):
        push = -G * (a - B * varpi**2 * np.sin(varpi * time + psi))
        return np.concatenate([y[MODES:], push - w**2 * y[:MODES]])

    start = np.concatenate([np.zeros(MODES), -G * (v + B * varpi * np.cos(psi))])
    solution = solve_ivp(rates, (0, t[-1]), start, t_eval=t, method="DOP853", rtol=1e-6, atol=1e-9)
    return tip @ solution.y[:MODES]


def timed(function, *arguments, repeat=1):
    """Return the best time and the result."""
    times = []
    for _ in range(repeat):
        start = perf_counter()
        result = function(*arguments)
        times.append(perf_counter() - start)
    return min(times), result


def measured() -> dict[str, dict[str, float]]:
    """Time each route and hold its numbers against ours."""
    rng = np.random.default_rng(1)
    arms = Arm.nominal().replace(k_t=10 ** rng.uniform(2, 6, SETS))
    fields = 0.1, 0.2, 1e-3, rng.uniform(5.0, 12.0, SETS), rng.uniform(0, 2 * np.pi, SETS)
    t = np.linspace(0, 2, TIMES)
    motion = BaseMotion(*fields)
    cra.tip_response(arms, motion, t, MODES)
    ours, found = timed(cra.tip_response, arms, motion, t, MODES, repeat=5)
    part = 50  # sets; broadcasting all at once would need gigabytes
    few = cra.modal_parameters(Arm.nominal().replace(k_t=arms.k_t[:part]), MODES)
    cut = [np.broadcast_to(value, SETS)[:part] for value in fields]
    numpy_time, plain = timed(broadcast, few, *cut, t, repeat=3)
    ivp_time, reference = 0.0, []
    for i in range(SLOW):
        one = cra.modal_parameters(Arm.nominal().replace(k_t=arms.k_t[i : i + 1]), MODES)
        seconds, values = timed(integrated, one, *(value[i] for value in cut), t)
        ivp_time, reference = ivp_time + seconds / SLOW, [*reference, values]
    numpy_time *= SETS / part
    ivp_time *= SETS
    peak = np.abs(found).max()
    assert np.abs(found[:part] - plain).max() < 1e-11 * peak
    assert np.abs(found[:SLOW] - reference).max() < 1e-3 * peak
    return {
        name: {"ns a sample": 1e9 * seconds / SETS / TIMES, "times as long": seconds / ours}
        for name, seconds in (
            ("closed form on the grid", ours),
            ("NumPy broadcasting", numpy_time),
            ("solve_ivp", ivp_time),
        )
    }


def main() -> None:
    """Print the table."""
    print(f"{SETS} parameter sets x {TIMES} times, {MODES} modes, frequencies included")
    for name, row in measured().items():
        print(f"{name:24} {row['ns a sample']:10.1f} ns a sample, {row['times as long']:6.0f} times as long")


if __name__ == "__main__":
    main()
