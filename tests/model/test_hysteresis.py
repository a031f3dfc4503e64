"""Elastic-slip elements: closed forms against quadrature, their place in a model, and what is refused."""

from __future__ import annotations

import itertools
import pickle

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import quad

import cra_sym as cra
from cra_sym.symbols import L, t, v, x

k_d, f_s = sp.symbols("k_d f_s", positive=True)
CLAMPED = [v.subs(x, 0), v.diff(x).subs(x, 0)]
BEAM = v.diff(t) ** 2 / 2 - v.diff(x, 2) ** 2 / 2


def beam(*elements, **options):
    return cra.Model(BEAM, fields=[v], x=x, domain=(0, L), t=t, essential=CLAMPED, hysteresis=elements, **options)


# closed forms ------------------------------------------------------------------------------------------------------


def loop(stiffness, slip, amplitude):
    """Return loss and first harmonic of one element, by Gauss quadrature of the four parts of its loop."""
    limit = slip / stiffness
    if amplitude <= limit:
        return 0.0, stiffness
    onset = np.arccos(1 - 2 * limit / amplitude)  # after the reversal at theta = 0, sticking ends
    nodes, weights = np.polynomial.legendre.leggauss(60)
    work = harmonic = 0.0
    for start, stop, force in (
        (0.0, onset, lambda theta: stiffness * (amplitude * np.cos(theta) - amplitude + limit)),
        (onset, np.pi, lambda theta: -slip + 0 * theta),
    ):
        theta, weight = start + (stop - start) * (nodes + 1) / 2, weights * (stop - start) / 2
        work += 2 * np.sum(weight * force(theta) * -amplitude * np.sin(theta))
        harmonic += 2 * np.sum(weight * force(theta) * np.cos(theta)) / np.pi / amplitude
    return work, harmonic


def test_one_element_has_the_loop_of_its_spring_and_slider():
    element = cra.Jenkins(60.0, 3.0)
    amplitudes = np.geomspace(0.01, 20.0, 50)
    wanted = np.array([loop(60.0, 3.0, a) for a in amplitudes])
    np.testing.assert_allclose(element.loss(amplitudes), wanted[:, 0], rtol=1e-10)
    np.testing.assert_allclose(element.equivalent_stiffness(amplitudes), wanted[:, 1], rtol=1e-10)
    np.testing.assert_allclose(element.loss(1.0), 4 * 3.0 * (1.0 - 0.05), rtol=1e-14)
    np.testing.assert_allclose(element.force([-1.0, 0.02, 1.0]), [-3.0, 1.2, 3.0])
    np.testing.assert_allclose(element.secant_stiffness([0.0, 0.05, 0.1]), [60.0, 60.0, 30.0])


DISTRIBUTIONS = [
    cra.Iwan(1e6, 100.0, -0.5, 0.5),
    cra.Iwan(3.0, 3.0),
    cra.Iwan.of_density(2.0, 1.0, 3.0, -0.3),
    cra.Iwan.of_points([0.1, 1.0, 2.0], [1.0, 3.0, 0.0]),
]


@pytest.mark.parametrize("iwan", DISTRIBUTIONS, ids=str)
def test_distributions_are_the_integral_of_their_elements(iwan):
    """At 50 amplitudes, stuck to gross slip; quadrature over the slip displacement in pieces that are smooth."""
    pieces, single = iwan.distribution
    largest = float(pieces[-1].stop)
    amplitudes = np.geomspace(1e-3, 30.0, 50) * largest

    def summed(of_one, a):
        total = sum(float(k) * of_one(float(phi), a) for k, phi in single)
        return total + sum(over(piece, of_one, a) for piece in pieces)

    def over(piece, of_one, a):
        (factor, exponent), *rest = [(float(f), float(e)) for f, e in piece.terms]
        low, high, power = float(piece.start), float(piece.stop), 1 / (1 + exponent)

        def integrand(y):  # phi = y^(1/(1 + exponent)) takes the singularity at zero away
            phi = y**power
            return power * (factor + sum(f * phi ** (e - exponent) for f, e in rest)) * of_one(phi, a)

        ends = sorted({low, high, float(np.clip(a, low, high))})
        parts = ((start ** (1 / power), stop ** (1 / power)) for start, stop in itertools.pairwise(ends))
        return sum(quad(integrand, *part, epsabs=0, epsrel=1e-12, limit=400)[0] for part in parts)

    def share(phi, a):
        theta = np.arccos(np.clip(1 - 2 * phi / a, -1, 1))
        return (theta - np.cos(theta) * np.sin(theta)) / np.pi

    stiffness = [summed(share, a) for a in amplitudes]
    loss = [summed(lambda phi, a: 4 * phi * max(a - phi, 0.0), a) for a in amplitudes]
    force = [summed(min, a) for a in amplitudes]
    # arccos loses half the digits of a small angle, which is a small share of the sum
    np.testing.assert_allclose(iwan.equivalent_stiffness(amplitudes), stiffness, rtol=1e-10)
    np.testing.assert_allclose(iwan.loss(amplitudes), loss, rtol=1e-10)
    np.testing.assert_allclose(iwan.force(amplitudes), force, rtol=1e-10)


