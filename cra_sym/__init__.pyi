from .analysis.certification import certify as certify
from .analysis.frequency_response import frequency_response as frequency_response
from .analysis.identification import identify_joint as identify_joint
from .analysis.modes import frequency_parameters as frequency_parameters
from .analysis.modes import modal_parameters as modal_parameters
from .analysis.modes import mode_shapes as mode_shapes
from .analysis.modes import natural_frequencies as natural_frequencies
from .analysis.residual_gradient import residual_vibration_gradient as residual_vibration_gradient
from .analysis.responses import residual_vibration as residual_vibration
from .analysis.responses import response as response
from .analysis.responses import tip_response as tip_response
from .analysis.sensitivities import sensitivities as sensitivities
from .analysis.shaping import input_shaper as input_shaper
from .analysis.stability import AsymptoticWarning as AsymptoticWarning
from .analysis.stability import ResonanceWarning as ResonanceWarning
from .analysis.stability import floquet_exponents as floquet_exponents
from .analysis.stability import forced_width as forced_width
from .analysis.stability import growth_rate as growth_rate
from .analysis.stability import stability_boundary as stability_boundary
from .analysis.state_space import state_space as state_space
from .arm.excitations import AxialBase as AxialBase
from .arm.excitations import JointStiffness as JointStiffness
from .arm.excitations import TransverseBase as TransverseBase
from .arm.parameters import Arm as Arm
from .codegen import export as export
from .explorer import explore as explore
from .kernels import kernel as kernel
from .mechanics.stations import stations as stations
from .model import Model as Model
from .paper.equations import equation as equation
from .paper.equations import equations as equations
from .solvers.motion import BaseMotion as BaseMotion
from .solvers.motion import Force as Force
from .studies import sweep as sweep

__version__: str
_LOADED: float
