"""The reference: every public name, grouped by purpose."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from inspect import cleandoc, getsource, isclass, isfunction, unwrap
from pathlib import Path
from typing import Any

import cra_sym
from cra_sym.cached import cached_property
from cra_sym.files import write_text

__all__ = ["groups", "results", "write_reference"]

# Title of a group and the rooms and modules of the package it comes from; the longest that fits decides.
_GROUPS = {
    "Arms, models and systems": ("arm", "model", "mechanics"),
    "Frequencies and modes": ("analysis", "arm.frequency_parameters"),
    "Motions, forces and responses": (
        "analysis.frequency_response",
        "analysis.residual_gradient",
        "analysis.responses",
        "analysis.residual_vibration",
        "analysis.shaping",
        "analysis.state_space",
        "solvers",
    ),
    "Identification": ("analysis.identification", "analysis.slip_identification"),
    "Parametric stability": (
        "analysis.certified_stability",
        "analysis.floquet",
        "analysis.stability",
        "arm.excitations",
        "model.excitations",
    ),
    "Large amplitudes and slip": (
        "analysis.backbone",
        "analysis.nonlinear",
        "analysis.slip_response",
        "analysis.slow_flow",
        "analysis.steady_states",
        "analysis.response_curves",
        "model.hysteresis",
    ),
    "The paper's equations": ("paper",),
    "Sweeps, code, sliders": ("studies", "kernels", "codegen", "explorer"),
}


# Internal classes, returned by methods that the package calls itself.
_INTERNAL = frozenset({"Distribution", "Domain", "Drive", "Numerics", "Projected", "SlipElements", "StateForm"})


def groups() -> dict[str, list[str]]:
    """Return the public names by the title of their group, each group in the order of the package."""
    names: dict[str, list[str]] = {title: [] for title in _GROUPS}
    for name, home in cra_sym._HOME.items():
        names[_group(home)].append(name)
    return names


def _group(home: str) -> str:
    fits = {
        len(place): title for title, places in _GROUPS.items() for place in places if f"{home}.".startswith(f"{place}.")
    }
    return fits[max(fits)]


def results() -> dict[str, list[type]]:
    """Return the classes that public functions and methods return and that have no public name, by group."""
    found: dict[str, list[type]] = {title: [] for title in _GROUPS}
    for function in _functions():
        for name in re.findall(r"\b[A-Z]\w+", str(unwrap(function).__annotations__.get("return"))):
            kind = _resolved(name, unwrap(function).__module__)
            home = getattr(kind, "__module__", "")
            if not isclass(kind) or not home.startswith("cra_sym.") or name in cra_sym._HOME or name in _INTERNAL:
                continue
            group = found[_group(home.removeprefix("cra_sym."))]
            group += [] if kind in group else [kind]
    return {title: sorted(kinds, key=lambda kind: kind.__name__) for title, kinds in found.items()}


def _functions() -> Iterator[Any]:
    """Yield public functions, and methods and properties of public classes."""
    for name in cra_sym._HOME:
        thing = getattr(cra_sym, name)
        if isclass(thing):
            for called, member in vars(thing).items():
                inner = member.fget if isinstance(member, property) else getattr(member, "__func__", member)
                inner = inner.func if isinstance(inner, cached_property) else inner
                if not called.startswith("_") and isfunction(inner):
                    yield inner
        else:
            yield thing


@cache
def _imports(module: str) -> dict[str, str]:
    """Return the modules from which a module imports its names, including imports for annotations only."""
    tree = ast.walk(ast.parse(getsource(import_module(module))))
    return {
        alias.asname or alias.name: node.module
        for node in tree
        if isinstance(node, ast.ImportFrom) and node.module
        for alias in node.names
    }


def _resolved(name: str, module: str) -> Any:
    home = _imports(module).get(name, module)
    return getattr(import_module(home), name, None) if home.startswith("cra_sym") else None


def write_reference(folder: Path) -> None:
    """Write the pages of the reference, of which Sphinx fills in the docstrings, into ``folder``."""
    listed = ["# Reference\n\nEvery public name of `cra_sym`; with `import cra_sym as cra`, all are `cra.NAME`.\n"]
    pages, returned = [], results()
    for title, names in groups().items():
        pages.append(title.lower().replace("'", "").replace(",", "").replace(" ", "_"))
        rows = "\n".join(f"| {{py:obj}}`~cra_sym.{name}` | {_first(getattr(cra_sym, name))} |" for name in names)
        listed.append(f"## {title}\n\n| name | |\n| --- | --- |\n{rows}\n")
        directives = "\n".join(f".. {_directive(name)}:: cra_sym.{name}\n" for name in names)
        page = f"# {title}\n\n```{{eval-rst}}\n{directives}```\n"
        if kinds := returned[title]:
            answers = "\n".join(f".. autoclass:: {kind.__module__}.{kind.__name__}\n" for kind in kinds)
            page += f"\n## What they return\n\n```{{eval-rst}}\n{answers}```\n"
            rows = "\n".join(f"| {{py:obj}}`~{k.__module__}.{k.__name__}` | {_first(k)} |" for k in kinds)
            listed.append(f"What they return:\n\n| class | |\n| --- | --- |\n{rows}\n")
        write_text(folder / f"{pages[-1]}.md", page)
    tree = "```{toctree}\n:hidden:\n\n" + "\n".join(pages) + "\n```\n"
    write_text(folder / "index.md", "\n".join([*listed, tree]))


def _directive(name: str) -> str:
    thing = getattr(cra_sym, name)
    return "autofunction" if not isclass(thing) else "autoexception" if issubclass(thing, Warning) else "autoclass"


def _first(thing: Any) -> str:
    """Return the first paragraph of a docstring as a cell of a table."""
    text = cleandoc(thing.__doc__ or "").partition("\n\n")[0]
    text = " ".join(text.split()).replace("``", "`").replace("|", r"\|")
    return re.sub(r":\w+:(`[^`]+`)", r"{py:obj}\1", text)
