"""Replacements of the placeholders in the templates for lines with one wave number: sizes and argument lists."""

from __future__ import annotations

from collections.abc import Mapping

from cra_sym.kernels import Kernel
from cra_sym.solvers import one_wave, one_wave_shapes
from cra_sym.solvers.one_wave import Layout
from cra_sym.solvers.one_wave_shapes import ShapeTable

__all__ = ["MODAL", "SPECTRUM", "modal_marks", "spectrum_marks"]

SPECTRUM = ("coefficients", "power_series", "basis", "basis_near", "chain", "derivatives")
"""Placeholders for functions in the template of the spectrum."""
MODAL = (
    "polynomials", "tip_near", "amplitudes_far", "tip_far", "invariant_near", "invariant_far", "prepared",
    "end_state", "generalised_mass", "rows", "rates", "rigid_body", "leading",
)  # fmt: skip
"""Placeholders for functions in the template of the modes; for a beam there is ``tip_rows`` too."""

_POWER = {1: "lam * lam", 2: "(lam * lam) * (lam * lam)"}
_ROOT = {1: "np.sqrt(z)", 2: "np.sqrt(np.sqrt(z))"}
_HELPERS = {"k": "_stiff", "m": "_heavy", "km": "_both"}


def _groups(layout: Layout) -> dict[tuple[int, str], str]:
    return {group: f"group_{i}" for i, group in enumerate(layout.groups)}


def _prepare(layout: Layout, array: str) -> str:
    """Return the statements that fill in the parameters of a lane from its groups."""
    groups, row, found = _groups(layout), 0, []
    for channel, kind in enumerate(layout.kinds):
        if kind in _HELPERS:
            targets = ", ".join(f"{array}[{row + j}, lane]" for j in range(len(kind) + 1))
            given = ", ".join(f"{groups[channel, letter]}[i]" for letter in kind)
            found.append(f"{targets} = {_HELPERS[kind]}({given})")
            row += len(kind) + 1
    return "; ".join(found)


def _rigid_body_modes(layout: Layout) -> str:
    """Return the number of rigid-body modes of a lane, as `Layout.rigid_body_modes` finds it."""
    groups, n = _groups(layout), layout.n

    def resisted(channel: int) -> str:
        group = groups.get((channel, "k"))
        return f"({group}[i] > 0.0)" if group else str(int(layout.kinds[channel] == "h"))

    turns = f" + (({resisted(1)} | {resisted(3)}) > 0)" if n == 2 else ""
    return f"{n} - min({n}, 0 + {resisted(0)} + {resisted(n)}{turns})"


def _count(layout: Layout) -> str:
    """Return the statements that follow the count from link to link."""
    found = []
    for link, change in enumerate(layout.changes, start=1):
        text = str(change)
        if isinstance(change, tuple):
            text = f"-1 if pairs[{change[0]}, lane] > z * pairs[{change[1]}, lane] else 1"
        found.append(f"number = _linked(number, link_{link}, {text})")
    return "; ".join(found)


def _rows(array: str, names: list[str], start: int = 0) -> dict[str, str]:
    return {name: f"{array}[{start + i}, lane]" for i, name in enumerate(names)}


def _parameters(layout: Layout) -> list[str]:
    return [f"{letter}_{channel}" for channel, letter in layout.parameters]


def _listed(names: list[str]) -> str:
    return ", ".join(names)


def spectrum_marks(layout: Layout, functions: Mapping[str, Kernel]) -> dict[str, object]:
    """Return the replacements of the placeholders in `cra_sym.solvers.spectrum_lanes`."""
    n = layout.n
    basis = list(functions["chain"].arguments[len(layout.parameters) + 1 :])
    coefficients, terms = (len(functions[name].layout) for name in ("coefficients", "power_series"))
    links = [f"link_{i}" for i in range(len(layout.changes) + 1)]
    pairs = _listed([f"pairs[{i}, lane]" for i in range(len(layout.parameters))])
    return {
        "NEAR": one_wave.NEAR[n],
        "MOST_NEAR": layout.most_near,
        "COEFFICIENTS": coefficients,
        "TERMS": terms,
        "PARAMETERS": len(layout.parameters),
        "GROUPS": _listed(list(_groups(layout).values())),
        "BASIS": _listed(basis),
        "BASIS_NEAR": _listed([f"{name}_near" for name in basis]),
        "BASIS_SIZE": len(basis),
        "ROOT": _ROOT[n],
        "POWER": _POWER[n],
        "PREPARE": _prepare(layout, "pairs"),
        "RIGID_BODY_MODES": _rigid_body_modes(layout),
        "OF_COEFFICIENTS": pairs,
        "OF_POWER_SERIES": _listed([f"k[{i}, lane]" for i in range(coefficients)]),
        "OF_CHAIN": _listed([pairs, "z", *basis]),
        "OF_DERIVATIVES": _listed([*(f"k[row + {i}, lane]" for i in range(coefficients)), "z", *basis]),
        "LINKS": _listed(links),
        "LAST_LINK": links[-1],
        "COUNT": _count(layout),
    }


