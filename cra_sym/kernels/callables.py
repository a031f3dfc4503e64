"""Callables generated from SymPy expressions, evaluated on arrays."""

from __future__ import annotations

import hashlib
import linecache
import math
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from itertools import count
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from cra_sym.cached import cached_property
from cra_sym.checks import choice, common_shape, shown
from cra_sym.kernels import lanes

if TYPE_CHECKING:
    from sympy import Expr, MatrixBase, Symbol

    Expressions: TypeAlias = "Expr | MatrixBase | float | Sequence[Expressions] | Mapping[Hashable, Expressions]"

__all__ = ["Kernel", "executed", "kernel"]

_BLOCK = 8192  # elements whose temporaries stay in the processor's second-level cache
_BACKENDS = ("numpy", "compiled")  # and None


def executed(text: str, filename: str) -> dict[str, Any]:
    """Return the names of a generated module; errors in it show its lines."""
    linecache.cache[filename] = (len(text), None, text.splitlines(True), filename)
    namespace: dict[str, Any] = {}
    exec(compile(text, filename, "exec"), namespace)
    return namespace


class Kernel:
    """A function of broadcasting arrays, generated from a SymPy expression.

    It is defined by its source: two kernels with the same source, arguments and backend are equal, and a pickled kernel
    is rebuilt from these three without SymPy. Arithmetic is that of IEEE 754 without warnings: 1/0 is inf.

    Parameters
    ----------
    source : str
        Module text made by :func:`kernel`.
    arguments : tuple of str
        Names of the arguments in calling order.
    backend : {None, 'numpy', 'compiled'}
        Backend of the evaluation; None selects it by size.
    """

    def __init__(self, source: str, arguments: tuple[str, ...], backend: str | None = None) -> None:
        if backend is not None:
            choice("backend", backend, _BACKENDS)
        self._source, self._arguments, self.backend = source, tuple(arguments), backend

    @property
    def source(self) -> str:
        """The generated module text."""
        return self._source

    @property
    def arguments(self) -> tuple[str, ...]:
        """Names of the arguments in calling order."""
        return self._arguments

    @cached_property
    def digest(self) -> str:
        """SHA-256 of source, arguments and backend."""
        return hashlib.sha256(repr((self.source, self.arguments, self.backend)).encode()).hexdigest()

    @cached_property
    def _module(self) -> dict[str, Any]:
        return executed(self.source, f"<cra_sym kernel {self.digest[:16]}>")

    @cached_property
    def _is_complex(self) -> bool:
        return "1j" in self.source

    @property
    def function(self) -> Callable[..., Any]:
        """The generated function, without checks or broadcasting, for any objects that support the arithmetic."""
        function: Callable[..., Any] = self._module["evaluate"]
        return function

    @property
    def layout(self) -> Any:
        """Structure of the outputs: () one number, (2, 2) a matrix, a list or dict of such."""
        return self._module["LAYOUT"]

    def __call__(self, *values: Any) -> Any:
        """Evaluate for real or complex numbers or arrays that broadcast together.

        Returns
        -------
        float, ndarray, tuple or dict
            With the structure of the expression; arrays have the common shape of the values, a matrix has its axes
            last.

        Raises
        ------
        TypeError
            If the number of values is wrong or a value is not numeric.
        ValueError
            If the shapes do not broadcast together.
        """
        if len(values) != len(self.arguments):
            wanted = ", ".join(self.arguments)
            raise TypeError(f"{len(values)} values given, {len(self.arguments)} expected: ({wanted})")
        arrays = [_numeric(name, value) for name, value in zip(self.arguments, values, strict=True)]
        shape = common_shape(self.arguments, arrays)
        return _arranged(self.layout, lanes.evaluated(self, arrays, shape, self._by_numpy), count(), shape)

    def _by_numpy(self, arrays: Sequence[np.ndarray], shape: tuple[int, ...]) -> lanes.Outputs:
        with np.errstate(all="ignore"):
            if math.prod(shape) > _BLOCK and all(a.shape == shape or a.ndim == 0 for a in arrays):
                return _in_blocks(self.function, arrays, shape)
            values = _tuple(self.function(*arrays))
            if self._is_complex or any(a.dtype != np.float64 for a in arrays):
                return [_filled(value, shape) for value in values]
            rows = np.empty((len(values), *shape))  # one array for all takes a fraction of the time
            for row, value in enumerate(values):
                rows[row] = value
            return rows

    def __reduce__(self) -> tuple[Any, ...]:
        return Kernel, (self.source, self.arguments, self.backend)

    def __eq__(self, other: object) -> bool:
        return self.digest == other.digest if isinstance(other, Kernel) else NotImplemented

    def __hash__(self) -> int:
        return hash(self.digest)

    def __repr__(self) -> str:
        return f"<Kernel ({', '.join(self.arguments)}) {self.digest[:12]}>"


