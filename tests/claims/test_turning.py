"""Every verdict can change: each claim has a perturbation of the physics, or of what is not known, that turns it."""

import copy
import re

import numpy as np
import pytest

import cra_sym as cra
from cra_sym.claims import claim, comparisons, energy, ledger, modes, motions, responses, sensitivity, stability, zones
from cra_sym.mechanics import boundaries
from cra_sym.paper import joint, parametric
from cra_sym.paper.flipped import flipped_frequencies

ARM = cra.Arm.nominal()
TURNS = {}


def changed(results, **values):
    """Return a copy of lazily computed results with some of them fixed."""
    results, kind = copy.copy(results), type(results)
    vars(results).update(values)
    object.__setattr__(results, "__class__", type(kind.__name__, (kind,), values))
    return results


def turns(id, before, after):
    """Register a perturbation; what it returns goes to the judge: an arm, or numbers of the setting."""

    def register(function):
        TURNS[id] = function, before, after
        return function

    return register


@turns("C01", "holds", "contradicted")
def thicker_arm(patch):
    return {"arm": ARM.replace(h=0.004)}


@turns("C02", "holds", "contradicted")
def softer_spring_that_stiffens(patch):
    def mirrored(arm, modes=3):
        return cra.natural_frequencies(arm.replace(k_t=np.inf), modes) ** 2 / cra.natural_frequencies(arm, modes)

    patch.setattr(modes, "natural_frequencies", mirrored)


@turns("C03", "contradicted", "rarely holds")
def sign_of_the_rotational_spring(patch):
    def flipped(arm, modes=3):
        frequencies = flipped_frequencies if np.all(np.isfinite(arm.k_r)) else cra.natural_frequencies
        return frequencies(arm, modes)

    patch.setattr(modes, "natural_frequencies", flipped)


@turns("C04", "holds", "contradicted")
def slower_way_to_the_limit(patch):
    true = cra.frequency_parameters
    patch.setattr(modes, "frequency_parameters", lambda t, r, *rest: true(np.sqrt(t), np.sqrt(r), *rest))


@turns("C05", "mostly holds", "contradicted")
def no_strain_in_the_translational_spring(patch):
    def never(arm, modes=3):
        found = cra.sensitivities(arm, modes)
        return changed(found, log_k_t=0 * found.log_k_t)

    patch.setattr(sensitivity, "sensitivities", never)


@turns("C06", "mostly holds", "holds")
def slope_that_falls_as_the_stiffness(patch):
    def falling(arm, modes=3):
        return changed(cra.sensitivities(arm, modes), df_dk_t=1 / np.asarray(arm.k_t)[..., None])

    patch.setattr(sensitivity, "sensitivities", falling)


@turns("C06b", "contradicted", "holds")
def flat_slope_along_the_rotational_stiffness(patch):
    def flat(arm, modes=3):
        found = cra.sensitivities(arm, modes)
        return changed(found, df_dk_r=1 + 0 * found.df_dk_r)

    patch.setattr(sensitivity, "sensitivities", flat)

    patch.setattr(sensitivity, "sensitivities", flat)


@turns("C07", "rarely holds", "contradicted")
def arm_that_moves_with_the_base_at_the_start(patch):
    true = motions.tip
    patch.setattr(motions, "tip", lambda *given, **options: true(*given, **{**options, "start": "base"}))


@turns("C08", "mostly holds", "contradicted")
def no_disturbance(patch):
    return {"amplitude": 0.0}


@turns("C09", "mostly holds", "holds")
def hardly_any_mean_acceleration(patch):
    return {"accelerations": (1e-4,)}


@turns("C10", "rarely holds", "contradicted")
def joint_that_does_not_give(patch):
    true = motions.tip

    def stiff(setting, arm, *given, **options):
        return true(setting, arm.replace(k_t=1e12 * np.ones_like(arm.k_t)), *given, **options)

    patch.setattr(comparisons, "tip", stiff)


@turns("C11", "rarely holds", "contradicted")
def joint_that_does_not_give_either(patch):
    joint_that_does_not_give(patch)


@turns("C12", "mostly holds", "holds")
def hardly_any_disturbance(patch):
    return {"amplitude": 1e-9}


@turns("C13", "contradicted", "holds")
def arm_that_stiffens(patch):
    """Its response is not a sum, and what the disturbance adds depends on the mean motion."""
    true = motions.tip

    def stiffening(*given, **options):
        v = true(*given, **options)
        return v + 1e3 * v**3

    patch.setattr(comparisons, "tip", stiffening)


@turns("C14", "contradicted", "holds")
def base_that_shakes_the_joint(patch):
    true = parametric.excited_motion
    patch.setattr(
        parametric, "excited_motion", lambda kind: true("joint stiffness" if kind == "transverse base" else kind)
    )


@turns("C15", "contradicted", "holds")
def amplitude_equation_with_the_conjugate(patch):
    principal = boundaries.general_resonance("principal", 1, damped=False)
    patch.setattr(boundaries, "forced_resonance", lambda: principal)


@turns("C16", "rarely holds", "contradicted")
def inverted_widths(patch):
    true = zones._widths
    patch.setattr(zones, "_widths", lambda *given: 1 / true(*given))


@turns("C17", "mostly holds", "contradicted")
def lighter_end_effectors(patch):
    return {"masses": claim("C17").setting.masses[::-1]}


@turns("C18", "contradicted", "holds")
def beam_that_stores_all_energy(patch):
    patch.setattr(energy, "_joint_share", lambda arm: np.zeros((*arm.shape, 3)))
    patch.setattr(energy, "_beam_share", lambda arm: np.ones((*arm.shape, 3)))


@turns("C19", "mostly holds", "contradicted")
def no_second_tongue(patch):
    patch.setattr(stability, "_largest_growth", lambda arm, epsilon, tongue: epsilon * (tongue == 1))


@turns("C20", "holds", "contradicted")
def springs_loaded_alike(patch):
    def alike(arm):
        found = cra.sensitivities(arm)
        return changed(found, df_dc_t=found.df_dc_r)

    patch.setattr(sensitivity, "sensitivities", alike)


@turns("C21", "holds", "mostly holds")
def sign_in_the_virtual_work(patch):
    first, second, *others = joint.boundary_conditions()
    patch.setattr(joint, "boundary_conditions", lambda: (first, second.func(second.lhs, -second.rhs), *others))


@turns("C22", "undecidable", "contradicted")
def other_printed_peaks(patch):
    return {"peaks": (1.0, 2.0, 3.0, 4.0)}


@turns("C23", "rarely holds", "holds")
def joint_that_does_not_turn(patch):
    true = cra.frequency_response
    patch.setattr(responses, "frequency_response", lambda arm, *rest: true(arm.replace(k_r=1e9 * arm.k_r), *rest))


def test_each_claim_has_a_perturbation():
    assert tuple(TURNS) == ledger._load()


@pytest.mark.parametrize("id", TURNS)
def test_the_verdict_turns(id, judge, monkeypatch):
    perturb, before, after = TURNS[id]
    former = claim(id)
    assert former.outcome == before
    changes = perturb(monkeypatch) or {}
    with np.errstate(divide="ignore", invalid="ignore"):
        found = judge(id, **changes)
    assert found.judgement.outcome == after
    assert found.plain != former.plain and words(found.plain) != words(former.plain)
    assert found.sentence != former.sentence


def words(text):
    return re.sub(r"[\d.]+", "", text)
