"""The claims asked of a joint that slips: verdicts follow their evidence, and linear limits come back."""

from __future__ import annotations

import numpy as np
import pytest

import cra_sym as cra
from cra_sym.__main__ import main
from cra_sym.claims import judged
from cra_sym.claims.slipping import SLIPPING, slipping_claim, slipping_claims
from cra_sym.claims.table import verdict_markdown


@pytest.fixture(scope="module")
def verdicts():
    return {verdict.id: verdict for verdict in slipping_claims()}


def test_every_verdict_says_what_and_why(verdicts):
    assert tuple(verdicts) == SLIPPING
    for verdict in verdicts.values():
        assert verdict.plain.endswith(".") and any(c.isdigit() for c in verdict.sentence) and verdict.criterion
        assert "nan" not in verdict.sentence.split() and verdict.title.endswith(", with slip")
        assert verdict.share is None or 0 <= verdict.share <= 1
    assert verdict_markdown(tuple(verdicts.values())).count("\n") == len(SLIPPING) + 1


def test_pictures_show_the_evidence(verdicts):
    for verdict in verdicts.values():
        (ax,) = verdict.draw().axes
        assert ax.get_xlabel() and ax.get_ylabel() and len(ax.get_legend().get_texts()) >= 3
    drawn = verdicts["C16"].draw().axes[0].lines
    for line, width in zip(drawn, verdicts["C16"]["width"], strict=True):
        np.testing.assert_array_equal(line.get_ydata(), width)


def test_command_line_asks_them_again(capsys):
    assert main(["claims", "--slipping", "C16"]) == 0
    assert "C16" in capsys.readouterr().out
    assert main(["claims", "--slipping", "C01"]) == 2
    assert "must be one of C02" in capsys.readouterr().err


def test_regions_are_those_of_the_evidence(verdicts):
    for id in ("C06", "C10", "C11", "C12", "C13"):
        assert judged(verdicts[id]["region"]).outcome == verdicts[id].outcome
    smaller = verdicts["C10"]
    np.testing.assert_array_equal(smaller["region"], smaller["log_ratio"] < np.log(0.99))


def test_friction_ends_superposition(verdicts):
    """Linear theory says that the disturbance adds the same at each acceleration; a joint that sticks agrees."""
    peaks = verdicts["C13"]["peaks"]
    assert cra.claims.claim("C13").outcome == "contradicted"
    np.testing.assert_allclose(peaks[:, 0, -1], peaks[0, 0, -1], rtol=1e-9)
    assert np.abs(peaks[-1] / peaks[0] - 1).max() > 0.05
    assert "is contradicted" in verdicts["C13"].sentence


def test_a_firm_joint_is_nearly_rigid(verdicts):
    for id in ("C10", "C11"):
        assert np.abs(verdicts[id]["log_ratio"][0, -1]) < 0.05


def test_bad_input_is_named():
    with pytest.raises(ValueError, match="claim = 'C01': must be one of C02"):
        slipping_claim("C01")
