"""Frequency response of a system, exact from the boundary-value problem instead of a modal sum."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.basis_response import on_basis
from cra_sym.analysis.histories import supports
from cra_sym.analysis.modes import check_kind, check_places, displaced, only_motion, participation, section_place
from cra_sym.cached import cached_property
from cra_sym.checks import choice, default_floating_point, instance, one_axis, shown
from cra_sym.model.routes import GeneralRoute, Modes
from cra_sym.model.spatial import HALVINGS, SpatialProblem
from cra_sym.model.system import System
from cra_sym.model.values import flat_columns
from cra_sym.si import Numbers
from cra_sym.solvers.driven import driven_states
from cra_sym.solvers.remainder import nodes, remainder

if TYPE_CHECKING:
    from sympy import Expr
    from sympy.core.function import AppliedUndef

__all__ = ["frequency_response"]

Complex = NDArray[np.complex128]
_BELOW, _ABOVE, _DIGITS = 18.0, 14.0, 37.0  # reach of the quadrature in ln y, and minus ln of its error
_SOFT, _MOST_SOFT = 0.03, 4  # ratio to the next frequency below which a mode is soft; largest number of soft modes
_NEAR = 0.05  # z below which soft modes are summed separately, over the square of the first frequency that is not soft
_FINEST = 20  # largest number of halvings of the domain at imaginary frequencies
_KINDS = ("force", "motion")
_FASTEST = 1e60  # rad/s, whose fourth power does not overflow; below its inverse the response is static


@default_floating_point
def frequency_response(
    system: System,
    angular_frequency: Numbers,
    x: Numbers | None = None,
    drive: Expr | None = None,
    *,
    kind: Literal["force", "motion"] | None = None,
    field: AppliedUndef | None = None,
    damping: Literal["modal", "structural"] = "modal",
) -> Complex:
    """Return the complex amplitude of a field for harmonic driving ``exp(i Omega t)``, dampers included.

    The boundary-value problem is solved at each frequency, without a modal sum, for any stiffness from zero to
    infinity.

    Parameters
    ----------
    system : System
        ``system.zeta`` is its modal damping.
    angular_frequency : array_like
        Omega, rad/s, not negative; a number or one axis.
    x : array_like, optional
        Place or one axis of places in the domain, m; the right end by default.
    drive : Expr or str, optional
        Input: a unit acceleration of a prescribed motion ``w(t)`` (by default the only one), a unit displacement if
        displacement or velocity act too, as on the support of a spring; a unit of a force ``F(t)``
        of the Lagrangian or the virtual work, distributed or not; or a displacement of a section at an end or an
        interior place, such as ``v.subs(x, L/2)``, or a lumped coordinate.
    kind : {'force', 'motion'}, optional
        A unit force on that displacement (the default), or a unit motion of it, at an end or of a coordinate.
    field : applied undefined function, optional
        A field (default: the first), or a lumped coordinate, which is the same at every x.
    damping : {'modal', 'structural'}
        Meaning of zeta. 'modal': viscous, the same ratio in every mode, as in the time domain. No local damper has this
        property, but the sum over all modes has a closed form, see Notes. 'structural': a loss factor 2 zeta of every
        stiffness. Both agree at resonances, to first order in zeta.

    Returns
    -------
    complex ndarray, shape (..., x, Omega)
        m per unit of the drive; s2 for an acceleration. A single x or Omega has no axis. Without damping it is
        unbounded at a natural frequency.

    Raises
    ------
    TypeError, ValueError
        If an argument is out of its range, an infinite stiffness holds the driven displacement, the waves are too
        short, a model with dampers has modal damping too, or modal damping is outside the scope of the Notes.

    Notes
    -----
    Mode i responds with a_i f(omega_i), f(z) = 1 / (z^2 + 2 i zeta Omega z - Omega^2) having its poles at
    alpha = Omega (sqrt(1 - zeta^2) - i zeta) and at -conj(alpha). With V(z), the undamped response at complex
    frequency z, the sum over modes is a sum of residues of 2 z V(z) f(z) in the right half plane, and the residue
    theorem gives

        H = 2 alpha V(alpha) / (alpha + conj(alpha))
            + (4 i zeta Omega / pi) int_0^inf y^2 V(i y) / ((y^2 + Omega^2)^2 - (2 zeta Omega y)^2) dy.

    The integrand has no resonance, and the trapezoidal rule in ln y converges geometrically to rounding. Rigid-body
    modes, which have no damping, are summed separately.

    Where coefficients or loads vary along x, the problem is solved in a Ritz basis on the stresses, refined until the
    response changes by less than 1e-9, which leaves an error of up to about 1e-8; one that does not converge to 1e-6,
    of waves that are too short, is solved as a boundary-value problem, or refused with modal damping or a stiffness
    that vanishes at an end. Modal damping is refused where the motion of one end drives a structure that varies along
    x or can still move as a rigid body.

    Examples
    --------
    >>> from cra_sym import Arm, frequency_response
    >>> static = frequency_response(Arm.nominal(), 0.0)
    >>> print(f"{static.real:.4e} s2")
    -6.6053e-03 s2
    """
    instance("system", system, System)
    frequencies = one_axis("angular_frequency", angular_frequency, "frequencies", low=0.0, high=_FASTEST, unit="rad/s")
    grid = np.where(frequencies * _FASTEST < 1.0, 0.0, np.atleast_1d(frequencies))
    places = None if x is None else one_axis("x", x, "places", unit="m")
    if places is not None:
        check_places(system, places)
    choice("damping", damping, ("modal", "structural"))
    system, drive, kind = _as_drive(system, drive, kind)
    place = section_place(system, field, lumped=True)
    undamped = _Undamped(system, places, drive, kind, place, float(grid.max(initial=0.0)))
    zeta = np.broadcast_to(system.zeta, system.shape)[..., None]
    if np.any(zeta) and undamped.problem_damped:
        raise ValueError(
            "zeta: the model has dampers or forces that follow the motion, beside which a frequency response has no "
            "modal damping; set it to 0"
        )
    if damping == "structural":
        loss = 1 + 2j * zeta
        found = undamped(grid / np.sqrt(loss)) / loss[..., None]
    else:
        undamped.check_modal_damping(zeta)
        on_basis = undamped.has_basis and np.any(zeta)
        found = undamped.damped_on_basis(grid, zeta) if on_basis else _with_modal_damping(undamped, grid, zeta)
    found = np.where((grid == 0)[..., None, :], undamped.turned_by_motion(found), found)
    unbounded = (grid == 0) & undamped.drives_rigid_motion()[..., None]
    found = np.where(unbounded[..., None, :], np.inf, found)
    found = found[..., 0, :] if places is None or not places.ndim else found
    return found if frequencies.ndim else found[..., 0]


def _with_modal_damping(undamped: _Undamped, grid: NDArray[np.float64], zeta: NDArray[np.float64]) -> Complex:
    if not np.any(zeta):
        return undamped(grid + 0.0 * zeta)
    cosine = np.sqrt(1 - zeta**2)
    static = grid == 0
    alpha = grid * (cosine - 1j * zeta)
    weight = np.where(static, 1.0, 1 - 1j * zeta / cosine)
    response = weight[..., None, :] * undamped(alpha)
    if static.all():
        return response
    moving = grid[~static]
    step = 2 * np.pi * np.arccos(np.max(zeta)) / _DIGITS
    y = np.exp(np.arange(np.log(moving.min()) - _BELOW, np.log(moving.max()) + _ABOVE, step))
    y = y[: undamped.followed(y)]  # beyond, the integrand is below 1e-12
    Omega = np.where(static, 1.0, grid)[..., None, :]
    factor = zeta[..., None]
    integrand = y[:, None] ** 3 / ((y[:, None] ** 2 + Omega**2) ** 2 - (2 * factor * Omega * y[:, None]) ** 2)
    smooth = undamped(-1j * y + 0.0 * zeta, rigid=False).real
    rest = np.where(static, 0.0, 4j * zeta * grid * step / np.pi)[..., None, :] * (smooth @ integrand)
    # a rigid-body mode has no damping, so its contribution to the formula is removed
    rigid = undamped.rigid_share(np.where(static, 1.0, alpha)), undamped.rigid_share(np.where(static, 1.0, grid))
    return np.asarray(response + rest + np.where(static[..., None, :], 0.0, rigid[1] - weight[..., None, :] * rigid[0]))


class _Undamped:
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
        self.motion = _cause_name(system, drive)
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


def _cause_name(system: System, drive: Any) -> str | None:
    """Return the name of the prescribed motion or force that is the input, or None for a displacement."""
    if drive is None:
        return only_motion(system, support=True)
    causes = dict(system.numerics("causes"))
    name = drive if isinstance(drive, str) else getattr(getattr(drive, "func", None), "__name__", shown(drive))
    if name not in causes or (not isinstance(drive, str) and len(drive.args) != 1):
        return None
    check_kind("drive", name, causes[name])
    return name


def _as_drive(system: System, drive: Any, kind: Any) -> tuple[System, Any, Any]:
    """Return system, input and kind: a displacement at an interior place is replaced by a new force there.

    A motion that acts by its displacement or velocity too is replaced by a coordinate that moves by a unit.
    """
    cause = _cause_name(system, drive)
    if cause in supports(system):
        if kind is not None:
            raise ValueError(f"kind = {shown(kind)}: must be left out for {cause}, which is not a displacement")
        moved = next(function for function in system.model.driving if function.func.__name__ == cause)
        return system.model.freed(cause).at({**system.values}, system.zeta), moved, "motion"
    if drive is None or isinstance(drive, str):
        return system, drive, kind
    found = system.model.numerics("pushed", drive) if hasattr(drive, "free_symbols") else None
    if found is None:
        return system, drive, kind
    if kind not in (None, "force"):
        raise ValueError(f"kind = {shown(kind)}: what drives at an interior place must be a force")
    model, name, place = found
    check_places(system, np.asarray(place.function(*system.domain.values)), "drive: place")
    return model.at({**system.values}, system.zeta), name, kind
