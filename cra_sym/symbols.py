r"""Table of all symbols: ASCII name, LaTeX, unit, meaning, assumptions; the nomenclature is this table.

>>> from cra_sym.symbols import symbol, dimension
>>> symbol("k_t"), symbol("v")
(k_t, v(x, t))
>>> dimension("k_t")
Dimension(m=0, kg=1, s=-2)

The table is plain text; SymPy is imported when the first symbol is used.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from html import escape
from typing import Any, NamedTuple

__all__ = ["Dimension", "Nomenclature", "Row", "dimension", "nomenclature", "symbol"]


class Row(NamedTuple):
    """One symbol; a function is a row with ``arguments``, the names of the rows it depends on."""

    name: str
    latex: str
    unit: str
    meaning: str
    assumptions: str = "real"
    arguments: tuple[str, ...] = ()
    group: str = ""


class Dimension(NamedTuple):
    """Exponents of metre, kilogram and second; the radian counts as 1."""

    m: int = 0
    kg: int = 0
    s: int = 0

    def __mul__(self, other: Any) -> Dimension:
        """Dimension of a product."""
        return Dimension(*(a + b for a, b in zip(self, other, strict=True)))

    def __pow__(self, exponent: Any) -> Dimension:
        """Dimension of a power."""
        return Dimension(*(a * exponent for a in self))


_POSITIVE, _NONNEGATIVE, _INTEGER, _COMPLEX = "positive", "nonnegative", "positive integer", "complex"
_X, _T, _XT = ("x",), ("t",), ("x", "t")

_TABLE: dict[str, list[tuple[Any, ...]]] = {
    "coordinates and motion": [
        ("x", "x", "m", "coordinate along the manipulator from the bolted joint, 0 to L"),
        ("t", "t", "s", "time"),
        ("tau", r"\tau", "s", "running time under an integral"),
        ("xi", r"\xi", "1", "x / L"),
        ("w", "w", "m", "transverse displacement of the driving base", "", _T),
        ("u", "u", "m", "axial displacement of the driving base", "", _T),
        ("v", "v", "m", "elastic displacement seen from the base; v(0, t) is the give of the joint", "", _XT),
        ("y", "y", "m", "absolute transverse displacement w + v", "", _XT),
        ("eta", r"\eta", "m", "virtual displacement, the variation of v", "", _XT),
        ("F", "F", "N", "force that drives the base", "", _T),
    ],
    "manipulator, base, end-effector": [
        ("L", "L", "m", "length of the manipulator", _POSITIVE),
        ("b", "b", "m", "width of the manipulator", _POSITIVE),
        ("h", "h", "m", "thickness of the manipulator", _POSITIVE),
        ("A", "A", "m^2", "area of the cross section, b h", _POSITIVE),
        ("I_z", "I_{z}", "m^4", "second moment of area about the neutral axis, b h^3 / 12", _POSITIVE),
        ("E", "E", "Pa", "Young's modulus", _POSITIVE),
        ("rho", r"\rho", "kg/m^3", "density", _POSITIVE),
        ("m_b", "m_{b}", "kg", "mass of the driving base", _POSITIVE),
        ("m_e", "m_{e}", "kg", "mass of the end-effector", _NONNEGATIVE),
        ("J_e", "J_{e}", "kg m^2", "rotary inertia of the end-effector (0 in the paper)", _NONNEGATIVE),
    ],
    "bolted joint": [
        ("k_t", "k_{t}", "N/m", "translational ('tensional') stiffness of the joint", _NONNEGATIVE),
        ("k_r", "k_{r}", "N m/rad", "rotational ('torsional') stiffness of the joint", _NONNEGATIVE),
        ("Q", "Q", "N", "shear force in the manipulator", "", _XT),
        ("M_z", "M_{z}", "N m", "bending moment in the manipulator", "", _XT),
    ],
    "dimensionless groups": [
        ("kappa_t", r"\kappa_{t}", "1", "k_t L^3 / (E I_z)", _NONNEGATIVE),
        ("kappa_r", r"\kappa_{r}", "1", "k_r L / (E I_z)", _NONNEGATIVE),
        ("mu", r"\mu", "1", "m_e / (rho A L)", _NONNEGATIVE),
        ("iota", r"\iota", "1", "J_e / (rho A L^3)", _NONNEGATIVE),
        ("s_t", "s_{t}", "1", "kappa_t / (1 + kappa_t), 1 for a rigid joint", _NONNEGATIVE),
        ("c_t", "c_{t}", "1", "1 / (1 + kappa_t), 0 for a rigid joint", _NONNEGATIVE),
        ("s_r", "s_{r}", "1", "kappa_r / (1 + kappa_r), 1 for a rigid joint", _NONNEGATIVE),
        ("c_r", "c_{r}", "1", "1 / (1 + kappa_r), 0 for a rigid joint", _NONNEGATIVE),
        ("a_t", "a_{t}", "1", "compliance 1 / kappa_t", _NONNEGATIVE),
        ("a_r", "a_{r}", "1", "compliance 1 / kappa_r", _NONNEGATIVE),
    ],
    "energies": [
        ("T", "T", "J", "kinetic energy"),
        ("U", "U", "J", "potential energy of manipulator and joint"),
        ("U_b", "U_{b}", "J", "potential energy of the manipulator alone, the paper's (4)"),
        ("Lcal", r"\mathcal{L}", "J", "Lagrangian T - U"),
        ("t_1", "t_{1}", "s", "first instant of the motion"),
        ("t_2", "t_{2}", "s", "last instant of the motion"),
    ],
    "modes": [
        ("i", "i", "1", "index of a mode", _INTEGER),
        ("j", "j", "1", "index of a mode", _INTEGER),
        ("phi_i", r"\phi_{i}", "1", "shape of mode i (kg^-1/2 when mass-normalised)", "", _X),
        ("phi_j", r"\phi_{j}", "1", "shape of mode j", "", _X),
        ("q_i", "q_{i}", "m", "generalised coordinate of mode i (m kg^1/2 when mass-normalised)", "", _T),
        ("q_j", "q_{j}", "m", "generalised coordinate of mode j", "", _T),
        ("M_i", "M_{i}", "kg", "generalised mass of mode i", _POSITIVE),
        ("K_i", "K_{i}", "N/m", "generalised stiffness of mode i", _NONNEGATIVE),
        ("K_b", "K_{b}", "N/m", "generalised stiffness of the manipulator alone, without the joint", _NONNEGATIVE),
        ("Gamma_i", r"\Gamma_{i}", "kg", "participation factor of mode i"),
        ("omega_i", r"\omega_{i}", "rad/s", "natural angular frequency of mode i", _NONNEGATIVE),
        ("omega_j", r"\omega_{j}", "rad/s", "natural angular frequency of mode j", _NONNEGATIVE),
        ("omega", r"\omega", "rad/s", "angular frequency", _NONNEGATIVE),
        ("f_i", "f_{i}", "Hz", "natural frequency of mode i", _NONNEGATIVE),
        ("zeta", r"\zeta", "1", "damping ratio that every mode has", _NONNEGATIVE),
        ("zeta_i", r"\zeta_{i}", "1", "damping ratio of mode i (0 in the paper)", _NONNEGATIVE),
        ("beta", r"\beta", "rad/m", "wave number, beta^4 = rho A omega^2 / (E I_z)", _NONNEGATIVE),
        ("lamda", r"\lambda", "1", "frequency parameter beta L", _NONNEGATIVE),
        ("C_1", "C_{1}", "1", "coefficient of cos(beta x) in the mode shape"),
        ("C_2", "C_{2}", "1", "coefficient of sin(beta x) in the mode shape"),
        ("C_3", "C_{3}", "1", "coefficient of cosh(beta x) in the mode shape"),
        ("C_4", "C_{4}", "1", "coefficient of sinh(beta x) in the mode shape"),
        ("r_2", "r_{2}", "1", "ratio C_2 / C_1 in the mode shape"),
        ("d_11", "d_{11}", "1", "reduced system, row 1, coefficient of C_1"),
        ("d_12", "d_{12}", "1", "reduced system, row 1, coefficient of C_2"),
        ("d_21", "d_{21}", "1", "reduced system, row 2, coefficient of C_1"),
        ("d_22", "d_{22}", "1", "reduced system, row 2, coefficient of C_2"),
        ("Delta", r"\Delta", "1", "frequency function of lamda: zero at the natural frequencies"),
    ],
    "responses": [
        ("v_m", "v_{m}", "m/s", "mean velocity of the base"),
        ("a_m", "a_{m}", "m/s^2", "mean acceleration of the base"),
        ("B", "B", "m", "amplitude of the base's harmonic disturbance"),
        ("varpi", r"\varpi", "rad/s", "angular frequency of the disturbance", _POSITIVE),
        ("psi", r"\psi", "rad", "phase of the disturbance"),
    ],
    "stability": [
        ("epsilon", r"\epsilon", "1", "small parameter", _POSITIVE),
        ("sigma", r"\sigma", "rad/s", "detuning of the excitation frequency"),
        ("T_0", "T_{0}", "s", "fast time t"),
        ("T_1", "T_{1}", "s", "slow time epsilon t"),
        ("m", "m", "1", "index of a mode", _INTEGER),
        ("n", "n", "1", "index of a mode", _INTEGER),
        ("omega_m", r"\omega_{m}", "rad/s", "natural angular frequency of mode m", _POSITIVE),
        ("omega_n", r"\omega_{n}", "rad/s", "natural angular frequency of mode n", _POSITIVE),
        ("zeta_m", r"\zeta_{m}", "1", "damping ratio of mode m", _NONNEGATIVE),
        ("zeta_n", r"\zeta_{n}", "1", "damping ratio of mode n", _NONNEGATIVE),
        ("A_m", "A_{m}", "m", "complex amplitude of mode m", "", ("T_1",)),
        ("A_n", "A_{n}", "m", "complex amplitude of mode n", "", ("T_1",)),
        ("Gamma_n", r"\Gamma_{n}", "kg", "participation factor of mode n"),
        ("M_n", "M_{n}", "kg", "generalised mass of mode n", _POSITIVE),
        ("w_0", "w_{0}", "m", "constant mean displacement of the base"),
        ("w_1", "w_{1}", "m", "amplitude of the transverse fluctuation of the base"),
        ("u_0", "u_{0}", "m", "amplitude of the axial fluctuation of the base"),
        ("G_ij", "G_{ij}", "kg/m", "axial-inertia coupling of modes i and j"),
        ("P_ij", "P_{ij}", "rad^2/s^2", "parametric coupling of modes i and j, for unit generalised masses"),
        ("P_nn", "P_{nn}", "rad^2/s^2", "parametric coupling of mode n with itself"),
        ("P_mn", "P_{mn}", "rad^2/s^2", "parametric coupling of mode m with mode n"),
        ("P_nm", "P_{nm}", "rad^2/s^2", "parametric coupling of mode n with mode m"),
    ],
}

_ROWS = {cells[0]: Row(*cells)._replace(group=group) for group, rows in _TABLE.items() for cells in rows}

_UNITS = {
    "1": Dimension(),
    "rad": Dimension(),
    "m": Dimension(m=1),
    "kg": Dimension(kg=1),
    "s": Dimension(s=1),
    "Hz": Dimension(s=-1),
    "N": Dimension(1, 1, -2),
    "Pa": Dimension(-1, 1, -2),
    "J": Dimension(2, 1, -2),
}


def row(name: str) -> Row:
    """Return the table row of ``name``, or raise ``KeyError`` with the nearest names."""
    try:
        return _ROWS[name]
    except (KeyError, TypeError):
        from difflib import get_close_matches

        near = get_close_matches(str(name), _ROWS)
        hint = f"; did you mean {', '.join(near)}?" if near else ""
        raise KeyError(f"no symbol named {name!r} in the nomenclature{hint}") from None


@cache
def symbol(name: str) -> Any:
    """Return the SymPy object of a row: a ``Symbol``, or for a function the applied form such as ``v(x, t)``."""
    from sympy import Function, Symbol

    entry = row(name)
    if entry.arguments:
        return Function(entry.name)(*(symbol(argument) for argument in entry.arguments))
    facts: dict[str, Any] = dict.fromkeys(entry.assumptions.split(), True)
    return Symbol(entry.name, **facts)


def __getattr__(name: str) -> Any:
    if name in _ROWS:
        return symbol(name)
    raise AttributeError(f"module 'cra_sym.symbols' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*__all__, *_ROWS])


# Dimensions -----------------------------------------------------------------------------------------------------


@cache
def unit_dimension(unit: str) -> Dimension:
    """Return the dimension of a unit such as ``N m/rad``; a ValueError names one that is not known."""
    if not isinstance(unit, str):
        raise TypeError(f"unit = {unit!r}: must be a text such as 'N m/rad'")
    above, _, below = unit.partition("/")
    total = Dimension()
    for part, sign in ((above, 1), (below, -1)):
        for atom in part.split():
            base, _, power = atom.partition("^")
            if base not in _UNITS:
                raise ValueError(f"unit = {unit!r}: {base!r} is not one of {', '.join(_UNITS)}")
            total = total * _UNITS[base] ** (sign * int(power or 1))
    return total


def dimension(quantity: Any, given: Mapping[Any, Dimension] | None = None) -> Dimension:
    """Return the physical dimension of a symbol's name or of a SymPy expression made of the table's symbols.

    Parameters
    ----------
    quantity : str or sympy.Basic
        A name of the table, an expression, or an equation (both sides must agree).
    given : mapping, optional
        Dimensions of further SymPy symbols or functions, by object or by name.

    Raises
    ------
    ValueError
        If terms of different dimension are added, compared, or put into a function such as ``sin``.
    """
    if isinstance(quantity, str):
        return unit_dimension(row(quantity).unit)
    return _expression_dimension(quantity, given or {})


def _expression_dimension(e: Any, given: Mapping[Any, Dimension]) -> Dimension:
    import sympy

    def of(part: Any) -> Dimension:
        return _expression_dimension(part, given)

    if e in given:
        return given[e]
    if e.is_Symbol or isinstance(e, sympy.core.function.AppliedUndef):
        name = e.name if e.is_Symbol else e.func.__name__
        return given[name] if name in given else dimension(name)
    if e.is_number or isinstance(e, sympy.Order):
        return Dimension()
    if isinstance(e, sympy.Add | sympy.Eq | sympy.Max | sympy.Min):
        terms = {of(term): term for term in e.args if term not in (0, sympy.oo)}
        if len(terms) > 1:
            found = "; ".join(f"{term} has {tuple(d)}" for d, term in terms.items())
            raise ValueError(f"terms of different dimension (m, kg, s) in {e}: {found}")
        return next(iter(terms), Dimension())
    if isinstance(e, sympy.Mul):
        total = Dimension()
        for factor in e.args:
            total = total * of(factor)
        return total
    if isinstance(e, sympy.Pow) and (e.exp.is_Rational or of(e.base) == Dimension() == of(e.exp)):
        return of(e.base) ** e.exp if e.exp.is_Rational else Dimension()
    if isinstance(e, sympy.Derivative):
        total = of(e.expr)
        for variable, order in e.variable_count:
            total = total * of(variable) ** -order
        return total
    if isinstance(e, sympy.Integral):
        total = of(e.function)
        for variable, *_ in e.limits:
            total = total * of(variable)
        return total
    if isinstance(e, sympy.Subs | sympy.Sum | sympy.Abs | sympy.conjugate | sympy.Limit):
        return of(e.args[0])
    if isinstance(e, sympy.Function) and all(of(argument) == Dimension() for argument in e.args):
        return Dimension()
    raise ValueError(f"no dimension for {e}: its argument or exponent is not dimensionless")


# The nomenclature as a table ------------------------------------------------------------------------------------


class Nomenclature(tuple[Row, ...]):
    """The rows as a table with a display in notebooks."""

    __slots__ = ()

    def __repr__(self) -> str:
        return f"nomenclature of {len(self)} symbols"

    def _cells(self) -> list[tuple[str, str, str, str, str]]:
        return [(r.group, _head(r), r.name, r.unit, r.meaning) for r in self]

    def _repr_html_(self) -> str:
        body, last = [], None
        for group, head, name, unit, meaning in self._cells():
            if group != last:
                body.append(f'<tr><th colspan="4" style="text-align:left">{group}</th></tr>')
                last = group
            texts = (f"${head}$", f"<code>{name}</code>", _pretty_unit(unit, "<sup>{}</sup>"), escape(meaning))
            body.append("<tr>" + "".join(f'<td style="text-align:left">{text}</td>' for text in texts) + "</tr>")
        titles = "".join(f'<th style="text-align:left">{t}</th>' for t in ("symbol", "name", "unit", "meaning"))
        return f"<table><thead><tr>{titles}</tr></thead><tbody>{''.join(body)}</tbody></table>"

    def _repr_markdown_(self) -> str:
        lines = ["| symbol | name | unit | meaning |", "| --- | --- | --- | --- |"]
        for _, head, name, unit, meaning in self._cells():
            lines.append(f"| ${head}$ | `{name}` | {_pretty_unit(unit, '<sup>{}</sup>')} | {meaning} |")
        return "\n".join(lines)

    def to_latex(self) -> str:
        """Return the table as a LaTeX ``tabular``."""
        lines = [r"\begin{tabular}{llll}", r"symbol & name & unit & meaning \\ \hline"]
        for _, head, name, unit, meaning in self._cells():
            texts = (rf"\texttt{{{name}}}", _pretty_unit(unit, "$^{{{}}}$"), meaning.replace("^", r"\^{}"))
            lines.append(f"${head}$ & " + " & ".join(t.replace("_", r"\_") for t in texts) + r" \\")
        return "\n".join([*lines, r"\end{tabular}"])


def _head(entry: Row) -> str:
    if not entry.arguments:
        return entry.latex
    return f"{entry.latex}({', '.join(_ROWS[name].latex for name in entry.arguments)})"


def _pretty_unit(unit: str, power: str) -> str:
    return re.sub(r"\^(-?\d+)", lambda match: power.format(match[1]), unit)


def nomenclature(group: str | None = None) -> Nomenclature:
    """Return all rows, or those of one group, as a table with a display in notebooks."""
    from cra_sym.checks import choice

    if group is not None:
        choice("group", group, _TABLE)
    return Nomenclature(r for r in _ROWS.values() if group in (None, r.group))
