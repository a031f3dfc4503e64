"""Templates specialised with kernels: values, the store of machine code, the absence of a compiler."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import sympy as sp

from cra_sym.kernels import compiled, has_compiler, kernel, specialise
from cra_sym.kernels.generated import CompileError

pytestmark = pytest.mark.skipif(not has_compiler(), reason="llvmlite is an option")

x, a = sp.symbols("x a")

# A template is plain text: here a Newton iteration on blocks of 64 lanes, for a function and a slope made elsewhere.
NEWTON = '''
import numpy as np

_LANES = 64


def _improved(x, a):
    value, slope = value_and_slope(x, a)
    return x - value / slope


def roots(out, start, a):
    """Write the root next to ``start`` for every ``a``."""
    x = np.empty(_LANES)
    for first in range(0, out.size, _LANES):
        count = min(_LANES, out.size - first)
        for lane in range(count):
            x[lane] = start[first + lane]
        for _ in range(6):
            for lane in range(count):
                x[lane] = _improved(x[lane], a[first + lane])
        for lane in range(count):
            out[first + lane] = x[lane]
'''


def kepler():
    equation = x - a * sp.sin(x) - 1
    return kernel((equation, equation.diff(x)), (x, a))


@pytest.fixture(scope="module")
def newton():
    return compiled(NEWTON, {"value_and_slope": kepler()})


def test_a_template_solves_what_the_kernel_states(newton):
    eccentricity = np.linspace(0, 0.7, 200)
    out = np.empty_like(eccentricity)
    newton.roots(out, np.full_like(out, 1.5), eccentricity)
    np.testing.assert_allclose(out - eccentricity * np.sin(out), 1, rtol=0, atol=1e-15)


def test_the_same_text_is_compiled_once(newton):
    assert compiled(NEWTON, {"value_and_slope": kepler()}) is newton
    assert not hasattr(newton, "_improved") and not hasattr(newton, "sin")


def test_threads_share_an_entry(newton):
    eccentricity = np.linspace(0, 0.7, 4000)
    out = np.empty_like(eccentricity)
    start = np.full_like(out, 1.5)
    with ThreadPoolExecutor(2) as pool:
        halves = [slice(0, 2000), slice(2000, 4000)]
        list(pool.map(lambda part: newton.roots(out[part], start[part], eccentricity[part]), halves))
    np.testing.assert_allclose(out - eccentricity * np.sin(out), 1, rtol=0, atol=1e-15)


SLOW = """
def fill(out, rounds):
    for k in range(out.size):
        x = 1.0 + k
        for _ in range(rounds):
            x = 0.5 * (x + 2.0 / x)
        out[k] = x
