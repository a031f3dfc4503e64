"""Strings and beams with any springs, masses and supports: every digit, none missed, shapes, rates, recognition."""

import itertools
import pickle

import mpmath as mp
import numpy as np
import pytest
from numpy.polynomial import Legendre
from numpy.polynomial.legendre import leggauss
from scipy.linalg import eigh, null_space
from sympy import Function, symbols

import cra_sym as cra
from cra_sym.mechanics import state_form
from cra_sym.mechanics.one_wave import link_channels
from cra_sym.model.close_pairs import resolve_close_pairs
from cra_sym.model.one_wave import OneWave, one_wave_route
from cra_sym.model.one_wave_family import family
from cra_sym.solvers.one_wave import Layout
from cra_sym.solvers.one_wave_shapes import ShapeTable

KINDS = ("", "h", "k", "m", "km")
STRINGS = [((left,), (right,)) for left, right in itertools.product(KINDS, KINDS)]
BEAMS = [(ends[:2], ends[2:]) for ends in itertools.product(KINDS, repeat=4)]
SOME = [*STRINGS, *BEAMS[::17], BEAMS[-1]]
NODES, WEIGHTS = leggauss(60)
NODES, WEIGHTS = (1 + NODES) / 2, WEIGHTS / 2


def drawn(structure, seed, size, stiffness=(-6, 7, 0.0, 1e-12, 1e12, np.inf), inertia=(-6, 4, 0.0, 1e-12, 1e6)):
    """Groups log-uniform over a range, about a third of them at its ends."""
    rng = np.random.default_rng([seed, len(structure[0])])

    def draw(low, high, *ends):
        values = 10.0 ** rng.uniform(low, high, size)
        return np.where(rng.random(size) < 0.3, rng.choice(ends, size), values)

    return [draw(*(stiffness if letter == "k" else inertia)) for _, letter in Layout(structure).groups]


def channel_values(structure, groups, lane):
    """kappa and mu of every channel of one lane; a support is an infinite stiffness."""
    values = [[np.inf if kind == "h" else 0.0, 0.0] for kind in Layout(structure).kinds]
    for (channel, letter), group in zip(Layout(structure).groups, groups, strict=True):
        values[channel]["km".index(letter)] = float(group[lane])
    return values


def exact_determinant(n, values, lam):
    """The determinant of the boundary conditions in cos, sin, cosh and sinh, from their definition."""
    z, rows = lam ** (2 * n), []
    at = [(1, 0, 1, 0), (mp.cos(lam), mp.sin(lam), mp.cosh(lam), mp.sinh(lam))]
    for end, (c, s, ch, sh) in enumerate(at):
        turned = [(c, s, ch, sh), (-s, c, sh, ch), (-c, -s, ch, sh), (s, -c, sh, ch)]
        phi = [[lam**order * x for x in turned[order][: 2 * n]] for order in range(2 * n)]
        for j, (kappa, mu) in enumerate(values[end * n : end * n + n]):
            force = [(-1) ** (n - 1 - j) * (1 if end else -1) * x for x in phi[2 * n - 1 - j]]
            if mp.isinf(kappa):
                rows.append(phi[j])
            else:
                rows.append([((kappa - z * mu) * q + p) / (1 + kappa + mu) for q, p in zip(phi[j], force, strict=True)])
    return mp.det(mp.matrix(rows))


def relative_errors(structure, groups, lam):
    """Newton's correction of every positive frequency parameter, relative, from the determinant to 50 digits."""
    n, errors = len(structure[0]), []
    with mp.workdps(50):
        for lane in range(len(lam)):
            values = [[mp.mpf(x) for x in pair] for pair in channel_values(structure, groups, lane)]
            for root in map(mp.mpf, map(float, lam[lane][lam[lane] > 0])):
                h = mp.mpf(10) ** -25
                here, *around = (exact_determinant(n, values, root * (1 + s * h)) for s in (0, 1, -1))
                errors.append(abs(float(here * 2 * h / (around[0] - around[1]))))
    return np.array(errors)


def solved(structure, groups, modes):
    """Frequency parameters with a lane axis."""
    return np.atleast_2d(family(structure).frequency_parameters(*groups, modes=modes, compile=False))


@pytest.mark.sample(21, 1)
@pytest.mark.parametrize("structure", SOME, ids=str)
def test_every_digit_of_lines_with_any_ends(structure):
    groups = drawn(structure, 2, 6)
    lam = solved(structure, groups, 5)
    assert relative_errors(structure, groups, lam).max() < 2e-15


