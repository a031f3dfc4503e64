"""Sweeps against loops, in memory, lazily and through a store that is stopped in the middle."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import time
from types import SimpleNamespace

import numpy as np
import pytest

import cra_sym as cra
from cra_sym.files import OutputError
from cra_sym.studies import store as store_module
from cra_sym.studies.study import make_study

xarray = pytest.importorskip("xarray", reason="the extra 'scale' brings xarray")

K_T, M_E = np.array([1e2, 1e4, np.inf]), np.array([0.0, 0.001, 0.005, 0.02])


def tip_stiffness(arm, *, scale=1.0):
    """A user's own quantity, with an axis of its own."""
    value = scale * 3 * np.asarray(arm.EI) / np.asarray(arm.L) ** 3 + 0 * np.asarray(arm.m_e)
    return np.stack([value, 2 * value], axis=-1)


def test_a_sweep_is_a_labelled_loop():
    study = cra.sweep(cra.Arm.nominal(), k_t=K_T, m_e=M_E, k_r=1e3, modes=2)
    assert study.natural_frequencies.dims == ("k_t", "m_e", "mode")
    assert study.attrs["arm_k_r"] == 1e3
    for k_t in K_T:
        for m_e in M_E:
            one = cra.natural_frequencies(cra.Arm.nominal().replace(k_t=k_t, m_e=m_e, k_r=1e3), modes=2)
            np.testing.assert_allclose(study.natural_frequencies.sel(k_t=k_t, m_e=m_e), one, rtol=1e-15)
    assert study.k_t.attrs["units"] == "N/m" and study.mode.values.tolist() == [1, 2]


def test_no_axis_is_one_point():
    study = cra.sweep(cra.Arm.nominal(), modes=4)
    assert study.natural_frequencies.dims == ("mode",) and study.sizes["mode"] == 4


def test_a_lazy_sweep_computes_the_same():
    import dask

    eager = cra.sweep(cra.Arm.nominal(), k_t=K_T, m_e=M_E)
    lazy = cra.sweep(cra.Arm.nominal(), k_t=K_T, m_e=M_E, chunks=2)
    assert lazy.natural_frequencies.chunks == ((2, 1), (2, 2), (3,))
    with dask.config.set(scheduler="synchronous"):
        xarray.testing.assert_allclose(lazy.compute(), eager, rtol=1e-14)


def test_own_quantities():
    study = cra.sweep(cra.Arm.nominal(), tip_stiffness, L=[0.5, 1.0], scale=2.0)
    assert study.tip_stiffness.dims == ("L", "component_0")
    assert study.tip_stiffness.attrs["long_name"] == "A user's own quantity, with an axis of its own."
    np.testing.assert_allclose(study.tip_stiffness[0], 8 * study.tip_stiffness[1])


def test_a_stored_sweep_goes_on_where_it_was_stopped(tmp_path, monkeypatch):
    place = tmp_path / "a study.zarr"
    written, write = [], store_module._write

    def stopping(study, path, region):
        if len(written) == 3:
            raise KeyboardInterrupt
        write(study, path, region)
        written.append(region)

    monkeypatch.setattr(store_module, "_write", stopping)
    with pytest.raises(KeyboardInterrupt):
        cra.sweep(cra.Arm.nominal(), k_t=K_T, m_e=M_E, chunks=1, store=place)
    rest = []
    monkeypatch.setattr(store_module, "_write", lambda *job: (rest.append(job[2]), write(*job)))
    study = cra.sweep(cra.Arm.nominal(), k_t=K_T, m_e=M_E, chunks=1, store=place)
    assert len(written) == 3 and len(rest) == K_T.size * M_E.size - 3
    assert not {str(region) for region in written} & {str(region) for region in rest}
    eager = cra.sweep(cra.Arm.nominal(), k_t=K_T, m_e=M_E)
    np.testing.assert_allclose(study.natural_frequencies, eager.natural_frequencies, rtol=1e-14)
    rest.clear()
    cra.sweep(cra.Arm.nominal(), k_t=K_T, m_e=M_E, store=place)
    assert rest == []


