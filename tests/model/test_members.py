"""Structures of several members against finite-element frames of their own."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

import cra_sym as cra
from tests.model.frame_elements import Frame

x, t = sp.symbols("x t")
H, B, EI, EA, mu, m, k, a = sp.symbols("H B EI EA mu m k a", positive=True)
ELEMENTS = 24  # of a member: the error of bending is the fourth power of a wave number times their length, over 720
CLOSE = 1e-5


def fields(number):
    return tuple(sp.Function(f"{name}_{number}")(x, t) for name in "uv")


def beam(number, length, angle=0, EI=EI, EA=EA, mu=mu, **options):
    u, v = fields(number)
    kinetic = mu * (u.diff(t) ** 2 + v.diff(t) ** 2) / 2
    return cra.Member(
        kinetic - EI * v.diff(x, 2) ** 2 / 2 - EA * u.diff(x) ** 2 / 2, (u, v), x, length, angle, **options
    )


VALUES = {H: 0.8, B: 1.3, EI: 2.0, EA: 3e3, mu: 0.7}


def test_an_l_shaped_arm_with_a_tip_mass():
    column, arm = beam(1, H, sp.pi / 2), beam(2, B, EI=EI / 3)
    tip = sum(d.diff(t) ** 2 for d in arm.end[:2]) * m / 2
    model = cra.joined([column, arm], t=t, joints=[(column.end, arm.start)], essential=column.start, terms=tip)
    found = model.at({**VALUES, m: 0.4}).natural_frequencies(4)
    frame = Frame()
    foot, corner, end = frame.node(), frame.node(), frame.node()
    frame.member(foot, corner, 0.8, np.pi / 2, 2.0, 3e3, 0.7, ELEMENTS)
    frame.member(corner, end, 1.3, 0.0, 2.0 / 3, 3e3, 0.7, ELEMENTS)
    frame.add(end[:2], mass=[0.4, 0.4])
    np.testing.assert_allclose(found, frame.frequencies(foot, 4), rtol=CLOSE)


@pytest.mark.parametrize(("place", "spring"), [(0.25, 3.0), (0.75, 1e6)])
def test_an_l_shaped_frame_with_an_elastic_support_on_its_beam(place, spring):
    """A spring, soft or next to rigid, that holds a place of the beam across; stepped bending stiffness."""
    column, arm = beam(1, H, sp.pi / 2), beam(2, B, EI=EI / 3)
    across = arm.fields[1]
    arm = beam(2, B, EI=EI / 3, inside=((place * B, -k * across**2 / 2),))
    model = cra.joined([column, arm], t=t, joints=[(column.end, arm.start)], essential=column.start)
    system = model.at({**VALUES, k: spring})
    found = system.natural_frequencies(4)
    assert system.accuracy < 1e-10
    frame = Frame()
    foot, corner, end = frame.node(), frame.node(), frame.node()
    frame.member(foot, corner, 0.8, np.pi / 2, 2.0, 3e3, 0.7, ELEMENTS)
    there = frame.member(corner, end, 1.3, 0.0, 2.0 / 3, 3e3, 0.7, ELEMENTS, place)
    frame.add(there[1:2], stiffness=[spring])
    np.testing.assert_allclose(found, frame.frequencies(foot, 4), rtol=CLOSE)


@pytest.mark.parametrize("angle", [90, 75])
def test_a_portal(angle):
    """Two legs, upright or inclined, and a beam; clamped feet."""
    lean = sp.pi * angle / 180
    one, top, two = beam(1, H, lean), beam(2, B, EI=2 * EI), beam(3, H, -lean)
    joints = [(one.end, top.start), (top.end, two.start)]
    model = cra.joined([one, top, two], t=t, joints=joints, essential=[*one.start, *two.end])
    found = model.at(VALUES).natural_frequencies(4)
    frame, slope = Frame(), np.deg2rad(angle)
    nodes = [frame.node() for _ in range(4)]
    frame.member(nodes[0], nodes[1], 0.8, slope, 2.0, 3e3, 0.7, ELEMENTS)
    frame.member(nodes[1], nodes[2], 1.3, 0.0, 4.0, 3e3, 0.7, ELEMENTS)
    frame.member(nodes[2], nodes[3], 0.8, -slope, 2.0, 3e3, 0.7, ELEMENTS)
    np.testing.assert_allclose(found, frame.frequencies([*nodes[0], *nodes[3]], 4), rtol=CLOSE)


@pytest.mark.parametrize("share", [0.25, 0.5])
def test_a_gantry_with_a_carriage(share):
    """Legs on elastic feet; the carriage stands somewhere on the cross beam."""
    u, v = fields(2)
    one, two = beam(1, H, sp.pi / 2), beam(3, H, -sp.pi / 2)
    cross = beam(2, B, inside=[(a, m * (u.diff(t) ** 2 + v.diff(t) ** 2) / 2)])
    feet = -k * (one.start[0] ** 2 + two.end[0] ** 2) / 2
    held = [*one.start[1:], *two.end[1:]]
    joints = [(one.end, cross.start), (cross.end, two.start)]
    model = cra.joined([one, cross, two], t=t, joints=joints, essential=held, terms=feet)
    found = model.at({**VALUES, m: 2.0, k: 30.0, a: 1.3 * share}).natural_frequencies(3)
    frame = Frame()
    nodes = [frame.node() for _ in range(4)]
    frame.member(nodes[0], nodes[1], 0.8, np.pi / 2, 2.0, 3e3, 0.7, ELEMENTS)
    place = frame.member(nodes[1], nodes[2], 1.3, 0.0, 2.0, 3e3, 0.7, ELEMENTS, place=share)
    frame.member(nodes[2], nodes[3], 0.8, -np.pi / 2, 2.0, 3e3, 0.7, ELEMENTS)
    frame.add(place[:2], mass=[2.0, 2.0])
    for foot in (nodes[0], nodes[3]):
        frame.add(foot[:1], stiffness=[30.0])
    held_there = [*nodes[0][1:], *nodes[3][1:]]
    np.testing.assert_allclose(found, frame.frequencies(held_there, 3), rtol=CLOSE)


def test_spans_over_supports_are_a_beam_with_interior_supports():
    """Three spans, each with its own field and stiffness, against one field with two supports and jumps."""
    lengths, stiffness = (0.7, 1.0, 0.5), (1.0, 3.0, 0.4)
    spans = []
    for number, (length, bending) in enumerate(zip(lengths, stiffness, strict=True)):
        v = sp.Function(f"v_{number}")(x, t)
        density = v.diff(t) ** 2 / 2 - bending * v.diff(x, 2) ** 2 / 2
        spans.append(cra.Member(density, (v,), x, sp.Float(length)))
    joints = [(spans[0].end, spans[1].start), (spans[1].end, spans[2].start)]
    essential = [span.start[0] for span in spans] + [spans[2].end[0]]
    found = cra.joined(spans, t=t, joints=joints, essential=essential).at({}).natural_frequencies(4)
    v = sp.Function("v")(x, t)
    bending = sp.Piecewise((1.0, x < 0.7), (3.0, x < 1.7), (0.4, True))
    one = cra.Model(
        v.diff(t) ** 2 / 2 - bending * v.diff(x, 2) ** 2 / 2,
        fields=[v],
        x=x,
        domain=(0, 2.2),
        t=t,
        essential=[v.subs(x, place) for place in (0, 0.7, 1.7, 2.2)],
    )
    np.testing.assert_allclose(found, one.at({}).natural_frequencies(4), rtol=1e-9)


def test_members_that_do_not_fit_are_refused():
    one = beam(1, H)
    with pytest.raises(ValueError, match="fields of its own"):
        cra.joined([one, one], t=t)
    with pytest.raises(TypeError, match=r"members\[1\]"):
        cra.joined([one, "beam"], t=t)
    with pytest.raises(ValueError, match="must hold fields at places"):
        cra.joined([one], t=t, essential=[fields(1)[0]])
