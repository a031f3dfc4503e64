"""Models as exported code: each language against the package, right values of others, what is refused."""

from __future__ import annotations

import math
import re
import shutil
from dataclasses import replace
from functools import cache
from unittest.mock import patch

import numpy as np
import pytest
import sympy as sp

import cra_sym as cra
from cra_sym.codegen import model_checks
from cra_sym.codegen.library import Library
from cra_sym.codegen.statement import stated
from cra_sym.codegen.user_model import model_library, model_text
from cra_sym.symbols import L, t, v, x
from tests import exported_models
from tests.codegen import kit
from tests.systems import system

LONG = ("string on a base with a payload", "bending and torsion")  # what languages run: the latter, long, C alone
TRIALS = 6  # of each model; a campaign runs a thousand


@cache
def library(name: str, real: str = "float64"):
    """Return one with a share of its reference vectors."""
    with patch.object(model_checks, "_POINTS", 2):
        return model_library(exported_models.model(name), "span", real)


def executed(made) -> dict:
    """Return the names of a library in Python."""
    names: dict = {}
    exec(compile(made.texts("python")[f"{made.name}.py"], made.name, "exec"), names)
    return names


@cache
def python(model: cra.Model) -> dict:
    return executed(kit.model_without_vectors(model))


def exported(name: str) -> dict:
    return python(exported_models.model(name))


@pytest.mark.parametrize("name", ["Timoshenko with end mass and spring", "string on a foundation"])
def test_python_passes_its_self_test(name, tmp_path):
    kit.passes(library(name), "python", tmp_path)


@pytest.mark.parametrize("language", ["c", "fortran", "rust", "javascript", "octave", "three wave numbers in c"])
def test_self_test_passes(language, tmp_path):
    made, language = library(LONG[language.startswith("three")]), language.split()[-1]
    kit.needs(language)
    if language == "octave":  # some hundred times slower than the others
        made = replace(made, checks=made.checks[::30])
    kit.passes(made, language, tmp_path)


@pytest.mark.parametrize("language", ["c", "fortran"])
def test_single_precision_is_a_whole_path(language, tmp_path):
    kit.needs(language)
    kit.passes(library("foundation with end mass", "float32"), language, tmp_path)
    source = next(path.read_text() for path in tmp_path.rglob("span.*") if path.suffix in (".c", ".f90"))
    assert not re.search(r"\bdouble\b", source) and "real64" not in source


def test_a_wrong_number_fails_the_self_test(tmp_path):
    """A line of each quantity, spoiled by a part in 1e9."""
    made = library(LONG[0])
    lines = {check.quantity: check for check in made.checks if not check.refused and np.any(check.expected)}
    assert sorted(lines) == list(range(10))
    names = exported(LONG[0])
    test = made.texts("python")["self_test.py"]
    exec(test[test.index("def _given") : test.index("def agree")], names)
    for check in lines.values():
        found = [0.0] * 256
        names["_evaluate"](check.quantity, [*check.given, *[0.0] * (64 - len(check.given))], found)
        size = np.abs(check.expected).max()
        off = np.abs(np.array(found[: len(check.expected)]) - check.expected)
        allowed = check.relative * np.abs(check.expected) + check.absolute
        assert (off <= allowed).all() and (allowed <= 1e-9 * size).any()


@pytest.mark.parametrize("name", exported_models.NAMES)
def test_random_parameters(name):
    """Stiffnesses from 0 to infinity, foundations and tensions of twelve decades: frequencies as the package's."""
    model = exported_models.model(name)
    names = python(model)
    fields = [symbol.name for symbol in model.symbols]
    for number in range(TRIALS):
        values = exported_models.drawn(name, number)
        expected = cra.natural_frequencies(model.at(dict(zip(fields, values, strict=True))), 4)
        found = names["natural_frequencies"](names["Parameters"](*values), 4)
        three = len(model.state_form.displacements) == 3  # a frequency of three waves loses some more digits
        assert found == pytest.approx(expected, rel=1e-11 if three else 1e-12, abs=1e-300), values


