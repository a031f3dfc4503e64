"""requirements.txt: pins that satisfy pyproject.toml and resolve to wheels on every supported Python."""

from __future__ import annotations

import json
import re
import tomllib
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path, PurePosixPath
from urllib.parse import urlsplit

import pytest
from packaging.markers import Marker
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.tags import compatible_tags, cpython_tags, platform_tags
from packaging.utils import canonicalize_name, parse_wheel_filename

from tests.notebooks.gate import requirements

ROOT = Path(__file__).resolve().parents[1]
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PROJECT = SETTINGS["project"]
LINES = [line for line in (ROOT / "requirements.txt").read_text(encoding="utf-8").splitlines() if line.strip()]
PINS = [line for line in LINES if not line.startswith(("#", "-e"))]
LOCKED = tomllib.loads((ROOT / ".ci" / "pylock.toml").read_text(encoding="utf-8"))["packages"]
PYTHONS = ("3.11", "3.12", "3.13", "3.14")


@pytest.mark.parametrize("which", ["oldest", "newest"])
def test_the_ends_of_the_ranges_can_be_installed(which):
    *lines, package = requirements(which)
    assert package == "-e ."
    first = [Requirement(line) for line in lines[: len(PROJECT["dependencies"])]]
    assert [one.name for one in first] == [Requirement(line).name for line in PROJECT["dependencies"]]
    for given, own in zip(first, map(Requirement, PROJECT["dependencies"]), strict=True):
        assert given.marker == own.marker
        assert [clause.operator for clause in given.specifier] == ["==" if which == "oldest" else ">="]


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
    versions = {package["name"]: package["version"] for package in LOCKED}
    pins = {canonicalize_name(pin.name): next(iter(pin.specifier)).version for pin in map(Requirement, PINS)}
    assert {name: versions.get(name) for name in pins} == pins
    wheels = [wheel for package in LOCKED for wheel in package["wheels"]]
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


def test_packages_without_machine_code_accept_every_python():
    there = {name: package.metadata.get("Requires-Python") or "" for name, package in installed().items()}
    assert len(there) > len(PINS) / 2
    refused = {n: r for n, r in there.items() if not all(SpecifierSet(r).contains(f"{p}.99") for p in PYTHONS)}
    assert refused == {}


@pytest.mark.parametrize("minor", [int(python.partition(".")[2]) for python in PYTHONS])
def test_the_lock_has_a_wheel_of_everything_for_every_python(minor):
    """On this system: what the pins bring with them too."""
    here = [*platform_tags()]
    known = {
        *cpython_tags((3, minor), platforms=here),
        *compatible_tags((3, minor), interpreter=f"cp3{minor}", platforms=here),
    }
    where = {"python_version": f"3.{minor}", "python_full_version": f"3.{minor}.0"}
    wanted = [one for one in LOCKED if Marker(one.get("marker", "python_version > '3'")).evaluate(where)]
    assert len(wanted) > 100
    names = {one["name"]: [PurePosixPath(urlsplit(w["url"]).path).name for w in one["wheels"]] for one in wanted}
    assert [n for n, wheels in names.items() if not any(parse_wheel_filename(w)[3] & known for w in wheels)] == []
