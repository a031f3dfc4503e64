"""Modes with elastic-slip elements against SciPy's integrator with events, closed forms, and their energy balance."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from cra_sym.solvers.first_roots import first_roots
from cra_sym.solvers.motion import BaseMotion
from cra_sym.solvers.motion_terms import Harmonic, Piecewise
from cra_sym.solvers.slip_loads import Cause
from cra_sym.solvers.slip_records import Ledger, Peak, Sampler
from cra_sym.solvers.slip_statics import SlippingModes
from cra_sym.solvers.slipping import Start, follow

OMEGA = np.array([15.0, 96.0, 270.0, 520.0, 880.0])
ROWS = np.array([[0.3, -0.9, 1.5, -2.0, 2.4], [0.1, 0.4, -0.6, 1.1, 0.7]])
GAMMA = np.array([0.4, 0.2, -0.13, 0.1, 0.08])
TIP = np.array([[2.0, -2.0, 2.0, -2.0, 2.0]])


def modes(members=1, elements=1, zeta=0.005, stiffness=3e3, slip=0.6, give=0.0):
    omega = np.repeat(OMEGA[:, None], members, 1)
    size = (elements, members)
    return SlippingModes(
        omega,
        2 * zeta * omega,
        np.repeat(ROWS[:elements, :, None], members, 2),
        np.repeat(give * np.array([[1.0, 0.3], [0.3, 0.8]])[:elements, :elements, None], members, 2),
        np.arange(elements),
        np.broadcast_to(stiffness, size).astype(float),
        np.broadcast_to(slip, size).astype(float),
    )


def cause(motion, members=1):
    terms = [
        Harmonic(*(np.reshape(value, -1) for value in term))
        if isinstance(term, Harmonic)
        else Piecewise(np.zeros(1), term.knots, np.atleast_2d(term.acceleration), np.atleast_2d(term.jerk))
        for term in motion.terms
    ]
    return Cause(np.repeat(GAMMA[:, None], members, 1), terms)


def rest(members=1):
    return Start(np.zeros((5, members)), np.zeros((5, members)))


def followed(system, causes, times, derivative=0, start=None):
    members = system.omega.shape[1]
    sampler = Sampler(np.repeat(TIP[..., None], members, 2), times, derivative)
    events = follow(system, causes, start or rest(members), np.full(members, times[-1]), sampler)
    return sampler.values, events


def acceleration(motion, within):
    """The acceleration of the base as a function of time that is smooth where one of its pieces is in force."""
    (term,) = motion.terms
    if isinstance(term, Harmonic):
        size, varpi, phase = (float(value) for value in term)
        return lambda t: -size * varpi**2 * np.sin(varpi * t + phase)
    k = np.searchsorted(term.knots, within, side="right") - 1
    return lambda t: term.acceleration[k] + term.jerk[k] * (t - term.knots[k])


def integrated(system, motion, times):
    """Tip displacement by SciPy's integrator with events, element by element; and the events."""
    omega, damping, rows, stiffness, slip, give = (system[k][..., 0] for k in (0, 1, 2, 5, 6, 3))
    elements = len(rows)
    knots = [k for term in motion.terms if isinstance(term, Piecewise) for k in term.knots]
    ends = np.unique([k for k in [*knots, times[-1]] if 0 < k <= times[-1]])
    y, force, state = np.zeros(10), np.zeros(elements), np.zeros(elements, int)
    now, tip, seen = 0.0, np.zeros(times.size), []
    for end in ends:
        while now < end:
            stuck = state == 0
            tangent = np.zeros((elements, elements))
            if stuck.any():
                tangent[np.ix_(stuck, stuck)] = np.linalg.inv(
                    np.diag(1 / stiffness[stuck]) + give[np.ix_(stuck, stuck)]
                )
            pull = tangent @ rows
            begin = pull @ y[:5]
            stiff, still = np.diag(omega**2) + rows.T @ pull, rows.T @ (force - begin)
            along = acceleration(motion, (now + end) / 2)

            def rate(t, y, stiff=stiff, still=still, along=along):
                return np.concatenate([y[5:], -damping * y[5:] - stiff @ y[:5] - still - GAMMA * along(t)])

            happens = []
            for e in range(elements):
                if state[e] == 0:
                    for side in (1, -1):
                        row = np.concatenate([-side * pull[e], np.zeros(5)])
                        happens.append((e, side, row, slip[e] - side * (force[e] - begin[e])))
                else:
                    row = state[e] * (rows[e] - give[e] @ pull)
                    happens.append((e, 0, np.concatenate([np.zeros(5), row]), 0.0))
            watched = [lambda t, y, row=row, level=level: level + row @ y for *_, row, level in happens]
            for event in watched:
                event.terminal, event.direction = True, -1
            run = solve_ivp(
                rate, (now, end), y, "DOP853", events=watched, rtol=1e-10, atol=1e-14, max_step=2e-3, dense_output=True
            )
            within = (times >= now) & (times <= run.t[-1])
            if within.any():
                tip[within] = TIP[0] @ run.sol(times[within])[:5]
            y, now = run.y[:, -1], run.t[-1]
            force = force + pull @ y[:5] - begin
            if run.status == 1:
                e, new, *_ = happens[next(k for k, t in enumerate(run.t_events) if t.size)]
                force[e] = np.sign(force[e]) * slip[e]
                state[e] = new
                seen.append((now, e, new))
    return tip, seen