def kernel(expression: Expressions, arguments: Iterable[Symbol], *, backend: str | None = None) -> Kernel:
    """Turn a SymPy expression into a fast, picklable function of broadcasting arrays.

    Parameters
    ----------
    expression : Expr, Matrix, sequence or dict of them
        Evaluated without expansion or simplification; common subexpressions are shared.
    arguments : sequence of Symbol
        Every free symbol of the expression, in calling order; further symbols only take part in broadcasting.
    backend : {None, 'numpy', 'compiled'}
        None starts with NumPy. If llvmlite is there, machine code is compiled, or loaded from the user's cache, once
        the calls of this process add up to 10 000 lanes, i.e. elements of the common shape; for sources of more than
        5000 characters that number grows with the square of their length. Calls add up over equal kernels, separately
        for each pattern of arrays and numbers among the arguments. NumPy is kept where machine code is not faster,
        and for complex values: powers other than integer ones and square roots, inverse and special functions,
        Mod, and elementary functions in expressions with conditions. 'compiled' compiles at once, these too.

    Returns
    -------
    Kernel

    Raises
    ------
    TypeError
        If an argument is not a symbol.
    ValueError
        If a free symbol is missing among the arguments, an argument comes twice, or the expression holds what NumPy
        cannot evaluate.

    Notes
    -----
    The two backends take the same steps but round differently. NumPy's elementary functions are within 2 units in the
    last
    place of the exact value for their argument. So are those of machine code, but for tan and tanh, which are within 4.
    Hence they differ by at most 4 units in each elementary function, and by at most 6 in these two. A sum of products
    may be rounded once instead of twice (fused multiply-add). Both give the same infinities and nan, except at the
    limit of overflow; the sign of a zero that comes out of Max, Min, Mod or sign may differ.
    Machine code for one pattern of arguments gives a lane the same value whatever the number of lanes and threads.

    Examples
    --------
    >>> from sympy import cos, symbols
    >>> x, a = symbols("x a")
    >>> f = kernel(a * cos(x) ** 2, (x, a))
    >>> float(f(0.0, 3))
    3.0
    >>> f([[0.0], [1.0]], [1, 2, 3]).shape
    (2, 3)
    """
    from cra_sym.kernels.source import check_arguments, module_source  # SymPy is loaded here, not at import

    symbols = check_arguments(arguments)
    try:
        source = module_source(expression, symbols)
    except RecursionError:
        raise ValueError("expression: it has too many levels, or is part of itself") from None
    return Kernel(source, tuple(s.name for s in symbols), backend)


def _numeric(name: str, value: Any) -> np.ndarray:
    try:
        array = np.asarray(value)
    except Exception:  # a conversion to an array may raise anything
        raise TypeError(f"{name} = {shown(value)}: must be real or complex numbers") from None
    if array.dtype == np.float64 and type(value) in (np.ndarray, float):
        return array
    if array.dtype.kind not in "iufc" or np.ma.is_masked(value):
        raise TypeError(f"{name} = {shown(value)}: must be real or complex numbers")
    return array.astype(np.result_type(array.dtype, np.float64), copy=False)


def _tuple(result: Any) -> tuple[Any, ...]:
    return result if isinstance(result, tuple) else (result,)


def _filled(value: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Return an array with its own memory, also for a constant or an output that is one of the inputs."""
    output = np.empty(shape, np.result_type(value, np.float64))
    output[...] = value
    return output


def _in_blocks(function: Callable[..., Any], arrays: Sequence[np.ndarray], shape: tuple[int, ...]) -> list[np.ndarray]:
    """Evaluate in blocks, so that temporaries fit in the cache."""
    size = math.prod(shape)
    flat = [a.reshape(-1) if a.ndim else a for a in arrays]
    outputs: list[np.ndarray] = []
    for start in range(0, size, _BLOCK):
        block = slice(start, start + _BLOCK)
        results = _tuple(function(*(a[block] if a.ndim else a for a in flat)))
        outputs = outputs or [np.empty(size, np.result_type(result, np.float64)) for result in results]
        for output, result in zip(outputs, results, strict=True):
            output[block] = result
    return [output.reshape(shape) for output in outputs]


def _arranged(layout: Any, values: lanes.Outputs, place: Iterator[int], shape: tuple[int, ...]) -> Any:
    if isinstance(layout, dict):
        return {name: _arranged(part, values, place, shape) for name, part in layout.items()}
    if isinstance(layout, list):
        return tuple(_arranged(part, values, place, shape) for part in layout)
    if layout == ():
        return values[next(place)][()]
    entries = [next(place) for _ in range(math.prod(layout))]
    if not entries:
        return np.empty(shape + layout)
    part = values[entries[0] : entries[-1] + 1]
    if isinstance(part, np.ndarray):
        return np.ascontiguousarray(np.moveaxis(part, 0, -1)).reshape(shape + layout)
    return np.stack(part, axis=-1).reshape(shape + layout)