# structures and groups with two modes at a relative distance of 1e-3 to 5e-6, whose zeros have lost digits
TUNED = {
    "two heavy ends": ((("m", "km"), ("km", "k")), [5.483451308281643, 0.0019049965744751935, 406445.492360603,
                       1.0474040435172773, 425309.31339111144, 1016.2422335310938]),
    "a heavy slope and the line": ((("m", "km"), ("km", "k")), [0.04926901651790867, 412435810.60870886,
                                   86963.84708265275, 1.0, 0.059236195642765936, 1.5162119579914854]),
    "a heavy end and the line": ((("km", "m"), ("h", "k")), [179570289.35089546, 713052.2011405991, 0.2946045773947329,
                                 0.002408414791873837]),
    "a heavy slope of a free line": ((("k", "km"), ("", "")), [213.02655870582436, 1212247.9740441372,
                                     3943.1462820074757]),
    "a string": ((("k",), ("km",)), [7.526833186085812, 2379003.793183314, 306290.13988477865]),
}  # fmt: skip


@pytest.mark.parametrize("name", TUNED)
def test_every_digit_of_tuned_pairs(name):
    structure, groups = TUNED[name]
    groups = [np.array([group]) for group in groups]
    lam = solved(structure, groups, 5)
    near = np.argmin(np.diff(lam[0]) / lam[0, 1:])
    assert relative_errors(structure, groups, lam[:, near : near + 2]).max() > 1e-15
    resolve_close_pairs(family(structure), lam, *groups)
    assert relative_errors(structure, groups, lam).max() < 2e-15


