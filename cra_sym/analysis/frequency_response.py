"""Frequency response of a system: exact, from the boundary-value problem; no modes are summed."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.modes import check_places, only_motion, participation, section_place
from cra_sym.checks import choice, default_floating_point, instance, one_axis, shown
from cra_sym.model.spatial import SpatialProblem
from cra_sym.model.system import System
from cra_sym.model.values import flat_columns
from cra_sym.solvers.driven import driven_states
from cra_sym.solvers.remainder import nodes, remainder

if TYPE_CHECKING:
    from sympy import Expr
    from sympy.core.function import AppliedUndef

__all__ = ["frequency_response"]

Complex = NDArray[np.complex128]
_BELOW, _ABOVE, _DIGITS = 18.0, 14.0, 37.0  # reach of the quadrature in ln y, and minus ln of its error
_SOFT, _MOST_SOFT = 0.03, 4  # a mode this far below the next is soft; at most so many are looked for
_NEAR = 0.05  # z below which soft modes are summed, over the square of the first frequency that is not soft
_KINDS = ("force", "motion")
_FASTEST = 1e60  # rad/s, whose fourth power is a number; what is slower than its inverse is static


@default_floating_point
def frequency_response(
    system: System,
    angular_frequency: Any,
    x: Any = None,
    drive: Expr | None = None,
    *,
    kind: Literal["force", "motion"] | None = None,
    field: AppliedUndef | None = None,
    damping: Literal["modal", "structural"] = "modal",
) -> Complex:
    """Return the complex amplitude of a field for harmonic driving ``exp(i Omega t)``, dampers included.

    No modes are summed: the boundary-value problem is solved at each frequency, for any stiffness from zero to
    infinity.

    Parameters
    ----------
    system : System
        ``system.zeta`` is its modal damping.
    angular_frequency : array_like
        Omega, rad/s, not negative; a number or one axis.
    x : array_like, optional
        Place or one axis of places in the domain, m; the right end by default.
    drive : Expr, optional
        What drives: a prescribed motion ``w(t)`` by one unit of its acceleration (by default the only one), or a
        displacement of an end, such as ``v.subs(x, L)``, or a lumped coordinate.
    kind : {'force', 'motion'}, optional
        A unit force on that displacement (the default), or one unit of motion of it.
    field : applied undefined function, optional
        Default: the first.
    damping : {'modal', 'structural'}
        What zeta means. 'modal': viscous, the same ratio in every mode, as in the time domain. No local damper has this
        property, but the sum over all modes is known, see Notes. 'structural': a loss factor 2 zeta of every
        stiffness. Both agree at resonances, to first order in zeta.

    Returns
    -------
    complex ndarray, shape (..., x, Omega)
        m per unit of the drive; s2 for an acceleration. A single x or Omega has no axis. Without damping it grows
        beyond all bounds at a natural frequency.

    Raises
    ------
    TypeError, ValueError
        If an argument is out of its range, an infinite stiffness holds what is driven, the waves are too short to
        follow, or a model with dampers is given modal damping too.

    Notes
    -----
    Mode i answers with a_i f(omega_i), f(z) = 1 / (z^2 + 2 i zeta Omega z - Omega^2) having its poles at
    alpha = Omega (sqrt(1 - zeta^2) - i zeta) and at -conj(alpha). With V(z), the undamped response at complex
    frequency z, the sum over modes is a sum of residues of 2 z V(z) f(z) in the right half plane, and the residue
    theorem gives

        H = 2 alpha V(alpha) / (alpha + conj(alpha))
            + (4 i zeta Omega / pi) int_0^inf y^2 V(i y) / ((y^2 + Omega^2)^2 - (2 zeta Omega y)^2) dy.

    The integrand has no resonance, and the trapezoidal rule in ln y converges geometrically to rounding. Rigid-body
    modes, which have no damping, are summed apart.

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
    undamped = _Undamped(system, places, drive, kind, section_place(system, field))
    zeta = np.broadcast_to(system.zeta, system.shape)[..., None]
    if np.any(zeta) and undamped.problem_damped:
        raise ValueError(
            "zeta: the model has dampers, beside which a frequency response has no modal damping; set it to 0"
        )
    if damping == "structural":
        loss = 1 + 2j * zeta
        found = undamped(grid / np.sqrt(loss)) / loss[..., None]
    else:
        found = _with_modal_damping(undamped, grid, zeta)
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
    Omega = np.where(static, 1.0, grid)[..., None, :]
    factor = zeta[..., None]
    integrand = y[:, None] ** 3 / ((y[:, None] ** 2 + Omega**2) ** 2 - (2 * factor * Omega * y[:, None]) ** 2)
    smooth = undamped(-1j * y + 0.0 * zeta, rigid=False).real
    rest = np.where(static, 0.0, 4j * zeta * grid * step / np.pi)[..., None, :] * (smooth @ integrand)
    # a rigid-body mode has no damping: what the formula does with it is taken back
    rigid = undamped.rigid_share(np.where(static, 1.0, alpha)), undamped.rigid_share(np.where(static, 1.0, grid))
    return response + rest + np.where(static[..., None, :], 0.0, rigid[1] - weight[..., None, :] * rigid[0])


