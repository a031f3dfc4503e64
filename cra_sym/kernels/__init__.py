"""The compiler: SymPy expression to fast, picklable, broadcasting NumPy or Numba function."""

from cra_sym.kernels.callables import Kernel, kernel
from cra_sym.kernels.derived import derived_kernel

__all__ = ["Kernel", "derived_kernel", "kernel"]