def ritz_matrices(n, values, degree=22):
    """Strain and kinetic energy of polynomials with end springs and masses: another route, an upper bound."""
    basis = [Legendre.basis(i, domain=[0, 1]) for i in range(degree)]

    def derivative(order, at):
        return np.array([(b.deriv(order) if order else b)(at) for b in basis])

    bent, shape = derivative(n, NODES), derivative(0, NODES)
    strain, kinetic, held = (bent * WEIGHTS) @ bent.T, (shape * WEIGHTS) @ shape.T, []
    for channel, (kappa, mu) in enumerate(values):
        row = derivative(channel % n, float(channel // n))
        kinetic = kinetic + mu * np.outer(row, row)
        if np.isinf(kappa):
            held.append(row)
        else:
            strain = strain + kappa * np.outer(row, row)
    free = null_space(np.array(held)) if held else np.eye(degree)
    return free.T @ strain @ free, free.T @ kinetic @ free


@pytest.mark.sample(21, 3)
@pytest.mark.parametrize("structure", SOME, ids=str)
def test_none_is_missed(structure):
    """Against Ritz values, whose rounding is that of the largest, 1e9 or so; a zero in their place is one."""
    groups = drawn(structure, 3, 8, (-2, 4, 0.0, np.inf), (-2, 3, 0.0))
    n, lam = len(structure[0]), solved(structure, groups, 5)
    for lane in range(len(lam)):
        strain, kinetic = ritz_matrices(n, channel_values(structure, groups, lane))
        expected = eigh(strain, kinetic, eigvals_only=True)[:5]
        np.testing.assert_allclose(lam[lane] ** (2 * n), expected, rtol=1e-6, atol=1e-5)


@pytest.mark.parametrize("structure", SOME, ids=str)
def test_the_count_steps_by_one_at_every_zero(structure):
    groups = drawn(structure, 4, 40)
    lam, power = solved(structure, groups, 6), 2 * len(structure[0])
    counted = family(structure).characteristic(*groups, lanes=len(lam))
    for mode in range(6):
        positive = np.flatnonzero(lam[:, mode] > 0)
        for side, expected in (
            (1 - 1e-9, (lam < lam[:, [mode]] * (1 - 1e-9))),
            (1 + 1e-9, lam < lam[:, [mode]] * (1 + 1e-9)),
        ):
            below = expected.sum(axis=1)[positive]
            number, value = counted.count((lam[positive, mode] * side) ** power, positive)
            some = below < 6  # all zeros below are among those found
            np.testing.assert_array_equal(number[some], below[some])
            np.testing.assert_array_equal(np.sign(value), (-1.0) ** number)


@pytest.mark.sample(21, 2)
@pytest.mark.parametrize("structure", SOME, ids=str)
def test_modes_are_orthonormal_and_meet_their_conditions(structure):
    groups = drawn(structure, 5, 8, (-3, 4, 0.0, np.inf), (-3, 3, 0.0))
    n, lam, line = len(structure[0]), solved(structure, groups, 5), family(structure)
    modes, table = line.modes(*groups, lam=lam, compile=False), ShapeTable(structure)
    rows = modes.quantities(slice(0, table.size))
    shape, bent = modes.shape(NODES), modes.shape(NODES, n)
    ends, integral = [modes.shape(np.array([0.0, 1.0]), order) for order in range(2 * n)], modes.integral()
    for lane in range(len(lam)):
        values = channel_values(structure, groups, lane)
        gram, strain = (np.einsum("ik,k,jk->ij", f[lane], WEIGHTS, f[lane]) for f in (shape, bent))
        z, momentum = lam[lane] ** (2 * n), shape[lane] @ WEIGHTS
        np.testing.assert_allclose(integral[lane], momentum, atol=1e-12)
        for channel, (kappa, mu) in enumerate(values):
            end, j = divmod(channel, n)
            q = rows[(table.right if end else table.left)][j][lane]
            p = rows[(table.right_force if end else table.left_force)][j][lane]
            gram += mu * np.outer(q, q)
            momentum = momentum + (mu * q if j == 0 else 0.0)
            if np.isinf(kappa):
                assert (q == 0).all()
            else:
                strain += kappa * np.outer(q, q)
                left_over = (kappa - z * mu) * q + (1 if end else -1) * p
                np.testing.assert_allclose(left_over, 0.0, atol=1e-14 * (kappa + z * mu).max() * np.abs(q).max())
            sizes = np.maximum(lam[lane], 1) ** np.array([[j], [2 * n - 1 - j]]) * np.abs(shape[lane]).max(axis=1)
            np.testing.assert_allclose(ends[j][lane, :, end] / sizes[0], q / sizes[0], atol=1e-10)
            force = (-1) ** (n - 1 - j) * ends[2 * n - 1 - j][lane, :, end]
            np.testing.assert_allclose(force / sizes[1], p / sizes[1], atol=1e-9)
        np.testing.assert_allclose(gram, np.eye(5), atol=1e-11)
        roots = np.where(z > 0, np.sqrt(z), 1.0)
        np.testing.assert_allclose(strain / np.outer(roots, roots), np.diag((z > 0) * 1.0), atol=1e-10)
        np.testing.assert_allclose(rows[table.momentum][lane] / np.abs(rows[table.momentum][lane]).max(initial=1.0),
                                   momentum / np.abs(momentum).max(initial=1.0), atol=1e-10)  # fmt: skip


@pytest.mark.parametrize("structure", [s for s in SOME if Layout(s).groups][::3], ids=str)
def test_rates_are_slopes(structure):
    """Central differences of ln z by the logarithm of each group; their own error is 1e-4 squared."""
    groups = drawn(structure, 6, 6, (-1, 2, 0.5), (-1, 1, 0.5))
    n, lam, line = len(structure[0]), solved(structure, groups, 3), family(structure)
    table = ShapeTable(structure)
    modes = line.modes(*groups, lam=lam, compile=False)
    springs, inertias = len(table.springs), len(table.inertias)
    own = [*modes.quantities(table.by_springs)[springs:], *modes.quantities(table.by_inertias)[inertias:]]
    for position, rate in zip((*table.springs, *table.inertias), own, strict=True):
        changed = [[g * (1 + s * 1e-4 * (i == position)) for i, g in enumerate(groups)] for s in (1, -1)]
        up, down = (solved(structure, g, 3) ** (2 * n) for g in changed)
        moving = lam > 0
        slope = np.where(moving, (up - down) / np.where(moving, up + down, 1.0), 0.0) / 2e-4
        np.testing.assert_allclose(np.where(moving, rate, 0.0), slope, rtol=1e-5, atol=1e-6)


def test_the_numeric_layout_is_that_of_the_derivation():
    for structure in SOME:
        assert len(Layout(structure).changes) == len(link_channels(structure))
        names = [f"{letter}_{channel}" for channel, letter in Layout(structure).parameters]
        arguments = family(structure).functions["coefficients"].arguments
        assert list(arguments) == names


x, t, a, c, l, k, m, h = symbols("x t a c l k m h", positive=True)
y = Function("y")(x, t)


def line(n, further=0, **ends):
    density = a * y.diff(t) ** 2 / 2 - c * y.diff(x, n) ** 2 / 2 + further
    return cra.Model(density, fields=[y], x=x, domain=(h, h + l), t=t, **ends)


def route_of(model):
    return one_wave_route(state_form(model.equations), model.symbols, h)


ENDS = {
    "k|m": {"n": 1, "left": -k * y**2 / 2, "right": m * y.diff(t) ** 2 / 2},
    "h|km": {"n": 1, "essential": [y.subs(x, h)], "right": m * y.diff(t) ** 2 / 2 - k * y**2 / 2},
    "k,h|m,": {
        "n": 2, "left": -k * y**2 / 2, "right": m * y.diff(t) ** 2 / 2, "essential": [y.diff(x).subs(x, h)],
    },
    ",m|h,k": {
        "n": 2, "left": m * y.diff(t, x) ** 2 / 2, "right": -k * y.diff(x) ** 2 / 2, "essential": [y.subs(x, h + l)],
    },
    "km,|,km": {
        "n": 2, "left": m * y.diff(t) ** 2 / 2 - k * y**2 / 2,
        "right": m * y.diff(t, x) ** 2 / 2 - k * y.diff(x) ** 2 / 2,
    },
}  # fmt: skip


@pytest.mark.parametrize("name", ENDS)
def test_numbers_of_a_model_are_those_of_the_dynamic_stiffness(name):
    """In SI units, up to the sign; the general route resolves shapes to 1e-7 or better."""
    model = line(**ENDS[name])
    route = pickle.loads(pickle.dumps(route_of(model)))
    assert isinstance(route, OneWave) and repr(route) == f"<OneWave structure {name}>"
    given = {"a": 0.7, "c": [[3.0], [5.0]], "l": 1.3, "k": [2.0, 40.0, 900.0], "m": 0.4, "h": 0.2}
    values = [np.asarray(given[s.name], dtype=float) for s in model.symbols]
    omega = route.angular_frequencies(values, (2, 3), 4)
    np.testing.assert_allclose(omega / (2 * np.pi), model.natural_frequencies(given, 4), rtol=1e-11, atol=1e-9)
    modes, general = route.modes(values, (2, 3), omega), model.modal_parameters(given, 4)
    places, size = np.linspace(0.2, 1.5, 5), np.abs(general.right_force).max()
    beside = modes.shape(0, 0, places) * model.mode_shapes(given, places, 4)
    sign = np.sign(beside.sum(axis=-1))
    for j in range(route.layout.n):
        np.testing.assert_allclose(modes.displacement(0, j), sign * general.left[..., j], atol=1e-7)
        np.testing.assert_allclose(modes.displacement(1, j), sign * general.right[..., j], atol=1e-7)
        np.testing.assert_allclose(modes.force(0, j) / size, sign * general.left_force[..., j] / size, atol=1e-7)
        np.testing.assert_allclose(modes.force(1, j) / size, sign * general.right_force[..., j] / size, atol=1e-7)
        expected = sign[..., None] * model.mode_shapes(given, places, 4, derivative=j)
        np.testing.assert_allclose(modes.shape(j, 0, places), expected, atol=1e-7)
        weights = 1.3 * WEIGHTS
        quadrature = modes.shape(j, 0, 0.2 + 1.3 * NODES) @ weights
        np.testing.assert_allclose(modes.integral(j), quadrature, atol=1e-12)
    high = 2 * route.layout.n + 1
    expected = sign[..., None] * model.mode_shapes(given, places, 4, derivative=high)
    np.testing.assert_allclose(modes.shape(0, high, places), expected, rtol=1e-5, atol=1e-4)
    leading = modes.displacement(1, 1 if name == ",m|h,k" else 0)
    assert (leading > 0).all(), "the first displacement of the right end that moves"


@pytest.mark.parametrize("name", ENDS)
def test_rates_of_a_model_are_slopes(name):
    """By stiffness, compliance and inertia, in SI units, and those of momentum times a displacement."""
    model = line(**ENDS[name])
    route = route_of(model)
    given = {"a": 0.7, "c": 3.0, "l": 1.3, "k": 9.0, "m": 0.4, "h": 0.2}
    place = 1 if name == ",m|h,k" else 0

    def at(**changes):
        values = [float((given | changes)[s.name]) for s in model.symbols]
        omega = route.angular_frequencies(values, (), 3)
        found = route.modes(values, (), omega)
        return found, omega, found.momentum() * found.displacement(1, place)

    modes, omega, _ = at()
    ways = {
        "stiffness": ("k", lambda s: 9.0 + s),
        "compliance": ("k", lambda s: 1 / (1 / 9.0 + s)),
        "inertia": ("m", lambda s: 0.4 + s),
    }
    for by, (symbol, moved) in ways.items():
        step = 1e-5
        (_, up, product_up), (_, down, product_down) = (at(**{symbol: moved(s)}) for s in (step, -step))
        channels = modes.inertias() if by == "inertia" else modes.springs()
        rate, change = (sum(parts) for parts in zip(*(
            (modes.rates(by)[channel], modes.product_rates(1, place, channel, by)[0]) for channel in channels
        ), strict=True))  # fmt: skip
        np.testing.assert_allclose(rate, (up - down) / (2 * step), rtol=1e-6, atol=1e-8)
        np.testing.assert_allclose(change, (product_up - product_down) / (2 * step), rtol=1e-5, atol=1e-7)
        for channel in channels:
            _, logarithmic = modes.product_rates(1, place, channel, by)
            np.testing.assert_allclose(logarithmic * omega, modes.rates(by)[channel], rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize(
    "model",
    [
        line(2, right=m * (y.diff(t) + k * y.diff(t, x)) ** 2 / 2),
        line(2, left=-k * y * y.diff(x)),
        line(1, virtual_work=[(-k * y.diff(t), y, "left")]),
        line(1, further=x * y.diff(t) ** 2 / 2),
        line(1, further=-k * y**2 / 2),
        line(2, further=-k * y.diff(x) ** 2 / 2),
        line(3),
    ],
    ids=["offset tip mass", "coupled spring", "damper", "tapered", "foundation", "tension", "third order"],
)  # fmt: skip
def test_other_lines_go_another_way(model):
    assert route_of(model) is None


def test_negative_stiffness_is_not_covered():
    model = line(1, left=k * y**2 / 2)
    route = route_of(model)
    values = {"a": 1.0, "c": 1.0, "l": 1.0, "h": 0.0}
    assert not route.covers([{**values, "k": 2.0}[s.name] for s in model.symbols])
    assert route.covers([{**values, "k": -2.0}[s.name] for s in model.symbols])
    with pytest.raises(ValueError, match=r"a stiffness must be in \[0, inf\]"):
        route.angular_frequencies([{**values, "k": 2.0}[s.name] for s in model.symbols], (), 3)


def test_a_line_without_springs_and_masses_has_one_set_of_modes():
    """A string between supports: n c / 2 l, sin(n pi x / l); its batch comes from the scale alone."""
    model = line(1, essential=[y.subs(x, h), y.subs(x, h + l)])
    route, tension = route_of(model), np.array([1.0, 4.0])
    given = {"a": 1.0, "c": tension, "l": 2.0, "h": 0.0}
    values = [given[s.name] for s in model.symbols]
    omega = route.angular_frequencies(values, (2,), 3)
    np.testing.assert_allclose(omega, np.sqrt(tension)[:, None] * np.pi / 2 * np.arange(1, 4), rtol=1e-15)
    modes, places = route.modes(values, (2,), omega), np.linspace(0, 2, 9)
    sine = np.sin(np.pi / 2 * np.arange(1, 4)[:, None] * places)
    np.testing.assert_allclose(np.abs(modes.shape(0, 0, places)), np.abs(np.stack([sine, sine])), atol=1e-14)
    assert (modes.shape(0, 0, np.array([1.999])) > 0).all(), "positive beside the right end"
    assert modes.springs() == modes.inertias() == []
    with pytest.raises(IndexError, match="no lumped coordinates"):
        modes.coordinate(0)


@pytest.mark.parametrize("scale", [1e-155, 1e-200, 1e-280])
def test_frequencies_on_springs_of_any_softness_go_with_their_root(scale):
    """Where soft springs alone hold the arm both frequencies are homogeneous in them; 1e-40 is solved as it is."""
    arm = cra.Arm.nominal().replace(m_e=0.003, J_e=1e-7)

    def held(size):
        return cra.natural_frequencies(arm.replace(k_t=2.0 * size, k_r=0.3 * size), 3)

    found, plain = held(scale), held(1e-40)
    np.testing.assert_allclose(found[:2] / np.sqrt(scale), plain[:2] / np.sqrt(1e-40), rtol=1e-12)
    assert found[2] == pytest.approx(plain[2], rel=1e-13)
