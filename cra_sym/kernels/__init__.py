"""Compiler from SymPy expressions to fast, picklable, broadcasting functions: by NumPy, or machine code."""

from cra_sym.kernels.callables import Kernel, kernel
from cra_sym.kernels.derived import derived_kernel
from cra_sym.kernels.specialise import compiled, has_compiler, is_compiled
from cra_sym.kernels.templates import template

__all__ = ["Kernel", "compiled", "derived_kernel", "has_compiler", "is_compiled", "kernel", "template"]
