"""Frequency response without modal damping, from the boundary-value problem or a basis on the stresses."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.basis_response import on_basis
from cra_sym.analysis.modes import check_kind, displaced, only_motion, participation
from cra_sym.cached import cached_property
from cra_sym.checks import choice, shown
from cra_sym.model.routes import GeneralRoute, Modes
from cra_sym.model.spatial import HALVINGS, SpatialProblem
from cra_sym.model.system import System
from cra_sym.model.values import flat_columns
from cra_sym.solvers.driven import driven_states
from cra_sym.solvers.remainder import nodes, remainder

__all__ = ["Undamped", "cause_name"]

Complex = NDArray[np.complex128]
_SOFT, _MOST_SOFT = 0.03, 4  # ratio to the next frequency below which a mode is soft; largest number of soft modes
_NEAR = 0.05  # z below which soft modes are summed separately, over the square of the first frequency that is not soft
_FINEST = 20  # largest number of halvings of the domain at imaginary frequencies
_KINDS = ("force", "motion")


class Undamped:
    """The response without modal damping at complex frequencies (..., K), shape (..., X, K)."""

    def __init__(
        self,
        system: System,
        places: NDArray[np.float64] | None,
        drive: Any,
        kind: str | None,
        place: int,
        fastest: float,
    ) -> None:
        self._system, self._places, self._place, self._fastest = system, places, place, fastest
        self.motion = cause_name(system, drive)
        if self.motion is not None:
            if kind is not None:
                raise ValueError(f"kind = {kind!r}: must be left out for {self.motion}, which is not a displacement")
            self._problem: SpatialProblem = system.numerics("driven", self.motion)
            self._driven = self._problem.displacements + system.numerics("driven_coordinate", self.motion)
            self._entry = place + (place >= self._driven)  # the motion is one of the coordinates of its problem
        else:
            self._problem = system.numerics("driven_spatial")
            from cra_sym.model.derivations import driven_displacement  # the drive is SymPy's already

            self._driven, self._entry = driven_displacement(system.model, drive), place
        sizes = system.numerics("sizes")
        reactions = 0 if self.motion is not None else self._problem.coordinates - sizes[1]
        self._row = self._driven + (reactions if self._driven >= sum(sizes) else 0)
        self._kind = "motion" if self.motion is not None else choice("kind", "force" if kind is None else kind, _KINDS)
        self.by_force = self._kind == "force"
        self._laplace: bool = system.numerics("damped")
        self.problem_damped: bool = not system.numerics("conservative")
        self.varies = not self._problem.uniform and not self.problem_damped

    @cached_property
    def _columns(self) -> NDArray[np.float64]:
        return flat_columns(self._system.parameters, self._system.shape)

    def check_modal_damping(self, zeta: NDArray[np.float64]) -> None:
        """Raise an error if the formula for modal damping does not apply to this structure."""
        if not np.any(zeta) or self.motion is not None or self.by_force:
            return
        if self.varies or (self._system.natural_frequencies(min(2, self._system.most_modes)) == 0).all(axis=-1).any():
            why = "varies along x" if self.varies else "can still move as a rigid body"
            raise ValueError(
                f"zeta: a structure that a motion of one end drives and that {why} must have damping='structural' or "
                "zeta = 0"
            )

    def followed(self, y: NDArray[np.float64]) -> int:
        """Return the number of these ascending imaginary frequencies at which the waves are not too short."""
        count = y.size
        for rows, _, problem in self._problem.problems(self._columns):
            row = np.repeat(np.arange(len(rows)), y.size)
            parameter = np.tile(1j * y if self._laplace else -(y**2), len(rows))
            levels = problem.levels(parameter, row).reshape(len(rows), y.size)
            count = min(count, int((levels.max(axis=0) <= _FINEST).sum()))
        return count

    def turned_by_motion(self, found: Complex) -> Complex:
        """Return the static response, where a moving end also rotates the structure about it as a rigid body."""
        system = self._system
        if self.problem_damped or self._kind != "motion" or self.motion is not None:
            return found
        modes = min(6, system.most_modes)
        still = system.natural_frequencies(modes) == 0
        if not still.any():
            return found
        drive = np.where(still, self._drive_of_modes(modes), 0.0)
        own = np.sum(drive**2, axis=-1)[..., None, None]
        limit = np.einsum("...m,...mx->...x", drive, self._shapes(modes))[..., None]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.where(own > 0, limit / own, found))

    def drives_rigid_motion(self) -> NDArray[np.bool_]:
        """Return whether a constant drive accelerates a rigid-body mode, shape of the batch."""
        system = self._system
        if self.problem_damped or self._kind != ("motion" if self.motion else "force"):
            return np.zeros(system.shape, dtype=bool)
        if not (system.natural_frequencies(1) == 0).any():
            return np.zeros(system.shape, dtype=bool)
        modes = min(2, system.most_modes)
        driven = self._drive_of_modes(modes)
        still = system.natural_frequencies(modes) == 0
        return np.asarray((still & (np.abs(driven) > 1e-9 * np.abs(driven).max(axis=-1, keepdims=True))).any(axis=-1))

    def _drive_of_modes(self, modes: int) -> NDArray[np.float64]:
        if self.motion is not None:
            return participation(self._system, modes, self.motion)
        return self._driven_by(self._system.modes(modes))

    def _driven_by(self, found: Modes) -> NDArray[np.float64]:
        """Return the driven displacement in each mode."""
        sizes = self._system.numerics("sizes")
        if self._driven < sizes[0]:
            return found.displacement(0, self._driven)
        if self._driven < sum(sizes):
            return found.coordinate(self._driven - sizes[0])
        return found.displacement(1, self._driven - sum(sizes))

    def __call__(self, frequency: NDArray[Any], *, rigid: bool = True) -> Complex:
        """Return the response, without that of the rigid-body modes if ``rigid`` is False."""
        shape = self._system.shape
        frequency = np.broadcast_to(frequency, (*shape, frequency.shape[-1])).reshape(-1, frequency.shape[-1])
        if self.problem_damped or not self._soft:
            found = self._exact(1j * frequency if self._laplace else frequency**2)
        else:
            found = self._with_soft_modes(frequency**2, rigid=rigid)
        return found.reshape(*shape, *found.shape[-2:])

    def _exact(self, parameter: NDArray[Any]) -> Complex:
        """Return the response from the boundary-value problem, shape (rows, X, K)."""
        columns, count = self._columns, (1 if self._places is None else self._places.size)
        found = np.empty((len(parameter), count, parameter.shape[-1]), dtype=complex)
        regular = np.arange(len(parameter))
        if not self._problem.uniform:
            found, there = self._on_basis(parameter)
            regular = np.nonzero(~there)[0]
        for some, left, problem in self._problem.problems(columns[:, regular], self._halvings(columns[:, regular])):
            rows = regular[some]
            if self._places is None:
                share = np.ones((len(rows), 1))
            else:
                share = problem.shares(np.atleast_1d(self._places), left)
            here = parameter[rows]
            here = here + 0j if self.problem_damped or np.imag(here).any() else np.real(here)
            for part in np.array_split(np.arange(here.shape[1]), 1 if self._problem.uniform else here.shape[1]):
                row = np.repeat(np.arange(len(some)), len(part))
                state = driven_states(problem, here[:, part].ravel(), row, share[row], self._row, self._kind)
                values = state[..., self._entry].reshape(len(rows), len(part), count)
                found[rows[:, None], :, part] = values
        return found

    def _halvings(self, columns: NDArray[np.float64]) -> int:
        """Return the number of halvings of the domain that resolve the coefficients along x."""
        if self._problem.uniform or not columns.size:
            return HALVINGS
        return max(GeneralRoute(self._problem).needed(columns), HALVINGS)

    def _on_basis(self, parameter: NDArray[Any], zeta: Any = None) -> tuple[Complex, NDArray[np.bool_]]:
        """Return the response from the basis on the stresses, shape (rows, X, K), and which rows have one."""
        s = np.asarray(parameter if self._laplace else 1j * np.sqrt(parameter + 0j), dtype=complex)
        x = None if self._places is None else np.atleast_1d(self._places)
        moved = self.motion is None and not self.by_force
        drive = self._driven_by if self.motion is None else self.motion
        return on_basis(self._system, self._columns, s, drive, self._place, x, motion=moved, zeta=zeta)

    # Near the frequency of a (nearly) rigid-body mode the boundary-value problem is nearly singular. The soft modes are
    # summed there, and the rest is interpolated from frequencies at which the problem is well conditioned.

    @cached_property
    def has_basis(self) -> bool:
        """Whether the problem varies along x and can be solved in the basis on the stresses."""
        return not self._problem.uniform and self._system.numerics("pencil") is not None

    @cached_property
    def _soft(self) -> int:
        """Number of modes far below the next, in any member of the batch; 0 for driving by a motion."""
        if self.problem_damped or (self.motion is None and not self.by_force) or not self._problem.displacements:
            return 0
        if self.has_basis and (self._system.natural_frequencies(1) > 0).all():
            return 0  # the basis is as good at rest
        omega = self._system.natural_frequencies(_MOST_SOFT + 1)
        gaps = (omega[..., :-1] < _SOFT * omega[..., 1:]).reshape(-1, _MOST_SOFT).any(axis=0)
        return int(np.flatnonzero(gaps).max(initial=-1)) + 1

    def damped_on_basis(self, grid: NDArray[np.float64], zeta: NDArray[np.float64]) -> Complex:
        """Return the response with modal damping from the basis on the stresses, shape (..., X, K)."""
        shape = self._system.shape
        z = np.broadcast_to(grid**2, (self._columns.shape[1], grid.size))
        found, _ = self._on_basis(z, np.broadcast_to(zeta, (*shape, 1)).ravel())
        return np.asarray(found.reshape(*shape, *found.shape[1:]))

    @cached_property
    def _residues(self) -> NDArray[np.float64]:
        """Product of the drive of each soft mode and its displacement at the places, shape (rows, modes, X)."""
        return self._products(self._soft)

    def _products(self, modes: int) -> NDArray[np.float64]:
        sign = -1.0 if self.motion is not None else 1.0
        product = sign * self._drive_of_modes(modes)[..., None] * self._shapes(modes)
        return np.asarray(product.reshape(-1, *product.shape[-2:]))

    def _shapes(self, modes: int) -> NDArray[np.float64]:
        """Return the displacements at the places, shape (..., modes, X)."""
        found = self._system.modes(modes)
        if self._places is None:
            return displaced(self._system, found, self._place)[..., None]
        return displaced(self._system, found, self._place, np.atleast_1d(self._places))

    def _with_soft_modes(self, z: NDArray[Any], *, rigid: bool) -> Complex:
        squares = self._system.natural_frequencies(self._soft + 1).reshape(len(z), -1) ** 2
        squares, limit = squares[:, :-1], squares[:, -1]
        low = np.abs(z) < _NEAR * limit[:, None]
        found = np.empty((len(z), self._residues.shape[-1], z.shape[-1]), dtype=complex)
        if low.any():
            values = np.swapaxes(self._exact(nodes(limit)), 1, 2).real
            others = remainder(values, squares, self._residues, limit)(np.where(low, z, 0.0))
            found[:] = np.swapaxes(others, 1, 2)
            found += self._modal(squares, z, rigid=rigid)
        if not low.all():
            far = self._exact(np.where(low, limit[:, None], z))
            if not rigid:
                far = far - self._modal(squares, z, rigid=True) + self._modal(squares, z, rigid=False)
            found = np.where(low[:, None, :], found, far)
        return found

    def _modal(self, squares: NDArray[np.float64], z: NDArray[Any], *, rigid: bool) -> Complex:
        weight = np.where(squares > 0, 1.0, float(rigid))
        with np.errstate(divide="ignore", invalid="ignore"):
            answers = weight[:, :, None] / (squares[:, :, None] - z[:, None, :])
        answers = np.where(weight[:, :, None] == 0, 0.0, answers)
        return np.asarray(np.einsum("rmx,rmk->rxk", self._residues, answers))

    def rigid_share(self, frequency: NDArray[Any]) -> Complex:
        """Return the response of the rigid-body modes at a frequency, shape (..., X, K)."""
        shape = self._system.shape
        frequency = np.broadcast_to(frequency, (*shape, frequency.shape[-1])).reshape(-1, frequency.shape[-1])
        count = 1 if self._places is None else self._places.size
        if not self._soft:
            return np.zeros((*shape, count, frequency.shape[-1]), dtype=complex)
        squares = self._system.natural_frequencies(self._soft).reshape(len(frequency), -1) ** 2
        weighted = np.where(squares > 0, 0.0, 1.0)[:, :, None] * self._residues
        found = np.einsum("rmx,rk->rxk", weighted, -1.0 / frequency**2)
        return np.asarray(found.reshape(*shape, *found.shape[1:]))


def cause_name(system: System, drive: Any) -> str | None:
    """Return the name of the prescribed motion or force that is the input, or None for a displacement."""
    if drive is None:
        return only_motion(system, support=True)
    causes = dict(system.numerics("causes"))
    name = drive if isinstance(drive, str) else getattr(getattr(drive, "func", None), "__name__", shown(drive))
    if name not in causes or (not isinstance(drive, str) and len(drive.args) != 1):
        return None
    check_kind("drive", name, causes[name])
    return name
