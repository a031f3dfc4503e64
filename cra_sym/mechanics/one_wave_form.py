"""Detection of Lagrangians with one wave number (strings and beams with uncoupled end conditions) and their groups."""

from __future__ import annotations

from sympy import Expr, Integer, Matrix, S, Symbol, cancel, sqrt, zeros

from cra_sym.mechanics.state_form import StateForm

__all__ = ["STRUCTURE", "one_wave_scales"]

STRUCTURE = "structure "
"""The first name of the scales is this and the kinds of the channels: ``"structure k,k|m,m"``."""


def one_wave_scales(form: StateForm, left: Expr = S.Zero) -> dict[str, Expr] | None:
    """Return the scales and the dimensionless groups of a line with one wave number; None for any other problem.

    The family has one field, no lumped coordinate, no damping, the density ``a v_t^2 / 2 - c (d^n v / dx^n)^2 / 2`` for
    n = 1 or 2 with a and c constant along x, and at each end and each displacement a spring, a mass, both or a support.
    Conditions that couple two displacements, such as those of a tip mass with an offset, are excluded.

    Parameters
    ----------
    form : StateForm
    left : Expr
        Where the left end is.

    Returns
    -------
    dict of str to Expr
        By name: the structure (its value means nothing), ``left``, ``length``, ``inertia`` a, ``stiffness`` c,
        ``scale`` of ``omega = scale lambda^n``, then for each channel, in the order of `cra_sym.mechanics.one_wave`,
        ``kappa`` and ``mu`` as far as it has them.
    """
    n, z = len(form.displacements), form.parameter
    if form.damped or form.coordinates or n not in (1, 2) or not form.uniform:
        return None
    stiffness = cancel(1 / form.system[n - 1, 2 * n - 1]) if form.system[n - 1, 2 * n - 1] != 0 else S.Zero
    inertia = cancel(-form.system[n, 0] / z)
    if stiffness == 0 or inertia == 0 or stiffness.has(z) or inertia.has(z):
        return None
    if (form.system - _system(n, inertia, stiffness, z)).applyfunc(cancel) != zeros(2 * n, 2 * n):
        return None
    ends = _ends(form)
    if ends is None:
        return None
    kinds = [kind for kind, _ in ends]
    names = "|".join(",".join(kinds[end * n : end * n + n]) for end in (0, 1))
    found = {STRUCTURE + names: S.Zero, "left": left, "length": form.length, "inertia": inertia}
    found |= {"stiffness": stiffness, "scale": sqrt(stiffness / inertia) / form.length**n}
    for number, (kind, (spring, mass)) in enumerate(ends):
        j = number % n
        groups = {"k": ("kappa", spring * form.length ** (2 * n - 1 - 2 * j) / stiffness)}
        groups["m"] = ("mu", mass / (inertia * form.length ** (1 + 2 * j)))
        found |= {f"{name} {number}": value for letter, (name, value) in groups.items() if letter in kind}
    return found


def _system(n: int, inertia: Expr, stiffness: Expr, z: Symbol) -> Matrix:
    """Return the system of a string or a beam."""
    system = zeros(2 * n, 2 * n)
    for j in range(n - 1):
        system[j, j + 1] = Integer(1)
        system[n + j + 1, n + j] = Integer(-1)
    system[n - 1, 2 * n - 1] = 1 / stiffness
    system[n, 0] = -inertia * z
    return system


def _ends(form: StateForm) -> list[tuple[str, tuple[Expr, Expr]]] | None:
    """Return the kind of each channel with its stiffness and its mass, None if conditions link displacements."""
    z, found = form.parameter, []
    boundary = form.boundary.applyfunc(cancel)
    free = {tuple(form.free.col(i)) for i in range(form.free.cols)}
    units = [tuple(Matrix.eye(boundary.rows).col(i)) for i in range(boundary.rows)]
    if not free <= set(units):
        return None
    moving = [i for i, unit in enumerate(units) if unit in free]
    if any(boundary[i, k] != 0 for i in moving for k in moving if i != k):
        return None
    for i in range(boundary.rows):
        spring = cancel(boundary[i, i].subs(z, 0))
        mass = cancel((spring - boundary[i, i]) / z)
        if mass.has(z):
            return None
        kind = ("k" if spring != 0 else "") + ("m" if mass != 0 else "")
        found.append((kind, (spring, mass)) if i in moving else ("h", (S.Zero, S.Zero)))
    return found
