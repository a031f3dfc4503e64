"""requirements.txt: pins that satisfy pyproject.toml and resolve to wheels on every supported Python."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PROJECT = SETTINGS["project"]
LINES = [line for line in (ROOT / "requirements.txt").read_text(encoding="utf-8").splitlines() if line.strip()]
PINS = [line for line in LINES if not line.startswith(("#", "-e"))]
PYTHONS = ("3.11", "3.12", "3.13", "3.14")


def test_the_package_itself_is_listed():
    assert LINES[-1] == "-e ."


WITH_COMPILER = {"llvmlite"}  # which some platforms have no wheels of


@pytest.mark.parametrize("line", PINS)
def test_every_line_is_a_plain_pin(line):
    requirement = Requirement(line)
    assert [clause.operator for clause in requirement.specifier] == ["=="]
    assert not (requirement.url or requirement.extras)
    assert bool(requirement.marker) == (requirement.name in WITH_COMPILER)


def test_llvmlite_is_asked_for_where_it_has_wheels():
    """One condition in both files, which holds and fails where it should."""
    lines = [line for line in [*PROJECT["dependencies"], *PINS] if Requirement(line).name in WITH_COMPILER]
    (marker,) = {str(Requirement(line).marker) for line in lines}
    with_wheels = {
        ("linux", "x86_64"),
        ("linux", "aarch64"),
        ("darwin", "arm64"),
        ("win32", "AMD64"),
        ("win32", "ARM64"),
    }
    without = {("darwin", "x86_64"), ("win32", "x86"), ("linux", "riscv64"), ("emscripten", "wasm32")}
    assert len(lines) == 2
    for system, machine in with_wheels | without:
        where = {"sys_platform": system, "platform_machine": machine}
        assert Requirement(f"llvmlite; {marker}").marker.evaluate(where) == ((system, machine) in with_wheels), where


def test_lock_has_the_pins():
    """A pin that is not in the lock: run make lock."""
    locked = tomllib.loads((ROOT / ".ci" / "pylock.toml").read_text(encoding="utf-8"))["packages"]
    versions = {package["name"]: package["version"] for package in locked}
    pins = {canonicalize_name(pin.name): next(iter(pin.specifier)).version for pin in map(Requirement, PINS)}
    assert {name: versions.get(name) for name in pins} == pins
    wheels = [wheel for package in locked for wheel in package["wheels"]]
    assert all(wheel["url"].startswith("https://") and wheel["hashes"]["sha256"] for wheel in wheels)


def test_pins_lie_in_the_ranges():
    """Every dependency, extra and group of pyproject.toml is pinned, inside the range given there."""
    pinned = {Requirement(line).name: next(iter(Requirement(line).specifier)).version for line in PINS}
    lists = [*PROJECT["optional-dependencies"].values(), *SETTINGS["dependency-groups"].values()]
    ranges = [*PROJECT["dependencies"], *(line for lines in lists for line in lines if isinstance(line, str))]
    for requirement in map(Requirement, ranges):
        assert requirement.specifier.contains(pinned[requirement.name]), requirement


def test_supported_pythons_agree():
    assert PROJECT["requires-python"] == f">={PYTHONS[0]}"
    declared = [c.removeprefix("Programming Language :: Python :: ") for c in PROJECT["classifiers"]]
    assert set(PYTHONS) <= set(declared)
    workflow = (ROOT / ".github" / "workflows" / "tests.yml").read_text(encoding="utf-8")
    (row,) = re.findall(r"^ +python: (\[.*\])$", workflow, re.M)
    assert json.loads(row) == list(PYTHONS)


def installed() -> dict[str, Distribution]:
    """Return what the pins bring, by canonical name, with their dependencies, as far as it is there."""
    found: dict[str, Distribution] = {}
    todo = [(Requirement(line).name, "") for line in PINS]
    while todo:
        name, extra = todo.pop()
        try:
            found[canonicalize_name(name)] = package = distribution(name)
        except PackageNotFoundError:
            continue
        for needed in map(Requirement, package.requires or ()):
            if needed.marker is None or needed.marker.evaluate({"extra": extra}):
                new = {"", *needed.extras} if canonicalize_name(needed.name) not in found else needed.extras
                todo += [(needed.name, wanted) for wanted in new]
    return found


def suits_every_python(package: Distribution) -> bool:
    """Return whether the package is one wheel without machine code."""
    return "-none-any" in (package.read_text("WHEEL") or "")


def test_packages_without_machine_code_accept_every_python():
    there = {name: package.metadata.get("Requires-Python") or "" for name, package in installed().items()}
    assert len(there) > len(PINS) / 2
    refused = {n: r for n, r in there.items() if not all(SpecifierSet(r).contains(f"{p}.99") for p in PYTHONS)}
    assert refused == {}


def command(python: str, target: Path) -> list[str]:
    """Return the command by which pip looks for wheels for another Python, without installing anything.

    Only what has machine code is asked for, the rest suits every Python: of the pins, and for the newest Python also
    of what they bring.
    """
    there = installed()
    pinned = {canonicalize_name(Requirement(line).name): line for line in PINS}
    asked = {*pinned, *there} if python == PYTHONS[-1] else set(pinned)
    general = {name for name, package in there.items() if suits_every_python(package)}
    lines = [pinned.get(name, name) for name in sorted(asked - general)]
    listed = target / f"pins-{python}.txt"
    listed.write_text("\n".join(lines), encoding="utf-8")
    options = ["--dry-run", "--ignore-installed", "--no-deps", "--only-binary=:all:", "--retries=0", "--timeout=20"]
    where = ["--python-version", python, "--target", str(target / python), "--requirement", str(listed)]
    return [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *options, *where]


def run(given: list[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(given, capture_output=True, text=True, timeout=600)


@pytest.mark.network
def test_wheels_resolve_on_every_python(tmp_path):
    probe = [sys.executable, "-m", "pip", "index", "versions", "mpmath", "--retries=0", "--timeout=10"]
    if subprocess.run(probe, capture_output=True).returncode:
        pytest.skip("no package index within reach")
    others = [python for python in PYTHONS if python != f"{sys.version_info.major}.{sys.version_info.minor}"]
    commands = [command(python, tmp_path) for python in others]  # not in threads, in which Python 3.11 fails to parse
    with ThreadPoolExecutor(len(others)) as pool:
        runs = dict(zip(others, pool.map(run, commands), strict=True))
    assert {python: done.stderr[-2000:] for python, done in runs.items() if done.returncode} == {}
