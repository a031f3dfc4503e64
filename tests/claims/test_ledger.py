"""The ledger: complete, in words and data, cached, and no verdict typed in."""

import ast
import dataclasses
import json
import re
from graphlib import TopologicalSorter
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import cra_sym as cra
from cra_sym.__main__ import main
from cra_sym.claims import OUTCOMES, THEMES, Setting, claim, claims, figure_claims, judged, ledger, provenance_family
from cra_sym.claims.family import MATERIALS
from cra_sym.claims.overviews import figure_family
from cra_sym.claims.table import verdict_markdown
from cra_sym.claims.words import listed, number, percent, plain_text, span

FOLDER = Path(ledger.__file__).parent
IDS = ledger._load()


@pytest.fixture(params=IDS)
def verdict(request):
    return claim(request.param)


def test_the_claims_are_numbered_on():
    assert [id for id in IDS if id != "C06b"] == [f"C{k:02d}" for k in range(1, len(IDS))] and "C06b" in IDS
    assert claims() == tuple(claim(id) for id in IDS)
    assert {v.theme for v in claims()} == set(THEMES)
    assert {v.outcome for v in claims()} == set(OUTCOMES)


def test_a_verdict_says_what_and_why(verdict):
    assert verdict.outcome in OUTCOMES and verdict.headline.startswith(verdict.outcome)
    assert verdict.plain.endswith(".") and ". " not in verdict.plain
    assert verdict.sentence.endswith(".") and any(c.isdigit() for c in verdict.sentence)
    assert "  " not in verdict.sentence and "nan" not in verdict.sentence.split()
    assert verdict.evidence and all(q.unit and q.meaning for q in verdict.evidence.values())
    assert all(np.asarray(q.values).dtype.kind in "fbi" for q in verdict.evidence.values())
    assert (verdict.missing is not None) == (verdict.outcome == "undecidable")


def test_where_is_a_region(verdict):
    """What holds somewhere shows where: truth values over the quantities their meaning names; the mean is the share."""
    if verdict.outcome in ("mostly holds", "rarely holds"):
        region = verdict.evidence["region"]
        assert region.values.dtype.kind == "b" and judged(region.values).outcome == verdict.outcome
        assert verdict.share == region.values.mean() and verdict.here is not None
        assert region.values.size > 20 and ("where" in region.meaning or "whether" in region.meaning)


def test_a_headline_tells_the_share_and_our_point(verdict):
    told = re.fullmatch(r"[a-z ]+( \(.*\))?", verdict.headline)[1] or ""
    assert ("cases" in told) == (verdict.outcome in ("mostly holds", "rarely holds"))
    assert ("point: yes" in told, "point: no" in told) == (verdict.here is True, verdict.here is False)


def test_mathematics_is_latex_and_has_a_plain_form(verdict):
    """No bare subscript, power or Greek letter stands in the prose, and none of LaTeX in what a terminal shows."""
    for text in (verdict.plain, verdict.sentence, verdict.criterion, verdict.remedy or "", verdict.missing or ""):
        assert text.count("$") % 2 == 0
        prose = "".join(text.split("$")[::2])
        assert not re.search(r"[_^\\{}]|\b(omega|varpi|psi|epsilon|kappa|lambda|phi|rho)\b|\de[-+]?\d", prose)
        assert not re.search(r"[$\\{}]", plain_text(text))


def test_thresholds_are_told(verdict):
    """The criterion carries every threshold, and moves with those of the setting."""
    assert any(c.isdigit() for c in verdict.criterion) or "no threshold" in verdict.criterion


def test_a_threshold_of_the_setting_is_that_of_the_criterion(judge):
    assert "1 %" in judge("C03").criterion and "2 %" in judge("C03", visible=0.02).criterion


def test_a_contradiction_carries_a_remedy(verdict):
    assert verdict.outcome != "contradicted" or verdict.remedy


def test_no_outcome_is_typed():
    """A claim's function may write 'undecidable', never a verdict: those come out of `judged`."""
    written = [
        call.args[0].value
        for path in FOLDER.glob("*.py")
        if path.name != "verdict.py"
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(call, ast.Call) and getattr(call.func, "id", "") == "Judgement"
    ]
    assert written == ["undecidable"]


def test_each_is_drawn_in_its_own_axes(verdict):
    figure = Figure()
    ax = figure.subplots()
    assert verdict.draw(ax) is figure
    assert figure.axes == [ax] and ax.has_data()
    assert verdict.id in ax.get_title(loc="left") and (ax.get_xlabel() or ax.get_xticklabels())


def test_a_theme_is_one_picture():
    figure = figure_claims("modes", claims(theme="modes")[:4], columns=2)
    assert [ax.get_title(loc="left")[2:5] for ax in figure.axes] == [v.id for v in claims(theme="modes")[:4]]


def test_every_arm_drawn_has_the_published_frequencies():
    """To the digits printed; the nominal arm stands among them."""
    figure = figure_family(provenance_family(length=np.linspace(0.4, 1.6, 4)))
    *curves, nominal = figure.axes[0].lines
    bare = cra.Arm.nominal().replace(m_e=0.0)
    for curve in curves:
        E, rho = MATERIALS[curve.get_label()]
        length, thickness = curve.get_xdata(), curve.get_ydata() / 1e3
        found = cra.natural_frequencies(bare.replace(L=length, h=thickness, E=E, rho=rho))
        np.testing.assert_allclose(found, [Setting.frequencies] * 4, rtol=0, atol=0.0005)
    assert len(curves) == len(MATERIALS)
    assert nominal.get_xydata().ravel().tolist() == [bare.L, 1e3 * bare.h]


