"""The registry: every equation is found, has a kind, a statement, its sources, and a check that can fail."""

import itertools
import random
import shutil
import subprocess
import sys
from importlib import import_module

import mpmath
import numpy as np
import pytest
from sympy import (
    Add,
    Basic,
    Derivative,
    Eq,
    Float,
    Function,
    Integral,
    Lambda,
    MatMul,
    MatrixBase,
    Mul,
    Pow,
    Rational,
    Symbol,
    lambdify,
)
from sympy.core.function import AppliedUndef

import cra_sym as cra
from cra_sym.mechanics.steps import mathematics
from cra_sym.paper import equations as registry
from cra_sym.paper import evaluation
from cra_sym.paper.frequency_equation import frequency_function
from cra_sym.paper.modal_sum import ModalSum
from cra_sym.paper.oracles import shooting
from cra_sym.symbols import symbol

PUBLISHED = tuple(range(1, 31))
ALL = [e.number for e in cra.equations(companions=True)]


@pytest.mark.parametrize("number", ALL)
def test_the_trial_in_numbers_confirms(number):
    """Where there is one; the proofs follow below, without numbers."""
    assert registry._SAMPLES.get(number, lambda: True)()


@pytest.mark.parametrize("number", [1, 16, 23, 34])
def test_a_check_is_proof_and_trial(number, monkeypatch):
    assert cra.equation(number).check() is True
    for routes, failing in ((registry._PROOFS, lambda: iter([symbol("L")])), (registry._SAMPLES, lambda: False)):
        with monkeypatch.context() as patch:
            patch.setitem(routes, number, failing)
            assert cra.equation(number).check() is False


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


