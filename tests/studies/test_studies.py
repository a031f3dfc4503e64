"""Sweeps against loops, in memory, lazily and through a store that is stopped in the middle."""

from __future__ import annotations

import os
import pickle
import shutil
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import cra_sym as cra
from cra_sym.files import OutputError
from cra_sym.studies import places
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


def stopped_after_three(store, monkeypatch):
    """Interrupt a sweep into a store; return the regions written, and a list that takes those written from now on."""
    written, rest, write = [], [], store_module._write

    def stopping(study, target, region):
        if len(written) == 3:
            raise KeyboardInterrupt
        write(study, target, region)
        written.append(region)

    monkeypatch.setattr(store_module, "_write", stopping)
    with pytest.raises(KeyboardInterrupt):
        cra.sweep(cra.Arm.nominal(), k_t=K_T, m_e=M_E, chunks=1, store=store)
    monkeypatch.setattr(store_module, "_write", lambda *job: (rest.append(job[2]), write(*job)))
    return written, rest


def test_a_stored_sweep_goes_on_where_it_was_stopped(tmp_path, monkeypatch):
    place = tmp_path / "a study.zarr"
    written, rest = stopped_after_three(place, monkeypatch)
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
    notes = pathlib.Path(os.environ["COUNTED"])
    with notes.open("a") as file:
        file.write(f"{np.ravel(arm.k_t)[0]} {np.ravel(arm.m_e)[0]}\\n")
    if "HELD" in os.environ and len(notes.read_text().splitlines()) > 40:
        time.sleep(300)  # it is killed here
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
    process = subprocess.Popen([sys.executable, "-c", text], stderr=subprocess.PIPE, env={**os.environ, "HELD": "1"})
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
    with pytest.raises(ValueError, match=r"holds another sweep \(dimension k_t "):
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
    monkeypatch.setattr(places, "os", disk)
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
        ("natural_frequencies", {"k_t": [1.0], "store": "new.zarr", "client": "one"}, "client = 'one': must be a dask"),
        ("natural_frequencies", {"k_t": [1.0], "store": 3}, "store = 3: must be a path"),
        ("natural_frequencies", {"k_t": [1.0], "store": "x" * 5000}, "output = .*File name too long"),
    ],
)
def test_bad_input_names_the_field(quantity, parameters, message):
    with pytest.raises((TypeError, ValueError), match=message):
        cra.sweep(cra.Arm.nominal(), quantity, **parameters)


def test_a_batch_arm_has_no_place():
    with pytest.raises(ValueError, match=r"system: its values have shape \(2,\)"):
        cra.sweep(cra.Arm.nominal().replace(m_e=[0.0, 1.0]))


def test_a_missing_library_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(ImportError, match=r"'cra_sym\[scale\]'"):
        cra.sweep(cra.Arm.nominal())


def test_a_study_travels():
    study = make_study(cra.Arm.nominal(), "natural_frequencies", {"k_t": K_T})
    assert pickle.loads(pickle.dumps(study)).described() == study.described()


# Any system, any quantity, any input ------------------------------------------------------------------------------


def wire(**options):
    import sympy as sp

    x, t, tension, mass = sp.symbols("x t tension mass")
    y = sp.Function("y")(x, t)
    return cra.Model(
        y.diff(t) ** 2 / 2 - tension * y.diff(x) ** 2 / 2, fields=[y], x=x, domain=(0, 1), t=t,
        essential=[y.subs(x, 0)], right=mass * y.diff(t) ** 2 / 2, **options,
    )  # fmt: skip


def test_any_system_is_swept():
    study = cra.sweep(wire(units={"tension": "N"}).at({"tension": 1.0, "mass": 0.0}), tension=[1.0, 4.0], zeta=0.01)
    np.testing.assert_allclose(study.natural_frequencies, [[0.25, 0.75, 1.25], [0.5, 1.5, 2.5]], rtol=1e-9)
    assert study.tension.attrs["units"] == "N" and study.attrs["system_mass"] == 0.0


