"""Structures of several members, each with fields on an interval of its own: joined into one model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from sympy import Derivative, Dummy, Expr, S, Subs, Symbol, cos, preorder_traversal, sin, sympify
from sympy.core.function import AppliedUndef

from cra_sym.checks import instance, shown
from cra_sym.mechanics.points import at_place
from cra_sym.model.lagrangian import Model

__all__ = ["Member", "joined"]


@dataclass(frozen=True)
class Member:
    """One member of a structure: a beam, a rod or a string along an interval of its own.

    Parameters
    ----------
    density : Expr
        Lagrangian density on (0, length), in the fields and their derivatives by x.
    fields : sequence of applied undefined functions
        ``v(x, t)``: other functions than those of other members. For `start` and `end` of a member in a plane: the
        displacement across the member, or first that along it and then that across it.
    x : Symbol
        Position along the member.
    length : Expr
    angle : Expr
        Direction of the member in its plane, rad, counter-clockwise.
    inside : sequence of (place, Expr), optional
        Lagrangian terms at places between 0 and the length.

    Examples
    --------
    A post that stands on its end, stretched and bent: along the axes of the plane its foot moves by

    >>> from sympy import Function, pi, symbols
    >>> import cra_sym as cra
    >>> from cra_sym.symbols import t, x
    >>> u, v = Function("u")(x, t), Function("v")(x, t)
    >>> l, m, EA, EI = symbols("l m EA EI")
    >>> density = m * (u.diff(t)**2 + v.diff(t)**2) / 2 - EA * u.diff(x)**2 / 2 - EI * v.diff(x, 2)**2 / 2
    >>> cra.Member(density, (u, v), x, l, angle=pi / 2).start[:2]
    (-v(0, t), u(0, t))
    """

    density: Expr
    fields: tuple[AppliedUndef, ...]
    x: Symbol
    length: Expr
    angle: Expr = S.Zero
    inside: tuple[tuple[Expr, Expr], ...] = ()

    def __post_init__(self) -> None:
        for name in ("density", "length", "angle"):
            object.__setattr__(self, name, sympify(getattr(self, name), strict=True))
        object.__setattr__(self, "fields", tuple(self.fields))
        object.__setattr__(self, "inside", tuple(tuple(pair) for pair in self.inside))

    @property
    def start(self) -> tuple[Expr, ...]:
        """Displacements of the end at x = 0: along the axes of the plane, and the rotation."""
        return self._at(S.Zero)

    @property
    def end(self) -> tuple[Expr, ...]:
        """Displacements of the end at x = length: along the axes of the plane, and the rotation."""
        return self._at(self.length)

    def _at(self, place: Expr) -> tuple[Expr, ...]:
        across = self.fields[-1]
        turned = across.diff(self.x).subs(self.x, place)
        if len(self.fields) == 1:
            return across.subs(self.x, place), turned
        along, moved = (field.subs(self.x, place) for field in self.fields)
        return (
            cos(self.angle) * along - sin(self.angle) * moved,
            sin(self.angle) * along + cos(self.angle) * moved,
            turned,
        )

    def scaled(self, expression: Expr) -> Expr:
        """Return an expression in the fields with the share of the length in place of x."""
        marks = {node: Dummy() for node in _functions(expression, self.fields)}
        moved = expression.xreplace(marks).subs(self.x, self.length * self.x)
        return moved.xreplace({mark: self._node(node) for node, mark in marks.items()})

    def _node(self, node: Expr) -> Expr:
        """Return a field, a derivative of it or a value at a place in the share of the length."""
        place, function = at_place(node, self.x) or (None, node)
        counts = dict(function.variable_count) if isinstance(function, Derivative) else {}
        value = function / self.length ** counts.get(self.x, 0)
        if place is None:
            return value
        share = S.One if place == self.length else place / self.length
        return function.subs(self.x, share) / self.length ** counts.get(self.x, 0)


def joined(
    members: Sequence[Member],
    *,
    t: Symbol,
    joints: Sequence[tuple[Sequence[Expr], Sequence[Expr]]] = (),
    essential: Sequence[Expr] = (),
    terms: Expr = S.Zero,
    virtual_work: Sequence[tuple[Expr, Expr, Expr | float | str | None]] = (),
    units: Mapping[Expr, str] | None = None,
    coordinates: Sequence[AppliedUndef] = (),
    prescribed: Sequence[AppliedUndef] = (),
    definitions: Mapping[Symbol, Expr] | None = None,
    small: tuple[Symbol, Symbol] | None = None,
) -> Model:
    """Return the model of a structure of several members.

    The coordinate x of this model runs from 0 to 1 along all members at once: it is the position over the length of
    each member, so a derivative by it is that by the position times the length.

    Parameters
    ----------
    members : sequence of Member
        All with the same x.
    t : Symbol
    joints : sequence of (end, end)
        Ends that move together, such as ``(column.end, beam.start)``.
    essential : sequence of Expr
        Further expressions that vanish, such as ``*column.start`` of a clamped foot. At interior places it is a
        support.
    terms : Expr
        Lagrangian of masses and springs at ends, in evaluated forms such as ``m * v.subs(x, L).diff(t)**2 / 2``.
    virtual_work : sequence of (force, displacement, None)
        Non-conservative forces on displacements of ends, in evaluated forms.
    units, coordinates, prescribed, definitions, small : optional
        As of :class:`Model`.

    Returns
    -------
    Model

    Raises
    ------
    TypeError, ValueError
        If two members share a field or differ in x, or as :class:`Model`.

    Examples
    --------
    A rod of two parts, of which the second is twice as stiff, held at both ends:

    >>> from sympy import Function, symbols
    >>> x, t = symbols("x t")
    >>> u, w = (Function(name)(x, t) for name in "uw")
    >>> one = Member((u.diff(t)**2 - u.diff(x)**2) / 2, [u], x, 1)
    >>> two = Member((w.diff(t)**2 - 2 * w.diff(x)**2) / 2, [w], x, 3)
    >>> rod = joined([one, two], t=t, joints=[([u.subs(x, 1)], [w.subs(x, 0)])], essential=[u.subs(x, 0), w.subs(x, 3)])
    >>> rod.natural_frequencies({}, modes=2).round(4)
    array([0.1525, 0.3269])
    """
    for number, member in enumerate(members):
        instance(f"members[{number}]", member, Member)
    x = members[0].x
    fields = [field for member in members for field in member.fields]
    if any(member.x != x for member in members) or len({field.func for field in fields}) != len(fields):
        raise ValueError("members: all must have the same x, and each fields of its own")

    def moved(expression: Expr) -> Expr:
        """Return an expression in values at places, each in the share of its member's length."""
        given = sympify(expression, strict=True)
        for member in members:
            nodes = {node: member._node(node) for node in _functions(given, member.fields)}
            if any(at_place(node, x) is None for node in nodes):
                raise ValueError(
                    f"joined: {shown(expression)} must hold fields at places, such as {member.fields[0]} at 0"
                )
            given = given.xreplace(nodes)
        return given

    pairs = [(first, second) for one, other in joints for first, second in zip(one, other, strict=True)]
    inside = [(place / m.length, m.scaled(term)) for m in members for place, term in m.inside]
    return Model(
        sum((member.length * member.scaled(member.density) for member in members), S.Zero),
        fields=fields,
        x=x,
        domain=(0, 1),
        t=t,
        left=moved(terms),
        essential=[moved(condition) for condition in essential] + [moved(first - second) for first, second in pairs],
        inside=inside,
        virtual_work=[(moved(force), moved(displacement), place) for force, displacement, place in virtual_work],
        units={x: "1", **(units or {})},
        coordinates=coordinates,
        prescribed=prescribed,
        definitions=definitions,
        small=small,
    )


def _functions(expression: Expr, fields: Sequence[AppliedUndef]) -> list[Expr]:
    """Return the outermost derivatives and values of some fields."""
    heads = {field.func for field in fields}
    found: dict[Expr, None] = {}
    walk = preorder_traversal(expression)
    for node in walk:
        if isinstance(node, (AppliedUndef, Derivative, Subs)) and {f.func for f in node.atoms(AppliedUndef)} & heads:
            found[node] = None
            walk.skip()
    return list(found)
