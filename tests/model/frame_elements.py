"""Plane frames by finite elements, without the package: cubic bending, quadratic stretching."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.polynomial import Polynomial as P
from scipy.linalg import eigh

_S = P([0.0, 1.0])
_BENDING = [1 - 3 * _S**2 + 2 * _S**3, _S - 2 * _S**2 + _S**3, 3 * _S**2 - 2 * _S**3, _S**3 - _S**2]
_AXIAL = [(1 - _S) * (1 - 2 * _S), _S * (2 * _S - 1), 4 * _S * (1 - _S)]


def _integral(f):
    return float(f.integ()(1.0))


def _pair(shapes, order):
    return np.array(
        [[_integral(a.deriv(order) * b.deriv(order)) if order else _integral(a * b) for b in shapes] for a in shapes]
    )


class Frame:
    """Nodes with (X, Y, rotation); members are cut into equal elements with a further unknown for stretching each."""

    def __init__(self):
        self.size, self.blocks = 0, []

    def node(self):
        self.size += 3
        return np.arange(self.size - 3, self.size)

    def member(self, first, last, length, angle, EI, EA, mass, elements, place=None):
        """Add a member between two nodes; return the node at a share of its length, if one is asked for."""
        nodes = [first, *(self.node() for _ in range(elements - 1)), last]
        h, c, s = length / elements, np.cos(angle), np.sin(angle)
        turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        scale = np.array([1.0, h, 1.0, h])
        bend = np.outer(scale, scale) * _pair(_BENDING, 2) * EI / h**3
        heavy = np.outer(scale, scale) * _pair(_BENDING, 0) * mass * h
        for one, other in pairwise(nodes):
            self.size += 1
            stiff, kinetic = np.zeros((7, 7)), np.zeros((7, 7))
            across, along = [1, 2, 4, 5], [0, 3, 6]
            stiff[np.ix_(across, across)], kinetic[np.ix_(across, across)] = bend, heavy
            stiff[np.ix_(along, along)] = _pair(_AXIAL, 1) * EA / h
            kinetic[np.ix_(along, along)] = _pair(_AXIAL, 0) * mass * h
            whole = np.eye(7)
            whole[:3, :3] = whole[3:6, 3:6] = turn
            self.blocks.append(([*one, *other, self.size - 1], whole.T @ stiff @ whole, whole.T @ kinetic @ whole))
        return None if place is None else nodes[round(place * elements)]

    def add(self, unknowns, stiffness=None, mass=None):
        """Add springs and masses on some unknowns."""
        zero = np.zeros(len(unknowns))
        stiff, kinetic = (np.diag(zero if values is None else values) for values in (stiffness, mass))
        self.blocks.append((list(unknowns), stiff, kinetic))

    def frequencies(self, held, modes):
        """Return angular frequencies with some unknowns held."""
        stiffness, mass = np.zeros((2, self.size, self.size))
        for unknowns, stiff, kinetic in self.blocks:
            stiffness[np.ix_(unknowns, unknowns)] += stiff
            mass[np.ix_(unknowns, unknowns)] += kinetic
        free = np.setdiff1d(np.arange(self.size), held)
        stiffness, mass = stiffness[np.ix_(free, free)], mass[np.ix_(free, free)]
        return 1.0 / np.sqrt(eigh(mass, stiffness, eigvals_only=True)[::-1][:modes])
