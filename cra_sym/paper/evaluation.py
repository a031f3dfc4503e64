"""Substitution of shapes, motions and numbers into equations, including at the ends of the manipulator and under
integrals."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sympy import Add, Derivative, Dummy, Expr, Function, Integral, Matrix, S, Subs, lambdify, sympify

from cra_sym.paper.groups import GROUPS
from cra_sym.paper.oracles.shooting import ShotMode, integrate, sample, shoot
from cra_sym.symbols import symbol

__all__ = [
    "annihilates",
    "at",
    "evaluate",
    "group_numbers",
    "put",
    "shapes_agree",
    "shot_coefficients",
    "termwise",
    "virtual_factors",
]

Array = NDArray[np.float64]
Shape = Callable[..., Any]  # a numerical mode shape, called with positions and the order of the derivative
x, t, L = symbol("x"), symbol("t"), symbol("L")
C_1, beta, lamda, r_2 = (symbol(name) for name in ("C_1", "beta", "lamda", "r_2"))


def at(expression: Expr, place: Any) -> Expr:
    """Return ``expression`` evaluated at a place on the manipulator, usually one of its ends."""
    return expression.subs(x, place)


def put(expression: Expr, values: Mapping[Expr, Expr]) -> Expr:
    """Return ``expression`` with functions replaced; integrals are not evaluated.

    SymPy writes a derivative at the tip as ``Derivative(v(L, t), L)``; a value that depends on L itself must be
    differentiated before it is evaluated there, which ``subs`` and ``replace`` alone would not do.

    Parameters
    ----------
    expression : Expr
    values : mapping of applied function to Expr
        For example ``{v: x**2 * t / L}``, in the variables the function is applied to; it may contain the function.
    """
    for function, value in values.items():
        variables, aside = function.args, Function("aside")
        value = value.replace(function.func, aside)

        def local(
            place: tuple[Expr, ...],
            counts: dict[Expr, int],
            function: Expr = function,
            value: Expr = value,
            variables: tuple[Expr, ...] = variables,
        ) -> Expr:
            moved = dict(zip(variables, place, strict=True))
            for variable, position in moved.items():
                value = value.diff(variable, counts.pop(position, 0)) if position.is_Symbol else value
            assert not counts, f"derivative of {function} by {counts}"
            return value.subs(moved, simultaneous=True)

        def derivative(e: Derivative, local: Callable[..., Expr] = local) -> Expr:
            return local(e.expr.args, dict(e.variable_count))

        head = function.func
        expression = expression.replace(lambda e, h=head: isinstance(e, Derivative) and e.expr.func == h, derivative)
        expression = expression.replace(head, lambda *place, local=local: local(place, {})).replace(aside, head)
    return expression.replace(lambda e: isinstance(e, Subs), lambda e: e.doit(integrals=False))


def termwise(expression: Expr) -> Expr:
    """Return ``expression`` with each integral split into its terms, constants in front, and the variables of each
    derivative in order: a normal form."""

    def split(integral: Integral) -> Expr:
        ((variable, low, high),) = integral.limits
        total = S.Zero
        for term in Add.make_args(integral.function.expand()):
            constant, varying = term.as_independent(variable, as_Add=False)
            total += constant * (high - low if varying == 1 else Integral(varying, *integral.limits))
        return total

    ordered = expression.replace(lambda e: isinstance(e, Derivative), lambda e: e.expr.diff(*e.variable_count))
    return ordered.replace(lambda e: isinstance(e, Integral), split).expand()


def virtual_factors(work: Expr, virtual: Expr) -> tuple[Expr, ...]:
    """Return the factors of an arbitrary virtual displacement in a virtual work.

    Integration by parts along the manipulator, and in time between instants at which the displacement vanishes, removes
    the derivatives of the displacement. Two works are equal for all virtual displacements if these factors are equal.

    Parameters
    ----------
    work : Expr
        Linear in the virtual displacement: integrals over the manipulator, and terms at its ends.
    virtual : applied function
        Of position, of position and time, or of time alone.

    Returns
    -------
    tuple of Expr
        The factor along the manipulator, and those of the displacement and of the slope at the root and at the tip; of
        a function of time its factor alone.
    """
    work = termwise(work)
    if termwise(put(work, {virtual: S.Zero})) != 0:
        raise ArithmeticError(f"not without {virtual}: {work}")
    if x not in virtual.args:
        return (_stationary(work, virtual),)
    along, ends = S.Zero, work.replace(lambda e: isinstance(e, Integral), lambda _: S.Zero)
    for integral in work.atoms(Integral):
        density = work.coeff(integral) * integral.function
        for factor, in_x, in_t in _linear(density, virtual):
            for k in range(in_x):
                moved = (-1) ** k * factor.diff(x, k) * virtual.diff(x, in_x - 1 - k, t, in_t)
                ends += at(moved, L) - at(moved, 0)
            along += (-1) ** (in_x + in_t) * factor.diff(x, in_x, t, in_t)
    amplitudes = [Function(f"g_{k}")(t) for k in range(4)]
    z = x / L
    hermite = (1 - 3 * z**2 + 2 * z**3, x * (1 - z) ** 2, 3 * z**2 - 2 * z**3, x * z * (z - 1))
    shape = Add(*(amplitude * h for amplitude, h in zip(amplitudes, hermite, strict=True)))
    ends = put(ends, {virtual: shape}).doit(integrals=False).expand()
    return tuple(map(termwise, [along, *(_stationary(ends, amplitude) for amplitude in amplitudes)]))


def _stationary(work: Expr, virtual: Expr) -> Expr:
    """Return the factor of a function of time after integration by parts in time."""
    return Add(*((-1) ** in_t * factor.diff(t, in_t) for factor, _, in_t in _linear(work, virtual))).expand()


def _linear(work: Expr, virtual: Expr) -> list[tuple[Expr, int, int]]:
    """Return the factors of a function and of its derivatives, each with the orders in x and t."""
    derivatives = [d for d in work.atoms(Derivative) if d.expr == virtual]
    stand_ins = {jet: Dummy() for jet in [*derivatives, virtual]}
    plain = work.xreplace(stand_ins)
    counts = ((jet, dict(jet.variable_count) if jet in derivatives else {}) for jet in stand_ins)
    found = [(plain.diff(stand_ins[jet]), count.get(x, 0), count.get(t, 0)) for jet, count in counts]
    if any(factor.has(*stand_ins.values()) for factor, *_ in found):
        raise ArithmeticError(f"not linear in {virtual}: {work}")
    return found


@cache
def _integrand(
    integral: Integral, functions: tuple[Expr, ...]
) -> tuple[Callable[..., Array], list[str], list[tuple[Expr, int]]]:
    """Return the integrand as a function of x, the named parameters and the listed derivatives of the shapes."""
    jets = [(f, k) for f in functions for k in range(4, -1, -1) if integral.function.has(f.diff(x, k))]
    stand_ins = {f.diff(x, k): Dummy() for f, k in jets}
    plain = integral.function.subs(list(stand_ins.items()))
    parameters = sorted(plain.free_symbols - {x, *stand_ins.values()}, key=str)
    return lambdify([x, *parameters, *stand_ins.values()], plain, "numpy"), [p.name for p in parameters], jets


def evaluate(expression: Expr, values: Mapping[str, float], shapes: Mapping[Expr, Shape] | None = None) -> float:
    """Return the value of an expression for given parameters and numerical mode shapes.

    Parameters
    ----------
    expression : Expr
        Integrals over the manipulator are done by quadrature.
    values : mapping
        Parameters by symbol name.
    shapes : mapping of applied function to callable
        For example ``{phi_i: mode}`` where ``mode(x, derivative)`` returns numbers.
    """
    shapes, length = shapes or {}, values["L"]
    numbers = {symbol(name): value for name, value in values.items()}
    table: dict[Expr, float] = {}
    expression = sympify(expression, strict=True)
    for integral in expression.atoms(Integral):
        table[integral] = integrate(_along(integral, values, shapes), length)
    for function, shape in shapes.items():
        for place, number in ((S.Zero, 0.0), (L, length)):
            table |= {at(function.diff(x, k), place): float(shape(number, k)) for k in range(4)}
    return float(sympify(expression.xreplace(table), strict=True).subs(numbers))


def _along(integral: Integral, values: Mapping[str, float], shapes: Mapping[Expr, Shape]) -> Callable[[Array], Array]:
    """Return the integrand as a function of the place."""
    function, names, jets = _integrand(integral, tuple(shapes))
    parameters = [values[name] for name in names]

    def along(place: Array) -> Array:
        return function(place, *parameters, *(shapes[f](place, k) for f, k in jets)) + 0.0 * place

    return along


def group_numbers(values: dict[str, float], mode_beta: float) -> dict[Expr, float]:
    """Return lamda and the dimensionless groups of an arm with a finite joint."""
    groups = {group: evaluate(value, values) for group, value in GROUPS.values()}
    pairs = {
        symbol(f"{letter}_{end}"): part / (1 + groups[symbol(f"kappa_{end}")])
        for end in "tr"
        for letter, part in (("s", groups[symbol(f"kappa_{end}")]), ("c", 1.0))
    }
    return groups | pairs | {lamda: mode_beta * values["L"]}


def shot_coefficients(mode: ShotMode) -> Matrix:
    """Return C_1..C_4 of a mode computed by shooting, from its values and derivatives at the root."""
    a, b, c, d = (mode.start[k] / mode.beta**k for k in range(4))
    return Matrix([(a - c) / 2, (b - d) / 2, (a + c) / 2, (b + d) / 2])


def annihilates(matrix: Matrix, seed: int) -> bool:
    """Tell whether a matrix annihilates the coefficients of modes computed by shooting, and does not at other wave
    numbers."""
    values = sample(seed)
    for mode in shoot(values):
        found = np.array(shot_coefficients(mode), dtype=float)[: matrix.cols]
        for factor, expected in ((1.0, True), (1.03, False)):
            numeric = np.array(matrix.subs(group_numbers(values, factor * mode.beta)), dtype=float)
            residual = np.abs(numeric @ found) / (np.abs(numeric) @ np.abs(found))
            if (residual.max() < 1e-8) != expected:
                return False
    return True


def shapes_agree(seeds: tuple[int, ...], shape: Expr, ratio: Expr, **joint: float) -> bool:
    """Compare a derived shape with modes computed by shooting, both normalised at the tip."""
    for seed in seeds:
        values = sample(seed) | joint
        for mode in shoot(values):
            numbers = group_numbers(values, mode.beta) | {C_1: 1.0, beta: mode.beta}
            numeric = shape.subs(r_2, ratio).subs(numbers)
            places = np.linspace(0.0, values["L"], 9)
            found = np.array([float(numeric.subs(x, place)) for place in places])
            expected = mode(places)
            if not np.allclose(found / found[-1], expected / expected[-1], atol=1e-6):
                return False
    return True