def modal_marks(layout: ShapeTable, functions: Mapping[str, Kernel]) -> dict[str, object]:
    """Return the replacements of the placeholders in `cra_sym.solvers.modal_lanes`."""
    n = layout.n
    left, waves = ["alpha", "beta"][:n], ["A", "B", "C", "D"][: 2 * n]
    krylov, raw = ([f"{name}{i}" for i in range(2 * n)] for name in ("k", "phi_"))
    end = [f"{name}_{j}" for name in "qp" for j in range(n)]
    end += [f"a_{n + j}" for j, kind in enumerate(layout.structure[1]) if "k" in kind]
    own = [n + j for j, kind in enumerate(layout.structure[1]) if kind == "m"]
    springs = [layout.groups[i][0] for i in layout.springs]
    given = [*_parameters(layout), *(f"mu_{layout.groups[i][0]}" for i in layout.inertias)]
    prepared = [*(f"light_{i}" for i in own), *(f"g_{i}" for i in springs)]
    names = {"cos": "cosine", "sin": "sine", "lamda": "lam"} | _rows("line", given + prepared)
    names |= {name: f"q_{i - n}" for name, i in zip(("tip", "slope"), own, strict=False)}
    both = [i for i, kind in enumerate(layout.kinds) if kind == "km"]
    table = [f"{name}_{j}" for name in ("p", "q") for j in range(n)] + [""]
    table += [f"{name}_{j}" for name in ("ql", "pl") for j in range(n)] + [""] * 2 * n
    table += [f"e_{i}" for i in springs] + [f"f_{i}" for i in both]

    def call(name: str, meaning: Mapping[str, str] = names) -> str:
        return _listed([meaning.get(argument, argument) for argument in functions[name].arguments])

    targets = [names[name] for name in prepared]
    still = [f"{x} = rigid[{n + j}] if still else {x}" for j, x in enumerate(left)]
    still.append(f"{raw[0]} = {'rigid[0] + rigid[1]' if n == 2 else 'rigid[0]'} if still else {raw[0]}")
    still += [f"{x} = {f'rigid[{j}]' if j < n else '0.0'} if still else {x}" for j, x in enumerate(raw) if j]
    inertias = _prepare(layout, "line")
    for i in layout.inertias:
        inertias += f"; {names[f'mu_{layout.groups[i][0]}']} = group_{i}[i]"
    marks: dict[str, object] = {name.upper(): call(name) for name in MODAL if name not in ("polynomials", "prepared")}
    return marks | {
        "NEAR": one_wave_shapes.NEAR[n],
        "FIRST": layout.waves.start,
        "MOMENTUM": layout.momentum,
        "WAVES_SIZE": 2 * n,
        "RATES_FROM": layout.size,
        "ROWS_SIZE": layout.by_inertias.stop,
        "LINE_SIZE": len(given) + len(prepared),
        "GROUPS": _listed(list(_groups(layout).values())),
        "PREPARE": inertias,
        "PREPARED": f"{_listed(targets)} = prepared({call('prepared')})" + ("[0]" if len(targets) == 1 else "")
        if targets
        else "line[0, lane] = line[0, lane]",
        "POWER": _POWER[n],
        "FREQUENCY": {1: "lam", 2: "lam * lam"}[n],
        "LEFT": _listed(left),
        "WAVES": _listed(waves),
        "RAW": _listed(raw),
        "KRYLOV": _listed(krylov),
        "END": _listed(end),
        "AMPLITUDES_NEAR": f"_amplitudes_near(tip_rows({call('tip_rows')}))" if n == 2 else "1.0",
        "STILL": "; ".join(still),
        "RIGID_MASS": 2 * n,
        "RATES": call("rates", names | _rows("w", table)),
    }