def test_a_function_without_a_zero_at_rest():
    """A string between fixed ends: sin(z)/z with z = omega L sqrt(m/N)."""
    m, N = sp.symbols("m N")
    string = cra.Model(
        m * v.diff(t) ** 2 / 2 - N * v.diff(x) ** 2 / 2,
        fields=[v], x=x, domain=(0, L), t=t, essential=[v.subs(x, 0), v.subs(x, L)],
    )  # fmt: skip
    names = python(string)
    parameters = names["Parameters"](**{"L": 0.5, "m": 2.0, "N": 8.0})
    start = names["characteristic"](parameters, 0.0)[0]
    for omega in (1.0, 3.9 * np.pi, 4.1 * np.pi):  # k L = omega / 4
        value, rate = names["characteristic"](parameters, omega)
        assert np.isclose(value / start, np.sinc(omega / 4 / np.pi), atol=1e-14)
        z = omega / 4
        assert np.isclose(rate / start, (math.cos(z) / z - math.sin(z) / z**2) / 4, atol=1e-14)
    assert "Motion" not in names  # nothing drives it


def test_right_below_the_cut_off():
    """A beam on a foundation with an end mass: omega_1 = 1.49597602, below the cut-off 10 (rho A = E I = L = 1)."""
    names = exported("foundation with end mass")
    beam = names["Parameters"](EI=1.0, L=1.0, k_f=100.0, m_e=10.0, rhoA=1.0)
    found = 2 * np.pi * np.array(names["natural_frequencies"](beam, 4))
    assert found[0] == pytest.approx(1.49597602, abs=1e-8)
    for number, omega in enumerate(found):
        near = [names["characteristic"](beam, omega * (1 + side * 1e-6))[0] for side in (-1, 1)]
        assert near[0] * near[1] < 0
        assert [names["count_below"](beam, omega * (1 + side * 1e-6)) for side in (-1, 1)] == [number, number + 1]
    assert all(np.isfinite(names["characteristic"](beam, omega)).all() for omega in (0.0, 10.0, 1e6))


def test_rigid_body_modes_and_close_pairs():
    """A free Timoshenko beam has two motions at rest; two strings of one tension have equal frequencies."""
    names = exported("Timoshenko with end mass and spring")
    loose = names["Parameters"](EI=1.0, I_r=0.01, L=1.0, kGA=30.0, k_r=0.0, k_t=0.0, m_e=0.5, rhoA=1.0)
    modes = names["modes_of"](loose, 4)
    assert [mode.omega for mode in modes[:2]] == [0.0, 0.0] and modes[2].omega > 1.0
    # two motions of unit mass at rest, without common mass, take all of the mass in a translation
    assert sum(mode.participation[0] ** 2 for mode in modes[:2]) == pytest.approx(1.5, rel=1e-12)
    m, n, T = sp.symbols("m n T")
    u = sp.Function("u")(x, t)
    pair = cra.Model(
        m * v.diff(t) ** 2 / 2 + n * u.diff(t) ** 2 / 2 - T * (v.diff(x) ** 2 + u.diff(x) ** 2) / 2,
        fields=[v, u], x=x, domain=(0, L), t=t,
        essential=[v.subs(x, 0), v.subs(x, L), u.subs(x, 0), u.subs(x, L)],
    )  # fmt: skip
    names = python(pair)
    for ratio in (1.0, 1.0 + 1e-13, 1.0 + 1e-7):
        parameters = names["Parameters"](L=1.0, T=1.0, m=1.0, n=ratio)
        found = np.array(names["natural_frequencies"](parameters, 4))
        exact = np.sort(np.concatenate([np.array([0.5, 1.0]), np.array([0.5, 1.0]) / math.sqrt(ratio)]))
        assert found == pytest.approx(exact, rel=1e-14)
        modes = names["modes_of"](parameters, 4)
        shapes = np.array([[names["mode_shape"](parameters, mode, k, 0.5, 0) for k in (0, 1)] for mode in modes[:2]])
        assert shapes.T @ shapes == pytest.approx(2 * np.eye(2), abs=1e-6)  # sqrt(2) sin(pi x) each


def test_bad_parameters_are_refused_by_name():
    names = exported("tension")
    good = {"EI": 1.0, "L": 1.0, "T": 2.0, "k_r": math.inf, "k_t": 5.0, "rhoA": 1.0}
    assert names["natural_frequencies"](names["Parameters"](**good), 2)[0] > 0.0
    wrong = {
        "EI": (math.nan, math.inf, 0.0, -1.0), "rhoA": (math.nan, -1.0, math.inf), "L": (0.0, -1.0, math.nan),
        "k_t": (-1.0, math.nan, -math.inf), "T": (math.nan, math.inf, -1e3),
    }  # fmt: skip
    for name, values in wrong.items():
        for value in values:
            with pytest.raises((names["InvalidParameters"], names["Buckled"])) as caught:
                names["natural_frequencies"](names["Parameters"](**(good | {name: value})), 2)
            assert "must" in str(caught.value) or "buckled" in str(caught.value)
    with pytest.raises(TypeError):
        names["natural_frequencies"](names["Parameters"](**(good | {"EI": "stiff"})), 2)
    with pytest.raises(names["InvalidArgument"], match="modes"):
        names["natural_frequencies"](names["Parameters"](**good), 0)


