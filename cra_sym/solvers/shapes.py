"""Mode shapes of a dynamic stiffness: null vector, back-substitution to every node, exact transfer between nodes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .stiffness import GOLDEN, TERMS, DynamicStiffness, Evaluation, Tree, form

__all__ = ["clusters", "mode_states", "mode_vectors", "nodes", "states"]


def mode_states(problem: DynamicStiffness, z: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Return the state (q, w, P) of every mode at the stations, mass-normalised.

    Parameters
    ----------
    problem : DynamicStiffness
    z : ndarray, shape (rows, modes)
        Roots: all of the lowest, as `lowest` gives them, or those of `refine`. Equal ones get independent shapes.
    share : ndarray, shape (rows, stations)
        Distance from the left end in lengths, 0 to 1.

    Returns
    -------
    ndarray, shape (rows, modes, stations, 2 n + m)
        Natural forces P come last. The modal mass ``-u' (dK/dz) u``, exact without quadrature, is one if it is real;
        complex shapes are scaled to a largest nodal displacement of one.
    """
    rows, modes = z.shape
    here, u, row = mode_vectors(problem, z)
    state = states(problem, here, u, clusters(z)[1].ravel(), row, share[row])
    return state.reshape(rows, modes, *state.shape[1:])


def mode_vectors(
    problem: DynamicStiffness, z: np.ndarray, *, common_levels: bool = False
) -> tuple[Evaluation, np.ndarray, np.ndarray]:
    """Return an evaluation at the roots with its tree, the normalised free coordinates, and the row of each root.

    With ``common_levels`` all roots of a row are evaluated on the same pieces.
    """
    rows, modes = z.shape
    row = np.repeat(np.arange(rows), modes)
    place, z = clusters(z)
    levels = problem.levels(z.ravel(), row)
    if common_levels:
        levels = np.repeat(levels.reshape(rows, modes).max(axis=1), modes)
    here = problem.evaluate(z.ravel(), row, keep_tree=True, levels=levels)
    return here, _null_vectors(here, place, rows, modes), row


def nodes(
    problem: DynamicStiffness, here: Evaluation, u: np.ndarray
) -> Iterator[tuple[int, np.ndarray, np.ndarray, np.ndarray]]:
    """Yield level, members, states left of every piece (part, member, piece, state), and (q(0), w, q(L)) of members.

    Parameters
    ----------
    here : Evaluation
        With its tree.
    u : ndarray, shape (members, f)
        Free coordinates.
    """
    assert here.tree is not None
    nodal = (here.unit @ u[..., None])[..., 0]
    unit = here.tree.scale
    size = unit.shape[1]
    for level in np.unique(here.tree.levels):
        member = np.nonzero(here.tree.levels == level)[0]
        start = _back_substitute(problem, here.tree, nodal[member], member, int(level))
        yield int(level), member, start, nodal[member, :size] * unit[member]


def states(
    problem: DynamicStiffness, here: Evaluation, u: np.ndarray, z: np.ndarray, row: np.ndarray, share: np.ndarray
) -> np.ndarray:
    """Return the state (q, w, P) at the stations for free coordinates ``u`` of an evaluation with its tree.

    Parameters
    ----------
    here : Evaluation
        Of ``problem`` at ``z`` and ``row``.
    u : ndarray, shape (len(z), f)
    share : ndarray, shape (len(z), stations)
    """
    state = np.empty((len(z), share.shape[1], 2 * problem.displacements + problem.coordinates), dtype=u.dtype)
    for level, member, start, _ in nodes(problem, here, u):
        state[member] = _propagate(problem, z[member], row[member], start, level, share[member])
    return state


