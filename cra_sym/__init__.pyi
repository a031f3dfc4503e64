from .arm.analysis import frequency_parameters as frequency_parameters
from .arm.analysis import modal_parameters as modal_parameters
from .arm.analysis import mode_shapes as mode_shapes
from .arm.analysis import natural_frequencies as natural_frequencies
from .arm.certification import certify as certify
from .arm.equations import equation as equation
from .arm.equations import equations as equations
from .arm.excitation import AxialBase as AxialBase
from .arm.excitation import JointStiffness as JointStiffness
from .arm.excitation import TransverseBase as TransverseBase
from .arm.frequency_response import frequency_response as frequency_response
from .arm.identification import identify_joint as identify_joint
from .arm.parameters import Arm as Arm
from .arm.response import residual_vibration as residual_vibration
from .arm.response import response as response
from .arm.response import tip_response as tip_response
from .arm.sensitivity import sensitivities as sensitivities
from .arm.shaping import input_shaper as input_shaper
from .arm.stability import AsymptoticWarning as AsymptoticWarning
from .arm.stability import ResonanceWarning as ResonanceWarning
from .arm.stability import floquet_exponents as floquet_exponents
from .arm.stability import forced_width as forced_width
from .arm.stability import growth_rate as growth_rate
from .arm.stability import stability_boundary as stability_boundary
from .arm.state_space import state_space as state_space
from .arm.vibration_gradient import residual_vibration_gradient as residual_vibration_gradient
from .codegen import export as export
from .explorer import explore as explore
from .kernels import kernel as kernel
from .model import Model as Model
from .solvers.motion import BaseMotion as BaseMotion
from .solvers.motion import Force as Force
from .studies import sweep as sweep

__version__: str
_LOADED: float
