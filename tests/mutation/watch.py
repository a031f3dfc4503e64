"""Which tests watch over which module: in rounds, quickest first; the first round that fails decides.

Before any round come the checks of all numbered equations that the module has a part in.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from itertools import islice
from pathlib import Path

__all__ = ["EXEMPT", "PACKAGE", "rounds", "watched_modules"]

PACKAGE = Path(__file__).resolve().parents[2] / "cra_sym"
MANY = 5  # files of tests: a second round has no more
ELSEWHERE = {f"tests/test_{name}.py" for name in ("ending", "first_ten_minutes", "main")}
"""Tests in processes of their own, to which a mutant is unknown."""

#: Modules of which no mutant is made, with the reason.
EXEMPT = {
    "__init__": "names of the public functions and where they live",
    "__main__": "the command line, which tests run in processes of their own",
    "kernels/derived": "keeps derivations for the process that examines mutants",
    "kernels/store": "keeps derivations for the process that examines mutants",
    "paper/equations": "the registry of equations and how wide a printed line may be",
}

_PERIODIC = "tests/analysis/test_periodic.py"
_COMPLEX, _EIGENVALUES = "tests/analysis/test_complex_modes.py", "tests/model/test_eigenvalues.py"
_LAWS = "tests/test_properties.py"
_LAMBDA, _MODAL = "tests/analysis/test_frequency_parameters.py", "tests/analysis/test_modal_parameters.py"
_COUNTS = [
    f"tests/mechanics/test_one_wave.py::test_count_{name}"
    for name in ("steps_by_one_at_every_zero", "where_zeros_of_the_limits_are")
]
_SEAMS = f"{_MODAL}::test_ranges_of_the_numbers_are_those_of_the_derivation"
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


def _stability(*names: str) -> list[str]:
    return [f"tests/analysis/test_stability.py::test_{name}" for name in names]


_ZONES = _stability(
    "known_numbers_of_a_soft_joint",
    "zones_scale_with_the_arm",
    "the_zone_is_continuous_where_a_spring_vanishes",
    "damping_threshold_is_said",
    "both_order_conventions_of_a_resonance",
    "difference_resonance_of_a_symmetric_coupling_is_none",
    "rigid_joint_has_nothing_to_fluctuate",
    "rigid_body_mode_does_not_resonate",
    "tongue_at_the_natural_frequency_is_of_second_order",
)
_SUMMED = _stability("the_second_order_does_not_depend_on_how_many_modes_are_summed_one_by_one")
_LOOPED = _stability("broadcasting_equals_looping")
_DAMPED = _stability("damped_zone")
_ORDER = _stability("order_of_accuracy")
_DOUBTS = _stability(
    "overlap_with_a_second_tongue_is_said", "overlap_and_reach_are_said", "overlap_is_said_from_where_the_zones_touch"
)
_FORCED = _stability("forced_width_is_the_growth_of_the_tip")
_SYSTEM = _stability(
    "what_is_asked_for_by_default",
    "bad_input_is_named",
    "growth_is_that_of_the_written_out_system",
    "charts_are_compiled_where_it_pays",
    "without_excitation_nothing_grows",
)
_FEW_MODES = _stability(
    "three_modes_shift_the_second_zone_the_wrong_way", "residual_flexibility_is_the_limit_of_many_modes"
)
_STATICS = _stability(
    "sums_over_all_modes",
    "the_zone_is_continuous_where_a_spring_vanishes",
    "the_statics_of_a_rigid_spring_do_not_mix_with_those_of_the_other",
    "rank_one_terms_make_up_springs_in_series_with_what_is_left_out",
)
_LANES = ["tests/model/test_templates.py"]
_STIFFNESS = [
    [
        f"tests/solvers/test_stiffness.py::test_{name}"
        for name in (
            "steps_through_varying_coefficients_are_of_sixth_order",
            "stationary_values_of_graded_energies_keep_their_digits",
            "count_equals_closed_form_everywhere",
            "string_with_a_damper_at_its_end",
            "equal_roots_are_counted_and_get_orthogonal_shapes",
            "the_entire_function_is_the_product_over_all_roots",
            "a_matrix_that_is_singular_to_the_last_bit_is_moved_by_rounding_errors",
            "a_pole_that_is_hit_to_the_last_bit",
            "how_often_a_part_is_halved_depends_on_no_unit_of_length",
            "a_root_costs_few_evaluations",
            "a_varying_part_is_cut_finer_than_a_uniform_one",
            "equal_damped_strings_get_shapes_of_their_own",
            "quotients_of_rough_roots_are_wrong_in_second_order_only",
            "more_soft_roots_than_static_deflections",
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
        "many_exponents_leave_narrow_gaps",
        "exponents_of_free_modes_in_whole_ratios_to_the_excitation",
    )
]
_FLOQUET = [
    _HILL[:1],
    [
        f"tests/solvers/test_floquet.py::test_{name}"
        for name in (
            "mathieu_edges",
            "monodromy_is_that_of_a_general_integrator",
            "compliance_is_a_spring_in_series",
            "error_is_what_was_asked_for",
            "multipliers_come_in_reciprocal_pairs",
            "no_excitation_no_growth",
            "growth_is_that_of_the_fastest_exponent",
            "any_argument_alone_may_be_the_batch",
            "batch_equals_loop",
        )
    ],
]
_COUPLED = ["tests/solvers/test_coupled_modes.py"]
_PHYSICS = [_FREQUENCIES, _MODES]

_ROUNDS: dict[str, list[list[str]]] = {
    "analysis/modes": [_MODES, [_MODAL, _LAMBDA]],
    "paper/oracles/by_hand": [["tests/paper/oracles/test_by_hand.py"]],
    "paper/oracles/forces": [],
    "paper/oracles/implicit_rates": [["tests/analysis/test_sensitivities.py"]],
    "paper/driven": [["tests/analysis/test_responses.py"]],
    "analysis/floquet_boundary": [
        [*_stability("the_search_finds_the_borders_of_what_grows"), *_ZONES[:1], *_SYSTEM[1:2]],
        [*_DAMPED, *_FEW_MODES[:1], *_ORDER],
    ],
    "paper/energy": [["tests/paper/test_energy.py"], *_PHYSICS],
    "paper/evaluation": [],
    "arm/frequency_parameters": [_FREQUENCIES, _DIGITS, [_LAMBDA]],
    "arm/lagrangian": [["tests/paper/test_energy.py"], *_PHYSICS],
    "arm/excitations": [["tests/analysis/test_stability.py"]],
    "kernels/arithmetic": [["tests/kernels/test_writer.py"], ["tests/kernels/test_callables.py"]],
    "mechanics/points": [["tests/model/test_members.py"], ["tests/model/test_nonlinear.py"]],
    "mechanics/polynomials": [["tests/model/test_nonlinear.py"]],
    "model/soft_springs": [["tests/model/test_one_wave.py"], _DIGITS],
    "model/excitations": [
        [*_ZONES[:3], *_FORCED, *_SYSTEM[:3]],
        [*_stability("excitations_compare_hash_and_pickle"), *_LOOPED, *_ORDER],
    ],
    "paper/excited": [],
    "paper/groups": [],
    "paper/implicit": [["tests/analysis/test_sensitivities.py"]],
    "paper/joint": _PHYSICS,
    "paper/limits": [],
    "paper/modal_dynamics": [],
    "paper/modal_sum": [["tests/paper/test_energy.py"]],
    "paper/motion": [["tests/paper/test_motion.py"]],
    "paper/orthogonality": [],
    "paper/operators": [],
    "arm/parameters": [["tests/arm/test_parameters.py", f"{_LAWS}::test_damping_may_come_close_to_critical"]],
    "paper/parametric": [["tests/paper/test_parametric.py"], _FORCED],
    "analysis/static_corrections": [_STATICS, _SUMMED + _FEW_MODES, _LOOPED],
    "paper/resonance": [],
    "paper/stability_boundary": [],
    "paper/shapes": [],
    "analysis/sensitivities": [
        ["tests/analysis/test_sensitivities.py"],
        [f"{_LAWS}::test_sensitivities_are_slopes_at_any_length", "tests/analysis/test_residual_gradient.py"],
    ],
    "paper/oracles/shooting": [],
    "analysis/stability": [[*_ZONES, *_FORCED], [*_LOOPED, *_DOUBTS, *_FEW_MODES]],
    "analysis/eigenvalues": [[_EIGENVALUES]],
    "analysis/complex_responses": [[_COMPLEX]],
    "analysis/complex_shapes": [[_COMPLEX]],
    "model/complex_shapes": [[_COMPLEX]],
    "model/pencil_route": [[_EIGENVALUES], [_COMPLEX]],
    "solvers/argument": [[_EIGENVALUES]],
    "solvers/lowest_motions": [[_COMPLEX]],
    "solvers/pencil": [[_EIGENVALUES], ["tests/analysis/test_critical.py"], [_COMPLEX]],
    "solvers/pencil_refine": [[_EIGENVALUES], [_COMPLEX]],
    "analysis/floquet": [[*_ZONES, *_SYSTEM], [*_LOOPED, *_FEW_MODES], [_PERIODIC]],
    "analysis/reduced_zones": [[_PERIODIC]],
    "model/excited": [[_PERIODIC]],
    "solvers/normal_form": [[_PERIODIC]],
    "solvers/periodic": [[_PERIODIC]],
    "solvers/taylor": [[_PERIODIC]],
    "solvers/taylor_lanes": [[f"{_LANES[0]}::test_series_of_periodic_systems"]],
    "solvers/taylor_operations": [[f"{_LANES[0]}::test_series_of_periodic_systems"]],
    "solvers/proved_stability": [[_PERIODIC]],
    "analysis/zones": [[*_ZONES, *_SUMMED], [*_LOOPED, *_DAMPED, *_DOUBTS], _ORDER],
    "model/oscillator": [["tests/model/test_oscillator.py"], ["tests/analysis/test_responses.py"]],
    "solvers/certificates": [["tests/analysis/test_certification.py"]],
    "solvers/ball_stiffness": [["tests/analysis/test_certification.py"]],
    "solvers/ball_determinant": [["tests/analysis/test_certified_eigenvalues.py"]],
    "solvers/enclosed_zeros": [
        ["tests/solvers/test_enclosed_zeros.py"],
        ["tests/analysis/test_certified_eigenvalues.py"],
    ],
    "solvers/eigenvalue_enclosures": [["tests/analysis/test_certified_eigenvalues.py"]],
    "solvers/coupled_modes": [_COUPLED],
    "solvers/driven_modes": [_COUPLED, ["tests/analysis/test_responses.py"]],
    "solvers/eigenvalues": _STIFFNESS,
    "solvers/floquet": _FLOQUET,
    "solvers/force": [["tests/solvers/test_motion.py"]],
    "solvers/hill": [_HILL],
    "solvers/modal_response": [
        ["tests/solvers/test_modal_response.py", *_COUPLED],
        ["tests/analysis/test_responses.py"],
    ],
    "solvers/modal_lanes": [
        [f"{_LANES[0]}::test_{name}" for name in ("a_mode_that_needs_another_basis_than_those_beside_it", "modes")]
    ],
    "solvers/one_wave": [["tests/solvers/test_spectrum.py", *_FREQUENCIES, _SEAMS], _DIGITS, _COUNTS, [_LAMBDA]],
    "solvers/one_wave_shapes": [
        [*_MODES, f"{_MODAL}::test_a_textbook_cantilever", "tests/analysis/test_sensitivities.py"],
        [f"{_LANES[0]}::test_modes", "tests/analysis/test_residual_gradient.py", _MODAL],
    ],
    "solvers/motion": [
        ["tests/solvers/test_motion.py", f"{_LAWS}::test_a_harmonic_of_no_size_or_speed_is_over_at_once"]
    ],
    "solvers/pairs_lanes": [
        [f"{_LANES[0]}::test_{name}" for name in ("spectrum", "spectrum_of_extreme_arms", "modes")]
    ],
    "solvers/rayleigh": _STIFFNESS,
    "solvers/shapes": _STIFFNESS,
    "solvers/spectrum": [["tests/solvers/test_spectrum.py"], _DIGITS],
    "solvers/spectrum_lanes": [
        [
            f"{_LANES[0]}::test_{name}"
            for name in (
                "zeros_are_counted_anywhere",
                "the_count_does_not_jump_at_multiples_of_pi",
                "spectrum",
                "spectrum_of_many_modes",
                "spectrum_of_extreme_arms",
            )
        ]
    ],
    "solvers/stiffness": _STIFFNESS,
}


def watched_modules() -> tuple[str, ...]:
    """Return all modules of the package, as ``arm/lagrangian``, but those exempt."""
    files = sorted(file for file in PACKAGE.rglob("*.py") if file.stem != "__init__")
    names = (file.relative_to(PACKAGE).with_suffix("").as_posix() for file in files)
    return tuple(name for name in names if name not in EXEMPT)


def rounds(module: str) -> list[list[str]]:
    """Return the rounds of a module; without an entry, the tests nearest to it, and the next nearest unless many.

    Nearest is the file of its name; then those that import it, those of the modules that import it, and so on. Of
    those equally near the tests in the same room serve alone, if there are any.
    """
    if module in _ROUNDS:
        return _ROUNDS[module]
    nearest = list(islice(_nearest(module), 2)) or [_of_its_room(module)]
    return nearest[:1] + [part for part in nearest[1:] if len(part) <= MANY]


def _nearest(module: str) -> Iterator[list[str]]:
    room, fresh, seen = module.rpartition("/")[0], {module}, set[str]()
    told = set(_of_its_name(module))
    if told:
        yield sorted(told)
    while fresh:
        found = {test for test, named in _named_by("tests").items() if named & fresh}
        found = found.union(*map(_of_its_name, fresh)) - told - ELSEWHERE
        if found:
            yield [test for test in sorted(found) if test.startswith(f"tests/{room}/")] or sorted(found)
        told |= found
        seen |= fresh
        fresh = {user for user, named in _named_by("cra_sym").items() if named & fresh} - seen


def _of_its_room(module: str) -> list[str]:
    room = module.rpartition("/")[0]
    return [f"tests/{room}" if room and (PACKAGE.parent / "tests" / room).is_dir() else "tests/test_bad_input.py"]


def _of_its_name(module: str) -> list[str]:
    room, _, name = module.rpartition("/")
    file = "/".join(part for part in ("tests", room, f"test_{name}.py") if part)
    return [file] if (PACKAGE.parent / file).exists() else []


@cache
def _named_by(folder: str) -> dict[str, set[str]]:
    """Return for each test file, or module of the package, the modules that it imports."""
    found = {}
    for file in sorted((PACKAGE.parent / folder).rglob("test_*.py" if folder == "tests" else "*.py")):
        place = file.relative_to(PACKAGE.parent if folder == "tests" else PACKAGE).as_posix()
        home = ["cra_sym", *place.split("/")[:-1]]
        named = set()
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom):
                base = home[: len(home) - node.level + 1] if node.level else []
                origin = ".".join([*base, *([node.module] if node.module else [])])
                named |= {origin, *(f"{origin}.{alias.name}" for alias in node.names)}
            elif isinstance(node, ast.Import):
                named |= {alias.name for alias in node.names}
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                named.add(node.value.partition(":")[0])
        short = {name.removeprefix("cra_sym.").replace(".", "/") for name in named if name.startswith("cra_sym.")}
        found[place if folder == "tests" else place.removesuffix(".py")] = short
    return found
