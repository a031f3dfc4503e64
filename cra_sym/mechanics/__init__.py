"""Symbolic engines: Hamilton's principle, separation, Ritz, multiple scales; independent of the arm."""

from cra_sym.mechanics.hamilton import BoundaryCondition, HamiltonResult, hamilton
from cra_sym.mechanics.jets import HamiltonError
from cra_sym.mechanics.multiple_scales import MultipleScales, multiple_scales
from cra_sym.mechanics.ritz import RitzMatrices, ritz
from cra_sym.mechanics.separation import Modal, separate
from cra_sym.mechanics.state_form import StateForm, state_form
from cra_sym.mechanics.steps import Step, compact_latex

__all__ = [
    "BoundaryCondition",
    "HamiltonError",
    "HamiltonResult",
    "Modal",
    "MultipleScales",
    "RitzMatrices",
    "StateForm",
    "Step",
    "compact_latex",
    "hamilton",
    "multiple_scales",
    "ritz",
    "separate",
    "state_form",
]
