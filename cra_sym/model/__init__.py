"""The hallway: one object that carries a Lagrangian through to equations, spectra, mode shapes and kernels."""

from cra_sym.model.lagrangian import Model
from cra_sym.model.modes import Damped, Modes

__all__ = ["Damped", "Model", "Modes"]