@pytest.mark.parametrize(
    ("name", "unit"),
    [("df_dk_t", "Hz m/N"), ("df_dk_r", "Hz rad/(N m)"), ("log_k_t", "1"), ("df_dm_e", "Hz/kg"), ("log_L", "1"),
     ("df_dE", "Hz/Pa"), ("df_dL", "Hz/m")],
)  # fmt: skip
def test_the_sensitivity_to_any_parameter_is_swept(name, unit):
    arm = cra.Arm.nominal().replace(m_e=0.02, k_r=50.0)
    study = cra.sweep(arm, name, k_t=[1e3, 1e4], modes=2)
    assert study[name].attrs["units"] == unit and study[name].dims == ("k_t", "mode")
    parameter, step = name.removeprefix("df_d").removeprefix("log_"), 1e-5
    for k_t, found in zip([1e3, 1e4], study[name].values, strict=True):
        here = arm.replace(k_t=k_t)
        value = here.values[parameter]
        above, below = (cra.natural_frequencies(here.replace(**{parameter: value * (1 + s)}), 2) for s in (step, -step))
        slope = (above - below) / (2 * step)  # a central difference: h^2 = 1e-10 and rounding over h
        expected = slope / (cra.natural_frequencies(here, 2) if name.startswith("log") else value)
        np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_the_sensitivity_of_any_system_is_swept():
    study = cra.sweep(wire(units={"tension": "N"}).at({"tension": 1.0, "mass": 0.0}), "df_dtension", tension=[1.0, 4.0])
    f = np.multiply.outer([0.5, 1.0], [0.5, 1.5, 2.5])  # of the wire without an end mass: f = sqrt(T) (2 n - 1) / 4
    np.testing.assert_allclose(study.df_dtension, f / (2 * np.array([[1.0], [4.0]])), rtol=1e-9)
    assert study.df_dtension.attrs["units"] == "Hz/N"


def test_fits_are_swept_over_what_is_assumed():
    """The fitted stiffnesses depend on the assumed end mass, and chi2 says which one is right."""
    arm = cra.Arm.nominal()
    measured = cra.natural_frequencies(arm.replace(k_t=2e3, k_r=40.0, m_e=0.02), 4)
    given = {"measured": measured, "uncertainty": 0.005, "m_e": [0.01, 0.02]}
    with pytest.warns(cra.MisfitWarning):
        fits = cra.sweep(arm, "identified", **given, unknown=("k_t", "k_r"))
        chi2 = cra.sweep(arm, "misfit", **given).misfit
    assert fits.identified.dims == ("m_e", "unknown") and fits.unknown.values.tolist() == ["k_t", "k_r"]
    np.testing.assert_allclose(fits.identified[1], [2e3, 40.0], rtol=1e-6)
    assert chi2[0] > 100 > 1e-6 > chi2[1]


def test_a_batch_of_motions_is_an_axis():
    motion = cra.BaseMotion.trapezoid([0.1, 0.2], 0.5, 1.0)
    study = cra.sweep(cra.Arm.nominal(), "residual_vibration", motion=motion, k_t=[1e3, 1e4])
    assert study.residual_vibration.dims == ("motion", "k_t")
    for i, distance in enumerate((0.1, 0.2)):
        for j, k_t in enumerate((1e3, 1e4)):
            one = cra.residual_vibration(
                cra.Arm.nominal().replace(k_t=k_t), cra.BaseMotion.trapezoid(distance, 0.5, 1.0)
            )
            assert study.residual_vibration[i, j] == pytest.approx(one, rel=1e-12)
    turned = cra.sweep(cra.Arm.nominal(), "residual_vibration", k_t=[1e3, 1e4], motion=motion)
    np.testing.assert_array_equal(turned.residual_vibration.T, study.residual_vibration)