"""


def test_threads_run_while_machine_code_does():
    """Another thread sees a result that is half made, at one of many calls: the interpreter lock is released."""
    fill, half_made = compiled(SLOW, {}).fill, False
    fill(np.empty(1), 1)
    with ThreadPoolExecutor(1) as pool:
        for _ in range(200):
            out = np.zeros(1000)
            running = pool.submit(fill, out, 2000)
            while not running.done() and not half_made:
                half_made = out[0] != 0.0 and out[-1] == 0.0
            running.result()
            if half_made:
                return
    pytest.fail("no other thread ran")


def test_threads_that_ask_at_once_get_the_same_entries():
    template = "def at(x):\n" + "    x = x + 1.0 / (x * x + 2.0)\n" * 300 + "    return x\n"
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as pool:
            entries = list(pool.map(lambda _: compiled(template, {}), range(4)))
    finally:
        sys.setswitchinterval(interval)
    assert all(one is entries[0] for one in entries)


def test_division_by_zero_follows_ieee():
    entries = compiled("def at(x):\n    return f(x)\n", {"f": kernel(1 / x, (x,))})
    assert entries.at(0.0) == np.inf


def test_what_cannot_be_compiled_is_refused():
    with pytest.raises(CompileError, match=r"f needs from scipy\.special import erf"):
        compiled("def at(x):\n    return f(x)\n", {"f": kernel(sp.erf(x), (x,))})


PROCESS = """
import sys
from cra_sym.kernels import Kernel, compiled, is_compiled
f = Kernel("from numpy import cos\\n\\n\\ndef evaluate(x):\\n    return cos(x)\\n", ("x",))
parts = "def at(x):\\n    return f(x)\\n", {"f": f}
print(is_compiled(*parts), "llvmlite" in sys.modules)
entries = compiled(*parts)
print(entries.at(0.5), *entries.at.origins.values())
"""


def run(code=PROCESS):
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == ""  # progress is for terminals
    return done.stdout.split()


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="the subprocess finds its cache by XDG_CACHE_HOME")
def test_machine_code_is_loaded_by_the_next_process_and_never_trusted_when_damaged(private):
    first, second = run(), run()
    assert first[:2] == ["False", "False"] and second[:2] == ["True", "False"]
    assert first[3:] == ["compiled"] and second[3:] == ["loaded"]
    entry = max(private.iterdir(), key=lambda path: path.stat().st_size)
    good = entry.read_bytes()
    entry.write_bytes(good[:-1] + bytes([good[-1] ^ 1]))
    assert run()[2:] == first[2:]
    assert len(entry.read_bytes()) == len(good)
    assert float(first[2]) == pytest.approx(np.cos(0.5), rel=1e-15)


def test_code_that_is_no_code_is_compiled_anew(private, monkeypatch):
    monkeypatch.setattr(specialise.store, "load", lambda key: b"no machine code")
    entries = compiled("def twice(x):\n    return 2 * f(x)\n", {"f": kernel(x, (x,))})
    assert entries.twice(3.0) == 6


def test_without_llvmlite_there_is_a_clear_error(monkeypatch):
    monkeypatch.setitem(sys.modules, "llvmlite", None)
    assert not has_compiler()
    with pytest.raises(ImportError, match="llvmlite"):
        compiled("def absent(x):\n    return f(x)\n", {"f": kernel(x, (x,))})


def test_arguments_of_other_types_are_refused_and_compile_nothing():
    """Also those that only look alike: values, lengths and addresses must be what the machine code takes them for."""
    at = compiled("def at(x):\n    return x + 1\n", {}).at
    total = compiled(
        "def total(x):\n    y = 0.0\n    for k in range(x.size):\n        y += x[k]\n    return y\n", {}
    ).total
    for value in (None, "1.0", 1j, 2**63, -(2**63) - 1, [1.0]):
        with pytest.raises(CompileError, match="must be numbers of 64 bits or contiguous arrays"):
            at(value)
    unaligned = np.frombuffer(b"." + np.ones(4).tobytes(), offset=1)
    big_endian, every_other = np.ones(4).astype(">f8"), np.ones(8)[::2]
    for array in (
        unaligned,
        big_endian,
        every_other,
        np.ones(4, np.float32),
        np.ones(4, np.int32),
        np.ones(4, complex),
    ):
        with pytest.raises(CompileError, match="must be numbers of 64 bits or contiguous arrays"):
            total(array)
    assert at.origins == total.origins == {}
    assert at(-(2**63)) == 1 - 2**63 and at(True) == 2 and at(np.float32(0.5)) == 1.5
    assert total(np.ones(4)) == 4.0 and total(np.empty(0)) == 0.0
    with pytest.raises(TypeError, match="at: 2 arguments given, 1 expected"):
        at(1.0, 2.0)


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="the subprocess finds its cache by XDG_CACHE_HOME")
def test_machine_code_without_a_place_or_for_two_at_once(private, monkeypatch):
    both = [subprocess.Popen([sys.executable, "-c", PROCESS], stdout=-1, text=True) for _ in range(2)]
    values = [process.communicate(timeout=120)[0].split()[2] for process in both]
    assert not [path for path in private.iterdir() if path.suffix]  # no drafts are left
    made = run()
    assert values == [made[2]] * 2 and made[0] == "True" and made[3:] == ["loaded"]
    for path in private.iterdir():  # as if put there by somebody else
        path.chmod(0o644)
    assert run()[2:] == [made[2], "compiled"]
    (private.parent / "file").write_text("no directory")
    monkeypatch.setenv("XDG_CACHE_HOME", str(private.parent / "file"))
    assert run() == ["False", "False", made[2], "compiled"]


def on_a_terminal(code):
    """Return what a process writes to its standard error while that is a terminal."""
    pty = pytest.importorskip("pty", reason="terminals are made the Unix way")
    termios = pytest.importorskip("termios")
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (24, 120))
    done = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.DEVNULL, stderr=theirs)
    os.close(theirs)
    shown = b""
    with contextlib.suppress(OSError):  # the other end is closed
        while part := os.read(ours, 1024):
            shown += part
    os.close(ours)
    assert done.wait() == 0, shown.decode()
    return shown.decode()


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="the subprocess finds its cache by XDG_CACHE_HOME")
def test_a_terminal_is_told_what_takes_long(private):
    derive = (
        "from cra_sym.kernels import derived_kernel\nderived_kernel('cra_sym.mechanics.one_wave:basis', 2).source\n"
    )
    shown = on_a_terminal(derive + PROCESS)
    assert "deriving cra_sym.mechanics.one_wave:basis(2), once" in shown and "compiling at, once" in shown
    assert on_a_terminal(derive + PROCESS) == ""