def test_computed_once_and_for_each_arm():
    assert claim("C01") is claim("C01", cra.Arm.nominal())
    other = claim("C01", cra.Arm.nominal().replace(L=1.1))
    assert other.outcome != claim("C01").outcome


def test_outcomes():
    assert judged([True]).outcome == "holds"
    assert judged([True, False, True], [True]).outcome == "mostly holds"
    assert judged([True, False], [True]).outcome == "rarely holds"
    assert judged([True], [False, False]).outcome == "contradicted"
    assert judged([True], here=[True, False]).here is False


@pytest.mark.parametrize(
    ("arguments", "numbers", "message"),
    [
        (("C99",), {}, "must be one of C01"),
        (("C01", 3.0), {}, "must be an Arm"),
        (("C01", cra.Arm.nominal().replace(k_t=[1.0, 2.0])), {}, "must be one arm"),
        (("C01",), {"speed": 1.0}, "not a number of a setting"),
        (("C01",), {"amplitude": -1.0}, "amplitude"),
        (("C01",), {"modes": 1.5}, "modes = 1.5"),
        (("C01",), {"phase": [0.0, 1.0]}, r"phase has shape \(2,\): must be one number"),
        (("C01",), {"k_r": []}, r"k_r has shape \(0,\): must be some numbers in a row"),
        (("C01",), {"frequencies": [1.0]}, r"frequencies has shape \(1,\): must be 3 numbers"),
        (("C01",), {"masses": [[0.0]]}, r"masses has shape \(1, 1\)"),
        (("C01",), {"k_t": None}, "k_t = None"),
        (("C01",), {"duration": 1e300}, r"duration = 1e\+300"),
    ],
)
def test_bad_input_is_refused(arguments, numbers, message):
    with pytest.raises((TypeError, ValueError), match=message):
        claim(*arguments, **numbers)
    for theme, error in (("colours", ValueError), (3, TypeError), (np.zeros(2), TypeError)):
        with pytest.raises(error, match="theme"):
            claims(theme=theme)
    with pytest.raises((TypeError, ValueError), match="verdict = 3: must be a Verdict"):
        figure_claims("modes", [3])
    with pytest.raises(TypeError, match="family = 3: must be an ArmFamily"):
        figure_family(3)


def test_every_number_has_a_provenance():
    names = {entry.name for entry in dataclasses.fields(Setting)} - {"arm"}
    assert set(Setting.provenance) == names
    assert {kind for kind, _ in Setting.provenance.values()} <= {"published", "calibrated", "assumed", "lost"}


def test_command_prints_the_table(capsys):
    assert main(["claims", "C01", "C03"]) == 0
    text = capsys.readouterr().out
    assert "C01  ✓ HOLDS" in text and "C03  ✗ CONTRADICTED" in text and text.endswith("1 holds, 1 contradicted\n")
    assert main(["claims", "C02", "--json", "--m-e", "0"]) == 0
    (only,) = json.loads(capsys.readouterr().out)
    assert only["outcome"] == "holds" and np.shape(only["evidence"]["frequency"]["values"]) == (61, 3)
    assert main(["claims", "C77"]) == 2
    assert "must be" in capsys.readouterr().err


def test_the_table_of_a_page_has_three_cells_a_row():
    """Whatever a verdict says, with its remedy or what is missing."""
    verdicts = [claim(id) for id in ("C01", "C02", "C03")]
    verdicts += [dataclasses.replace(verdicts[0], sentence="$|v|$ is $k_t^2$.", missing="a figure", remedy="a spring")]
    head, line, *rows = verdict_markdown(verdicts).splitlines()
    cells = [re.split(r"(?<!\\)\|", row)[1:-1] for row in (head, line, *rows)]
    assert {len(row) for row in cells} == {3} and len(rows) == 4
    for verdict, (words, verdict_cell, found) in zip(verdicts, cells[2:], strict=True):
        assert verdict.id in words and verdict.source in words
        assert verdict.headline in verdict_cell and verdict.plain in verdict_cell and verdict.criterion in found
        assert all(text in found for text in (verdict.remedy or "", verdict.missing or ""))
    assert r"$\vert v\vert $ is $k_t^2$." in rows[-1]


def test_words():
    assert [number(x) for x in (99900.0, 105000.0, 9.99e-4)] == ["99900", r"$1.05\times10^{5}$", r"$9.99\times10^{-4}$"]
    assert plain_text(r"$\kappa_t$, $\epsilon\varpi$ and $\lambda$") == "\u03ba_t, \u03b5\u03d6 and \u03bb"
    assert number(np.inf) == "infinite" and number(12345.6) == "12300" and number(1e-9) == "$10^{-9}$"
    assert percent(0.5) == "50 %" and listed([1.0]) == "1"
    assert span([1, 2, 3], [False] * 3) == "nowhere"
    assert span([1, 2, 3], [True, False, True], "s") == "1 and 3 s"


def test_imports_of_the_room_form_no_circle():
    """Not at import, not inside functions, not for types."""
    needs = {}
    for path in FOLDER.glob("*.py"):
        tree = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        origins = {node.module or "" for node in tree if isinstance(node, ast.ImportFrom)}
        needs[path.stem] = {name.rpartition(".")[2] for name in origins if name.startswith("cra_sym.claims.")}
    order = list(TopologicalSorter(needs).static_order())  # raises CycleError
    assert order.index("verdict") < order.index("registry") < order.index("ledger") < order.index("overviews")
