"""How the work of a batch is shared out, and which path it takes."""

import os
import threading
from collections import Counter

import numpy as np
import pytest

from cra_sym.kernels import parts as sharing
from cra_sym.model.one_wave_family import family


def shared_out(lanes, modes, **how):
    parts, threads = [], set()

    def fill(part):
        parts.append((part.start, part.stop))
        threads.add(threading.get_ident())

    sharing.in_parts(fill, lanes, modes, **how)
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
    assert sharing.processors() == 3
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert sharing.processors() == 1, "where nobody knows"


def test_the_path_is_chosen_by_what_it_costs(monkeypatch):
    """Machine code is loaded for a large call, and made when this process has done enough without it."""
    calls, made, beams = [], [], family((("k", ""), ("", "")))
    monkeypatch.setattr(beams, "fill_compiled", lambda result, *groups: calls.append("compiled"))
    monkeypatch.setattr(beams, "_fill", lambda result, *groups: calls.append("numpy"))
    monkeypatch.setattr(sharing, "has_compiler", lambda: True)
    monkeypatch.setattr(sharing, "is_compiled", lambda *given: bool(made))
    monkeypatch.setattr(sharing, "_done", Counter())
    monkeypatch.setattr(sharing, "COMPILE_FROM", 2.5 * sharing.LOAD_FROM)

    def path(size):
        calls.clear()
        beams.frequency_parameters(np.ones(size), modes=1)
        (taken,) = set(calls)
        return taken

    large = sharing.LOAD_FROM
    assert path(10) == "numpy"
    assert [path(large) for _ in range(3)] == ["numpy", "numpy", "compiled"]
    monkeypatch.setattr(sharing, "_done", Counter())
    assert path(3 * large) == "compiled"  # at once, if one call is worth it
    monkeypatch.setattr(sharing, "_done", Counter())
    assert {path(large // 2) for _ in range(9)} == {"numpy"}
    made.append(True)
    assert path(large) == "compiled" and path(10) == "numpy"
    monkeypatch.setattr(sharing, "has_compiler", lambda: False)
    assert path(large) == "numpy"
