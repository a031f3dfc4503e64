"""Mode shapes of a dynamic stiffness: null vector, back-substitution to every node, exact transfer between nodes."""

from __future__ import annotations

import numpy as np

from .stiffness import TERMS, DynamicStiffness, Evaluation, Tree

__all__ = ["mode_states"]


def mode_states(problem: DynamicStiffness, z: np.ndarray, x: np.ndarray, derivative: int = 0) -> np.ndarray:
    """Return the state (q, w, P) of every mode at the stations x, mass-normalised.

    Parameters
    ----------
    problem : DynamicStiffness
    z : ndarray, shape (rows, modes)
        Roots, from `lowest` or `refine`. Equal roots get independent, mass-orthogonal shapes.
    x : ndarray, shape (rows, stations)
        Distance from the left end, within the length.
    derivative : int
        Order of the derivative by x.

    Returns
    -------
    ndarray, shape (rows, modes, stations, 2 n + m)
        Natural forces P come last. The modal mass ``-u' (dK/dz) u``, exact without quadrature, is one if it is real;
        complex shapes are scaled to a largest nodal displacement of one.
    """
    rows, modes = z.shape
    row = np.repeat(np.arange(rows), modes)
    place, z = _clusters(z)
    here = problem.evaluate(z.ravel(), row, keep_tree=True)
    assert here.tree is not None
    u = _null_vectors(here, place, rows, modes)
    nodal = np.einsum("rij,rj->ri", here.unit, u)
    state = np.empty((rows * modes, x.shape[1], 2 * problem.displacements + problem.coordinates), dtype=u.dtype)
    for level in np.unique(here.tree.levels):
        member = np.nonzero(here.tree.levels == level)[0]
        state[member] = _spread(problem, here.tree, nodal[member], member, int(level), x[row[member]], derivative)
    return state.reshape(rows, modes, *state.shape[1:])


def _clusters(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return each root's position among equal neighbours, and the roots with those neighbours made identical."""
    place, joined = np.zeros(z.shape, dtype=int), z.copy()
    for i in range(1, z.shape[1]):
        same = np.abs(z[:, i] - joined[:, i - 1]) <= 1e-9 * np.abs(z[:, i])
        place[:, i] = np.where(same, place[:, i - 1] + 1, 0)
        joined[:, i] = np.where(same, joined[:, i - 1], z[:, i])
    return place, joined


def _null_vectors(here: Evaluation, place: np.ndarray, rows: int, modes: int) -> np.ndarray:
    """Return balanced null vectors: mass-normalised and, among equal roots, mass-orthogonal."""
    pick = place.ravel()
    if np.iscomplexobj(here.matrix):
        vector = np.conj(np.linalg.svd(here.matrix)[2][np.arange(len(pick)), -1 - pick])
        size = np.abs(np.einsum("rij,rj->ri", here.unit, vector)).max(axis=1, keepdims=True)
        return vector / size
    value, vector = np.linalg.eigh(here.matrix)
    order = np.argsort(np.abs(value), axis=1)
    u = np.take_along_axis(vector, order[np.arange(len(pick)), pick][:, None, None], axis=2)[..., 0]
    u = u.reshape(rows, modes, -1)
    mass = -here.derivative.reshape(rows, modes, *here.derivative.shape[1:])
    for i in range(modes):
        for back in range(1, int(place[:, i].max(initial=0)) + 1):
            tied = (place[:, i] >= back)[:, None]
            overlap = np.einsum("ri,rij,rj->r", u[:, i - back], mass[:, i], u[:, i])[:, None]
            u[:, i] -= np.where(tied, overlap * u[:, i - back], 0.0)
        u[:, i] /= np.sqrt(np.einsum("ri,rij,rj->r", u[:, i], mass[:, i], u[:, i]))[:, None]
    return u.reshape(rows * modes, -1)


def _spread(problem: DynamicStiffness, tree: Tree, nodal, member, level: int, x, derivative: int) -> np.ndarray:
    """Back-substitute to all nodes of the given members, then transfer the state to the stations."""
    n, m = problem.displacements, problem.coordinates
    left, w = nodal[:, :n], nodal[:, n : n + m]
    right, middle = nodal[:, n + m : 2 * n + m], nodal[:, 2 * n + m :]
    nodes = np.stack([np.stack([left, middle], axis=1), np.stack([middle, right], axis=1)])
    for step in range(level):
        x_matrix = tree.middles[len(tree.middles) - 1 - step][:, member]
        start, end = nodes[:, :, :-1], nodes[:, :, 1:]
        lumped = np.broadcast_to(w[None, :, None], (*start.shape[:-1], m))
        halves = -np.einsum("prij,prkj->prki", x_matrix, np.concatenate([start, lumped, end], axis=-1))
        finer = np.empty((2, len(member), 2 * start.shape[2] + 1, n), dtype=halves.dtype)
        finer[:, :, ::2], finer[:, :, 1::2] = nodes, halves
        nodes = finer
    scale = tree.scale[member][None, :, None, :n]
    lumped = np.broadcast_to(w[None, :, None], (*nodes[:, :, :-1].shape[:-1], m))
    ends = np.concatenate([nodes[:, :, :-1] * scale, lumped, nodes[:, :, 1:] * scale], axis=-1)
    force = -np.einsum("prij,prkj->prki", tree.start[:, member], ends)
    gathered = np.zeros((*force.shape[:-1], m))
    start_state = np.concatenate([ends[..., : n + m], force, gathered], axis=-1)
    return _transfer_to(tree, member, start_state, x, derivative)[..., : 2 * n + m]


def _transfer_to(tree: Tree, member, start_state, x, derivative: int) -> np.ndarray:
    """Carry the state from the node left of each station to the station by the Taylor series of ``exp(A xi)``."""
    boundary = tree.piece[0, member] * 2.0 ** tree.levels[member]
    part = (x > boundary[:, None]).astype(int)
    inside = x - np.where(part, boundary[:, None], 0.0)
    piece = tree.piece[part, member[:, None]]
    index = np.clip((inside / piece).astype(int), 0, start_state.shape[2] - 1)
    xi = (inside - index * piece)[..., None]
    state = start_state[part, np.arange(len(member))[:, None], index]
    system = tree.system[member]
    for _ in range(derivative):
        state = np.einsum("rij,rsj->rsi", system, state)
    total, term = state.copy(), state
    for j in range(1, TERMS + 1):
        term = np.einsum("rij,rsj->rsi", system, term) * (xi / j)
        total = total + term
    return total
