"""The registry: every equation is found, has a kind, a statement, its sources, and a check that can fail."""

import pytest
from sympy import Basic, Eq

import cra_sym as cra
from cra_sym.arm import equations as registry

PUBLISHED = tuple(range(1, 31))
ALL = [e.number for e in cra.equations(companions=True)]


@pytest.mark.parametrize("number", ALL)
def test_the_independent_route_confirms(number):
    assert cra.equation(number).check() is True


@pytest.mark.parametrize("number", ALL)
def test_each_equation_says_what_it_is(number):
    e = cra.equation(number)
    assert e.kind in ("definition", "assumption", "derived")
    assert e.title and e.statement.endswith(".") and e.checked_by.endswith(".")
    parts = e.expression if isinstance(e.expression, tuple) else (e.expression,)
    assert all(isinstance(part, Basic) for part in parts)
    assert f"({number})" in e._repr_latex_() and e._repr_latex_().startswith("$")
    if e.kind == "derived":
        assert e.derived_from


def test_the_papers_numbers_come_in_order_and_none_is_missing():
    assert tuple(e.number for e in cra.equations())[:30] == PUBLISHED


def test_the_graph_has_no_loop_and_no_loose_end():
    known, pending = set(), {e.number: set(e.derived_from) for e in cra.equations(companions=True)}
    while pending:
        ready = {number for number, sources in pending.items() if sources <= known}
        assert ready, f"loop or unknown source among {pending}"
        known |= ready
        pending = {number: sources for number, sources in pending.items() if number not in ready}


@pytest.mark.parametrize("number", [0, 99, "a", "23z", ""])
def test_an_unknown_number_is_refused_with_what_is_allowed(number):
    with pytest.raises(ValueError, match=r"number = .*: allowed are 1 to"):
        cra.equation(number)


@pytest.mark.parametrize("number", [1.5, None, True, (1,)])
def test_a_wrong_type_is_refused(number):
    with pytest.raises(TypeError, match="number = "):
        cra.equation(number)


def test_a_number_can_be_given_as_text():
    assert cra.equation("23") is cra.equation(23)


def test_an_equation_cannot_be_built_in_two_places():
    with pytest.raises(ValueError, match=r"equation \(1\) is already built by cra_sym.arm.energy"):
        registry.numbered(1, "again", "definition")(lambda: Eq(1, 1, evaluate=False))


MUTATIONS = {
    # number: (module, function that the check and only the check should mistrust, how to spoil its value)
    3: ("energy", "kinetic_energy", lambda e: Eq(e.lhs, 2 * e.rhs)),
    5: ("energy", "modal_energies", lambda pair: (Eq(pair[0].lhs, 2 * pair[0].rhs), pair[1])),
    6: ("energy", "generalised", lambda three: (Eq(three[0].lhs, 2 * three[0].rhs), *three[1:])),
    9: ("motion", "variation", lambda e: Eq(e.lhs, 2 * e.rhs)),
    10: ("motion", "integrated_by_parts", lambda e: Eq(-e.lhs, 0)),
    11: ("motion", "dynamic_equation", lambda e: Eq(e.lhs, -e.rhs)),
    12: ("motion", "duhamel", lambda e: Eq(e.lhs, 2 * e.rhs)),
    13: ("motion", "initial_values", lambda pair: (pair[0], Eq(pair[1].lhs, -pair[1].rhs))),
    14: ("joint", "virtual_work", lambda pair: (Eq(-pair[0].lhs, 0), pair[1])),
    16: ("joint", "boundary_conditions", lambda four: (Eq(four[0].lhs, -four[0].rhs), *four[1:])),
    "16a": ("joint", "mode_conditions", lambda four: (*four[:3], Eq(four[3].lhs, -four[3].rhs))),
    "16b": ("orthogonality", "stiffness_identity", lambda two: (Eq(two[0].lhs, 2 * two[0].rhs), two[1])),
    "16d": ("orthogonality", "stiffness_of_manipulator_alone", lambda e: Eq(e.lhs, 2 * e.rhs)),
    18: ("modes", "root_matrix", lambda matrix: matrix.applyfunc(abs)),
    19: ("modes", "tip_matrix", lambda matrix: matrix.applyfunc(abs)),
    21: ("modes", "reduced_coefficients", lambda four: (Eq(four[0].lhs, -four[0].rhs), *four[1:])),
    22: ("modes", "determinant", lambda e: Eq(2 * e.lhs, 0)),
    24: ("modes", "coefficient_ratios", lambda two: (Eq(two[0].lhs, -two[0].rhs), two[1])),
    26: ("modes", "circular_ratio", lambda e: Eq(e.lhs, -e.rhs)),
    30: ("limits", "natural_frequency", lambda e: Eq(e.lhs, 2 * e.rhs)),
}


@pytest.mark.parametrize("number", list(MUTATIONS))
def test_the_check_notices_a_wrong_equation(number, monkeypatch):
    module, name, spoil = MUTATIONS[number]
    home = __import__(f"cra_sym.arm.{module}", fromlist=[name])
    wrong = spoil(getattr(home, name)())
    monkeypatch.setattr(home, name, lambda: wrong)
    assert cra.equation(number).check() is False
