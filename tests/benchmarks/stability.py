"""A stability chart against one solve_ivp a point, in one run.

Run it as ``python tests/benchmarks/stability.py``. It prints ratios; nothing is asserted but agreement. solve_ivp is
timed on random points of the chart and scaled up, once with its default method and tolerances and once as accurate
as the chart.
"""

from time import perf_counter

import numpy as np
from scipy.integrate import solve_ivp

import cra_sym as cra

SIDE, MODES, SAMPLE = 200, 3, 40
ACCURATE = {"method": "DOP853", "rtol": 1e-6, "atol": 1e-8}


def chart(arm):
    """Return the frequencies and the sizes of the excitation."""
    omega = cra.modal_parameters(arm, MODES).omega
    return np.linspace(omega[0], 2.2 * omega[-1], SIDE), np.linspace(0.0, 0.4, SIDE)


def monodromy(arm, excitation, varpi, epsilon, **options):
    """The monodromy matrix of one point as anyone would write it."""
    modal = cra.modal_parameters(arm, MODES)
    omega, coupling = modal.omega, excitation.coupling(modal, varpi)

    def rates(time, y):
        q, p = y.reshape(2, MODES, 2 * MODES)
        stiffness = np.diag(omega**2) + epsilon * np.cos(varpi * time) * coupling
        return np.concatenate([p, -stiffness @ q]).ravel()

    return solve_ivp(rates, (0, 2 * np.pi / varpi), np.eye(2 * MODES).ravel(), **options).y[:, -1]


def one_growth_rate(arm, excitation, varpi, epsilon, **options):
    """The growth rate of one point from its monodromy matrix."""
    multipliers = np.linalg.eigvals(monodromy(arm, excitation, varpi, epsilon, **options).reshape(2 * MODES, -1))
    return max(0.0, np.log(np.abs(multipliers).max()) * varpi / (2 * np.pi))


def timed(function, repeat=3):
    """Return the best time and the result."""
    times = []
    for _ in range(repeat):
        start = perf_counter()
        result = function()
        times.append(perf_counter() - start)
    return min(times), result


def main():
    """Time the chart with NumPy, compiled, and by solve_ivp, for a fluctuating joint."""
    arm, excitation = cra.Arm.nominal().replace(k_t=1e3), cra.JointStiffness()
    varpi, epsilon = chart(arm)
    rng = np.random.default_rng(1)
    points = [(varpi[i], epsilon[k]) for i, k in rng.integers(0, SIDE, (SAMPLE, 2))]
    reference = {}
    for name, options in (("default", {}), ("accurate", ACCURATE)):
        seconds, rates = timed(lambda o=options: [one_growth_rate(arm, excitation, *p, **o) for p in points], repeat=1)
        reference[name] = seconds / SAMPLE * SIDE**2
        exact = np.array([float(cra.growth_rate(arm, excitation, *p, MODES, tolerance=1e-12)) for p in points])
        print(f"solve_ivp, {name}: largest error of a growth rate {np.abs(rates - exact).max():.1e} 1/s")
    results = {}
    for backend in ("numpy", "numba"):

        def run(backend=backend):
            return cra.growth_rate(arm, excitation, varpi, epsilon[:, None], MODES, tolerance=1e-7, backend=backend)

        run()
        seconds, results[backend] = timed(run)
        ratios = ", ".join(
            f"{total / seconds:.0f} times faster than solve_ivp ({name})" for name, total in reference.items()
        )
        print(f"{SIDE} x {SIDE} chart, {MODES} modes, {backend}: {ratios}")
        at = [results[backend][np.searchsorted(epsilon, e), np.searchsorted(varpi, v)] for v, e in points]
        print(f"    largest error of a growth rate {np.abs(np.array(at) - exact).max():.1e} 1/s")
    assert np.allclose(results["numpy"], results["numba"], atol=1e-8)


if __name__ == "__main__":
    main()