def clusters(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
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
        nodal = np.einsum("rij,rj->ri", here.unit, vector)
        assert here.tree is not None
        unit = here.tree.scale
        unit = np.concatenate(
            [unit, unit[:, : nodal.shape[1] - unit.shape[1]]], axis=1
        )  # the middle's as the left end's
        return np.asarray(vector / np.abs(nodal * unit).max(axis=1, keepdims=True))
    value, vector = np.linalg.eigh(here.matrix)
    order = np.argsort(np.abs(value), axis=1)[np.arange(len(pick)), pick]
    # K has as many negative eigenvalues as modes lie below, so the next one belongs to this mode, even among close ones
    number = np.clip(np.tile(np.arange(modes), rows) - here.fixed_count, 0, value.shape[1] - 1)
    vanishing = np.abs(np.take_along_axis(value, number[:, None], axis=1)[:, 0]) < 1e-6
    u = np.take_along_axis(vector, np.where(vanishing, number, order)[:, None, None], axis=2)[..., 0]
    u = u.reshape(rows, modes, -1)
    mass = -here.derivative.reshape(rows, modes, *here.derivative.shape[1:])
    for i in range(modes):
        for back in range(1, int(place[:, i].max(initial=0)) + 1):
            tied = (place[:, i] >= back)[:, None]
            overlap = (u[:, i - back] * (mass[:, i] @ u[:, i, :, None])[..., 0]).sum(axis=1)[:, None]
            u[:, i] -= np.where(tied, overlap * u[:, i - back], 0.0)
        u[:, i] /= np.sqrt(form(u[:, i], mass[:, i]))[:, None]
    return u.reshape(rows * modes, -1)


def _back_substitute(
    problem: DynamicStiffness, tree: Tree, nodal: np.ndarray, member: np.ndarray, level: int
) -> np.ndarray:
    """Back-substitute to all nodes; return the state at the left of every piece, (part, member, piece, state)."""
    n, m = problem.displacements, problem.coordinates
    left, w = nodal[:, :n], nodal[:, n : n + m]
    right, middle = nodal[:, n + m : 2 * n + m], nodal[:, 2 * n + m :]
    nodes = np.stack([np.stack([left, middle], axis=1), np.stack([middle, right], axis=1)])
    for step in range(level):
        elimination = tree.middles[len(tree.middles) - 1 - step][:, member]
        ends = _with_lumped(nodes[:, :, :-1], w, nodes[:, :, 1:])
        finer = np.empty((2, len(member), 2 * nodes.shape[2] - 1, n), dtype=nodal.dtype)
        finer[:, :, ::2], finer[:, :, 1::2] = nodes, -(elimination @ ends[..., None])[..., 0]
        nodes = finer
    nodes = nodes * tree.scale[member][None, :, None, :n]
    ends = _with_lumped(nodes[:, :, :-1], w, nodes[:, :, 1:])
    force = -(tree.start[:, member] @ ends[..., None])[..., 0]
    return np.concatenate([ends[..., : n + m], force, np.zeros((*force.shape[:-1], m))], axis=-1)


def _with_lumped(start: np.ndarray, w: np.ndarray, end: np.ndarray) -> np.ndarray:
    lumped = np.broadcast_to(w[None, :, None], (*start.shape[:-1], w.shape[-1]))
    return np.concatenate([start, lumped, end], axis=-1)


def _propagate(
    problem: DynamicStiffness, z: np.ndarray, row: np.ndarray, start: np.ndarray, level: int, share: np.ndarray
) -> np.ndarray:
    """Propagate the state from the node left of each station to the station by the Taylor series of ``exp(Omega)``."""
    n, m = problem.displacements, problem.coordinates
    part = (share > GOLDEN).astype(int)
    origin = np.where(part, GOLDEN, 0.0)
    piece = np.where(part, 1.0 - GOLDEN, GOLDEN) / 2.0**level
    index = np.clip(((share - origin) / piece).astype(int), 0, start.shape[2] - 1)
    node = origin + index * piece
    exponent, _ = problem.exponent(z, row, node, share - node)
    start = problem.behind(start, z, row, level)
    total = term = start[part, np.arange(len(row))[:, None], index][..., None]
    for j in range(1, TERMS + 1):
        term = exponent @ term / j
        total = total + term
    return np.asarray(total[..., : 2 * n + m, 0])
