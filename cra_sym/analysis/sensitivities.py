"""Sensitivities (31)-(32) of the natural frequencies to every parameter of a system."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cra_sym.analysis.complex_shapes import of_complex_modes
from cra_sym.analysis.differences import by_differences, rates_by_moved_supports
from cra_sym.analysis.eigenvalue_rates import eigenvalue_rates, mode_rates, with_next
from cra_sym.analysis.eigenvalues import oscillating_frequencies
from cra_sym.analysis.followed_points import FollowedPoints
from cra_sym.analysis.modes import driver_of, participation
from cra_sym.analysis.rates import Rates
from cra_sym.cached import cached_property
from cra_sym.checks import choice, count, default_floating_point, flag, instance, names
from cra_sym.model.one_wave import Change, OneWaveModes
from cra_sym.model.projection import Projected, column, project
from cra_sym.model.routes import Modes
from cra_sym.model.system import MOST_MODES, System
from cra_sym.model.vanishing import check_forces

__all__ = ["Rates", "Sensitivities", "sensitivities"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
_SAME = 1e-10  # relative distance below which frequencies are equal to rounding
_MIXED = 1e-6  # relative size of a rate, above rounding, beyond which a parameter splits a repeated frequency


class Sensitivities:
    """Derivatives of the natural frequencies f (Hz), arrays of shape (..., modes), computed on first use.

    Raw derivatives have the unit Hz over that of the parameter and cannot be compared with each other. Logarithmic
    ones, d ln f / d ln p, can: that of a spring is half its share of the strain energy of the mode, that of a mass
    minus half its share of the kinetic energy.

    The frequency of a rigid-body mode, f = 0, grows from zero as a square root: its raw derivative by a stiffness
    that would resist it is inf, its other raw derivatives are 0 and its logarithmic ones nan. With several such
    modes, as where a parameter splits a repeated frequency, the modes depend on the direction of the change and the
    derivatives are nan. Derivatives by an infinite stiffness are 0; those by its compliance 1/k give the effect of a
    small compliance of a rigid support.

    Of a system without natural modes (gyroscopic terms, forces that follow the motion), f is that of the motions that
    oscillate, ``Im s / (2 pi)``. Derivatives of eigenvalues s are differences of eighth order with a relative error of
    about 1e-10, more beside the onset of flutter; they are nan where s is repeated or coalesces with another.

    Attributes
    ----------
    frequency : ndarray
        f, Hz.
    rate, log : mapping of str to ndarray
        Raw and logarithmic derivatives by every requested parameter.
    compliance : mapping of str to ndarray
        Raw derivatives by 1/k for every stiffness k of an end: Hz N/m for one in N/m.
    df_dk_t, log_k_t, df_dc_t, ... : ndarray
        The same by attribute: of a parameter p ``df_dp`` and ``log_p``; ``df_dc_t`` is by the compliance 1/k_t,
        unless c_t is a parameter itself.
    eigenvalue : ndarray of complex
        s, rad/s, of the motions ``exp(s t)`` that oscillate: with dampers too, see :func:`cra_sym.eigenvalues`.
    eigenvalue_rate : mapping of str to ndarray of complex
        Their raw derivatives: the real part is that of the growth, the imaginary one that of the angular frequency.
    damping_ratio_rate : mapping of str to ndarray
        Raw derivatives of the damping ratio, ``-Re s / |s|``.
    """

    frequency: Array

    def __init__(self, system: System, modes: int, by: Sequence[str]) -> None:
        self._system, self._modes, self._by = system, modes, tuple(by)
        self._known: dict[tuple[str, bool], Complex] = {}
        self._of_squares: dict[str, Array] = {}
        self.frequency = oscillating_frequencies(system, modes) / (2 * np.pi)
        stiff = [name for name in system.numerics("stiffnesses") if name in by]
        self.rate: Rates[Array] = Rates(self, "raw", by)
        self.log: Rates[Array] = Rates(self, "logarithmic", by)
        self.compliance: Rates[Array] = Rates(self, "by_compliance", stiff)
        self.eigenvalue_rate: Rates[Complex] = Rates(self, "of_eigenvalue", by)
        self.damping_ratio_rate: Rates[Array] = Rates(self, "of_damping_ratio", by)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Sensitivities):
            return NotImplemented
        return (self._modes, self._by, self._system) == (other._modes, other._by, other._system)

    def __hash__(self) -> int:
        return hash((self._modes, self._by, self._system))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self._system, self._modes, self._by)

    def __repr__(self) -> str:
        return f"<Sensitivities of frequencies {self.frequency} Hz by {', '.join(self._by)}: rate, log, compliance>"

    def __getattr__(self, name: str) -> Array:
        if name.startswith("_"):
            raise AttributeError(name)
        for prefix, kind in (("df_d", self.rate), ("log_", self.log)):
            parameter = name.removeprefix(prefix)
            if name.startswith(prefix) and parameter in kind:
                return kind[parameter]
            stiffness = parameter.replace("c_", "k_", 1)
            if prefix == "df_d" and name.startswith("df_dc_") and stiffness in self.compliance:
                return self.compliance[stiffness]
        raise AttributeError(f"Sensitivities have no {name!r}")

    def __dir__(self) -> list[str]:
        names = [f"{prefix}{name}" for name in self.rate for prefix in ("df_d", "log_")]
        names += [f"df_dc_{name.removeprefix('k_')}" for name in self.compliance if name.startswith("k_")]
        return sorted({*super().__dir__(), *names})

    @property
    def eigenvalue(self) -> Complex:
        """Eigenvalues, rad/s."""
        if self._system.numerics("conservative"):
            return np.asarray(2j * np.pi * self.frequency)
        return self._eigenvalues[..., : self._modes]

    # ------------------------------------------------------------------------------------------------------------

    def shapes(self, name: str, x: Any = None, *, field: Any = None, damped: bool = False) -> Array | Complex:
        """Return the derivatives of the mass-normalised mode shapes by a parameter.

        Points are held fixed relative to the length. By an infinite stiffness the derivative is 0; where a frequency is
        repeated there is none, and it is nan. Differences of eighth order: the error is about 1e-10 of the
        largest shape over the value of the parameter.

        Parameters
        ----------
        name : str
            One of those asked for.
        x : array_like, optional
            Places in the domain, m: a number or one axis. A lumped coordinate has no place, and needs none.
        field : applied undefined function, optional
            A field (default: the first), or a lumped coordinate.
        damped : bool
            Of the complex shapes of the motions that oscillate, normalised as by :func:`cra_sym.mode_shapes` with
            ``damped``; always without natural modes. Their error is about 1e-10 too, more where eigenvalues are close.

        Returns
        -------
        ndarray, shape (..., modes) or (..., modes, x)
            Complex of complex shapes.

        Raises
        ------
        TypeError, ValueError
            If the name was not asked for, or a place or the field is not of the system.

        Examples
        --------
        >>> from cra_sym import Arm, mode_shapes
        >>> arm = Arm.nominal().replace(m_e=0.0)
        >>> change = sensitivities(arm, 2).shapes("rho", 1.0)
        >>> bool(np.allclose(change, -mode_shapes(arm, 1.0, 2) / (2 * arm.rho)))  # the mass is normalised
        True
        """
        followed = FollowedPoints(self._system, x, field)
        found, drift = self._changed(name, followed.shapes, flag("damped", damped)), followed.drift(name)
        found = found if drift is None else found - self._here(followed.slopes, damped) * drift[..., None, :]
        return found[..., 0] if followed.single else found

    def participation(self, name: str, motion: str | None = None) -> Array | Complex:
        """Return the derivatives of the participation factors by a parameter, shape (..., modes).

        Without natural modes those of the complex shapes: the same integral of these, ``phi' M r`` of a motion that
        carries all masses along by r.

        Parameters
        ----------
        name : str
            One of those asked for.
        motion : str, optional
            Name of a prescribed motion or force; by default the only prescribed motion.

        Raises
        ------
        ValueError
            If the name was not asked for, nothing of that name drives the model, or it acts by more than its
            acceleration or its value.
        """
        driver = driver_of(self._system, motion)
        load = self._system.numerics("load", driver)
        if self._is_complex:
            check_forces(self._system, load, self._system.numerics("pencil"))
        else:
            participation(self._system, self._modes, driver)  # likewise refuses what makes a strain infinite
        return self._changed(name, lambda system, modes: -project(system.domain, modes, load))

    def _changed(self, name: str, quantity: Callable[[System, Modes], Array], damped: bool = False) -> Array | Complex:
        """Return the derivative of a linear quantity of the modes of shape (..., modes, ...)."""
        choice("name", name, self._by)
        if self._by_complex_modes(damped):
            rates = mode_rates(self._system, name, self._eigenvalues, lambda one, s: of_complex_modes(one, s, quantity))
            return np.take(rates, np.arange(self._modes), axis=self.frequency.ndim - 1)
        watched = min(self._modes + 1, self._system.most_modes)  # the next mode may be close to the last one
        more = Sensitivities(self._system, watched, [name])
        found = by_differences(self._system, more, name, lambda one: quantity(one, one.modes(self._modes)))
        none = np.zeros(self.frequency.shape, dtype=bool)
        if self._repeated is not None:
            none = np.asarray(self._repeated[..., : self._modes, :].any(axis=-1))
        rigid = np.isinf(column(np.asarray(self._system.values[name]))) | none
        extra = (None,) * (found.ndim - self.frequency.ndim)
        found = np.where(np.broadcast_to(none, rigid.shape)[(..., *extra)], np.nan,
                         np.where(rigid[(..., *extra)], 0.0, found))  # fmt: skip
        return found.astype(complex) if damped else found

    def _here(self, quantity: Callable[[System, Modes], Array], damped: bool) -> Array | Complex:
        if not self._by_complex_modes(damped):
            return quantity(self._system, self._system.modes(self._modes))
        return of_complex_modes(self._system, self._eigenvalues[..., : self._modes], quantity)

    def _by_complex_modes(self, damped: bool) -> bool:
        return (damped or self._is_complex) and not self._system.numerics("conservative")

    @cached_property
    def _forms(self) -> Projected:
        return self._system.form("rates", self._modes, diagonal=True)

    @cached_property
    def _of_the_determinant(self) -> Mapping[str, Array]:
        """Derivatives of omega^2 by parameters, of a system whose frequencies are the roots of a determinant."""
        return self._system.root_rates(self._modes, self._by)

    @property
    def _omega(self) -> Array:
        return self._system.natural_frequencies(self._modes)

    def _squared(self, name: str) -> Array:
        """Return the derivative of omega^2 by a parameter, by first-order perturbation; found once."""
        if name not in self._of_squares:
            self._of_squares[name] = self._found_squared(name)
        return self._of_squares[name]

    def _found_squared(self, name: str) -> Array:
        direct = self._of_the_determinant.get(name)
        if name in self._system.numerics("moving_supports"):
            rate = 2 * self._omega * rates_by_moved_supports(self._system, name, self._modes)
        elif direct is None:
            rate = self._forms[f"{name} stiffness"] - self._forms[f"{name} mass"] * self._omega * self._omega
            rate = rate + self._system.numerics("held_motions").rate(self._system, name, self._modes)
        else:
            rate = direct
        if self._repeated is not None:
            rate = np.where(self._splits(name), np.nan, rate)
        rigid = np.isinf(self._system.values[name])
        return np.where(column(rigid), 0.0, rate) if rigid.any() else rate

    @property
    def _watched(self) -> int:
        """Number of modes compared: more than requested, to detect one beyond the last with the same frequency."""
        return min(self._modes + 2, self._system.most_modes)

    @cached_property
    def _repeated(self) -> NDArray[np.bool_] | None:
        """Which frequencies are equal to rounding, shape (..., modes + 2, modes + 2); None if none are."""
        if self._of_the_determinant or isinstance(self._system.modes(self._modes), OneWaveModes):
            return None  # those are apart; modes of one wave number in one field are not repeated
        omega = self._system.natural_frequencies(self._watched)
        near = np.abs(omega[..., :, None] - omega[..., None, :]) <= _SAME * omega[..., None, :]
        near &= (omega > 0)[..., None] & ~np.eye(omega.shape[-1], dtype=bool)
        return near if near[..., : self._modes, :].any() else None

    def _splits(self, name: str) -> NDArray[np.bool_]:
        """Return at which modes a change of the parameter splits a repeated frequency: there it has no derivative."""
        assert self._repeated is not None
        forms = self._system.form("rates", self._watched)
        omega = self._system.natural_frequencies(self._watched)
        block = forms[f"{name} stiffness"] - omega[..., None] * omega[..., None, :] * forms[f"{name} mass"]
        own = np.diagonal(block, axis1=-2, axis2=-1)
        off = np.maximum(np.abs(block), np.abs(own[..., :, None] - own[..., None, :]))
        size = np.maximum(np.abs(own[..., :, None]), np.abs(own[..., None, :])) + np.abs(block)
        return np.asarray(np.any((self._repeated & (off > _MIXED * size))[..., : self._modes, :], axis=-1))

    @cached_property
    def _is_complex(self) -> bool:
        """Whether there are no natural modes."""
        return self._system.conservative_part is not self._system

    @default_floating_point
    def _of_eigenvalue(self, name: str) -> Complex:
        if self._system.numerics("conservative"):
            return np.asarray(2j * np.pi * self._raw(name))
        return self._eigenvalue_rates(name)

    def _eigenvalue_rates(self, name: str, *, compliance: bool = False) -> Complex:
        key = name, compliance
        if key not in self._known:
            found = eigenvalue_rates(self._system, name, self._eigenvalues, compliance=compliance)
            found.flags.writeable = False
            self._known[key] = found[..., : self._modes]
        return self._known[key]

    @cached_property
    def _eigenvalues(self) -> Complex:
        return with_next(self._system, self._modes)

    def _of_damping_ratio(self, name: str) -> Array:
        s, rate = self.eigenvalue, self._of_eigenvalue(name)
        size = np.where(s == 0.0, 1.0, np.abs(s))
        return np.asarray((s.real * (s.conj() * rate).real / size**2 - rate.real) / size)

    @default_floating_point
    def _raw(self, name: str) -> Array:
        if self._is_complex:
            return self._of_eigenvalue(name).imag / (2 * np.pi)
        direct = self._at_an_end(name)
        if direct is not None:
            modes, kind, channel, factor = direct
            rate = modes.rates(kind, cycles=True)[channel]
            return self._at_rest(rate if (factor == 1).all() else factor * rate, name)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            value = self._squared(name) / self._omega / (4 * np.pi)
        return self._at_rest(value, name)

    @default_floating_point
    def _logarithmic(self, name: str) -> Array:
        if self._is_complex:
            given = np.asarray(self._system.values[name])
            return np.asarray(column(np.where(np.isinf(given), 0.0, given)) * self._raw(name) / self.frequency)
        direct = self._at_an_end(name)
        if direct is not None:
            modes, kind, channel, _ = direct
            value = modes.logarithmic_rates(kind)[channel]
        else:
            given = np.asarray(self._system.values[name])
            finite = column(np.where(np.isinf(given), 0.0, given))
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                value = self._squared(name) / self._omega / self._omega * (0.5 * finite)
        return np.where(self._still, np.nan, value) if self._loose else value

    def _at_an_end(self, name: str) -> tuple[OneWaveModes, Change, tuple[int, int], Array] | None:
        """Return modes, kind, (end, place) and factor of an end parameter with rates in closed form, or None."""
        if name in self._of_the_determinant:
            return None
        modes = self._system.modes(self._modes)
        kinds: tuple[tuple[str, Change], ...] = (("stiffnesses", "stiffness"), ("inertias", "inertia"))
        if not isinstance(modes, OneWaveModes) or modes.is_unfelt.any():
            return None
        for which, kind in kinds:
            found = self._system.numerics(which).get(name)
            if found is not None:
                factor = np.asarray(column(np.asarray(found.factor.function(*self._system.domain.values))))
                return modes, kind, (found.end, found.place), factor
        return None

    @default_floating_point
    def _by_compliance(self, name: str) -> Array:
        if self._is_complex:
            return self._eigenvalue_rates(name, compliance=True).imag / (2 * np.pi)
        end, place, kernel = self._system.numerics("stiffnesses")[name]
        modes = self._system.modes(self._modes)
        factor = column(np.asarray(kernel.function(*self._system.domain.values)))
        stiffness = factor * column(np.asarray(self._system.values[name]))
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            force, rigid = stiffness * modes.displacement(end, place), np.isinf(stiffness)
            force = np.where(rigid, modes.force(end, place), force) if rigid.any() else force
            value = -(force**2) / (8 * np.pi**2 * self.frequency * factor)
        return self._at_rest(value, name)

    def _at_rest(self, value: Array, name: str) -> Array:
        """Return the values with those of rigid-body modes corrected."""
        if not self._loose:
            return value
        squared = self._squared(name)
        moves = np.abs(squared) > 1e-20 * np.abs(squared).max(axis=-1, keepdims=True)  # more than by rounding
        directed = ((self._still.sum(axis=-1) > 1) & (moves & self._still).any(axis=-1))[..., None]
        return np.where(self._still, np.where(directed, np.nan, np.where(moves & ~np.isnan(value), value, 0.0)), value)

    @cached_property
    def _loose(self) -> bool:
        return bool(self._still.any())

    @cached_property
    def _still(self) -> Array:
        return np.asarray(self.frequency == 0)


@default_floating_point
def sensitivities(system: System, modes: int = 3, by: Sequence[str] | None = None) -> Sensitivities:
    """Return the sensitivities (31)-(32) of the natural frequencies to the parameters of a system.

    First-order perturbation with mass-normalised modes: d omega_i^2 is the modal change of the stiffness minus
    omega_i^2 times that of the mass. Displacements are held fixed relative to the length, so that lengths are
    parameters like any other. By a parameter that moves a support inside the domain, derivatives are differences of
    eighth order, with a relative error of about 1e-8. Without natural modes they are those of the complex eigenvalues,
    which all systems have as ``eigenvalue_rate``.

    Parameters
    ----------
    system : System
    modes : int
        How many, 1 to 1000, rigid-body modes included.
    by : sequence of str, optional
        Names of parameters; all of them by default.

    Returns
    -------
    Sensitivities
        Arrays of shape (..., modes); ``...`` is ``system.shape``.

    Raises
    ------
    TypeError, ValueError
        If ``system`` is not a :class:`System`, ``modes`` is not an integer from 1 to 1000, or a name is not that
        of a parameter.

    Examples
    --------
    >>> from cra_sym import Arm, sensitivities
    >>> found = sensitivities(Arm.nominal().replace(k_t=1e3, k_r=1e3))
    >>> print(found.log["k_t"].round(4), found.log_k_r.round(4))
    [0.0173 0.2076 0.204 ] [0.0089 0.0047 0.    ]
    """
    instance("system", system, System)
    by = tuple(system.values) if by is None else names("by", by, system.values)
    return Sensitivities(system, count("modes", modes, high=MOST_MODES), by)