@pytest.mark.parametrize(
    "motion",
    [
        cra.BaseMotion(velocity=[0.1, 0.2, 0.3]),
        cra.BaseMotion(amplitude=1e-3, angular_frequency=[5.0, 6.0, 7.0]),
        cra.BaseMotion.sampled([0.0, 0.5, 1.0], [[0.0, 1.0, 0.0], [0.0, 2.0, 0.0], [1.0, 0.0, 0.0]]),
        cra.BaseMotion.s_curve(0.1, [0.1, 0.2, 0.3], 1.0, 10.0),
    ],
    ids=["velocity", "harmonic", "record", "s-curve"],
)
def test_one_of_a_batch_of_motions_is_that_motion(motion):
    t = np.linspace(0.0, 2.0, 9)
    for i in range(3):
        np.testing.assert_allclose(motion[i].kinematics(t), [part[i] for part in motion.kinematics(t)], rtol=1e-15)
    assert motion[1:].shape == (2,) and motion[1:][0] == motion[1] and len(list(motion)) == 3


def test_a_batch_of_excitations_is_an_axis():
    study = cra.sweep(
        cra.Arm.nominal().replace(k_t=1e3, k_r=50.0), "growth_rate", excitation=cra.JointStiffness(k_t=[0.5, 1.0]),
        angular_frequency=[28.0, 29.0, 30.0], epsilon=0.1, modes=2,
    )  # fmt: skip
    assert study.growth_rate.dims == ("excitation", "angular_frequency") and study.growth_rate.shape == (2, 3)


@pytest.mark.parametrize("options", [{"scale": np.array([1.0, 2.0])}, {"scale": [1.0, 2.0, 3.0]}])
def test_an_option_that_would_be_paired_is_refused(options):
    def scaled(arm, *, scale):
        return arm.k_t * np.asarray(scale)

    with pytest.raises(ValueError, match=r"it returns the shape .*\(scale\)"):
        cra.sweep(cra.Arm.nominal(), scaled, k_t=[1.0, 2.0], **options)
    with pytest.raises(ValueError, match=r"motion is a batch of shape \(1, 2\)"):
        cra.sweep(cra.Arm.nominal(), "residual_vibration", motion=cra.BaseMotion(velocity=[[0.1, 0.2]]))


def complex_response(arm, *, driven=3.0):
    return cra.frequency_response(arm, driven)


def soft(arm):
    return np.asarray(arm.k_t) < 1e3


def softness(arm):
    return 1 / np.asarray(arm.k_t)


def counted(arm):
    return np.asarray(arm.k_t).astype(int)


@pytest.mark.parametrize(("quantity", "kind"), [(complex_response, "c"), (soft, "b"), (counted, "i"), (softness, "f")])
@pytest.mark.parametrize("way", [{}, {"chunks": 2}, {"store": True}], ids=["memory", "lazy", "store"])
def test_what_a_quantity_is_made_of_stays(quantity, kind, way, tmp_path):
    way = {"store": tmp_path / "study.zarr", "chunks": 2} if "store" in way else way
    study = cra.sweep(cra.Arm.nominal().replace(zeta=0.01), quantity, k_t=[1e2, 1e3, 1e4], **way)
    found = study[quantity.__name__]
    assert found.dtype.kind == kind
    expected = [quantity(cra.Arm.nominal().replace(zeta=0.01, k_t=k_t)) for k_t in (1e2, 1e3, 1e4)]
    np.testing.assert_allclose(found.values, expected, rtol=1e-12)


LAST = K_T[:2].max()


@pytest.mark.parametrize(
    ("quantity", "message"),
    [
        (lambda arm: arm.k_t + 1j * np.any(arm.k_t == LAST) if np.any(arm.k_t == LAST) else arm.k_t,
         "it returns complex128 here and float64 at the first point"),
        (lambda arm: arm.k_t + 0.5 if np.any(arm.k_t == LAST) else np.ones(arm.shape, int), "float64 here and int64"),
        (lambda arm: arm.k_t if np.any(arm.k_t == LAST) else arm.k_t > 1, "float64 here and bool"),
        (lambda arm: np.ma.masked_equal(arm.k_t, LAST), "quantity = <lambda>: element .*1.* is masked"),
        (lambda arm: 3.0, r"it returns the shape \(\), which must begin with \(1,.*, that of the system$"),
    ],
    ids=["complex", "float", "not truth values", "masked", "one number"],
)  # fmt: skip
@pytest.mark.parametrize("way", [{}, {"chunks": 2}, {"motion": cra.BaseMotion(velocity=[0.1, 0.2])}],
                         ids=["memory", "store", "batch"])  # fmt: skip