@pytest.mark.parametrize(
    "symbols, fields",
    [
        (("lambda", "pi", "PI", "\u03bb"), ["PI_2", "lambda_2", "pi_3", "lamda"]),
        (("k_t", "K_t", "EPS", "determinant"), ["EPS_2", "K_t", "determinant_2", "k_t_2"]),
        (("in", "by_T", "prepare", "a*/b"), ["a_b", "by_T", "in_2", "prepare_2"]),
    ],
)
def test_any_name_of_a_parameter(symbols, fields):
    """Words of languages and of the text, case that Fortran folds, Greek letters, what would end a comment."""
    m, T, k, m_e = sp.symbols(symbols)
    string = cra.Model(
        m * v.diff(t) ** 2 / 2 - T * v.diff(x) ** 2 / 2, fields=[v], x=x, domain=(0, L), t=t, left=-k * v**2 / 2,
        right=m_e * v.diff(t) ** 2 / 2,
    )  # fmt: skip
    written = model_text(string)
    assert sorted(set(written.names.values()) - {"L"}) == sorted(fields)
    asked = "def _evaluate(quantity: int, given: Row[float, 64], found: Mut[Row[float, 256]]) -> None:\n"
    asked += "    found[0] = 0.0\n"
    made = Library("span", "", f"{written.text()}\n\n{asked}", tuple(stated(string)), ())
    assert all("*/" not in line for line in made.provenance)
    names = executed(made)
    given = dict.fromkeys(fields, 1.0) | {"L": 1.0}
    z = 2 * np.pi * names["natural_frequencies"](names["Parameters"](**given), 1)[0]
    assert np.tan(z) == pytest.approx((1 - z**2) / (2 * z), rel=1e-12)


def test_two_models_link_into_one_program(tmp_path):
    if shutil.which("g++") is None:
        pytest.skip("needs g++")
    heads, objects = set(), []
    for name in ("string on a foundation", "hinged-hinged beam"):
        made = kit.model_without_vectors(exported_models.model(name), name.split()[0].split("-")[0])
        texts = made.texts("c")
        kit.write({key: text for key, text in texts.items() if key.endswith((".c", ".h"))}, tmp_path)
        head = texts[f"{made.name}.h"]
        assert "Lagrangian density" in head and "Boundary conditions" in head
        heads.add(re.search(r"SHA-256 of the above: ([0-9a-f]{64})", head)[1])
        kit.run(["cc", "-std=c99", "-O0", "-c", f"{made.name}.c"], tmp_path)
        objects.append(f"{made.name}.o")
    (tmp_path / "main.cpp").write_text(
        '#include "string.h"\n#include "hinged.h"\n#include <cstdio>\n'
        "int main() { double one[1], two[1]; string_parameters s = { 0 }; hinged_parameters h = { 0 };\n"
        "  s.L = s.T = s.rhoA = h.L = h.EI = h.rhoA = 1; s.k_t = 1;\n"
        "  if (string_natural_frequencies(&s, 1, one) || hinged_natural_frequencies(&h, 1, two)) return 1;\n"
        '  std::printf("%.12f\\n", two[0]); }\n'
    )
    kit.run(["g++", "-I.", "main.cpp", *objects, "-lm", "-o", "both"], tmp_path)
    assert float(kit.run(["./both"], tmp_path)) == pytest.approx(math.pi / 2, rel=1e-11)
    assert len(heads) == 2


def strings(**options):
    m, T = sp.symbols("m T", positive=True)
    u = sp.Function("u")(x, t)
    density = (m * v.diff(t) ** 2 + m * u.diff(t) ** 2 - T * (v.diff(x) ** 2 + u.diff(x) ** 2)) / 2
    return cra.Model(density, fields=[v, u], x=x, domain=(0, L), t=t, **options)


def test_joined_ends():
    """Two free strings, the end of one joined to the beginning of the other, are one of twice the length."""
    u = sp.Function("u")(x, t)
    names = python(strings(essential=[v.subs(x, L) - u.subs(x, 0)]))
    parameters = names["Parameters"](L=0.5, T=8.0, m=2.0)
    assert names["natural_frequencies"](parameters, 4) == pytest.approx([0.0, 1.0, 2.0, 3.0], rel=1e-14)
    mode = names["modes_of"](parameters, 2)[1]  # cos(pi x), of unit mass m L: from 1 to -1
    ends = [*mode.left_displacement, *mode.right_displacement]
    assert np.array(ends) * np.sign(ends[0]) == pytest.approx([1.0, 0.0, 0.0, -1.0], abs=1e-13)


