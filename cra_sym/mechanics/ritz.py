"""Ritz's method: mass, damping and stiffness matrices of a Lagrangian on Hermite elements, symbolic in parameters."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise, product
from typing import Any

from sympy import Dummy, Expr, Matrix, Poly, Rational, S, SparseMatrix, Symbol, sympify, zeros
from sympy.integrals.quadrature import gauss_legendre

from cra_sym import checks
from cra_sym.mechanics.hamilton import HamiltonResult, hamilton
from cra_sym.mechanics.jets import HamiltonError, Jet
from cra_sym.mechanics.weak import Bilinear, WeakForm, weak_form

__all__ = ["RitzMatrices", "hermite", "ritz"]

Entries = dict[tuple[int, int], Expr]
_POINTS = 8
_DIGITS = 30


@dataclass(frozen=True)
class RitzMatrices:
    r"""Ritz matrices of :math:`M \ddot q + C \dot q + K q = f` on equal Hermite elements, symbolic in the parameters.

    Unknowns: node by node every field with its slope (and the second derivative, if third ones occur in the density),
    then the lumped coordinates, then slopes right of interior nodes where the density has first derivatives only. To
    assemble numbers, evaluate the element matrices for ``element_length`` and each ``element_start``, add entry (i, j)
    to ``(connectivity[e][i], connectivity[e][j])``, add the end terms, and replace each unknown by its ``restraint``.

    Attributes
    ----------
    elements : int
        Of all spans together.
    spans : tuple of (Expr, Expr)
        Left end and length of each span between nodes at interior places; all have as many elements.
    element_stiffness, element_damping, element_mass : Matrix
        In ``element_length`` and, where coefficients vary along x, ``element_start``.
    element_load : Matrix, shape (unknowns of an element, 1)
        From prescribed motions and applied forces.
    element_length, element_start : Symbol
        Length of an element and position of its left node.
    connectivity : tuple of tuple of int
        Unknowns of each element, in the order of the element matrices.
    end_stiffness, end_damping, end_mass : dict of (int, int) to Expr
        End terms and lumped coordinates, by unknown.
    end_load : dict of int to Expr
    restraint : tuple of dict of int to Expr
        Each unknown in terms of the free ones, by the essential conditions: ``q[i] = sum factor * free[j]``.
    labels : tuple of Expr
        Meaning of the unknowns at one node and of the lumped coordinates.
    start, length : Expr
        Left end and length of the interval.
    """

    elements: int
    spans: tuple[tuple[Expr, Expr], ...]
    element_stiffness: Matrix
    element_damping: Matrix
    element_mass: Matrix
    element_load: Matrix
    element_length: Symbol
    element_start: Symbol
    connectivity: tuple[tuple[int, ...], ...]
    end_stiffness: Entries
    end_damping: Entries
    end_mass: Entries
    end_load: dict[int, Expr]
    restraint: tuple[dict[int, Expr], ...]
    labels: tuple[Expr, ...]
    start: Expr
    length: Expr

    @property
    def free(self) -> int:
        """Number of free unknowns: the size of the matrices."""
        return 1 + max((index for row in self.restraint for index in row), default=-1)

    @property
    def stiffness(self) -> SparseMatrix:
        """K on the free unknowns."""
        return self._assembled(self.element_stiffness, self.end_stiffness)

    @property
    def damping(self) -> SparseMatrix:
        """C on the free unknowns: viscous (symmetric) and gyroscopic (skew) forces."""
        return self._assembled(self.element_damping, self.end_damping)

    @property
    def mass(self) -> SparseMatrix:
        """M on the free unknowns."""
        return self._assembled(self.element_mass, self.end_mass)

    @property
    def load(self) -> Matrix:
        """f on the free unknowns, in the prescribed motions and applied forces."""
        total = zeros(self.free, 1)
        for unknowns, place in self._places():
            for p, value in zip(unknowns, self.element_load.subs(place), strict=True):
                for i, factor in self.restraint[p].items():
                    total[i] += factor * value
        for p, value in self.end_load.items():
            for i, factor in self.restraint[p].items():
                total[i] += factor * value
        return total

    def _places(self) -> Iterator[tuple[tuple[int, ...], dict[Symbol, Expr]]]:
        """Yield the unknowns of each element with its length and position."""
        each = self.elements // len(self.spans)
        for number, unknowns in enumerate(self.connectivity):
            start, length = self.spans[number // each]
            step = length / each
            yield unknowns, {self.element_length: step, self.element_start: start + number % each * step}

    def _assembled(self, element: Matrix, ends: Entries) -> SparseMatrix:
        total: Entries = dict(ends)
        for unknowns, place in self._places():
            local = element.subs(place)
            for (i, p), (j, q) in product(enumerate(unknowns), repeat=2):
                if local[i, j] != 0:
                    total[p, q] = total.get((p, q), S.Zero) + local[i, j]
        reduced: Entries = {}
        for (p, q), value in total.items():
            for (i, a), (j, b) in product(self.restraint[p].items(), self.restraint[q].items()):
                reduced[i, j] = reduced.get((i, j), S.Zero) + a * b * value
        return SparseMatrix(self.free, self.free, reduced)


def ritz(
    problem: HamiltonResult | Expr, *, elements: int, nodes: Sequence[Expr] = (), **arguments: Any
) -> RitzMatrices:
    """Return Ritz matrices of a quadratic Lagrangian on Hermite elements.

    Parameters
    ----------
    problem : HamiltonResult or Expr
        What `hamilton` returned, or a Lagrangian density with the ``arguments`` of `hamilton`.
    elements : int
        Number of equal elements, of each span between nodes.
    nodes : sequence of Expr, optional
        Further interior nodes besides those of terms and supports, such as jumps of a coefficient.

    Notes
    -----
    A field with x derivatives up to order m is interpolated by polynomials of degree ``2 p - 1``, ``p = max(m, 2)``,
    with continuous derivatives up to ``p - 1``. Frequencies converge from above, with an error of order
    ``2 (2 p - m)`` in the element length. Coefficients polynomial in x are integrated exactly, others by Gauss's rule
    with eight points an element; place the jumps of a coefficient at nodes. Interior places that are not all numbers
    must be stated in ascending order, those of ``nodes`` first.

    Raises
    ------
    HamiltonError
        If the Lagrangian is not quadratic or has more than two time derivatives, or an essential condition prescribes
        a motion that varies in time: take the displacement relative to it instead.

    Examples
    --------
    >>> from sympy import Function, symbols
    >>> x, t, T, rho, l = symbols("x t T rho l")
    >>> y = Function("y")(x, t)
    >>> matrices = ritz(rho*y.diff(t)**2/2 - T*y.diff(x)**2/2, elements=1, fields=[y], x=x, domain=(0, l), t=t,
    ...                 essential=[y.subs(x, 0), y.subs(x, l)])
    >>> matrices.stiffness
    Matrix([
    [2*T*l/15,  -T*l/30],
    [ -T*l/30, 2*T*l/15]])
    """
    count = checks.count("elements", elements)
    result = problem if isinstance(problem, HamiltonResult) else hamilton(problem, **arguments)
    step, begin = result.unused_symbol("h"), result.unused_symbol("x_e")
    return _Mesh(weak_form(result.variation), count, tuple(nodes), step, begin).matrices()


def ordered(places: Iterable[Expr]) -> list[Expr]:
    """Return interior places in ascending order if they are numbers, else unchanged."""
    found = list(places)
    return sorted(found, key=float) if all(place.is_number for place in found) else found


@lru_cache
def hermite(size: int) -> tuple[Poly, ...]:
    """Return the Hermite polynomials on (0, 1) for values and derivatives below order ``size`` at 0, then at 1.

    Examples
    --------
    >>> hermite(1)
    (Poly(-xi + 1, xi, domain='QQ'), Poly(xi, xi, domain='QQ'))
    """
    xi = Symbol("xi")
    powers = [Poly(xi**n, xi, domain="QQ") for n in range(2 * size)]
    derivatives = [[power.diff((0, order)) for power in powers] for order in range(size)]
    conditions = Matrix([[p.eval(end) for p in row] for end in (0, 1) for row in derivatives])
    columns = conditions.inv()
    return tuple(Poly(list(columns[::-1, k]), xi, domain="QQ") for k in range(2 * size))


class _Mesh:
    """Numbering of the unknowns and integrals over one element."""

    def __init__(self, weak: WeakForm, elements: int, nodes: tuple[Expr, ...], step: Symbol, begin: Symbol) -> None:
        self.weak, self.each = weak, elements
        if max(weak.powers, default=0) > 2:
            raise HamiltonError("ritz: more than two time derivatives; there is no mass matrix")
        weak.variation.elimination.check_homogeneous("ritz")
        self.nodes = ordered(dict.fromkeys((*map(sympify, nodes), *(point.place for point in weak.points))))
        self.elements = elements * (len(self.nodes) + 1)
        self.space = weak.variation.space
        self.step, self.begin = step, begin
        self.sizes = [max(order, 2) for order in weak.variation.orders]
        self.offsets = [sum(self.sizes[:number]) for number in range(len(self.sizes) + 1)]
        self.lumped = weak.fields()[2]

    @property
    def width(self) -> int:
        """Unknowns of one node."""
        return self.offsets[-1]

    @property
    def broken(self) -> list[int]:
        """Unknowns of a node that may jump between spans: slopes of fields with first derivatives in the density."""
        orders = self.weak.variation.orders
        return [self.offsets[f] + j for f, size in enumerate(self.sizes) for j in range(max(orders[f], 1), size)]

    def _unknowns(self, element: int) -> list[int]:
        """Return the unknowns of both nodes of an element; discontinuous ones have a second one right of a node."""
        found = list(range(element * self.width, (element + 2) * self.width))
        node, within = divmod(element, self.each)
        if node and not within:
            first = (self.elements + 1) * self.width + len(self.lumped) + (node - 1) * len(self.broken)
            for number, unknown in enumerate(self.broken):
                found[unknown] = first + number
        return found

    def index(self, jet: Jet) -> int:
        """Return the index of the unknown of an end displacement or a coordinate."""
        if jet in self.lumped:
            return (self.elements + 1) * self.width + self.lumped.index(jet)
        if isinstance(jet.place, int):
            node = self.each * (self.nodes.index(self.weak.points[jet.place].place) + 1)
        else:
            node = self.elements if jet.place == "right" else 0
        return node * self.width + self.offsets[jet.unknown] + jet.space

    def matrices(self) -> RitzMatrices:
        """Integrate over one element and collect the numbering."""
        nodal = [Jet(f, j, 0, None) for f, size in enumerate(self.sizes) for j in range(size)]
        labels = tuple(self.space.form(jet) for jet in [*nodal, *self.lumped])
        tail = tuple(map(self.index, self.lumped))
        element = {power: self._integrated(power) for power in range(3)}
        ends = {power: self._pointwise(power) for power in range(3)}
        start, end = self.space.ends["left"], self.space.ends["right"]
        return RitzMatrices(
            self.elements,
            tuple((left, right - left) for left, right in pairwise((start, *self.nodes, end))),
            element[0],
            element[1],
            element[2],
            self._load(),
            self.step,
            self.begin,
            tuple((*self._unknowns(e), *tail) for e in range(self.elements)),
            ends[0],
            ends[1],
            ends[2],
            {self.index(jet): value for jet, value in self.weak.discrete_load.items()},
            self._restraint(),
            labels,
            start,
            end - start,
        )

    def _pointwise(self, power: int) -> Entries:
        form = _of_power(self.weak.discrete, power)
        return {(self.index(p), self.index(q)): value for (p, q), value in form.items()}

    def _restraint(self) -> tuple[dict[int, Expr], ...]:
        factors = self.weak.variation.elimination.factors
        fixed = {
            self.index(jet): {self.index(other): factor for other, factor in row.items()}
            for jet, row in factors.items()
        }
        for place, point in enumerate(self.weak.points):
            fixed |= {self.index(jet._replace(place=place)): {} for jet in point.held}
        total = (self.elements + 1) * self.width + len(self.lumped) + len(self.nodes) * len(self.broken)
        number = {unknown: free for free, unknown in enumerate(u for u in range(total) if u not in fixed)}
        rows = (fixed.get(unknown, {unknown: S.One}) for unknown in range(total))
        return tuple({number[other]: factor for other, factor in row.items()} for row in rows)

    # ------------------------------------------------------------------------------------------------ one element

    def _integrated(self, power: int) -> Matrix:
        size = 2 * self.width + len(self.lumped)
        total = zeros(size, size)
        for (p, q), value in _of_power(self.weak.inside, power).items():
            rows, columns = self._shapes(p), self._shapes(q)
            moments = self._moments(value)
            for (i, a), (j, b) in product(rows.items(), columns.items()):
                scale = self.step ** (a[1] + b[1] + 1)
                total[i, j] += scale * moments(a[0] * b[0])
        return total

    def _load(self) -> Matrix:
        total = zeros(2 * self.width + len(self.lumped), 1)
        for jet, value in self.weak.inside_load.items():
            moments = self._moments(value)
            for i, (polynomial, power) in self._shapes(jet).items():
                total[i] += self.step ** (power + 1) * moments(polynomial)
        return total

    def _shapes(self, jet: Jet) -> Mapping[int, tuple[Poly, int]]:
        """Return, by unknown of the element, a derivative of its shape on (0, 1) and the power of h that scales it."""
        if jet in self.lumped:
            return {2 * self.width + self.lumped.index(jet): (Poly(1, Symbol("xi"), domain="QQ"), 0)}
        size, offset = self.sizes[jet.unknown], self.offsets[jet.unknown]
        shapes = {}
        for number, polynomial in enumerate(hermite(size)):
            node, order = divmod(number, size)
            shapes[node * self.width + offset + order] = (polynomial.diff((0, jet.space)), order - jet.space)
        return shapes

    def _moments(self, coefficient: Expr) -> Callable[[Poly], Expr]:
        """Return the linear functional ``polynomial -> integral of coefficient * polynomial over (0, 1)``."""
        xi = Dummy("xi")
        moved = coefficient.subs(self.space.x, self.begin + self.step * xi)
        if coefficient.is_polynomial(self.space.x):
            terms = Poly(moved, xi).terms() if moved.has(xi) else [((0,), moved)]

            def exact(polynomial: Poly) -> Expr:
                whole = ((n, c * _moment(polynomial, n)) for (n,), c in terms)
                return sum((value for _, value in whole), S.Zero)

            return exact
        points, weights = gauss_legendre(_POINTS, _DIGITS)
        values = [
            ((1 + point) / 2, weight / 2 * moved.subs(xi, (1 + point) / 2))
            for point, weight in zip(points, weights, strict=True)
        ]
        return lambda polynomial: sum((value * polynomial.eval(point) for point, value in values), S.Zero)


def _moment(polynomial: Poly, order: int) -> Expr:
    """Return the integral of ``xi**order * polynomial`` over (0, 1)."""
    return sum((c / Rational(n + order + 1) for (n,), c in polynomial.terms()), S.Zero)


def _of_power(form: Bilinear, power: int) -> dict[tuple[Jet, Jet], Expr]:
    return {pair: entry[power] for pair, entry in form.items() if power in entry}