def test_what_is_of_another_kind_than_the_first_point_is_refused(quantity, message, way, tmp_path):
    """Else the imaginary part is lost, 10000.5 is 10000, and a number is True."""
    asked = (lambda arm, motion: quantity(arm)) if "motion" in way else quantity
    store = {"store": tmp_path / "study.zarr"} if "chunks" in way else {}
    with pytest.raises((TypeError, ValueError), match=message):
        cra.sweep(cra.Arm.nominal(), asked, k_t=K_T[:2], **way, **store)


def test_units_of_a_quantity_are_converted():
    class Quantity:  # the documented attributes of one of Pint
        dimensionality = property(lambda _: {"[length]": 1})

        def __init__(self, magnitude):
            self.magnitude = magnitude

        def to_base_units(self):
            return self

        def unit_items(self):
            return [("meter", 1)]

        def to(self, unit):
            return Quantity(1e-3 * self.magnitude)

    study = cra.sweep(cra.Arm.nominal(), lambda arm: Quantity(arm.k_t), k_t=K_T[:2])
    np.testing.assert_allclose(study["<lambda>"], 1e-3 * K_T[:2])


def test_what_is_not_a_number_is_refused():
    with pytest.raises(TypeError, match="quantity = <lambda>: it returns <U4; must be numbers"):
        cra.sweep(cra.Arm.nominal(), lambda arm: np.full(arm.shape, "text"), k_t=[1.0, 2.0])


# Labelled inputs --------------------------------------------------------------------------------------------------


def test_labelled_parameters_that_share_a_dimension_are_paired():
    k_t = xarray.DataArray([1e3, 1e4, 1e5], dims="case", coords={"case": ["a", "b", "c"]}, attrs={"units": "N/m"})
    m_e = xarray.DataArray([0.0, 0.01, 0.1], dims="case")
    study = cra.sweep(cra.Arm.nominal(), k_t=k_t, m_e=m_e, k_r=[1e2, 1e3])
    assert study.natural_frequencies.dims == ("case", "k_r", "mode")
    one = cra.natural_frequencies(cra.Arm.nominal().replace(k_t=1e4, m_e=0.01, k_r=1e3))
    np.testing.assert_allclose(study.natural_frequencies.sel(case="b", k_r=1e3), one, rtol=1e-12)
    assert study.k_t.dims == ("case",) and study.k_t.attrs["units"] == "N/m"


def test_labelled_parameters_of_two_dimensions_lie_along_both():
    k_t = xarray.DataArray([[1e3, 1e4, 1e5], [2e3, 2e4, 2e5]], dims=("row", "column"))
    k_r = xarray.DataArray([1e2, 1e3], dims="row")
    study = cra.sweep(cra.Arm.nominal(), k_r=k_r, k_t=k_t)
    assert study.natural_frequencies.dims == ("row", "column", "mode")
    one = cra.natural_frequencies(cra.Arm.nominal().replace(k_t=2e5, k_r=1e3))
    np.testing.assert_allclose(study.natural_frequencies[1, 2], one, rtol=1e-12)


