"""Mode shapes and modal quantities of lines with one wave number as numbers; dimensionless, for xi = x / L."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cra_sym.cached import cached_property
from cra_sym.solvers.one_wave import Functions, Layout, power, stacked

__all__ = ["NEAR", "ShapeTable", "fill", "integral", "near_shape", "rate_rows", "shape"]

Array = NDArray[np.float64]
NEAR = {1: 2.0, 2: 25.0}
"""Below this z a shape is a power series from the left end; a test checks that it equals the value in the
derivation."""
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(16)  # exact to rounding up to `NEAR`


class ShapeTable(Layout):
    """Rows of a table of modes, and of the rates that follow from them.

    They are P and q of the right end, the momentum, q and P of the left end, the amplitudes of cos, sin and for a beam
    exp(-lam xi), exp(-lam (1 - xi)) where z is over `NEAR`, then for each spring the root of twice its energy,
    sqrt(kappa) q, 0 for infinite stiffness, and for each with an inertia beside it its force. Rates are those of z over
    its square root, by each kappa, then half of those of ln z by ln kappa, by 1 / kappa, by each mu, and half of those
    of ln z by ln mu.
    """

    @property
    def right_force(self) -> slice:
        """P of the right end."""
        return slice(0, self.n)

    @property
    def right(self) -> slice:
        """q of the right end."""
        return slice(self.n, 2 * self.n)

    @property
    def momentum(self) -> int:
        """The integral of the shape with the masses of both ends."""
        return 2 * self.n

    @property
    def left(self) -> slice:
        """q of the left end."""
        return slice(2 * self.n + 1, 3 * self.n + 1)

    @property
    def left_force(self) -> slice:
        """P of the left end."""
        return slice(3 * self.n + 1, 4 * self.n + 1)

    @property
    def state(self) -> slice:
        """q and P of the left end and the amplitudes of the waves, which determine a shape."""
        return slice(2 * self.n + 1, 6 * self.n + 1)

    @property
    def waves(self) -> slice:
        """The amplitudes of the waves."""
        return slice(4 * self.n + 1, 6 * self.n + 1)

    @property
    def strain(self) -> slice:
        """The roots of twice the energy of the springs."""
        return slice(6 * self.n + 1, 6 * self.n + 1 + len(self.springs))

    @cached_property
    def size(self) -> int:
        """Rows of a table without the rates."""
        return 6 * self.n + 1 + len(self.springs) + self.kinds.count("km")

    @property
    def by_springs(self) -> slice:
        """Rates by kappa, then by ln kappa."""
        return slice(self.size, self.size + 2 * len(self.springs))

    @property
    def by_compliances(self) -> slice:
        """Rates by 1 / kappa."""
        return slice(self.by_springs.stop, self.by_springs.stop + len(self.springs))

    @property
    def by_inertias(self) -> slice:
        """Rates by mu, then by ln mu."""
        return slice(self.by_compliances.stop, self.by_compliances.stop + 2 * len(self.inertias))


def fill(
    table: Array,
    lam: Array,
    modes: int,
    layout: ShapeTable,
    functions: Functions,
    parameters: Array,
    inertias: Sequence[Array],
) -> None:
    """Fill the rows of a table for modes of unit generalised mass.

    Parameters
    ----------
    table : ndarray, shape (rows, size)
    lam : ndarray, shape (size,)
        All first frequency parameters of each lane, one lane after the other; the imaginary parts may hold a
        complex-step derivative, since all formulas are analytic.
    modes : int
        Of each lane.
    layout : ShapeTable
    functions : mapping of str to Function
        Those of `cra_sym.mechanics.one_wave_shapes` and ``one_wave_rows``.
    parameters : ndarray, shape (parameters, size)
    inertias : sequence of ndarray, shape (size,)
        mu of the channels that have one.
    """
    n, z = layout.n, power(lam, layout.n)
    left, tip, waves = (np.zeros((rows, lam.size), lam.dtype) for rows in (n, 2 * n, 2 * n))
    invariant = np.zeros(lam.size, lam.dtype)
    near = z < NEAR[n]
    left[:, near], tip[:, near], invariant[near] = _near(layout, functions, parameters[:, near], z[near])
    far = _far(layout, functions, parameters[:, ~near], lam[~near], z[~near])
    left[:, ~near], tip[:, ~near], waves[:, ~near], invariant[~near] = far
    rigid = np.flatnonzero(lam == 0)
    still = _rigid(functions, parameters[:, rigid], [mu[rigid] for mu in inertias], rigid % modes == 0)
    left[:, rigid], tip[:n, rigid], tip[n:, rigid] = still[n : 2 * n], still[:n], 0.0
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        prepared = functions["prepared"].function(*parameters, *inertias)
        massive = len(prepared) - len(layout.springs)
        inverse = 1 / z
        given = *parameters, *inertias, *prepared[:massive], lam, z, inverse
        end = functions["end_state"].function(*given, *tip)
        q, p, amplitudes = end[:n], end[n : 2 * n], end[2 * n :]
        own = [i for i, kind in enumerate(layout.structure[1]) if kind == "m"]
        of_these = [mu for mu, i in zip(inertias, layout.inertias, strict=True) if layout.groups[i][0] - n in own]
        massive_q = [q[i] for i in own]
        (mass,) = functions["generalised_mass"].function(
            *parameters, *left, z, invariant, *massive_q, *amplitudes, *of_these
        )
        found = functions["rows"].function(*parameters, *prepared[massive:], *left, z, inverse, *end)
    first, rest = layout.state.start + 2 * n, layout.waves.stop
    for row, value in enumerate(found):
        table[row if row < first else row + rest - first] = value
    table[layout.waves] = waves
    mass = np.where(lam == 0, 1.0, mass)
    mass[rigid], table[layout.momentum, rigid] = still[2 * n], still[2 * n + 1]
    (leading,) = functions["leading"].function(*q, *p)
    table *= np.where(leading < 0, -1.0, 1.0) / np.sqrt(mass)
    table += 0.0  # -0.0 becomes 0.0


def _near(layout: ShapeTable, functions: Functions, parameters: Array, z: Array) -> tuple[Array, Array, Array]:
    """Return the amplitudes of the left end, the raw state of the right end and the invariant."""
    krylov = functions["polynomials"].function(np.ones_like(z), z)
    if layout.n == 1:
        left = np.ones((1, z.size), z.dtype)
    else:
        left = _amplitudes_near(stacked(functions["tip_rows"].function(*parameters, z, *krylov), z.size))
    of_left = parameters[: sum(channel < layout.n for channel, _ in layout.parameters)]
    tip = functions["tip_near"].function(*of_left, *left, z, *krylov)
    (invariant,) = functions["invariant_near"].function(*of_left, *left, z)
    return left, stacked(tip, z.size), invariant


def _amplitudes_near(rows: Array) -> Array:
    """Return the amplitudes from whichever condition of the right end cancels less."""
    rows = rows.reshape(2, 2, 2, -1)  # condition, amplitude, (entry, magnitude)
    entry, magnitude = rows[:, :, 0], rows[:, :, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        loss = np.where(magnitude > 0, magnitude / np.abs(entry), 1.0).real.max(axis=1)
    loss[~entry.any(axis=1)] = np.inf
    row = np.where(loss[0] <= loss[1], entry[0], entry[1])
    row = row / np.maximum(np.abs(row).max(axis=0), np.finfo(float).tiny)
    return np.array([row[1], -row[0]])


def _far(
    layout: ShapeTable, functions: Functions, parameters: Array, lam: Array, z: Array
) -> tuple[Array, Array, Array, Array]:
    """Return the amplitudes of the left end, the raw state of the right end, the wave amplitudes and the invariant."""
    n = layout.n
    waving = lam, np.cos(lam), np.sin(lam), np.exp(-lam)
    found = stacked(functions["amplitudes_far"].function(*parameters, *waving), lam.size)
    found = found / np.sqrt(found[n] ** 2 + found[n + 1] ** 2)
    left, waves = found[:n], found[n:]
    tip = stacked(functions["tip_far"].function(*waves, *waving), lam.size)
    (invariant,) = functions["invariant_far"].function(*waves, waving[3], z)
    return left, tip, waves, invariant


def _rigid(functions: Functions, parameters: Array, inertias: list[Array], first: Array) -> Array:
    """Return shape and slope at the right end, amplitudes of the left end, mass and momentum of rigid-body modes."""
    with np.errstate(divide="ignore", invalid="ignore"):
        found = functions["rigid_body"].function(*parameters, *inertias, first.astype(np.float64))
    result = stacked(found, first.size)
    n = (len(result) - 2) // 2
    result[0] += result[1] if n == 2 else 0.0  # at the right end
    return result


def rate_rows(table: Array, lam: Array, layout: ShapeTable, functions: Functions, inertias: Sequence[Array]) -> Array:
    """Return the rows of rates from those of a table, shape (rates, size)."""
    root = lam if layout.n == 1 else lam * lam
    inner = layout.waves
    given = *table[: layout.momentum], *table[layout.momentum + 1 : inner.start], *table[inner.stop :]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        found = functions["rates"].function(*inertias, root, 1 / root, *given)
    return stacked(found, lam.size)


def derivatives(state: Array, n: int) -> Array:
    """Return the shape and its derivatives at the left end from q and P there."""
    forces = [(-1) ** (n - 1 - j) * state[n + j] for j in reversed(range(n))]
    return np.array([*state[:n], *forces])


def near_shape(start: Array, z: Array, xi: Array, derivative: int, functions: Functions) -> Array:
    """Return a derivative by xi, below the 2n-th, of the solution with the given derivatives at the left end."""
    size = len(start)
    signed = (-1) ** (size // 2) * z
    solutions = functions["polynomials"].function(xi, z)
    terms = (
        start[j] * signed ** ((derivative - j + size - 1) // size) * solutions[(j - derivative) % size]
        for j in range(size)
    )
    return np.asarray(sum(terms))


def shape(lam: Array, state: Array, xi: Array, derivative: int, n: int, functions: Functions) -> Array:
    """Return a derivative of every shape by xi at points that broadcast on a new last axis.

    Parameters
    ----------
    lam : ndarray, shape (..., modes)
    state : ndarray, shape (4 n, ..., modes)
        The rows `Table.state`.
    xi : ndarray, shape (..., points)
    derivative : int
    n : int
    functions : mapping of str to Function
    """
    lam, xi = np.broadcast_arrays(lam[..., None], xi)
    turns, order = divmod(derivative, 2 * n)
    z = power(lam, n)
    near = z < NEAR[n]
    result = np.empty(lam.shape)
    state = np.broadcast_to(state[..., None], (4 * n, *lam.shape))
    start = derivatives(state[: 2 * n, near], n)
    result[near] = near_shape(start, z[near], xi[near], order, functions)
    result[~near] = functions["shape_far"].function(*state[2 * n :, ~near], lam[~near], xi[~near])[order]
    return result * ((-1) ** n * z) ** turns if turns else result


def integral(lam: Array, state: Array, n: int, functions: Functions) -> Array:
    """Return the integral of every shape from 0 to 1, shape (..., modes)."""
    z = power(lam, n)
    near = z < NEAR[n]
    result = np.empty(lam.shape)
    start = derivatives(state[: 2 * n, near], n)[..., None]
    values = near_shape(start, z[near, None], (1 + _POINTS) / 2, 0, functions)
    result[near] = values @ (_WEIGHTS / 2)
    far = lam[~near]
    waving = far, np.cos(far), np.sin(far), np.exp(-far)
    result[~near] = functions["integral_far"].function(*state[2 * n :, ~near], *waving)[0]
    return result
