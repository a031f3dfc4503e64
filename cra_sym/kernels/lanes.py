"""Kernels on many lanes: a loop that is compiled once the kernel has been called enough, and runs in threads."""

from __future__ import annotations

import math
import os
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from threading import Lock
from time import perf_counter
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from cra_sym.kernels.generated import CompileError, Generated
from cra_sym.kernels.specialise import compiled, has_compiler

__all__ = ["COMPILE_FROM", "evaluated", "processors"]

COMPILE_FROM = 10_000
"""Total number of lanes over the calls of this process from which on a kernel is compiled, or loaded from the cache.

Compilation takes about a tenth of a second. Kernels of more than `_SHORT` characters take longer, and are compiled
later.
"""
_SHORT = 5000  # characters of source; beyond, the time of the compiler grows nearly with their square
_SPAN = 1 << 16  # lanes per task of a thread
_WORTH = 1e-3  # seconds of work for each of the threads, which cost a tenth of it to start
_INLINE = {"ceil", "floor", "maximum", "minimum", "nan", "sign", "sqrt", "where"}  # functions with machine instructions
_BRANCH_FREE = {"cos", "cosh", "exp", "log", "sin", "sinh", "tan", "tanh"}  # of `cra_sym.kernels.elementary`

Array = NDArray[np.float64]


@dataclass
class _Loop:
    """The loop of a kernel over one pattern of arguments, each an array of lanes or a number."""

    outputs: int
    lanes: int = 0  # lanes evaluated without it so far
    fill: Callable[..., int] | None = None
    possible: bool = True
    turn: Lock = field(default_factory=Lock)

    def wanted(self, kernel: Generated, along: Sequence[bool], size: int) -> Callable[..., int] | None:
        """Return the compiled function, if a call of this size makes it available."""
        with self.turn:
            if self.fill is None and self.possible:
                self.lanes += size
                if (
                    kernel.backend == "compiled"
                    or self.lanes >= COMPILE_FROM * max(1, len(kernel.source) / _SHORT) ** 2
                ):
                    self.fill = _compiled(kernel, along, self.outputs)
                    self.possible = self.fill is not None
        return self.fill


_loops: dict[tuple[str, tuple[bool, ...]], _Loop] = {}  # by digest and pattern, shared by equal kernels


Outputs: TypeAlias = Sequence[np.ndarray] | np.ndarray
"""The outputs of a kernel, each of the shape of the call."""


def evaluated(
    kernel: Generated,
    arrays: Sequence[np.ndarray],
    shape: tuple[int, ...],
    by_numpy: Callable[[Sequence[np.ndarray], tuple[int, ...]], Outputs],
) -> Outputs:
    """Return the outputs of the kernel, each of the given shape: by machine code once it pays, until then by NumPy.

    Lanes with a result nan are evaluated again by NumPy, whose sine and cosine have no limit of the argument. A kernel
    with comparisons could hide such a nan and is compiled with the platform's functions.
    """
    size = math.prod(shape)
    if kernel.backend == "numpy" or not size or any(a.dtype != np.float64 for a in arrays):
        return by_numpy(arrays, shape)
    along = tuple(a.ndim > 0 for a in arrays)
    loop = _loops.get((kernel.digest, along))
    if loop is None:
        loop = _loops.setdefault((kernel.digest, along), _Loop(_leaves(kernel.layout)))
    fill = loop.fill or loop.wanted(kernel, along, size)
    if fill is None:
        return by_numpy(arrays, shape)
    values = [_in_a_row(a, shape) if a.ndim else float(a) for a in arrays]
    results = [np.empty(size) for _ in range(loop.outputs)]
    if _in_threads(fill, results, values) and _is_free(kernel):
        again = np.flatnonzero(np.any([np.isnan(r) for r in results], axis=0))
        rest = [v[again] if isinstance(v, np.ndarray) else np.asarray(v) for v in values]
        for result, value in zip(results, by_numpy(rest, again.shape), strict=True):
            result[again] = value
    return [result.reshape(shape) for result in results]


