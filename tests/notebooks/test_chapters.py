"""The chapters keep their promise: every equation is shown, and everything follows the one cell of parameters."""

import ast
import re
from importlib import metadata
from pathlib import Path

import nbformat
import pytest
from nbformat.v4 import new_code_cell

import cra_sym as cra
from cra_sym.report.notebooks import execute

FOLDER = Path(__file__).parents[2] / "notebooks"
DERIVATION = sorted(FOLDER.glob("0[1-7]*.ipynb"))
TAUGHT = sorted(path for path in FOLDER.glob("[01]*.ipynb") if not path.stem.startswith("00"))
#: Another arm: longer, with a heavier tip and a rotary inertia, on a joint that gives; and another Lagrangian.
OTHER = 'fields |= {"L": 0.8, "m_e": 0.004, "J_e": 1e-6, "k_t": 5e3, "k_r": 4e2}'
TENSIONED = OTHER + "; tension = 2.0"
#: Whether pictures are drawn by the version that drew the stored ones.
PINNED = f"matplotlib=={metadata.version('matplotlib')}\n" in (FOLDER.parent / "requirements.txt").read_text()
#: Proofs know no arm: they run where the chapter is compared with its stored outputs.
PROVED = "from cra_sym.paper.equations import Equation\n\nEquation.check = lambda self: True\n"


def tagged(notebook, tag):
    return [cell for cell in notebook.cells if tag in cell.metadata.get("tags", ())]


def outputs(notebook):
    return [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]


def pictures(notebook):
    """Return every picture with the cell it is made by."""
    return [
        (cell.source, output.data["image/png"])
        for cell in notebook.cells
        if cell.cell_type == "code"
        for output in cell.outputs
        if "image/png" in output.get("data", {})
    ]


def test_every_equation_of_the_ledger_is_shown_with_its_number():
    shown = set()
    for path in DERIVATION:
        for output in outputs(nbformat.read(path, as_version=4)):
            text = "".join(output.get("data", {}).get(kind, "") for kind in ("text/markdown", "text/latex"))
            shown |= set(re.findall(r"\\qquad (?:\\mathrm\{)?\((\d+[a-z]?)\)", text))
    assert shown == {str(e.number) for e in cra.equations(companions=True)}


@pytest.mark.parametrize("path", TAUGHT, ids=lambda path: path.stem)
def test_a_chapter_has_objectives_pitfalls_and_exercises(path):
    notebook = nbformat.read(path, as_version=4)
    prose = "\n".join(cell.source for cell in notebook.cells if cell.cell_type == "markdown")
    assert len(notebook.cells) <= 41
    assert "**After this chapter you can**" in prose and "## Pitfalls" in prose
    assert not re.search(r"\\\\[A-Za-z]", prose), "a doubled backslash breaks a formula"
    solutions = tagged(notebook, "solution")
    assert 2 <= len(solutions) <= 4 and len(re.findall(r"^\*\*\d\.\*\*", prose, re.MULTILINE)) == len(solutions)
    for cell in solutions:
        assert "assert " in cell.source and cell.metadata["jupyter"]["source_hidden"]


@pytest.mark.parametrize("path", TAUGHT, ids=lambda path: path.stem)
def test_assertions_say_what_they_check(path):
    for cell in nbformat.read(path, as_version=4).cells:
        if cell.cell_type == "code":
            for node in ast.walk(ast.parse(cell.source)):
                assert not isinstance(node, ast.Assert) or node.msg, ast.unparse(node)


def following():
    return [path for path in TAUGHT if any("fields" in c.source for c in tagged(nbformat.read(path, 4), "parameters"))]


#: What draws no arm, or another structure, such as the measured strip.
ARMLESS = re.compile(r'\bdraw\("\w+"(, benchmark)?(, \w+=[^()]*)*\)|\bfigure_fit\(of_all\)')


@pytest.mark.sample(3, 5)
@pytest.mark.parametrize("path", following(), ids=lambda path: path.stem)
def test_a_chapter_follows_its_parameters(path, monkeypatch):
    """Another arm, under tension where a chapter has one: no cell fails, every figure that shows an arm is another."""
    stored = nbformat.read(path, as_version=4)
    (parameters,) = tagged(stored, "parameters")
    read = nbformat.read

    def with_another_arm(*arguments, **options):
        notebook = read(*arguments, **options)
        place = [cell.source for cell in notebook.cells].index(parameters.source)
        changed = TENSIONED if "tension" in parameters.source else OTHER
        notebook.cells.insert(place + 1, new_code_cell(PROVED + changed))
        return notebook

    monkeypatch.setattr(nbformat, "read", with_another_arm)
    before, after = pictures(stored), pictures(execute(path))
    same = [source for (source, a), (_, b) in zip(before, after, strict=True) if a == b]
    armless = [source for source, _ in before if ARMLESS.search(source)]
    # Another version of Matplotlib draws a picture that shows no arm differently too.
    assert same == armless if PINNED else set(same) <= set(armless)
