"""All benchmarks in one go: ``python -m tests.benchmarks [--quick] [--output DIR]``.

Writes ``results.md``, ``results.json`` and ``results.png``; a run that was there gives the columns of the run before.
Times are medians with quartiles; only ratios within a run say anything.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import matplotlib

from tests.benchmarks import (
    along_x,
    calls,
    charts,
    cold,
    frequencies,
    kernel,
    machine,
    nodes,
    nonlinear,
    records,
    responses,
    slipping,
    stability,
    targets,
    waves,
)

RESULTS = Path(__file__).parent / "results"


def run(quick: bool) -> dict[str, Any]:
    """Measure everything."""
    size, rounds = (20_000, 3) if quick else (1_000_000, 7)
    report: dict[str, Any] = {"quick": quick, "seed": frequencies.SEED, "machine": machine.description()}
    report["floor"] = machine.floor()
    report["kernel"] = kernel.main(1 << 14 if quick else 1 << 16)["table"]
    report["calls"] = calls.measured(calls.SIZES[:2] if quick else calls.SIZES)
    report["frequencies"] = [frequencies.measured(size, 3, rounds), frequencies.measured(size // 3, 10, rounds)]
    report["waves"], report["models"] = waves.measured(size, rounds), waves.models(size, rounds)
    report["growth"] = frequencies.growth(100_000 if quick else 10_000_000)
    report["cold start"] = cold.measured()
    report["responses"], report["stability"] = responses.measured(), stability.measured()
    report["charts"], report["sensitivities"] = charts.costs(), charts.sensitivities()
    report["sweep"] = nodes.measured(40_000 if quick else 4_000_000)
    report["along x"] = along_x.measured(3 if quick else 5)
    report["in practice"], report["slip"] = records.measured(quick), slipping.measured()
    report["nonlinear"] = nonlinear.measured(quick)
    report["targets"] = targets.rows(report)
    return report


def table(report: dict[str, Any], former: dict[str, Any] | None = None) -> str:
    """Return the report as Markdown, with what a former one measured of the same targets."""
    earlier = {} if former is None else former["machine"]
    lines = ["# Benchmarks", "", "| machine | | the run before |", "| --- | --- | --- |"]
    lines += [f"| {name} | {value} | {earlier.get(name, '')} |" for name, value in report["machine"].items()]
    earlier = {} if former is None else former["floor"]
    for name, value in report["floor"].items():
        lines.append(
            f"| {name} | {value:.2f} | {earlier[name]:.2f} |" if name in earlier else f"| {name} | {value:.2f} | |"
        )
    lines += ["", "## Targets", "", "| what | measured | the run before | target | |"]
    lines.append("| --- | --: | --: | --: | --- |")
    before = {} if former is None else {row["what"]: f"{row['measured']:.3g}" for row in former["targets"]}
    for row in report["targets"]:
        met = "met" if row["met"] else "missed"
        what = row["what"]
        lines.append(f"| {what} | {row['measured']:.3g} | {before.get(what, '')} | {row['target']} | {met} |")
    for case in report["frequencies"]:
        lines += ["", f"## {case['modes']} frequencies of an arm", ""]
        lines += [
            "| route | arms | µs a set | quartiles | times the loop | differs by |",
            "| --- | --: " + "| --: " * 4 + "|",
        ]
        for name, row in case["rows"].items():
            differs = f"{row['differs by']:.0e}" if "differs by" in row else ""
            lines.append(
                f"| {name} | {row['arms']} | {row['median']:.3g} | {row['low']:.3g} to {row['high']:.3g} "
                f"| {row['times the loop']:.1f} | {differs} |"
            )
        found = ", ".join(f"{value:.2f} {name}" for name, value in case["evaluations a root"].items())
        widths = ", ".join(f"{name} {bits}" for name, bits in case["C vector bits"].items())
        lines += [
            "",
            f"Evaluations of the determinant a root: {found}. Bits of the registers C multiplies in: {widths}. ",
        ]
        lines[-1] += "'Differs by' is the largest relative difference from ours."
        lines += ["", *(f"- not run: {name}: {why}" for name, why in case["absent"].items())]
    lines += ["", "## 3 frequencies of other Lagrangians", "", *waves.table(report["waves"], report["models"])]
    lines += [
        "",
        "## One evaluation of the determinant",
        "",
        "| route | ns | quartiles | times C |",
        "| --- | --: | --: | --: |",
    ]
    for name, row in report["kernel"].items():
        low, high = row["quartiles ns"]
        lines.append(f"| {name} | {row['median ns']} | {low} to {high} | {row['ratio to C']} |")
    lines += ["", "## Calls of a kernel, the determinant again", "", *calls.table(report["calls"])]
    lines += ["", "## Beams that vary along x, batches of 1000, five modes", ""]
    lines += ["| beam | µs a set | times the dynamic stiffness | differs by |", "| --- | --: | --: | --: |"]
    lines += [
        f"| {name} | {row['us a set']:.3g} | {row['times']:.3g} | {row['differs by']:.0e} |"
        for name, row in report["along x"].items()
    ]
    lines += ["", "## Cold start, a new process", "", "| what | processor s | wall s |", "| --- | --: | --: |"]
    lines += [f"| {name} | {row['processor s']} | {row['wall s']} |" for name, row in report["cold start"].items()]
    for kind, routes in report["growth"].items():
        lines += ["", f"## Growth with {kind}", "", f"| route | {kind} | s | quartiles |", "| --- | --: | --: | --: |"]
        for route, points in routes.items():
            lines += [f"| {route} | {n} | {median:.3g} | {low:.3g} to {high:.3g} |" for n, median, low, high in points]
    for title, unit in (("responses", "ns a sample"), ("stability", "ms a point")):
        lines += ["", f"## {title.capitalize()}", "", f"| route | {unit} | times as long |", "| --- | --: | --: |"]
        lines += [f"| {name} | {row[unit]:.3g} | {row['times as long']:.1f} |" for name, row in report[title].items()]
    if "slip" in report:  # a report of an earlier day has none
        lines += ["", "## A thousand moves of 2 s with an element that slips, against solve_ivp with events", ""]
        lines += ["| what | |", "| --- | --: |", *(f"| {key} | {value:.3g} |" for key, value in report["slip"].items())]
    for name, row in report.get("nonlinear", {}).items():
        lines += ["", f"## {name.capitalize()} against solve_ivp", "", "| what | |", "| --- | --: |"]
        lines += [f"| {key} | {value:.3g} |" for key, value in row.items()]
    lines += ["", "## Records of motion, and stores", "", *records.note(report["in practice"])]
    lines += ["", "## Sweeps", "", nodes.note(report["sweep"])]
    return "\n".join(lines) + "\n"


def picture(report: dict[str, Any], path: Path) -> None:
    """Draw the ratios, and how cost grows."""
    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(13, 4), layout="constrained")
    rows = report["frequencies"][0]["rows"]
    left.barh(list(rows), [row["times the loop"] for row in rows.values()], color="0.4")
    left.set(xscale="log", xlabel="times as fast as the brentq loop, 3 frequencies")
    left.invert_yaxis()
    labels = {"arms": "arms, 3 modes each", "modes": "modes, 300 arms"}
    for axes, (kind, routes) in zip((middle, right), report["growth"].items(), strict=True):
        for (name, points), style in zip(routes.items(), ("o-", "s--"), strict=False):
            axes.loglog([p[0] for p in points], [p[1] for p in points], style, label=name)
        n, median, *_ = points[-1]
        axes.loglog([p[0] for p in points], [median * p[0] / n for p in points], ":", color="0.5", label="proportional")
        axes.set(xlabel=labels[kind], ylabel="time / s")
        axes.legend()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="small sets, for a look")
    parser.add_argument("--output", type=Path, default=RESULTS)
    options = parser.parse_args()
    report = run(options.quick)
    options.output.mkdir(parents=True, exist_ok=True)
    last = options.output / "results.json"
    text = table(report, json.loads(last.read_text(encoding="utf-8")) if last.exists() else None)
    last.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    (options.output / "results.md").write_text(text, encoding="utf-8")
    picture(report, options.output / "results.png")
    print(text)


if __name__ == "__main__":
    main()
