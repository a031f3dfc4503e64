"""Methods of Model that call the analysis functions at given values: the one upward import of the package."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from cra_sym.analysis.modal_parameters import ModalParameters
    from cra_sym.mechanics.slow_flow import SlowFlow
    from cra_sym.model.system import System

__all__ = ["Asked"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


class Asked(ABC):
    """Base class of Model with the analysis functions as methods.

    The first argument of each is the values of all parameters, as of :meth:`at`.
    """

    @abstractmethod
    def at(self, values: Mapping[Any, Any]) -> System:
        """Return the model bound to values."""

    def slow_flow(self, resonance: Any, order: int = 1, modes: int | None = None) -> SlowFlow:
        """Return :func:`cra_sym.analysis.slow_flow.slow_flow` of the model: multiple scales of its modal equations."""
        return cast("SlowFlow", _analysis("slow_flow").slow_flow(self, resonance, order, modes))

    def natural_frequencies(self, values: Mapping[Any, Any], modes: int = 3) -> Array:
        """Return ``cra_sym.natural_frequencies(self.at(values), modes)``."""
        return cast("Array", _analysis("modes").natural_frequencies(self.at(values), modes))

    def mode_shapes(self, values: Mapping[Any, Any], x_values: Any = None, modes: int = 3, **options: Any) -> Array:
        """Return ``cra_sym.mode_shapes(self.at(values), x_values, modes, **options)``."""
        return cast("Array", _analysis("modes").mode_shapes(self.at(values), x_values, modes, **options))

    def modal_parameters(self, values: Mapping[Any, Any], modes: int = 3) -> ModalParameters:
        """Return ``cra_sym.modal_parameters(self.at(values), modes)``."""
        return cast("ModalParameters", _analysis("modal_parameters").modal_parameters(self.at(values), modes))

    def eigenvalues(self, values: Mapping[Any, Any], modes: int = 3, *, oscillating: bool = True) -> Complex:
        """Return :func:`cra_sym.analysis.eigenvalues.eigenvalues` of the model at the values."""
        return cast("Complex", _analysis("eigenvalues").eigenvalues(self.at(values), modes, oscillating=oscillating))

    def damping_ratios(self, values: Mapping[Any, Any], modes: int = 3) -> Array:
        """Return :func:`cra_sym.analysis.eigenvalues.damping_ratios` of the model at the values."""
        return cast("Array", _analysis("eigenvalues").damping_ratios(self.at(values), modes))

    def frequency_response(
        self, values: Mapping[Any, Any], angular_frequency: Any, x_values: Any = None, **options: Any
    ) -> Complex:
        """Return ``cra_sym.frequency_response(self.at(values), angular_frequency, x_values, **options)``."""
        respond = _analysis("frequency_response").frequency_response
        return cast("Complex", respond(self.at(values), angular_frequency, x_values, **options))

    def response(
        self,
        values: Mapping[Any, Any],
        motion: Any,
        t: Any,
        x: Any,
        modes: int = 5,
        derivative: int = 0,
        **options: Any,
    ) -> Array:
        """Return ``cra_sym.response(self.at(values), motion, t, x, modes, derivative, **options)``."""
        return cast(
            "np.ndarray", _analysis("responses").response(self.at(values), motion, t, x, modes, derivative, **options)
        )

    def tip_response(self, values: Mapping[Any, Any], motion: Any, t: Any, modes: int = 5, **options: Any) -> Array:
        """Return ``cra_sym.tip_response(self.at(values), motion, t, modes, **options)``."""
        return cast("Array", _analysis("responses").tip_response(self.at(values), motion, t, modes, **options))


def _analysis(module: str) -> Any:
    """Import a module of ``cra_sym.analysis``."""
    return import_module(f"cra_sym.analysis.{module}")
