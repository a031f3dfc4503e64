"""Hamilton's principle as it is displayed."""

from cra_sym import equation
from cra_sym import symbols as s


def test_the_principle_is_an_integral_between_two_instants_that_vanishes():
    """What the proof of (8) takes apart is the integrand."""
    principle = equation(8).expression
    assert principle.rhs == 0
    assert principle.lhs.limits == ((s.t, s.t_1, s.t_2),)
