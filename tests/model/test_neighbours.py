"""Neighbours of the cases of practice: other ends, other kinds of jumps, exceptional points; right or refused."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from numpy.testing import assert_allclose
from scipy.linalg import expm
from scipy.special import jn_zeros

import cra_sym as cra

x, t, c, P, U, k, m = sp.symbols("x t c P U k m")
v, F = sp.Function("v")(x, t), sp.Function("F")(t)
R, HALF = sp.Rational, sp.Rational(1, 2)
ROOT, FOOT = v.subs(x, 0), v.diff(x).subs(x, 0)
CLAMPED, PINNED = (ROOT, FOOT), (ROOT, v.subs(x, 1))
FREE, FIXED = (), (*CLAMPED, v.subs(x, 1), v.diff(x).subs(x, 1))
IRRATIONAL = 1 / sp.sqrt(2)
CLOSE = 1e-10


def line(stiffness=1, mass=1, order=2, essential=CLAMPED, more=0, domain=(0, 1), **options):
    density = mass * v.diff(t) ** 2 / 2 - stiffness * v.diff(x, order) ** 2 / 2 + more
    return cra.Model(density, fields=[v], x=x, domain=domain, t=t, essential=essential, **options)


def step(place, left, right):
    return sp.Piecewise((left, x < place), (right, True))


# what is not smooth -----------------------------------------------------------------------------------------------

STEPPED = {"stiffness": step(HALF, 1, R(1, 10)), "mass": step(HALF, 1, R(46, 100))}
ROUGH = {
    "step, pinned": line(**STEPPED, essential=PINNED),
    "step, fixed": line(**STEPPED, essential=FIXED),
    "step, free": line(**STEPPED, essential=FREE),
    "two jumps": line(sp.Piecewise((1, x < R(1, 3)), (R(1, 10), x < R(2, 3)), (3, True)), step(R(1, 4), 1, 5)),
    "an irrational place": line(step(IRRATIONAL, 1, R(1, 10)), step(IRRATIONAL, 1, 3)),
    "pi / 4": line(1 + 9 * sp.Heaviside(x - sp.pi / 4), essential=PINNED),
    "Heaviside times Heaviside": line(
        1, 1 + 3 * sp.Heaviside(x - R(1, 4)) * sp.Heaviside(R(3, 4) - x), 1, essential=PINNED
    ),
    "Min of three": line(sp.Min(1 + x, 2 - x, R(13, 10)), essential=PINNED),
    "Abs of a sine": line(1 + sp.Abs(sp.sin(7 * x))),
    "Abs of a square": line(1, 1 + sp.Abs(x**2 - R(1, 3)), 1, essential=PINNED),
    "floor": line(1 + sp.floor(5 * x)),
    "frac": line(1 + sp.frac(3 * x)),
    "power 1": line(1 + 4 * sp.SingularityFunction(x, R(2, 5), 1)),
    "power 3": line(1 + 4 * sp.SingularityFunction(x, R(2, 5), 3)),
    "a root that turns": line(1 + sp.Abs(x - R(1, 3)) ** R(1, 3), 1, 1, essential=PINNED),
    "two point masses": line(1, 1 + sp.DiracDelta(x - R(1, 3)) + 2 * sp.DiracDelta(x - R(2, 3))),
    "a point mass on a jump": line(1 + sp.Heaviside(x - HALF), 1 + sp.DiracDelta(x - HALF)),
    "a table": line(cra.stations(x, [(0.1, 1.0), (0.5, 2.0), (0.9, 1.5)])),
    "a table of steps": line(cra.stations(x, [(0, 1), (HALF, 2), (1, 3)], kind="step")),
    "a mass like 1 / sqrt(x)": line(1, 1 / sp.sqrt(x), 1, essential=PINNED),
    "a wedge on a hinge": line((1 - x) ** 3, 1 - x, essential=(ROOT,)),
    "a wedge with a support": line((1 - x) ** 3, 1 - x, essential=(*CLAMPED, v.subs(x, R(3, 5)))),
    "a cone on a spring": line((1 - x) ** 4, (1 - x) ** 2, essential=(ROOT,), left=-5 * v.diff(x) ** 2),
    "sharp at both ends": line((x * (1 - x)) ** 3, x * (1 - x), essential=FREE),
    "a rotating string on a hub": line(((R(11, 10)) ** 2 - (x + R(1, 10)) ** 2) / 2, 1, 1, essential=(ROOT,)),
    "a tension that all but vanishes": line(R(1, 1000) + 1 - x**2, 1, 1, essential=(ROOT,)),
}


@pytest.mark.sample(10, 1)
@pytest.mark.parametrize("name", ROUGH)
def test_what_is_rough_agrees_with_elements(name):
    """Nodes of the elements stand on every breakpoint; expected is what halving them still changes."""
    found = ROUGH[name].at({}).check(2)
    assert found.agree and abs(found.difference) < 1e-4


@pytest.mark.parametrize(
    ("model", "exact"),
    [
        (line(x**3, x, essential=(v.subs(x, 1), v.diff(x).subs(x, 1))), [5.31509942365365]),
        (line(x, 1, 1, essential=(v.subs(x, 1),)), jn_zeros(0, 3) / 2),
        (line((1 - x**2) / 2, 1, 1, essential=FREE, domain=(-1, 1)), [0.0, 1.0, np.sqrt(3.0)]),  # Legendre's
        (line((1 - x**2) / 2, 1, 1, essential=(ROOT,), more=v**2 / 4), np.sqrt([0.5, 5.5, 14.5])),
        (line(1, 1 + sp.DiracDelta(1 - 2 * x)), line(1, 1 + x * sp.DiracDelta(x - HALF)).at({}).natural_frequencies(3)),
        (line(more=-25 * sp.DiracDelta(x - R(2, 5)) * v**2), [4.585003194, 24.054863328, 62.155272372]),  # inside=
        (line(1 + sp.Piecewise((3, sp.Ne(x, HALF)), (100, True))), 2 * line().at({}).natural_frequencies(3)),
    ],
    ids=["wedge to the left", "chain upwards", "free", "in its plane", "Delta(1 - 2 x)", "spring", "one place"],
)
def test_what_has_a_closed_form(model, exact):
    assert_allclose(model.at({}).natural_frequencies(len(exact)), exact, rtol=2e-9, atol=CLOSE)


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda: line(1, 1 + sp.DiracDelta(x - HALF, 1)), r"DiracDelta\(x - 1/2, 1\) must be"),
        (lambda: line(1, 1 + sp.SingularityFunction(x, HALF, -2)), "acts at a point"),
        (lambda: line(1 + sp.SingularityFunction(x, HALF, HALF)), "exponent of .* must be a whole number"),
        (lambda: line(1, 1 + sp.DiracDelta(x - HALF) * sp.Heaviside(x - HALF)), "jumps right there"),
        (lambda: line(1 + sp.DiracDelta(x - HALF)), "may jump there"),
        (lambda: line(1, 1 + sp.DiracDelta(x - 1)), "use left or right"),
        (lambda: line(1 - x, 1, 1, essential=PINNED), "a force on the displacement there makes the strain infinite"),
        (
            lambda: line(1 - x, 1, 1, essential=(ROOT,), right=v.diff(t) ** 2 / 2),
            "right end .* leave out its spring, mass",
        ),
        (lambda: line((1 - x) ** 2, 1, right=v.diff(x, t) ** 2 / 2), "a force on the slope there makes the strain inf"),
        (lambda: line(sp.sqrt(1 - x), 1, 1, essential=(ROOT,), right=v.diff(t) ** 2 / 2), "to the power 0.5: a force"),
        (lambda: line((1 - x**2) / 2, 1, 1, essential=(ROOT,), more=v**2 / 2), "takes the whole stiffness of a motion"),
        (lambda: line(1, 1 / x, 1, essential=PINNED), "infinite at x"),
        (lambda: line(sp.Piecewise((1, x < R(1, 3)), (2, x > HALF))), "infinite at x = 0.333"),
        (lambda: line(sp.Abs(x - HALF), 1, 1, essential=PINNED), "zero or a coefficient infinite at x = 0.5"),
        (lambda: line(1, 2 + sp.log(x + R(1, 1000)), 1, essential=PINNED), "energy of the section at x = 0.00"),
    ],
)
def test_what_is_refused_says_why(made, words):
    with pytest.raises(ValueError, match=words):
        made().at({}).natural_frequencies(2)


# damped, pressed, flowed through ----------------------------------------------------------------------------------

PRESSED = P * v.diff(x) ** 2 / 2
FOLLOWS = (-P * v.diff(x), v, "right")
FLOW = U**2 * v.diff(x) ** 2 / 2 + sp.sqrt(R(1, 5)) * U * v.diff(t) * v.diff(x)
OUTLET = (-(U**2) * v.diff(x) - sp.sqrt(R(1, 5)) * U * v.diff(t), v, "right")
ALONG = (-c * v.diff(t), v, "domain")
END, MIDDLE = (-c * v.diff(t), v, "right"), (-c * v.diff(t), v, HALF)
SLACK = -9 * (1 - x) * v.diff(x) ** 2 / 2
RELATED = {
    "pressed, with a tip mass": ({"more": PRESSED, "right": m * v.diff(t) ** 2 / 2}, [FOLLOWS], {P: 18, m: 0.5}),
    "with rotary inertia": ({"more": PRESSED, "right": m * v.diff(x, t) ** 2 / 20}, [FOLLOWS], {P: 15, m: 1}),
    "half of it follows": ({"more": PRESSED}, [(-P * v.diff(x) / 2, v, "right")], {P: 30}),
    "a moment that follows": ({"more": PRESSED}, [(-P * v, v.diff(x), "right")], {P: 10}),
    "a stepped column": ({"stiffness": step(HALF, 2, 1), "more": PRESSED}, [FOLLOWS], {P: 25}),
    "pressed and damped": ({"more": PRESSED}, [FOLLOWS, ALONG], {P: 19, c: 0.1}),
    "pressed, of lossy material": (
        {"more": PRESSED}, [FOLLOWS, (-c * v.diff(x, 2, t), v.diff(x, 2), "domain")], {P: 12, c: 0.01}
    ),
    "pressed between supports": ({"more": PRESSED, "essential": (*CLAMPED, v.subs(x, HALF))}, [FOLLOWS], {P: 30}),
    "a pipe beyond flutter": ({"more": FLOW}, [OUTLET], {U: 9}),
    "a pipe on a foundation": ({"more": FLOW - 15 * v**2}, [OUTLET], {U: 6}),
    "a pipe with a nozzle": ({"more": FLOW, "right": m * v.diff(t) ** 2 / 2}, [OUTLET], {U: 5, m: 0.2}),
    "hanging from a hinge": ({"more": SLACK, "essential": (ROOT,)}, [END], {c: 0.3}),
    "damped halfway": ({"more": SLACK}, [MIDDLE], {c: 3}),
    "critical on a foundation": ({"more": -25 * v**2}, [ALONG], {c: 2 * np.sqrt(3.516015268500394**2 + 50) - 1e-3}),
    "pressed to the middle": (
        {"more": P * sp.Heaviside(HALF - x) * v.diff(x) ** 2 / 2}, [(-P * v.diff(x), v, HALF)], {P: 15}
    ),
    "a moment inside that follows": ({"essential": PINNED[:1], "left": -9 * v.diff(x) ** 2}, [
        (-P * v, v.diff(x), R(1, 4)), MIDDLE], {P: 8, c: 0.2}
    ),
    "damped over a half": ({}, [(-c * sp.Heaviside(x - HALF) * v.diff(t), v, "domain")], {c: 20}),
}  # fmt: skip


@pytest.mark.sample(7, 1)
@pytest.mark.parametrize("name", RELATED)
def test_what_is_damped_or_pressed_agrees_with_elements(name):
    """Eigenvalues, a response in time and one at a frequency, by 24 elements with a node halfway."""
    options, work, values = RELATED[name]
    model = line(**options, virtual_work=[*work, (F, v, "right")])
    ritz = model.ritz(12, nodes=[R(1, 4), HALF])
    ((_, stiffness, damping, mass),) = ritz._numbers(ritz._columns(values)[0])
    size = len(mass)
    whole = np.zeros((2 * size + 1, 2 * size + 1))
    whole[:size, size : 2 * size] = np.eye(size)
    whole[size : 2 * size, : 2 * size] = np.linalg.solve(mass, -np.hstack([stiffness, damping]))
    whole[size : 2 * size, -1] = np.linalg.solve(mass, np.eye(size)[-2])
    every = np.linalg.eigvals(whole)
    system = model.at(values)
    for one in cra.eigenvalues(system, 2):
        assert np.abs(every - one).min() < 2e-4 * abs(one)  # h^4 |s|^2 / 1440, more where two come close
    times = np.array([0.2, 0.5, 0.9])
    expected = [expm(whole * time)[size - 2, -1] for time in times]
    found = cra.tip_response(system, {F: cra.Force(1.0)}, times, modes=8)
    assert_allclose(found, expected, atol=5e-3 * np.abs(expected).max())  # the static share of the modes beyond
    moved = np.linalg.solve(stiffness + 7.3j * damping - 7.3**2 * mass, np.eye(size)[-2])[-2]
    assert_allclose(cra.frequency_response(system, 7.3, drive=F), moved, rtol=5e-4)


def test_what_follows_at_an_interior_place_has_no_natural_frequencies():
    model = line(virtual_work=[(-P * v.diff(x), v, HALF)])
    with pytest.raises(ValueError, match="forces that follow the motion; use eigenvalues"):
        model.at({P: 1.0}).natural_frequencies(1)


@pytest.mark.parametrize(
    ("model", "damper", "number"),
    [
        (line(1, 1, 1, essential=(ROOT,), virtual_work=[END]), 1.0, 0),
        (line(4, 1, 1, essential=(ROOT,), virtual_work=[END]), 2.0, 0),
        (line(1, 1, 1, essential=FREE, virtual_work=[END]), 1.0, 1),
        (line(1, 1, 1, essential=FREE, virtual_work=[END, (-c * v.diff(t), v, "left")]), 1.0, 1),
    ],
    ids=["fixed", "of impedance 2", "free", "at both ends"],
)
def test_matched_dampers_leave_a_rigid_motion_at_most(model, damper, number):
    with pytest.raises(ValueError, match=f"argument principle counts {number} eigenvalues"):
        model.at({c: damper}).model.eigenvalues({c: damper}, 2)


def test_a_step_before_a_matched_end_sends_waves_back():
    """The reflection at the step, 1/3, of a half length with the wave speed 1/2: tanh s = -1/2 of the left half."""
    model = line(1, step(HALF, 4, 1), 1, essential=(ROOT,), virtual_work=[END])
    found = model.eigenvalues({c: 1.0}, 3)
    assert_allclose(found, -np.arctanh(0.5) + 1j * np.pi * (np.arange(3) + 0.5), rtol=1e-10)
