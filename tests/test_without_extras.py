"""The package without llvmlite, Dask, xarray and the other extras: a process in which importing them fails."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np

ABSENT = ("llvmlite", "dask", "distributed", "xarray", "zarr", "flint")

BLOCK = f"""
import sys
from importlib.machinery import PathFinder

class WithoutExtras(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        return None if name.partition(".")[0] in {ABSENT!r} else super().find_spec(name, path, target)

sys.meta_path[sys.meta_path.index(PathFinder)] = WithoutExtras
"""

NUMBERS = """
import numpy as np
import cra_sym as cra
from cra_sym.kernels import has_compiler

rng = np.random.default_rng(8)
arms = cra.Arm.nominal().replace(
    k_t=10 ** rng.uniform(1, 6, 200), k_r=10 ** rng.uniform(0, 5, 200), m_e=rng.uniform(0, 0.1, 200)
)
many = cra.Arm.nominal().replace(k_t=np.geomspace(1e1, 1e6, 140_000))
soft = cra.Arm.nominal().replace(k_t=1e3)
t, x = np.linspace(0.0, 2.0, 101), np.linspace(0.0, 1.0, 7)
modal, slopes = cra.modal_parameters(arms), cra.sensitivities(arms)
from cra_sym.symbols import symbol
y, a = symbol("x"), symbol("L")
numbers = {
    "frequencies": cra.natural_frequencies(arms, modes=6),
    "many frequencies": cra.natural_frequencies(many)[::997],
    "shapes": cra.mode_shapes(arms, x, derivative=2),
    "participation": modal.participation,
    "axial": modal.axial,
    "log_k_t": slopes.log_k_t,
    "df_dk_r": slopes.df_dk_r,
    "response": cra.tip_response(soft, cra.BaseMotion(velocity=0.1, amplitude=1e-3, angular_frequency=10.0), t),
    "growth": cra.growth_rate(soft, cra.JointStiffness(), np.linspace(6.0, 90.0, 50), 0.3),
    "boundary": cra.stability_boundary(soft, cra.JointStiffness(), 0.01, resonance=(1, 1), order=2),
    "frequency response": np.abs(cra.frequency_response(soft, np.linspace(5.0, 90.0, 50), x)),
    "residual": cra.residual_vibration(soft, cra.BaseMotion.trapezoid(0.3, 0.5, 1.0)),
    "kernel": cra.kernel(y**2 / a, (y, a))(np.linspace(0.0, 1.0, 5), 2.0),
}
"""

REPORT = """
import json

def refused(call):
    try:
        call()
    except ImportError as error:
        return str(error)

messages = [refused(lambda: cra.sweep(soft, k_t=[1.0, 2.0])), refused(lambda: cra.certify(soft))]
found = {name: np.asarray(value).tolist() for name, value in numbers.items()}
print(json.dumps([found, messages, has_compiler(), sorted(set(ABSENT) & set(sys.modules))]))
"""


def test_reproduce_names_the_extra_it_needs():
    """As from a plain wheel: one line, no traceback, nothing written."""
    code = (
        BLOCK.replace(repr(ABSENT), repr(("nbconvert",)))
        + "from cra_sym.__main__ import main\nsys.exit(main(['reproduce']))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.count("\n") == 1 and "cra_sym[notebooks]" in done.stderr and "nbconvert" in done.stderr


def test_every_number_without_the_extras():
    """The fallback gives the numbers of this process, which may compile, and says what an extra would bring."""
    code = f"{BLOCK}{NUMBERS}ABSENT = {ABSENT!r}\n{REPORT}"
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-2000:]
    found, messages, compiler, loaded = json.loads(done.stdout)
    assert not compiler and loaded == []
    for message, extra in zip(messages, ("scale", "certify"), strict=True):
        assert f"cra_sym[{extra}]" in message
    here: dict = {}
    exec(NUMBERS, here)
    for name, expected in here["numbers"].items():
        scale = np.max(np.abs(expected))
        np.testing.assert_allclose(found[name], expected, rtol=1e-9, atol=1e-12 * scale, err_msg=name)
