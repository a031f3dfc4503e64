"""All natural frequencies of a dynamic stiffness: brackets from the exact count, Newton's method on an eigenvalue of K.

Damped problems have complex eigenvalues and no count: given starting values are refined together, so that no two
converge to one root, but completeness is not guaranteed.
"""

from __future__ import annotations

import numpy as np

from .rayleigh import quotients, ritz_values
from .stiffness import GOLDEN, DynamicStiffness, Evaluation, form

__all__ = ["lowest", "refine"]

_NOISE = 512 * np.finfo(float).eps
_SOFT, _BLURRED = 1e-8, 1e-14
"""Relative rounding error above which a root is replaced by a Ritz value, and above which its shape is used for it."""
_SWEEPS = 200
_BELOW = 1e-4  # share of the smallest z without stiffness from which on frequencies are not searched


def lowest(problem: DynamicStiffness, modes: int) -> np.ndarray:
    """Return the ``modes`` smallest squared frequencies of every row: ascending, complete, double roots twice.

    Parameters
    ----------
    problem : DynamicStiffness
        Real and symmetric, with z = omega^2.
    modes : int

    Returns
    -------
    ndarray, shape (rows, modes)
        omega^2; rigid-body motions count as exact zeros.

    Raises
    ------
    ValueError
        If the structure is statically unstable (has buckled), or has fewer natural frequencies than asked for. Where
        the highest derivatives by x have inertia too, those count that lie below the z at which it first outweighs
        their stiffness somewhere: at that z, motions of any wave length are eigenfunctions.

    Notes
    -----
    Each root is replaced by the Rayleigh quotient of its shape, in which the rounding error of the stiffness appears
    squared; roots near that error (soft joints, heavy tips) are replaced by Ritz values on their common span. A value
    below 1e-24 of the first elastic bound is a rigid-body zero.
    """
    rows = len(problem.length)
    every = np.arange(rows)
    static = problem.evaluate(np.zeros(rows), every)
    rigid = _rigid_count(static)
    bounds = _static_bounds(static)
    # Ritz values of soft modes need the shapes of all of them
    asked, modes = modes, max(modes, int((bounds < _SOFT * bounds[:, -1:]).sum(axis=1).max(initial=0)))
    wanted = np.arange(1, modes + 1)
    low, below = np.zeros((rows, modes)), np.repeat(rigid[:, None], modes, axis=1)
    high, above, guess = _upper_bounds(problem, bounds, modes)
    open_ = wanted > rigid[:, None]
    result, noise = np.zeros((rows, modes)), np.full((rows, modes), np.inf)
    for sweep in range(_SWEEPS):
        row, mode = np.nonzero(open_)
        if not row.size:
            return _polish(problem, np.sort(result, axis=1), noise, bounds)[:, :asked]
        z = _next_point(guess[row, mode], low[row, mode], high[row, mode], below[row, mode], above[row, mode], mode + 1)
        here = problem.evaluate(z, row)
        value, step, count, noise[row, mode] = _newton(here, mode + 1)
        _tighten(low, high, below, above, row, z, count, wanted)
        target = z + step
        relative = np.abs(step) / np.maximum(np.abs(target), np.finfo(float).tiny)
        settled = (relative < 1e-10) | (np.abs(step) <= 16.0 * noise[row, mode]) | ((relative < 1e-7) & (sweep > 60))
        narrow = high[row, mode] - low[row, mode] <= 4 * np.finfo(float).eps * high[row, mode]
        result[row, mode] = np.where(settled & value, target, 0.5 * (low[row, mode] + high[row, mode]))
        open_[row, mode] = ~((settled & value) | narrow)
        trusted = value & ((sweep % 3 != 2) | (relative < 1e-3))
        guess[row, mode] = np.where(trusted, target, np.nan)
    raise ArithmeticError("the search for natural frequencies did not converge")


