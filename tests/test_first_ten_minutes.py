"""A reader's first ten minutes: from the commands of the README to a changed parameter and a saved figure."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import cra_sym as cra
from cra_sym.report.pictures import save_figures

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def run(*arguments, folder):
    """Run a command of the package as a reader does, in another folder."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(
        [sys.executable, "-m", "cra_sym", *map(str, arguments)],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
    )


def picture(file):
    with Image.open(file) as image:
        return np.asarray(image.convert("L"), dtype=float)


def test_from_a_changed_parameter_to_a_saved_figure(tmp_path):
    """A number, the same number with another joint, and a figure of it in a folder with a space in its name."""
    table = run("frequencies", "--k-t", "1e4", "--m-e", "0.005", "--json", folder=tmp_path)
    assert (table.returncode, table.stderr) == (0, "")
    changed = cra.Arm.nominal().replace(k_t=1e4, m_e=0.005)
    np.testing.assert_array_equal(json.loads(table.stdout)["frequency"], cra.natural_frequencies(changed))

    own = Path("my own arm", "fig03.png")
    made = run("figures", "--only", "fig03", "--output", own.parent, "--k-r", 100, "--m-e", 0.05, folder=tmp_path)
    assert (made.returncode, made.stdout.split("\n")[0]) == (0, str(own)), made.stderr
    published, *_ = save_figures(tmp_path / "as published", ["fig03"])
    before, after = picture(published), picture(tmp_path / own)
    assert min(before.shape) > 500
    assert before.shape != after.shape or np.mean(np.abs(before - after) > 50) > 0.002


def test_the_same_from_python(tmp_path):
    from cra_sym.figures import draw

    figure = draw("fig03", cra.Arm.nominal().replace(m_e=0.05))
    figure.savefig(tmp_path / "softer joint.png", dpi=80)
    assert picture(tmp_path / "softer joint.png").min() < 128
    drawn = figure.axes[0].lines[1]
    expected = cra.natural_frequencies(cra.Arm.nominal().replace(m_e=0.05, k_t=drawn.get_xdata()))
    np.testing.assert_array_equal(drawn.get_ydata(), expected[:, 0])


def test_a_figure_without_an_arm_says_so(tmp_path):
    made = run("figures", "--only", "derivation", "--k-t", "10", folder=tmp_path)
    assert (made.returncode, made.stdout, made.stderr.count("\n")) == (2, "", 1)
    assert "derivation" in made.stderr and list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", sorted(set(re.findall(r"`python -m cra_sym (\w+)", README))))
def test_commands_of_the_readme_exist(command):
    from cra_sym.__main__ import COMMANDS

    assert command in COMMANDS
