"""Symbolic-numeric dynamics and stability of a flexible Cartesian robotic arm.

The public names below load on first use, so that importing the package is fast: no derivation runs, and
neither SymPy nor matplotlib is imported.
"""

from importlib import import_module
from time import time

_LOADED = time()  # a derivation is stored only if no source is newer
__version__ = "0.1.0"

_HOME = {
    "Arm": "arm.parameters",
    "BoltedJoint": "arm.bolted_joint",
    "paper_lagrangian": "arm.lagrangian",
    "System": "model",
    "Member": "model.members",
    "joined": "model.members",
    "equation": "paper.equations",
    "equations": "paper.equations",
    "natural_frequencies": "analysis.modes",
    "frequency_parameters": "arm.frequency_parameters",
    "mode_shapes": "analysis.modes",
    "modal_parameters": "analysis.modal_parameters",
    "eigenvalues": "analysis.eigenvalues",
    "damping_ratios": "analysis.eigenvalues",
    "count_eigenvalues": "analysis.eigenvalues",
    "critical_value": "analysis.critical",
    "BaseMotion": "solvers.motion",
    "Force": "solvers.force",
    "UndersamplingWarning": "analysis.responses",
    "response": "analysis.responses",
    "tip_response": "analysis.responses",
    "residual_vibration": "analysis.residual_vibration",
    "SlipEvent": "analysis.slip_response",
    "SlipResponse": "analysis.slip_response",
    "slip_response": "analysis.slip_response",
    "residual_vibration_gradient": "analysis.residual_gradient",
    "state_space": "analysis.state_space",
    "frequency_response": "analysis.frequency_response",
    "sensitivities": "analysis.sensitivities",
    "AmbiguityWarning": "analysis.identification",
    "MisfitWarning": "analysis.identification",
    "identify": "analysis.identification",
    "identify_joint": "analysis.identification",
    "identify_slip": "analysis.slip_identification",
    "input_shaper": "analysis.shaping",
    "certify": "analysis.certification",
    "certify_eigenvalues": "analysis.certification",
    "certify_stability": "analysis.certified_stability",
    "AxialBase": "model.excitations",
    "Fluctuation": "model.excitations",
    "JointStiffness": "arm.excitations",
    "TransverseBase": "model.excitations",
    "AsymptoticWarning": "analysis.stability",
    "ResonanceWarning": "analysis.stability",
    "floquet_exponents": "analysis.floquet",
    "forced_width": "analysis.stability",
    "growth_rate": "analysis.floquet",
    "stability_boundary": "analysis.stability",
    "Backbone": "analysis.backbone",
    "ConvergenceWarning": "analysis.nonlinear",
    "backbone": "analysis.backbone",
    "nonlinear_modal_equations": "analysis.nonlinear",
    "slow_flow_values": "analysis.slow_flow",
    "SteadyState": "analysis.steady_states",
    "steady_states": "analysis.steady_states",
    "ResponseCurve": "analysis.response_curves",
    "response_curves": "analysis.response_curves",
    "basins": "analysis.basins",
    "Iwan": "model.hysteresis",
    "Jenkins": "model.hysteresis",
    "Model": "model",
    "stations": "mechanics.stations",
    "sweep": "studies",
    "kernel": "kernels",
    "Controller": "codegen",
    "export": "codegen",
    "explore": "explorer",
}

__all__ = ["__version__", *_HOME]


def __getattr__(name: str) -> object:
    try:
        module = import_module(f"cra_sym.{_HOME[name]}")
    except KeyError:
        raise AttributeError(f"module 'cra_sym' has no attribute {name!r}") from None
    value = getattr(module, name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
