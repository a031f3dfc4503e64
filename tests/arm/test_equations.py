"""The registry: every equation is found, has a kind, a statement, its sources, and a check that can fail."""

import sys
from importlib import import_module

import numpy as np
import pytest
from sympy import Add, Basic, Eq, Function, Integral, Lambda, MatMul, Rational

import cra_sym as cra
from cra_sym.arm import equations as registry
from cra_sym.arm.modal_sum import ModalSum
from cra_sym.arm.modes import frequency_function
from cra_sym.symbols import symbol

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
    sampling = e.checked_by.startswith("Numbers:") or "random polynomial" in e.checked_by or number in (8, "10a")
    assert e.evidence == ("sampled" if sampling else "proved")


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


#: Parts that one per cent leaves true: zero on the right-hand side, or a scale that is free.
UNHARMED = {(2, 0), (8, 0), (13, 0), (17, 0), (25, 0), (27, 1), (28, 0)}


def parts(expression):
    return expression if isinstance(expression, tuple) else (expression,)


def spoiled(part):
    """Return an equation one of whose terms or factors is one per cent off."""
    percent = Rational(101, 100)
    if not isinstance(part, Eq):
        first, rest = part.as_two_terms()
        return percent * first + rest
    left, right = part.args
    if isinstance(left, MatMul):
        matrix, unknowns = left.args
        changed = matrix.as_mutable()
        changed[0] *= percent
        return Eq(MatMul(changed, unknowns), right, evaluate=False)
    side = left if right == 0 else right
    first, rest = side.as_two_terms() if isinstance(side, Add) else (side, 0)
    if isinstance(first, Integral | ModalSum):
        worse = first.func(percent * first.function, *first.args[1:]) + rest
    else:
        worse = percent * first + rest
    return Eq(worse, right, evaluate=False) if right == 0 else Eq(left, worse, evaluate=False)


@pytest.mark.parametrize("e", cra.equations(companions=True), ids=lambda e: str(e.number))
def test_the_check_notices_one_per_cent(e, monkeypatch):
    module, name = e.source.split(":")
    builder, right = getattr(import_module(module), name), parts(e.expression)
    holders = [m for key, m in sys.modules.items() if key.startswith("cra_sym.arm") and vars(m).get(name) is builder]
    for place in range(len(right)):
        if (e.number, place) in UNHARMED:
            continue
        wrong = (*right[:place], spoiled(right[place]), *right[place + 1 :])
        for holder in holders:
            monkeypatch.setattr(holder, name, lambda: wrong if isinstance(e.expression, tuple) else wrong[0])  # noqa: B023
        assert e.check() is False, f"part {place}"


def test_any_integer_is_a_number():
    assert cra.equation(np.int64(23)) is cra.equation("23") is cra.equation(23)
    for number in (True, np.True_, 23.0, None, (23,)):
        with pytest.raises(TypeError, match="allowed are integers"):
            cra.equation(number)


def test_what_is_shown_of_a_long_equation_is_the_equation():
    """(32) is shown with (31)'s Delta; putting (23) in its place gives the expression."""
    e, function = cra.equation(32), frequency_function()[0]
    values = {"lamda": 1.7, "mu": 0.3, "iota": 0.1, "L": 1.1, "A": 0.3, "E": 2.0, "I_z": 0.7, "rho": 1.3}
    kappa = {"t": symbol("kappa_t"), "r": symbol("kappa_r")}
    sizes = {"t": 3.0, "r": 5.0}
    for name, shown, whole in zip("tr", e.shown, e.expression, strict=True):
        pairs = {n: (k, 1) if n == name else (sizes[n], 1) for n, k in kappa.items()}
        pair = {
            symbol(f"{letter}_{n}"): part / (1 + pairs[n][0])
            for n in "tr"
            for letter, part in zip("sc", pairs[n], strict=True)
        }
        Delta = Lambda((symbol("lamda"), kappa[name]), function.subs(pair))
        numbers = {symbol(n): v for n, v in values.items()} | {kappa[n]: v for n, v in sizes.items()}
        found = shown.rhs.replace(Function("Delta"), Delta).doit().subs(numbers)
        assert shown.lhs == whole.lhs
        assert float(found) == pytest.approx(float(whole.rhs.subs(pair).subs(numbers)), rel=1e-12)
    assert len(e._repr_latex_()) < 1000
