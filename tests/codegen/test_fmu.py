"""Functional Mock-up Units, validated, built from source and simulated by FMPy."""

from __future__ import annotations

import shutil
import subprocess
import zipfile
from functools import reduce
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
    where = Path(folder) / "sources"
    strict = "-std=c99 -pedantic -Wall -Wextra -Wconversion -Wdouble-promotion -Wshadow -Werror".split()
    for compiler in filter(shutil.which, ("gcc", "clang")):
        subprocess.run([compiler, *strict, "-O1", "-c", "crane.c", f"fmi{major}.c"], cwd=where, check=True)
    (where / "main.c").write_text(reduce(lambda text, names: text.replace(*names), NAMES[major].items(), DRIVER))
    token = fmpy.read_model_description(folder).guid
    checked = ["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", f'-DTOKEN="{token}"']
    build = ["cc", *strict[:3], *checked, "main.c", "crane.c", "-lm", "-o", "main"]
    subprocess.run(build, cwd=where, check=True)
    subprocess.run(["./main"], cwd=where, check=True)


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


DRIVER = r"""
#include "fmi2.c"

int main(void) /* initialise twice, the first time in vain; advance; keep and set back the state */
{
    const unsigned number = 2006; /* k_t */
    double value = -1.0, change[STATES];
    void *kept = NULL;
    component *one = created("one", say, NULL, NULL);
    if (fmi2SetReal(one, &number, 1, &value) != fmi2OK || fmi2ExitInitializationMode(one) != fmi2Error) {
        return 1;
    }
    value = 2e3;
    if (fmi2Reset(one) != fmi2OK || fmi2SetReal(one, &number, 1, &value) != fmi2OK) {
        return 2;
    }
    one->data.input[0] = 1.0;
    if (fmi2ExitInitializationMode(one) != fmi2OK || advance(one, 0.01) || fmi2GetFMUState(one, &kept) != fmi2OK) {
        return 3;
    }
    if (derivatives(one, change) || change[1] != 1.0 || fmi2SetFMUState(one, kept) != fmi2OK) {
        return 4;
    }
    fmi2FreeFMUState(one, &kept);
    fmi2FreeInstance(one);
    return 0;
}
"""
NAMES = {"2": {"FMUState": "FMUstate"}, "3": {"fmi2": "fmi3", "SetReal": "SetFloat64", "1, &value": "1, &value, 1"}}
CHANGES = [{"k_t": 2e3, "m_e": 0.05, "zeta": 0.03}, {"k_t": np.inf, "L": 0.7}]


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_parameters_are_start_values(unit, kind):
    """Other values than those of the export: the same system with these; model exchange to the tolerance of CVode."""
    variables = {v.name: v for v in fmpy.read_model_description(str(unit)).modelVariables}
    for name, value in {**ARM.values, "zeta": ARM.zeta}.items():
        one = variables[name]
        assert (one.causality, one.variability, float(one.start)) == ("parameter", "fixed", float(value))
        assert one.description and one.unit == ({**ARM.model.units, "zeta": "1"})[name]
    for changes in CHANGES:
        found = fmpy.simulate_fmu(
            str(unit), fmi_type=kind, start_values={"base_acceleration": 0.2, **changes}, stop_time=0.5,
            output_interval=0.01, output=["v", "tip_acceleration"], relative_tolerance=1e-10,
        )  # fmt: skip
        arm, motion = ARM.replace(**changes), cra.BaseMotion(acceleration=0.2)
        expected = cra.tip_response(arm, motion, found["time"], modes=3)
        bound = 1e-13 if kind == "CoSimulation" else 1e-8
        assert np.max(np.abs(found["v"] - expected)) < bound < 1e-3 * np.max(np.abs(expected))
        if kind == "CoSimulation":  # CVode's error in q times omega^2 is 1e-5 m/s^2
            moved = cra.tip_response(arm, motion, found["time"], modes=3, derivative=2)
            np.testing.assert_allclose(found["tip_acceleration"], 0.2 + moved, atol=1e-11)