@pytest.mark.parametrize(
    ("k_t", "m_e", "message"),
    [
        (("case", 2, {}), ("case", 3, {}), "dimension 'case' has 3 entries, another 2"),
        (
            ("case", 2, {"case": [0, 1]}),
            ("case", 2, {"case": [1, 0]}),
            "the coordinate of dimension 'case' is not that",
        ),
    ],
)
def test_labelled_parameters_that_do_not_fit_are_refused(k_t, m_e, message):
    given = {
        name: xarray.DataArray(np.linspace(0.1, 1.0, size), dims=dim, coords=coords)
        for name, (dim, size, coords) in (("k_t", k_t), ("m_e", m_e))
    }
    with pytest.raises(ValueError, match=message):
        cra.sweep(cra.Arm.nominal(), **given)


@pytest.mark.parametrize(
    ("dims", "message"),
    [
        ("mode", "dimension 'mode': is a name of the quantity"),
        ("natural_frequencies", "is a name of the quantity"),
        ("m_e", "dimension 'm_e': is the name of a parameter that is not swept along it"),
    ],
)
def test_a_dimension_of_a_name_that_is_taken_is_refused(dims, message):
    with pytest.raises(ValueError, match=message):
        cra.sweep(cra.Arm.nominal(), k_t=xarray.DataArray([1e3, 1e4], dims=dims))


@pytest.mark.parametrize("order", [("k_t", "m_e"), ("m_e", "k_t")])
def test_a_parameter_may_lie_along_another_in_any_order(order):
    given = {"k_t": xarray.DataArray([1e3, 1e4], dims="m_e"), "m_e": [0.0, 0.1]}
    study = cra.sweep(cra.Arm.nominal(), **{name: given[name] for name in order})
    assert study.natural_frequencies.dims == ("m_e", "mode") and study.m_e.values.tolist() == [0.0, 0.1]


def test_units_of_labelled_parameters_are_kept_or_refused():
    with pytest.raises(ValueError, match="k_t has units 'N/mm': must be in N/m"):
        cra.sweep(cra.Arm.nominal(), k_t=xarray.DataArray([1.0, 2.0], dims="k_t", attrs={"units": "N/mm"}))


# Stores -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"modes": 4}, "modes is 3 there, 4 here"),
        ({"k_r": 2.0}, "k_r is 1.0 there, 2.0 here"),
        ({"m_e": [0.1, 0.2]}, "m_e is .* there, .* here; dimension m_e is swept or given here only"),
        ({"quantity": "log_k_t"}, "quantity differs|quantity is .* there"),
    ],
)
def test_a_store_says_what_differs(tmp_path, changes, message):
    given = {"quantity": "natural_frequencies", "k_t": K_T, "k_r": 1.0, "modes": 3, "store": tmp_path / "study.zarr"}
    cra.sweep(cra.Arm.nominal(), **given)
    with pytest.raises(ValueError, match=message):
        cra.sweep(cra.Arm.nominal(), **(given | changes))


FUNCTION = """
{before}
def own(arm, *, scale=1.0):
    {inside}
    return scale * arm.k_t
"""
OBJECT = """
class Own:
    __name__ = "own"
    def __init__(self, scale):
        self.scale = scale
    def __call__(self, arm):
        return self.scale * arm.k_t
own = Own({scale})
"""


def quantity_of(tmp_path, source, name):
    import importlib.util
    import linecache

    linecache.clearcache()
    place = tmp_path / "own_quantity.py"
    place.write_text(source)
    spec = importlib.util.spec_from_file_location("own_quantity", place)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return getattr(module, name)


def test_a_function_that_moves_is_the_same_and_one_that_changes_is_not(tmp_path):
    place = tmp_path / "study.zarr"
    first = quantity_of(tmp_path, FUNCTION.format(before="", inside='"as it was"'), "own")
    cra.sweep(cra.Arm.nominal(), first, k_t=K_T[:2], store=place)
    moved = quantity_of(tmp_path, FUNCTION.format(before="# two\n# lines\n", inside='"as it was"  # a comment'), "own")
    cra.sweep(cra.Arm.nominal(), moved, k_t=K_T[:2], store=place)
    other = quantity_of(tmp_path, FUNCTION.format(before="", inside="scale = 2 * scale"), "own")
    with pytest.raises(ValueError, match=r"holds another sweep .*quantity"):
        cra.sweep(cra.Arm.nominal(), other, k_t=K_T[:2], store=place)


