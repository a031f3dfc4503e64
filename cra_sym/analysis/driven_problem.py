"""Periodically driven nonlinear system truncated to a number of modes and harmonics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.nonlinear import embedding, samples, watched
from cra_sym.analysis.periodic_forcing import Forced, forced
from cra_sym.analysis.steady_seeds import seeds
from cra_sym.cached import cached_property
from cra_sym.solvers.harmonic_balance import Balance, Basis, newton, peak
from cra_sym.solvers.monodromy import multipliers

__all__ = ["DrivenProblem"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
_WHOLE = 15  # iterations with full steps, which converge soon or not at all
_NEAR_CIRCLE = 1e-5  # multipliers this close to the unit circle are computed to the best accuracy
_ROUGH, _FINE = 1e-7, 1e-11


@dataclass(frozen=True, eq=False)
class DrivenProblem:
    """A driven system truncated to a number of modes and harmonics.

    Points are pairs of angular frequency and size of the excitation, shape (points, 2).

    Attributes
    ----------
    arguments : mapping
        Arguments that the problem was made from.
    rows : ndarray, shape (modes,)
        Output displacement in each mode.
    driven : Forced
        With an excitation of size one.
    basis : Basis
    period : int
    """

    arguments: dict[str, Any]
    rows: Array
    driven: Forced
    basis: Basis
    period: int

    @classmethod
    def of(cls, *, place: Any, field: Any, harmonics: int, period: int, **arguments: Any) -> DrivenProblem:
        """Return the problem of the arguments of :func:`cra_sym.steady_states`."""
        own = {**arguments, "epsilon": None if arguments["epsilon"] is None else 1.0}
        driven = forced(**own, small=True)
        number = samples(driven.equations.degree, harmonics, driven.order * period)
        rows = watched(arguments["system"], arguments["modes"], place, field)
        options = {**arguments, "place": place, "field": field, "harmonics": harmonics, "period": period}
        return cls(options, rows, driven, Basis.whole(harmonics, number), period)

    @cached_property
    def balance(self) -> Balance:
        """The equations of harmonic balance."""
        return Balance(self.driven.equations, self.basis)

    def causes(self, at: Array, phase: Array | None = None, *, rates: bool = False) -> Array:
        """Return the known functions at points, or their rates, shape (points, waves, samples)."""
        phase = self.basis.phase if phase is None else phase
        return self.driven.causes(at[:, 0], phase, self.period, at[:, 1], rates=rates)

    def acceleration(self, phase: float, at: Array, q: Array, u: Array) -> Array:
        """Return the accelerations of one motion at each point, shape (points, modes), at a phase of the period."""
        known = (self.causes(at, np.array([phase]), rates=rates)[:, :, 0].T for rates in (False, True))
        return self.driven.equations.acceleration(q, u, *known)

    unique = False

    @property
    def fastest(self) -> float:
        """Largest natural frequency, rad/s."""
        return float(self.driven.equations.omega.max())

    def coefficients(self, unknowns: Array) -> Array:
        """Return modal coefficients, shape (points, modes, functions)."""
        return self.balance.coefficients(unknowns)

    def seeds(self, at: Array, order: NDArray[np.intp]) -> tuple[NDArray[np.intp], Array, float]:
        """Return starting points."""
        return seeds(self.driven, self.basis, at, order, self.period)

    def loss(self, unknowns: Array) -> float:
        """Return the energy dissipated by elastic-slip elements: zero, as there are none."""
        return 0.0

    def peaks(self, unknowns: Array, at: Array) -> Array:
        """Return the peak of the output in a period of each solution."""
        return peak(self.basis, self.rows, self.balance.coefficients(unknowns))[0]

    def settled(self, found: list[list[Array]], at: Array) -> tuple[DrivenProblem, list[list[Array]]]:
        """Return the problem and the solutions unchanged: the number of harmonics is fixed."""
        return self, found

    def solved(self, starts: Array, at: Array, floor: float, most: int = 40) -> tuple[Array, NDArray[np.bool_]]:
        """Return solutions from starting points, and which converged; full steps are tried where damped ones fail."""
        given = at[:, 0] / self.period, self.causes(at)
        found, good = newton(self.balance, starts, *given, floor=floor, most=most)
        left = np.flatnonzero(~good) if most > 1 else np.zeros(0, int)
        if left.size:
            again = (part[left] for part in given)
            found[left], good[left] = newton(self.balance, starts[left], *again, floor=floor, most=_WHOLE, whole=True)
        return found, good

    def multipliers(self, unknowns: Array, at: Array) -> Complex:
        """Return Floquet multipliers over a period of each solution, to 1e-7, or to 1e-11 near the unit circle."""
        found = self._multipliers(unknowns, at, _ROUGH)
        near = np.abs(np.abs(found[:, 0]) - 1.0) < _NEAR_CIRCLE
        found[near] = self._multipliers(unknowns[near], at[near], _FINE)
        return found

    def _multipliers(self, unknowns: Array, at: Array, tolerance: float) -> Complex:
        coefficients = self.balance.coefficients(unknowns)

        def causes(phase: Array, rows: NDArray[np.intp]) -> Array:
            return self.causes(at[rows], phase)

        frequency = at[:, 0] / self.period
        return multipliers(self.driven.equations, self.basis, coefficients, frequency, causes, tolerance=tolerance)

    def changed(self, more_modes: int, more_harmonics: int, unknowns: Array, at: Array) -> float:
        """Return the relative change of the motion when modes or harmonics are added: two steps of Newton's method."""
        options = dict(self.arguments)
        options["modes"] = min(options["modes"] + more_modes, options["system"].most_modes)
        options["harmonics"] += more_harmonics
        coefficients: Array = self.balance.coefficients(unknowns)[0]
        rich, n, h = DrivenProblem.of(**options), len(coefficients), coefficients.shape[1] // 2
        x = np.zeros((options["modes"], rich.basis.size))
        into, start = embedding(options["system"], n, options["modes"]).T, options["harmonics"] + 1
        x[:, : h + 1], x[:, start : start + h] = into @ coefficients[:, : h + 1], into @ coefficients[:, h + 1 :]
        before = x.ravel()[None].copy()
        after, _ = newton(rich.balance, before, at[None, 0] / self.period, rich.causes(at[None]), most=2)
        size = np.linalg.norm(before)
        return float(np.linalg.norm(after - before) / size) if size > 0 else 0.0