CASES = {
    "a move": ({}, BaseMotion.trapezoid(0.3, 0.5, 2.0)),
    "a jerk-limited move, undamped": ({"zeta": 0.0, "slip": 0.3}, BaseMotion.s_curve(0.3, 0.5, 2.0, 40.0)),
    "a harmonic": ({"slip": 0.2}, BaseMotion(amplitude=4e-3, angular_frequency=21.0, phase=0.4)),
    "two elements": ({"elements": 2, "slip": [[0.4], [0.2]]}, BaseMotion.trapezoid(0.3, 0.5, 2.0)),
    "two elements that give": (
        {"elements": 2, "slip": [[0.4], [0.2]], "give": 4e-4},
        BaseMotion.trapezoid(0.3, 0.5, 2.0),
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_agrees_with_integration(case):
    options, motion = CASES[case]
    times = np.linspace(0.0, 0.6, 31)
    system = modes(**options)
    values, events = followed(system, [cause(motion)], times)
    tip, seen = integrated(system, motion, times)
    assert [(e, s) for _, e, s in seen] == list(zip(events.element, events.state, strict=True))
    assert len(seen) >= 5
    # the integrator's local error of 1e-10, some thousand steps, and what an event's own error adds
    np.testing.assert_allclose(events.time, [t for t, *_ in seen], rtol=0, atol=1e-8)
    np.testing.assert_allclose(values[0, 0], tip, rtol=0, atol=1e-8 * np.abs(tip).max())


MOTION = BaseMotion.trapezoid(0.3, 0.5, 2.0)
TIMES = np.linspace(0.0, 1.0, 51)


def linear(stiffness):
    """Tip displacement of the move with a spring in place of the element, by matrix exponentials."""
    friction, matrix = np.diag(0.01 * OMEGA), np.diag(OMEGA**2) + stiffness * np.outer(ROWS[0], ROWS[0])
    system = np.zeros((12, 12))  # q, q', the acceleration and its rate
    system[:5, 5:10] = np.eye(5)
    system[5:10, :10] = -np.hstack([matrix, friction])
    system[5:10, 10] = -GAMMA
    (term,) = MOTION.terms
    state, tip = np.zeros(12), np.zeros(TIMES.size)
    for k, knot in enumerate(term.knots):
        end = term.knots[k + 1] if k + 1 < len(term.knots) else np.inf
        state[10:] = term.acceleration[k], 0.0
        for at in np.flatnonzero((knot <= TIMES) & (end > TIMES)):
            tip[at] = TIP[0] @ (expm((TIMES[at] - knot) * system) @ state)[:5]
        if np.isfinite(end):
            state = expm((end - knot) * system) @ state
    return tip


@pytest.mark.parametrize(("slip", "stiffness"), [(1e6, 3e3), (1e-13, 0.0)])
def test_limits_are_linear(slip, stiffness):
    values, events = followed(modes(slip=slip), [cause(MOTION)], TIMES)
    tip = linear(stiffness)
    assert (events.time.size == 0) == (slip > 1)
    # rounding of 300 steps; a slip force of 1e-13 moves the tip by 1e-13 of a unit force's effect
    np.testing.assert_allclose(values[0, 0], tip, rtol=0, atol=1e-11 * np.abs(tip).max())


@pytest.mark.parametrize("case", CASES)
def test_energy_balances(case):
    options, motion = CASES[case]
    system, times = modes(**options), np.linspace(0.0, 2.0, 21)
    ledger = Ledger(system, times, (np.zeros((5, 1)), np.zeros((5, 1)), np.zeros(system.slip.shape)))
    follow(system, [cause(motion)], rest(), np.array([2.0]), ledger, times)
    kept = ledger.energies
    stored = kept.kinetic + kept.potential + kept.elements
    taken = kept.dampers + kept.sliders.sum(axis=0)
    assert (np.diff(kept.sliders) >= 0).all() and kept.sliders[..., -1].min() > 0.01 * kept.input.max()
    assert (kept.dampers[..., -1] > 0).all() == (options.get("zeta") != 0.0)
    # rounding of some hundred steps of 29 terms
    np.testing.assert_allclose(kept.input, stored + taken, rtol=0, atol=1e-12 * np.abs(kept.input).max())
    assert (np.abs(kept.force) <= system.slip[..., None]).all()


def test_one_mass_dissipates_as_the_closed_form_says():
    """Driven slowly, the loss of a cycle is 4 f (a - f/k), a the amplitude of the element."""
    one = np.ones((1, 1))
    slow = 0.02
    system = SlippingModes(one, 2 * one, one[None], 0 * one[None], np.zeros(1, int), 5 * one, 0.7 * one)
    load = Cause(-one, [Harmonic(np.array([-3.0 / slow**2]), np.array([slow]), np.zeros(1))])
    times = 2 * np.pi / slow * np.linspace(0.0, 2.25, 226)
    ledger = Ledger(system, times, (0 * one, 0 * one, 0 * one))
    follow(system, [load], Start(0 * one, 0 * one), times[-1:], ledger, times)
    kept = ledger.energies
    amplitude = np.abs(kept.displacement[0, 0, 126:]).max()
    loss = kept.sliders[0, 0, -1] - kept.sliders[0, 0, -101]
    assert amplitude == pytest.approx(3.0 - 0.7, rel=1e-2)  # statics, but for what inertia and the damper do
    # the amplitude is the largest of 100 in a cycle: off by (pi/100)^2/2
    assert loss == pytest.approx(4 * 0.7 * (amplitude - 0.7 / 5), rel=1e-3)


def test_no_slip_is_too_short():
    """A slip force a hair below the largest force is met once, and its slip ends at once."""
    system = modes(slip=1e6)
    ledger = Ledger(system, TIMES, (np.zeros((5, 1)), np.zeros((5, 1)), np.zeros((1, 1))))
    peak = Peak(ROWS[0][:, None], np.zeros(1), 1)

    def both(step):
        ledger(step)
        peak(step)

    start = Start(1e-3 * np.ones((5, 1)), np.zeros((5, 1)))  # strikes the highest modes
    follow(system, [], start, np.array([1.0]), both, TIMES)
    # u, whose largest magnitude is found by Newton's method, is the force over the stiffness, but for its start
    first = ROWS[0].sum() * 1e-3
    assert abs(first) < float(peak._stuck[0])
    largest = 3e3 * float(peak._stuck[0])
    for share in (1e-4, 1e-8, 1e-12):
        _, events = followed(modes(slip=largest * (1 - share)), [], TIMES, start=start)
        assert events.state.tolist() == [events.state[0], 0]
        assert 0 < np.diff(events.time)[0] < 0.03 * np.sqrt(share)
    _, events = followed(modes(slip=largest * (1 + 1e-12)), [], TIMES, start=start)
    assert events.time.size == 0


def test_a_batch_is_its_members():
    slips = np.array([0.2, 0.5, 1.0, 1e3])
    values, events = followed(modes(4, slip=slips), [cause(MOTION, 4)], TIMES, derivative=1)
    for k, slip in enumerate(slips):
        one, alone = followed(modes(slip=slip), [cause(MOTION)], TIMES, derivative=1)
        np.testing.assert_allclose(values[0, k], one[0, 0], rtol=0, atol=1e-12 * np.abs(one).max())
        here = events.member == k
        np.testing.assert_allclose(events.time[here], alone.time, rtol=0, atol=1e-12)
        assert (events.state[here] == alone.state).all()


def test_acceleration_is_that_to_the_right_of_a_jump():
    (term,) = MOTION.terms
    knot = float(term.knots[np.flatnonzero(np.diff(term.acceleration))[0] + 1])
    (values, _), (velocity, _) = (
        followed(modes(), [cause(MOTION)], np.array([0.0, knot, knot + 1e-7, 1.0]), order) for order in (2, 1)
    )
    slope = np.diff(velocity[0, 0, 1:3])[0] / 1e-7
    assert values[0, 0, 1] == pytest.approx(slope, rel=1e-3)  # to first order in the 1e-7 s


def test_roots_of_polynomials():
    """Products of known factors: the first root in (0, 1) is found, unless a second one hides it."""
    rng = np.random.default_rng(4)
    for _ in range(300):
        roots = rng.uniform(-2, 2, 5)
        pairs = rng.uniform(-1, 1, 3) + 1j * rng.uniform(0.1, 1, 3)
        polynomial = np.polynomial.polynomial.polyfromroots([*roots, *pairs, *pairs.conj()]).real
        if abs(polynomial[0]) < 1e-3:
            continue
        polynomial *= np.sign(polynomial[0])
        inside = np.sort(roots[(roots > 0) & (roots < 1)])
        (place,), (falls,) = first_roots(polynomial[:, None])
        if not inside.size:
            assert (place, falls) == (1.0, False) or (place < 1 and not falls)
        elif falls:
            assert place == pytest.approx(inside[0], rel=0, abs=1e-10)
        else:
            assert place < inside[0] + 1e-12


def test_a_root_at_the_start_is_not_taken_for_a_crossing():
    rising, falling = np.array([0.0, 0.0, 1.0, -2.0]), np.array([0.0, -1.0, 2.0, 0.0])
    place, falls = first_roots(np.stack([rising, falling], 1))
    assert falls.all()
    np.testing.assert_allclose(place, [0.5, 0.0], rtol=1e-15, atol=0)


def test_too_many_steps_are_refused():
    with pytest.raises(ValueError, match="must be at most 1000000"):
        follow(modes(stiffness=1e20), [cause(MOTION)], rest(), np.array([1.0]), lambda step: None)


def test_many_elements_on_one_displacement_stop_and_slip_together():
    """None slides against its force where all stop at once, or where the loop of many closes."""
    slips = np.linspace(0.01, 0.3, 40)[:, None]
    system = modes()._replace(where=np.zeros(40, int), stiffness=np.full((40, 1), 300.0), slip=slips)
    wrong, most = [], []

    def seen(step):
        way = (step.moved[1:] * step.share ** np.arange(1, len(step.moved))[:, None, None]).sum(axis=0)[system.where]
        wrong.append(np.where(step.state != 0, -step.state * way, 0.0).max())
        most.append(np.where(step.state == 0, np.abs(step.force + 300.0 * way) - slips, 0.0).max())

    follow(system, [cause(BaseMotion(amplitude=0.05, angular_frequency=23.0))], rest(), np.array([1.0]), seen)
    assert max(wrong) < 1e-15 and max(most) < 1e-12 and len(wrong) > 200