def _compiled(kernel: Generated, along: Sequence[bool], outputs: int) -> Callable[..., int] | None:
    """Return the loop in machine code, or None if there is no compiler, or no gain and it is not requested."""
    complex_or_special = "1j" in kernel.source or "\nfrom scipy" in f"\n{kernel.source}"
    if (
        not outputs
        or complex_or_special
        or not (kernel.backend == "compiled" or _is_quick(kernel))
        or not has_compiler()
    ):
        return None
    template = _template(along, outputs, kernel.layout == ())
    fill: Callable[..., int] = compiled(template, {"evaluate": kernel}, elementary=_is_free(kernel)).fill
    none = np.empty(0)
    try:
        fill(*[none] * outputs, *(_in_a_row(none, (0,)) if lanes else 0.0 for lanes in along))  # compiles
    except CompileError:
        return None
    return fill


def _is_quick(kernel: Generated) -> bool:
    """Return whether all functions of a kernel become SIMD code, unlike the platform's functions of one number."""
    head, _, body = kernel.source.partition("\ndef evaluate(")
    lines = [line.removeprefix("from numpy import ") for line in head.splitlines() if line.startswith("from numpy ")]
    names = {name for line in lines for name in line.split(", ")}
    wanted = _INLINE | _BRANCH_FREE if _is_free(kernel) else _INLINE
    return names <= wanted and "**" not in body and "%" not in body


def _is_free(kernel: Generated) -> bool:
    """Return whether a kernel has no comparisons, so that an intermediate nan propagates to the result."""
    return "where(" not in kernel.source


def _in_a_row(array: np.ndarray, shape: tuple[int, ...]) -> Array:
    """Return the lanes of an array, contiguous, aligned and read-only, so that only one type is compiled."""
    if array.shape != shape:
        array = np.broadcast_to(array, shape)
    if not array.flags.aligned:
        array = array.copy()
    row = np.ascontiguousarray(array).reshape(-1)
    row.flags.writeable = False
    return row


def _in_threads(fill: Callable[..., int], results: Sequence[Array], values: Sequence[Array | float]) -> int:
    """Fill the results and return the number of lanes with nan; threads are used if the first part is slow."""
    size = results[0].size
    if size <= _SPAN:
        return fill(*results, *values)
    left = deque(slice(start, start + _SPAN) for start in range(0, size, _SPAN))

    def part() -> int:
        span = left.popleft()
        return fill(*(r[span] for r in results), *(v[span] if isinstance(v, np.ndarray) else v for v in values))

    def rest() -> int:
        lost = 0
        with suppress(IndexError):  # nothing is left
            while True:
                lost += part()
        return lost

    start = perf_counter()
    lost = part()
    worth = int((perf_counter() - start) * len(left) / _WORTH)
    others = min(worth, len(left), processors()) - 1
    if others < 1:
        return lost + rest()
    with ThreadPoolExecutor(others) as pool:
        helping = [pool.submit(rest) for _ in range(others)]
        return lost + rest() + sum(helper.result() for helper in helping)


def processors() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _leaves(layout: Any) -> int:
    """Return the number of outputs per lane."""
    if isinstance(layout, (dict, list)):
        return sum(map(_leaves, layout.values() if isinstance(layout, dict) else layout))
    return math.prod(layout)


def _template(along: Sequence[bool], outputs: int, single: bool) -> str:
    """Return the loop for one pattern of arguments, each an array of lanes or a number."""
    arguments = [f"a{k}" for k in range(len(along))]
    results = [f"r{k}" for k in range(outputs)]
    values = [f"v{k}" for k in range(outputs)]
    given = ", ".join(f"{name}[lane]" if lanes else name for name, lanes in zip(arguments, along, strict=True))
    lines = [
        f"{', '.join(values)}{'' if single else ','} = evaluate({given})",
        *(f"{result}[lane] = {value}" for result, value in zip(results, values, strict=True)),
        f"lost += {' | '.join(f'({value} != {value})' for value in values)}",
    ]
    loop = "".join(f"        {line}\n" for line in lines)
    head = f"def fill({', '.join(results + arguments)}):\n    lost = 0\n    for lane in range(r0.size):\n"
    return f"{head}{loop}    return lost\n"