COUNTED = """
import os, pathlib, time
import numpy as np

def counted(arm):
    "Notes every region it is asked for, as soon as it is asked."
    with pathlib.Path(os.environ["COUNTED"]).open("a") as notes:
        notes.write(f"{np.ravel(arm.k_t)[0]} {np.ravel(arm.m_e)[0]}\\n")
    time.sleep(0.01)
    return np.asarray(arm.k_t) + np.asarray(arm.m_e)
"""


def test_a_killed_sweep_loses_nothing_and_computes_nothing_twice(tmp_path, monkeypatch):
    """Killed outright, it has lost the region in hand and no other."""
    place, notes = tmp_path / "study.zarr", tmp_path / "notes"
    (tmp_path / "counting.py").write_text(COUNTED)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("COUNTED", str(notes))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), *sys.path]))
    k_t, m_e = np.geomspace(1e2, 1e6, 10), np.linspace(0.0, 0.05, 10)
    text = f"""
import numpy as np, cra_sym as cra
from counting import counted
axes = {{"k_t": np.geomspace(1e2, 1e6, 10), "m_e": np.linspace(0.0, 0.05, 10)}}
cra.sweep(cra.Arm.nominal(), counted, **axes, chunks=1, store={str(place)!r})
"""
    process = subprocess.Popen([sys.executable, "-c", text], stderr=subprocess.PIPE)
    while not notes.exists() or len(notes.read_text().splitlines()) < 20:
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.005)
    process.kill()
    process.wait()
    process.stderr.close()
    from counting import counted

    asked = notes.read_text().splitlines()
    assert 20 <= len(asked) < 100
    notes.unlink()
    study = cra.sweep(cra.Arm.nominal(), counted, k_t=k_t, m_e=m_e, chunks=1, store=place)
    (corner, *again), first = (
        notes.read_text().splitlines(),
        asked[1:],
    )  # each call asks for one corner to learn the axes
    assert corner == asked[0] and len(set(again)) == len(again)
    assert set(first) | set(again) == {f"{a} {b}" for a in k_t for b in m_e}
    assert set(first) & set(again) <= {first[-1]}
    np.testing.assert_array_equal(study.counted, k_t[:, None] + m_e)


def test_a_terminal_sees_how_far_a_sweep_is(tmp_path, monkeypatch, capsys):
    def shown(terminal):
        monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal, raising=False)
        cra.sweep(cra.Arm.nominal(), tip_stiffness, k_t=K_T, m_e=M_E, chunks=2, store=tmp_path / f"{terminal}.zarr")
        return capsys.readouterr().err

    assert shown(False) == ""
    assert "tip_stiffness" in (bar := shown(True)) and "4/4" in bar


def test_a_store_of_another_sweep_is_not_touched(tmp_path):
    place = tmp_path / "study.zarr"
    cra.sweep(cra.Arm.nominal(), k_t=K_T, store=place)
    before = sorted(str(p) for p in place.rglob("*"))
    with pytest.raises(ValueError, match="holds something else"):
        cra.sweep(cra.Arm.nominal(), k_t=K_T * 2, store=place)
    (tmp_path / "letters").mkdir()
    (tmp_path / "letters" / "one.txt").write_text("keep me")
    with pytest.raises(ValueError, match="holds something else"):
        cra.sweep(cra.Arm.nominal(), k_t=K_T, store=tmp_path / "letters")
    assert sorted(str(p) for p in place.rglob("*")) == before
    assert (tmp_path / "letters" / "one.txt").read_text() == "keep me"


def test_a_full_disk_stops_a_sweep_that_goes_on_later(tmp_path):
    """A limit on the size of files stands for the disk: what is in the store is whole, and the rest follows."""
    resource = pytest.importorskip("resource", reason="the size of files is limited the Unix way")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)

    def numbers(arm, *, small):
        return np.random.default_rng(1).random((*arm.shape, 8 if small else 2000))

    study = {"k_t": K_T, "chunks": 1, "store": tmp_path / "a study"}
    try:
        for size, small in ((300, True), (4000, False)):  # too small for the labels, then for a region
            resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
            with pytest.raises(
                OutputError, match=rf"output = '{tmp_path}/a study.*: cannot be written \(File too large"
            ):
                cra.sweep(cra.Arm.nominal(), numbers, small=small, **study)
            assert size > 300 or not list(tmp_path.iterdir())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert [path.name for path in tmp_path.iterdir()] == ["a study"]
    found = cra.sweep(cra.Arm.nominal(), numbers, small=False, **study).numbers.values
    np.testing.assert_array_equal(found[0], np.random.default_rng(1).random((1, 2000))[0])


