"""All roots of small systems of polynomials, by elimination: the null space of Macaulay's matrix.

Stetter's eigenvalue method: the monomials at the roots span that null space, and a shift by one degree acts on it as a
matrix whose eigenvalues are values of a linear form at the roots. Roots at infinity are separated by the degrees at
which the rank of the rows of the null space stops growing (Dreesen, Batselier and De Moor, 2012).
"""

from __future__ import annotations

import itertools
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

__all__ = ["monomials_up_to", "polynomial_roots"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
_RANK = 1e-9
_MOST_COLUMNS = 800


@cache
def monomials_up_to(variables: int, degree: int) -> tuple[tuple[int, ...], ...]:
    """Return the exponents of all monomials, lower degrees first."""
    found = (e for e in itertools.product(range(degree + 1), repeat=variables) if sum(e) <= degree)
    return tuple(sorted(found, key=lambda e: (sum(e), e)))


def polynomial_roots(coefficients: Array, degree: int) -> Complex:
    """Return all finite roots of as many polynomials as variables.

    Parameters
    ----------
    coefficients : ndarray, shape (variables, monomials)
        In the order of :func:`monomials_up_to` the variables and ``degree``; scaled so that roots are of order one.
    degree : int

    Returns
    -------
    complex ndarray, shape (roots, variables)

    Raises
    ------
    ValueError
        If there are infinitely many roots, or the degree is too high.

    Examples
    --------
    The circle x^2 + y^2 = 1 and the line x = y, times x:

    >>> circle = [-1, 0, 0, 1, 0, 1]
    >>> lines = [0, 0, 0, 0, -1, 1]
    >>> polynomial_roots(np.array([circle, lines], float), 2).real.round(6) + 0.0
    array([[-0.707107, -0.707107],
           [ 0.      , -1.      ],
           [ 0.      ,  1.      ],
           [ 0.707107,  0.707107]])
    """
    variables = len(coefficients)
    scaled = coefficients / np.abs(coefficients).max(axis=1, keepdims=True)
    generator = np.random.default_rng(0)
    for top in itertools.count(variables * (degree - 1) + 2):
        columns = monomials_up_to(variables, top)
        if len(columns) > _MOST_COLUMNS:
            raise ValueError("the polynomials have infinitely many roots, or roots too close to tell apart")
        null = _null_space(_macaulay(scaled, degree, top))
        last = _gap(null, variables, top)
        if last is not None:
            return _roots(null, variables, last, generator)
    raise AssertionError  # the loop always terminates


def _macaulay(coefficients: Array, degree: int, top: int) -> Array:
    """Return all products of the polynomials with monomials, up to the degree ``top``."""
    places = _places(len(coefficients), degree, top)
    rows = np.zeros((len(places), len(coefficients), len(monomials_up_to(len(coefficients), top))))
    rows[np.arange(len(places))[:, None], :, places] = coefficients.T
    return rows.reshape(-1, rows.shape[-1])


@cache
def _places(variables: int, degree: int, top: int) -> NDArray[np.intp]:
    """Return the positions of the monomials of a polynomial times each monomial, (factors, monomials)."""
    place = {exponents: k for k, exponents in enumerate(monomials_up_to(variables, top))}
    own = monomials_up_to(variables, degree)
    factors = monomials_up_to(variables, top - degree)
    return np.array([[place[tuple(a + b for a, b in zip(f, e, strict=True))] for e in own] for f in factors])


def _null_space(matrix: Array) -> Array:
    q, r, _ = qr(matrix.T, pivoting=True)  # as reliable as singular values here, and ten times as fast
    size = np.abs(np.diag(r))
    return np.asarray(q[:, int((size > _RANK * size[0]).sum()) :])


def _gap(null: Array, variables: int, top: int) -> int | None:
    """Return the degree from which on the rank of the rows stays the same for one more, or None."""
    before = -1
    for degree in range(top):
        size = np.linalg.svd(null[: len(monomials_up_to(variables, degree))], compute_uv=False)
        rank = int((size > _RANK).sum())
        if rank == before:
            return degree - 1
        before = rank
    return None


def _roots(null: Array, variables: int, last: int, generator: np.random.Generator) -> Complex:
    low, high = (monomials_up_to(variables, degree) for degree in (last, last + 1))
    u, size, _ = np.linalg.svd(null[: len(high)], full_matrices=False)
    affine = u[:, size > _RANK]
    if not affine.shape[1]:
        return np.empty((0, variables), complex)
    place = {exponents: k for k, exponents in enumerate(high)}
    weights = generator.normal(size=variables)
    shifted = np.zeros((len(low), affine.shape[1]))
    for number, weight in enumerate(weights):
        raised = [place[(*e[:number], e[number] + 1, *e[number + 1 :])] for e in low]
        shifted += weight * affine[raised]
    action = np.linalg.lstsq(affine[: len(low)], shifted, rcond=None)[0]
    vectors = affine @ np.linalg.eig(action)[1]
    one = place[(0,) * variables]
    linear = [place[tuple(int(k == number) for k in range(variables))] for number in range(variables)]
    found = (vectors[linear] / vectors[one]).T
    return np.asarray(found[np.lexsort((found[:, -1].real, found[:, 0].real.round(9)))])
