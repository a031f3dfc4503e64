"""The reference: every public name, in groups by what it is for."""

from __future__ import annotations

import re
from inspect import cleandoc, isclass
from pathlib import Path

import cra_sym
from cra_sym.files import write_text

__all__ = ["groups", "write_reference"]

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
        "model.hysteresis",
    ),
    "The paper's equations": ("paper",),
    "Sweeps, code, sliders": ("studies", "kernels", "codegen", "explorer"),
}


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


def write_reference(folder: Path) -> None:
    """Write the pages of the reference, of which Sphinx fills in the docstrings, into ``folder``."""
    listed = ["# Reference\n\nEvery public name of `cra_sym`; with `import cra_sym as cra`, all are `cra.NAME`.\n"]
    pages = []
    for title, names in groups().items():
        pages.append(title.lower().replace("'", "").replace(",", "").replace(" ", "_"))
        rows = "\n".join(f"| {{py:obj}}`~cra_sym.{name}` | {_summary(name)} |" for name in names)
        listed.append(f"## {title}\n\n| name | |\n| --- | --- |\n{rows}\n")
        directives = "\n".join(f".. {_directive(name)}:: cra_sym.{name}\n" for name in names)
        write_text(folder / f"{pages[-1]}.md", f"# {title}\n\n```{{eval-rst}}\n{directives}```\n")
    tree = "```{toctree}\n:hidden:\n\n" + "\n".join(pages) + "\n```\n"
    write_text(folder / "index.md", "\n".join([*listed, tree]))


def _directive(name: str) -> str:
    thing = getattr(cra_sym, name)
    return "autofunction" if not isclass(thing) else "autoexception" if issubclass(thing, Warning) else "autoclass"


def _summary(name: str) -> str:
    """Return the first paragraph of a docstring as a cell of a table."""
    text = cleandoc(getattr(cra_sym, name).__doc__ or "").partition("\n\n")[0]
    text = " ".join(text.split()).replace("``", "`").replace("|", r"\|")
    return re.sub(r":\w+:(`[^`]+`)", r"{py:obj}\1", text)