def test_a_callable_object_resumes_until_its_state_changes(tmp_path):
    place = tmp_path / "study.zarr"
    for _ in range(2):
        cra.sweep(cra.Arm.nominal(), quantity_of(tmp_path, OBJECT.format(scale=2.0), "own"), k_t=K_T[:2], store=place)
    with pytest.raises(ValueError, match=r"holds another sweep .*quantity"):
        cra.sweep(cra.Arm.nominal(), quantity_of(tmp_path, OBJECT.format(scale=3.0), "own"), k_t=K_T[:2], store=place)


HELPED = """
import functools
FACTOR = {factor}
def helper(arm):
    return [{helped} for _ in range(1)][0]
def own(arm):
    return FACTOR * helper(arm)
class Own:
    def __call__(self, arm):
        return self.factor() * helper(arm)
    def factor(self):
        return FACTOR
kept, made = functools.lru_cache(own), Own()
"""


@pytest.mark.parametrize("name", ["own", "kept", "made"])
@pytest.mark.parametrize("changes", [{"factor": 3.0}, {"helped": "2 * arm.k_t"}])
def test_what_a_function_takes_from_its_module_counts(tmp_path, name, changes):
    """A constant or a helper that changed gave the numbers of before."""
    place, first = tmp_path / "study.zarr", {"factor": 2.0, "helped": "arm.k_t"}
    for _ in range(2):
        quantity = quantity_of(tmp_path, HELPED.format(**first), name)
        cra.sweep(cra.Arm.nominal(), quantity, k_t=K_T[:2], store=place)
    with pytest.raises(ValueError, match=r"holds another sweep .*quantity"):
        changed = quantity_of(tmp_path, HELPED.format(**(first | changes)), name)
        cra.sweep(cra.Arm.nominal(), changed, k_t=K_T[:2], store=place)


def test_an_empty_folder_is_a_new_store_and_a_broken_one_is_said(tmp_path):
    place = tmp_path / "study.zarr"
    place.mkdir()
    cra.sweep(cra.Arm.nominal(), k_t=K_T[:2], store=place)
    (place / "natural_frequencies" / ".zarray").unlink()
    with pytest.raises(ValueError, match=r"store = .*a part of the sweep is missing there"):
        cra.sweep(cra.Arm.nominal(), k_t=K_T[:2], store=place)
    (place / ".zmetadata").unlink()
    with pytest.raises(ValueError, match="holds something else than a sweep"):
        cra.sweep(cra.Arm.nominal(), k_t=K_T[:2], store=place)


def test_what_is_missing_in_a_store_is_computed_again_or_said(tmp_path):
    place = tmp_path / "study.zarr"
    whole = cra.sweep(cra.Arm.nominal(), store=place, chunks=2, k_t=K_T).natural_frequencies.values
    chunks = sorted(path for path in (place / "natural_frequencies").iterdir() if path.name[0] != ".")
    chunks[0].write_bytes(b"")  # as after a power failure
    again = cra.sweep(cra.Arm.nominal(), store=place, chunks=2, k_t=K_T).natural_frequencies
    np.testing.assert_array_equal(again, whole)
    shutil.rmtree(place / "k_t")
    with pytest.raises(ValueError, match="the coordinate 'k_t' is missing there"):
        cra.sweep(cra.Arm.nominal(), store=place, chunks=2, k_t=K_T)


def test_a_store_in_the_home_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    cra.sweep(cra.Arm.nominal(), store="~/study.zarr", k_t=[1e3])
    assert (tmp_path / "study.zarr").is_dir()


def test_a_url_that_was_made_a_path_makes_no_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match=r"store = 's3:/bucket/study': must be .* URL of an object store as a text"):
        cra.sweep(cra.Arm.nominal(), k_t=K_T[:2], store=Path("s3:/" + "/bucket/study"))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "url", ["sftp://host/study", "http" + "://host/study", "file" + ":///study.zarr", "://", "x://y"]
)
def test_a_store_that_gives_no_promise_is_refused(url, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match=r"store = .*must be a local path, or a URL of an object store \(memory, s3"):
        cra.sweep(cra.Arm.nominal(), k_t=K_T, store=url)
    assert not list(tmp_path.iterdir())


