"""A stability chart against one solve_ivp a point, in one run.

Run it as ``python -m tests.benchmarks.stability``. It prints ratios; nothing is asserted but agreement. solve_ivp is
timed on random points of the chart and scaled up, once with its default method and tolerances and once as accurate
as the chart.
"""

from time import perf_counter

import numpy as np
from scipy.integrate import solve_ivp

import cra_sym as cra
from cra_sym.kernels import has_compiler

SIDE, MODES, SAMPLE = 200, 3, 40
ACCURATE = {"method": "DOP853", "rtol": 1e-6, "atol": 1e-8}


def chart(arm):
    """Return the frequencies and the sizes of the excitation."""
    omega = cra.modal_parameters(arm, MODES).omega
    return np.linspace(omega[0], 2.2 * omega[-1], SIDE), np.linspace(0.0, 0.4, SIDE)


def monodromy(arm, excitation, varpi, epsilon, **options):
    """The monodromy matrix of one point as anyone would write it."""
    omega = cra.modal_parameters(arm, MODES).omega
    ((_, _, power), coupling, *_) = excitation.drives(arm, MODES)[0]

    def rates(time, y):
        q, p = y.reshape(2, MODES, 2 * MODES)
        stiffness = np.diag(omega**2) + epsilon * varpi**power * np.cos(varpi * time) * coupling
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


def measured() -> dict[str, dict[str, float]]:
    """Time the chart with NumPy, compiled, and by solve_ivp, for a fluctuating joint; return milliseconds a point."""
    arm, excitation = cra.Arm.nominal().replace(k_t=1e3), cra.JointStiffness()
    varpi, epsilon = chart(arm)
    rng = np.random.default_rng(1)
    points = [(varpi[i], epsilon[k]) for i, k in rng.integers(0, SIDE, (SAMPLE, 2))]
    exact = np.array([float(cra.growth_rate(arm, excitation, *p, MODES, tolerance=1e-12)) for p in points])
    rows, results = {}, {}
    for name, options in (("solve_ivp, default", {}), ("solve_ivp, as accurate", ACCURATE)):
        seconds, rates = timed(lambda o=options: [one_growth_rate(arm, excitation, *p, **o) for p in points], repeat=1)
        rows[name] = {"ms a point": 1e3 * seconds / SAMPLE, "error 1/s": float(np.abs(rates - exact).max())}
    for backend in ("numpy", "compiled") if has_compiler() else ("numpy",):

        def run(backend=backend):
            return cra.growth_rate(arm, excitation, varpi, epsilon[:, None], MODES, backend=backend)

        run()
        seconds, results[backend] = timed(run)
        at = [results[backend][np.searchsorted(epsilon, e), np.searchsorted(varpi, v)] for v, e in points]
        error = float(np.abs(np.array(at) - exact).max())
        rows[f"cra_sym, {backend}"] = {"ms a point": 1e3 * seconds / SIDE**2, "error 1/s": error}
    for rates in results.values():
        assert np.allclose(rates, results["numpy"], atol=1e-4)  # at a boundary the error is like the root of the maps'
    fastest = min(row["ms a point"] for row in rows.values())
    return {name: {**row, "times as long": row["ms a point"] / fastest} for name, row in rows.items()}


def main() -> None:
    """Print the table."""
    print(f"{SIDE} x {SIDE} chart, {MODES} modes")
    for name, row in measured().items():
        print(f"{name:24} {row['ms a point']:10.4f} ms a point, {row['times as long']:8.1f} times as long")


if __name__ == "__main__":
    main()