def test_a_payload_on_a_rigid_link():
    """A rigid link makes the payload an end mass; a base without spring has a motion at rest, exactly."""
    names, model = exported(LONG[0]), exported_models.model(LONG[0])
    given = {"L": 0.7, "T": 3.0, "a": 1.0, "k_b": 20.0, "k_p": math.inf, "k_t": 9.0, "m_b": 0.4, "m_e": 0.0, "m_p": 0.3,
             "rhoA": 0.2}  # fmt: skip
    linked = names["natural_frequencies"](names["Parameters"](**given), 5)
    alone = given | {"k_p": 0.0, "m_p": 1e-3, "m_e": 0.3}  # the payload by itself moves at rest
    assert linked == pytest.approx(names["natural_frequencies"](names["Parameters"](**alone), 6)[1:], rel=1e-13)
    loose = given | {"k_b": 0.0, "a": 1.3, "k_p": 5.0}
    found = cra.natural_frequencies(model.at(loose), 3)
    assert found[0] == 0.0 and names["natural_frequencies"](names["Parameters"](**loose), 3) == pytest.approx(found)
    still = given | {"m_b": 0.0, "m_p": 0.0, "rhoA": 0.0, "k_p": 0.0}
    with pytest.raises(names["InvalidParameters"], match="lumped coordinates"):
        names["natural_frequencies"](names["Parameters"](**still), 2)


def test_dampers_are_refused(tmp_path):
    c = sp.Symbol("c")
    with pytest.raises(ValueError, match="dampers"):
        cra.export("c", tmp_path / "out", model=strings(virtual_work=[(-c * v.diff(t), v, "right")]))
    base, k, m = sp.Function("base")(t), *sp.symbols("k m")
    footing = cra.Model(
        m * v.diff(t) ** 2 / 2 - v.diff(x) ** 2 / 2 - k * (v - base) ** 2 / 2, fields=[v], coordinates=[base], x=x,
        domain=(0, L), t=t, left=m * base.diff(t) ** 2,
    )  # fmt: skip
    with pytest.raises(ValueError, match="coordinates that act along the whole length"):
        cra.export("c", tmp_path / "out", model=footing)
    with pytest.raises(TypeError, match="must be a Model"):
        cra.export("c", tmp_path / "out", model="beam")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="float32"):
        cra.export("python", tmp_path / "out", model=exported_models.model("tension"), real="float32")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "name, reason",
    [
        ("hanging beam", "vary along the length"), ("two planes", "4 wave numbers"),
        ("beam with an interior mass", "terms inside"),
    ],
)  # fmt: skip
def test_others_are_refused_and_frozen(name, reason, tmp_path):
    """One line says why, and what to do, which works."""
    with pytest.raises(ValueError, match=reason) as caught:
        cra.export("c", tmp_path / "out", model=system(name).model)
    assert "system=" in str(caught.value) and "\n" not in str(caught.value) and not list(tmp_path.iterdir())
    frozen = cra.export("c", tmp_path / "out", system=system(name), input="w", outputs=["v"], modes=2)
    assert "system.c" in frozen.files


def test_symmetric_structures_are_refused_and_frozen(tmp_path):
    """Three equal strings joined by springs have double frequencies, of one determinant."""
    m, T, k = sp.symbols("m T k", positive=True)
    parts = [sp.Function(f"u_{i}")(x, t) for i in range(3)]
    star = cra.Model(
        sum(m * u.diff(t) ** 2 - T * u.diff(x) ** 2 for u in parts) / 2, fields=parts, x=x, domain=(0, L), t=t,
        right=-k * sum((u - w) ** 2 for u, w in zip(parts, parts[1:] + parts[:1], strict=True)) / 2,
        essential=[u.subs(x, 0) for u in parts],
    )  # fmt: skip
    with pytest.raises(ValueError, match=r"model: is symmetric, .*give system="):
        cra.export("python", tmp_path / "out", model=star)
    given = star.at({"m": 0.3, "T": 5.0, "k": 30.0, "L": 1.0})
    frozen = cra.export("python", tmp_path / "out", system=given, input=parts[0].subs(x, L), outputs=["u_0"])
    assert "system.py" in frozen.files