def _polish(problem: DynamicStiffness, z: np.ndarray, noise: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    """Replace the roots by quotients of their shapes, and the soft ones, the first few of a row, by Ritz values."""
    last = bounds.shape[1] - 1
    soft, span = (np.cumprod(noise > level * z, axis=1).astype(bool) for level in (_SOFT, _BLURRED))
    polished = np.where(soft, z, quotients(problem, z))
    number = np.where(soft[:, 0], span.sum(axis=1), 0)
    for size in np.unique(number[number > 0]):
        rows = np.nonzero(number == size)[0]
        almost_rigid = np.cumprod(noise[rows, :size] > 1e-3 * z[rows, :size], axis=1).sum(axis=1)
        value = ritz_values(problem.take(rows), z[rows, :size], almost_rigid)
        value = np.where(value > 1e-24 * bounds[rows, None, min(size, last)], value, 0.0)
        polished[rows, :size] = np.where(soft[rows, :size], value, polished[rows, :size])
    return polished


def _rigid_count(static: Evaluation) -> np.ndarray:
    """Return the number of rigid-body motions of each row; refuse a structure that has buckled."""
    if static.matrix.shape[-1] == 0:
        return np.zeros(len(static.matrix), dtype=int)
    value, vector = np.linalg.eigh(static.matrix)
    size = np.einsum("rij,rik,rkj->rj", np.abs(vector), np.abs(static.matrix), np.abs(vector))
    rounding = _NOISE * size + 4.0 * np.finfo(float).eps * np.abs(static.matrix).max(axis=(1, 2))[:, None]
    unstable = static.fixed_count + (value < -rounding).sum(axis=1)
    if unstable.any():
        number, sets = int(unstable.max()), len(unstable)
        where = f", in {np.count_nonzero(unstable)} of {sets} parameter sets" if sets > 1 else ""
        plural = "s" if number > 1 else ""
        raise ValueError(f"the structure has buckled: {number} unstable mode{plural} (omega^2 < 0){where}")
    return np.asarray((np.abs(value) <= rounding).sum(axis=1))


def _upper_bounds(
    problem: DynamicStiffness, bounds: np.ndarray, modes: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return, for every mode, a z with that many frequencies below it, the count there and a guess.

    Static deflections are admissible motions: their Rayleigh-Ritz values bound the lowest frequencies from above.
    """
    rows = len(bounds)
    guess = np.full((rows, modes), np.nan)
    shared = min(modes, bounds.shape[1])
    guess[:, :shared] = bounds[:, :shared]
    high, above = np.full((rows, modes), np.inf), np.zeros((rows, modes), dtype=int)
    ceiling = _ceiling(problem)
    z = np.minimum(np.maximum(bounds[:, 0], 1e-12 * bounds[:, -1]) * (1.0 + 1e-9), ceiling)
    pending = np.arange(rows)
    for _ in range(400):
        count = problem.evaluate(z[pending], pending).count
        few = (z[pending] >= ceiling[pending]) & (count < modes)
        if few.any():
            worst = int(np.argmin(np.where(few, count, modes)))
            raise ValueError(
                f"modes = {modes}: only {count[worst]} natural frequencies lie below {np.sqrt(z[pending[worst]]):.6g} "
                "rad/s, about where the inertia of the highest derivatives by x outweighs their stiffness and "
                f"frequencies are no longer distinct; modes must be at most {count[worst]}"
            )
        reached = (np.arange(1, modes + 1) <= count[:, None]) & np.isinf(high[pending])
        high[pending], above[pending] = (
            np.where(reached, z[pending, None], high[pending]),
            np.where(reached, count[:, None], above[pending]),
        )
        pending = pending[np.isinf(high[pending, -1])]
        if not pending.size:
            return high, above, guess
        z[pending] = np.minimum(4.0 * z[pending], ceiling[pending])
    raise ValueError(f"modes = {modes}: the model has only {int(above.max())} natural frequencies")


def _ceiling(problem: DynamicStiffness) -> np.ndarray:
    """Return up to which z natural frequencies are searched, shape (rows,): inf without inertia of the highest strain.

    Where q' = F P + .., F is the inverse of stiffness minus z times inertia of the highest derivatives, and F^-1 F' at
    z = 0 has the reciprocals of the z at which that is singular.
    """
    n, rows = problem.displacements, len(problem.length)
    force = slice(n + problem.coordinates, 2 * n + problem.coordinates)

    def flexibility(share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        matrix, slope = problem.system(np.zeros(rows), np.arange(rows), share[None])
        return matrix[..., :n, force], slope[..., :n, force]

    if not flexibility(np.array([0.3]))[1].any():
        return np.full(rows, np.inf)
    # both ends of every piece, beside its nodes: coefficients may jump there
    pieces = 1 if problem.uniform else 2 ** max(problem.halvings, 8)
    near = ((np.arange(pieces)[:, None] + [1e-9, 1.0 - 1e-9]) / pieces).ravel()
    flexible, slope = flexibility(np.concatenate([GOLDEN * near, GOLDEN + (1.0 - GOLDEN) * near]))
    top = np.nonzero(np.abs(flexible).max(axis=tuple(range(flexible.ndim - 1))))[0]
    ratio = np.linalg.solve(flexible[..., top[:, None], top], slope[..., top[:, None], top])
    largest = np.linalg.eigvals(ratio).real.max(axis=(-2, -1))
    with np.errstate(divide="ignore"):
        return np.broadcast_to(np.where(largest > 0.0, (1.0 - _BELOW) / largest, np.inf), rows)


def _static_bounds(static: Evaluation) -> np.ndarray:
    """Return the Rayleigh-Ritz values of the static deflections of the free coordinates."""
    mass, frame = np.linalg.eigh(-static.derivative)
    if (mass[:, 0] < -1e-6 * np.abs(mass).max(axis=1)).any():
        raise ValueError("values: a static deflection has negative kinetic energy; masses must be at least 0")
    if (mass[:, -1] <= 0.0).any():
        raise ValueError("values: no motion of the structure has kinetic energy")
    whitener = frame / np.sqrt(np.maximum(mass, 1e-14 * mass.max(axis=1, keepdims=True)))[:, None, :]
    return np.linalg.eigvalsh(np.swapaxes(whitener, -1, -2) @ static.matrix @ whitener)


def _next_point(
    guess: np.ndarray, low: np.ndarray, high: np.ndarray, below: np.ndarray, above: np.ndarray, mode: np.ndarray
) -> np.ndarray:
    """Take the guess if it lies inside the bracket, else split the bracket in proportion to the counts at its ends."""
    share = (mode - below - 0.5) / np.maximum(above - below, 1)
    split = (np.sqrt(low) + share * (np.sqrt(high) - np.sqrt(low))) ** 2
    return np.where((guess > low) & (guess < high), guess, split)


def _newton(here: Evaluation, mode: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return whether K has the eigenvalue that vanishes at a mode, its Newton step, the count, and rounding."""
    value, vector = np.linalg.eigh(here.matrix)
    count = here.fixed_count + (value < 0.0).sum(axis=1)
    index = mode - 1 - here.fixed_count
    exists = (index >= 0) & (index < value.shape[1])
    pick = np.clip(index, 0, value.shape[1] - 1)[:, None]
    u = np.take_along_axis(vector, pick[:, None, :], axis=2)[..., 0]
    slope = form(u, here.derivative)
    with np.errstate(divide="ignore", invalid="ignore"):
        step = -np.take_along_axis(value, pick, axis=1)[:, 0] / slope
        noise = -np.finfo(float).eps * form(np.abs(u), np.abs(here.matrix)) / slope
    exists &= np.isfinite(step)
    return exists, np.where(exists, step, 0.0), count, noise


def _tighten(
    low: np.ndarray,
    high: np.ndarray,
    below: np.ndarray,
    above: np.ndarray,
    row: np.ndarray,
    z: np.ndarray,
    count: np.ndarray,
    wanted: np.ndarray,
) -> None:
    """Use the count at every visited point for all modes of its row (in place)."""
    order = np.argsort(row, kind="stable")
    turn = np.arange(len(row)) - np.searchsorted(row[order], row[order])
    for k in range(int(turn.max()) + 1):
        now = order[turn == k]
        r, point, found = row[now], z[now, None], count[now, None]
        is_high = (found >= wanted) & (point < high[r])
        is_low = (found < wanted) & (point > low[r])
        high[r], above[r] = np.where(is_high, point, high[r]), np.where(is_high, found, above[r])
        low[r], below[r] = np.where(is_low, point, low[r]), np.where(is_low, found, below[r])


def refine(
    problem: DynamicStiffness, guesses: np.ndarray, *, squared: bool = False, tolerance: float = 1e-12
) -> np.ndarray:
    """Refine complex eigenvalues of a damped problem, all modes of a row at once (Ehrlich-Aberth on exact F'/F).

    Parameters
    ----------
    problem : DynamicStiffness
        Coefficients analytic in the complex parameter s, or in ``z = -s^2``.
    guesses : ndarray of complex, shape (rows, modes)
        Of s.
    squared : bool
        Whether the parameter is z; then the one of the two s of a root that is nearer to the guess is returned.

    Returns
    -------
    ndarray of complex, shape (rows, modes)
        Roots of the characteristic function; nan where the iteration did not converge.
    """
    s = -(guesses**2) if squared else np.array(guesses, dtype=complex)
    rows, modes = s.shape
    row = np.repeat(np.arange(rows), modes)
    moving = np.isfinite(s)
    off = ~np.eye(modes, dtype=bool)
    for _ in range(60):
        at = moving.ravel()
        if not at.any():
            break
        slope = np.zeros((rows, modes), dtype=complex)
        slope.ravel()[at] = problem.evaluate(s.ravel()[at], row[at]).logarithmic_derivative
        with np.errstate(divide="ignore", invalid="ignore"):
            gap = s[:, :, None] - s[:, None, :]
            repulsion = np.where(off & (gap != 0.0), 1.0 / np.where(gap == 0.0, 1.0, gap), 0.0).sum(axis=2)
            step = np.where(moving, 1.0 / (slope - repulsion), 0.0)
        step = np.where(np.isfinite(step), step, 0.0)
        s -= step
        moving &= np.abs(step) > tolerance * np.abs(s)
    found = np.where(moving, np.nan, s)
    if not squared:
        return found
    root = np.sqrt(-found)
    return np.where((root * guesses.conj()).real < 0.0, -root, root)
