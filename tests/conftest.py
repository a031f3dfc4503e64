"""Settings shared by every test; read before NumPy is imported, so the libraries' thread pools see them."""

import os

for pool in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(pool, "1")  # the test workers share the cores already; a pool each only gets in the way
os.environ.setdefault("MPLBACKEND", "agg")
