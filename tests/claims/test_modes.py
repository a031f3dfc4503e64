"""Claims on frequencies: numbers by a second route, and verdicts that turn when the physics is perturbed."""

import numpy as np
import pytest

import cra_sym as cra
from cra_sym.claims import claim, energy, modes, provenance_family
from cra_sym.claims.family import MATERIALS, common_scale
from cra_sym.paper import joint
from cra_sym.paper.flipped import flipped_frequencies

ARM = cra.Arm.nominal()
BARE = ARM.replace(m_e=0.0)


def test_c01_turns_with_the_numbers(judge):
    assert judge("C01").judgement.outcome == "holds"
    assert judge("C01", ARM.replace(h=0.004)).judgement.outcome == "contradicted"
    assert judge("C01", frequencies=(2.448, 15.4, 42.950)).judgement.outcome == "contradicted"


def test_c01_scale_is_that_of_the_textbook():
    low, high, _ = common_scale([2.448, 15.339, 42.950])
    by_hand = 2 * np.pi * 42.950 / 7.854757438237613**2
    assert low < by_hand < high and high - low < 2e-4


def test_c02_slope_is_that_of_the_frequencies():
    verdict = claim("C02")
    k_t = verdict["k_t"]
    up, down = (cra.natural_frequencies(ARM.replace(k_t=k_t * s)) for s in (1 + 1e-5, 1 - 1e-5))
    slope = 4 * np.pi**2 * (up**2 - down**2) / (2e-5 * k_t[:, None])
    np.testing.assert_allclose(verdict["slope"][1, 0, 20:], slope[20:], rtol=2e-4)


def test_c03_is_reproduced_by_the_flipped_sign(judge, monkeypatch):
    assert claim("C03").outcome == "contradicted"
    monkeypatch.setattr(modes, "natural_frequencies", lambda arm, modes=3: _flipped_or_rigid(arm, modes))
    found = judge("C03")
    assert found.judgement.outcome in ("mostly holds", "rarely holds")
    np.testing.assert_array_equal(found.evidence["region"].values, claim("C03")["flipped_region"])


def _flipped_or_rigid(arm, modes):
    return flipped_frequencies(arm, modes) if np.all(np.isfinite(arm.k_r)) else cra.natural_frequencies(arm, modes)


def test_c03_offers_no_remedy_that_does_not_work(judge, monkeypatch):
    monkeypatch.setattr(modes, "flipped_frequencies", cra.natural_frequencies)
    assert judge("C03").remedy is None


def test_c05_limits_are_those_of_the_cantilever(judge):
    """(lambda sigma)^2 with sigma = (sinh + sin) / (cosh + cos), the textbook's shear over moment at the root."""
    lam = cra.frequency_parameters(np.inf, np.inf, 0.0)
    sigma = (np.sinh(lam) - np.sin(lam)) / (np.cosh(lam) + np.cos(lam))
    found = judge("C05", BARE).evidence["critical"].values
    np.testing.assert_allclose(found, (lam * sigma) ** 2, rtol=1e-9)
    np.testing.assert_allclose(found, [1.89, 22.9, 61.6], rtol=3e-3)


def test_c06_tells_where_the_growth_ends():
    verdict = claim("C06")
    turn, grows, k_t = verdict["turn"], verdict["region"], verdict["k_t"]
    assert grows[:, 0].all() and not grows[:, 1:].all()
    for mode in (1, 2):
        np.testing.assert_array_equal(grows[:, mode], k_t[1:] >= turn[mode] * (1 - 1e-9))
    assert claim("C06b")["factor"].min() > 1000 and claim("C06b").outcome == "contradicted"


def test_c18_holds_for_the_full_energy_only(judge, monkeypatch):
    verdict = claim("C18")
    assert verdict.outcome == "contradicted" and "k_t v(0)^2/2" in verdict.remedy
    np.testing.assert_allclose(verdict["with_springs"], 1.0, rtol=1e-10)
    assert verdict["beam_only"].min() < 0.4
    monkeypatch.setattr(energy, "_joint_share", lambda arm: np.zeros((41, 3)))
    assert judge("C18").remedy is None


def test_c20_coefficients(judge):
    found = judge("C20", BARE).evidence
    np.testing.assert_allclose(found["coefficient_r"].values, 2.0, rtol=1e-9)
    np.testing.assert_allclose(found["coefficient_t"].values, [3.8, 45.7, 123], rtol=5e-3)
    stiff = found["kappa"].values[-1]
    np.testing.assert_allclose(
        found["drop"].values[:, -1] * stiff, [found["coefficient_t"].values, found["coefficient_r"].values], rtol=1e-3
    )


def test_c21_turns_with_a_sign_in_the_virtual_work(judge, monkeypatch):
    true = joint.boundary_conditions()
    wrong = (*true[:1], true[1].func(true[1].lhs, -true[1].rhs), *true[2:])
    monkeypatch.setattr(joint, "boundary_conditions", lambda: wrong)
    found = judge("C21")
    assert found.judgement.outcome in ("mostly holds", "rarely holds")
    np.testing.assert_array_equal(found.evidence["with_springs"].values, [True, False, True, True])


def test_family_shares_the_published_frequencies():
    family = provenance_family()
    shape = (len(family.materials), family.length.size, 3)
    np.testing.assert_array_equal(family.frequencies.round(3), np.broadcast_to(family.published, shape))
    assert family.mass.max() > 20 * family.mass.min() and family.stiffness.max() > 20 * family.stiffness.min()
    b, h = cra.Arm.nominal().b, family.thickness
    E, rho = np.array(list(MATERIALS.values())).T[:, :, None]
    np.testing.assert_allclose(family.mass, rho * b * h * family.length, rtol=1e-12)
    np.testing.assert_allclose(family.stiffness, E * b * h**3 / 4 / family.length**3, rtol=1e-10)
    with pytest.raises(ValueError, match="no clamped uniform arm"):
        provenance_family([2.0, 15.0, 43.0])
