"""Division of the work on large batches: blocks for NumPy, threads for machine code, and the choice between them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from cra_sym.kernels.callables import Kernel
from cra_sym.kernels.lanes import processors
from cra_sym.kernels.specialise import has_compiler, is_compiled

__all__ = ["COMPILE_FROM", "LOAD_FROM", "Parts", "flattened", "in_parts", "wants_compiler"]

# A root takes about 2 microseconds with NumPy and 0.1 compiled. Loading machine code takes about as long as LOAD_FROM
# roots by NumPy, compiling it as long as COMPILE_FROM. The benchmark of cold starts measures both.
LOAD_FROM = 40_000
"""Number of roots in one call from which on loading machine code pays."""
COMPILE_FROM = 500_000
"""Number of roots in such calls of this process from which on compiling pays."""
_ROOTS_PER_PART = 30_000  # least number of roots per thread
_PARTS_PER_THREAD = 8  # parts per thread, so that a slow thread does not delay the others
_BLOCK = 32_768  # points and roots whose temporaries fit in the processor's cache
_FEWEST = 256  # lanes in a block, below which a call of NumPy costs more than its work

Parts = Callable[[], tuple[str, Mapping[str, Kernel]]]
_done: Counter[Parts] = Counter()  # roots in large calls, by template


def flattened(*values: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return arrays of lanes, all contiguous and read-only, so that machine code is compiled for one type."""
    lanes = tuple(np.ascontiguousarray(value).reshape(-1).view() for value in values)
    for array in lanes:
        array.flags.writeable = False
    return lanes


def wants_compiler(roots: int, parts: Parts) -> bool:
    """Return whether the compiled path of a template pays for a call: the policy of the package.

    Small calls neither compile nor load. A call of `LOAD_FROM` roots uses machine code that exists already. Otherwise
    it is compiled for a call of more than `COMPILE_FROM` roots, or once such calls of this process add up to that
    number. The total time is thus at most twice the optimum (competitive ratio 2).
    """
    if roots < LOAD_FROM or not has_compiler():
        return False
    _done[parts] += roots
    return _done[parts] > COMPILE_FROM or is_compiled(*parts())


def in_parts(fill: Callable[[slice], Any], lanes: int, modes: int, *, threads: int | None, compiled: bool) -> None:
    """Call ``fill`` for all lanes, part by part: in threads if compiled, else in blocks that fit the cache."""
    threads = (threads or processors()) if compiled else 1
    fair = -(-lanes // (threads if threads == 1 else _PARTS_PER_THREAD * threads))
    share = max(fair, _ROOTS_PER_PART // modes, 1) if compiled else max(_BLOCK // (modes + 4), _FEWEST)
    parts = [slice(start, min(start + share, lanes)) for start in range(0, lanes, share)]
    if threads == 1 or len(parts) <= 1:
        for part in parts:
            fill(part)
    else:
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(fill, parts))