@pytest.mark.parametrize("chi", [-0.9, -0.5, -0.1, 0.0])
def test_limits_of_the_four_parameter_law(chi):
    iwan = cra.Iwan(1e6, 100.0, chi, 0.5)
    np.testing.assert_allclose(iwan.equivalent_stiffness([0.0, 1e-60]), 1e6, rtol=1e-5)  # stuck
    a = np.geomspace(1e-3, 1.0, 50) * iwan.phi_max  # a power of the displacement until the last ones slip
    np.testing.assert_allclose(iwan.loss(a), 4 * iwan.R * a ** (3 + chi) / ((2 + chi) * (3 + chi)), rtol=1e-10)
    wide = np.geomspace(2.0, 1e6, 50) * iwan.phi_max  # gross slip: the force is that of all sliders
    np.testing.assert_allclose(iwan.force(wide), 100.0, rtol=1e-12)
    slope = np.diff(iwan.loss(wide)) / np.diff(wide)
    np.testing.assert_allclose(slope, 400.0, rtol=1e-9)
    again = cra.Iwan.of_density(iwan.R, iwan.S, iwan.phi_max, chi)
    for name in ("stiffness", "slip", "beta", "phi_max"):
        np.testing.assert_allclose(getattr(again, name), getattr(iwan, name), rtol=1e-12)


@pytest.mark.parametrize("chi", [-0.9, -0.5, 0.0])
def test_elements_of_a_distribution_converge_as_stated(chi):
    iwan = cra.Iwan(1e6, 100.0, chi, 0.5)
    a = np.geomspace(2e-3, 10.0, 200) * iwan.phi_max
    errors = []
    for number in (30, 60, 120):
        stiffness, slip = iwan.elements(number)
        assert abs(len(stiffness) - number) <= 1 and (stiffness > 0).all()
        np.testing.assert_allclose([stiffness.sum(), slip.sum()], [1e6, 100.0], rtol=1e-12)
        some = cra.Jenkins(stiffness, slip)
        errors.append(np.abs(some.loss(a[:, None]).sum(axis=1) / iwan.loss(a) - 1).max())
    assert np.all(np.array(errors) < [0.05, 0.01, 0.003])
    assert (
        np.abs(
            cra.Jenkins(*iwan.elements(60)).equivalent_stiffness(a[:, None]).sum(axis=1) / iwan.equivalent_stiffness(a)
            - 1
        ).max()
        < 1e-3
    )


def test_elements_are_values():
    one, other = cra.Iwan([1.0, 2.0], 1.0, -0.5), cra.Iwan([1.0, 2.0], 1.0, -0.5)
    assert one == other and hash(one) == hash(other) and pickle.loads(pickle.dumps(one)) == one
    assert one != cra.Iwan([1.0, 2.0], 1.0, -0.4) and cra.Jenkins(k_d, 1.0) == cra.Jenkins(k_d, 1.0)
    assert one.loss(0.1).shape == (2,) and cra.Jenkins(k_d, 1.0).replace(stiffness=2.0).loss(1.0) == 2.0


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: cra.Jenkins(-1.0, 1.0), r"stiffness = -1.0: must be real numbers in \(0, inf\)"),
        (lambda: cra.Jenkins(1.0, 0.0), r"slip = 0.0: must be real numbers in \(0, inf\)"),
        (lambda: cra.Jenkins(1.0, np.inf), r"slip = inf: must be"),
        (lambda: cra.Jenkins([1.0, np.nan], 1.0), r"stiffness\[1\] = nan: must be"),
        (lambda: cra.Jenkins("stiff", 1.0), "stiffness = 'stiff': must be"),
        (lambda: cra.Jenkins([1.0, 2.0], [1.0, 2.0, 3.0]), "shapes do not broadcast"),
        (lambda: cra.Iwan(1.0, 1.0, -1.0), r"chi = -1.0: must be real numbers in \(-1, 0\]"),
        (lambda: cra.Iwan(1.0, 1.0, 0.5), r"chi = 0.5: must be"),
        (lambda: cra.Iwan(1.0, 1.0, beta=-1.0), "beta = -1.0: must be"),
        (lambda: cra.Iwan(1.0, 1.0, number=1), "number = 1: must be"),
        (lambda: cra.Iwan.of_density(0.0, 1.0, 1.0, -0.5), "R = 0.0: must be"),
        (lambda: cra.Iwan.of_points([1.0, 0.5], [1.0, 1.0]), "displacements = .*: must ascend"),
        (lambda: cra.Iwan.of_points([0.0, 0.5], [0.0, 0.0]), "densities = .*: one of them must be positive"),
        (lambda: cra.Iwan.of_points([0.0, 0.5], [0.0, -1.0]), r"densities\[1\] = -1.0: must be"),
        (lambda: cra.Iwan.of_points([0.0, 0.5], [1.0]), "densities = .*: must be one axis"),
        (lambda: cra.Jenkins(k_d, 1.0).loss(1.0), "stiffness = k_d: must be a number here"),
        (lambda: cra.Jenkins(sp.Function("k")(t), 1.0), r"stiffness = k\(t\): must be numbers or"),
        (lambda: cra.Jenkins(1.0, 1.0).loss(-1.0), "amplitude = -1.0: must be"),
    ],
)
def test_bad_elements_are_refused_by_name(make, words):
    with pytest.raises((TypeError, ValueError), match=words):
        make()