class _Undamped:
    """The response without modal damping at complex frequencies (..., K), shape (..., X, K)."""

    def __init__(
        self, system: System, places: NDArray[np.float64] | None, drive: Any, kind: str | None, place: int
    ) -> None:
        self._system, self._places, self._place = system, places, place
        self.motion = _motion_name(system, drive)
        if self.motion is not None:
            if kind is not None:
                raise ValueError(f"kind = {kind!r}: a prescribed motion drives by its acceleration; leave kind out")
            self._problem: SpatialProblem = system.numerics("driven", self.motion)
            self._driven = self._problem.displacements + system.numerics("driven_coordinate", self.motion)
        else:
            self._problem = system.numerics("damped_spatial")
            from cra_sym.model.derivations import driven_displacement  # SymPy is there: the drive is an expression

            self._driven = driven_displacement(system.model, drive)
        self._kind = "motion" if self.motion is not None else choice("kind", "force" if kind is None else kind, _KINDS)
        self.by_force = self._kind == "force"
        self.problem_damped: bool = system.numerics("damped")

    def drives_rigid_motion(self) -> NDArray[np.bool_]:
        """Return whether a constant drive accelerates a rigid-body mode, shape of the batch."""
        system = self._system
        if self.problem_damped or self._kind != ("motion" if self.motion else "force"):
            return np.zeros(system.shape, dtype=bool)
        if not (system.natural_frequencies(1) == 0).any():
            return np.zeros(system.shape, dtype=bool)
        driven = self._drive_of_modes(2)
        still = system.natural_frequencies(2) == 0
        return (still & (np.abs(driven) > 1e-9 * np.abs(driven).max(axis=-1, keepdims=True))).any(axis=-1)

    def _drive_of_modes(self, modes: int) -> NDArray[np.float64]:
        if self.motion is not None:
            return participation(self._system, modes, self.motion)
        found, sizes = self._system.modes(modes), self._system.numerics("sizes")
        if self._driven < sizes[0]:
            return found.displacement(0, self._driven)
        if self._driven < sum(sizes):
            return found.coordinate(self._driven - sizes[0])
        return found.displacement(1, self._driven - sum(sizes))

    def __call__(self, frequency: NDArray[Any], *, rigid: bool = True) -> Complex:
        """Return the response; without ``rigid`` that of all modes but the rigid-body ones."""
        shape = self._system.shape
        frequency = np.broadcast_to(frequency, (*shape, frequency.shape[-1])).reshape(-1, frequency.shape[-1])
        if self.problem_damped or not self._soft:
            found = self._exact(1j * frequency if self.problem_damped else frequency**2)
        else:
            found = self._with_soft_modes(frequency**2, rigid=rigid)
        return found.reshape(*shape, *found.shape[-2:])

    def _exact(self, parameter: NDArray[Any]) -> Complex:
        """Return the response from the boundary-value problem, shape (rows, X, K)."""
        columns = flat_columns(self._system.parameters, self._system.shape)
        count = 1 if self._places is None else self._places.size
        found = np.empty((len(parameter), count, parameter.shape[-1]), dtype=complex)
        for rows, left, problem in self._problem.problems(columns):
            row = np.repeat(np.arange(len(rows)), parameter.shape[-1])
            here = parameter[rows].ravel()
            here = here if np.imag(here).any() else np.real(here)
            if self._places is None:
                share = np.ones((len(rows), 1))
            else:
                share = problem.shares(np.atleast_1d(self._places), left)
            state = driven_states(problem, here, row, share[row], self._driven, self._kind)
            values = state[..., self._place].reshape(len(rows), parameter.shape[-1], count)
            found[rows] = np.swapaxes(values, 1, 2)
        return found

    # Next to a rigid-body mode, or one nearly so, the boundary-value problem is nearly singular: there the soft modes
    # are summed, and what the others add is interpolated from where the problem is well conditioned.

    @cached_property
    def _soft(self) -> int:
        """Number of modes far below the next, in any member of the batch; 0 for driving by a motion."""
        if self.problem_damped or (self.motion is None and not self.by_force):
            return 0
        omega = self._system.natural_frequencies(_MOST_SOFT + 1)
        gaps = (omega[..., :-1] < _SOFT * omega[..., 1:]).reshape(-1, _MOST_SOFT).any(axis=0)
        return int(np.flatnonzero(gaps).max(initial=-1)) + 1

    @cached_property
    def _residues(self) -> NDArray[np.float64]:
        """Product of the drive of each soft mode and its displacement at the places, shape (rows, modes, X)."""
        modes = self._system.modes(self._soft)
        sign = -1.0 if self.motion is not None else 1.0
        drive = sign * self._drive_of_modes(self._soft)
        if self._places is None:
            shape = modes.displacement(1, self._place)[..., None]
        else:
            shape = modes.shape(self._place, 0, np.atleast_1d(self._places))
        product = drive[..., None] * shape
        return product.reshape(-1, *product.shape[-2:])

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
        """Return the part of the response at a frequency that is of rigid-body modes, shape (..., X, K)."""
        shape = self._system.shape
        frequency = np.broadcast_to(frequency, (*shape, frequency.shape[-1])).reshape(-1, frequency.shape[-1])
        count = 1 if self._places is None else self._places.size
        if not self._soft:
            return np.zeros((*shape, count, frequency.shape[-1]), dtype=complex)
        squares = self._system.natural_frequencies(self._soft).reshape(len(frequency), -1) ** 2
        weighted = np.where(squares > 0, 0.0, 1.0)[:, :, None] * self._residues
        found = np.einsum("rmx,rk->rxk", weighted, -1.0 / frequency**2)
        return np.asarray(found.reshape(*shape, *found.shape[1:]))


def _motion_name(system: System, drive: Any) -> str | None:
    """Return the name of the prescribed motion that drives, or None if a displacement does."""
    if drive is None:
        return only_motion(system)
    motions = [name for name, kind in system.numerics("causes") if kind == "motion"]
    name = drive if isinstance(drive, str) else getattr(getattr(drive, "func", None), "__name__", shown(drive))
    arguments = len(getattr(drive, "args", (None,)))
    return name if name in motions and (isinstance(drive, str) or arguments == 1) else None
