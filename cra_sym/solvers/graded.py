"""Singular values of matrices whose columns differ in size by any factor, as soft springs make them differ."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgejsv

__all__ = ["graded"]

Array = NDArray[np.float64]
_RANK = 1e-13
"""Singular value of columns of the same length, relative to the largest, below which it is rounding."""
_COLUMNS, _NO_VECTORS = 0, 3  # LAPACK's JOBA = 'C', for columns of any length, and JOBU = 'N'


def graded(matrices: Array) -> tuple[Array, Array]:
    """Return the singular values, descending, and the right singular vectors of matrices, each to its last digits.

    Jacobi's method gives the smallest ones as accurately as the columns, scaled to the same length, determine them.
    Those beyond the rank of these columns are set to zero.

    Parameters
    ----------
    matrices : ndarray, shape (sets, rows, columns)
        Columns whose lengths have ratios of up to 1e150.

    Returns
    -------
    values : ndarray, shape (sets, columns)
    vectors : ndarray, shape (sets, columns, columns)
        One in each row.

    Raises
    ------
    ArithmeticError
        If the method does not converge.

    References
    ----------
    Z. Drmac and K. Veselic, New fast and accurate Jacobi SVD algorithm, SIAM J. Matrix Anal. Appl. 29 (2008).

    Examples
    --------
    >>> import numpy as np
    >>> size = np.array([1e-140, 1.0])
    >>> values, _ = graded(np.array([[[1.0, 1.0], [1.0, -1.0], [0.0, 0.0]]]) * size)
    >>> values / np.sqrt(2.0)
    array([[1.e+000, 1.e-140]])
    """
    sets, rows, number = matrices.shape
    matrices = np.pad(matrices, ((0, 0), (0, max(0, number - rows)), (0, 0)))
    values, vectors = np.zeros((sets, number)), np.zeros((sets, number, number))
    for k, matrix in enumerate(matrices):
        scaled, _, adjoint, work, _, info = dgejsv(matrix, joba=_COLUMNS, jobu=_NO_VECTORS)
        if info:
            raise ArithmeticError("values: singular values do not converge; they lie too far apart")
        values[k], vectors[k] = scaled * (work[0] / work[1]), adjoint.T
        length = np.sqrt((matrix**2).sum(axis=0))
        alike = np.linalg.svd(matrix / np.where(length > 0.0, length, 1.0), compute_uv=False)
        values[k, (alike > _RANK * alike[0]).sum() :] = 0.0
    return values, vectors
