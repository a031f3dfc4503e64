"""Derived kernels: lazy, stored, and never stale."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys

import pytest

from cra_sym.kernels import derived, derived_kernel

DERIVATION = "cra_sym.test_derivation:beat"
PLANT = """
import sys, types
module = types.ModuleType("cra_sym.test_derivation")
def beat():
    import sympy as sp
    x, a = sp.symbols("x a")
    print("derived")
    return {"beat": sp.cos(x) * sp.cos(a * x), "power": x**5}, (x, a)
module.beat = beat
sys.modules["cra_sym.test_derivation"] = module
"""
CALL = f"""
import sys
from cra_sym.kernels import derived_kernel
f = derived_kernel("{DERIVATION}")
assert not {{"sympy", "llvmlite"}} & set(sys.modules)
values = f(0.5, [1.0, 2.0])
print({{name: value.tolist() for name, value in values.items()}}, f.arguments, "sympy" in sys.modules)
"""


def run(code):
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == ""  # progress is for terminals
    return done.stdout.splitlines()


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="the subprocess finds its cache by XDG_CACHE_HOME")
def test_second_process_derives_nothing_and_never_loads_sympy(private):
    first, second = run(PLANT + CALL), run(PLANT + CALL)
    assert first[0] == "derived" and first[1].endswith("True")
    assert len(second) == 1 and second[0].endswith("('x', 'a') False")
    assert first[1].split(" (")[0] == second[0].split(" (")[0]


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="the subprocess finds its cache by XDG_CACHE_HOME")
def test_two_processes_at_once_agree(private):
    started = [subprocess.Popen([sys.executable, "-c", PLANT + CALL], stdout=-1, text=True) for _ in range(2)]
    outputs = [process.communicate(timeout=120)[0].splitlines()[-1].split(" (")[0] for process in started]
    assert outputs[0] == outputs[1]
    assert [file.suffix for file in private.iterdir()] == [""]


def test_importing_loads_neither_sympy_nor_llvm():
    assert run("import sys, cra_sym.kernels; print({'sympy', 'llvmlite'} & set(sys.modules))") == ["set()"]


def test_fingerprint_follows_sources_and_versions(monkeypatch, tmp_path):
    before = derived.fingerprint()
    derived.fingerprint.cache_clear()
    monkeypatch.setattr("importlib.metadata.version", lambda package: "0")
    assert derived.fingerprint() != before
    derived.fingerprint.cache_clear()
    monkeypatch.undo()
    assert derived.fingerprint() == before
    derived.fingerprint.cache_clear()
    (tmp_path / "symbols.py").write_text("changed = True\n")
    monkeypatch.setattr(derived, "_PACKAGE", tmp_path)
    assert derived.fingerprint() != before
    derived.fingerprint.cache_clear()


def test_every_deriving_source_exists():
    assert all((derived._PACKAGE / name).exists() for name in derived._DERIVING)


def test_sources_edited_since_loading_are_not_vouched_for(private, monkeypatch, tmp_path):
    assert derived._sources_are_what_runs()
    (tmp_path / "symbols.py").write_text("edited = True\n")
    os.utime(tmp_path / "symbols.py", (2e9, 4e9))
    monkeypatch.setattr(derived, "_PACKAGE", tmp_path)
    assert not derived._sources_are_what_runs()
    namespace = {}
    exec(PLANT, namespace)
    assert derived_kernel(DERIVATION)(0.5, 1.0)["power"] == 0.5**5
    assert not list(private.glob("*"))
    (tmp_path / "symbols.py").unlink()
    assert not derived._sources_are_what_runs()  # a package without its sources
    for kept in (derived._source_of, derived.fingerprint, derived._hash_is_of_what_runs):
        kept.cache_clear()


def test_stored_derivations_are_read_without_a_look_at_the_sources(private, monkeypatch):
    namespace, looks, look = {}, [], derived._sources_are_what_runs
    exec(PLANT, namespace)
    monkeypatch.setattr(derived, "_sources_are_what_runs", lambda: looks.append(1) or look())
    derived._hash_is_of_what_runs.cache_clear()
    for _ in range(3):
        derived._source_of.cache_clear()
        assert derived_kernel(DERIVATION)(0.5, 1.0)["power"] == 0.5**5
    assert len(looks) == 3 and os.listdir(private)  # about the hash before and after, once more before it is stored
    derived._source_of.cache_clear()


def test_a_derived_kernel_pickles_as_what_it_is(private, monkeypatch):
    namespace = {}
    exec(PLANT, namespace)
    f = derived_kernel(DERIVATION)
    assert "beat" in repr(f)
    copy = pickle.loads(pickle.dumps(f))
    assert copy == f and copy.arguments == ("x", "a")
    del sys.modules["cra_sym.test_derivation"]
    assert os.listdir(private)


@pytest.mark.parametrize("path", ["os:system", "cra_sym.arm", "cra_sym.arm:a b", "sympy.x:cos"])
def test_only_derivations_of_the_package(path):
    with pytest.raises(ValueError, match="must be"):
        derived_kernel(path)


def test_a_derivation_takes_literals_which_are_a_part_of_its_key():
    string, beam = (derived_kernel("cra_sym.mechanics.one_wave:basis", n) for n in (1, 2))
    assert len(string.layout) == 2 and len(beam.layout) == 5
    assert repr(beam) == "<Kernel of cra_sym.mechanics.one_wave:basis(2)>"
    ends = derived_kernel("cra_sym.mechanics.one_wave:coefficients", (("k",), ("m",)))
    assert ends.arguments == ("s_0", "c_0", "i_1", "c_1")
    with pytest.raises(ValueError, match="must be numbers, texts and tuples of them"):
        derived_kernel("cra_sym.mechanics.one_wave:basis", [1])
