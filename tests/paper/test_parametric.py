"""The excited arm's equations of motion against those of textbooks: a compressed column, and springs that vary."""

import pytest
from sympy import cos

from cra_sym import symbols as s
from cra_sym.paper.parametric import excited_motion

EI, line = s.E * s.I_z, s.rho * s.A
SWING = s.epsilon * cos(s.varpi * s.t)


def test_a_base_shaken_along_the_arm_makes_it_a_compressed_column():
    """E I v_xxxx + (N v_x)_x + rho A v_tt = 0, with the N that accelerates all the mass beyond x."""
    (field,) = excited_motion("axial base").field_equations
    compression = (line * (s.L - s.x) + s.m_e) * s.u.diff(s.t, 2)
    expected = EI * s.v.diff(s.x, 4) + (compression * s.v.diff(s.x)).diff(s.x) + line * s.v.diff(s.t, 2)
    assert (field.lhs - field.rhs - expected).expand() == 0


@pytest.mark.parametrize(
    ("kind", "base", "swing"), [("joint stiffness", 0, SWING), ("transverse base", s.w.diff(s.t, 2), 0)]
)
def test_a_beam_on_springs_that_vary_and_on_a_base_that_moves(kind, base, swing):
    motion = excited_motion(kind)
    (field,) = motion.field_equations
    assert (field.lhs - field.rhs - EI * s.v.diff(s.x, 4) - line * (s.v.diff(s.t, 2) + base)).expand() == 0
    force, moment, *_ = motion.boundary_conditions
    give, turn, bent, shear = ((s.v.diff(s.x, n) if n else s.v).subs(s.x, 0) for n in range(4))
    assert (force.lhs - force.rhs - EI * shear - s.k_t * (1 + swing) * give).expand() == 0
    assert (moment.lhs - moment.rhs - EI * bent + s.k_r * (1 + swing) * turn).expand() == 0
