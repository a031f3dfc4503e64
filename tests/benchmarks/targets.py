"""What the package set out to reach, each a ratio within one run, beside what the run says."""

from __future__ import annotations

from typing import Any

from tests.benchmarks.calls import KERNEL, LEAST_LANES, PEERS
from tests.benchmarks.frequencies import LOOP
from tests.benchmarks.waves import ARM_AS_MODEL, PUBLIC, PUBLIC_NUMPY, STRING

ONE, NUMPY, FIND = "cra_sym, compiled, 1 thread", "cra_sym, NumPy", "scipy elementwise.find_root"


def rows(report: dict[str, Any]) -> list[dict[str, Any]]:
    """Return what was aimed at, what was measured, and whether it is met."""
    found: list[dict[str, Any]] = []

    def add(what: str, measured: float | None, target: float, *, least: bool = True) -> None:
        if measured is not None:
            met = measured >= target if least else measured <= target
            sign = "at least" if least else "at most"
            found.append({"what": what, "measured": measured, "target": f"{sign} {target:g}", "met": met})

    for case in report["frequencies"]:
        name, median = f"{case['modes']} modes", {key: row["median"] for key, row in case["rows"].items()}
        several = next((key for key in median if key.startswith("cra_sym, compiled") and key != ONE), None)

        def ratio(slow: str, fast: str | None, median: dict[str, float] = median) -> float | None:
            return median[slow] / median[fast] if slow in median and fast in median else None

        add(f"{name}: one thread, times the loop", ratio(LOOP, ONE), 200)
        add(f"{name}: {str(several)[19:]}, times the loop", ratio(LOOP, several), 400)
        add(f"{name}: one thread, times find_root", ratio(FIND, ONE), 15)
        add(f"{name}: NumPy alone, times the loop", ratio(LOOP, NUMPY), 25)
        twins = [key for key in median if key.startswith("exported C") and key.endswith("1 thread")]
        for twin in twins:
            add(f"{name}: one thread over {twin.removesuffix(', 1 thread')}", ratio(ONE, twin), 1.3, least=False)
        for quantity in ("modal_parameters", "sensitivities"):
            over = case["rows"][quantity]["times the frequencies"]
            add(f"{name}: {quantity} over frequencies", over, 2.0, least=False)
        for arms, value in case["evaluations a root"].items():
            add(f"{name}: evaluations a root, {arms}", value, 2.5, least=False)
    for family, routes in report["waves"].items():
        for route, least in ((PUBLIC_NUMPY, 15), (PUBLIC, 150)):
            add(
                f"{family}: {route}, {routes[route]['sets']} sets, times the loop",
                routes[route]["times the loop"],
                least,
            )
    for model, most in ((ARM_AS_MODEL, 1.3), (STRING, 2.0)):
        add(f"{model} over the arm", report["models"][model]["times the arm"], most, least=False)
    kernel = report["kernel"]
    if "compiled, kernel" in kernel and "C, branch-free functions" in kernel:
        add("one evaluation over C", kernel["compiled, kernel"]["ratio to C"], 1.6, least=False)
    for case in report["calls"]["runs"]:
        for number, routes in case["lanes"].items():
            if int(number) >= LEAST_LANES:
                others = [row["median"] for name, row in routes.items() if name in PEERS]
                ratio_to_best = routes[KERNEL]["median"] / min(others) if others else None
                add(
                    f"a kernel's call over its best peer, {number} lanes, {case['name']}", ratio_to_best, 1, least=False
                )
        add(f"overhead of a compiled call, us, {case['name']}", case["overhead us"], 30, least=False)
    for name, case in report["along x"].items():
        add(f"a batch of {name} beams, times the dynamic stiffness", case["times"], 1000)
    for name, ratio_to_arm in report["charts"].items():
        if not name.startswith("the arm"):
            add(f"a chart: {name}, times the arm's", ratio_to_arm, 1.5, least=False)
    for name, over in report["sensitivities"].items():
        add(f"sensitivities over frequencies, 300 sets: {name}", over, 2.0, least=False)
    practice = report["in practice"]
    add("a record of 1e6 samples, 5 modes, times lsim", practice["records"]["times as fast"], 2)
    add("a sweep into a store over Zarr alone", practice["stores"]["times zarr"], 2.0, least=False)
    add("moves with slip, times solve_ivp with events", report["slip"]["times as fast"], 500)
    for what, case in report["nonlinear"].items():
        add(f"{what}, times solve_ivp", case["times as fast"], 200 if "backbone" in what else 1000)
    cold = {key: row["wall s"] for key, row in report["cold start"].items()}
    add("import, s more than NumPy's", cold["import cra_sym and numpy"] - cold["import numpy"], 0.3, least=False)
    for key, seconds in cold.items():
        if key == "one arm, stored" or ("nothing stored" in key and "NumPy alone" not in key):
            add(f"{key}, s", seconds, 8.0 if "nothing" in key else 1.0, least=False)
    return found
