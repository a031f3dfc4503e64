"""The fast route of a Lagrangian with one wave number: strings and beams with any springs, masses and supports.

`one_wave_route` returns None for all other problems: those with coupled displacements at an end (a tip mass with an
offset), with coefficients that vary along x, or with a second wave number (a beam under tension).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from cra_sym.cached import cached_property
from cra_sym.kernels import Kernel, kernel
from cra_sym.model.close_pairs import resolve_close_pairs
from cra_sym.model.one_wave_family import DimensionlessModes, family
from cra_sym.model.soft_springs import felt, free_motions, put_soft
from cra_sym.solvers.one_wave import Layout, parameters
from cra_sym.solvers.one_wave_shapes import ShapeTable, fill

if TYPE_CHECKING:
    from sympy import Expr, Symbol

    from cra_sym.mechanics import StateForm

__all__ = ["OneWave", "OneWaveModes", "one_wave_route"]

Array = NDArray[np.float64]
Value = float | Array
Channel = tuple[int, int]
Rates = dict[Channel, Array]
Change = Literal["stiffness", "compliance", "inertia"]

_TINY = 1e-30  # imaginary part whose square underflows
_SCALES = 6  # names before those of the groups


def one_wave_route(form: StateForm, symbols: Sequence[Symbol], left: Expr | None = None) -> OneWave | None:
    """Return the route of a spatial problem with one wave number, None for every other problem.

    Parameters
    ----------
    form : StateForm
    symbols : sequence of Symbol
        The parameters, in the order in which their values are given.
    left : Expr, optional
        Where the left end is; 0 by default.
    """
    from sympy import S

    from cra_sym.mechanics.one_wave_form import one_wave_scales

    scales = one_wave_scales(form, S.Zero if left is None else left)
    return None if scales is None else OneWave(kernel(scales, tuple(symbols)))


class OneWave:
    """Natural frequencies and modes of a line with one wave number, for any values of its parameters.

    Parameters
    ----------
    scales : Kernel
        Of what `cra_sym.mechanics.one_wave_form.one_wave_scales` returns.

    Attributes
    ----------
    scales : Kernel
    family : Family
        Of all lines with the same structure.
    """

    def __init__(self, scales: Kernel) -> None:
        names = list(scales.layout)
        left, right = (tuple(end.split(",")) for end in names[0].partition(" ")[2].split("|"))
        self.scales, self.family = scales, family((left, right))

    def __reduce__(self) -> tuple[Any, ...]:
        return OneWave, (self.scales,)

    def __repr__(self) -> str:
        return f"<OneWave {next(iter(self.scales.layout))}>"

    @property
    def layout(self) -> Layout:
        """The positions of the quantities of the structure in its arrays."""
        return self.family.layout

    def covers(self, values: Sequence[Value]) -> bool:
        """Return whether every stiffness and inertia is in its range, so that the count of zeros is exact."""
        return self._are_covered(self._numbers(values))

    def _are_covered(self, numbers: list[Array]) -> bool:
        line, groups = numbers[2:4], numbers[_SCALES - 1 :]
        letters = (letter for _, letter in self.layout.groups)
        return all((np.isfinite(x) & (x > 0)).all() for x in line) and all(
            (x >= 0).all() and (letter == "k" or np.isfinite(x).all())
            for x, letter in zip(groups, letters, strict=True)
        )

    def _numbers(self, values: Sequence[Value]) -> list[Array]:
        """Return the scales and the groups, not broadcast."""
        with np.errstate(all="ignore"):
            found = self.scales.function(*(np.asarray(value, dtype=np.float64) for value in values))
        parts = (np.asarray(x) for x in found[1:])  # the root of a negative number is nan, which is not covered
        return [
            (np.where(x.imag == 0, x.real, np.nan) if np.iscomplexobj(x) else x).astype(float, copy=False)
            for x in parts
        ]

    def _groups(self, numbers: list[Array]) -> list[Array]:
        if not self._are_covered(numbers):
            raise ValueError(
                "values: a stiffness must be in [0, inf], an inertia in [0, inf), those of the line itself positive"
            )
        return numbers[_SCALES - 1 :]

    def _solved(self, groups: list[Array], modes: int) -> Array:
        lam = self.family.frequency_parameters(*groups, modes=modes)
        resolve_close_pairs(self.family, lam, *groups)
        return lam

    def angular_frequencies(self, values: Sequence[Value], shape: tuple[int, ...], modes: int) -> Array:
        """Return the natural angular frequencies, rad/s, shape (*shape, modes): ascending, complete."""
        numbers = self._numbers(values)
        groups = self._groups(numbers)
        common = np.broadcast_shapes(*(x.shape for x in groups)) if groups else ()
        omega = put_soft(self.layout, [np.broadcast_to(x, common) for x in groups], self._solved, modes)
        omega = omega if common == shape else np.array(np.broadcast_to(omega, (*shape, modes)))
        if self.layout.n == 2:
            omega *= omega  # in place: fresh memory costs more than the product
        omega *= _column(numbers[4])
        return omega

    def modes(self, values: Sequence[Value], shape: tuple[int, ...], omega: Array) -> OneWaveModes:
        """Return the modes, given all their first angular frequencies.

        Parameters
        ----------
        values : sequence of float or ndarray
        shape : tuple of int
        omega : ndarray, shape (*shape, modes)
        """
        numbers = self._numbers(values)
        left, length, inertia, stiffness, scale = numbers[: _SCALES - 1]
        with np.errstate(divide="ignore", invalid="ignore"):
            lam = omega / _column(scale)
        if not np.isfinite(lam).all():
            raise ValueError("values: they lead beyond the range of double precision")
        if self.layout.n == 2:
            np.sqrt(lam, out=lam)
        given = [np.broadcast_to(x, shape) for x in self._groups(numbers)]
        groups = felt(self.layout, given)
        if any(a is not b for a, b in zip(groups, given, strict=True)):  # as free where nothing else holds them
            lam = np.where(free_motions(self.layout, groups, lam), 0.0, lam)
        found = self.family.modes(*groups, lam=lam)
        return OneWaveModes(found, omega, left, length, inertia, stiffness, scale)


class OneWaveModes:
    """Mass-normalised modes, computed on use; the first nonzero displacement of the right end is positive.

    Parameters
    ----------
    dimensionless : DimensionlessModes
    omega : ndarray, shape (..., modes)
        rad/s.
    left, length, inertia, stiffness, scale : ndarray
        Place of the left end, length, a, c and the scale of the frequencies; they broadcast to the batch.
    """

    def __init__(
        self,
        dimensionless: DimensionlessModes,
        omega: Array,
        left: Array,
        length: Array,
        inertia: Array,
        stiffness: Array,
        scale: Array,
    ) -> None:
        self.dimensionless, self.omega = dimensionless, omega
        self._left, self._length, self._inertia, self._stiffness, self._scale = left, length, inertia, stiffness, scale

    @property
    def lam(self) -> Array:
        """The frequency parameter lambda, shape (..., modes)."""
        return self.dimensionless.lam

    @cached_property
    def is_unfelt(self) -> NDArray[np.bool]:
        """Which modes are held by springs alone that are too soft to change the shapes, shape (..., modes)."""
        return np.asarray((self.lam == 0) & (self.omega > 0))

    @property
    def _table(self) -> ShapeTable:
        return self.dimensionless.family.layout

    @cached_property
    def _root_mass(self) -> Array:
        return np.sqrt(self._inertia * self._length)

    def _unit(self, order: int) -> Array:
        """Return the unit of a derivative of the shapes."""
        unit = 1 / self._root_mass
        for _ in range(order):
            unit = unit / self._length
        return unit

    def _force_unit(self, place: int) -> Array:
        return self._stiffness * self._unit(2 * self._table.n - 1 - place)

    @cached_property
    def _ends(self) -> Array:
        """Rows of the table from q of the right end to P of the left end, in SI units."""
        n = self._table.n
        q = [self._unit(j) for j in range(n)]
        units = [*q, self._root_mass, *q, *(self._force_unit(j) for j in range(n))]
        return self.dimensionless.quantities(slice(self._table.right.start, self._table.left_force.stop), units)

    @cached_property
    def _right_forces(self) -> Array:
        units = [self._force_unit(j) for j in range(self._table.n)]
        return self.dimensionless.quantities(self._table.right_force, units)

    def displacement(self, end: int, place: int) -> Array:
        """Return a displacement of the left (0) or the right end (1), shape (..., modes)."""
        rows = self._table.right if end else self._table.left
        return self._end_row(rows.start + place)

    def force(self, end: int, place: int) -> Array:
        """Return a natural force P of the left (0) or the right end (1), shape (..., modes).

        Raises
        ------
        ValueError
            If a mode is held only by stiffnesses so small relative to the line that they do not change the shapes.
        """
        if self.is_unfelt.any():
            raise ValueError("values: a stiffness below 1e-150 of the line's own has no force in the modes; take 0")
        if end:
            found: Array = self._right_forces[place]
            return found
        return self._end_row(self._table.left_force.start + place)

    def _end_row(self, row: int) -> Array:
        found: Array = self._ends[row - self._table.right.start]
        return found

    def coordinate(self, number: int) -> Array:
        """Raise an IndexError: these lines have no lumped coordinates."""
        raise IndexError(f"coordinate {number}: this model has no lumped coordinates")

    def momentum(self) -> Array:
        """Return the integral of a phi over the line, with the masses of both ends, kg^(1/2), shape (..., modes)."""
        return self._end_row(self._table.momentum)

    def shape(self, place: int, derivative: int, x: Array) -> Array:
        """Return a derivative of a displacement at places x, m, shape (..., modes, stations).

        The places have the shape (stations,) or (..., stations) of the batch.
        """
        length, order = _column(self._length, 2), place + derivative
        x = np.asarray(x, dtype=np.float64)
        xi = ((x if x.ndim < 2 else x[..., None, :]) - _column(self._left, 2)) / length
        return self.dimensionless.shape(np.clip(xi, 0.0, 1.0), order) * _column(self._unit(order), 2)

    def integral(self, place: int) -> Array:
        """Return the integral of a displacement over the line, shape (..., modes)."""
        if place:
            return self.displacement(1, place - 1) - self.displacement(0, place - 1)
        return self.dimensionless.integral() * _column(self._length * self._unit(0))

    def springs(self) -> list[Channel]:
        """Return end and place of each spring, in the order of the rates."""
        return self._channels("k")

    def inertias(self) -> list[Channel]:
        """Return end and place of each inertia, in the order of the rates."""
        return self._channels("m")

    def _channels(self, letter: str) -> list[Channel]:
        return [divmod(channel, self._table.n) for channel, kind in self._table.groups if kind == letter]

    def strain(self) -> Array:
        """Return sqrt(k) q of each spring, signed, 1/s, shape (springs, ..., modes): 0 for infinite stiffness."""
        return self.dimensionless.quantities(self._table.strain, [self._scale] * len(self.springs()))

    def rates(self, by: Change, *, cycles: bool = False) -> dict[Channel, Array]:
        """Return d omega by the stiffnesses, compliances or inertias of the ends, by (end, place), rad/s over SI unit.

        With ``cycles`` they are those of the frequency in Hz. Others of the same kind cost nothing more.
        """
        return self._rates(by, cycles)[0]

    def logarithmic_rates(self, by: Change) -> dict[Channel, Array]:
        """Return d ln omega by the logarithms of the stiffnesses or inertias of the ends."""
        signs = {"stiffness": 1.0, "compliance": -1.0, "inertia": 1.0}
        found = self._rates("stiffness" if by == "compliance" else by, True)[1]
        return found if signs[by] > 0 else {channel: -value for channel, value in found.items()}

    def _rates(self, by: Change, cycles: bool) -> tuple[Rates, Rates]:
        known: dict[tuple[Change, bool], tuple[Rates, Rates]] = self.__dict__.setdefault("_known", {})
        if (by, cycles) not in known:
            channels = self.inertias() if by == "inertia" else self.springs()
            rows = {"stiffness": self._table.by_springs, "compliance": self._table.by_compliances}
            scale = self._scale / (4 * np.pi if cycles else 2)  # d omega = scale / (2 sqrt(z)) dz
            units = [scale * self.group_unit(channel, by) for channel in channels]
            units += [np.ones(())] * (len(channels) if by != "compliance" else 0)
            found = self.dimensionless.quantities(rows.get(by, self._table.by_inertias), units)
            found.flags.writeable = False
            first, second = found[: len(channels)], found[len(channels) :]
            known[by, cycles] = dict(zip(channels, first, strict=True)), dict(zip(channels, second, strict=False))
        return known[by, cycles]

    def group_unit(self, channel: Channel, by: Change) -> Array:
        """Return the value of the dimensionless group for a unit stiffness, compliance or inertia."""
        n, place = self._table.n, channel[1]
        if by == "inertia":
            return 1 / (self._inertia * self._length * self._length ** (2 * place))
        unit = self._length ** (2 * (n - place) - 1) / self._stiffness
        return unit if by == "stiffness" else 1 / unit

    def product_rates(self, end: int, place: int, channel: Channel, by: Change) -> tuple[Array, Array]:
        """Return the derivatives of momentum times a displacement of an end, and of ln omega, by a group of an end.

        Both are derivatives along the frequency equation, not difference quotients. By a stiffness that is 0, or a
        compliance that is infinite, they are nan: a rigid-body mode is about to become a vibration.

        Parameters
        ----------
        end, place : int
            The displacement.
        channel : (int, int)
            End and place of the spring or the inertia.
        by : {'stiffness', 'compliance', 'inertia'}
        """
        modes, table, n = self.dimensionless, self._table, self._table.n
        number = channel[0] * n + channel[1]
        shape, count = self.lam.shape, self.lam.shape[-1]
        flat = [np.repeat(group, count) for group in modes.groups]
        group = table.groups.index((number, "m" if by == "inertia" else "k"))
        unit = np.broadcast_to(_column(self.group_unit(channel, by)), shape).reshape(-1)
        logarithmic = self._logarithmic(channel, by).reshape(-1) * unit
        if by != "inertia":
            logarithmic = np.where(flat[group] == 0, np.nan, logarithmic)
        lam = self.lam.reshape(-1) * (1 + 1j * _TINY * logarithmic / n)
        given = parameters(table, flat).astype(complex)
        changes = _parameter_changes(table, given.real, flat, number, by)
        for row, change in changes.items():
            given[row] += 1j * _TINY * unit * change
        inertias = [flat[i].astype(complex) for i in table.inertias]
        if by == "inertia":
            inertias[table.inertias.index(group)] += 1j * _TINY * unit
        rows = np.empty((table.size, lam.size), complex)
        fill(rows, lam, count, table, modes.family.functions, given, inertias)
        displacement = rows[(table.right if end else table.left).start + place]
        change = ((rows[table.momentum] * displacement).imag / _TINY).reshape(shape)
        return change * _column(self._unit(place) * self._root_mass), logarithmic.reshape(shape)

    def _logarithmic(self, channel: Channel, by: Change) -> Array:
        """Return d ln omega by a dimensionless group, 0 for a rigid-body mode."""
        rows = {"stiffness": self._table.by_springs, "compliance": self._table.by_compliances}
        start = rows.get(by, self._table.by_inertias).start
        start += (self.inertias() if by == "inertia" else self.springs()).index(channel)
        (rate,) = self.dimensionless.quantities(slice(start, start + 1))
        root = self.lam if self._table.n == 1 else self.lam**2
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(root > 0, rate / (2 * root), 0.0)


def _parameter_changes(
    layout: Layout, given: Array, groups: Sequence[Array], number: int, by: Change
) -> dict[int, Array]:
    """Return the derivatives of s, i and c of a channel by its kappa, 1 / kappa or mu, by row."""
    row = {letter: i for i, (channel, letter) in enumerate(layout.parameters) if channel == number}
    s, i, c = (given[row[letter]] if letter in row else 0.0 for letter in "sic")
    if by == "inertia":
        found = {"s": -s * c, "i": (c + s) * c, "c": -c * c}
    elif by == "stiffness":
        found = {"s": (c + i) * c, "i": -i * c, "c": -c * c}
    else:
        mu = groups[layout.groups.index((number, "m"))] if "i" in row else 0.0
        found = {"s": -(1 + mu) * s * s, "i": mu * s * s, "c": s * s}
    return {row[letter]: np.asarray(value) for letter, value in found.items() if letter in row}


def _column(value: Value, axes: int = 1) -> Value:
    """Append axes of length one to a parameter, for modes and points; scalars are returned unchanged."""
    return np.asarray(value)[(..., *(None,) * axes)] if np.ndim(value) else value
