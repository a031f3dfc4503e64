"""Regulator and observer of an exported model, with gains for one set of its values."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from cra_sym.analysis.state_space import state_space
from cra_sym.cached import cached_property
from cra_sym.checks import instance
from cra_sym.codegen.controllers import Array, Controller, controller_checks
from cra_sym.codegen.library import Check, source
from cra_sym.codegen.model_checks import ERRORS
from cra_sym.codegen.model_text import ModelText
from cra_sym.codegen.unused import marked
from cra_sym.model.system import System

__all__ = ["ModelController"]


@dataclass(frozen=True)
class ModelController:
    """Writes regulator and observer.

    Attributes
    ----------
    written : ModelText
    controller : Controller

    Raises
    ------
    TypeError, ValueError
        If the controller has no system of this model, or the model has not one input.
    """

    written: ModelText
    controller: Controller

    def __post_init__(self) -> None:
        if self.controller.system is None:
            raise ValueError("controller: must have system=, with the values for which gains are computed")
        instance("controller: system", self.controller.system, System)
        if self.controller.system.model != self.written.model:
            raise ValueError("controller: its system must be one of the model that is exported")
        signals = self.written.signals
        if signals is None or len(signals.inputs) != 1:
            raise ValueError(
                f"controller: the model must have one input, it has {len(signals.inputs) if signals else 0}"
            )

    def _matrices(self, system: System) -> tuple[Array, Array, Array, Array]:
        assert self.written.signals is not None
        held = state_space(system, self.written.signals.modes, *self.written.signals.given).discrete(
            self.controller.time
        )
        return held.A, held.B, held.C, held.D

    @property
    def _names(self) -> list[str]:
        assert self.written.signals is not None
        return list(self.written.signals.outputs)

    @cached_property
    def _gains(self) -> tuple[Array, Array]:
        assert self.controller.system is not None
        return self.controller.gains(*self._matrices(self.controller.system), self._names)

    @property
    def text(self) -> str:
        """Gains and functions."""
        functions = marked(source("controller"), {"TIMED"}).replace("BLOCKS", "DOFS")
        return self.controller.text(self._names, *self._gains) + functions

    def checks(self) -> Iterator[Check]:
        """Yield reference vectors at the values of the gains and beside them: the loop in matrices."""
        loss, system = ERRORS[self.written.real], self.controller.system
        assert system is not None
        changed = next(name for name, value in system.values.items() if 0.0 < abs(float(value)) < math.inf)
        for other in (system, system.replace(**{changed: 1.1 * float(system.values[changed])})):
            values = tuple(float(other.values[symbol.name]) for symbol in self.written.names)
            for pushed, found, size in controller_checks(
                self.controller, self._matrices(other), self._gains, self._names
            ):
                yield Check(10, (*values, *pushed, float(other.zeta)), found, loss, 10 * loss * size)
        yield Check(10, (*values, 0.25, 1.0, 0.125, math.nan, float(system.zeta)), (), refused=True)