def test_the_library_of_an_object_store_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "s3fs", None)
    with pytest.raises(ImportError, match=r"store = 's3://bucket/study.zarr': .*not installed .*s3fs"):
        cra.sweep(cra.Arm.nominal(), k_t=K_T, store="s3://bucket/study.zarr")


@pytest.fixture
def bucket():
    """A prefix in the object store that fsspec keeps in memory."""
    memory = pytest.importorskip("fsspec").filesystem("memory")
    yield "memory://bucket/study.zarr"
    memory.store.clear()


def test_a_sweep_into_an_object_store_goes_on_where_it_was_stopped(bucket, monkeypatch):
    written, rest = stopped_after_three(bucket, monkeypatch)
    study = cra.sweep(cra.Arm.nominal(), k_t=K_T, m_e=M_E, chunks=1, store=bucket + "/")
    assert len(rest) == K_T.size * M_E.size - 3 and not {*map(str, written)} & {*map(str, rest)}
    eager = cra.sweep(cra.Arm.nominal(), k_t=K_T, m_e=M_E)
    np.testing.assert_allclose(study.natural_frequencies, eager.natural_frequencies, rtol=1e-14)
    rest.clear()
    cra.sweep(cra.Arm.nominal(), k_t=K_T, m_e=M_E, store=bucket)
    assert rest == []
    with pytest.raises(ValueError, match=r"store = 'memory:.*holds another sweep \(modes is .* given here only"):
        cra.sweep(cra.Arm.nominal(), k_t=K_T, m_e=M_E, modes=4, store=bucket)


def test_what_an_object_store_holds_is_not_touched(bucket):
    import fsspec

    files = fsspec.filesystem("memory")
    files.pipe("/bucket/study.zarr/letter", b"keep me")
    with pytest.raises(ValueError, match="holds something else"):
        cra.sweep(cra.Arm.nominal(), k_t=K_T, store=bucket)
    assert files.find("/") == ["/bucket/study.zarr/letter"]


def test_what_an_object_store_refuses_is_said(bucket, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    cra.sweep(cra.Arm.nominal(), k_t=K_T[:1], m_e=M_E, chunks=1, store=bucket)
    import fsspec

    files = fsspec.filesystem("memory")
    files.rm("/bucket/study.zarr/natural_frequencies/0.1.0")
    monkeypatch.setattr(type(files), "pipe_file", full)
    with pytest.raises(OutputError, match=r"output = 'memory:.*cannot be written \(No space left"):
        cra.sweep(cra.Arm.nominal(), k_t=K_T[:1], m_e=M_E, store=bucket)


def test_the_memory_of_one_process_is_no_place_for_workers(bucket):
    with pytest.raises(ValueError, match="is in the memory of one process"):
        cra.sweep(cra.Arm.nominal(), k_t=K_T, store=bucket, client=SimpleNamespace(scatter=None, submit=None))


def test_a_store_opens_without_warnings(tmp_path):
    """This suite turns warnings into errors: those of xarray, Zarr and Dask too."""
    place = tmp_path / "study.zarr"
    cra.sweep(cra.Arm.nominal(), tip_stiffness, k_t=np.linspace(1.0, 2.0, 300), m_e=M_E, chunks=1, store=place).load()
    opened = xarray.open_zarr(place)
    assert opened.tip_stiffness.shape == (300, 4, 2) and opened.k_t.attrs["units"] == "N/m"
    lazy = cra.sweep(cra.Arm.nominal(), tip_stiffness, k_t=np.linspace(1.0, 2.0, 300), m_e=M_E, chunks=1)
    assert lazy.tip_stiffness.chunks[0] == (1,) * 300
