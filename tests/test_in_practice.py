"""The package beside other tools: pickles and copies, threads, precision of others, floating-point error handling."""

import copy
import os
import pickle
import signal
import threading
import warnings
from concurrent.futures import ThreadPoolExecutor

import mpmath
import numpy as np
import pytest
import sympy as sp

import cra_sym as cra
from cra_sym.cached import cached_property, released_in_children
from cra_sym.checks import equal
from cra_sym.symbols import v

ARM = cra.Arm.nominal().replace(k_t=1e3, k_r=50.0)
BATCH = ARM.replace(m_e=np.linspace(0.0, 0.1, 5), k_t=[[1e2], [np.inf]])
DAMPED = ARM.replace(zeta=0.3)
TIMES = np.linspace(0.0, 2.0, 40)


def claimed():
    from cra_sym.claims import claim

    return claim("C01")


def certified(modes):
    pytest.importorskip("flint", reason="the extra 'certify' brings python-flint")
    return cra.certify(ARM, modes)


def slipped():
    k_d, f_s = sp.symbols("k_d f_s")
    model = ARM.model.replace(hysteresis=[(cra.Jenkins(k_d, f_s), v, "left")])
    return cra.slip_response(
        model.at({**ARM.values, "k_d": 5e3, "f_s": 0.3}), VALUES["motion"]()[0], [0.1, 0.2], modes=1
    )


VALUES = {
    "arm": lambda: ARM.replace(m_e=[0.1, 0.2]),
    "system": lambda: ARM.model.at(ARM.values, zeta=0.01),
    "model": lambda: ARM.model,
    "sensitivities": lambda: cra.sensitivities(BATCH),
    "rates": lambda: cra.sensitivities(BATCH).rate,
    "modal parameters": lambda: cra.modal_parameters(BATCH),
    "certificate": lambda: certified(1),
    "motion": lambda: cra.BaseMotion.trapezoid([0.1, 0.2], 0.2, 1.0),
    "sum of motions": lambda: cra.BaseMotion(velocity=0.1) + cra.BaseMotion(amplitude=1e-3, angular_frequency=10.0),
    "record": lambda: cra.BaseMotion.sampled([0.0, 0.1, 0.2], [0.0, 1.0, 0.0]),
    "force": lambda: cra.Force(1.0, 0.5, 10.0),
    "sampled force": lambda: cra.Force.sampled([0.0, 0.1, 0.2], [0.0, 1.0, 0.0]),
    "axial base": lambda: cra.AxialBase(0.01),
    "joint stiffness": lambda: cra.JointStiffness(1.0),
    "fluctuation": lambda: cra.Fluctuation(k_t=1.0),
    "transverse base": lambda: cra.TransverseBase(0.01),
    "equation": lambda: cra.equation(23),
    "elements": lambda: ARM.model.ritz(2),
    "backbone": lambda: cra.backbone(ARM, amplitude=1e-3, modes=1, harmonics=1),
    "steady states": lambda: cra.steady_states(ARM, [28.0], drive={"w": 1e-4}, modes=1, harmonics=1),
    "modal equations": lambda: cra.nonlinear_modal_equations(ARM, 1),
    "fit": lambda: cra.identify(ARM, cra.natural_frequencies(ARM), 0.01, unknown=("k_t",)),
    "slip": slipped,
    "verdict": claimed,
}  # fmt: skip


@pytest.mark.parametrize("name", VALUES)
def test_results_are_values(name):
    one, other = VALUES[name](), VALUES[name]()
    assert one == other
    assert pickle.loads(pickle.dumps(one)) == one and copy.copy(one) == one and copy.deepcopy(one) == one
    assert one != "something else" and not one == 1


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (cra.BaseMotion(velocity=0.1), cra.BaseMotion(velocity=0.2)),
        (cra.BaseMotion(velocity=0.1), cra.BaseMotion(velocity=[0.1])),
        (cra.BaseMotion(velocity=0.1), cra.BaseMotion(amplitude=0.1)),
        (cra.BaseMotion.trapezoid(0.1, 0.2, 1.0), cra.BaseMotion.trapezoid(0.1, 0.2, 1.1)),
        (cra.Force(1.0), cra.Force(2.0)),
        (cra.Force(1.0), cra.BaseMotion(acceleration=1.0)),
        (cra.sensitivities(ARM), cra.sensitivities(ARM, 2)),
        (cra.sensitivities(ARM), cra.sensitivities(ARM, by=("k_t",))),
        (cra.modal_parameters(ARM), cra.modal_parameters(ARM.replace(k_t=2e3))),
    ],
)
def test_what_differs_is_not_equal(one, other):
    assert one != other and other != one


