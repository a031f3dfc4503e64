r"""Forces of elastic-slip elements over a period of a motion given by its harmonics; exact between events.

The slider of an element, at z, moves only so far that the spring's length u - z stays within the slip displacement d:
at each reversal of u it is clipped to [u - d, u + d], and in between it sticks from the reversal to the phase where
u - z reaches d. With the indicator of sticking :math:`\chi` the rate of the force is :math:`k\chi u'`, so the harmonics
of the force are sums of those of the motion times integrals of :math:`\chi\cos n\theta` and :math:`\chi\sin n\theta`.
While an element sticks, the variation of its slider is that of u at the reversal at which it stopped, which makes the
Jacobian exact. Shifts of the events have no first-order effect, since the force is continuous.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cra_sym.cached import cached_property

__all__ = ["Cycle", "cycle"]

Array = NDArray[np.float64]
Index = NDArray[np.intp]
_PER_WAVE = 16  # samples per period of the highest harmonic
_ITERATIONS = 80
_SMALL = 1e-9
_TURN = 2.0 * np.pi


@dataclass(frozen=True, eq=False)
class Cycle:
    """The elements on one displacement over a period, many motions at once.

    Attributes
    ----------
    coefficients : ndarray, shape (rows, 2 harmonics + 1)
        Of the displacement: constant, cosines, sines.
    stiffness, slip : ndarray, shape (elements,)
    reversals : ndarray, shape (rows, reversals)
        Phases in [0, 2 pi), ascending; padded by repeating the last one.
    places : ndarray, shape (rows, reversals)
        Displacements there.
    sliders : ndarray, shape (rows, reversals, elements)
        z after each reversal.
    sources : ndarray of int, shape (rows, reversals, elements)
        Reversal at which the slider stopped there; -1 for one that never slipped.
    onsets : ndarray, shape (rows, reversals, elements)
        Phase after each reversal at which the element begins to slip: that of the next reversal if it does not.
    """

    coefficients: Array
    stiffness: Array
    slip: Array
    reversals: Array
    places: Array
    sliders: Array
    sources: Index
    onsets: Array

    @property
    def harmonics(self) -> int:
        """Number of harmonics."""
        return int(self.coefficients.shape[1]) // 2

    @cached_property
    def ends(self) -> Array:
        """Phase of the next reversal."""
        return np.concatenate([self.reversals[:, 1:], self.reversals[:, :1] + _TURN], axis=1)

    @cached_property
    def slips(self) -> NDArray[np.bool_]:
        """Whether an element slips before the next reversal, shape (rows, reversals, elements)."""
        return np.asarray(np.roll(self.sliders, -1, axis=1) != self.sliders)

    @cached_property
    def _is_falling(self) -> Array:
        return np.sign(np.roll(self.places, -1, axis=1) - self.places)[:, :, None]

    @cached_property
    def _sticking(self) -> tuple[Array, Array]:
        """Integrals of cos n theta and of sin n theta, n = 0 .. 2 harmonics, over each time of sticking, times k."""
        orders = np.arange(1, 2 * self.harmonics + 1)
        first = np.exp(1j * self.reversals[:, :, None] * orders)[:, :, None, :]
        last = np.exp(1j * self.onsets[..., None] * orders)
        found = (last - first) / (1j * orders) * self.stiffness[:, None]
        whole = (self.onsets - self.reversals[:, :, None]) * self.stiffness
        real = np.concatenate([whole[..., None], found.real], axis=-1)
        return real, np.concatenate([np.zeros_like(whole)[..., None], found.imag], axis=-1)

    @cached_property
    def _products(self) -> Array:
        """Integrals of the products of any two functions of the basis while elements stick, times k."""
        x, y = (part.sum(axis=(1, 2)) for part in self._sticking)
        k = np.arange(self.harmonics + 1)
        plus, minus = k[:, None] + k, np.abs(k[:, None] - k)
        sign = np.sign(k[:, None] - k)
        cosines = 0.5 * (x[:, minus] + x[:, plus])
        sines = 0.5 * (x[:, minus] - x[:, plus])[:, 1:, 1:]
        mixed = 0.5 * (y[:, plus] - sign * y[:, minus])[:, :, 1:]  # cos k sin l
        above = np.concatenate([cosines, mixed], axis=2)
        return np.concatenate([above, np.concatenate([mixed.swapaxes(1, 2), sines], axis=2)], axis=1)

    @cached_property
    def force(self) -> Array:
        """Harmonics of the force, shape (rows, 2 harmonics + 1)."""
        h, c = self.harmonics, self.coefficients
        k = np.arange(1, h + 1)
        rate = np.concatenate([np.zeros((len(c), 1)), k * c[:, h + 1 :], -k * c[:, 1 : h + 1]], axis=1)
        turned = (self._products @ rate[:, :, None])[:, :, 0]
        found = np.empty_like(c)
        found[:, 1 : h + 1] = -turned[:, h + 1 :] / (np.pi * k)
        found[:, h + 1 :] = turned[:, 1 : h + 1] / (np.pi * k)
        stuck = (self._products[:, 0] * c).sum(axis=1)
        stuck -= ((self.onsets - self.reversals[:, :, None]) * self.sliders * self.stiffness).sum(axis=(1, 2))
        slipping = ((self.ends[:, :, None] - self.onsets) * self._is_falling * self.slip).sum(axis=(1, 2))
        found[:, 0] = (stuck + slipping) / _TURN
        return found

    @cached_property
    def jacobian(self) -> Array:
        """Rates of the force's harmonics by those of the displacement, shape (rows, functions, functions)."""
        h, (x, y) = self.harmonics, self._sticking
        found = self._products.copy()
        each = np.concatenate([x[..., : h + 1], y[..., 1 : h + 1]], axis=-1)
        at = values(self.reversals, h)
        for number in range(self.reversals.shape[1]):
            held = self.sources == number
            if held.any():
                share = np.einsum("rje,rjem->rm", held, each)
                found -= share[:, :, None] * at[:, number, None, :]
        found /= np.pi
        found[:, 0] *= 0.5
        return found

    @cached_property
    def loss(self) -> Array:
        """Energy dissipated by friction in a period, shape (rows,)."""
        way = np.abs(np.roll(self.sliders, -1, axis=1) - self.sliders)
        return np.asarray((way * self.slip).sum(axis=(1, 2)))

    def energy(self, phase: float) -> float:
        """Return the energy of all springs of the first motion at a phase."""
        start = self.reversals[0]
        turned = np.where(phase < start[0], phase + _TURN, phase) % _TURN if phase < 0 else phase
        turned = turned + _TURN if turned < start[0] else turned
        number = int(np.flatnonzero(turned >= start)[-1])
        sticks = turned <= self.onsets[0, number]
        place = float(values(np.array(turned), self.harmonics) @ self.coefficients[0])
        pull = np.where(sticks, self.stiffness * (place - self.sliders[0, number]), self.slip)
        return float(0.5 * (pull**2 / self.stiffness).sum())


