"""The arm's characteristic function as numbers: derived kernels behind the interface of the generic solver."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache, cached_property
from importlib.resources import files
from typing import Any

import numpy as np

from cra_sym.kernels import Kernel, compiled, derived_kernel, has_compiler, is_compiled
from cra_sym.solvers.spectrum import Lanes, spectrum

__all__ = ["ArmCharacteristic", "flattened", "frequency_parameters", "pair"]

NEAR = 5.0  # characteristic.NEAR; a test holds the two together

_COEFFICIENTS, _DERIVATIVES, _POWER_SERIES, _BASIS, _BASIS_NEAR, _CHAIN = (
    derived_kernel(f"cra_sym.model.characteristic:{name}")
    for name in ("coefficients", "derivatives", "power_series", "basis", "basis_near", "chain")
)


def pair(value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return ``(value, 1) / (1 + value)``, which is (1, 0) for infinity."""
    complement = 1 / (1 + value)
    with np.errstate(invalid="ignore"):
        return np.where(np.isinf(value), 1.0, value / (1 + value)), complement


class ArmCharacteristic:
    """Characteristic functions of arms, one in each lane, for `cra_sym.solvers.spectrum`.

    Parameters
    ----------
    kappa_t, kappa_r, mu, iota : ndarray, shape (lanes,)
        Dimensionless stiffnesses in [0, inf] and inertias in [0, inf).
    """

    def __init__(self, kappa_t: np.ndarray, kappa_r: np.ndarray, mu: np.ndarray, iota: np.ndarray) -> None:
        self._parameters = np.array([x for value in (kappa_t, kappa_r, mu, iota) for x in pair(value)])
        self._coefficients = np.array(_COEFFICIENTS.function(*self._parameters))
        self.zeros = (kappa_t == 0).astype(np.int64) + (kappa_r == 0)

    @cached_property
    def _power_series(self) -> np.ndarray:
        """Coefficients of the power series in z with the zeros at z = 0 divided out, shape (terms, lanes)."""
        powers = np.array(_POWER_SERIES.function(*self._coefficients))
        for multiplicity in (1, 2):
            shifted = self.zeros >= multiplicity
            powers[:-1, shifted], powers[-1, shifted] = powers[1:, shifted], 0.0
        return powers

    def count(self, z: float | np.ndarray, lanes: Lanes) -> tuple[np.ndarray, np.ndarray]:
        """Return the exact number of zeros below z, rigid-body zeros included, and the scaled determinant."""
        lam, *basis = _basis(np.asarray(z, dtype=np.float64))
        both_pinned, sprung, massive, translating, rotating = _CHAIN.function(*self._parameters[:, lanes], z, *basis)
        number = np.floor(lam / np.pi).astype(np.int64)
        number = _with_parity(both_pinned, number, np.where(lam / np.pi - number < 0.5, -1, 1))
        number = _with_parity(sprung, number, -1)
        for value in (massive, translating, rotating):
            number = _with_parity(value, number, 1)
        return number, rotating

    def evaluate(self, z: np.ndarray, lanes: Lanes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the determinant and its derivatives by z, scaled; rigid-body zeros divided out for small z."""
        near = z < NEAR
        if not near.any():
            return self._evaluate_far(z, lanes)
        if near.all():
            return self._evaluate_near(z, lanes)
        lanes = np.arange(len(self.zeros))[lanes]
        result = np.empty((3, z.size))
        result[:, near] = self._evaluate_near(z[near], lanes[near])
        result[:, ~near] = self._evaluate_far(z[~near], lanes[~near])
        return result[0], result[1], result[2]

    def _evaluate_far(self, z: np.ndarray, lanes: Lanes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        _, *basis = _basis_far(z)
        value, first, second = _DERIVATIVES.function(*self._coefficients[:, lanes], z, *basis)
        return value, first / z, second / z**2

    def _evaluate_near(self, z: np.ndarray, lanes: Lanes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        powers = self._power_series[:, lanes]
        value, first, second = powers[-1], np.zeros_like(z), np.zeros_like(z)
        for power in powers[-2::-1]:
            second = second * z + first
            first = first * z + value
            value = value * z + power
        return value, first, 2 * second


def _with_parity(value: np.ndarray, number: np.ndarray, change: int | np.ndarray) -> np.ndarray:
    """Return the number, changed where the sign of the value is not that of ``(-1)**number``."""
    return np.where((value > 0) == (number % 2 == 0), number, number + change)


def _basis_far(z: np.ndarray) -> tuple[np.ndarray, ...]:
    lam = np.sqrt(np.sqrt(z))
    return lam, *_BASIS.function(lam, np.exp(-lam))


def _basis(z: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return lambda and the basis, scaled, for any z."""
    lam = np.sqrt(np.sqrt(z))
    near = _BASIS_NEAR.function(np.minimum(z, NEAR))
    return lam, *(np.where(z < NEAR, a, b) for a, b in zip(near, _BASIS.function(lam, np.exp(-lam)), strict=True))


# A root costs NumPy about 2 microseconds and compiled code 0.1; to load machine code, Numba included, takes as long as
# LOAD_FROM roots by NumPy, to make it as long as COMPILE_FROM. The benchmark of cold starts measures both.
LOAD_FROM = 400_000
"""Roots in one call from where on loading machine code costs less than it saves."""
COMPILE_FROM = 1_200_000
"""Roots in such calls of this process from where on making machine code costs less than going on without it."""
_ROOTS_PER_PART = 30_000  # that are worth handing out
_PARTS_PER_THREAD = 8  # so that a thread on a busy processor keeps nobody waiting
_BLOCK = 32_768  # points and roots whose temporaries stay in the processor's cache
_FEWEST = 256  # lanes in a block, below which a call of NumPy costs more than its work


def frequency_parameters(
    kappa_t: np.ndarray,
    kappa_r: np.ndarray,
    mu: np.ndarray,
    iota: np.ndarray,
    *,
    modes: int,
    compile: bool | None = None,
    threads: int | None = None,
) -> np.ndarray:
    """Return lambda of the first modes for checked arrays of one shape; the mode axis is last.

    Both paths take the same steps. The compiled one is taken where it saves more than loading it costs, unless
    ``compile`` says otherwise; ``threads`` are then as many as there are processors and work for.
    """
    shape = kappa_t.shape
    groups = flattened(kappa_t, kappa_r, mu, iota)
    result = np.empty((groups[0].size, modes))
    compile = wants_compiler(result.size, _template_parts) if compile is None else compile
    fill = _fill_compiled if compile else _fill

    def fill_part(part: slice) -> None:
        fill(result[part], *(x[part] for x in groups))

    in_parts(fill_part, len(result), modes, threads=threads, compiled=compile)
    return result.reshape(*shape, modes)


def flattened(*values: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return arrays of lanes, all contiguous and read-only: of one type, for which machine code is made once."""
    lanes = tuple(np.ascontiguousarray(value).reshape(-1).view() for value in values)
    for array in lanes:
        array.flags.writeable = False
    return lanes


def wants_compiler(roots: int, parts: Callable[[], tuple[str, dict[str, Kernel]]]) -> bool:
    """Return whether the compiled path of a template pays for a call: the policy of the package.

    Small calls never compile and never load. A call of `LOAD_FROM` roots takes machine code that is there. If there is
    none, it is made for a call of more than `COMPILE_FROM` roots, or as soon as such calls of this process have come to
    that number: nobody waits more than twice as long as whoever knew what comes next.
    """
    if roots < LOAD_FROM or not has_compiler():
        return False
    _done[parts] += roots
    return _done[parts] > COMPILE_FROM or is_compiled(*parts())


_done: Counter[Callable[[], Any]] = Counter()  # roots in large calls, by template


def in_parts(fill: Callable[[slice], Any], lanes: int, modes: int, *, threads: int | None, compiled: bool) -> None:
    """Call ``fill`` for all lanes, part by part: in threads if compiled, else in blocks that fit the cache."""
    threads = (threads or _processors()) if compiled else 1
    fair = -(-lanes // (threads if threads == 1 else _PARTS_PER_THREAD * threads))
    share = max(fair, _ROOTS_PER_PART // modes, 1) if compiled else max(_BLOCK // (modes + 4), _FEWEST)
    parts = [slice(start, min(start + share, lanes)) for start in range(0, lanes, share)]
    if threads == 1 or len(parts) <= 1:
        for part in parts:
            fill(part)
    else:
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(fill, parts))


def _processors() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _fill(result: np.ndarray, *groups: np.ndarray) -> None:
    """Fill in a part of the result, vectorised by NumPy."""
    result[...] = np.sqrt(np.sqrt(spectrum(ArmCharacteristic(*groups), result.shape[1])))


def _fill_compiled(result: np.ndarray, *groups: np.ndarray) -> int:
    """Fill in a part of the result; return the number of evaluations of the determinant."""
    evaluations = np.zeros(1, dtype=np.int64)
    if not _template().frequency_parameters(result, evaluations, *groups):
        raise ArithmeticError("a zero was not reached")
    return int(evaluations[0])


@cache
def _template() -> Any:
    return compiled(*_template_parts())


@cache
def _template_parts() -> tuple[str, dict[str, Kernel]]:
    text = files("cra_sym.solvers").joinpath("spectrum_lanes.py").read_text(encoding="utf-8")
    names = "coefficients", "power_series", "basis", "basis_near", "chain", "derivatives"
    kernels = _COEFFICIENTS, _POWER_SERIES, _BASIS, _BASIS_NEAR, _CHAIN, _DERIVATIVES
    return text, dict(zip(names, kernels, strict=True))
