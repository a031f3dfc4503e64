"""Rates of the roots of uniform problems by the coefficients of their determinant, by one sweep backwards through it.

On the root ``F(k, z) = 0`` the rates are ``dz/dk = -(dF/dk) / (dF/dz)``. All derivatives together take a few times as
long as F itself (reverse mode; Griewank and Walther, Evaluating Derivatives, 2008, chapter 3), whatever their number. A
positive factor of F, such as the exponentials over which its columns are, has no effect there and is taken as constant.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from importlib.resources import files
from typing import Any

import numpy as np

from . import waves_kernel
from .straight import Term, straight, wanted_lines
from .waves_count import Determinant, Functions, determinant_of, kinds, regime_formula, wave_texts
from .waves_problem import Floats
from .waves_structure import Structure

__all__ = ["Slopes", "compiled_root_rates", "evaluated", "rate_template", "root_rates", "slope_formulas"]

kernel: Any = waves_kernel  # formulas of arrays and terms, without types

_BLOCK = 2048  # roots whose intermediate results stay in the processor's cache
_BINARY = re.compile(r"(\S+) ([-+*/]|[<>=!]=?|[&|]) (\S+)")
_CALL = re.compile(r"(?:np\.)?(\w+)\((.*)\)")
_WAVES = {"_wave", "_rising", "_turning"}
_LARGEST = 1e-11  # relative error of a root, from the size of F there, beyond which rates are left to other methods


def slope_formulas(structure: Structure, known: Sequence[int | None]) -> str:
    """Return the text of ``_slopes_kind(k, i, z)`` for each regime: F, dF/dz and dF/dk for the varying k."""
    texts = wave_texts()
    for kind in kinds(structure):
        slopes = partial(_with_slopes, partial(determinant_of, structure, kind))
        texts.append(straight(f"_slopes_{kind}", slopes, ["z"], known))
    return "\n\n\n".join(texts) + "\n"


def rate_template(structure: Structure, known: Sequence[int | None]) -> str:
    """Return the text of the compiled version of `root_rates`: the formulas, and the loops over blocks of lanes."""
    loops = files("cra_sym.solvers").joinpath("waves_rates_lanes.py").read_text(encoding="utf-8")
    texts, choice = [loops, slope_formulas(structure, known)], ["def _rates_in(found, k, z, kind, size):"]
    names = [f"s{at}" for at in range(2 + sum(value is None for value in known))]
    for at, kind in enumerate(kinds(structure)):
        lines = [f"def _rates_{kind}(found, k, z, size):", "    for i in range(size):"]
        lines.append(f"        {', '.join(names)} = _slopes_{kind}(k, i, z[i])")
        lines.append(f"        scale = -1.0 / s1 if abs(s0) <= {_LARGEST} * abs(s1 * z[i]) else np.nan")
        lines += [f"        found[{entry}, i] = {name} * scale" for entry, name in enumerate(names[2:])]
        texts.append("\n".join(lines))
        choice += [f"    if kind == {at}:", f"        _rates_{kind}(found, k, z, size)"]
    called = tuple(f"_rates_{kind}" for kind in kinds(structure))
    constants = f"_KINDS = {len(called)}\n_CALLED = {called}"
    return "\n\n\n".join([*texts, regime_formula(structure, known), "\n".join(choice), constants]) + "\n"


def _with_slopes(function: Callable[[Any, Any], Any], k: Sequence[Any], z: Any) -> list[Any]:
    """Return the value of a function of terms, and its derivatives by z and by the entries that are terms."""
    value = function(k, z)
    lines = z.lines
    slopes: dict[str, Any] = {value.name: 1.0}
    for names, text in reversed(wanted_lines(lines, [value.name])):
        given = [slopes.get(name, 0.0) for name in names]
        if any(isinstance(slope, Term) or slope for slope in given):
            results = [Term(name, lines) for name in names]
            for operand, slope in _backwards(text, results, given, lines):
                if isinstance(operand, Term):
                    known = slopes.get(operand.name)
                    slopes[operand.name] = slope if known is None else known + slope
    return [value, *(slopes.get(entry.name, 0.0) for entry in (z, *k) if isinstance(entry, Term))]


def _backwards(
    text: str, results: Sequence[Any], slopes: list[Any], lines: dict[str, str]
) -> Iterator[tuple[Any, Any]]:
    """Yield operands of a line, with the derivative of the whole through this line alone."""

    def read(word: str) -> Any:
        return Term(word, lines) if word[0] in "tz" else float(word)

    (result, *_), (slope, *_) = results, slopes
    binary, call = _BINARY.fullmatch(text), _CALL.fullmatch(text)
    if binary:
        first, sign, second = binary.groups()
        yield from _of_operator(sign, read(first), read(second), result, slope)
    elif call:
        name, words = call.groups()
        if name in _WAVES:
            yield _of_wave(read(words.split(", ")[-1]), results, slopes)
        else:
            yield from _of_function(name, [read(word) for word in words.split(", ")], result, slope)
    elif text.startswith("-"):
        yield read(text[1:]), -slope
    elif not text.startswith("k["):
        raise AssertionError(text)


def _of_operator(sign: str, first: Any, second: Any, result: Any, slope: Any) -> Iterator[tuple[Any, Any]]:
    if sign in "+-":
        yield first, slope
        yield second, slope if sign == "+" else -slope
    elif sign == "*":
        yield first, slope * second
        yield second, slope * first
    elif sign == "/":
        share = slope / second
        yield first, share
        yield second, -(share * result)


def _of_function(name: str, given: list[Any], result: Any, slope: Any) -> Iterator[tuple[Any, Any]]:
    where = kernel.where
    if name == "where":
        yield given[1], where(given[0], slope, 0.0)
        yield given[2], where(given[0], 0.0, slope)
    elif name == "abs":
        yield given[0], where(given[0] < 0.0, -slope, slope)
    elif name == "sqrt":
        positive = result > 0.0
        yield given[0], where(positive, 0.5 * slope / where(positive, result, 1.0), 0.0)
    elif name == "exp":
        yield given[0], slope * result
    elif name == "log":
        yield given[0], slope / given[0]
    else:
        raise AssertionError(name)


def _of_wave(m: Any, results: Sequence[Any], slopes: list[Any]) -> tuple[Any, Any]:
    """Return the slope by m of ``C = cosh(sqrt m)`` and ``S = sinh(sqrt m) / sqrt(m)``, both over a constant."""
    c, s = results
    small = (m < 0.25) & (m > -0.25)
    series, rate = kernel.small_sinh_with_rate(m)
    of_s = kernel.where(small, s * rate / series, 0.5 * (c - s) / kernel.where(small, 1.0, m))
    return m, 0.5 * s * slopes[0] + of_s * slopes[1]


Slopes = Callable[[str, Floats, Floats], Floats]
"""Returns F, dF/dz and dF/dk, one a row, from the name of the regime, k and z of some roots."""


def evaluated(functions: Functions) -> Slopes:
    """Return the slopes by the functions that the text of `slope_formulas` defines."""

    def slopes(kind: str, k: Floats, z: Floats) -> Floats:
        out = np.empty((2 + len(k), z.size))
        for row, value in zip(out, functions[f"_slopes_{kind}"](k, slice(None), z), strict=True):
            row[:] = value
        return out

    return slopes


@np.errstate(all="ignore")
def root_rates(function: Determinant, slopes: Slopes, z: Floats) -> Floats:
    """Return dz/dk of simple roots, shape (varying coefficients, modes, rows); nan where rounding would spoil them.

    Parameters
    ----------
    function : Determinant
    slopes : callable
    z : ndarray, shape (modes, rows)
        Positive roots as `lowest_waves` gives them.
    """
    roots, row = z.ravel(), np.tile(np.arange(z.shape[1]), len(z))
    found = np.empty((len(function.k), roots.size))
    for start in range(0, roots.size, _BLOCK):
        part = slice(start, start + _BLOCK)
        k, at, rates = function.k[:, row[part]], roots[part], found[:, part]
        for kind, members in function.take(row[part]).regimes(at):
            value, by_z, *_ = out = slopes(kind, k[:, members], at[members])
            sound = np.abs(value) <= _LARGEST * np.abs(by_z * at[members])
            rates[:, members] = out[2:] * np.where(sound, -1.0 / by_z, np.nan)
    return found.reshape(-1, *z.shape)


def compiled_root_rates(rates: Callable[..., None], function: Determinant, z: Floats) -> Floats:
    """Return the result of `root_rates` by the compiled entry of `rate_template`."""
    found = np.empty((len(function.k), *z.shape))
    rates(found, function.k, np.ascontiguousarray(z))
    return found
