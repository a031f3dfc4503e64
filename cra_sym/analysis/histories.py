"""Input histories of a system: those given for its prescribed motions and forces."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, TypeAlias, Union

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.modes import check_kind, only_motion
from cra_sym.checks import mapping, shown
from cra_sym.model.system import System
from cra_sym.solvers.force import Force
from cra_sym.solvers.motion import BaseMotion

if TYPE_CHECKING:
    from sympy.core.function import AppliedUndef

__all__ = ["Histories", "History", "check_no_support", "driven", "histories", "supports"]

Array = NDArray[np.float64]
History = BaseMotion | Force
Histories: TypeAlias = Union["Mapping[AppliedUndef, History]", Mapping[str, History]]  # by function of t, or by name


def histories(system: System, motion: Any) -> dict[str, History]:
    """Return the history given for each input of the model, by name."""
    causes = dict(system.numerics("causes"))
    terms = system.numerics("nonlinear")
    others = [] if terms is None else [name for name, _ in terms.causes if name not in causes]
    if isinstance(motion, BaseMotion):
        motion = {only_motion(system, support=True): motion}
    if motion is not None and not isinstance(motion, Mapping):
        raise TypeError(f"motion = {shown(motion)}: must be a BaseMotion or a mapping from functions of t to motions")
    given = {
        key if isinstance(key, str) else getattr(getattr(key, "func", None), "__name__", str(key)): value
        for key, value in mapping("motion", motion, "functions of t to BaseMotion or Force").items()
    }
    for name, history in given.items():
        if name not in (*causes, *others):
            raise ValueError(
                f"motion: {name} does not drive the model; what drives it is {', '.join([*causes, *others]) or 'none'}"
            )
        if not isinstance(history, BaseMotion | Force):
            raise TypeError(f"motion: {name} = {shown(history)}: must be a Force or a BaseMotion")
        if name in others:  # only in nonlinear terms, through any of its derivatives
            continue
        check_kind("motion", name, causes[name])
        if isinstance(history, Force) != (causes[name] == "force"):
            acts, other = {
                "motion": ("by its acceleration", "a BaseMotion"),
                "support": ("by its displacement or velocity", "a BaseMotion"),
                "force": ("by itself", "a Force, or state the spring of a moving support in the Lagrangian"),
            }[causes[name]]
            raise ValueError(f"motion: {name} drives the model {acts}; give {other}")
    missing = [name for name in (*causes, *others) if name not in given]
    if missing:
        raise ValueError(f"motion: no history for {', '.join(missing)}; must be a Force or a BaseMotion")
    return given


def supports(system: System) -> list[str]:
    """Return the motions that act by their displacement or velocity, such as that of the support of a spring."""
    return [name for name, kind in system.numerics("causes") if kind == "support"]


def check_no_support(system: System) -> None:
    """Raise an error if a motion acts by its displacement or velocity."""
    for name in supports(system):
        raise ValueError(
            f"motion: {name} acts by its displacement or velocity, which is not taken into account here; use response "
            "without elastic-slip elements, or measure the fields from the moving frame"
        )


def driven(system: System, found: Mapping[str, History], modes: int) -> Iterator[tuple[Array, History]]:
    """Yield, for each force and each motion that acts by its acceleration, minus the generalised force of a unit of it
    on every mode, and its history.

    Raises
    ------
    ValueError
        If an input acts in nonlinear terms alone.
    """
    linear = dict(system.numerics("causes"))
    for name, history in found.items():
        if name not in linear:
            raise ValueError(
                f"motion: {name} acts in nonlinear terms alone, which linear results leave out; use response"
            )
        yield -system.project(system.numerics("load", name), modes), history
    constant = system.numerics("constant")
    if constant is not None:
        yield -system.project(constant, modes), Force(1.0)
