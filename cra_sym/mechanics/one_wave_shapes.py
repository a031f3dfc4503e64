"""Mode shapes of a line with one wave number, in two bases that between them keep every digit at any frequency.

The notation is that of `cra_sym.mechanics.one_wave`, ``xi = x / L``. The channels of the left end leave one amplitude
alpha_j each open, and with them the state there is exact for any stiffness and inertia, zero and infinity included:

    q_j(0) = c_j alpha_j,   P_j(0) = S_j alpha_j.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

import sympy as sp

from cra_sym.mechanics.one_wave import (
    Derivation,
    Structure,
    b,
    channels,
    conditions,
    cos_,
    force_rows,
    parameters,
    sin_,
    z,
)
from cra_sym.symbols import symbol

__all__ = [
    "NEAR",
    "amplitudes_far",
    "end_state",
    "generalised_mass",
    "inertias",
    "integral_far",
    "invariant_far",
    "invariant_near",
    "leading",
    "polynomials",
    "prepared",
    "rates",
    "rigid_body",
    "rows",
    "shape_far",
    "tip_far",
    "tip_near",
    "tip_rows",
]

NEAR = {1: 2, 2: 25}
"""Below this z a shape is a power series from the left end, above it waves and decaying exponentials."""

xi = symbol("xi")
ALPHA = sp.symbols("alpha beta", real=True)
KRYLOV = sp.symbols("k0:4", positive=True)  # the solutions with one unit derivative at the left end
WAVES = A, B, C, D = sp.symbols("A B C D", real=True)  # cos b xi, sin b xi, exp(-b xi), exp(-b (1 - xi))
RAW = sp.symbols("phi_0:4", real=True)  # the shape and its derivatives at the right end, as its basis gives them
decay = sp.Symbol("decay", real=True)
inverse, root = sp.symbols("inverse root", positive=True)  # 1 / z and the square root of z, or one over this


def _n(structure: Structure) -> int:
    return len(structure[0])


def _indexed(name: str, structure: Structure, letter: str, ends: tuple[int, ...] = (0, 1)) -> dict[int, sp.Symbol]:
    """Return a symbol for each channel of some ends whose kind holds a letter."""
    n = _n(structure)
    found = ((i, kind) for i, kind in enumerate(channels(structure)) if i // n in ends)
    return {i: sp.Symbol(f"{name}_{i}", real=True) for i, kind in found if letter in kind}


def inertias(structure: Structure) -> dict[int, sp.Symbol]:
    """Return the inertia mu of each channel that has one."""
    return _indexed("mu", structure, "m")


def _amplitudes(structure: Structure) -> dict[int, sp.Symbol]:
    """Return the amplitude of each channel of the right end that has a spring: ``q = c a``, ``P = -S a``."""
    return _indexed("a", structure, "k", (1,))


def _massive(structure: Structure) -> dict[int, sp.Symbol]:
    """Return the inertia of each channel of the right end that has no spring beside it."""
    return {i: mu for i, mu in inertias(structure).items() if i >= _n(structure) and channels(structure)[i] == "m"}


def _state_symbols(name: str, structure: Structure) -> tuple[sp.Symbol, ...]:
    return tuple(sp.Symbol(f"{name}_{j}", real=True) for j in range(_n(structure)))


def _whole(structure: Structure) -> dict[sp.Symbol, sp.Expr]:
    """Return a symbol for each S of a spring with an inertia beside it: expanded, its terms would cancel apart."""
    pairs = enumerate(conditions(structure)[0])
    return {sp.Symbol(f"S_{i}", real=True): stiff for i, (stiff, _) in pairs if stiff.is_Add}


def _pairs(structure: Structure) -> list[tuple[sp.Expr, sp.Expr]]:
    """Return (S, c) of every channel, with the symbols of `_whole`."""
    names = {stiff: name for name, stiff in _whole(structure).items()}
    return [(names.get(stiff, stiff), soft) for stiff, soft in conditions(structure)[0]]


def _left(structure: Structure) -> tuple[list[sp.Expr], list[sp.Expr]]:
    """Return q and P at the left end in the amplitudes."""
    pairs = _pairs(structure)[: _n(structure)]
    both = [(c * a, s * a) for (s, c), a in zip(pairs, ALPHA, strict=False)]
    return [q for q, _ in both], [p for _, p in both]


def _left_derivatives(structure: Structure) -> list[sp.Expr]:
    """Return the shape and its derivatives at the left end in the amplitudes."""
    q, p = _left(structure)
    n = len(q)
    return [*q, *((-1) ** (n - 1 - j) * p[j] for j in reversed(range(n)))]


def _left_parameters(structure: Structure) -> tuple[sp.Symbol, ...]:
    return parameters((structure[0], ("",) * _n(structure)))


def polynomials(n: int) -> Derivation:
    """Return, for z up to `NEAR`, the solutions with one unit derivative at the left end, as functions of xi."""
    order = next(m for m in range(1, 60) if sp.Float(NEAR[n]) ** m / sp.factorial(2 * n * m) < 2.0**-60)
    y = sp.Symbol("y", real=True)  # z xi^(2n)
    sign = (-1) ** n
    series = (sum((sign * y) ** m / sp.factorial(2 * n * m + j) for m in range(order)) for j in range(2 * n))
    terms = [sp.horner(term, y).subs(y, z * xi ** (2 * n)) for term in series]
    return tuple(xi**j * term for j, term in enumerate(terms)), (xi, z)


def _near(structure: Structure, derivative: int) -> sp.Expr:
    """Return a derivative of the shape at xi = 1 in the Krylov functions there."""
    size = 2 * _n(structure)
    # the derivative of the j-th solution is the one before it; of the first, (-1)^n z times the last
    factors = [((-1) ** _n(structure) * z) ** ((derivative - j + size - 1) // size) for j in range(size)]
    images = [factor * KRYLOV[(j - derivative) % size] for j, factor in enumerate(factors)]
    return sum((s * image for s, image in zip(_left_derivatives(structure), images, strict=True)), sp.Integer(0))


def _right_conditions(structure: Structure, derivatives: list[sp.Expr]) -> list[sp.Expr]:
    """Return what has to vanish at the right end, given the shape and its derivatives there."""
    n = _n(structure)
    state = force_rows(sp.Matrix(derivatives))
    pairs = _pairs(structure)[n:]
    return [(-1) ** (n - 1 - j) * (s * state[j] + c * state[n + j]) for j, (s, c) in enumerate(pairs)]


def tip_rows(structure: Structure) -> Derivation:
    """Return the conditions of the right end as rows in the amplitudes, each entry with its terms' magnitudes."""
    size = 2 * _n(structure)
    entries = []
    for condition in _right_conditions(structure, [_near(structure, d) for d in range(size)]):
        for amplitude in ALPHA[: _n(structure)]:
            entry = sp.expand(condition).coeff(amplitude)
            entries += [entry, sum(abs(term) for term in sp.Add.make_args(entry))]
    return _written_out(entries, structure), (*parameters(structure), z, *KRYLOV[:size])


