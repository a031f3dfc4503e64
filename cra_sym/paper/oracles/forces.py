"""Forces, virtual work and inertia of the arm written by hand: the exact second route of (3)-(16) and (36).

Nothing here comes from the Lagrangian.
"""

from __future__ import annotations

from sympy import Expr, Integral, S

from cra_sym.symbols import symbol

__all__ = ["mass_product", "newton", "rigid_body", "spring_product", "stiffness_product", "virtual_work"]

x, t, L, w, v, F = (symbol(name) for name in ("x", "t", "L", "w", "v", "F"))
E, I_z, rho, A = (symbol(name) for name in ("E", "I_z", "rho", "A"))
m_b, m_e, J_e, k_t, k_r = (symbol(name) for name in ("m_b", "m_e", "J_e", "k_t", "k_r"))


def rigid_body() -> tuple[Expr, ...]:
    """Return mass, static moment and moment of inertia about the root of a strip with a point mass at its end."""
    return tuple(rho * A * L**n / n + m_e * L ** (n - 1) for n in (1, 2, 3))


def mass_product(first: Expr, second: Expr) -> Expr:
    """Return the work of the inertia forces of manipulator and end-effector, accelerated in one shape, on another."""
    tip = m_e * first * second + J_e * first.diff(x) * second.diff(x)
    return Integral(rho * A * first * second, (x, 0, L)) + tip.subs(x, L)


def spring_product(first: Expr, second: Expr) -> Expr:
    """Return the work of the two joint springs, deflected in one shape, on another."""
    return (k_t * first * second + k_r * first.diff(x) * second.diff(x)).subs(x, 0)


def stiffness_product(first: Expr, second: Expr) -> Expr:
    """Return the work of manipulator and joint, deflected in one shape, on another."""
    return Integral(E * I_z * first.diff(x, 2) * second.diff(x, 2), (x, 0, L)) + spring_product(first, second)


def virtual_work(virtual: Expr) -> Expr:
    """Return the virtual work of all elastic and inertia forces on the manipulator, its joint and its end-effector."""
    return -stiffness_product(v, virtual) - mass_product((w + v).diff(t, 2), virtual)


def newton() -> tuple[Expr, ...]:
    """Return the residuals of Newton's law, with inertia forces, of an Euler-Bernoulli beam.

    Force on a slice per length, force and moment on the joint, force and moment on the end-effector, and the force on
    the whole arm, carried by the base and driven by F.
    """
    moment = E * I_z * v.diff(x, 2)
    shear, acceleration = moment.diff(x), (w + v).diff(t, 2)
    return (
        -shear.diff(x) - rho * A * acceleration,
        (-shear - k_t * v).subs(x, 0),
        (moment - k_r * v.diff(x)).subs(x, 0),
        (shear - m_e * acceleration).subs(x, L),
        (-moment - J_e * v.diff(x, t, t)).subs(x, L),
        F - m_b * w.diff(t, 2) - mass_product(acceleration, S.One),
    )
