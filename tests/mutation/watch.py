"""Which tests watch over which module: in rounds, quickest first; the first round that fails decides.

Before any round come the checks of all numbered equations that the module has a part in.
"""

from __future__ import annotations

from pathlib import Path

__all__ = ["EXEMPT", "PACKAGE", "rounds", "watched_modules"]

PACKAGE = Path(__file__).resolve().parents[2] / "cra_sym"

#: Modules in which nothing stands for physics.
EXEMPT = {
    "arm/equations": "the registry of equations and how wide a printed line may be",
}

_LAWS = "tests/test_properties.py"
_LAMBDA, _MODAL = "tests/arm/test_frequency_parameters.py", "tests/arm/test_modal_parameters.py"
_FREQUENCIES = [
    f"{_LAMBDA}::test_{name}"
    for name in ("classical_beams", "rigid_body_zeros", "none_is_missed_against_finite_elements")
]
_DIGITS = [
    f"{_LAMBDA}::test_{name}"
    for name in ("every_digit_of_random_extreme_arms", "continuous_through_zero_and_infinite_stiffness")
]
_MODES = [
    f"{_MODAL}::test_{name}"
    for name in (
        "orthonormal_with_the_end_effector",
        "modal_stiffness_is_the_squared_frequency",
        "participation",
        "boundary_conditions",
        "end_values_are_those_of_the_shapes",
    )
]
_STATICS = [
    f"tests/arm/test_stability.py::test_{name}"
    for name in (
        "sums_over_all_modes",
        "the_zone_is_continuous_where_a_spring_vanishes",
        "residual_flexibility_is_the_limit_of_many_modes",
    )
]
_STABILITY = [["tests/arm/test_boundaries.py"], ["tests/arm/test_stability.py"]]
_LANES = ["tests/arm/test_templates.py"]
_STIFFNESS = [
    [
        f"tests/solvers/test_stiffness.py::test_{name}"
        for name in (
            "steps_through_varying_coefficients_are_of_sixth_order",
            "stationary_values_of_graded_energies_keep_their_digits",
            "count_equals_closed_form_everywhere",
            "string_with_a_damper_at_its_end",
            "equal_roots_are_counted_and_get_orthogonal_shapes",
        )
    ],
    ["tests/solvers/test_stiffness.py"],
    [
        f"tests/model/test_{name}"
        for name in (
            "gallery.py::test_heavy_tips_on_soft_joints_keep_their_digits",
            "damped.py::test_receptance_of_a_cantilever",
            "damped.py::test_viscous_joint_damper",
            "model.py::test_modal_parameters_close_the_balance_of_forces",
        )
    ],
]
_HILL = [
    f"tests/solvers/test_floquet.py::test_{name}"
    for name in (
        "exponents_are_hills",
        "too_few_harmonics_are_refused",
        "exponents_of_free_modes_in_whole_ratios_to_the_excitation",
    )
]
_FLOQUET = [
    _HILL[:1],
    [
        f"tests/solvers/test_floquet.py::test_{name}"
        for name in (
            "free_modes_drift_by_the_exponential_of_their_matrix",
            "mathieu_edges",
            "monodromy_is_that_of_a_general_integrator",
            "compliance_is_a_spring_in_series",
            "error_is_what_was_asked_for",
            "multipliers_come_in_reciprocal_pairs",
            "no_excitation_no_growth",
            "growth_is_that_of_the_fastest_exponent",
            "batch_equals_loop",
        )
    ],
]
_COUPLED = ["tests/solvers/test_coupled_modes.py"]
_PHYSICS = [_FREQUENCIES, _MODES]

_ROUNDS: dict[str, list[list[str]]] = {
    "arm/analysis": [_MODES, [_MODAL, _LAMBDA]],
    "arm/boundaries": _STABILITY,
    "arm/by_hand": [],
    "arm/characteristic": [_FREQUENCIES, _MODES, _DIGITS, ["tests/arm/test_characteristic.py"]],
    "arm/driven": [["tests/arm/test_response.py"]],
    "arm/edges": _STABILITY,
    "arm/energy": _PHYSICS,
    "arm/evaluation": [],
    "arm/excitation": _STABILITY,
    "arm/excited": [],
    "arm/forced": [["tests/arm/test_frequency_response.py"]],
    "arm/implicit": [["tests/arm/test_sensitivity.py"]],
    "arm/joint": _PHYSICS,
    "arm/limits": [],
    "arm/modal": [_MODES, [_MODAL]],
    "arm/modal_dynamics": [],
    "arm/modal_lanes": [_LANES],
    "arm/modal_sum": [["tests/arm/test_energy.py"]],
    "arm/motion": [],
    "arm/orthogonality": [],
    "arm/operators": [],
    "arm/parameters": [["tests/arm/test_parameters.py", f"{_LAWS}::test_damping_may_come_close_to_critical"]],
    "arm/parametric": _STABILITY,
    "arm/residual": [_STATICS, *_STABILITY],
    "arm/resonance": [],
    "arm/sensitivity": [["tests/arm/test_sensitivity.py"], [f"{_LAWS}::test_sensitivities_are_slopes_at_any_length"]],
    "arm/shapes": [_MODES, [_MODAL]],
    "arm/shooting": [],
    "arm/spectrum": [_FREQUENCIES, _DIGITS, [_LAMBDA]],
    "arm/stability": _STABILITY[::-1],
    "arm/zones": _STABILITY,
    "model/oscillator": [["tests/model/test_oscillator.py"], ["tests/arm/test_response.py"]],
    "solvers/floquet_lanes": [[f"{_LANES[0]}::test_floquet"]],
    "solvers/certificates": [["tests/arm/test_certification.py"]],
    "solvers/coupled_modes": [_COUPLED],
    "solvers/driven_modes": [_COUPLED, ["tests/arm/test_response.py"]],
    "solvers/eigenvalues": _STIFFNESS,
    "solvers/floquet": _FLOQUET,
    "solvers/hill": [_HILL],
    "solvers/modal_response": [
        ["tests/solvers/test_modal_response.py", *_COUPLED],
        ["tests/arm/test_response.py"],
    ],
    "solvers/motion": [
        ["tests/solvers/test_motion.py", f"{_LAWS}::test_a_harmonic_of_no_size_or_speed_is_over_at_once"]
    ],
    "solvers/rayleigh": _STIFFNESS,
    "solvers/shapes": _STIFFNESS,
    "solvers/spectrum": [["tests/solvers/test_spectrum.py"], _DIGITS],
    "solvers/spectrum_lanes": [[f"{_LANES[0]}::test_spectrum"]],
    "solvers/stiffness": _STIFFNESS,
}


def watched_modules() -> tuple[str, ...]:
    """Return the oscillators and all modules of the arm and of the solvers, as ``arm/energy``, but those exempt."""
    files = sorted(file for room in ("arm", "solvers") for file in (PACKAGE / room).glob("*.py"))
    names = (file.relative_to(PACKAGE).with_suffix("").as_posix() for file in files if file.stem != "__init__")
    return ("model/oscillator", *(name for name in names if name not in EXEMPT))


def rounds(module: str) -> list[list[str]]:
    """Return the rounds of a module; without an entry, the tests of the same name."""
    room, _, name = module.partition("/")
    return _ROUNDS.get(module, [[f"tests/{room}/test_{name}.py"]])