@pytest.mark.parametrize("number", ALL)
def test_a_derived_equation_tells_how_it_comes_from_its_sources(number):
    """Its last step is the equation; each step rests on the one before, the first on what the equation is derived from.

    The others have no steps.
    """
    e = cra.equation(number)
    if e.kind != "derived":
        assert e.steps == ()
        return
    *way, last = e.steps
    assert way, "nothing between the sources and the equation"
    assert last.expression == e.shown and last.name == e.title and f"({number})" in last._repr_latex_()
    assert way[0].derived_from == tuple(f"({source})" for source in e.derived_from)
    for before, after in itertools.pairwise(e.steps):
        assert after.derived_from == (before.name,)
    for step in e.steps:
        parts = step.expression if isinstance(step.expression, tuple) else (step.expression,)
        assert all(isinstance(part, Basic | MatrixBase) for part in parts), step.name
        assert step.statement.endswith(".") and mathematics(step.statement) in e.steps._repr_markdown_()


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="needs LaTeX: apt install texlive-latex-base")
def test_every_formula_fits_the_page_of_an_article(tmp_path):
    """Equations and steps, in LaTeX's own measure: it reports what is wider than the text."""
    shown = [
        rf"\typeout{{of ({e.number})}} \[ {step._formula()} \]"
        for e in cra.equations(companions=True)
        for step in e.steps
    ]
    shown += [e.latex() for e in cra.equations(companions=True)]
    text = r"\documentclass{article}\usepackage{amsmath,amssymb}\begin{document}" + "\n".join(shown) + r"\end{document}"
    (tmp_path / "all.tex").write_text(text, encoding="utf-8")
    run = subprocess.run(
        ["pdflatex", "-interaction=nonstopmode", "all.tex"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        errors="replace",
    )
    log = run.stdout
    assert run.returncode == 0 and "Overfull" not in log and "Undefined" not in log, log[-3000:]


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
def test_an_unknown_number_is_refused_with_what_it_must_be(number):
    with pytest.raises(ValueError, match=r"number = .*: must be from 1 to"):
        cra.equation(number)


@pytest.mark.parametrize("number", [1.5, None, True, (1,)])
def test_a_wrong_type_is_refused(number):
    with pytest.raises(TypeError, match="number = "):
        cra.equation(number)


def test_a_number_can_be_given_as_text():
    assert cra.equation("23") is cra.equation(23)


def test_an_equation_cannot_be_built_in_two_places():
    with pytest.raises(ValueError, match=r"equation \(1\) is already built by cra_sym.paper.energy"):
        registry.numbered(1, "again", "definition")(lambda: Eq(1, 1, evaluate=False))


class Refusal:
    """Stands where numbers come from."""

    def __call__(self, *_, **__):
        raise AssertionError("a proof uses numbers")

    def __getattr__(self, name):
        raise AssertionError(f"a proof uses numbers: {name}")


@pytest.fixture
def no_numbers(monkeypatch):
    """Take from the sections' modules all that numbers come from: NumPy, conversion to floats, random arms, quadrature.

    A floating-point number that a proof yields all the same is refused by the decision procedure.
    """
    sources = [np, mpmath, random, lambdify, shooting.sample, shooting.shoot, shooting.integrate]
    sources += [
        evaluation.annihilates,
        evaluation.evaluate,
        evaluation.shapes_agree,
        evaluation.group_numbers,
        evaluation.shot_coefficients,
    ]
    for module in map(import_module, registry._HOMES):
        for name, value in list(vars(module).items()):
            if any(value is source for source in sources):
                monkeypatch.setattr(module, name, Refusal())
        monkeypatch.setattr(module, "float", Refusal(), raising=False)


@pytest.mark.parametrize("number", ALL)
def test_a_proof_draws_and_rounds_no_number(number, no_numbers):
    e = cra.equation(number)
    assert (e.evidence == "proved") == (e.prove() is True)


def test_every_equation_is_proved():
    """What were only sampled would have to say so, and why, in its route."""
    assert {e.number for e in cra.equations(companions=True) if e.evidence == "sampled"} == set()


@pytest.mark.parametrize("number", [23, 34, "36b", 49])
def test_a_sample_under_the_name_of_a_proof_is_found_out(number, no_numbers):
    with pytest.raises(AssertionError, match="a proof uses numbers"):
        registry._SAMPLES[number]()


def test_an_equation_without_proof_says_that_it_is_sampled(monkeypatch):
    monkeypatch.setattr(registry, "_PROOFS", {})
    e = cra.equation(23)
    assert e.evidence == "sampled" and e.prove() is None and e.checked_by.startswith("Sampled: ")
    monkeypatch.setattr(registry, "_SAMPLES", {})
    with pytest.raises(NotImplementedError, match="no check"):
        e.check()


def test_a_proof_that_yields_a_number_is_refused(monkeypatch):
    monkeypatch.setitem(registry._PROOFS, 1, lambda: iter([Float(1e-12) * symbol("L")]))
    with pytest.raises(ValueError, match="must be exact numbers"):
        cra.equation(1).check()


PERCENT = Rational(101, 100)
#: What one per cent leaves true: a scale that is free, by equation, part and term.
FREE = {(25, 0, "whole"), (27, 1, "whole"), (28, 0, "whole"), (17, 0, "whole")}
FREE |= {(17, 0, f"C_{k}*{f}(beta*x)") for k, f in enumerate(("cos", "sin", "cosh", "sinh"), start=1)}
#: (23) written out and differentiated: its proof takes seconds, so the terms are tried with numbers.
WRITTEN_OUT = {32}
#: How many of an equation's terms the suite tries, so that the long ones do not take all the time; a campaign, all.
TRIED = 4
ALL_EQUATIONS = pytest.mark.sample(1000, 1)  # of each the terms are sampled


@pytest.fixture
def drawn(request):
    """Some of a list, or all of it in a campaign."""
    every = request.config.getoption("--all-cases")
    return lambda found, count: found if every else random.Random(1).sample(found, min(count, len(found)))


def parts(expression):
    return expression if isinstance(expression, tuple) else (expression,)


def spoils(expression):
    """Yield (name, expression) with one term, at any depth but in the argument of a function, one per cent off."""
    if isinstance(expression, Add):
        terms = expression.args
        for k, term in enumerate(terms):
            yield f"{term}", Add(*terms[:k], PERCENT * term, *terms[k + 1 :])
    if isinstance(expression, Integral | ModalSum):
        for name, worse in spoils(expression.function):
            yield name, expression.func(worse, *expression.args[1:])
    elif isinstance(expression, Add | Mul | Pow):
        for k, part in enumerate(expression.args):
            for name, worse in spoils(part):
                yield name, expression.func(*expression.args[:k], worse, *expression.args[k + 1 :])


def spoiled(part):
    """Yield (name, equation) with one term or one side one per cent off."""
    if not isinstance(part, Eq):
        yield from spoils(part)
        return
    left, right = part.args
    if isinstance(left, MatMul):
        matrix, unknowns = left.args
        for k, entry in enumerate(matrix):
            for name, worse in [("entry", PERCENT * entry), *spoils(entry)]:
                changed = matrix.as_mutable()
                changed[k] = worse
                if entry != 0:
                    yield name, Eq(MatMul(changed, unknowns), right, evaluate=False)
        return
    for side, other, back in ((left, right, False), (right, left, True)):
        for name, worse in [("whole", PERCENT * side), *spoils(side)]:
            if side == 0 or (name == "whole" and (other == 0 or isinstance(side, Symbol | AppliedUndef | Derivative))):
                continue
            yield name, Eq(other, worse, evaluate=False) if back else Eq(worse, other, evaluate=False)


@ALL_EQUATIONS
@pytest.mark.parametrize("e", cra.equations(companions=True), ids=lambda e: str(e.number))
def test_the_proof_notices_one_per_cent(e, drawn, monkeypatch):
    where, missed = holders(e), []
    for place, part in enumerate(parts(e.expression)):
        found = [spoil for spoil in spoiled(part) if e.number not in WRITTEN_OUT or spoil[0] == "whole"]
        for term, worse in drawn(found, TRIED):
            put_in(monkeypatch, where, e, place, worse)
            if (e.number, place, term) not in FREE and _proves(e):
                missed.append((place, term))
    assert not missed


@ALL_EQUATIONS
@pytest.mark.parametrize("number", sorted(WRITTEN_OUT))
def test_the_numbers_notice_one_per_cent_of_a_term(number, drawn, monkeypatch):
    e = cra.equation(number)
    where, missed = holders(e), []
    assert registry._SAMPLES[number]()
    for place, part in enumerate(parts(e.expression)):
        for term, worse in drawn([*spoiled(part)], 2 * TRIED):
            put_in(monkeypatch, where, e, place, worse)
            if registry._SAMPLES[number]():
                missed.append((place, term))
    assert not missed


def holders(e):
    """Return the modules that hold the function of an equation, and its name there."""
    module, name = e.source.split(":")
    builder = getattr(import_module(module), name)
    found = [m for key, m in sys.modules.items() if key.startswith("cra_sym.paper") and vars(m).get(name) is builder]
    return found, name


def put_in(monkeypatch, where, e, place, worse):
    """Let the functions of the paper return an equation with another part."""
    modules, name = where
    right = parts(e.expression)
    wrong = (*right[:place], worse, *right[place + 1 :])
    for module in modules:
        monkeypatch.setattr(module, name, lambda: wrong if isinstance(e.expression, tuple) else wrong[0])


def _proves(e):
    try:
        return e.prove()
    except (ArithmeticError, ValueError, TypeError):  # what it rests on no longer fits
        return False


def test_any_integer_is_a_number():
    assert cra.equation(np.int64(23)) is cra.equation("23") is cra.equation(23)
    for number in (True, np.True_, 23.0, None, (23,)):
        with pytest.raises(TypeError, match="must be an integer"):
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


def test_every_equation_survives_srepr():
    """Evaluated with SymPy's names alone, the text is the same expression, sums over modes included."""
    from sympy import srepr

    names = {}
    exec("from sympy import *", names)
    for entry in registry.equations(companions=True):
        parts = entry.expression if isinstance(entry.expression, tuple) else (entry.expression,)
        for part in parts:
            assert eval(srepr(part), dict(names)) == part, entry
