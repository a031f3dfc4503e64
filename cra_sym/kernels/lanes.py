"""A kernel on large arrays: one compiled loop over lanes, shared out among threads."""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise, starmap

import numpy as np

from cra_sym.kernels.generated import Generated
from cra_sym.kernels.specialise import compiled, has_compiler

__all__ = ["COMPILE_FROM", "evaluated", "suits"]

COMPILE_FROM = 1 << 22  # lanes in one call from where on loading or compiling machine code costs less than it saves
_SPAN = 1 << 16  # lanes that are worth a thread


def suits(kernel: Generated, arrays: Sequence[np.ndarray], size: int) -> bool:
    """Return whether the compiled path is wanted, possible, and meant for these values."""
    if kernel.backend == "numpy" or (kernel.backend is None and size < COMPILE_FROM):
        return False
    real = all(a.dtype == np.float64 for a in arrays) and "1j" not in kernel.source
    return real and size > 0 and "\nfrom scipy" not in f"\n{kernel.source}" and has_compiler()


def evaluated(
    kernel: Generated, arrays: Sequence[np.ndarray], shape: tuple[int, ...], outputs: int
) -> list[np.ndarray] | None:
    """Return the outputs of the kernel, each of the given shape, or None if Numba cannot compile it.

    Lanes that come out as nan are evaluated again by NumPy, whose sine and cosine have no limit. A kernel that
    compares numbers could hide such a nan: it is compiled with the platform's functions.
    """
    import numba

    arrays = [a if a.ndim == 0 else np.ascontiguousarray(np.broadcast_to(a, shape)).reshape(-1) for a in arrays]
    results = [np.empty(math.prod(shape)) for _ in range(outputs)]
    free = "where(" not in kernel.source
    template = _template([a.ndim == 1 for a in arrays], outputs, kernel.layout == ())
    fill = compiled(template, {"evaluate": kernel}, elementary=free).fill

    def part(span: slice) -> int:
        return fill(*(r[span] for r in results), *(a[span] if a.ndim else float(a) for a in arrays))

    try:
        part(slice(0))  # compiles
    except numba.errors.NumbaError:
        return None
    spans = _spans(results[0].size, numba.config.NUMBA_NUM_THREADS)  # type: ignore[attr-defined]
    with ThreadPoolExecutor(len(spans)) as pool:
        lost = sum(pool.map(part, spans))
    if lost and free:
        again = np.flatnonzero(np.any([np.isnan(r) for r in results], axis=0))
        values = kernel.function(*(a[again] if a.ndim else a for a in arrays))
        for result, value in zip(results, values if isinstance(values, tuple) else (values,), strict=True):
            result[again] = value
    return [result.reshape(shape) for result in results]


def _spans(size: int, threads: int) -> list[slice]:
    parts = max(1, min(threads, size // _SPAN))
    edges = np.linspace(0, size, parts + 1).astype(int).tolist()
    return list(starmap(slice, pairwise(edges)))


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
