"""Pairs of numbers for stiffnesses, and how the work of a batch is shared out."""

import os
import threading

import numpy as np
import pytest

from cra_sym.model import spectrum


def test_a_stiffness_and_its_complement():
    np.testing.assert_array_equal(
        spectrum.pair(np.array([0.0, 1.0, 3.0, np.inf])), [[0, 0.5, 0.75, 1], [1, 0.5, 0.25, 0]]
    )


def test_each_absent_spring_leaves_a_rigid_body_mode():
    joints = np.array([[0.0, 0.0], [0.0, 2.0], [1.0, 0.0], [np.inf, 0.0], [np.inf, np.inf], [3.0, 1.0]]).T
    arms = spectrum.ArmCharacteristic(*joints, np.full(6, 0.1), np.zeros(6))
    np.testing.assert_array_equal(arms.zeros, [2, 1, 1, 1, 0, 0])


def shared_out(lanes, modes, **how):
    parts, threads = [], set()

    def fill(part):
        parts.append((part.start, part.stop))
        threads.add(threading.get_ident())

    spectrum.in_parts(fill, lanes, modes, **how)
    starts, stops = zip(*sorted(parts), strict=True)
    assert (0, *stops) == (*starts, lanes), "each lane once"
    return len(parts), threads == {threading.get_ident()}


@pytest.mark.parametrize(
    ("lanes", "threads", "compiled", "parts", "here"),
    [
        (1_000_000, 1, True, 1, True),
        (1_000_000, 2, True, 16, False),
        (100, 2, True, 1, True),
        (1_000_000, 2, False, 214, True),
    ],
)
def test_work_is_shared_out(lanes, threads, compiled, parts, here):
    """Machine code takes all that one thread gets at once, or eight parts for each of several; NumPy takes blocks."""
    assert shared_out(lanes, 3, threads=threads, compiled=compiled) == (parts, here)


def test_there_are_as_many_threads_as_processors_for_this_process(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {0: {3, 5, 7}}[process], raising=False)
    assert spectrum._processors() == 3
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert spectrum._processors() == 1, "where nobody knows"
