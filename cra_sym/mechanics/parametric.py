"""Input of multiple scales: a parametrically excited system of modes, and one of its resonances."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sympy import Expr, IndexedBase, Integer, MatrixBase, Rational, S, Symbol, Tuple, sympify

__all__ = ["ParametricResonance", "ParametricSystem"]

Label = Any


@dataclass(frozen=True)
class ParametricResonance:
    r"""A resonance ``tongue`` x varpi = omega_first + sign x omega_second; sign 0 is a forced resonance.

    Attributes
    ----------
    first, second : int or Symbol
        Labels of the resonant modes, counted from 1.
    sign : int
        1 for the principal and sum types, -1 for the difference type, 0 for a forced resonance.
    tongue : int
        Number of excitation periods of the resonance: 1 for the tongues whose width is of first order in epsilon,
        2 for those of second order.
    """

    first: Label
    second: Label
    sign: int
    tongue: int = 1

    @classmethod
    def of(cls, spec: Any, tongue: int = 1) -> ParametricResonance:
        """Return the resonance of a pair ``(m, n)``, ``(m, -n)``, or of a single ``n`` for a forced one.

        Examples
        --------
        >>> ParametricResonance.of((2, -1)).kind, ParametricResonance.of((1, 1)).kind, ParametricResonance.of(3).kind
        ('difference', 'principal', 'forced')
        """
        if tongue not in (1, 2):
            raise ValueError(f"tongue = {tongue!r}: must be 1 or 2")
        allowed = "must be (n, n), (m, n) or (m, -n) with modes counted from 1, or n alone for a forced resonance"
        pair = tuple(spec) if isinstance(spec, tuple | list | Tuple) else (spec,)
        if len(pair) not in (1, 2):
            raise ValueError(f"resonance = {spec!r}: {allowed}")
        try:
            labels = [sympify(entry, strict=True) for entry in pair]
        except ValueError:
            raise TypeError(f"resonance = {spec!r}: {allowed}") from None
        sign = 0 if len(labels) == 1 else 1
        if sign and labels[1].could_extract_minus_sign():
            labels[1], sign = -labels[1], -1
        if not all(label.is_Symbol or (label.is_Integer and label > 0) for label in labels):
            raise ValueError(f"resonance = {spec!r}: {allowed}")
        if sign == -1 and labels[0] == labels[1]:
            raise ValueError(f"resonance = {spec!r}: the difference of a mode with itself is not a frequency")
        if sign == 0 and tongue != 1:
            raise ValueError(f"tongue = {tongue!r}: must be 1 for a forced resonance")
        return cls(labels[0], labels[-1], sign, tongue)

    @property
    def kind(self) -> str:
        """``'principal'``, ``'sum'``, ``'difference'`` or ``'forced'``."""
        if self.sign == 1:
            return "principal" if self.first == self.second else "sum"
        return "difference" if self.sign else "forced"

    @property
    def modes(self) -> tuple[Label, ...]:
        """The resonant modes, without duplicates."""
        return (self.first,) if self.first == self.second else (self.first, self.second)

    def combine(self, first: Any, second: Any) -> Any:
        """Return the combination of two modes' quantities for the excitation: (first + sign x second) / tongue."""
        return (first + self.sign * second) * Rational(1, self.tongue)


