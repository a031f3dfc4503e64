"""Exported Fortran: the bits of plain Python, no memory taken, nothing read or written, no state, all pure."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from cra_sym.codegen.arm_library import arm_library
from tests.codegen import kit

ALLOWED = {
    "exp", "expm1", "sin", "cos", "sincos", "sinh", "atan2", "sqrt", "memset", "memcpy", "memmove",
    "_GLOBAL_OFFSET_TABLE_", "__stack_chk_fail",
}  # fmt: skip


@pytest.fixture(scope="module")
def source() -> str:
    return kit.arm_without_vectors("crane").texts("fortran")["src/crane.f90"]


def test_every_procedure_is_pure(source):
    procedures = re.findall(r"^ *(.*?)\b(?:subroutine|function) \w+\(", source, re.MULTILINE)
    assert len(procedures) > 30
    assert all("pure" in words.split() for words in procedures)


def test_bits_are_those_of_plain_python_without_memory_or_state(tmp_path: Path):
    """Of everything that the self-test asks for, with the one mathematical library that both have here."""
    kit.needs("fortran")
    library = kit.arm_without_vectors("crane")
    checks = kit.bits(replace(library, checks=arm_library("cra").checks))
    kit.write(replace(library, checks=tuple(checks)).texts("fortran"), tmp_path)
    strict = ["gfortran", *"-std=f2008 -Wall -Wextra -Werror -ffp-contract=off -O1".split()]
    kit.run([*strict, "-c", "src/crane.f90"], tmp_path)
    kit.run([*strict, "-o", "self_test", "test/self_test.f90", "crane.o"], tmp_path)
    assert f"{len(checks)} checks, 0 failures" in kit.run(["./self_test"], tmp_path) and len(checks) > 500
    if shutil.which("nm"):
        symbols = [line.split()[-2:] for line in kit.run(["nm", "crane.o"], tmp_path).splitlines()]
        assert {name for kind, name in symbols if kind == "U"} <= ALLOWED
        variables = {name for kind, name in symbols if kind in "BDCbd"}
        assert not {name for name in variables if not re.search(r"___(def_init|vtab)_", name)}  # the compiler's own


def test_stiffnesses_are_rigid_unless_given(source):
    assert len(re.findall(r"k_[tr] = huge\(1\.0_dp\)", source)) == 2
