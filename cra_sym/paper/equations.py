"""The paper's numbered equations: one registry, filled by the sections' modules, each equation built on first use.

A section's module writes one small function an equation, and one each for a proof and for a trial in numbers::

    @numbered(1, "displacement", "definition")
    def displacement():
        '''The statement, in words.'''
        return Eq(y, w + v)

    @derived(22, "determinant", (20,))
    def determinant():
        '''The statement, in words.'''
        matrix = reduced_system().lhs.args[0]
        yield "System", "What was done, in a sentence.", matrix
        return Eq(matrix.det(), 0)

    @proves(1)
    def prove_displacement():
        '''The independent route, in words.'''
        yield displacement().rhs.subs(v, 0) - w

    @samples(1)
    def sample_displacement():
        '''The independent route, in words.'''
        return isclose(...)

A proof yields expressions that must vanish; :func:`cra_sym.mechanics.identities.vanishes` decides whether they do.

Derived equations come from the Lagrangian in :mod:`cra_sym.arm.lagrangian` and the functions of
:mod:`cra_sym.mechanics`; the references are written by hand, or computed by shooting, in :mod:`cra_sym.paper.oracles`.
If a term of the Lagrangian is changed, the equations change with it and their proofs fail.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, wraps
from importlib import import_module
from operator import index
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import numpy as np

from cra_sym.checks import default_floating_point, shown

if TYPE_CHECKING:
    from cra_sym.mechanics.steps import Steps

__all__ = ["Derivation", "Equation", "Proof", "derived", "equation", "equations", "numbered", "proves", "samples"]

Number = int | str
R = TypeVar("R")
Kind = Literal["definition", "assumption", "derived"]
Evidence = Literal["proved", "sampled"]
#: What a proof yields: expressions that must vanish identically, and Boolean statements such as equal dimensions.
Proof = Iterator[Any]
#: Name of a step, a sentence that describes it, and its result.
Stage = tuple[str, str, Any]
#: Builder of a derived equation: it yields the intermediate steps and returns the equation.
Derivation = Generator[Stage, None, R]

#: Module that builds each equation; a new module adds a line here.
_HOMES: dict[str, range] = {
    "cra_sym.paper.energy": range(1, 8),
    "cra_sym.paper.motion": range(8, 11),
    "cra_sym.paper.modal_dynamics": range(11, 14),
    "cra_sym.paper.joint": range(14, 17),
    "cra_sym.paper.orthogonality": range(16, 17),
    "cra_sym.paper.modes": range(17, 20),
    "cra_sym.paper.frequency_equation": range(20, 24),
    "cra_sym.paper.shapes": range(24, 27),
    "cra_sym.paper.limits": range(27, 31),
    "cra_sym.paper.implicit": range(31, 33),
    "cra_sym.paper.driven": range(33, 35),
    "cra_sym.paper.excited": range(35, 37),
    "cra_sym.paper.resonance": range(37, 49),
    "cra_sym.paper.stability_boundary": range(49, 50),
    "cra_sym.paper.literal_route": range(42, 50),
}

_EQUATIONS: dict[Number, Equation] = {}
_PROOFS: dict[Number, Callable[[], Proof]] = {}
_SAMPLES: dict[Number, Callable[[], bool]] = {}


@dataclass(frozen=True, repr=False)
class Equation:
    """One numbered equation of the paper.

    Attributes
    ----------
    number : int or str
        The paper's number; a letter marks a companion the paper does not have, such as ``"11a"``.
    title, statement : str
        What the equation is, in a few words and in a sentence.
    kind : {"definition", "assumption", "derived"}
    derived_from : tuple
        Numbers of the equations this one rests upon.
    source : str
        Where it is built, ``"module:function"``.
    """

    number: Number
    title: str
    kind: Kind
    derived_from: tuple[Number, ...]
    statement: str
    source: str
    _build: Callable[[], Any] = field(compare=False)
    _stages: Callable[[], tuple[Stage, ...]] = field(default=tuple, compare=False)
    _shown: Callable[[], Any] | None = field(default=None, compare=False)

    @property
    def expression(self) -> Any:
        """The SymPy equation, or a tuple of them; derived on first use."""
        return self._build()

    @property
    def shown(self) -> Any:
        """What is displayed: the expression or, where that is too long for a page, the same in terms of the equations
        it rests on."""
        return self.expression if self._shown is None else self._shown()

    @property
    def steps(self) -> Steps:
        """How the equation comes from those it rests on; the last step is the equation itself.

        Empty for a definition or an assumption.

        Examples
        --------
        >>> from cra_sym import equation
        >>> [step.name for step in equation(22).steps]
        ['matrix of the reduced system', 'determinant']
        >>> equation(1).steps
        ()
        """
        from cra_sym.mechanics.steps import Step, Steps

        if self.kind != "derived":
            return Steps()
        before = tuple(f"({number})" for number in self.derived_from)
        chain: list[Step] = []
        for name, statement, expression in self._stages():
            chain.append(Step(name, statement, expression, before))
            before = (name,)
        return Steps((*chain, Step(self.title, self.statement, self.shown, before, self.checked_by, tag=self.number)))

    @property
    def checked_by(self) -> str:
        """Description of the independent routes that :meth:`check` takes."""
        exact = "Proved" if self.kind == "derived" else "Exact"
        routes: dict[str, Mapping[Number, Callable[[], Any]]] = {exact: _PROOFS, "Sampled": _SAMPLES}
        return " ".join(f"{how}: {_text(of[self.number])}" for how, of in routes.items() if self.number in of)

    @property
    def evidence(self) -> Evidence:
        """Whether :meth:`check` proves exact identities, or only compares numerical samples because no exact route
        exists.

        For a definition or an assumption, necessary consequences are proved.
        """
        return "proved" if self.number in _PROOFS else "sampled"

    @default_floating_point
    def check(self) -> bool:
        """Tell whether the independent routes confirm the equation: the proof if there is one, then the numbers.

        Raises
        ------
        NotImplementedError
            If there is neither.
        """
        if self.number not in _PROOFS and self.number not in _SAMPLES:
            raise NotImplementedError(f"equation ({self.number}) has no check")
        return self.prove() is not False and bool(_SAMPLES.get(self.number, lambda: True)())

    def prove(self) -> bool | None:
        """Tell whether the proof holds, without random numbers or rounding; None if there is no proof."""
        if self.number not in _PROOFS:
            return None
        return all(map(_decide, _PROOFS[self.number]()))

    def latex(self, label: str | None = None) -> str:
        r"""Return the equation as LaTeX for an article, with the paper's number; its lines fit an article's page.

        Parameters
        ----------
        label : str, optional
            What ``\ref`` calls it; by default ``eq:`` and the number.

        Examples
        --------
        >>> from cra_sym import equation
        >>> print(equation(1).latex())
        \begin{equation}\tag{1}\label{eq:1}
        \begin{gathered} y = v + w \end{gathered}
        \end{equation}
        """
        from cra_sym.mechanics.steps import display_latex

        name = f"eq:{self.number}" if label is None else label
        body = display_latex(self.shown)
        return rf"\begin{{equation}}\tag{{{self.number}}}\label{{{name}}}" + f"\n{body}\n" + r"\end{equation}"

    def __reduce__(self) -> tuple[Callable[[Number], Equation], tuple[Number]]:
        return equation, (self.number,)

    def __repr__(self) -> str:
        return f"Equation ({self.number}), {self.title}"

    def _formula(self) -> str:
        from cra_sym.mechanics.steps import display_latex

        return display_latex(self.shown, tag=self.number)

    def _repr_latex_(self) -> str:
        return rf"$\displaystyle {self._formula()}$"

    def _repr_markdown_(self) -> str:
        from cra_sym.mechanics.steps import mathematics

        sources = ", ".join(f"({number})" for number in self.derived_from)
        origin = f"{self.kind} from {sources}" if sources else self.kind
        return f"**({self.number}) {self.title}**, {origin}. {mathematics(self.statement)}\n\n$${self._formula()}$$"


def _text(function: Callable[..., Any]) -> str:
    return " ".join((inspect.getdoc(function) or "").split())


def _decide(part: Any) -> bool:
    """Tell whether one item of a proof holds."""
    from cra_sym.mechanics.identities import vanishes

    return part if isinstance(part, bool) else vanishes(part)


def numbered(
    number: Number,
    title: str,
    kind: Literal["definition", "assumption"],
    derived_from: tuple[Number, ...] = (),
) -> Callable[[Callable[[], R]], Callable[[], R]]:
    """Register the decorated function, whose docstring is the statement, as the builder of an equation."""

    def register(function: Callable[[], R]) -> Callable[[], R]:
        build = cache(function)
        _register(function, number, title, kind, derived_from, build)
        return build

    return register


def derived(
    number: Number,
    title: str,
    derived_from: tuple[Number, ...],
    shown: Callable[[], Any] | None = None,
) -> Callable[[Callable[[], Derivation[R]]], Callable[[], R]]:
    """Register the decorated generator, whose docstring is the statement, as the derivation of an equation.

    The generator yields the intermediate steps and returns the equation; the decorated name is a function that returns
    the equation. ``shown`` builds what is displayed in place of an expression that is too long for a page.
    """

    def register(function: Callable[[], Derivation[R]]) -> Callable[[], R]:
        carried_out = cache(lambda: _carry_out(function))

        @wraps(function)
        def build() -> R:
            return carried_out()[1]

        _register(function, number, title, "derived", derived_from, build, lambda: carried_out()[0], shown)
        return build

    return register


def _carry_out(function: Callable[[], Derivation[R]]) -> tuple[tuple[Stage, ...], R]:
    """Return the intermediate steps of a derivation and its result."""
    stages: list[Stage] = []
    work = function()
    while True:
        try:
            stages.append(next(work))
        except StopIteration as end:
            return tuple(stages), end.value


def _register(
    function: Callable[[], Any],
    number: Number,
    title: str,
    kind: Kind,
    derived_from: tuple[Number, ...],
    build: Callable[[], Any],
    stages: Callable[[], tuple[Stage, ...]] = tuple,
    shown: Callable[[], Any] | None = None,
) -> None:
    source = f"{function.__module__}:{function.__qualname__}"
    if number in _EQUATIONS and _EQUATIONS[number].source != source:
        raise ValueError(f"equation ({number}) is already built by {_EQUATIONS[number].source}")
    statement = _text(function)
    _EQUATIONS[number] = Equation(number, title, kind, derived_from, statement, source, build, stages, shown)


def proves(number: Number) -> Callable[[Callable[[], Proof]], Callable[[], Proof]]:
    """Register the decorated generator, whose docstring names the route, as the proof of an equation."""
    return _registered(_PROOFS, number)


def samples(number: Number) -> Callable[[Callable[[], bool]], Callable[[], bool]]:
    """Register the decorated function, whose docstring names the route, as the numerical check of an equation."""
    return _registered(_SAMPLES, number)


def _registered(routes: dict[Number, Callable[[], R]], number: Number) -> Callable[[Callable[[], R]], Callable[[], R]]:
    def register(function: Callable[[], R]) -> Callable[[], R]:
        routes[number] = function
        return function

    return register


def _order(number: Number) -> tuple[int, str]:
    text = str(number)
    digits = text.rstrip("abcdefghijklmnopqrstuvwxyz")
    return int(digits), text[len(digits) :]


def equation(number: Number) -> Equation:
    """Return the paper's equation ``number``, such as ``23``, or a companion such as ``"11a"``.

    Raises
    ------
    TypeError
        If ``number`` is neither an integer nor a string.
    ValueError
        If there is no such equation.

    Examples
    --------
    >>> from cra_sym import equation
    >>> equation(1)
    Equation (1), displacement
    >>> equation(1).expression
    Eq(y(x, t), v(x, t) + w(t))
    >>> equation(1).kind, equation(5).derived_from
    ('definition', (2, 3, 4, 6, '16c'))
    """
    if isinstance(number, (bool, np.bool_)):
        raise TypeError(f"number = {number}: must be an integer, or a string such as '11a'")
    if not isinstance(number, str):
        try:
            number = index(number)
        except TypeError:
            raise TypeError(f"number = {shown(number)}: must be an integer, or a string such as '11a'") from None
    elif number.isdecimal():
        number = int(number)
    if number not in _EQUATIONS:
        _load()
    try:
        return _EQUATIONS[number]
    except KeyError:
        companions = [key for key in _EQUATIONS if isinstance(key, str)]
        whole = [key for key in _EQUATIONS if isinstance(key, int)]
        also = f", and {', '.join(map(repr, sorted(companions, key=_order)))}" if companions else ""
        raise ValueError(f"number = {shown(number)}: must be from {min(whole)} to {max(whole)}{also}") from None


def equations(*, companions: bool = False) -> tuple[Equation, ...]:
    """Return all equations in the paper's order; with ``companions``, also those the paper does not number.

    Examples
    --------
    >>> from cra_sym import equations
    >>> len(equations()), equations()[0]
    (49, Equation (1), displacement)
    >>> [e.number for e in equations(companions=True)][9:13]
    [10, '10a', '10b', '10c']
    """
    _load()
    return tuple(_EQUATIONS[key] for key in sorted(_EQUATIONS, key=_order) if companions or isinstance(key, int))


def _load() -> None:
    for module in _HOMES:
        import_module(module)