def tip_near(structure: Structure) -> Derivation:
    """Return the shape and its derivatives at the right end from the amplitudes and the Krylov functions there."""
    size = 2 * _n(structure)
    left = _left_parameters(structure)
    tip = [_near(structure, d) for d in range(size)]
    return _written_out(tip, structure), (*left, *ALPHA[: _n(structure)], z, *KRYLOV[:size])


def _waves(n: int, order: int, cosine: sp.Expr, sine: sp.Expr, from_left: sp.Expr, from_right: sp.Expr) -> sp.Expr:
    """Return a derivative of the shape in waves and decaying exponentials."""
    turned = [(cosine, sine), (-sine, cosine), (-cosine, -sine), (sine, -cosine)][order % 4]
    near_ends = (-1) ** order * C * from_left + D * from_right if n == 2 else sp.Integer(0)
    return b**order * (A * turned[0] + B * turned[1] + near_ends)


def _at_right(n: int) -> list[sp.Expr]:
    return [_waves(n, d, cos_, sin_, decay, sp.Integer(1)) for d in range(2 * n)]


def _at_left(n: int) -> list[sp.Expr]:
    one, zero = sp.Integer(1), sp.Integer(0)
    return [_waves(n, d, one, zero, one, decay) for d in range(2 * n)]


def amplitudes_far(structure: Structure) -> Derivation:
    """Return the amplitudes of the left end and those of the waves of a mode with z over `NEAR`.

    In a beam the growing exponential has to be small at the left end and to meet the conditions of the right end; the
    rest of these is then met because z is a zero of the determinant.
    """
    n = _n(structure)
    arguments = (*parameters(structure), b, cos_, sin_, decay)
    unknown, left = list(WAVES[: 2 * n]), _left_derivatives(structure)
    if n == 1:
        solution = sp.solve([a - s for a, s in zip(_at_left(1), left, strict=True)], unknown, dict=True)[0]
        found = [sp.Integer(1), *(solution[x].subs(ALPHA[0], 1) for x in unknown)]
        return tuple(_in_b(x, 1) for x in _written_out(found, structure)), arguments
    growing = sp.Symbol("growing")  # D times its decay
    equations = [sp.expand(a - s).subs(D, growing / decay) for a, s in zip(_at_left(2), left, strict=True)]
    waves = sp.solve([sp.expand(e) for e in equations], [A, B, C, growing], dict=True)[0]
    at_left = waves.pop(growing)
    held = _from_the_right(structure, waves)
    remainder = at_left - decay * held
    ratio = {ALPHA[0]: sp.diff(remainder, ALPHA[1]), ALPHA[1]: -sp.diff(remainder, ALPHA[0])}
    amplitudes = [*ratio.values(), *(waves[x].subs(ratio, simultaneous=True) for x in (A, B, C))]
    amplitudes.append(held.subs(ratio, simultaneous=True))
    return tuple(_in_b(x, n) for x in _written_out(amplitudes, structure)), arguments


