"""Growth of a system with periodic coefficients, by Floquet theory."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np

from cra_sym import checks
from cra_sym.analysis.static_corrections import static_terms
from cra_sym.kernels import Kernel, compiled, has_compiler
from cra_sym.kernels.parts import wants_compiler
from cra_sym.kernels.templates import template
from cra_sym.model.excitations import Drive, Excitation, Fluctuation, Parametric, TransverseBase
from cra_sym.model.modal_matrices import ModalMatrices, modal_matrices
from cra_sym.model.system import MOST_MODES, System
from cra_sym.si import Numbers, paired
from cra_sym.solvers import periodic
from cra_sym.solvers.taylor_operations import Loop

__all__ = [
    "Matrices",
    "batch_shape",
    "checked_point",
    "floquet_exponents",
    "growth_rate",
    "matrices_of",
    "parametric",
]

_ROOTS = 5  # spectra for which the compiled path saves as much time as for a point of a chart


@checks.default_floating_point
def growth_rate(
    system: System,
    excitation: Excitation,
    angular_frequency: Numbers,
    epsilon: Numbers,
    modes: int = 3,
    *,
    residual: bool = False,
    tolerance: float = 1e-10,
    backend: str = "auto",
) -> np.ndarray:
    """Return the growth rate of vibration: max(0, largest real part of the Floquet exponents).

    The motion is expanded in the first natural modes of the conservative part. Dampers, gyroscopic and follower forces
    couple them, so that with such forces more modes may be needed. The method is that of
    :mod:`cra_sym.solvers.periodic`.

    Parameters
    ----------
    system : System
    excitation : Fluctuation, JointStiffness, AxialBase or the model's own `excitation`
    angular_frequency : array_like
        Excitation frequency varpi, rad/s, positive.
    epsilon : array_like
        Not negative.
    modes : int
        Number of modes, 1 to 1000.
    residual : bool
        Whether to include the static flexibility of the omitted modes, for fluctuating stiffnesses of ends; far fewer
        modes are then sufficient. Otherwise the system consists of its first modes only.
    tolerance : float
        Relative error of the monodromy matrix.
    backend : {'auto', 'numpy', 'compiled'}
        'auto' compiles for large charts if llvmlite is there, by the policy for frequencies.

    Returns
    -------
    ndarray
        1/s, shape broadcast from system, excitation, angular_frequency and epsilon.

    Raises
    ------
    TypeError, ValueError
        If an argument is out of its range: also a :class:`TransverseBase`, stiffnesses that are to fluctuate but are
        all infinite, ``residual`` if no stiffness of an end fluctuates, and 'compiled' without llvmlite. If shapes do
        not broadcast, or a period takes more than 1e7 steps.

    Examples
    --------
    >>> from cra_sym import Arm, JointStiffness
    >>> arm = Arm.nominal().replace(k_t=1e4)
    >>> print(growth_rate(arm, JointStiffness(), [186.0, 187.15, 188.0], 0.1).round(3))
    [0.    0.102 0.   ]
    """
    found = _solver_arguments(system, excitation, angular_frequency, epsilon, modes, residual)
    return periodic.growth_rate(*found, tolerance=tolerance, loop=_loop(backend, found))[()]


@checks.default_floating_point
def floquet_exponents(
    system: System,
    excitation: Excitation,
    angular_frequency: Numbers,
    epsilon: Numbers,
    modes: int = 3,
    *,
    residual: bool = False,
    tolerance: float = 1e-10,
    backend: str = "auto",
) -> np.ndarray:
    """Return all Floquet exponents of the excited system, largest real part first.

    The real part of the first one is the growth rate without the limit at zero, so a negative one is the stability
    margin. Imaginary parts are given between -1/2 and 1/2 of the excitation frequency.

    Parameters
    ----------
    system, excitation, angular_frequency, epsilon, modes, residual, tolerance, backend
        As in :func:`growth_rate`.

    Returns
    -------
    complex ndarray, shape (..., 2 modes)
        1/s; ``...`` is broadcast from system, excitation, angular_frequency and epsilon.

    Raises
    ------
    TypeError, ValueError
        As :func:`growth_rate`.

    Examples
    --------
    In the middle of the principal zone of the first mode one exponent has a positive real part:

    >>> from math import pi
    >>> import cra_sym as cra
    >>> soft = cra.Arm.nominal().replace(k_t=1e3, k_r=1e2)
    >>> varpi = 4 * pi * cra.natural_frequencies(soft)[0]
    >>> cra.floquet_exponents(soft, cra.JointStiffness(), varpi, epsilon=0.3, modes=1).real.round(4)
    array([ 0.0316, -0.0316])
    """
    found = _solver_arguments(system, excitation, angular_frequency, epsilon, modes, residual)
    return periodic.floquet_exponents(*found, tolerance=tolerance, loop=_loop(backend, found))


def parametric(excitation: Any) -> Parametric:
    """Return the excitation, or raise an error that lists the kinds."""
    if isinstance(excitation, TransverseBase):
        raise ValueError(
            f"excitation = {excitation!r}: in linear theory a transverse base only forces the system and has no "
            "boundary; see forced_width"
        )
    if not isinstance(excitation, Parametric):
        raise TypeError(
            f"excitation = {checks.shown(excitation)}: must be a Fluctuation, such as JointStiffness, an AxialBase or "
            "the excitation of a model that has one"
        )
    return excitation


def batch_shape(system: Any, excitation: Excitation, **arrays: np.ndarray) -> tuple[int, ...]:
    """Return the common shape of a system, an excitation and arrays."""
    checks.instance("system", system, System)
    return checks.broadcastable(system=np.empty(system.shape), excitation=np.empty(excitation.shape), **arrays)


def _loop(backend: str, found: tuple[Any, ...]) -> Loop | None:
    """Return the compiled loop of the solver if requested or worthwhile."""
    checks.choice("backend", backend, ("auto", "numpy", "compiled"))
    if backend == "compiled" and not has_compiler():
        raise ValueError("backend = 'compiled': llvmlite is not installed; backend must be 'auto' or 'numpy'")
    stiffness, _, _, frequency, epsilon, _ = found
    points = np.broadcast(stiffness[..., 0, 0], frequency, epsilon).size
    wanted = backend == "auto" and wants_compiler(_ROOTS * points, _template_parts)
    loop: Loop | None = _template().propagate if wanted or backend == "compiled" else None
    return loop


@cache
def _template() -> Any:
    return compiled(*_template_parts())


def _template_parts() -> tuple[str, dict[str, Kernel]]:
    return template("cra_sym.solvers.taylor_lanes", {}), {}


class Matrices(NamedTuple):
    """Constant and oscillating matrices of a system between its modes."""

    modal: ModalMatrices
    drives: list[Drive]

    @property
    def only_stiffness(self) -> bool:
        """Whether damping is modal and nothing but stiffness oscillates."""
        still = self.modal.damping is None and self.modal.stiffness is None
        return still and all(d.damping is None and d.momentum is None and d.mass is None for d in self.drives)

    @property
    def stiffness(self) -> np.ndarray:
        """K, shape (..., modes, modes)."""
        unit = np.eye(self.modal.omega.shape[-1])
        own = self.modal.omega[..., None] ** 2 * unit
        return own if self.modal.stiffness is None else own + self.modal.stiffness

    @property
    def damping(self) -> np.ndarray:
        """C, shape (..., modes, modes)."""
        own = 2.0 * self.modal.decay[..., None] * np.eye(self.modal.omega.shape[-1])
        return own if self.modal.damping is None else own + self.modal.damping


def matrices_of(system: System, excitation: Parametric, modes: int) -> Matrices:
    """Return the matrices between the first modes of the conservative part."""
    return Matrices(modal_matrices(system, modes), excitation.drives(system, modes))


def checked_point(
    system: System, excitation: Any, angular_frequency: Any, epsilon: Any, modes: Any
) -> tuple[Parametric, np.ndarray, np.ndarray, int]:
    """Return the arguments of a chart, or raise an error that names an invalid one."""
    excitation = parametric(excitation)
    checks.instance("system", system, System)
    given = paired({"system": np.empty(system.shape), "angular_frequency": angular_frequency, "epsilon": epsilon})
    frequency = checks.real_array("angular_frequency", given["angular_frequency"], low=1e-300, unit="rad/s")
    epsilon = checks.real_array("epsilon", given["epsilon"], low=0.0, unit="1")
    batch_shape(system, excitation, angular_frequency=frequency, epsilon=epsilon)
    _refuse_rigid(system, excitation)
    return excitation, frequency, epsilon, checks.count("modes", modes, high=MOST_MODES)


def _refuse_rigid(system: System, excitation: Parametric) -> None:
    """Raise an error if all parameters that are to fluctuate are infinite everywhere, since then none does."""
    weights = excitation.weights if isinstance(excitation, Fluctuation) else {}
    names = [name for name, weight in weights.items() if np.any(weight) and name in system.values]
    if names and all(np.isinf(system.values[name]).all() for name in names):
        raise ValueError(
            f"excitation = {excitation!r}: {' and '.join(f'{name} = inf' for name in names)} cannot fluctuate; must be "
            "finite"
        )


def _solver_arguments(
    system: System, excitation: Excitation, angular_frequency: Any, epsilon: Any, modes: int, residual: bool
) -> tuple[Any, ...]:
    """Return the arguments of `cra_sym.solvers.periodic`."""
    given, frequency, epsilon, modes = checked_point(system, excitation, angular_frequency, epsilon, modes)
    matrices, compliance = matrices_of(system, given, modes), None
    drives = [(d.oscillation, (d.stiffness, d.damping, d.momentum, d.mass)) for d in matrices.drives]
    if residual:
        if not (isinstance(given, Fluctuation) and given.springs(system) and matrices.only_stiffness):
            raise ValueError(
                f"residual = True needs fluctuating stiffnesses of ends and no forces between modes, not {given!r}"
            )
        coupling, compliance = static_terms(system, given, modes)
        drives = [(matrices.drives[0].oscillation, (part, None, None, None)) for part in np.moveaxis(coupling, -3, 0)]
    return matrices.stiffness, matrices.damping, drives, frequency, epsilon, compliance