def values(phase: Array, harmonics: int, derivative: int = 0) -> Array:
    """Return constant, cosines and sines, or their derivatives, at phases, shape (..., 2 harmonics + 1)."""
    k = np.arange(1, harmonics + 1)
    turned = np.exp(1j * phase[..., None] * k) * (1j * k) ** derivative
    constant = np.full((*phase.shape, 1), 0.0 if derivative else 1.0)
    return np.concatenate([constant, turned.real, turned.imag], axis=-1)


def cycle(coefficients: Array, stiffness: Array, slip: Array) -> Cycle:
    """Return the cycle of elements for a displacement; a slider that never slips is at 0 or as near as possible.

    Parameters
    ----------
    coefficients : ndarray, shape (rows, 2 harmonics + 1)
    stiffness, slip : ndarray, shape (elements,)
    """
    reversals, places = _reversals(coefficients, float((slip / stiffness).min()))
    sliders, sources = _sliders(places, slip / stiffness)
    ends = np.concatenate([reversals[:, 1:], reversals[:, :1] + _TURN], axis=1)
    onsets = np.repeat(ends[:, :, None], stiffness.size, axis=2)
    moved = np.roll(sliders, -1, axis=1) - sliders
    row, number, element = np.nonzero(moved)
    level = sliders[row, number, element] + np.sign(moved[row, number, element]) * (slip / stiffness)[element]
    after = (number + 1) % places.shape[1]
    onsets[row, number, element] = _crossings(
        coefficients[row], reversals[row, number], ends[row, number], places[row, number], places[row, after], level
    )
    return Cycle(coefficients, stiffness, slip, reversals, places, sliders, sources, onsets)


def _sliders(places: Array, limit: Array) -> tuple[Array, Index]:
    """Return sliders after each reversal in the periodic state, and the reversal each stopped at."""
    rows, count = places.shape
    z, source = np.zeros((rows, limit.size)), np.full((rows, limit.size), -1)
    sliders, sources = np.empty((rows, count, limit.size)), np.empty((rows, count, limit.size), int)
    for kept in (False, True):
        for number in range(count):
            new = np.clip(z, places[:, number, None] - limit, places[:, number, None] + limit)
            source = np.where(new != z, number, source)
            z = new
            if kept:
                sliders[:, number], sources[:, number] = z, source
    return sliders, sources


