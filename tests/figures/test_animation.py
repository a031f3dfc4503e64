"""The moving arm: small, with words, and every frame what the response says."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest

import cra_sym as cra
from cra_sym.figures import ANIMATIONS, animate, animation

ARM = cra.Arm.nominal()


def points(path):
    """Return the points of a relative polyline."""
    start, steps = re.fullmatch(r"M(\S+ \S+)l(.*)", path.get("d")).groups()
    both = np.array([float(n) for n in f"{start} {steps}".split()]).reshape(-1, 2)
    return np.cumsum(both, axis=0)


def films(text):
    return [e for e in ElementTree.fromstring(text).iter() if e.get("class") == "film"]


@pytest.mark.parametrize("name", ANIMATIONS)
def test_it_is_small_and_has_words(name):
    text = animate(name)
    root = ElementTree.fromstring(text)
    assert len(text) < 100_000 and "<script" not in text
    assert "http" not in text.replace("http://www.w3.org/2000/svg", "")
    title, description = root[0].text, root[1].text
    assert len(title) > 20 and len(description) > 20 and root.get("role") == "img"
    assert "prefers-reduced-motion" in text and "hover" in text and "print" in text
    for film in films(text):
        travel = float(re.search(r"--travel:(-?\d+)px", film.get("style"))[1])
        steps = int(re.search(r"steps\((\d+)\)", film.get("style"))[1])
        assert len(film) in {1, steps} and travel % len(film) == 0


def test_the_frames_are_the_response():
    """The tip's circle stands where the base and the tip's elastic displacement take it."""
    arm = ARM.replace(zeta=0.01)
    rigid, elastic, _ = films(animation.moving_arm())
    motion, t = cra.BaseMotion.s_curve(**animation._MOVE), np.arange(96) * 2.4 / 96
    for film, joined in ((rigid, arm), (elastic, arm.replace(k_t=200.0, k_r=20.0))):
        up = motion.displacement(t) + cra.tip_response(joined, motion, t)
        drawn = [float(frame[2].get("y")) for frame in film]
        np.testing.assert_allclose(drawn, 175 - 240 * up, atol=0.06)
        ends = [points(frame[0])[-1, 1] for frame in film]
        np.testing.assert_allclose(ends, drawn, atol=0.06)


def test_a_joint_that_does_not_give_moves_like_the_rigid_one():
    rigid, stiff, _ = films(animation.moving_arm(k_t=1e9, k_r=1e9))
    for one, other in zip(rigid, stiff, strict=True):
        np.testing.assert_allclose(points(one[0]), points(other[0]), atol=0.11)


def test_modes_swing_through_their_shapes():
    drawn = films(animation.moving_modes(k_t=1e3, k_r=1e2))
    x = np.linspace(0.0, 1.0, 21)
    shapes = [cra.mode_shapes(arm, x) for arm in (ARM, ARM.replace(k_t=1e3, k_r=1e2))]
    scale = 75 / np.abs(shapes).max()
    for mode in range(3):
        for joint in range(2):
            film = drawn[2 * mode + joint]
            first, half = (85 - points(film[k][0])[:, 1] for k in (0, 16))
            np.testing.assert_allclose(first, scale * shapes[joint][mode], atol=0.06)
            np.testing.assert_allclose(half, -first, atol=0.11)
    seconds = [float(re.search(r"duration:([\d.]+)s", film.get("style"))[1]) for film in drawn]
    hertz = [cra.natural_frequencies(arm) for arm in (ARM, ARM.replace(k_t=1e3, k_r=1e2))]
    np.testing.assert_allclose(np.divide(seconds[::2], seconds[1::2]), hertz[1] / hertz[0], rtol=1e-2)


def test_a_wrong_name_is_refused():
    with pytest.raises(ValueError, match="must be one of moving_arm, moving_modes, jumping_arm"):
        animate("dance")
