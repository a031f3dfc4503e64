"""Rates of the coefficients of a model by its parameters, for sensitivities."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cra_sym.codegen.model_text import ModelText

__all__ = ["rate_functions"]


def rate_functions(written: ModelText) -> str:
    """Return the functions that give a parameter by number, and the rates of the coefficients by it."""
    places = written.waves.places
    names = list(written.names.values())
    value = ["def _parameter(parameters: Parameters, number: int) -> float:",
             *(f"    if number == {at}:\n        return parameters.{name}" for at, name in enumerate(names[:-1])),
             f"    return parameters.{names[-1]}"]  # fmt: skip
    ends, links = written.form.structure.moving**2, written.form.structure.links
    offsets = {
        "stiffness": 0,
        "mass": ends,
        "ties": 2 * ends,
        "link_stiffness": 3 * ends,
        "link_mass": 3 * ends + links,
        "stretch": 3 * ends + 2 * links,
    }
    texts: list[str] = []
    lines: list[str] = []
    for number, symbol in enumerate(written.names):
        entries = {f"k_rate[{places[at]}]": e.diff(symbol) for at, e in written.entries.items() if at in places}
        for target, entry in written.ends.items():
            name, at = target[:-1].split("[")
            if name not in offsets:
                continue  # motions carried by coordinates have no energy of their own
            entries[f"end_rate[{offsets[name] + int(at)}]"] = entry.diff(symbol)
        entries = {target: entry for target, entry in entries.items() if entry != 0}
        if not entries:
            continue
        row = f"by_{written.names[symbol]}"
        text, call = written.call(row, list(entries.values()), f"rate_{number}",
                                f"Return how coefficients change with {written.names[symbol]}.")  # fmt: skip
        texts.append(text)
        lines.append(f"{'el' if lines else ''}if number == {number}:")
        lines += [f"    {line}" for line in call]
        lines += [f"    {target} = rate_{number}[{at}]" for at, target in enumerate(entries)]
    head = (
        "def _parameter_rates(\n    parameters: Parameters, number: int, k_rate: Out[Row[float, COEFFICIENTS]],\n"
        "    end_rate: Out[Row[float, END_RATES]]\n) -> None:"
    )
    start = ["for i in range(COEFFICIENTS):", "    k_rate[i] = 0.0"]
    start += ["for i in range(END_RATES):", "    end_rate[i] = 0.0"]
    return "\n\n\n".join([*texts, "\n".join(value), "\n    ".join([head, *start, *lines])])
