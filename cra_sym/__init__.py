"""Symbolic-numeric dynamics and stability of a flexible Cartesian robotic arm.

The public names below load on first use, so importing the package costs next to nothing: no derivation runs, and
neither SymPy nor matplotlib is imported.
"""

from importlib import import_module
from time import time

_LOADED = time()  # a derivation is stored only if no source is younger
__version__ = "0.1.0"

_HOME = {
    "Arm": "arm.parameters",
    "equation": "arm.equations",
    "equations": "arm.equations",
    "natural_frequencies": "arm.analysis",
    "frequency_parameters": "arm.analysis",
    "mode_shapes": "arm.analysis",
    "modal_parameters": "arm.analysis",
    "BaseMotion": "solvers.motion",
    "Force": "solvers.motion",
    "response": "arm.response",
    "tip_response": "arm.response",
    "residual_vibration": "arm.response",
    "residual_vibration_gradient": "arm.vibration_gradient",
    "state_space": "arm.state_space",
    "frequency_response": "arm.frequency_response",
    "sensitivities": "arm.sensitivity",
    "identify_joint": "arm.identification",
    "input_shaper": "arm.shaping",
    "certify": "arm.certification",
    "AxialBase": "arm.excitation",
    "JointStiffness": "arm.excitation",
    "TransverseBase": "arm.excitation",
    "AsymptoticWarning": "arm.stability",
    "ResonanceWarning": "arm.stability",
    "floquet_exponents": "arm.stability",
    "forced_width": "arm.stability",
    "growth_rate": "arm.stability",
    "stability_boundary": "arm.stability",
    "Model": "model",
    "sweep": "studies",
    "kernel": "kernels",
    "export": "codegen",
    "explore": "explorer",
}

__all__ = ["__version__", *_HOME]


def __getattr__(name):
    try:
        module = import_module(f"cra_sym.{_HOME[name]}")
    except KeyError:
        raise AttributeError(f"module 'cra_sym' has no attribute {name!r}") from None
    value = getattr(module, name)
    globals()[name] = value
    return value


def __dir__():
    return sorted(__all__)
