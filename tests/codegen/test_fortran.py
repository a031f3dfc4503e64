"""Exported Fortran: no memory taken, nothing read or written, no state, every procedure pure."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.codegen.kit import arm_without_vectors

ALLOWED = {
    "exp", "expm1", "sin", "cos", "sincos", "sinh", "atan2", "sqrt", "memset", "memcpy", "memmove",
    "_GLOBAL_OFFSET_TABLE_", "__stack_chk_fail",
}  # fmt: skip


@pytest.fixture(scope="module")
def source() -> str:
    return arm_without_vectors("crane").texts("fortran")["src/crane.f90"]


def test_every_procedure_is_pure(source):
    procedures = re.findall(r"^ *(.*?)\b(?:subroutine|function) \w+\(", source, re.MULTILINE)
    assert len(procedures) > 30
    assert all("pure" in words.split() for words in procedures)


def test_no_memory_no_input_no_output_no_state(source, tmp_path: Path):
    if shutil.which("gfortran") is None or shutil.which("nm") is None:
        pytest.skip("needs gfortran and nm (binutils)")
    (tmp_path / "crane.f90").write_text(source)
    subprocess.run(["gfortran", "-std=f2008", "-O1", "-c", "crane.f90"], cwd=tmp_path, check=True, timeout=300)
    listed = subprocess.run(["nm", "crane.o"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    symbols = [line.split()[-2:] for line in listed.splitlines()]
    assert {name for kind, name in symbols if kind == "U"} <= ALLOWED
    variables = {name for kind, name in symbols if kind in "BDCbd"}
    assert not {name for name in variables if not re.search(r"___(def_init|vtab)_", name)}  # the compiler's own


def test_stiffnesses_are_rigid_unless_given(source):
    assert len(re.findall(r"k_[tr] = huge\(1\.0_dp\)", source)) == 2
