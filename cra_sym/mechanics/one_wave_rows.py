"""Modal quantities of a line with one wave number from the end values of its shapes: mass, momentum, forces, rates.

The notation is that of `cra_sym.mechanics.one_wave` and `cra_sym.mechanics.one_wave_shapes`.
"""

from __future__ import annotations

from itertools import chain

import sympy as sp

from cra_sym.mechanics.one_wave import Derivation, Structure, b, channels, conditions, force_rows, parameters, z
from cra_sym.mechanics.one_wave_shapes import (
    ALPHA,
    WAVES,
    at_left,
    decay,
    left,
    left_derivatives,
    left_parameters,
    written_out,
    xi,
)

__all__ = [
    "end_state",
    "generalised_mass",
    "inertias",
    "invariant_far",
    "invariant_near",
    "leading",
    "prepared",
    "rates",
    "rigid_body",
    "rows",
]

RAW = sp.symbols("phi_0:4", real=True)  # the shape and its derivatives at the right end, as its basis gives them
inverse, root = sp.symbols("inverse root", positive=True)  # 1 / z and the square root of z, or one over this


def _indexed(name: str, structure: Structure, letter: str, ends: tuple[int, ...] = (0, 1)) -> dict[int, sp.Symbol]:
    """Return a symbol for each channel of some ends whose kind holds a letter."""
    n = len(structure[0])
    found = ((i, kind) for i, kind in enumerate(channels(structure)) if i // n in ends)
    return {i: sp.Symbol(f"{name}_{i}", real=True) for i, kind in found if letter in kind}


def inertias(structure: Structure) -> dict[int, sp.Symbol]:
    """Return the inertia mu of each channel that has one."""
    return _indexed("mu", structure, "m")


def _amplitudes(structure: Structure) -> dict[int, sp.Symbol]:
    """Return the amplitude of each channel of the right end that has a spring: ``q = c a``, ``P = -S a``."""
    return _indexed("a", structure, "k", (1,))


def _massive(structure: Structure) -> dict[int, sp.Symbol]:
    """Return the inertia of each channel of the right end that has no spring."""
    return {i: mu for i, mu in inertias(structure).items() if i >= len(structure[0]) and channels(structure)[i] == "m"}


def _state_symbols(name: str, structure: Structure) -> tuple[sp.Symbol, ...]:
    return tuple(sp.Symbol(f"{name}_{j}", real=True) for j in range(len(structure[0])))


def _exponent(number: int, n: int) -> int:
    """Return the power of lambda by which the force of a channel outgrows its displacement."""
    return 2 * (n - number % n) - 1


def prepared(structure: Structure) -> Derivation:
    """Return the quantities common to all modes of a set: 1 / mu, where needed, and sqrt(s c) of the springs."""
    pairs = _springs(structure)
    found = [*(1 / mu for mu in _massive(structure).values()), *(sp.sqrt(s * c) for s, c in pairs.values())]
    return tuple(found), (*parameters(structure), *inertias(structure).values())


def _prepared_symbols(structure: Structure) -> tuple[dict[int, sp.Symbol], dict[int, sp.Symbol]]:
    light = {i: sp.Symbol(f"light_{i}", positive=True) for i in _massive(structure)}
    return light, {i: sp.Symbol(f"g_{i}", positive=True) for i in _springs(structure)}


def _springs(structure: Structure) -> dict[int, tuple[sp.Symbol, sp.Expr]]:
    """Return (s, c) of every channel with a spring; s is that of the spring alone."""
    pairs = conditions(structure)[0]
    kinds = channels(structure)
    return {i: (sp.Symbol(f"s_{i}", nonnegative=True), c) for i, (_, c) in enumerate(pairs) if "k" in kinds[i]}


def end_state(structure: Structure) -> Derivation:
    """Return q, P and the amplitudes of springs at the right end from the raw shape and its derivatives there.

    Each condition relates q and P. With a stiff spring or a heavy inertia q is small and is computed from P.
    """
    n = len(structure[0])
    raw = force_rows(sp.Matrix(RAW[: 2 * n]))
    light, _ = _prepared_symbols(structure)
    q, p, amplitudes = [], [], []
    for j, ((stiff, soft), kind) in enumerate(zip(conditions(structure)[0][n:], structure[1], strict=True)):
        number, limit = n + j, 1 + b ** _exponent(j, n)
        if kind == "h":
            q.append(sp.Integer(0))
            p.append(raw[n + j])
        elif kind == "":
            q.append(raw[j])
            p.append(sp.Integer(0))
        elif kind == "m":
            mu = inertias(structure)[number]
            heavy = raw[n + j] * (light[number] * inverse)
            q.append(sp.Piecewise((heavy, mu * z > limit), (raw[j], True)))
            p.append(mu * z * q[-1])
        else:
            heavy = stiff > soft * limit if kind == "k" else stiff**2 > (soft * limit) ** 2
            amplitudes.append(sp.Piecewise((-raw[n + j] / stiff, heavy), (raw[j] / soft, True)))
            q.append(soft * amplitudes[-1])
            p.append(-stiff * amplitudes[-1])
    arguments = (*parameters(structure), *inertias(structure).values(), *light.values(), b, z, inverse, *RAW[: 2 * n])
    return (*q, *p, *amplitudes), arguments


def _end_arguments(structure: Structure) -> tuple[sp.Symbol, ...]:
    """Return q, P and amplitudes of the right end as `end_state` returns them."""
    state = (_state_symbols(name, structure) for name in ("q", "p"))
    return (*chain.from_iterable(state), *_amplitudes(structure).values())


def _invariant(derivatives: list[sp.Expr]) -> sp.Expr:
    """Return twice the Hamiltonian of the field equation, which is the same at every xi."""
    n = len(derivatives) // 2
    state = force_rows(sp.Matrix(derivatives))
    work = sum(state[n + j] * derivatives[j + 1] for j in range(n))
    return sp.expand(2 * work - derivatives[n] ** 2 + z * derivatives[0] ** 2)


def invariant_near(structure: Structure) -> Derivation:
    """Return the invariant of `generalised_mass` from the amplitudes of the left end."""
    left = left_parameters(structure)
    return written_out([_invariant(left_derivatives(structure))], structure), (*left, *ALPHA[: len(structure[0])], z)


def invariant_far(n: int) -> Derivation:
    """Return the invariant from the wave amplitudes."""
    found = sp.factor(_invariant(at_left(n)).subs(b ** (2 * n), z))
    return (found,), (*WAVES[: 2 * n], decay, z)


def generalised_mass(structure: Structure) -> Derivation:
    """Return the modal mass over a L from end values alone, for z > 0, given the invariant H.

    ``2n z phi^2`` is the derivative of ``xi H - sum (2 (n - j) - 1) q_j P_j``. By the end conditions the
    products are squares, ``P = -+(kappa - z mu) q``: without cancellation.
    """
    n = len(structure[0])
    invariant = sp.Symbol("invariant", real=True)
    springs, massive, own = _springs(structure), _massive(structure), conditions(structure)[0]
    amplitudes = dict(enumerate(ALPHA[:n])) | _amplitudes(structure)
    tips = {i: sp.Symbol(name, real=True) for i, name in zip(massive, ("tip", "slope"), strict=False)}
    total = invariant / (2 * n * z)
    for number, kind in enumerate(channels(structure)):
        weight = sp.Rational(_exponent(number, n), 2 * n)
        if "k" in kind:
            s, c = springs[number]
            total += weight * s * c * amplitudes[number] ** 2 / z
        if number in massive:
            total += (1 - weight) * massive[number] * tips[number] ** 2
        elif "m" in kind:
            inertia = sp.Symbol(f"i_{number}", nonnegative=True)
            total += (1 - weight) * inertia * own[number][1] * amplitudes[number] ** 2
    arguments = (*parameters(structure), *ALPHA[:n], z, invariant, *tips.values())
    return (total,), (*arguments, *_amplitudes(structure).values(), *massive.values())


def _spring_forces(structure: Structure) -> dict[int, sp.Expr]:
    """Return the force of each spring, ``kappa q``, where it is not all of P."""
    amplitudes = dict(enumerate(ALPHA)) | _amplitudes(structure)
    both = [i for i, kind in enumerate(channels(structure)) if kind == "km"]
    return {i: _springs(structure)[i][0] * amplitudes[i] for i in both}


def rows(structure: Structure) -> Derivation:
    """Return the rows of a table of modes: right P, right q, momentum, left q, left P, strain roots, spring forces.

    The momentum, the integral of phi with the masses of both ends, is that of the springs and supports over z.
    """
    n = len(structure[0])
    q, p = (written_out(x, structure) for x in left(structure))
    right_q, right_p = (_state_symbols(name, structure) for name in ("q", "p"))
    amplitudes = dict(enumerate(ALPHA[:n])) | _amplitudes(structure)
    _, roots = _prepared_symbols(structure)
    push = sum((s * amplitudes[i] for i, (s, _) in _springs(structure).items() if i % n == 0), sp.Integer(0))
    push += (ALPHA[0] if structure[0][0] == "h" else 0) - (right_p[0] if structure[1][0] == "h" else 0)
    strain = [g * amplitudes[i] for i, g in roots.items()]
    result = [*right_p, *right_q, push * inverse, *q, *p, *strain, *_spring_forces(structure).values()]
    return tuple(result), (*parameters(structure), *roots.values(), *ALPHA[:n], z, inverse, *_end_arguments(structure))


def rates(structure: Structure) -> Derivation:
    """Return rows of rates of z over its square root: by the springs, by their logarithms, by compliances, by inertias.

    They follow by first-order perturbation from the normalised modes. Those by logarithms are half of those of ln z.
    """
    n = len(structure[0])
    q = [*_state_symbols("ql", structure), *_state_symbols("q", structure)]
    p = [*_state_symbols("pl", structure), *_state_symbols("p", structure)]
    springs, masses = _springs(structure), inertias(structure)
    strain = {i: sp.Symbol(f"e_{i}", real=True) for i in springs}
    forces = {i: sp.Symbol(f"f_{i}", real=True) for i in _spring_forces(structure)}
    square = sp.Symbol("square", positive=True)
    found = [q[i] ** 2 * root for i in springs]
    found += [(strain[i] * root) ** 2 / 2 for i in springs]
    found += [-(forces.get(i, p[i]) ** 2) * root for i in springs]
    found += [-(q[i] ** 2) * square for i in masses]
    found += [-mu * q[i] ** 2 / 2 for i, mu in masses.items()]
    own = (*p[n:], *q[n:], *q[:n], *p[:n], *strain.values(), *forces.values())
    return tuple(found), (*masses.values(), square, root, *own)


def rigid_body(structure: Structure) -> Derivation:
    """Return rigid-body motion, amplitudes, generalised mass and momentum of a mode with z = 0.

    Translation, if no spring or support resists it, comes first; then the rotation about the held displacement, or
    about the centre of mass.
    """
    n = len(structure[0])
    first, masses = sp.Symbol("first", nonnegative=True), inertias(structure)
    mass = [masses.get(i, sp.Integer(0)) for i in range(2 * n)]
    still = [_is_held(structure, i) for i in range(2 * n)]
    value, slope = sp.Symbol("value", real=True), sp.Symbol("slope", real=True) if n == 2 else sp.Integer(0)
    shape = value + slope * xi
    total = sp.integrate(shape**2, (xi, 0, 1))
    momentum = sp.integrate(shape, (xi, 0, 1))
    for end, at in ((0, value), (n, shape.subs(xi, 1))):
        total, momentum = total + mass[end] * at**2, momentum + mass[end] * at
    found: dict[sp.Symbol, sp.Expr] = {value: sp.Integer(1)}
    if n == 2:
        total += (mass[1] + mass[3]) * slope**2
        centre = (sp.Rational(1, 2) + mass[2]) / (1 + mass[0] + mass[2])
        translates = sp.And(first > 0, sp.Not(still[0]), sp.Not(still[2]))
        about = sp.Piecewise((0, still[0]), (-1, still[2]), (-centre, True))
        found = {
            value: sp.Piecewise((1, translates), (about, True)),
            slope: sp.Piecewise((0, translates), (1, True)),
        }
    amplitudes = [
        sp.Piecewise((0, still[j]), (x / conditions(structure)[0][j][1], True)) if still[j] != True else sp.Integer(0)  # noqa: E712
        for j, x in enumerate((value, slope)[:n])
    ]
    result = [*(value, slope)[:n], *amplitudes, total, momentum]
    return tuple(e.subs(found) for e in result), (*parameters(structure), *masses.values(), first)


def _is_held(structure: Structure, number: int) -> sp.Basic:
    kind = channels(structure)[number]
    if kind == "h":
        return sp.true
    return sp.Symbol(f"s_{number}", nonnegative=True) > 0 if "k" in kind else sp.false


def leading(structure: Structure) -> Derivation:
    """Return the quantity made positive: the first nonzero displacement of the right end, else the field next to it."""
    n = len(structure[0])
    q, p = (_state_symbols(name, structure) for name in ("q", "p"))
    found = (-1) ** n * p[n - 1]
    for kind, x in reversed(list(zip(structure[1], q, strict=True))):
        if kind in ("", "m"):
            found = x
        elif kind != "h":
            found = sp.Piecewise((x, sp.Ne(x, 0)), (found, True))
    return (found,), (*q, *p)