def test_equal_motions_have_equal_hashes():
    assert len({VALUES["motion"](), VALUES["motion"](), VALUES["force"](), VALUES["force"]()}) == 2


def test_arrays_are_equal_by_their_elements():
    assert equal({"a": (np.array([1.0, np.nan]), [1])}, {"a": (np.array([1.0, np.nan]), [1])})
    assert not equal({"a": np.array([1.0])}, {"a": np.array([1.0, 2.0])})
    assert not equal((1.0,), [1.0]) and not equal(np.array([1.0]), 1.0) and equal(np.nan, np.nan)


# Threads ----------------------------------------------------------------------------------------------------------


def everything(k_t):
    """One thread's work: results of all kinds that keep something or compile something."""
    arm = cra.Arm.nominal().replace(k_t=k_t, k_r=50.0, m_e=[0.0, 0.01], zeta=0.01)
    motion = cra.BaseMotion.trapezoid(0.1, 0.2, 1.0)
    return (
        cra.natural_frequencies(arm, 4),
        cra.mode_shapes(arm, [0.2, 1.0], 3),
        cra.sensitivities(arm).log["L"],
        cra.tip_response(arm, motion, TIMES),
        cra.frequency_response(arm, [3.0, 30.0]),
        cra.growth_rate(arm, cra.JointStiffness(1.0), 28.0, 0.05, 2),
    )


def test_eight_threads_compute_what_one_does():
    stiffnesses = np.geomspace(1e2, 1e5, 16)
    serial = [everything(k_t) for k_t in stiffnesses]
    with ThreadPoolExecutor(8) as pool:
        assert equal(list(pool.map(everything, stiffnesses)), serial)


def test_threads_share_one_arm():
    serial = cra.sensitivities(BATCH).rate["E"], cra.modal_parameters(BATCH).axial
    shared = BATCH.replace(L=1.0)
    with ThreadPoolExecutor(8) as pool:
        work = [(cra.sensitivities(shared).rate["E"], cra.modal_parameters(shared).axial) for _ in range(8)]
        found = list(
            pool.map(lambda _: (cra.sensitivities(shared).rate["E"], cra.modal_parameters(shared).axial), work)
        )
    assert equal(found, [serial] * 8)


def test_certificates_of_threads_are_those_of_one_and_the_precision_stays():
    flint = pytest.importorskip("flint", reason="the extra 'certify' brings python-flint")
    before = flint.ctx.prec
    serial = [cra.certify(ARM.replace(k_t=k_t), 2) for k_t in (1e2, 1e3, 1e4, 1e5)]
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(lambda k_t: cra.certify(ARM.replace(k_t=k_t), 2), (1e2, 1e3, 1e4, 1e5)))
    assert found == serial and flint.ctx.prec == before


@pytest.mark.parametrize("digits", [15, 3])
def test_the_precision_of_another_thread_changes_no_check(digits):
    held, done = threading.Event(), threading.Event()

    def other():
        with mpmath.workdps(digits):
            held.set()
            done.wait()

    thread = threading.Thread(target=other)
    thread.start()
    try:
        held.wait(60.0)
        assert all(cra.equation(number).check() for number in (30, 34, 36))
        assert mpmath.mp.dps == digits
    finally:
        done.set()
        thread.join()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are not forked here")
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_a_process_forked_beside_a_computing_thread_computes_too():
    """The lock of a property of Python 3.11 is held in the child forever; that of the package by nobody."""
    begun, done, lock = threading.Event(), threading.Event(), released_in_children(threading.Lock())

    class Slow:
        @cached_property
        def value(self):
            if threading.current_thread() is not threading.main_thread():
                begun.set()
                done.wait()
            return 1

    thread = threading.Thread(target=lambda: Slow().value)
    thread.start()
    begun.wait(60.0)
    child = os.fork()
    if not child:
        signal.alarm(60)  # ends a child that waits
        free = lock.acquire(timeout=50.0)
        os._exit(0 if free and Slow().value == 1 else 1)
    done.set()
    thread.join()
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


def test_no_property_of_the_package_has_a_lock():
    from pathlib import Path

    lines = {
        (path.name, line)
        for path in Path(cra.__file__).parent.rglob("*.py")
        for line in path.read_text("utf-8").splitlines()
        if "functools" in line and "cached_property" in line
    }
    assert {name for name, _ in lines} == {"cached.py"}


# Error handling of others -----------------------------------------------------------------------------------------