@dataclass(frozen=True)
class ParametricSystem:
    r"""The system :math:`\ddot q + 2 Z\Omega\dot q + (\Omega^2 + \epsilon\cos(\varpi t) P)\,q = \epsilon f`.

    Attributes
    ----------
    rows : tuple
        Labels of the modes written out. With a symbolic number of modes these are the resonant ones and, if
        ``spectator`` is set, one that represents each of the others.
    spectator : Symbol or None
        That representative.
    size : Expr
        Number of modes.
    frequencies, damping, forcing, cubic : sequences or IndexedBase
        omega_i; zeta_i; complex amplitude F_i of a force ``epsilon Re(F_i exp(i varpi t))``; gamma_i of a weak term
        ``epsilon gamma_i q_i^3``.
    coupling, coupling_slope : Matrix or IndexedBase
        P at the exact resonance and its derivative with respect to varpi.
    """

    rows: tuple[Label, ...]
    spectator: Symbol | None
    size: Expr
    frequencies: Any
    coupling: Any = None
    damping: Any = None
    forcing: Any = None
    cubic: Any = None
    coupling_slope: Any = None

    @classmethod
    def of(cls, resonance: ParametricResonance, frequencies: Any, coupling: Any, **quantities: Any) -> ParametricSystem:
        """Return the checked system, written out for the modes the resonance needs."""
        size = quantities.pop("size", None)
        symbolic = isinstance(frequencies, IndexedBase)
        if symbolic:
            size = Symbol("N", integer=True, positive=True) if size is None else sympify(size, strict=True)
            spectator = Symbol("j", integer=True, positive=True)
            if spectator in resonance.modes:
                raise ValueError("resonance: the index j is kept for the sum over the other modes")
            rows = (*resonance.modes, spectator)
        else:
            frequencies = tuple(sympify(w, strict=True) for w in frequencies)
            size, spectator = Integer(len(frequencies)), None
            rows = tuple(Integer(i + 1) for i in range(len(frequencies)))
            for mode in resonance.modes:
                if mode not in rows:
                    raise ValueError(f"resonance with mode {mode}: must be a mode from 1 to {len(rows)}")
        given = {"coupling": coupling, **quantities}
        for name, value in given.items():
            given[name] = _checked(name, value, size, symbolic)
        return cls(rows, spectator, size, frequencies, **given)

    def _entry(self, values: Any, *labels: Label) -> Expr:
        if values is None:
            return S.Zero
        if isinstance(values, IndexedBase):
            return values[labels]
        if isinstance(values, Mapping):
            return sympify(values.get(labels[0], 0), strict=True)
        position = tuple(int(label) - 1 for label in labels)
        return sympify(values[position] if len(position) == 2 else values[position[0]], strict=True)

    def omega(self, i: Label) -> Expr:
        """Natural frequency of mode i."""
        return self._entry(self.frequencies, i)

    def zeta(self, i: Label) -> Expr:
        """Damping ratio of mode i."""
        return self._entry(self.damping, i)

    def force(self, i: Label) -> Expr:
        """Complex amplitude of the force on mode i."""
        return self._entry(self.forcing, i)

    def gamma(self, i: Label) -> Expr:
        """Coefficient of mode i's weak cubic term."""
        return self._entry(self.cubic, i)

    def p(self, i: Label, k: Label) -> Expr:
        """Parametric coupling P_ik at the exact resonance."""
        return self._entry(self.coupling, i, k)

    def slope(self, i: Label, k: Label) -> Expr:
        """Derivative of P_ik with respect to the excitation frequency."""
        return self._entry(self.coupling_slope, i, k)

    @property
    def omegas(self) -> tuple[Expr, ...]:
        """Natural frequencies of the rows."""
        return tuple(self.omega(i) for i in self.rows)


def _checked(name: str, value: Any, size: Expr, symbolic: bool) -> Any:
    """Raise an error for a value that does not match the number of modes."""
    if value is None or isinstance(value, IndexedBase):
        return value
    if name in ("coupling", "coupling_slope"):
        if symbolic or not isinstance(value, MatrixBase) or value.shape != (size, size):
            allowed = "an IndexedBase" if symbolic else f"a {size} x {size} Matrix"
            raise ValueError(f"{name} = {value!r}: must be {allowed}")
        return value.as_immutable()
    if isinstance(value, Mapping):
        return value
    if symbolic or not isinstance(value, Sequence) or len(value) != size:
        allowed = "an IndexedBase or a dict" if symbolic else f"a sequence of {size} entries or a dict"
        raise ValueError(f"{name} = {value!r}: must be {allowed}")
    return tuple(value)
