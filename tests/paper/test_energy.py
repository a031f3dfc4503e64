"""Energies and the Lagrangian against hand-made cases."""

import pytest
from sympy import Integral, Rational, oo

from cra_sym import symbols as s
from cra_sym.arm.lagrangian import paper_lagrangian
from cra_sym.paper.energy import inner_stiffness, potential
from cra_sym.paper.evaluation import evaluate, put
from cra_sym.paper.modal_sum import ModalSum, member
from cra_sym.paper.orthogonality import modal_energies
from cra_sym.symbols import symbol


def test_without_the_joint_the_lagrangian_is_the_papers():
    beam, _ = potential()
    gap = paper_lagrangian(joint=False).total() - paper_lagrangian().total()
    springs = s.k_t * s.v.subs(s.x, 0) ** 2 / 2 + s.k_r * s.v.diff(s.x).subs(s.x, 0) ** 2 / 2
    assert (gap - springs).expand() == 0
    assert not beam.rhs.has(s.k_t, s.k_r)


def test_a_manipulator_that_moves_and_turns_unbent_stores_nothing_in_itself():
    rigid = s.L + s.x
    assert inner_stiffness(rigid, rigid, joint=False).doit() == 0
    assert inner_stiffness(rigid, rigid).doit() == s.k_t * s.L**2 + s.k_r


def test_modal_energies_name_all_their_coefficients():
    kinetic, potential = modal_energies()
    assert kinetic.rhs.atoms(Integral) == potential.rhs.atoms(Integral) == set()
    assert {e.function for e in kinetic.rhs.atoms(ModalSum)} == {
        s.M_i * s.q_i.diff(s.t) ** 2 / 2,
        s.Gamma_i * s.q_i.diff(s.t) * s.w.diff(s.t),
    }


def test_a_derivative_at_the_tip_is_taken_before_the_place_is_put_in():
    slope_at_tip = s.v.diff(s.x).subs(s.x, s.L)
    assert put(slope_at_tip, {s.v: s.x**2 / s.L * s.t}) == 2 * s.t
    assert put(s.v.diff(s.x).subs(s.x, 0), {s.v: s.x * s.t + 1}) == s.t


def test_members_of_a_modal_sum():
    total = ModalSum(s.omega_i * s.phi_i * s.q_i)
    assert total.doit() is total
    assert total.limits == ((symbol("i"), 1, oo),), "modes are counted from one, and all are meant"
    assert total.members("i", "j") == s.omega_i * s.phi_i * s.q_i + s.omega_j * s.phi_j * s.q_j
    assert member(s.phi_i.diff(s.x), "j") == s.phi_j.diff(s.x)


def test_evaluate_integrates_and_takes_end_values():
    expression = Integral(s.phi_i.diff(s.x) ** 2, (s.x, 0, s.L)) + s.phi_i.subs(s.x, s.L) * s.E

    def line(x, derivative=0):
        return (3.0 * x, 3.0 + 0.0 * x, 0.0 * x, 0.0 * x, 0.0 * x)[derivative]

    assert evaluate(expression, {"L": 2.0, "E": 0.5}, {s.phi_i: line}) == pytest.approx(18.0 + 3.0)
    assert evaluate(s.E**2, {"L": 1.0, "E": 0.5}) == 0.25
    assert evaluate(Rational(1, 2), {"L": 1.0}) == 0.5
