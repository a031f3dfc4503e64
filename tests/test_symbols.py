"""The nomenclature: each name and each LaTeX form once, printed by SymPy exactly as the table says."""

import subprocess
import sys

import pytest
import sympy
from sympy import Derivative, Integral, Rational, cos, latex

from cra_sym import symbols
from cra_sym.symbols import Dimension, dimension, nomenclature, symbol

NAMES = [row.name for row in nomenclature()]


def test_each_name_and_each_latex_form_means_one_thing():
    written = [row for rows in symbols._TABLE.values() for row in rows]
    assert len({row[0] for row in written}) == len(written) == len({row[1] for row in written})


@pytest.mark.parametrize("name", NAMES)
def test_sympy_prints_what_the_table_promises(name):
    row = symbols.row(name)
    made = symbol(name)
    bare = sympy.Symbol(made.func.__name__) if row.arguments else made
    assert latex(bare).replace("{" + row.latex + "}", row.latex) == row.latex
    assert name.isascii() and name.isidentifier() and row.meaning
    assert isinstance(dimension(name), Dimension)


def test_attribute_access_gives_the_same_object():
    assert symbols.k_t is symbol("k_t")
    assert symbols.v == sympy.Function("v")(symbols.x, symbols.t)
    with pytest.raises(AttributeError):
        symbols.nothing_of_the_kind  # noqa: B018


def test_an_unknown_name_is_answered_with_the_nearest():
    with pytest.raises(KeyError, match="kappa_t"):
        symbol("kapa_t")


def test_the_table_does_not_import_sympy():
    code = "import sys, cra_sym.symbols as s; s.nomenclature()._repr_html_(); sys.exit('sympy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_dimensions_of_expressions():
    E, I_z, x, t, v, L, rho, A = (symbol(name) for name in ("E", "I_z", "x", "t", "v", "L", "rho", "A"))
    energy = Dimension(2, 1, -2)
    assert dimension(Rational(1, 2) * Integral(E * I_z * v.diff(x, 2) ** 2, (x, 0, L))) == energy
    assert dimension(symbol("k_r") * v.diff(x).subs(x, 0) ** 2) == energy
    assert dimension(sympy.Eq(rho * A * v.diff(t, 2), -E * I_z * Derivative(v, (x, 4)))) == Dimension(0, 1, -2)
    assert dimension(sympy.sqrt(E * I_z / (rho * A)) / L**2) == Dimension(s=-1)
    assert dimension(cos(symbol("beta") * x)) == Dimension()


@pytest.mark.parametrize(
    "wrong",
    [
        symbols.k_t + symbols.k_r,
        cos(symbols.x),
        2**symbols.L,
        sympy.Eq(symbols.T, symbols.k_t),
    ],
    ids=str,
)
def test_a_dimensional_slip_is_refused(wrong):
    with pytest.raises(ValueError, match="dimension"):
        dimension(wrong)


def test_tables_show_every_row():
    table = nomenclature()
    for text in (table._repr_html_(), table._repr_markdown_(), table.to_latex()):
        assert all(row.latex in text for row in table)
    assert {row.group for row in nomenclature("bolted joint")} == {"bolted joint"}
    with pytest.raises(ValueError, match="bolted joint"):
        nomenclature("nuts")
