"""Figures 1 and 2 show the derived mode shape of the arm they are given."""

import numpy as np
import pytest
from matplotlib.figure import Figure

import cra_sym as cra
from cra_sym.figures.drawing import deflection
from cra_sym.figures.joint import figure_2
from cra_sym.figures.robot import figure_1


def test_a_rigid_joint_gives_nothing():
    xi = np.linspace(0, 1, 11)
    rigid = deflection(cra.Arm.nominal(), xi)
    assert rigid[-1] == 1
    np.testing.assert_allclose(rigid[0], 0, atol=1e-12)
    soft = deflection(None, xi)
    assert soft[0] > 0.05 and soft[1] - soft[0] > 0.01


@pytest.mark.parametrize("figure", [figure_1, figure_2])
def test_draws_where_it_is_told(figure):
    ax = Figure().add_subplot()
    assert figure(ax=ax) is ax.figure
    assert ax.texts and (ax.patches or ax.collections)


def test_the_drawn_arm_follows_the_stiffness():
    def root(arm):
        collection = figure_2(arm).axes[0].collections[0]
        vertices = collection.get_paths()[0].vertices
        ends = vertices[vertices[:, 0] == 0, 1]
        return (ends.min() + ends.max()) / 2

    nominal = cra.Arm.nominal()
    assert root(nominal) == pytest.approx(0, abs=1e-6)
    assert root(nominal.replace(k_t=50.0)) > root(nominal.replace(k_t=500.0)) > 0