# in a model --------------------------------------------------------------------------------------------------------


def test_linear_results_take_the_elements_stuck():
    slipping = beam((cra.Jenkins(k_d, f_s), v, "right"), (cra.Iwan(20.0, f_s, -0.5), v.diff(x), sp.Rational(1, 3)))
    stuck = cra.Model(
        BEAM,
        fields=[v],
        x=x,
        domain=(0, L),
        t=t,
        essential=CLAMPED,
        right=-k_d * v**2 / 2,
        inside=[(sp.Rational(1, 3), -20 * v.diff(x) ** 2 / 2)],
    )
    values = {"L": 1.0, "k_d": [60.0, 5.0]}
    system = slipping.at({**values, "f_s": 3.0})
    np.testing.assert_array_equal(cra.natural_frequencies(system), cra.natural_frequencies(stuck.at(values)))
    assert slipping.replace(left=None) == slipping and slipping.without_hysteresis == beam()
    assert system.without_hysteresis.values == {"L": 1.0} and pickle.loads(pickle.dumps(system)) == system
    assert beam().without_hysteresis is not None and beam().at({"L": 1.0}).without_hysteresis == beam().at({"L": 1.0})


def test_elements_seen_by_modes_and_their_statics():
    """Rows against mode shapes; the flexibility against the statics of a cantilever and the sum over many modes."""
    a = 0.3
    system = beam((cra.Jenkins(k_d, f_s), v, "right"), (cra.Jenkins(7.0, 2.0), v, a)).at(
        {"L": 1.0, "k_d": [60.0, 5.0], "f_s": 3.0}
    )
    found, base = system.slip_elements(4), system.without_hysteresis
    np.testing.assert_allclose(found.stiffness, [[60.0, 7.0], [5.0, 7.0]])
    np.testing.assert_allclose(found.slip, [[3.0, 2.0]] * 2)
    shapes = cra.mode_shapes(base, [1.0, a], modes=4).T
    np.testing.assert_allclose(found.rows, [shapes, shapes], rtol=1e-9)
    omega = base.natural_frequencies(4)
    statics = np.array([[1 / 3, a**2 * (3 - a) / 6], [a**2 * (3 - a) / 6, a**3 / 3]])  # by tables of beams
    # many short pieces between interior places lose digits of the statics, whose 1e-3 is what is left out here
    left_out = statics - (shapes / omega**2) @ shapes.T
    np.testing.assert_allclose(found.flexibility[0], left_out, rtol=0, atol=1e-8 * statics[0, 0])


def test_own_flexibility_becomes_part_of_the_elements():
    """In series with a spring the force on the way from rest is that of the absorbed elements, at the sum of both."""
    system = beam((cra.Jenkins(60.0, 3.0), v, "right"), (cra.Iwan(30.0, 2.0, -0.5, number=6), v, "right")).at({"L": 1})
    found = system.slip_elements(1)
    flexibility, absorbed = found.flexibility[0, 0], found.absorbed()
    assert flexibility > 0 and not absorbed.flexibility.any() and (absorbed.stiffness > 0).all()
    u = np.linspace(0.0, 0.5, 401)
    force = cra.Jenkins(found.stiffness, found.slip).force(u[:, None]).sum(axis=1)
    again = cra.Jenkins(absorbed.stiffness, absorbed.slip).force((u + flexibility * force)[:, None]).sum(axis=1)
    np.testing.assert_allclose(again, force, rtol=1e-12)


