"""Reference vectors of an exported model: values of the package; its characteristic function by exponentials.

Points are drawn in the range of parameters; the exported code must refuse what the package refuses. Modes are compared
where all frequencies are distinct, since the shapes are not unique otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from cra_sym.analysis.modes import mode_shapes, participation
from cra_sym.analysis.responses import response
from cra_sym.analysis.sensitivities import sensitivities
from cra_sym.analysis.state_space import state_space
from cra_sym.codegen.in_time_checks import stepped_outputs
from cra_sym.codegen.library import Check
from cra_sym.codegen.model_text import ModelText
from cra_sym.codegen.vectors import SEED
from cra_sym.model.system import System
from cra_sym.model.waves_form import WavesForm
from cra_sym.solvers.force import Force
from cra_sym.solvers.motion import BaseMotion

__all__ = ["ERRORS", "in_time_checks", "largest", "model_checks", "sample", "tested"]

Array = NDArray[np.float64]
ERRORS = {"float64": 1e-12, "float32": 2e-3}
"""Error allowed, relative to the largest value of a kind, by the type of real numbers."""
_POINTS, _MODES = 8, 6
_APART = 1e-3
_ALONE = {"float64": 1e-3, "float32": 0.1}  # of all mass, that the base moves alone
_CANCELLED = 2e-3  # what a sum may lose of the digits that are compared
_TURNS = (0.3, 4.0, 40.0, 1000.0)
"""Wave number times length of the points of the characteristic function."""


def sample(written: ModelText) -> list[float]:
    """Return parameters of a stable structure."""
    for values in _drawn(written):
        system = _system(written, values)
        try:
            system.natural_frequencies(_MODES)
        except ValueError:
            continue
        if written.signals and not written.signals.are_in(system):
            continue
        return values
    raise ValueError(
        "model: no parameters were found for which the structure stands and all places of inputs and outputs are in "
        "the domain; give system= with the model"
    )


def _drawn(written: ModelText, tries: int = 400) -> Iterator[list[float]]:
    """Yield parameters within a factor of three, then within two orders, then with either sign."""
    rng, right = np.random.default_rng(SEED), written.model.equations.domain[1]
    length = list(written.names).index(right) if right in written.names else None
    reach = written.signals.reach if written.signals else 0.0
    for number in range(tries):
        width = 0.5 if number < tries // 2 else 1.0
        found = 10.0 ** rng.uniform(-width, width, len(written.names))
        if number >= 3 * tries // 4:
            found *= rng.choice((-1.0, 1.0), len(found))
        if length is not None:
            found[length] = max(found[length], reach)
        yield [float(f"{x:.6g}") for x in found]


def _system(written: ModelText, values: Sequence[float]) -> System:
    return written.model.at(dict(zip(written.names, values, strict=True)))


def model_checks(written: ModelText, values: Sequence[float]) -> Iterator[Check]:
    """Yield the reference vectors of a model, for parameters around valid ones."""
    loss = ERRORS[written.real]
    for point in _around(written, values):
        system = _system(written, point)
        try:
            omega = system.natural_frequencies(_MODES)
        except ValueError:
            yield Check(0, (*point, 3.0), (), refused=True)
            continue
        yield Check(0, (*point, float(_MODES)), tuple(omega / (2 * np.pi)), loss, loss * float(omega[-1]) * 1e-3)
        yield from _counts(point, omega, written.real)
        yield from _modal(written, system, point, omega, loss)
    last = 2 if written.real == "float32" else 3 if written.form.structure.n == 3 else 4  # three waves lose 2600 digits
    for turns in (0.0, *_TURNS[:last]):
        yield _characteristic(written, values, turns, loss)
    yield from _refused(written, values)


def _around(written: ModelText, values: Sequence[float]) -> Iterator[list[float]]:
    rng = np.random.default_rng(SEED + 1)
    yield list(values)
    stiffnesses = [list(written.names).index(symbol) for symbol in written.form.conditions.springs]
    for at in stiffnesses:
        for value in (math.inf, 0.0):
            yield [value if place == at else x for place, x in enumerate(values)]
    if len(stiffnesses) > 1:
        for value in (math.inf, 0.0):
            yield [value if place in stiffnesses else x for place, x in enumerate(values)]
    for _ in range(_POINTS):
        width = rng.choice((0.1, 0.5, 1.0)) if written.real == "float64" else 0.1
        yield [float(f"{x:.6g}") for x in np.array(values) * 10.0 ** rng.uniform(-width, width, len(values))]


def _counts(point: Sequence[float], omega: Array, real: str) -> Iterator[Check]:
    least = 1e-9 if real == "float64" else 1e-2
    edges = [(a, b) for a, b in pairwise(omega) if b - a > least * b]
    for low, high in edges[-2:]:
        between = float(0.5 * (low + high))
        yield Check(2, (*point, between), (float((omega < between).sum()),))


def _modal(written: ModelText, system: System, point: Sequence[float], omega: Array, loss: float) -> Iterator[Check]:
    if (np.diff(omega[:5]) <= _APART * omega[1:5]).any():
        return
    loss *= 10.0 if written.form.structure.n == 3 else 1.0  # the package's own error is 1e-12 there
    modes, order = system.modes(4), written.form.order
    quantities = [[modes.displacement(end, at) for at in order] for end in (0, 1)]
    quantities += [[modes.force(end, at) for at in order] for end in (0, 1)]
    found = np.array(quantities)  # (what, displacement, mode)
    sizes = largest(written, system)  # (displacement, mode)
    moved = sizes > 1e-9 * sizes.max(axis=1, keepdims=True)
    forces = np.where(moved, omega[3] ** 2 / np.where(moved, sizes, 1.0), 0.0).max()  # the modal mass is 1
    for at in range(len(order)):
        for what, size in ((0, sizes[at].max()), (1, forces)):
            own = found[2 * what : 2 * what + 2, at].T
            yield Check(3, (*point, 0.0, at, what), tuple(own.ravel()), loss, loss * float(size))
    for at in range(len(written.coordinates)):
        own = modes.coordinate(at)
        yield Check(3, (*point, 0.0, at, 2.0), tuple(own), loss, loss * float(max(np.abs(own).max(), sizes[0].max())))
    left, length = (float(x) for x in (system.domain.left, system.domain.length))
    for field, function in enumerate(system.model.equations.fields):
        for share, derivative in ((0.37, 0), (1.0, 1), (0.81, 2)):
            x = left + share * length
            shapes = mode_shapes(system, x, 4, derivative, field=function)
            size = float(
                np.abs(mode_shapes(system, left + length * np.linspace(0, 1, 21), 4, derivative, field=function)).max()
            )
            yield Check(4, (*point, derivative, x, field), tuple(shapes), loss, loss * size)
    yield from _sensitivities(written, system, point, omega, loss)
    yield from _driven(written, system, point, loss)
    yield from in_time_checks(written, system, point, loss)


def largest(written: ModelText, system: System) -> Array:
    """Return the largest value along the length of every displacement of a section in four modes."""
    places = float(system.domain.left) + float(system.domain.length) * np.linspace(0.0, 1.0, 33)
    displacements = system.model.conservative.displacements
    found = []
    for at in written.form.order:
        field, order = displacements[at], 0
        if isinstance(field, sp.Derivative):
            field, order = field.expr, sum(int(count) for _, count in field.variable_count)
        found.append(np.abs(mode_shapes(system, places, 4, order, field=field)).max(axis=-1))
    return np.array(found)


def _sensitivities(
    written: ModelText, system: System, point: Sequence[float], omega: Array, loss: float
) -> Iterator[Check]:
    found, first = sensitivities(system, 4), int((omega[:4] == 0.0).sum())
    if first:
        yield Check(5, (*point, 0.0, 0.0, 0.0), (), refused=True)
    rows = [
        [kind[symbol.name][mode] for kind in (found.rate, found.log) for symbol in written.names]
        for mode in range(first, 4)
    ]
    size = max(1.0, float(np.abs(rows).max()))
    yield Check(5, (*point, first, 0.0, 0.0), tuple(float(x) for row in rows for x in row), loss, loss * size)


def _driven(written: ModelText, system: System, point: Sequence[float], loss: float) -> Iterator[Check]:
    left, length = (float(x) for x in (system.domain.left, system.domain.length))
    x, field = left + length, system.model.equations.fields[0]
    last = float(system.natural_frequencies(4)[-1])
    for drive, name in enumerate(written.drives):
        taken = participation(system, 4, name)
        yield Check(6, (*point, drive, 0.0, 0.0), tuple(taken), loss, loss * float(np.abs(taken).max()))
        zeta, time = 0.02, 7.3 / last
        motion = {
            "velocity": 0.3,
            "acceleration": -0.2,
            "amplitude": 0.1,
            "angular_frequency": 0.7 * last,
            "phase": 0.4,
        }
        damped = system.replace(zeta=zeta)
        still = {
            other: Force() if kind == "force" else BaseMotion() for other, kind in written.model.numerics("causes")
        }
        moved = response(damped, still | {name: BaseMotion(**motion)}, time, x, 4)
        size = float(np.abs(taken * largest(written, system)[written.form.order.index(0)]).sum()) * (0.5 * time + 0.1)
        given = (*point, drive, x, 0.0, zeta, time, *motion.values())
        yield Check(7, given, (float(moved),), loss, loss * size)
        linear = state_space(damped, 4, name, {"y": field.subs(system.model.equations.x, x)})
        numbers = (*np.ravel(linear.A), *np.ravel(linear.B), *np.ravel(linear.C))
        yield Check(
            8, (*point, drive, x, 0.0, zeta), tuple(map(float, numbers)), loss, loss * float(np.abs(taken).max())
        )


def tested(written: ModelText) -> int:
    """Return the number of modes of the reference vectors in time."""
    return min(3, written.signals.modes) if written.signals else 0


def in_time_checks(written: ModelText, system: System, point: Sequence[float], loss: float) -> Iterator[Check]:
    """Yield outputs after steps under held inputs."""
    if written.signals is None:
        return
    system = system.replace(zeta=0.02)
    if not written.signals.are_in(system):
        yield Check(9, (*point, 1.0, 0.25, 0.0, 0.02, 0.1), (), refused=True)
        return
    time = 0.0
    for time, steps, y, size in stepped_outputs(written.signals, system, tested(written), _ALONE[written.real]):
        # an acceleration is a sum with that of the base, 0.25, and may be as small as its rounding
        smallest = loss * max(size, _CANCELLED * 0.25)
        yield Check(9, (*point, steps, 0.25, 0.0, 0.02, time), y, loss, smallest)
    if time:
        yield Check(9, (*point, 1.0, 0.25, 0.0, 1.0, time), (), refused=True)
        yield Check(9, (*point, 1.0, 0.25, 0.0, 0.02, math.nan), (), refused=True)


# The characteristic function -----------------------------------------------------------------------------------------


def _characteristic(written: ModelText, values: Sequence[float], turns: float, loss: float) -> Check:
    """Return the function and its derivative from matrix exponentials, with extra digits for those lost."""
    import mpmath

    found = _Exact(written, values)
    omega = found.frequency(turns)
    with mpmath.workdps(found.digits(omega)):
        value, rate = found.scaled(omega)
        size = max(abs(value), abs(rate) * max(omega, 1e-3))
    return Check(1, (*values, omega), (float(value), float(rate)), loss, loss * float(size) / max(omega, 1.0))


def _of_ends(form: WavesForm) -> list[sp.Expr]:
    """Return the entries of stiffness, mass and ties, then those of links."""
    ends = form.conditions
    return [*ends.stiffness, *ends.mass, *ends.ties, *ends.links]


class _Exact:
    """The determinant of the end conditions in arbitrary precision."""

    def __init__(self, written: ModelText, values: Sequence[float]) -> None:
        self._form, self._structure = written.form, written.form.structure
        left, right = written.model.equations.domain
        entries = [*self._form.matrices, right - left, *_of_ends(self._form)]
        self._entries = sp.lambdify(list(written.names), entries, "mpmath")
        self._values, self._system = values, _system(written, values)
        frequencies = self._system.natural_frequencies(_MODES)
        self._first = float(frequencies[1])
        self._rigid = int((frequencies == 0.0).sum())
        self._low = float(frequencies[self._rigid]) / 2

    def _parts(self) -> tuple[Any, ...]:
        """Return the matrices a and b without z and their factors of z, times half the length, and the ends."""
        import mpmath

        found, n = self._entries(*map(mpmath.mpf, self._values)), self._structure.n
        half = found[4 * n * n] / 2
        matrices = [mpmath.matrix(n, n) for _ in range(4)]
        for at in range(4 * n * n):
            matrices[at // (n * n)][at % (n * n) // n, at % n] = found[at] * half
        return matrices, found[4 * n * n + 1 :]

    def _waves(self, omega: float) -> Array:
        """Return the square roots of the eigenvalues of b a, in 1 / half the length."""
        a, b, a_slope, b_slope = (np.array(m.tolist(), dtype=float) for m in self._parts()[0])
        z = omega**2
        return np.asarray(np.sqrt(np.linalg.eigvals((b + z * b_slope) @ (a + z * a_slope)).astype(complex)))

    def frequency(self, turns: float) -> float:
        """Return the angular frequency at which the shortest wave has a given number of radians along the length."""
        if not turns:
            return 0.0
        low, high = 1e-9 * self._first, 1e12 * self._first
        for _ in range(200):
            middle = math.sqrt(low * high)
            low, high = (middle, high) if 2 * np.abs(self._waves(middle)).max() < turns else (low, middle)
        return float(f"{high:.6g}")

    def digits(self, omega: float) -> int:
        """Return the number of decimal digits that the determinant loses, plus 90."""
        return 90 + int(4 * self._structure.n * float(np.real(self._waves(omega)).max()) / math.log(10))

    def scaled(self, omega: float) -> tuple[Any, Any]:
        """Return the determinant and its derivative by omega, over the growth of its waves."""
        import mpmath

        (a, b, a_slope, b_slope), _ = self._parts()
        z = mpmath.mpf(omega) ** 2
        product = (b + z * b_slope) * (a + z * a_slope)
        values = mpmath.eig(product, left=False, right=False) if len(product) > 1 else [product[0]]
        growth = mpmath.exp(-2 * sum(mpmath.re(mpmath.sqrt(mu)) for mu in values))
        value, step = self._determinant(mpmath.mpf(omega)), mpmath.mpf(10) ** -35
        rate = (self._determinant(mpmath.mpf(omega) + step) - value) / step if omega else mpmath.mpf(0)
        # positive below all frequencies, and thus (-1)^n behind n of them; the factor is one for all omega
        sign = 1 if (self._determinant(mpmath.mpf(self._low)) > 0) == (self._rigid % 2 == 0) else -1
        return sign * value * growth, sign * rate * growth

    def _determinant(self, omega: Any) -> Any:
        import mpmath

        n, odd, size, width = self._structure.n, self._structure.odd, self._structure.moving, self._structure.places
        (a, b, a_slope, b_slope), ends = self._parts()
        z = omega * omega
        whole = mpmath.matrix(2 * n, 2 * n)  # (E, O)' by (E, O)
        for i in range(n):
            for j in range(n):
                whole[i, n + j] = b[i, j] + z * b_slope[i, j]
                whole[n + i, j] = a[i, j] + z * a_slope[i, j]
        right = mpmath.expm(whole, method="taylor")
        moved, forces = mpmath.matrix(width, width), mpmath.matrix(width, width)  # by E and O at mid-span, and others
        for end, side in ((0, -1), (1, 1)):
            for i in range(n):
                for column in range(2 * n):  # the left end is the mirror image
                    even, force = (
                        right[i, column] * (side if column >= n else 1),
                        right[n + i, column] * (side if column < n else 1),
                    )
                    moved[end * n + i, column] = force if odd[i] else even
                    forces[end * n + i, column] = side * (even if odd[i] else force)
        for at in range(2 * n, width):  # coordinates, and the forces of links
            (moved if at < size else forces)[at, at] = 1
        stiffness, mass, ties = (mpmath.matrix(size, size) for _ in range(3))
        for kind, target in enumerate((stiffness, mass, ties)):
            for at in range(size * size):
                target[at // size, at % size] = ends[kind * size * size + at]
        matrix = mpmath.matrix(width, width)
        links = [ends[3 * size * size + link * (2 + size) :][: 2 + size] for link in range(width - size)]
        for place in range(size):
            free = place in self._form.conditions.free
            row = moved[place, :] - (ties * moved[:size, :])[place, :]
            share = 1
            if free:
                row = ((stiffness - z * mass) * moved[:size, :])[place, :] + forces[place, :]
                for other in range(2 * n):
                    row += ties[other, place] * forces[other, :]
                for link, (_, _, *stretch) in enumerate(links):
                    row += stretch[place] * forces[size + link, :]
                share = 1 / (1 + stiffness[place, place] + mass[place, place])
            matrix[place, :] = share * row
        for link, (stiff, heavy, *stretch) in enumerate(links):
            row = forces[size + link, :]
            for place in range(size):
                row -= (stiff - z * heavy) * stretch[place] * moved[place, :]
            matrix[size + link, :] = row / (1 + stiff + heavy)
        try:
            return mpmath.det(matrix)
        except TypeError:  # of a column that is exactly 0
            return mpmath.mpf(0)


def _refused(written: ModelText, values: Sequence[float]) -> Iterator[Check]:
    for place, symbol in enumerate(written.names):
        bad = [math.nan, -math.inf] + ([] if symbol in written.form.conditions.springs else [math.inf])
        for wrong in bad:
            given = [wrong if number == place else x for number, x in enumerate(values)]
            for quantity in (0, 1, 2):
                yield Check(quantity, (*given, 1.0), (), refused=True)
    for modes in (0.0, -1.0, 1001.0):
        yield Check(0, (*values, modes), (), refused=True)
    for omega in (math.nan, -1.0, math.inf):
        yield Check(1, (*values, omega), (), refused=True)
        yield Check(2, (*values, omega), (), refused=True)
    yield Check(4, (*values, 9.0, 0.0, 0.0), (), refused=True)
    yield Check(4, (*values, 0.0, math.nan, 0.0), (), refused=True)
    yield Check(4, (*values, 0.0, 0.0, 99.0), (), refused=True)
