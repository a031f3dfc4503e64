"""Change the Lagrangian, and everything downstream follows: every public number of the arm is that of its model."""

from __future__ import annotations

import json
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tests.perturbed import CHANGES

ROOT = Path(__file__).resolve().parents[1]


@cache
def found(name: str) -> dict[str, dict[str, np.ndarray]]:
    """Return the numbers of the arm and of the model under a change, each found in a fresh process."""
    command = [sys.executable, "-m", "tests.perturbed", name]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-4000:]
    read = json.loads(done.stdout)
    return {
        which: {key: np.array(real) + 1j * np.array(imag) for key, (real, imag) in table.items()}
        for which, table in read.items()
    }


@pytest.mark.parametrize("change", CHANGES)
def test_every_number_of_the_arm_is_that_of_its_model(change):
    """Both are derived from the same Lagrangian: they differ by nothing, since they take the same route."""
    arm, model = found(change)["arm"], found(change)["model"]
    assert arm.keys() == model.keys()
    differing = [key for key in arm if not np.array_equal(arm[key], model[key], equal_nan=True)]
    assert differing == []


STILL = {
    # A heavier base changes only what a force on the base does; a prescribed base moves as prescribed.
    "base's mass": lambda key: not key.startswith(("state_space drive_force A", "state_space drive_force B")),
    "nothing": lambda key: True,
}
BARELY = 1e-9  # relative to the largest entry: above the rounding of every number here, far below a change by 70 %


@pytest.mark.parametrize("change", [name for name in CHANGES if name != "nothing"])
def test_what_physics_says_moves(change):
    """Every number of the arm moves, but for those that cannot depend on the changed term."""
    before, after = found("nothing")["arm"], found(change)["arm"]
    still = STILL.get(change, _cannot_move)
    moved = {
        key
        for key in before
        if np.abs(np.nan_to_num(after[key] - before[key])).max() > BARELY * np.abs(np.nan_to_num(before[key])).max()
    }
    assert {key for key in before if still(key)} & moved == set()
    assert {key for key in before if not still(key)} - moved == set()


def _cannot_move(key: str) -> bool:
    """Tell the numbers that do not depend on a term of the Lagrangian."""
    zero = key in ("sensitivities.rate m_b", "sensitivities.log m_b")  # the base is prescribed
    fixed = key.startswith("state_space") and key.endswith(" D")
    return zero or fixed


SIGNS = {  # frequencies rise with stiffness and fall with inertia, by Rayleigh's principle
    "manipulator's mass": -1,
    "manipulator's stiffness": 1,
    "translational spring": 1,
    "rotational spring": 1,
    "end-effector's mass": -1,
    "end-effector's inertia": -1,
    "axial tension": 1,
    "foundation": 1,
    "offset end-effector": -1,
}


@pytest.mark.parametrize("change", SIGNS)
def test_frequencies_move_the_right_way(change):
    before, after = (found(name)["arm"]["natural_frequencies"].real for name in ("nothing", change))
    assert (SIGNS[change] * (after - before) >= -1e-12 * before).all()
    assert (SIGNS[change] * (after - before) > 1e-6 * before).any()
