"""A model bound to values: what every analysis takes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from cra_sym.cached import cached_property
from cra_sym.checks import broadcastable, count, default_floating_point, instance, real_array, shown
from cra_sym.model.cross_check import CrossCheck, cross_check
from cra_sym.model.end_masses import end_mass_rounding
from cra_sym.model.energy_signs import refuse_negative
from cra_sym.model.projection import BilinearForm, Domain, Load, Projected, project
from cra_sym.model.routes import ROUNDING, TOLERANCE, Estimated, Modes, Rated, Route
from cra_sym.model.slip_elements import SlipElements, slip_elements, slip_terms_of
from cra_sym.model.spanned_stiffness import check_range
from cra_sym.model.values import Value, checked_damping, checked_values, frozen
from cra_sym.model.vanishing import check_forces
from cra_sym.si import Numbers

if TYPE_CHECKING:
    from sympy import Expr, Symbol

    from cra_sym.model.lagrangian import Model
    from cra_sym.model.numerics import Numerics

__all__ = ["MOST_MODES", "TOLERANCE", "System"]

Array = NDArray[np.float64]
MOST_MODES = 1000
_Found = TypeVar("_Found")
_MOST_KEPT = 8  # numbers of modes for which a system caches its results


class System:
    """A :class:`cra_sym.Model` bound to values; make one with :meth:`cra_sym.Model.at`.

    Its natural frequencies and modes are computed on first use, once for each number of modes, and cached.

    Parameters
    ----------
    model : Model
    values : mapping of symbol or name to array_like
        One for each parameter of the model; arrays broadcast together as batch axes. The stiffness of an end may be
        inf.
    zeta : array_like
        Modal damping ratio beside the dampers of the model, the same for every mode, in [0, 1).
    tolerance : float
        Largest accepted relative error of natural frequencies where coefficients vary along x, in [1e-13, 0.01]; a
        frequency that does not reach it is refused. See `accuracy`.

    Raises
    ------
    TypeError, ValueError
        Names the parameter that is missing, unknown or not a real number, or shapes that do not broadcast together.

    Examples
    --------
    >>> from sympy import symbols
    >>> import cra_sym as cra
    >>> from cra_sym.symbols import L, t, v, x
    >>> mass, tension = symbols("mass tension")
    >>> string = cra.Model(mass * v.diff(t)**2 / 2 - tension * v.diff(x)**2 / 2, fields=[v], x=x, domain=(0, L), t=t,
    ...                    essential=[v.subs(x, 0), v.subs(x, L)])
    >>> system = string.at({mass: 1.0, tension: [1.0, 4.0], L: 1.0})
    >>> cra.natural_frequencies(system, modes=2)
    array([[0.5, 1. ],
           [1. , 2. ]])
    """

    tolerance: float = TOLERANCE

    def __init__(
        self, model: Model, values: Mapping[Symbol | str, Numbers], zeta: Numbers = 0.0, tolerance: float = TOLERANCE
    ) -> None:
        from cra_sym.model.lagrangian import Model

        instance("model", model, Model)
        self._model = model
        self._values = checked_values([symbol.name for symbol in model.symbols], values, model.units)
        self._zeta = frozen(checked_damping(zeta))
        given = real_array("tolerance", tolerance, low=1e-13, high=1e-2)
        if given.ndim:
            raise ValueError(f"tolerance = {shown(tolerance)}: must be one number in [1e-13, 0.01]")
        object.__setattr__(self, "tolerance", float(given))
        broadcastable(zeta=self._zeta, **self._values)
        if model.pieces["hysteresis"]:
            slip_terms_of(self).at(self.parameters)  # refuses elements that are out of range

    def __setattr__(self, name: str, value: Any) -> None:
        if not name.startswith("_"):
            raise AttributeError(f"{name} = {shown(value)}: a System is frozen; use replace({name}=..)")
        object.__setattr__(self, name, value)

    @property
    def model(self) -> Model:
        """The model."""
        return self._model

    @property
    def values(self) -> Mapping[str, Value]:
        """The value of every parameter, by name."""
        return MappingProxyType(self._values)

    @property
    def zeta(self) -> Value:
        """Modal damping ratio."""
        return self._zeta

    @cached_property
    def shape(self) -> tuple[int, ...]:
        """Batch shape: the common shape of all values."""
        return broadcastable(zeta=self.zeta, **self.values)

    @property
    def section_quantities(self) -> Mapping[str, Expr]:
        """Measurable quantities of a section besides its displacements, by name: expressions in x."""
        return {}

    def replace(self, **changes: Numbers) -> System:
        """Return a validated copy with some values, ``zeta`` or ``tolerance``, changed.

        Raises
        ------
        TypeError, ValueError
            As :class:`System`.
        """
        options = {name: changes.pop(name, getattr(self, name)) for name in ("zeta", "tolerance")}
        return System(self.model, {**self.values, **changes}, **options)

    @property
    def parameter_sets(self) -> tuple[System, ...]:
        """The systems of a batch, one for each set of values, the last batch axis fastest; of a single one itself.

        For what takes no batch: ``[steady_states(one, ..) for one in system.parameter_sets]``.
        """
        if not self.shape:
            return (self,)
        parts = {name: np.broadcast_to(v, self.shape) for name, v in {**self.values, "zeta": self.zeta}.items()}
        return tuple(
            self.replace(**{name: float(v[index]) for name, v in parts.items()}) for index in np.ndindex(self.shape)
        )

    @cached_property
    def without_hysteresis(self) -> System:
        """The system without its elastic-slip elements, whose modes nonlinear results use; itself if it has none."""
        model = self.model.without_hysteresis
        if model is self.model:
            return self
        values = {symbol.name: self.values[symbol.name] for symbol in model.symbols}
        return System(model, values, self.zeta, self.tolerance)

    def slip_elements(self, modes: int) -> SlipElements:
        """Return the numerical data of the elastic-slip elements, projected on modes of the system without them.

        Parameters
        ----------
        modes : int

        Returns
        -------
        SlipElements

        Raises
        ------
        ValueError
            If the system has none, or one of them acts on a held displacement.
        """
        found: SlipElements = self.cached("slip", modes, lambda n: slip_elements(self, n))
        return found

    # ------------------------------------------------------------------------------------------ numbers, once

    @property
    def numerics(self) -> Numerics:
        """Compiled derivations from the Lagrangian."""
        return self.model.numerics

    @cached_property
    def parameters(self) -> tuple[Value, ...]:
        """Values in the order of the model's symbols."""
        return tuple(self.values[name] for name in self.numerics("names"))

    @cached_property
    def domain(self) -> Domain:
        """Values with 0 in place of inf, left end and length of the domain."""
        finite = [np.where(np.isinf(p), 0.0, p)[()] if np.isinf(p).any() else p for p in self.parameters]
        length, left = self.numerics("geometry").function(*finite)
        if not (np.all(length > 0) and np.all(np.isfinite(length))):
            name = self.numerics("length_name")
            given = np.atleast_1d(self.values.get(name, length))
            bad = given[~((given > 0) & np.isfinite(given))]
            first = bad.flat[0] if bad.size else np.inf
            raise ValueError(f"domain: the length {name} = {first:g} must be in (0, inf)")
        found = Domain(finite, left, length)
        refuse_negative(self.numerics("masses"), found, self.shape, self.values)
        return found

    @cached_property
    def conservative_part(self) -> System:
        """The system without gyroscopic and follower forces: itself if it has natural modes."""
        part: Model | None = self.numerics("conservative_part")
        return self if part is None else part.at(self.values, tolerance=self.tolerance)

    @cached_property
    def basis(self) -> System:
        """The system whose natural modes equations are projected on: the conservative part, unless it has buckled.

        Then it is the elastic part: without potential energies of other than the highest derivatives by x, and without
        those of ends, places and coordinates that buckle it; coordinates alone have a positive one in place of theirs.
        """
        part = self.conservative_part
        if part is not self:
            try:
                part.natural_frequencies(1)
            except ValueError:
                elastic: Model = self.numerics("elastic_part")
                return elastic.at(self.values, tolerance=self.tolerance)
        return part

    @property
    def stiffness_beside(self) -> BilinearForm | None:
        """The stiffness besides that of the basis, None if there is none."""
        elastic = self.basis is not self.conservative_part
        found: BilinearForm | None = self.numerics("stiffness_beside_elastic" if elastic else "stiffness_beside")
        return found

    def natural_frequencies(self, modes: int) -> Array:
        """Return the first natural frequencies, rad/s, shape (..., modes); read-only."""
        return np.asarray(self.cached("omega", count("modes", modes, high=MOST_MODES), self._find_frequencies))

    def _find_frequencies(self, modes: int) -> Array:
        domain, stiffness = self.domain, self.numerics("leading")
        if stiffness.form.uniform:  # the routes of what varies along x find the place
            refuse_negative(stiffness, domain, self.shape, self.values)
        route = self._route
        with np.errstate(all="ignore"):
            if isinstance(route, Estimated):
                omega, accuracy = route.estimated(self.parameters, self.shape, modes, self.tolerance)
            else:
                omega = route.angular_frequencies(self.parameters, self.shape, modes)
                accuracy = np.full(self.shape, ROUNDING)
            check_range(omega)
            accuracy = np.maximum(accuracy, end_mass_rounding(self, route, omega))
        self.note_accuracy(accuracy)
        omega.flags.writeable = False
        return omega

    def note_accuracy(self, error: Array) -> None:
        """Include the estimated relative error of a result, shape (...), in `accuracy`."""
        self.__dict__["_accuracy"] = np.maximum(self.__dict__.get("_accuracy", 0.0), error)

    def root_rates(self, modes: int, by: Sequence[str]) -> Mapping[str, Array]:
        """Return the derivatives of omega^2 by parameters, shape (..., modes) each, without modes.

        Only those that the route gives directly to full accuracy: the others follow from the modes.
        """
        route, names = self._route, self.numerics("names")
        if not isinstance(route, Rated):
            return {}
        omega, positions = self.natural_frequencies(modes), [names.index(name) for name in by]
        found = route.rates(self.parameters, self.shape, omega, positions)
        return {name: rate for name, rate in zip(by, found, strict=True) if not np.isnan(rate).any()} if found else {}

    @property
    def accuracy(self) -> Array:
        """Estimated relative error of natural frequencies and eigenvalues, the largest so far computed, shape (...).

        Of the first three frequencies if none was computed. Where coefficients vary along x it is estimated, from the
        stresses that break equilibrium or, with inertia of the highest derivatives by x, from a second integration of
        twice as many steps; that of complex eigenvalues is the difference of two meshes, and of coalescing ones that of
        their mean and product. A frequency whose error would be beyond ``tolerance`` is refused. Where coefficients are
        constant along x frequencies are exact but for rounding, and this is a bound of that, 1e-11.
        """
        if "_accuracy" not in self.__dict__:
            self.natural_frequencies(3)
        return np.asarray(self.__dict__["_accuracy"])

    def check(self, modes: int = 3) -> CrossCheck:
        """Compare natural frequencies with those of Hermite elements, and name the likely cause of the difference.

        Ritz's method is independent of the method of the frequencies but for the Lagrangian, and gives upper bounds.
        Its elements have nodes at all breakpoints.

        Parameters
        ----------
        modes : int

        Raises
        ------
        ValueError
            If the model has no natural frequencies of conservative motions.

        Examples
        --------
        >>> from sympy import Piecewise, symbols
        >>> import cra_sym as cra
        >>> from cra_sym.symbols import t, v, x
        >>> rope = cra.Model(v.diff(t)**2 / 2 - Piecewise((1, x < 1), (3, True)) * v.diff(x)**2 / 2, fields=[v], x=x,
        ...                  domain=(0, 2), t=t, essential=[v.subs(x, 0), v.subs(x, 2)], units={x: "1"})
        >>> bool(rope.at({}).check().agree)
        True
        """
        return cross_check(self, count("modes", modes, high=MOST_MODES))

    @property
    def most_modes(self) -> int:
        """Largest number of modes: that of the coordinates where there is no field, else unlimited."""
        displacements, coordinates = self.numerics("sizes")
        return MOST_MODES if displacements else int(coordinates)

    def modes(self, modes: int) -> Modes:
        """Return the first natural modes."""
        found: Modes = self.cached("modes", modes, lambda n: self._find_modes(n))
        return found

    def _find_modes(self, modes: int) -> Modes:
        omega = self.natural_frequencies(modes)
        route = self._route
        if isinstance(route, Estimated):
            return route.estimated_modes(self.parameters, self.shape, omega, self.tolerance)
        return route.modes(self.parameters, self.shape, omega)

    @cached_property
    def _route(self) -> Route:
        """The fastest route that is valid for the values."""
        route: Route = self.numerics("route")
        return route if route.covers(self.parameters) else self.numerics("general_route")

    @default_floating_point
    def cached(self, kind: str, modes: int, find: Callable[[int], _Found]) -> _Found:
        """Return ``find(modes)``, which is kept for the last few ``modes`` of each kind."""
        kept: dict[tuple[str, int], _Found] = self.__dict__.setdefault("_kept", {})
        key = kind, modes
        if key not in kept:
            found = find(modes)
            while len(kept) >= 2 * _MOST_KEPT:
                kept.pop(next(iter(kept)), None)
            kept[key] = found
        return kept[key]

    def project(self, load: Load, modes: int) -> Array:
        """Return the generalised force of a load on every mode of the basis, shape (..., modes)."""
        part = self.basis
        check_forces(part, load, part._route)
        return project(part.domain, part.modes(modes), load)

    def form(self, name: str, modes: int, *, diagonal: bool = False) -> Projected:
        """Return bilinear forms that were derived from the Lagrangian, between the modes."""
        return Projected(self.domain, self.modes(modes), self.numerics(name), diagonal=diagonal)

    # ------------------------------------------------------------------------------------------ value semantics

    def _key(self) -> tuple[Any, ...]:
        values = (*self.values.values(), self.zeta)
        return self.model, self.tolerance, tuple((np.shape(value), np.asarray(value).tobytes()) for value in values)

    def __eq__(self, other: object) -> bool:
        return self._key() == other._key() if isinstance(other, System) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._key())

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.model, dict(self.values), self.zeta, self.tolerance)

    def __repr__(self) -> str:
        values = ", ".join(f"{name}={value!r}" for name, value in self.values.items())
        tolerance = "" if self.tolerance == TOLERANCE else f", tolerance={self.tolerance!r}"
        return f"<System of {self.model!r} at {values}, zeta={self.zeta!r}{tolerance}>"