def _reversals(coefficients: Array, limit: float) -> tuple[Array, Array]:
    """Return phases and displacements of all reversals, shape (rows, reversals); only one at 0 where nothing slips."""
    h = coefficients.shape[1] // 2
    moving = np.abs(coefficients).sum(axis=1) > limit
    row, low, high = _brackets(coefficients[moving], h)
    row = np.flatnonzero(moving)[row]
    phase = _zeros(coefficients[row], low, high, 1)
    rows, order = len(coefficients), np.lexsort((phase, row))
    row, phase = row[order], phase[order]
    counts = np.bincount(row, minlength=rows)
    number = np.arange(row.size) - np.repeat(np.cumsum(counts) - counts, counts)
    found = np.zeros((rows, max(int(counts.max(initial=0)), 1)))
    found[row, number] = phase
    last = np.take_along_axis(found, np.maximum(counts - 1, 0)[:, None], axis=1)
    found = np.where(np.arange(found.shape[1]) < counts[:, None], found, last)
    places = (values(found, h) @ coefficients[:, :, None])[..., 0]
    return found, places


def _brackets(coefficients: Array, harmonics: int) -> tuple[Index, Array, Array]:
    """Return (row, low, high) of phases between which the rate of the displacement vanishes once."""
    number = max(_PER_WAVE * harmonics, 32)
    width = _TURN / number
    k = np.arange(1, harmonics + 1)
    series = coefficients[:, 1 : harmonics + 1] - 1j * coefficients[:, harmonics + 1 :]
    spectra = np.zeros((2, len(coefficients), number // 2 + 1), complex)
    spectra[0][:, 1 : harmonics + 1], spectra[1][:, 1 : harmonics + 1] = 1j * k * series, -(k**2) * series
    rate, bend = np.fft.irfft(spectra, number, axis=-1) * (number / 2)
    bend = bend * width
    ahead, bend_ahead = np.roll(rate, -1, axis=1), np.roll(bend, -1, axis=1)
    row, at = np.nonzero((rate >= 0) != (ahead >= 0))
    low, high = at * width, (at + 1) * width
    near = ((rate >= 0) == (ahead >= 0)) & (rate * bend < 0) & (ahead * bend_ahead > 0)
    hidden, cell = np.nonzero(near)
    if hidden.size:  # two zeros between samples are found from a cubic through both ends
        s = np.linspace(0.0, 1.0, 17)[1:-1, None]
        y, dy, end, dend = (part[hidden, cell] for part in (rate, bend, ahead, bend_ahead))
        cubic = (
            (1 + 2 * s) * (1 - s) ** 2 * y + s * (1 - s) ** 2 * dy + s**2 * (3 - 2 * s) * end + s**2 * (s - 1) * dend
        )
        share = s[(cubic * np.sign(y)).argmin(axis=0), 0]
        middle = (cell + share) * width
        rates = (values(middle, harmonics, 1) * coefficients[hidden]).sum(axis=1)
        real = (rates >= 0) != (y >= 0)
        hidden, cell, middle = hidden[real], cell[real], middle[real]
        row = np.concatenate([row, hidden, hidden])
        low = np.concatenate([low, cell * width, middle])
        high = np.concatenate([high, middle, (cell + 1) * width])
    return row, np.asarray(low, float), np.asarray(high, float)


def _zeros(coefficients: Array, low: Array, high: Array, derivative: int, level: Array | float = 0.0) -> Array:
    """Return the zero of a derivative less a level between two phases, by Newton's method within the bracket."""
    return _solved(coefficients, low, high, 0.5 * (low + high), derivative, level)


def _crossings(coefficients: Array, low: Array, high: Array, start: Array, end: Array, level: Array) -> Array:
    """Return the phase at which a displacement crosses a level between two reversals."""
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.clip(np.nan_to_num((level - start) / (end - start)), 0.0, 1.0)
    guess = low + (high - low) * np.arccos(1.0 - 2.0 * share) / np.pi
    return _solved(coefficients, low, high, guess, 0, level)


def _solved(c: Array, low: Array, high: Array, guess: Array, derivative: int, level: Array | float) -> Array:
    h = c.shape[1] // 2
    if not len(c):
        return guess
    k = np.arange(1, h + 1)
    series = (c[:, 1 : h + 1] - 1j * c[:, h + 1 :]) * (1j * k) ** derivative
    constant = (0.0 if derivative else c[:, 0]) - level
    k, steep = k.astype(float), 1j * k

    def at(phase: Array) -> tuple[Array, Array]:
        turned = series * np.exp(1j * phase[:, None] * k)
        return turned.real.sum(axis=1) + constant, (turned * steep).real.sum(axis=1)

    rises = at(high)[0] > at(low)[0]
    x = guess
    for number in range(_ITERATIONS):
        value, slope = at(x)
        above = (value >= 0) == rises
        high, low = np.where(above, x, high), np.where(above, low, x)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = value / slope
        near = np.abs(step) <= _SMALL  # Newton's method squares it
        new = x - step if number else np.clip(x - step, low, high)  # the zero may lie at an end
        x = np.where(near | ((new >= low) & (new <= high) & (new != x)), new, 0.5 * (low + high))
        if (near | (high - low <= _SMALL**2)).all():
            break
    return x