WORK = {
    "natural frequencies": lambda: cra.natural_frequencies(BATCH),
    "mode shapes": lambda: cra.mode_shapes(BATCH, [0.0, 0.5, 1.0], 5),
    "modal parameters": lambda: cra.modal_parameters(BATCH).axial,
    "sensitivities": lambda: cra.sensitivities(BATCH).log["L"],
    "sensitivities to a rigid joint": lambda: cra.sensitivities(ARM.replace(k_t=np.inf, k_r=0.0)).compliance["k_t"],
    "sensitivities of a rigid-body mode": lambda: cra.sensitivities(ARM.replace(k_t=0.0)).rate["k_t"],
    "frequency response": lambda: cra.frequency_response(ARM.replace(zeta=0.01), np.geomspace(1e-3, 1e6, 6)),
    "static response": lambda: cra.frequency_response(ARM.replace(zeta=0.01), [0.0, 1e-70]),
    "structural damping": lambda: cra.frequency_response(ARM.replace(zeta=0.01), [1.0], damping="structural"),
    "response": lambda: cra.response(ARM, cra.BaseMotion(velocity=0.1), TIMES, [0.5, 1.0]),
    "damped response": lambda: cra.tip_response(ARM.replace(zeta=0.5), cra.BaseMotion(velocity=0.1), 1e3 * TIMES),
    "sampled response": lambda: cra.tip_response(
        ARM.replace(zeta=0.9),
        cra.BaseMotion.sampled(TIMES[:31], np.exp(-(30.0 * TIMES[:31] ** 2)), exact=True),
        100.0 * TIMES,
    ),
    "harmonic response": lambda: cra.tip_response(
        ARM.replace(zeta=0.1), cra.BaseMotion(amplitude=1e-3, angular_frequency=10.0), TIMES
    ),
    "residual vibration": lambda: cra.residual_vibration(DAMPED, cra.BaseMotion.trapezoid(0.1, 0.2, 1.0)),
    "residual gradient": lambda: cra.residual_vibration_gradient(
        ARM, cra.BaseMotion.trapezoid(0.1, 0.2, 1.0), by=("k_r", "duration")
    ),
    "input shaper": lambda: cra.input_shaper(10.0, 0.9),
    "state space": lambda: cra.state_space(ARM).A,
    "growth rate": lambda: cra.growth_rate(ARM, cra.JointStiffness(1.0), [28.0, 1e5], 0.05, 2),
    "stability boundary": lambda: cra.stability_boundary(ARM, cra.JointStiffness(1.0), [0.0, 0.01], (1, 1)),
    "axial base": lambda: cra.stability_boundary(ARM, cra.AxialBase(0.01), 0.1, (1, 2)),
    "ritz": lambda: ARM.model.ritz(4).natural_frequencies(ARM.values, 3),
    "identification": lambda: cra.identify_joint(ARM, cra.natural_frequencies(ARM), 0.01).values,
}  # fmt: skip


@pytest.mark.parametrize("name", WORK)
def test_numpy_set_to_raise_changes_nothing(name):
    expected = WORK[name]()
    with np.errstate(all="raise"), warnings.catch_warnings():
        warnings.simplefilter("error")
        assert equal(WORK[name](), expected)


@pytest.mark.parametrize("number", [5, 16, 19, 23, 26, 30, 31, 34, 36, 40, 44])
def test_checks_pass_with_numpy_set_to_raise(number):
    with np.errstate(all="raise"):
        assert cra.equation(number).check()


def test_nothing_is_left_changed():
    import matplotlib

    before = np.geterr(), dict(matplotlib.rcParams), list(warnings.filters), mpmath.mp.prec
    for name in ("frequency response", "sampled response", "growth rate", "identification"):
        WORK[name]()
    assert cra.equation(34).check()
    assert (np.geterr(), dict(matplotlib.rcParams), list(warnings.filters), mpmath.mp.prec) == before


def test_no_thread_changes_the_warnings_of_another():
    """The filters of warnings are those of the process: nothing in the package sets them, even for a moment."""
    from pathlib import Path

    users = {
        path.name
        for path in Path(cra.__file__).parent.rglob("*.py")
        for line in path.read_text("utf-8").splitlines()
        if "catch_warnings" in line and ">>>" not in line  # examples are not the package
    }
    assert users == set()


def test_eight_threads_find_the_boundaries_one_does_and_each_its_warnings():
    from cra_sym.analysis.floquet_boundary import floquet_boundary

    arms = [cra.Arm.nominal().replace(k_t=k_t) for k_t in np.geomspace(5e3, 5e4, 8)]

    def work(arm):
        return floquet_boundary(arm, cra.JointStiffness(), 0.05, (1, 1), modes=2)

    serial = [work(arm) for arm in arms]
    before = list(warnings.filters)
    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(work, arms)) == serial
    assert list(warnings.filters) == before