def test_statics_of_the_modes_left_out_make_up_for_them():
    system = beam((cra.Jenkins(60.0, 3.0), v, "right")).at({"L": 1.0})
    exact, modal = system.natural_frequencies(3), np.diag(system.without_hysteresis.natural_frequencies(3) ** 2)
    errors = []
    for found in (system.slip_elements(3), system.slip_elements(3).absorbed()):
        stuck = modal + found.total * found.rows.T @ found.rows
        errors.append(np.abs(np.sqrt(np.linalg.eigvalsh(stuck)) / exact - 1).max())
    assert errors[1] < 3e-4 < 5e-3 < errors[0]


def test_coordinates_alone():
    q, w = sp.Function("q")(t), sp.Function("w")(t)
    lagrangian = (q.diff(t) ** 2 + w.diff(t) ** 2 - q**2 - 3 * w**2) / 2
    elements = [(cra.Jenkins(0.5, 0.2), q, None), (cra.Jenkins(0.5, 0.2), q - w, None)]
    system = cra.Model(
        0, fields=(), coordinates=[q, w], x=x, domain=(0, 1), t=t, left=lagrangian, hysteresis=elements
    ).at({})
    stuck = np.array([[1 + 1.0, -0.5], [-0.5, 3 + 0.5]])
    np.testing.assert_allclose(system.natural_frequencies(2) ** 2, np.linalg.eigvalsh(stuck), rtol=1e-12)
    np.testing.assert_allclose(system.slip_elements(2).rows, [[1, 0], [1, -1]], atol=1e-12)
    np.testing.assert_allclose(system.slip_elements(1).flexibility, [[0, 0], [0, 1 / 3]], atol=1e-12)


@pytest.mark.parametrize(
    ("elements", "words"),
    [
        ([(cra.Jenkins(1.0, 1.0), v, "left")], r"hysteresis\[0\]: v\(x, t\) cannot hold an element;.*is essential"),
        ([(cra.Jenkins(1.0, 1.0), v, "right"), (cra.Jenkins(1.0, 1.0), v.diff(x), "left")], r"hysteresis\[1\]"),
        ([(cra.Jenkins(1.0, 1.0), v, "middle")], "place = 'middle' must be 'left', 'right', an interior place or None"),
        ([(cra.Jenkins(1.0, 1.0), v, "domain")], "place = 'domain' must be"),
        ([(cra.Jenkins(1.0, 1.0), v.diff(x, 2), "right")], "is not a displacement of that end"),
        ([(cra.Jenkins(1.0, 1.0), v.diff(t), "right")], "free of time derivatives"),
        ([(cra.Jenkins(1.0, 1.0), v**2, "right")], "must be linear"),
        ([(cra.Jenkins(1.0, 1.0), k_d, "right")], "holds no field and no coordinate"),
        ([(cra.Jenkins([1.0, 2.0], 1.0), v, "right")], "holds an array; must be a symbol here"),
        ([(60.0, v, "right")], "60.0 must be a Jenkins or an Iwan"),
        ([(cra.Jenkins(1.0, 1.0), v)], r"must be \(element, displacement, place\)"),
        (cra.Jenkins(1.0, 1.0), "hysteresis = .*: must be a sequence"),
    ],
)
def test_bad_places_are_refused_by_name(elements, words):
    with pytest.raises((TypeError, ValueError), match=words):
        beam(*elements) if isinstance(elements, list) else beam().replace(hysteresis=elements)


def test_bad_values_are_refused_by_name():
    model = beam((cra.Jenkins(k_d, f_s), v, "right"))
    for values, words in (
        ({"k_d": -1.0, "f_s": 1.0}, r"hysteresis\[0\]: stiffness = -1.0: must be real numbers in \(0, inf\)"),
        ({"k_d": [1.0, 0.0], "f_s": 1.0}, r"hysteresis\[0\]: stiffness\[1\] = 0.0: must be"),
        ({"k_d": 1.0, "f_s": np.inf}, r"hysteresis\[0\]: slip = inf: must be"),
    ):
        with pytest.raises(ValueError, match=words):
            model.at({"L": 1.0, **values})
    with pytest.raises(ValueError, match="no value for f_s"):
        model.at({"L": 1.0, "k_d": 1.0})
    with pytest.raises(ValueError, match="has no elastic-slip elements"):
        beam().at({"L": 1.0}).slip_elements(3)
    arm = cra.Arm.nominal()  # its rigid joint holds the root
    held = arm.model.replace(hysteresis=[(cra.Jenkins(1.0, 1.0), v, "left")]).at(arm.values)
    with pytest.raises(ValueError, match=r"hysteresis: v\(x, t\) at left is held, so nothing can slip there"):
        held.slip_elements(3)
