"""Functional Mock-up Units, validated, built from source and simulated by FMPy."""

from __future__ import annotations

import shutil
import zipfile
from pathlib import Path

import numpy as np
import pytest

import cra_sym as cra

fmpy = pytest.importorskip("fmpy", reason="needs FMPy")
pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")

ARM = cra.Arm.nominal().replace(k_t=1e4, k_r=1e3, zeta=0.01)


@pytest.fixture(scope="module", params=["3.0", "2.0"])
def unit(request, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("fmu") / "out"
    made = cra.export("fmu", folder, system=ARM, name="crane", modes=3, version=request.param)
    assert made.files == ("crane.fmu",)
    return folder / "crane.fmu"


def simulated(unit: Path, kind: str, **options):
    return fmpy.simulate_fmu(
        str(unit), fmi_type=kind, start_values={"base_acceleration": 0.2}, stop_time=0.5, output_interval=0.01,
        output=["v", "y", "root_force"], **options,
    )  # fmt: skip


def test_it_is_valid(unit):
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(unit)) == []
    variables = {v.name: v for v in fmpy.read_model_description(str(unit)).modelVariables}
    assert variables["base_acceleration"].causality == "input" and variables["base_acceleration"].unit == "m/s2"
    assert variables["root_moment"].causality == "output" and variables["root_moment"].unit == "N.m"


@pytest.mark.parametrize("kind, bound", [("CoSimulation", 1e-13), ("ModelExchange", 1e-8)])
def test_it_moves_as_the_tip_response(unit, kind, bound):
    """Co-simulation is exact; model exchange to the tolerance of CVode, 1e-10 of states of up to 1e-2."""
    found = simulated(unit, kind, relative_tolerance=1e-10)
    expected = cra.tip_response(ARM, cra.BaseMotion(acceleration=0.2), found["time"], modes=3)
    assert np.max(np.abs(found["v"] - expected)) < bound and np.max(np.abs(expected)) > 1e-3
    np.testing.assert_allclose(found["y"] - found["v"], 0.1 * found["time"] ** 2, atol=1e-8)


def test_it_builds_from_its_sources(unit, tmp_path):
    names = zipfile.ZipFile(unit).namelist()
    assert any(name.startswith("binaries/") for name in names) and "documentation/licenses/LICENSE.txt" in names
    folder = fmpy.extract(str(unit), str(tmp_path / "unit"))
    major = fmpy.read_model_description(folder).fmiVersion[0]
    import subprocess

    command = f"cc -std=c99 -pedantic -Wall -Wextra -Werror -shared -fPIC crane.c fmi{major}.c -lm -o crane.so"
    subprocess.run(command.split(), cwd=Path(folder) / "sources", check=True)


def test_state_and_directional_derivative(unit):
    """A state that is set back gives the same again; the derivative of a linear system is its matrix."""
    description = fmpy.read_model_description(str(unit))
    folder = fmpy.extract(str(unit))
    arguments = {
        "guid": description.guid, "unzipDirectory": folder, "instanceName": "one",
        "modelIdentifier": description.coSimulation.modelIdentifier,
    }  # fmt: skip
    three = description.fmiVersion == "3.0"
    one = (fmpy.fmi3.FMU3Slave if three else fmpy.fmi2.FMU2Slave)(**arguments)
    try:
        one.instantiate()
        if not three:
            one.setupExperiment(startTime=0.0)
        one.enterInitializationMode()
        one.exitInitializationMode()
        get, put = (one.getFloat64, one.setFloat64) if three else (one.getReal, one.setReal)
        keep, back = (one.getFMUState, one.setFMUState) if three else (one.getFMUstate, one.setFMUstate)
        put([1], [0.2])
        one.doStep(0.0, 0.01)
        kept, seen = keep(), []
        for _ in range(2):
            back(kept)
            one.doStep(0.01, 0.01)
            seen.append(get([1001])[0])
        assert seen[0] == seen[1] != 0.0
        rows = one.getDirectionalDerivative([20001, 1001], [10000], [1.0])
        put([1, 10000, 10001], [0.0, 1.0, 0.0])
        assert rows[0] == get([20001])[0]
    finally:
        one.terminate()
        one.freeInstance()
        shutil.rmtree(folder, ignore_errors=True)


def test_a_rigid_body_mode_works(tmp_path):
    """A base free under a force, and an arm that slides at its root."""
    for name, arm, drive in (("free", ARM, "drive_force"), ("slides", ARM.replace(k_t=0.0), "base_acceleration")):
        cra.export("fmu", tmp_path / name, system=arm, name="crane", input=drive)
        found = fmpy.simulate_fmu(
            str(tmp_path / name / "crane.fmu"), fmi_type="CoSimulation", start_values={drive: 0.2}, stop_time=0.5,
            output_interval=0.01, output=["v", "w"],
        )  # fmt: skip
        if drive == "base_acceleration":
            expected = cra.tip_response(arm, cra.BaseMotion(acceleration=0.2), found["time"], modes=3)
        else:
            whole = cra.state_space(arm, 3, drive, ["v"])
            held = whole.discrete(0.01)
            expected, state = [], np.zeros(len(held.A))
            for _ in found["time"]:
                expected.append((held.C @ state)[0])
                state = held.A @ state + held.B[:, 0] * 0.2
        assert np.max(np.abs(found["v"] - expected)) < 1e-12


def test_what_is_refused(tmp_path):
    with pytest.raises(ValueError, match="give system="):
        cra.export("fmu", tmp_path / "out")
    with pytest.raises(ValueError, match=r"version = '1\.0': must be '3.0' or '2.0'"):
        cra.export("fmu", tmp_path / "out", system=ARM, version="1.0")
    with pytest.raises(ValueError, match="an FMU has float64"):
        cra.export("fmu", tmp_path / "out", system=ARM, real="float32")
    assert not list(tmp_path.iterdir())
