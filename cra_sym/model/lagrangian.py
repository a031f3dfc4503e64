"""One object from any polynomial Lagrangian to its equations, complete spectrum, mode shapes and kernels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, Literal

from sympy import Expr, Symbol, sympify
from sympy.core.function import AppliedUndef

from cra_sym.cached import cached_property
from cra_sym.checks import mapping
from cra_sym.kernels import Kernel, kernel
from cra_sym.mechanics import HamiltonResult, Modal, StateForm, hamilton, ritz, separate, state_form
from cra_sym.mechanics.jets import listed
from cra_sym.mechanics.polynomials import linearised
from cra_sym.mechanics.weak import weak_form
from cra_sym.model.asked import Asked
from cra_sym.model.excitations import LagrangianTerms
from cra_sym.model.excited import checked_small, refuse_small, without_oscillations
from cra_sym.model.galerkin import Ritz
from cra_sym.model.hysteresis import Element
from cra_sym.model.numerics import Numerics
from cra_sym.model.parameters import parameters
from cra_sym.model.pieces import arguments, expressions_in, options_of, undamped
from cra_sym.model.slip_terms import check_displacements, checked_hysteresis, expressions_of
from cra_sym.model.symmetry import asymmetry
from cra_sym.model.system import TOLERANCE, System
from cra_sym.model.units import check_dimensions, named_units, symbol_units
from cra_sym.model.work import work_as_energy
from cra_sym.si import Numbers

__all__ = ["Model"]


class Model(Asked):
    r"""A one-dimensional continuum defined by its Lagrangian.

    Parameters
    ----------
    density : Expr
        Lagrangian density: kinetic minus potential energy per length.
    fields : sequence of applied undefined functions
        ``v(x, t)``, as many as are needed.
    x, t : Symbol
    domain : (left, right)
        End coordinates.
    left, right : Expr, optional
        Lagrangian of each end, in ``v(x, t)`` and its derivatives, understood at that end. Zero (the default) is a free
        end.
    essential : sequence of Expr, optional
        Expressions that vanish at an end, such as ``v.subs(x, 0)``. Measure a field from a prescribed displacement. At
        an interior place, ``v.subs(x, a)`` or ``v.diff(x).subs(x, a)``, it is a support.
    inside : sequence of (place, Expr), optional
        Lagrangian terms of interior places: point masses, springs, rotary inertias, in ``v(x, t)`` and its derivatives
        as at an end. ``DiracDelta(x - a)`` times a term in the density means the same. Places
        must be between the ends.
    coordinates : sequence of applied undefined functions, optional
        Lumped coordinates ``w(t)``.
    prescribed : sequence of applied undefined functions, optional
        Motions ``w(t)`` that are given, see `response`. A force ``F(t)`` needs no mention.
    virtual_work : sequence of (force, displacement, place), optional
        Non-conservative forces; place is 'left', 'right', 'domain' (per length), an interior place, or None (on a
        coordinate).
    units : mapping, optional
        Units of symbols of the model that are not those of ``cra_sym.symbols``, such as ``{c: "N s/m"}``. Every term
        whose symbols all have a known unit must be an energy (per length in the density).
    definitions : mapping of Symbol to Expr, optional
        Symbols of the pieces above that stand for expressions, such as ``{A: b*h}``: the parameters of the model are
        then those of the expressions.
    small : (Symbol, Symbol), optional
        epsilon and varpi of a Lagrangian that is periodic in time: terms, loads and forces with cosines and sines of
        ``n*varpi*t + phase``, n a whole number; terms quadratic in the unknowns must be proportional to epsilon.
        These two symbols are not parameters and take no value. Analyses leave these terms out, except those of
        parametric excitation (``cra_sym.growth_rate``, ``cra_sym.stability_boundary``), which take `excitation`.
    quadratures : mapping of applied undefined function to Expr, optional
        Fields s(x, t) that are integrals from the left end, such as the foreshortening ``{s: v.diff(x)**2/2}``; see
        :func:`cra_sym.mechanics.hamilton`.
    hysteresis : sequence of (element, displacement, place), optional
        Elastic-slip elements, :class:`cra_sym.Jenkins` or :class:`cra_sym.Iwan`, and the displacement, slope or
        coordinate they act on; place as in ``virtual_work``. Equations and every linear analysis take them stuck.

    Raises
    ------
    TypeError, ValueError
        Names what is not an expression, the term that cannot be treated, or whose dimension is wrong.

    Notes
    -----
    Values are given as a mapping from symbols, or their names, to numbers or arrays that broadcast together; the
    batch axes come first in every result. The stiffness of a spring at an end may be ``inf``.

    Examples
    --------
    A string with an end mass and a spring:

    >>> from sympy import Function, symbols
    >>> x, t, T, rho, l, m, k = symbols("x t T rho l m k")
    >>> y = Function("y")(x, t)
    >>> string = Model(rho*y.diff(t)**2/2 - T*y.diff(x)**2/2, fields=[y], x=x, domain=(0, l), t=t,
    ...                left=-k*y**2/2, right=m*y.diff(t)**2/2)
    >>> string.natural_frequencies({T: 1, rho: 1, l: 1, m: 0, k: float("inf")}, modes=3)
    array([0.25, 0.75, 1.25])
    """

    def __init__(
        self,
        density: Expr,
        *,
        fields: Sequence[AppliedUndef],
        x: Symbol,
        domain: tuple[Expr | float, Expr | float],
        t: Symbol,
        left: Expr | None = None,
        right: Expr | None = None,
        essential: Sequence[Expr] = (),
        inside: Sequence[tuple[Expr, Expr]] = (),
        coordinates: Sequence[AppliedUndef] = (),
        prescribed: Sequence[AppliedUndef] = (),
        virtual_work: Sequence[tuple[Expr, Expr, Expr | float | str | None]] | None = None,
        units: Mapping[Expr, str] | None = None,
        definitions: Mapping[Symbol, Expr] | None = None,
        small: tuple[Symbol, Symbol] | None = None,
        quadratures: Mapping[AppliedUndef, Expr] | None = None,
        hysteresis: Sequence[tuple[Element, Expr, Expr | float | str | None]] = (),
    ) -> None:
        self._pieces: dict[str, Any] = {
            "density": density,
            "fields": listed("fields", fields),
            "x": x,
            "domain": listed("domain", domain),
            "t": t,
            "left": left,
            "right": right,
            "essential": listed("essential", () if essential is None else essential),
            "inside": tuple(tuple(pair) for pair in listed("inside", () if inside is None else inside)),
            "coordinates": listed("coordinates", coordinates),
            "prescribed": listed("prescribed", prescribed),
            "virtual_work": tuple(
                tuple(work) for work in listed("virtual_work", () if virtual_work is None else virtual_work)
            ),
            "units": tuple(mapping("units", units, "symbols to units").items()),
            "definitions": tuple(mapping("definitions", definitions, "symbols to expressions").items()),
            "small": checked_small(small, (x, t)),
            "quadratures": tuple(mapping("quadratures", quadratures, "functions s(x, t) to integrands").items()),
            "hysteresis": checked_hysteresis(hysteresis),
        }
        if self._pieces["hysteresis"]:
            check_displacements(self)
        self.options, self._stated_inside = options_of(self._pieces)
        self.equations: HamiltonResult = hamilton(**self.options)
        """Equations of motion, boundary conditions and the steps that led there."""
        stated = ((f"{end} end", self.options[end]) for end in ("left", "right"))
        ends = {label: sympify(term, strict=True) for label, term in stated if term is not None}
        self.equations.variation.elimination.check_homogeneous("Model")
        density, work = self.options["density"], self.options["virtual_work"]
        ends |= {f"term inside at {x} = {place}": sympify(term, strict=True) for place, term in self._stated_inside}
        given = [*expressions_in(self.options), *ends.values(), *expressions_of(self._pieces)]
        given += [q.integrand for q in self.equations.quadratures]
        self.symbols: tuple[Symbol, ...] = parameters(given, self.equations)
        """The parameters: every symbol but x and t, by name."""
        declared = named_units(units, [*given, *self.options["fields"], *self.options["coordinates"]])
        if self._pieces["small"] is not None:
            self.symbols = tuple(symbol for symbol in self.symbols if symbol not in self._pieces["small"])
            self._steady, self.oscillating_terms = without_oscillations(self)
            self._steady._pieces["units"] = tuple(declared.items())
            return
        unknowns = (x, t, *self.equations.fields, *self.equations.coordinates, *self.options["prescribed"])
        check_dimensions(sympify(density, strict=True), ends, declared, work, unknowns)

    @cached_property
    def without_hysteresis(self) -> Model:
        """The model without its elastic-slip elements, whose modes nonlinear results use; itself if it has none."""
        return self.replace(hysteresis=()) if self._pieces["hysteresis"] else self

    def replace(self, **changes: object) -> Model:
        """Return the same model with some of what it was made of replaced.

        Parameters
        ----------
        **changes
            Arguments of :class:`Model`.

        Raises
        ------
        TypeError, ValueError
            If a name is not an argument of :class:`Model`; otherwise as :class:`Model`.

        Examples
        --------
        >>> import cra_sym as cra
        >>> from cra_sym.symbols import v
        >>> density, left, right = cra.paper_lagrangian()
        >>> k_f = Symbol("k_f")
        >>> cra.Arm.nominal().model.replace(density=density - k_f * v**2 / 2)
        <Model of v(x, t) with parameters E, J_e, L, b, h, k_f, k_r, k_t, m_b, m_e, rho>
        """
        unknown = [name for name in changes if name not in self._pieces]
        if unknown:
            raise TypeError(f"{unknown[0]!r} is not an argument of Model; it has {', '.join(self._pieces)}")
        return Model(**{**arguments(self._pieces), **changes})

    def at(self, values: Mapping[Symbol | str, Numbers], zeta: Numbers = 0.0, tolerance: float = TOLERANCE) -> System:
        """Return the model bound to values.

        Parameters
        ----------
        values : mapping of symbol or name to array_like
        zeta : array_like
            Modal damping ratio beside the dampers, in [0, 1).
        tolerance : float
            Relative error of natural frequencies that is aimed at where coefficients vary along x, in [1e-13, 0.01].

        Returns
        -------
        System

        Raises
        ------
        TypeError, ValueError
            Names the parameter that is missing, unknown or out of range.
        """
        refuse_small(self._pieces["small"], values)
        return System(self, values, zeta, tolerance)

    @property
    def steady(self) -> Model:
        """The model without the terms of its Lagrangian that oscillate: itself if there are none."""
        return self if self._pieces["small"] is None else self._steady

    @cached_property
    def excitation(self) -> LagrangianTerms | None:
        """The oscillating terms of the Lagrangian and the virtual work, or None.

        Examples
        --------
        >>> from sympy import cos
        >>> from cra_sym.symbols import L, epsilon, k_t, t, v, varpi, x
        >>> beam = Model(v.diff(t)**2 / 2 - v.diff(x, 2)**2 / 2, fields=[v], x=x, domain=(0, L), t=t,
        ...     left=-k_t * (1 + epsilon * cos(varpi*t)) * v**2 / 2, small=(epsilon, varpi))
        >>> beam.excitation
        <epsilon cos(varpi t) in the Lagrangian>
        """
        return LagrangianTerms(self) if self.steady is not self and self.oscillating_terms else None

    def freed(self, name: str) -> Model:
        """Return the model with one of its inputs (prescribed motion or force) as a lumped coordinate.

        The work of a force becomes a term of the Lagrangian, so that the equations stay symmetric.
        """
        if name not in self._freed:
            driver = next(function for function in self.driving if function.func.__name__ == name)
            prescribed = [function for function in self._pieces["prescribed"] if function != driver]
            pieces = {"prescribed": prescribed, "coordinates": [*self._pieces["coordinates"], driver]}
            work = {} if driver in self.motions else work_as_energy(self._pieces, driver)
            self._freed[name] = self.replace(**pieces, **work)
        return self._freed[name]

    @cached_property
    def _freed(self) -> dict[str, Model]:
        return {}

    @property
    def pieces(self) -> Mapping[str, Any]:
        """The arguments that the model was made from, by name; read-only."""
        return MappingProxyType(self._pieces)

    @cached_property
    def driving(self) -> tuple[AppliedUndef, ...]:
        """Inputs of the model: prescribed motions and forces, by name."""
        terms = weak_form(self.linearised.variation).load_terms
        return tuple(sorted({f for term in terms for f in term.atoms(AppliedUndef)}, key=str))

    @cached_property
    def motions(self) -> tuple[AppliedUndef, ...]:
        """Inputs that act through their acceleration."""
        terms, t = weak_form(self.linearised.variation).load_terms, self.equations.t
        return tuple(f for f in self.driving if any(term.has(f.diff(t, 2)) for term in terms))

    @cached_property
    def units(self) -> Mapping[str, str]:
        """Unit of every parameter that is a symbol of ``cra_sym.symbols`` or was given one, by name."""
        return symbol_units(self.symbols, dict(self._pieces["units"]))

    @cached_property
    def numerics(self) -> Numerics:
        """Compiled derivations from the Lagrangian, each made when it is first needed."""
        return Numerics(lambda: self.steady)

    def __eq__(self, other: object) -> bool:
        return self._pieces == other._pieces if isinstance(other, Model) else NotImplemented

    def __hash__(self) -> int:
        return hash(tuple(self._pieces.values()))

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuilt, (self._pieces,)

    def __repr__(self) -> str:
        unknowns = ", ".join(map(str, (*self._pieces["fields"], *self.equations.coordinates)))
        return f"<Model of {unknowns} with parameters {', '.join(s.name for s in self.symbols) or 'none'}>"

    def _repr_latex_(self) -> str:
        return self.equations._repr_latex_()

    # ------------------------------------------------------------------------------------------------- symbolic

    @cached_property
    def linearised(self) -> HamiltonResult:
        """Equations of motion and boundary conditions, linearised about zero; of a linear model its `equations`.

        Every linear function (frequencies, modes, stability, exports) is of these.

        Raises
        ------
        ValueError
            Names the term that is not polynomial in the unknowns.
        """
        return linearised(self.steady.equations, self.steady.options)

    @cached_property
    def nonlinear(self) -> bool:
        """Whether the equations of motion are nonlinear."""
        return self.linearised is not self.steady.equations

    @cached_property
    def state_form(self) -> StateForm:
        """The spatial problem as a first-order system, virtual work included."""
        return state_form(self.linearised)

    @cached_property
    def conservative(self) -> StateForm:
        """The spatial problem as a first-order system, without the forces that are odd in time (dampers).

        Raises
        ------
        ValueError
            If what remains is not symmetric: gyroscopic terms, forces that follow the motion.
        """
        if not self.state_form.damped:
            form = self.state_form
        else:
            undamped = self.steady.options | {"virtual_work": self.undamped_work()}
            form = state_form(linearised(hamilton(**undamped), undamped))
        problem = asymmetry(form)
        if problem:
            raise ValueError(
                f"system: has no natural modes, since {problem}; use eigenvalues and mode_shapes(damped=True), or "
                "system.conservative_part, which leaves such forces out"
            )
        return form

    def undamped_work(self) -> tuple[tuple[Expr, Expr, Expr | str | None], ...]:
        """Return the virtual work without forces that are odd in time."""
        return undamped(self.steady.options["virtual_work"], self.options["t"])

    def separate(
        self,
        *,
        parameters: Mapping[Symbol, Expr] | None = None,
        basis: Literal["hyperbolic", "decaying"] = "hyperbolic",
        frequency: Symbol | None = None,
    ) -> Modal:
        """Separate the variables: characteristic matrix and function, mode shapes, in closed form."""
        if parameters is None and basis == "hyperbolic" and frequency is None:
            return self._separated
        return separate(self.linearised, parameters=parameters, basis=basis, frequency=frequency)

    @cached_property
    def _separated(self) -> Modal:
        return separate(self.linearised)

    def ritz(self, elements: int, nodes: Sequence[Expr] = ()) -> Ritz:
        """Return a Hermite-element model of the same Lagrangian: upper bounds of frequencies, coefficients of any x.

        Parameters
        ----------
        elements : int
            Number of equal elements in each span between nodes.
        nodes : sequence of Expr
            Interior places that are nodes, in ascending order, such as jumps of a coefficient. Places of terms
            and supports are nodes anyway; list them too where they are symbols and were not stated in ascending order.
        """
        return Ritz(ritz(self.linearised, elements=elements, nodes=nodes), self.symbols)

    def kernel(self) -> Kernel:
        """Return the characteristic function as a fast function of the angular frequency and the parameters.

        Its first argument is omega (s of a damped model), then come `symbols`. With more than one wave number, give
        omega as a complex number: below the cut-off one of them is imaginary.

        Raises
        ------
        ValueError
            If the wave numbers have no closed form, or the coefficients vary along x.
        """
        modal = self.separate()
        waves = modal.basis.wave_numbers
        if None in waves.values():
            raise ValueError(f"the wave numbers have no closed form, only {modal.basis.dispersion}")
        return kernel(modal.characteristic_function.xreplace(waves), (modal.frequency, *self.symbols))


def _rebuilt(pieces: dict[str, Any]) -> Model:
    return Model(**arguments(pieces))