def test_any_model_has_its_parameters(tmp_path):
    """A force and an acceleration together, and a force on the free base: as the state space at other values."""
    from tests.codegen.test_in_time import PUSHED, VALUES, v
    from tests.codegen.test_in_time import x as place

    system = PUSHED.at(VALUES, zeta=0.02)
    changed = {"k_t": 5e3, "m_b": 0.9, "L": 1.1}
    outputs = {"tip": "y", "strain": 0.01 * v.diff(place, 2).subs(place, 0), "root": "root_force"}
    for name, drive in (("held", ["base_acceleration", "F"]), ("free", "drive_force")):
        cra.export("fmu", tmp_path / name, system=system, name="span", modes=4, input=drive, outputs=outputs)
        linear = cra.state_space(system.replace(**changed), 4, drive, outputs)
        u = np.array([0.3, -1.5])[: linear.B.shape[1]]
        found = fmpy.simulate_fmu(
            str(tmp_path / name / "span.fmu"), fmi_type="CoSimulation", stop_time=0.3, output_interval=0.01,
            start_values=changed | dict(zip(linear.input_names, u, strict=True)), output=list(outputs),
        )  # fmt: skip
        held, x, expected = linear.discrete(0.01), np.zeros(len(linear.A)), []
        for _ in found["time"]:
            expected.append(held.C @ x + held.D @ u)
            x = held.A @ x + held.B @ u
        for column, one in zip(np.array(expected).T, outputs, strict=True):
            np.testing.assert_allclose(found[one], column, atol=1e-10 * np.abs(column).max())


BAD = [{"k_t": -1.0}, {"L": 0.0}, {"E": np.nan, "m_e": 0.02}, {"zeta": 1.5}, {"rho": -1.0, "L": -1.0}]


@pytest.mark.parametrize("changes", BAD)
def test_bad_parameters_are_named(unit, changes):
    said: list[str] = []
    with pytest.raises(Exception, match="ExitInitializationMode failed with status 3"):
        fmpy.simulate_fmu(
            str(unit), fmi_type="CoSimulation", start_values=changes, stop_time=0.1,
            logger=lambda *given: said.append(given[-1].decode()),
        )  # fmt: skip
    bad = set(changes) - {"m_e"}
    assert {text.split(" = ")[0] for text in said} == bad and all("invalid" in text for text in said)


LOGGED = fmpy.fmi2.fmi2CallbackFunctions()


def test_parameters_are_fixed_after_initialization(unit):
    """And a reset brings their start values back."""
    from fmpy.logging import addLoggerProxy

    description = fmpy.read_model_description(str(unit))
    folder, said = fmpy.extract(str(unit)), list[str]()
    three = description.fmiVersion == "3.0"
    one = (fmpy.fmi3.FMU3Model if three else fmpy.fmi2.FMU2Model)(
        guid=description.guid, unzipDirectory=folder, instanceName="one",
        modelIdentifier=description.modelExchange.modelIdentifier,
    )  # fmt: skip
    number = next(v.valueReference for v in description.modelVariables if v.name == "k_t")
    if three:
        one.instantiate(logMessage=lambda *given: said.append(given[-1].decode()))
    else:
        LOGGED.logger = fmpy.fmi2.fmi2CallbackLoggerTYPE(lambda *given: said.append(given[-1].decode()))
        addLoggerProxy(fmpy.fmi2.byref(LOGGED))  # one for the whole process, so that it must stay
        one.instantiate(callbacks=LOGGED)
    get, put = (one.getFloat64, one.setFloat64) if three else (one.getReal, one.setReal)

    def initialised() -> None:
        if not three:
            one.setupExperiment(startTime=0.0)
        one.enterInitializationMode()
        put([number], [2e3])
        one.exitInitializationMode()

    try:
        initialised()
        assert get([number]) == [2e3]
        with pytest.raises(Exception, match="failed with status 3"):
            put([number], [3e3])
        assert said == ["k_t: is fixed once initialization mode is over"]
        one.reset()
        assert get([number]) == [1e4]
        initialised()
    finally:
        one.freeInstance()
        shutil.rmtree(folder, ignore_errors=True)


def test_a_system_without_closed_form_is_frozen_and_says_why(tmp_path):
    from tests.systems import system

    cra.export("fmu", tmp_path / "out", system=system("hanging beam", zeta=0.01), name="span")
    description = fmpy.read_model_description(str(tmp_path / "out" / "span.fmu"))
    assert not [v for v in description.modelVariables if v.causality == "parameter"]
    assert "Its values are frozen: model: has coefficients that vary" in description.description


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
