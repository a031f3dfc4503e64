"""The hallway: one object that carries a Lagrangian through to equations, spectra, mode shapes and kernels."""

from cra_sym.model.galerkin import Ritz
from cra_sym.model.lagrangian import Model
from cra_sym.model.modes import Modes

__all__ = ["Model", "Modes", "Ritz"]
