"""The compiler: SymPy expression to fast, picklable, broadcasting NumPy or Numba function."""
