"""requirements.txt: pins that satisfy pyproject.toml and resolve to wheels on every supported Python."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
LINES = [line for line in (ROOT / "requirements.txt").read_text(encoding="utf-8").splitlines() if line.strip()]
PINS = [line for line in LINES if not line.startswith(("#", "-e"))]
PYTHONS = ("3.11", "3.12", "3.13", "3.14")


def test_the_package_itself_is_listed():
    assert LINES[-1] == "-e ."


@pytest.mark.parametrize("line", PINS)
def test_every_line_is_a_plain_pin(line):
    requirement = Requirement(line)
    assert [clause.operator for clause in requirement.specifier] == ["=="]
    assert not (requirement.marker or requirement.url or requirement.extras)


def test_pins_lie_in_the_ranges():
    """Every dependency and every extra of pyproject.toml is pinned, inside the range given there."""
    pinned = {Requirement(line).name: next(iter(Requirement(line).specifier)).version for line in PINS}
    ranges = [*PROJECT["dependencies"], *(r for extra in PROJECT["optional-dependencies"].values() for r in extra)]
    for requirement in map(Requirement, ranges):
        assert requirement.specifier.contains(pinned[requirement.name]), requirement


def test_supported_pythons_agree():
    assert PROJECT["requires-python"] == f">={PYTHONS[0]}"
    declared = [c.removeprefix("Programming Language :: Python :: ") for c in PROJECT["classifiers"]]
    assert set(PYTHONS) <= set(declared)


def resolve(python: str, target: Path) -> subprocess.CompletedProcess[str]:
    """Let pip look for the wheels of all pins for another Python, without installing anything.

    For the newest Python it also follows what the pins depend on, which takes a while.
    """
    listed = target / f"pins-{python}.txt"
    listed.write_text("\n".join(PINS), encoding="utf-8")
    options = ["--dry-run", "--ignore-installed", "--only-binary=:all:", "--retries=0", "--timeout=20", "--quiet"]
    where = ["--python-version", python, "--target", str(target / python), "--requirement", str(listed)]
    if python != PYTHONS[-1]:
        options.append("--no-deps")
    command = [sys.executable, "-m", "pip", "install", "--disable-pip-version-check", *options, *where]
    return subprocess.run(command, capture_output=True, text=True, timeout=600)


@pytest.mark.network
def test_wheels_resolve_on_every_python(tmp_path):
    probe = [sys.executable, "-m", "pip", "index", "versions", "mpmath", "--retries=0", "--timeout=10"]
    if subprocess.run(probe, capture_output=True).returncode:
        pytest.skip("no package index within reach")
    with ThreadPoolExecutor(2) as pool:
        runs = dict(zip(PYTHONS, pool.map(lambda python: resolve(python, tmp_path), PYTHONS), strict=True))
    assert {python: run.stderr[-2000:] for python, run in runs.items() if run.returncode} == {}
