"""A kernel on many lanes: one compiled loop, made once the calls of a kernel add up, and shared out among threads."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from itertools import pairwise, starmap
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.kernels.generated import Generated
from cra_sym.kernels.specialise import compiled, has_compiler

__all__ = ["COMPILE_FROM", "evaluated"]

COMPILE_FROM = 10_000
"""Lanes of a kernel, added up over the calls of this process, from where on it is compiled, or loaded from the store.

That takes about half a second, Numba's import included, so whoever evaluates less does without. Kernels of more than
`_SHORT` characters take longer, and are compiled later.
"""
_SHORT = 5000  # characters of source; beyond, the time of the compiler grows nearly with their square
_SPAN = 1 << 16  # lanes that are worth a thread

Array = NDArray[np.float64]


@dataclass
class _Loop:
    """The loop of a kernel over one pattern of arguments, each an array of lanes or a number."""

    outputs: int
    lanes: int = 0  # evaluated without it
    fill: Callable[..., int] | None = None
    possible: bool = True
    turn: Lock = field(default_factory=Lock)

    def wanted(self, kernel: Generated, along: Sequence[bool], size: int) -> Callable[..., int] | None:
        """Return the compiled function if there is one after a call of this size."""
        with self.turn:
            if self.fill is None and self.possible:
                self.lanes += size
                if kernel.backend == "numba" or self.lanes >= COMPILE_FROM * max(1, len(kernel.source) / _SHORT) ** 2:
                    self.fill = _compiled(kernel, along, self.outputs)
                    self.possible = self.fill is not None
        return self.fill


_loops: dict[tuple[str, tuple[bool, ...]], _Loop] = {}  # by digest and pattern: equal kernels share them


def evaluated(
    kernel: Generated,
    arrays: Sequence[np.ndarray],
    shape: tuple[int, ...],
    by_numpy: Callable[[Sequence[np.ndarray], tuple[int, ...]], list[np.ndarray]],
) -> list[np.ndarray]:
    """Return the outputs of the kernel, each of the given shape: by machine code once it pays, until then by NumPy.

    Lanes that come out as nan are evaluated again by NumPy, whose sine and cosine have no limit. A kernel that
    compares numbers could hide such a nan: it is compiled with the platform's functions.
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
        rest = [v[again] if isinstance(v, np.ndarray) else np.float64(v) for v in values]
        for result, value in zip(results, by_numpy(rest, again.shape), strict=True):
            result[again] = value
    return [result.reshape(shape) for result in results]


def _compiled(kernel: Generated, along: Sequence[bool], outputs: int) -> Callable[..., int] | None:
    """Return the loop in machine code, or None if there is no compiler for it."""
    complex_or_special = "1j" in kernel.source or "\nfrom scipy" in f"\n{kernel.source}"
    if not outputs or complex_or_special or not has_compiler():
        return None
    import numba

    template = _template(along, outputs, kernel.layout == ())
    fill: Callable[..., int] = compiled(template, {"evaluate": kernel}, elementary=_is_free(kernel)).fill
    none = np.empty(0)
    try:
        fill(*[none] * outputs, *(_in_a_row(none, (0,)) if lanes else 0.0 for lanes in along))  # compiles
    except numba.errors.NumbaError:
        return None
    return fill


def _is_free(kernel: Generated) -> bool:
    """Return whether a kernel compares no numbers, so that a nan on its way is a nan at its end."""
    return "where(" not in kernel.source


def _in_a_row(array: np.ndarray, shape: tuple[int, ...]) -> Array:
    """Return the lanes of an array, contiguous, aligned and read-only: of one type, compiled once."""
    if array.shape != shape:
        array = np.broadcast_to(array, shape)
    if not array.flags.aligned:
        array = array.copy()
    row = np.ascontiguousarray(array).reshape(-1)
    row.flags.writeable = False
    return row


def _in_threads(fill: Callable[..., int], results: Sequence[Array], values: Sequence[Array | float]) -> int:
    """Fill the results and return how many lanes hold a nan."""
    size = results[0].size
    if size < 2 * _SPAN:
        return fill(*results, *values)
    import numba

    def part(span: slice) -> int:
        return fill(*(r[span] for r in results), *(v[span] if isinstance(v, np.ndarray) else v for v in values))

    first, *others = _spans(size, numba.config.NUMBA_NUM_THREADS)  # type: ignore[attr-defined]
    if not others:
        return part(first)
    with ThreadPoolExecutor(len(others)) as pool:
        lost = pool.map(part, others)
        return part(first) + sum(lost)


def _spans(size: int, threads: int) -> list[slice]:
    parts = max(1, min(threads, size // _SPAN))
    edges = np.linspace(0, size, parts + 1).astype(int).tolist()
    return list(starmap(slice, pairwise(edges)))


def _leaves(layout: Any) -> int:
    """Return how many numbers a lane has."""
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
