"""One object from any quadratic Lagrangian to its equations, complete spectrum, mode shapes and kernels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, Literal

import numpy as np
from sympy import Expr, S, Symbol, sympify
from sympy.core.function import AppliedUndef

from cra_sym.checks import choice, count, one_axis, shown
from cra_sym.kernels import Kernel, kernel
from cra_sym.mechanics import HamiltonResult, Modal, StateForm, hamilton, ritz, separate, state_form
from cra_sym.mechanics.jets import Jet, listed
from cra_sym.mechanics.weak import weak_form
from cra_sym.model.forced import driven_displacement, steady_states
from cra_sym.model.galerkin import Ritz
from cra_sym.model.modes import Modes, tip_sign
from cra_sym.model.projection import modal_basis
from cra_sym.model.response import History, oscillation
from cra_sym.model.spatial import SpatialProblem, shares
from cra_sym.model.symmetry import asymmetry, odd_in_time
from cra_sym.model.units import check_dimensions, named_units
from cra_sym.model.values import Values, parameters
from cra_sym.solvers.driven_modes import Start
from cra_sym.solvers.eigenvalues import lowest, refine
from cra_sym.solvers.shapes import mode_states

__all__ = ["Model"]

_TAU = 2.0 * np.pi
_MOST_MODES, _MOST_DERIVATIVES = 1000, 20


class Model:
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
        Lagrangian of each end, in ``v(x, t)`` and its derivatives, understood at that end. Nothing means a free end.
    essential : sequence of Expr, optional
        What vanishes at an end, such as ``v.subs(x, 0)``. Measure a field from a displacement that is given.
    coordinates : sequence of applied undefined functions, optional
        Lumped coordinates ``w(t)``.
    prescribed : sequence of applied undefined functions, optional
        Motions ``w(t)`` that are given, see `response`. A force ``F(t)`` needs no mention.
    virtual_work : sequence of (force, displacement, place), optional
        Non-conservative forces; place is 'left', 'right', 'domain' (per length) or None (on a coordinate).
    units : mapping, optional
        Units of symbols of the model that are not those of ``cra_sym.symbols``, such as ``{c: "N s/m"}``. Every term
        whose symbols all have a known unit must be an energy (per length in the density).

    Raises
    ------
    TypeError, ValueError
        Names what is no expression, the term that cannot be treated, or whose dimension is wrong.

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
        domain: tuple[Any, Any],
        t: Symbol,
        left: Expr | None = None,
        right: Expr | None = None,
        essential: Sequence[Expr] = (),
        coordinates: Sequence[AppliedUndef] = (),
        prescribed: Sequence[AppliedUndef] = (),
        virtual_work: Sequence[tuple[Expr, Expr, Any]] | None = None,
        units: Mapping[Any, str] | None = None,
    ) -> None:
        self._options: dict[str, Any] = {
            "fields": listed("fields", fields),
            "coordinates": listed("coordinates", coordinates),
            "prescribed": listed("prescribed", prescribed),
            "x": x,
            "domain": listed("domain", domain),
            "t": t,
            "left": left,
            "right": right,
            "essential": listed("essential", () if essential is None else essential),
        }
        self._density = density
        self._virtual_work = listed("virtual_work", () if virtual_work is None else virtual_work)
        self.equations: HamiltonResult = hamilton(density, virtual_work=self._virtual_work, **self._options)
        """Equations of motion, boundary conditions and the steps that led there."""
        stated = ((f"{end} end", self._options[end]) for end in ("left", "right"))
        ends = {label: sympify(term, strict=True) for label, term in stated if term is not None}
        self.equations.variation.elimination.check_homogeneous("Model")
        given = [density, *self._options["domain"], *self._options["essential"], *ends.values()]
        given += [part for force, displacement, _ in self._virtual_work for part in (force, displacement)]
        self.symbols: tuple[Symbol, ...] = parameters(given, self.equations)
        """The parameters: every symbol but x and t, by name."""
        units = named_units(units, [*given, *self._options["fields"], *self._options["coordinates"]])
        check_dimensions(sympify(density, strict=True), ends, units, self._virtual_work)

    def __repr__(self) -> str:
        unknowns = ", ".join(map(str, (*self.equations.fields, *self.equations.coordinates)))
        return f"<Model of {unknowns} with parameters {', '.join(s.name for s in self.symbols) or 'none'}>"

    def _repr_latex_(self) -> str:
        return self.equations._repr_latex_()

    # ------------------------------------------------------------------------------------------------- symbolic

    @cached_property
    def state_form(self) -> StateForm:
        """The spatial problem as a first-order system, virtual work included."""
        return state_form(self.equations)

    @cached_property
    def _conservative(self) -> StateForm:
        """The same without the forces that are odd in time (dampers)."""
        if not self.state_form.damped:
            form = self.state_form
        else:
            form = state_form(hamilton(self._density, virtual_work=self._undamped_work(), **self._options))
        problem = asymmetry(form)
        if problem:
            raise ValueError(f"natural frequencies need conservative forces, and {problem}; use eigenvalues")
        return form

    def _undamped_work(self) -> tuple[tuple[Expr, Expr, Any], ...]:
        t = self._options["t"]

        def still(force: Expr) -> Expr:
            terms = sympify(force, strict=True).expand().as_ordered_terms()
            return sum((term for term in terms if not odd_in_time(term, t)), S.Zero)

        kept = ((still(force), displacement, place) for force, displacement, place in self._virtual_work)
        return tuple(work for work in kept if work[0] != 0)

    @cached_property
    def _damped(self) -> SpatialProblem:
        return SpatialProblem(self.state_form, self.symbols, self._left, self.equations.fields)

    @property
    def _left(self) -> Expr:
        return sympify(self._options["domain"][0], strict=True)

    @cached_property
    def _spatial(self) -> SpatialProblem:
        return SpatialProblem(self._conservative, self.symbols, self._left, self.equations.fields)

    def separate(self, **options: Any) -> Modal:
        """Separate the variables: characteristic matrix and function, mode shapes, in closed form."""
        return separate(self.equations, **options)

    def ritz(self, elements: int) -> Ritz:
        """Return the same Lagrangian on equal Hermite elements: frequencies from above, coefficients may vary by x."""
        return Ritz(ritz(self.equations, elements=elements), self.symbols)

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

    # ------------------------------------------------------------------------------------------------- spectrum

    def natural_frequencies(self, values: Mapping[Any, Any], modes: int = 3) -> np.ndarray:
        """Return the natural frequencies in Hz: ascending, complete, rigid-body motions as zeros.

        Dampers are left out: these are the frequencies of the conservative structure (see `eigenvalues`).

        Parameters
        ----------
        values : mapping
        modes : int

        Returns
        -------
        ndarray, shape (..., modes)

        Raises
        ------
        TypeError, ValueError
            If a value is missing, unknown or not allowed; if the structure has buckled under its static load; if it
            has fewer natural frequencies.
        """
        modes = count("modes", modes, high=_MOST_MODES)
        given = Values.read(self.symbols, values)
        squares = np.empty((given.columns.shape[1], modes))
        for rows, _, problem in self._spatial.problems(given):
            squares[rows] = lowest(problem, modes)
        return (np.sqrt(squares) / _TAU).reshape(*given.shape, modes)

    def eigenvalues(self, values: Mapping[Any, Any], modes: int = 3, *, oscillating: bool = True) -> np.ndarray:
        """Return complex eigenvalues s (rad/s) of motions ``exp(s t)``, dampers included, one of each conjugate pair.

        They are guessed by the Ritz matrices and refined on the exact problem. That none is missing is promised only
        without dampers, where ``s = i omega``.

        Parameters
        ----------
        values : mapping
        modes : int
        oscillating : bool
            Leave out real eigenvalues, of motions that decay without oscillating: Kelvin-Voigt damping has infinitely
            many, which crowd at minus one over the retardation time.

        Returns
        -------
        ndarray of complex, shape (..., modes)
            By ascending modulus.

        Raises
        ------
        ArithmeticError
            If a refinement does not settle.
        """
        modes = count("modes", modes, high=_MOST_MODES)
        if not self.state_form.damped and not asymmetry(self.state_form):
            return 1j * _TAU * self.natural_frequencies(values, modes)
        given = Values.read(self.symbols, values)
        guesses = self.ritz(2 * modes + 10).eigenvalues(values, modes, oscillating=oscillating).reshape(-1, modes)
        roots = np.empty_like(guesses)
        for rows, _, problem in self._damped.problems(given):
            found = refine(problem, guesses[rows], squared=not self.state_form.damped)
            if np.isnan(found).any():
                raise ArithmeticError("eigenvalues: the refinement of a Ritz value did not settle; ask for fewer modes")
            roots[rows] = np.take_along_axis(found, np.argsort(np.abs(found), axis=1, kind="stable"), axis=1)
        return roots.reshape(*given.shape, modes)

    def damping_ratios(self, values: Mapping[Any, Any], modes: int = 3) -> np.ndarray:
        """Return ``-Re s / |s|`` of the `eigenvalues`, zero for a rigid motion, shape (..., modes)."""
        s = self.eigenvalues(values, modes)
        return -s.real / np.where(s == 0.0, 1.0, np.abs(s))

    def mode_shapes(
        self,
        values: Mapping[Any, Any],
        x_values: Any,
        modes: int = 3,
        *,
        field: AppliedUndef | None = None,
        derivative: int = 0,
    ) -> np.ndarray:
        """Return mass-normalised mode shapes of one field; positive at the right end.

        Parameters
        ----------
        values : mapping
        x_values : array_like, shape (stations,)
            Within the domain; a single place makes one station.
        modes : int
        field : applied undefined function, optional
            Default: the first.
        derivative : int
            Order of the derivative by x.

        Returns
        -------
        ndarray, shape (..., modes, stations)
        """
        modes, derivative = (
            count("modes", modes, high=_MOST_MODES),
            count("derivative", derivative, low=0, high=_MOST_DERIVATIVES),
        )
        wanted, given = self._field(field), Values.read(self.symbols, values)
        x = np.atleast_1d(one_axis("x_values", x_values, "places"))
        place = self._conservative.displacements.index(wanted)
        shapes = np.empty((given.columns.shape[1], modes, len(x)))
        for rows, left, problem in self._spatial.problems(given):
            z, share = lowest(problem, modes), shares(x, left, problem.length, "x_values")
            state = mode_states(problem, z, np.concatenate([share, np.ones((len(rows), 1))], axis=1))
            sign = tip_sign(state[:, :, -1, : problem.displacements])
            row = self._spatial.derivative_row(place, derivative, z, x, given.take(rows))
            shapes[rows] = sign * (row * state[:, :, :-1]).sum(axis=-1)
        return shapes.reshape(*given.shape, modes, len(x))

    def frequency_response(
        self,
        values: Mapping[Any, Any],
        angular_frequency: Any,
        x_values: Any,
        *,
        drive: Expr,
        kind: Literal["force", "motion"] = "force",
        field: AppliedUndef | None = None,
    ) -> np.ndarray:
        """Return the exact complex amplitude of a field for harmonic driving ``exp(i omega t)``, dampers included.

        Parameters
        ----------
        values : mapping
        angular_frequency : array_like, shape (n,)
            rad/s.
        x_values : array_like, shape (stations,)
        drive : Expr
            A displacement of an end, such as ``v.subs(x, L)``, or a lumped coordinate.
        kind : {'force', 'motion'}
            A generalised force of one unit on that displacement, or one unit of motion of it.
        field : applied undefined function, optional
            Default: the first.

        Returns
        -------
        ndarray of complex, shape (..., n, stations)
        """
        choice("kind", kind, ("force", "motion"))
        form, given = self.state_form, Values.read(self.symbols, values)
        place = form.displacements.index(self._field(field))
        driven = driven_displacement(form, drive, self.equations.domain)
        omega = np.atleast_1d(one_axis("angular_frequency", angular_frequency, "frequencies", low=-1e60, high=1e60))
        x = np.atleast_1d(one_axis("x_values", x_values, "places"))
        found = np.empty((given.columns.shape[1], len(omega), len(x)), dtype=complex)
        for rows, left, problem in self._damped.problems(given):
            row = np.repeat(np.arange(len(rows)), len(omega))
            parameter = np.tile(1j * omega if form.damped else omega**2, len(rows))
            share = shares(x, left, problem.length, "x_values")[row]
            state = steady_states(problem, parameter, row, share, driven, kind)
            found[rows] = state[..., place].reshape(len(rows), len(omega), len(x))
        return found.reshape(*given.shape, len(omega), len(x))

    def response(
        self,
        values: Mapping[Any, Any],
        motion: Mapping[AppliedUndef, History] | None,
        t: Any,
        x: Any,
        modes: int = 5,
        derivative: int = 0,
        *,
        initial: Mapping[Expr, Expr] | None = None,
        zeta: Any = 0.0,
        field: AppliedUndef | None = None,
        start: Start = "inertial",
    ) -> np.ndarray:
        """Return a field in time: the modes driven by prescribed motions and forces, or let go from an initial state.

        Parameters
        ----------
        values : mapping
        motion : mapping of function of t to BaseMotion or Force
            What the prescribed motions and the forces of the Lagrangian and of the virtual work are. A motion must
            act by its acceleration alone: measure the fields from the frame that moves. Constant loads act from t = 0.
        t : array_like
            Times from 0 on, s.
        x : array_like
            Place or one axis of places.
        modes : int
            Modes in the sum.
        derivative : {0, 1, 2}
            By time.
        initial : mapping of field, coordinate or its first time derivative to an expression in x, optional
            State at t = 0, such as ``{v: a*x**2, v.diff(t): 0}``; at rest otherwise.
        zeta : array_like, optional
            Modal damping ratios in [0, 1) beside the dampers of the model, one or one for each mode.
        field : applied undefined function, optional
            Default: the first.
        start : {'inertial', 'base'}
            At rest before t = 0 in the inertial frame, or seen from the moving one.

        Returns
        -------
        ndarray, shape (..., x, t)
            A single x or t has no axis.

        Raises
        ------
        TypeError, ValueError
            Names the load without a history, or the function that is not at rest, known or allowed.
        """
        modes = count("modes", modes, high=_MOST_MODES)
        wanted, given = self._field(field), Values.read(self.symbols, values)
        places = np.empty(()) if x is None else one_axis("x", x, "places")
        basis = modal_basis(self._spatial, given, modes, None if x is None else np.atleast_1d(places))
        shape = Jet(self.equations.fields.index(wanted), 0, 0, None)
        rows = basis.values(shape)[..., basis.places]
        weak = weak_form(self.equations.variation)
        found = oscillation(basis, weak, motion, rows, given.shape, t, derivative, zeta, start, initial)
        found = found if places.ndim else found[..., 0, :]
        return found if np.ndim(t) else found[..., 0]

    def tip_response(
        self,
        values: Mapping[Any, Any],
        motion: Mapping[AppliedUndef, History] | None,
        t: Any,
        modes: int = 5,
        derivative: int = 0,
        **options: Any,
    ) -> np.ndarray:
        """Return a field of the right end in time; as `response`, shape (..., t)."""
        return self.response(values, motion, t, None, modes, derivative, **options)

    def _field(self, field: AppliedUndef | None) -> AppliedUndef:
        wanted = self.equations.fields[0] if field is None else field
        if not isinstance(wanted, AppliedUndef) or wanted not in self.equations.fields:
            raise ValueError(f"field = {shown(field)}: allowed are {', '.join(map(str, self.equations.fields))}")
        return wanted

    def modal_parameters(self, values: Mapping[Any, Any], modes: int = 3) -> Modes:
        """Return frequencies with the mass-normalised displacements and natural forces of both ends."""
        modes = count("modes", modes, high=_MOST_MODES)
        given = Values.read(self.symbols, values)
        n, m = len(self._conservative.displacements), len(self._conservative.coordinates)
        omega = np.empty((given.columns.shape[1], modes))
        ends = np.empty((len(omega), modes, 2, 2 * n + m))
        for rows, _, problem in self._spatial.problems(given):
            z = lowest(problem, modes)
            state = mode_states(problem, z, np.tile([0.0, 1.0], (len(rows), 1)))
            omega[rows], ends[rows] = np.sqrt(z), state * tip_sign(state[:, :, 1, :n])[..., None]
        ends = ends.reshape(*given.shape, modes, 2, 2 * n + m)
        q, w, p = ends[..., :n], ends[..., 0, n : n + m], ends[..., n + m :]
        return Modes(omega.reshape(*given.shape, modes), q[..., 0, :], q[..., 1, :], p[..., 0, :], p[..., 1, :], w)