def test_a_store_made_by_another_process_meanwhile_is_used(tmp_path, monkeypatch):
    place, answers = tmp_path / "study.zarr", iter([False])
    cra.sweep(cra.Arm.nominal(), k_t=K_T, store=place)
    disk = SimpleNamespace(path=SimpleNamespace(exists=lambda _: next(answers, True)))
    monkeypatch.setattr(store_module, "os", disk)
    study = cra.sweep(cra.Arm.nominal(), k_t=K_T, store=place)
    assert not list(answers) and study.sizes["k_t"] == K_T.size
    assert [path.name for path in tmp_path.iterdir()] == [place.name]


def test_two_workers_one_killed(tmp_path):
    """A real local cluster: one of two workers dies in the middle, and every region is there in the end."""
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        k_t = np.geomspace(1e2, 1e6, 24)
        killed = []

        def kill_one(future):
            if not killed:
                killed.append(True)
                next(iter(cluster.workers.values())).process.process.kill()

        submit = client.submit

        def submitted(*args, **kwargs):
            future = submit(*args, **kwargs)
            future.add_done_callback(kill_one)
            return future

        client.submit = submitted
        study = cra.sweep(cra.Arm.nominal(), k_t=k_t, m_e=M_E, chunks=2, store=tmp_path / "study.zarr", client=client)
        eager = cra.sweep(cra.Arm.nominal(), k_t=k_t, m_e=M_E)
        np.testing.assert_allclose(study.natural_frequencies, eager.natural_frequencies, rtol=1e-14)
        assert killed


@pytest.mark.parametrize(
    ("quantity", "parameters", "message"),
    [
        ("frequencies", {}, "quantity = 'frequencies': must be one of natural_frequencies"),
        ("natural_frequencies", {"k_x": [1.0]}, "'k_x' is not a parameter of natural_frequencies"),
        ("natural_frequencies", {"k_t": [[1.0]]}, r"k_t: an array of shape \(1, 1\)"),
        ("natural_frequencies", {"k_t": []}, "k_t: an array of shape"),
        ("natural_frequencies", {"m_e": [0.0, -1.0]}, r"m_e\[1\] = -1.0"),
        ("natural_frequencies", {"k_t": [1.0], "chunks": 0}, "chunks = 0"),
        ("peak_response", {}, "peak_response needs the option motion"),
        ("natural_frequencies", {"k_t": [1.0], "chunks": 2**70}, "chunks = 1180591620717411303424: must be"),
        ("natural_frequencies", {"k_t": [1.0], "client": "one"}, "client: must be given together with a store"),
        ("natural_frequencies", {"k_t": [1.0], "store": 3}, "store = 3: must be a path"),
        ("natural_frequencies", {"k_t": [1.0], "store": "x" * 5000}, "output = .*File name too long"),
    ],
)
def test_bad_input_names_the_field(quantity, parameters, message):
    with pytest.raises((TypeError, ValueError), match=message):
        cra.sweep(cra.Arm.nominal(), quantity, **parameters)


def test_a_batch_arm_has_no_place():
    with pytest.raises(ValueError, match=r"arm: its fields have shape \(2,\)"):
        cra.sweep(cra.Arm.nominal().replace(m_e=[0.0, 1.0]))


def test_a_missing_library_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(ImportError, match=r"'cra_sym\[scale\]'"):
        cra.sweep(cra.Arm.nominal())


def test_a_study_travels():
    study = make_study(cra.Arm.nominal(), "natural_frequencies", {"k_t": K_T})
    assert pickle.loads(pickle.dumps(study)).digest() == study.digest()