def _written_out(expressions: Sequence[sp.Expr], structure: Structure) -> tuple[sp.Expr, ...]:
    return tuple(x.xreplace(_whole(structure)) for x in expressions)


def _in_b(expression: sp.Expr, n: int) -> sp.Expr:
    return expression.subs(z, b ** (2 * n))


def _from_the_right(structure: Structure, waves: dict[sp.Symbol, sp.Expr]) -> sp.Expr:
    """Return D, in the amplitudes, from the conditions of the right end.

    One condition in which its coefficient is a sum of terms of one sign is enough. Where a spring on the displacement
    and an inertia of the slope leave none, both are taken, weighted by what is left of the coefficients.
    """
    rows = [sp.expand(_in_b(row, 2) / b**3) for row in _right_conditions(structure, _at_right(2))]
    for row in rows:
        terms = sp.Add.make_args(sp.expand(row.coeff(D)))
        if not row.has(*_whole(structure)) and len({sp.sign(term.as_coeff_Mul()[0]) for term in terms}) == 1:
            return -row.subs(D, 0).subs(waves) / row.coeff(D)
    above, below = [], []
    for row in rows:
        entry = row.coeff(D)
        size = sum(term**2 for term in sp.Add.make_args(sp.expand(entry)))
        above.append(entry * row.subs(D, 0).subs(waves) / size)
        below.append(entry**2 / size)
    return -sum(above) / sum(below)


def tip_far(n: int) -> Derivation:
    """Return the shape and its derivatives at the right end from the wave amplitudes."""
    return tuple(_at_right(n)), (*WAVES[: 2 * n], b, cos_, sin_, decay)


def shape_far(n: int) -> Derivation:
    """Return the shape and its derivatives at xi from the wave amplitudes."""
    functions = sp.cos(b * xi), sp.sin(b * xi), sp.exp(-b * xi), sp.exp(-b * (1 - xi))
    return tuple(_waves(n, d, *functions) for d in range(2 * n)), (*WAVES[: 2 * n], b, xi)


def integral_far(n: int) -> Derivation:
    """Return the integral of the shape from 0 to 1 from the wave amplitudes."""
    near_ends = (C + D) * (1 - decay) if n == 2 else sp.Integer(0)
    return ((A * sin_ + B * (1 - cos_) + near_ends) / b,), (*WAVES[: 2 * n], b, cos_, sin_, decay)


def _exponent(number: int, n: int) -> int:
    """Return the power of lambda by which the force of a channel outgrows its displacement."""
    return 2 * (n - number % n) - 1


def prepared(structure: Structure) -> Derivation:
    """Return what the modes of one parameter set have in common: 1 / mu, where needed, and sqrt(s c) of the springs."""
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

    A condition links q and P. Where a stiff spring or a heavy inertia keeps q small, P knows it better.
    """
    n = _n(structure)
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
    left = _left_parameters(structure)
    return _written_out([_invariant(_left_derivatives(structure))], structure), (*left, *ALPHA[: _n(structure)], z)


def invariant_far(n: int) -> Derivation:
    """Return the invariant from the wave amplitudes."""
    found = sp.factor(_invariant(_at_left(n)).subs(b ** (2 * n), z))
    return (found,), (*WAVES[: 2 * n], decay, z)


def generalised_mass(structure: Structure) -> Derivation:
    """Return the modal mass over a L from end values alone, for z > 0, given the invariant H.

    ``2n z phi^2`` is the derivative of ``xi H - sum (2 (n - j) - 1) q_j P_j``. At the ends the conditions turn the
    products into squares, ``P = -+(kappa - z mu) q``: nothing cancels.
    """
    n = _n(structure)
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
    n = _n(structure)
    q, p = (_written_out(x, structure) for x in _left(structure))
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
    n = _n(structure)
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

    Translation, where no spring or support is in its way, comes first; then the rotation about the displacement that
    is held, or about the centre of mass.
    """
    n = _n(structure)
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
    """Return what is to be positive: the first displacement of the right end that moves, else the field beside it."""
    n = _n(structure)
    q, p = (_state_symbols(name, structure) for name in ("q", "p"))
    found = (-1) ** n * p[n - 1]
    for kind, x in reversed(list(zip(structure[1], q, strict=True))):
        if kind in ("", "m"):
            found = x
        elif kind != "h":
            found = sp.Piecewise((x, sp.Ne(x, 0)), (found, True))
    return (found,), (*q, *p)
