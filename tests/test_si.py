"""Numbers as users bring them: units converted or refused, exact numbers, masked and labelled arrays, extremes."""

import warnings
from datetime import timedelta
from decimal import Decimal
from fractions import Fraction

import mpmath
import numpy as np
import pytest
import sympy as sp

import cra_sym as cra
from cra_sym.checks import real_array
from cra_sym.symbols import L, t, v, x

ARM = cra.Arm.nominal()
SI = {"meter": (1.0, {"[length]": 1}), "millimeter": (1e-3, {"[length]": 1}), "kilogram": (1.0, {"[mass]": 1}),
      "newton / meter": (1.0, {"[mass]": 1, "[time]": -2}), "newton / millimeter": (1e3, {"[mass]": 1, "[time]": -2}),
      "hertz": (1.0, {"[time]": -1}), "degree / second": (np.pi / 180, {"[time]": -1}), "bit": (1.0, {"[data]": 1}),
      "pascal": (1.0, {"[mass]": 1, "[length]": -1, "[time]": -2})}  # fmt: skip


class PintQuantity:
    """The documented attributes of a quantity of Pint, for tests without Pint."""

    def __init__(self, magnitude, unit):
        self.magnitude, self.unit_name = magnitude, unit

    def __array__(self, *_, **__):
        return np.asarray(self.magnitude)

    def __repr__(self):
        return f"<Quantity({self.magnitude}, '{self.unit_name}')>"

    __str__ = __repr__

    @property
    def dimensionality(self):
        return SI[self.unit_name][1]

    def to_base_units(self):
        base = type(self)(self.magnitude, self.unit_name)
        base.units = "radian / second" if self.unit_name.startswith("degree") else self.unit_name
        return base

    def unit_items(self):
        return [tuple((*part.split(), 1)[:2]) for part in self.units.split(" / ")]

    def to(self, unit):
        return type(self)(np.asarray(self.magnitude) * SI[self.unit_name][0], unit)


class AstropyUnit:
    def __init__(self, **powers):
        self.bases = [type("Base", (), {"name": name}) for name in powers]
        self.powers = list(powers.values())


class AstropyQuantity(np.ndarray):
    """The documented attributes of a quantity of Astropy, which is an array that NumPy would strip of its unit."""

    unit = AstropyUnit()

    @classmethod
    def of(cls, value, scale=1.0, **powers):
        made = np.asarray(value, float).view(cls)
        made.scale, made.unit = scale, AstropyUnit(**powers)
        return made

    @property
    def value(self):
        return np.asarray(self)

    def decompose(self):
        return self.of(
            self.value * self.scale, 1.0, **{b.name: p for b, p in zip(self.unit.bases, self.unit.powers, strict=True)}
        )


class ShortQuantity(PintQuantity):
    """One of a registry that writes its units short, as ``rad/s``."""

    def to_base_units(self):
        base = super().to_base_units()
        base.unit_items, base.units = base.unit_items, "rad/s"
        return base

    def unit_items(self):
        return [("radian", 1), ("second", -1)] if self.unit_name.startswith("degree") else [("second", -1)]


class MaskedQuantity(np.ndarray):
    """The documented attributes of a masked array of Astropy, which is an array that NumPy would strip of its mask."""

    @classmethod
    def of(cls, values, mask):
        made = np.asarray(values, float).view(cls)
        made.mask = np.array(mask)
        return made

    @property
    def unmasked(self):
        return np.asarray(self)


class TableColumn(np.ndarray):
    """The documented attributes of a column of a table of Astropy, which is an array beside its unit."""

    @classmethod
    def of(cls, values, unit, mask=False):
        made = np.asarray(values, float).view(cls)
        made.unit, made.mask = unit, mask
        return made

    @property
    def quantity(self):
        return AstropyQuantity.of(np.asarray(self), 1e-3, kg=1)


class StatedArray:
    """An array in a file, with its unit among its attributes."""

    def __init__(self, values, **attrs):
        self.values, self.attrs = values, attrs

    def __array__(self, *_, **__):
        return np.asarray(self.values)


class Uncertain(float):
    nominal_value = std_dev = 1.0


class UnknownQuantity:
    units = "furlong"

    def __float__(self):
        return 1.0


@pytest.mark.parametrize(
    ("field", "value", "expected"),
    [
        ("k_t", PintQuantity(1, "newton / millimeter"), 1e3),
        ("k_t", PintQuantity([1.0, 2.0], "newton / millimeter"), [1e3, 2e3]),
        ("L", [PintQuantity(1, "meter"), PintQuantity(500.0, "millimeter")], [1.0, 0.5]),
        ("L", np.array([PintQuantity(1, "meter"), 2.0], dtype=object), [1.0, 2.0]),
        ("k_t", AstropyQuantity.of(3.0, 1e3, kg=1, s=-2), 3e3),
        ("k_r", AstropyQuantity.of([3.0], 1e-3, kg=1, m=2, s=-2, rad=-1), [3e-3]),
        ("m_e", TableColumn.of([1.0, 2.0], "g"), [1e-3, 2e-3]),
        ("m_e", TableColumn.of([1.0, 2.0], None), [1.0, 2.0]),
        ("m_e", StatedArray([1.0, 2.0], units=b"kg"), [1.0, 2.0]),
        ("k_t", sp.Integer(1000), 1e3),
        ("k_t", sp.oo, np.inf),
        ("L", sp.sqrt(2), 2**0.5),
        ("L", [sp.Rational(1, 2), 1], [0.5, 1.0]),
        ("E", Fraction(1, 3), 1 / 3),
        ("m_e", Decimal("0.001"), 0.001),
        ("m_e", np.array([Decimal("0.5"), Fraction(1, 4)]), [0.5, 0.25]),
        ("m_e", np.ma.masked_array([1.0, 2.0], mask=[False, False]), [1.0, 2.0]),
        ("m_e", np.float32(0.5), 0.5),
        ("m_e", MaskedQuantity.of([1.0, 2.0], [False, False]), [1.0, 2.0]),
        ("m_e", np.array([np.array([1.0, 2.0]), np.array([3.0, 4.0])], dtype=object), [[1.0, 2.0], [3.0, 4.0]]),
        ("L", sp.Matrix([1, sp.Rational(1, 2)]), [[1.0], [0.5]]),
        ("m_e", np.array([1, 2], dtype=np.uint8), [1.0, 2.0]),
    ],
)
def test_numbers_and_quantities_are_converted(field, value, expected):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        np.testing.assert_allclose(getattr(ARM.replace(**{field: value}), field), expected, rtol=1e-15)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("k_t", PintQuantity(1, "kilogram"), "k_t = .*kilogram.*: must be in N/m"),
        ("L", [PintQuantity(1, "kilogram")], "L = .*must be in m"),
        ("L", PintQuantity(1, "bit"), "L = .*not one of SI.*must be in m"),
        ("k_t", AstropyQuantity.of(3.0, m=1), "k_t = 3.*must be in N/m"),
        ("k_t", AstropyQuantity.of(3.0, A=1), "k_t = 3.*must be in N/m"),
        ("k_t", UnknownQuantity(), "k_t = .*its unit cannot be converted"),
        ("m_e", TableColumn.of([1.0, 2.0], "g", [False, True]), "m_e: element 1 is masked"),
        ("k_t", StatedArray([1.0], units="kN/m"), "k_t has units 'kN/m': must be in N/m; convert it first"),
        ("k_t", [Uncertain(1.0)], "k_t = .*has an uncertainty; must be real numbers, as its nominal value is"),
        ("m_e", np.ma.masked_array([1.0, 2.0], mask=[False, True]), "m_e: element 1 is masked"),
        ("m_e", [1.0, np.ma.masked], "m_e: an element is masked"),
        ("L", [True, 2.0], "L = .*booleans"),
        ("m_e", MaskedQuantity.of([1.0, 2.0], [False, True]), "m_e: element 1 is masked"),
        ("k_t", Decimal("1e400"), "k_t = 1E.400: must be a real number in the range of floating point"),
        ("k_t", Fraction(10**400), "k_t = 1000.*in the range of floating point"),
        ("k_t", sp.Integer(10) ** 400, "k_t = 1000.*in the range of floating point"),
        ("k_t", Decimal("sNaN"), "k_t = sNaN: must be a real number"),
        ("k_t", bytearray(b"12"), "k_t = bytearray.*not bytes"),
        ("k_t", np.array([[1.0], [2.0, 3.0]], dtype=object), "k_t = .*different shapes"),
        ("L", np.array([True, 2.0], dtype=object), "L = .*booleans"),
        ("L", sp.I, "L = I: must be real numbers"),
        ("L", sp.Symbol("a"), "L = a: must be real numbers"),
        ("L", 10**400, "L = 1000.*must be real numbers"),
        ("L", np.timedelta64(1, "s"), "L = .*must be real numbers"),
        ("m_e", [0.1, 0.2, np.nan], r"m_e\[2\] = nan: must be"),
        ("m_e", [[0.1, 0.2], [-3.0, 0.2]], r"m_e\[1, 0\] = -3.0: must be"),
    ],
)
def test_what_is_not_a_number_in_si_is_refused_by_name(field, value, message):
    with pytest.raises((TypeError, ValueError), match=message):
        ARM.replace(**{field: value})


def test_a_frequency_is_not_an_angular_frequency():
    assert real_array("omega", PintQuantity(180.0, "degree / second"), unit="rad/s") == pytest.approx(np.pi)
    with pytest.raises(ValueError, match="must be in rad/s; a frequency in Hz times 2 pi"):
        cra.BaseMotion(amplitude=1.0, angular_frequency=PintQuantity(10.0, "hertz"))
    with pytest.raises(ValueError, match="must be in Hz"):
        cra.identify_joint(ARM, AstropyQuantity.of([10.0, 20.0], rad=1, s=-1), 0.1)


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        (lambda: cra.identify_joint(ARM, ShortQuantity([180.0, 360.0], "degree / second"), 0.1), "must be in Hz"),
        (lambda: cra.frequency_response(ARM, ShortQuantity(1.0, "hertz")), "must be in rad/s"),
        (lambda: cra.Force(PintQuantity(1.0, "kilogram")), "level = .*must be in N or N m or N/m"),
        (lambda: cra.Force.sampled([0.0, 1.0], PintQuantity([1.0, 2.0], "kilogram")), "force = .*must be in N or"),
        (lambda: cra.frequency_parameters(PintQuantity(1.0, "kilogram"), 1.0, 0.0), "kappa_t = .*must be in 1"),
        (lambda: cra.BaseMotion(velocity=0.1) * PintQuantity(2.0, "meter"), "factor = .*must be in 1"),
        (lambda: cra.BaseMotion(amplitude=1e300, angular_frequency=1e10), "amplitude, angular_frequency: .*finite"),
        (lambda: list(cra.BaseMotion(velocity=0.1)), "no batch axis"),
    ],
)
def test_what_is_not_the_unit_of_an_argument_is_refused(asked, message):
    with pytest.raises((TypeError, ValueError), match=message):
        asked()


def test_a_unit_is_known_by_what_it_is_and_not_by_how_it_is_written():
    turning = ShortQuantity(180.0, "degree / second")
    assert real_array("omega", turning, unit="rad/s") == pytest.approx(np.pi)
    assert cra.Force(PintQuantity(2.0, "newton / millimeter"))(0.0) == 2e3


def test_times_are_seconds():
    assert real_array("t", np.timedelta64(1500, "ms"), unit="s") == 1.5
    assert real_array("t", timedelta(seconds=2), unit="s") == 2.0
    assert real_array("t", [timedelta(seconds=2), 3.0], unit="s").tolist() == [2.0, 3.0]


def test_values_of_any_model_know_the_units_of_the_nomenclature_and_their_own():
    damper = sp.Symbol("c")
    model = cra.Model(
        v.diff(t) ** 2 / 2 - v.diff(x, 2) ** 2 / 2, fields=[v], x=x, domain=(0, L), t=t,
        essential=[v.subs(x, 0), v.diff(x).subs(x, 0)], virtual_work=[(-damper * v.diff(t), v, "right")],
        units={damper: "N s/m"},
    )  # fmt: skip
    values = {L: PintQuantity(2000.0, "millimeter"), damper: 0.0}
    assert model.at(values).values["L"] == 2.0
    for bad in ({L: PintQuantity(1.0, "kilogram"), damper: 0.0}, {L: 1.0, damper: PintQuantity(1.0, "kilogram")}):
        with pytest.raises(ValueError, match=r"kilogram.*must be in"):
            model.at(bad)


@pytest.mark.parametrize("library", ["pint", "astropy"])
def test_real_quantities(library):
    if library == "pint":
        pint = pytest.importorskip("pint", reason="Pint is not a dependency")
        registry = pint.UnitRegistry(system="cgs")
        newton, mm, degree, hertz = (registry(u) for u in ("newton", "mm", "degree", "hertz"))
    else:
        u = pytest.importorskip("astropy.units", reason="Astropy is not a dependency")
        newton, mm, degree, hertz = u.N, u.mm, u.deg, u.Hz
    arm = ARM.replace(k_t=2 * newton / mm, k_r=3 * newton * mm / degree, L=np.array([1.0, 2.0]) * 1e3 * mm)
    assert arm.k_t == pytest.approx(2e3) and arm.k_r == pytest.approx(3e-3 * 180 / np.pi)
    np.testing.assert_allclose(arm.L, [1.0, 2.0])
    with pytest.raises(ValueError, match="must be in rad/s"):
        cra.frequency_response(ARM, 10 * hertz)


# Labelled arrays ------------------------------------------------------------------------------------------------


def labelled(values, *dims, units=None, **coords):
    xarray = pytest.importorskip("xarray", reason="the extra 'scale' brings xarray")
    return xarray.DataArray(values, dims=dims, coords=coords, attrs={} if units is None else {"units": units})


def test_labelled_arrays_pair_by_dimension():
    """The axes come in the order in which the parameters name them: L, b, ..., m_e, J_e, k_t, k_r."""
    k_t, m_e = labelled([1e3, 1e4, 1e5], "k"), labelled([0.0, 0.01, 0.1], "m")
    arm = ARM.replace(k_t=k_t, m_e=m_e)
    assert arm.shape == (3, 3)
    both = ARM.replace(k_t=labelled([[1.0, 2.0]], "a", "b"), m_e=labelled([[1.0], [2.0]], "b", "a"))
    assert both.shape == (2, 1) and np.ravel(both.m_e).tolist() == [1.0, 2.0]
    model = ARM.model.at({**ARM.values, "k_t": k_t, "m_e": m_e})
    assert model.shape == (3, 3)


@pytest.mark.parametrize(
    ("units", "good"), [("N/m", True), ("N m-1", True), ("kg s-2", True), ("N*m**-1", True), ("N/mm", False),
                        ("kg", False), ("parsec", False)],
)  # fmt: skip
def test_a_units_attribute_is_that_of_si_or_refused(units, good):
    value = labelled([1.0, 2.0], "k", units=units)
    if good:
        assert ARM.replace(k_t=value).k_t.tolist() == [1.0, 2.0]
    else:
        with pytest.raises(ValueError, match=r"k_t.*must be in N/m"):
            ARM.replace(k_t=value)


def test_a_units_attribute_tells_hertz_from_radians():
    assert real_array("omega", labelled([1.0], "k", units="rad/s"), unit="rad/s") == 1.0
    with pytest.raises(ValueError, match="must be in rad/s; a frequency in Hz times 2 pi"):
        real_array("omega", labelled([1.0], "k", units="Hz"), unit="rad/s")


@pytest.mark.parametrize(
    "shape",
    [
        lambda a, b: cra.frequency_parameters(a, b, 0.0).shape[:-1],
        lambda a, b: cra.BaseMotion.trapezoid(a, b, 1.0).shape,
        lambda a, b: cra.Force(a, b, 1.0).shape,
        lambda a, b: cra.JointStiffness(k_t=a, k_r=b).shape,
        lambda a, b: cra.input_shaper(a, 0.1 * b)[0].shape[:-1],
        lambda a, b: np.shape(cra.growth_rate(ARM.replace(k_t=1e3), cra.JointStiffness(), 28 * a, 0.1 * b, 1)),
    ],
)
def test_labelled_arguments_pair_by_dimension(shape):
    one, other = labelled([0.1, 0.2], "a"), labelled([0.3, 0.4], "b")
    assert shape(one, other) == (2, 2) and shape(one, one) == (2,)


def test_labelled_arguments_beside_a_batch_without_names_are_refused():
    batch, size = ARM.replace(k_t=[1e3, 2e3]), labelled([0.1, 0.2], "a")
    for asked in (lambda: cra.growth_rate(batch, cra.JointStiffness(), 28.0, size, 1),
                  lambda: cra.stability_boundary(batch, cra.JointStiffness(), size)):  # fmt: skip
        with pytest.raises(ValueError, match="system has axes without names, and epsilon has the dimensions"):
            asked()


def test_tables_of_other_rows_are_not_paired():
    pandas = pytest.importorskip("pandas", reason="the extra 'scale' brings pandas")
    values, rows = pandas.Series([1.0, 2.0], index=["a", "b"]), pandas.Series([Decimal(1), 2], index=["a", "b"])
    assert ARM.replace(k_t=values, m_e=rows).m_e.tolist() == [1.0, 2.0]
    with pytest.raises(ValueError, match="k_t: its index is not that of m_e"):
        ARM.replace(k_t=values, m_e=rows[::-1])
    assert (values * cra.BaseMotion(velocity=0.1)).shape == (2,)


def test_labelled_arrays_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="dimension 'k': m_e has 3 entries, k_t has 2"):
        ARM.replace(k_t=labelled([1.0, 2.0], "k"), m_e=labelled([1.0, 2.0, 3.0], "k"))
    with pytest.raises(ValueError, match="dimension 'k': its coordinate in m_e is not that in k_t"):
        ARM.replace(k_t=labelled([1.0, 2.0], "k", k=[0, 1]), m_e=labelled([1.0, 2.0], "k", k=[1, 0]))
    with pytest.raises(ValueError, match="m_e has axes without names"):
        ARM.replace(k_t=labelled([1.0, 2.0], "k"), m_e=[1.0, 2.0])
    with pytest.raises(ValueError, match="m_e has axes without names"):
        ARM.replace(m_e=[1.0, 2.0]).replace(k_t=labelled([1.0, 2.0], "k"))


# Lagrangians written with numbers -------------------------------------------------------------------------------


def clamped(density, **options):
    return cra.Model(density, fields=[v], x=x, domain=(0, 1), t=t, essential=[v.subs(x, 0), v.diff(x).subs(x, 0)],
                     **options)  # fmt: skip


@pytest.mark.parametrize(
    ("density", "first"),
    [
        (v.diff(t) ** 2 / 2 - v.diff(x, 2) ** 2 / 2, 3.5160152685),
        (2 * v.diff(t) ** 2 - 2 * v.diff(x, 2) ** 2, 3.5160152685),
        (sp.Float(2.0) * v.diff(t) ** 2 - sp.Float(8.0) * v.diff(x, 2) ** 2, 2 * 3.5160152685),
        (v.diff(t) ** 2 / 2 - v.diff(x, 2) ** 2 / 2 - 50 * v**2, np.hypot(3.5160152685, 10.0)),
    ],
)
def test_a_number_may_carry_any_unit(density, first):
    assert clamped(density).at({}).natural_frequencies(1)[0] == pytest.approx(first, rel=1e-9)


@pytest.mark.parametrize("term", ["E", "m_e", "rho"])
def test_a_parameter_of_the_nomenclature_carries_its_own(term):
    with pytest.raises(ValueError, match="its dimension is"):
        clamped(v.diff(t) ** 2 / 2 - sp.Symbol("E", positive=True) * v.diff(x, 2) ** 2 / 2
                - cra.symbols.symbol(term) * v**2 / 2)  # fmt: skip


@pytest.mark.parametrize(
    ("density", "message"),
    [
        (v.diff(t) ** 2 / 2 + v.diff(x, 2) ** 2 / 2, "the strain energy of a section is negative"),
        (-(v.diff(t) ** 2) / 2 - v.diff(x, 2) ** 2 / 2, "the kinetic energy of a section is negative"),
    ],
)
def test_an_energy_of_the_wrong_sign_is_said(density, message):
    with pytest.raises(ValueError, match=message):
        cra.natural_frequencies(clamped(density).at({}))


OTHER = sp.Function("u")(x, t)


@pytest.mark.parametrize(
    ("density", "fields"),
    [
        (v.diff(t) ** 2 / 2, [v]),
        (v.diff(t) ** 2 / 2 - v**2 / 2, [v]),
        (v.diff(t) ** 2 / 2 - v.diff(x) ** 2 / 2 + OTHER.diff(t) ** 2 / 2, [v, OTHER]),
    ],
)
def test_a_field_without_stiffness_along_the_length_is_refused(density, fields):
    model = cra.Model(density, fields=fields, x=x, domain=(0, 1), t=t)
    for asked in (cra.natural_frequencies, cra.mode_shapes):
        with pytest.raises(ValueError, match="has inertia or damping but no derivative by x, so infinitely many"):
            asked(model.at({}), *([0.5] if asked is cra.mode_shapes else []))


# Extreme values -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "changes", [{"k_t": 1e-160}, {"k_t": 3e-308}, {"k_t": 1e-200, "k_r": 1e-300}, {"k_r": 1e-307}, {"J_e": 1e-300}]
)
def test_tiny_values_give_numbers(changes):
    """As stiffnesses that are zero give: what is that small is nothing beside the beam."""
    nothing = {name: 0.0 for name in changes}
    found, limit = (cra.modal_parameters(ARM.replace(**c)) for c in (changes, nothing))
    for name in ("frequency", "participation", "root_displacement", "tip_slope"):
        assert np.isfinite(getattr(found, name)).all(), name
    elastic = limit.frequency > 0
    # both come from one solver, to its accuracy; rigid-body modes that share a frequency may mix
    np.testing.assert_allclose(found.frequency[elastic], limit.frequency[elastic], rtol=1e-12)
    np.testing.assert_allclose(np.abs(found.tip_displacement[elastic]), limit.tip_displacement[elastic], rtol=1e-6)


def test_numbers_that_have_lost_digits_are_refused():
    """A joint of 5e-324 N/m had 0 Hz."""
    for name, value in (("k_t", 5e-324), ("k_r", [1.0, 1e-310])):
        for changed in (ARM.replace, lambda **c: ARM.model.at({**ARM.values, **c})):
            with pytest.raises(ValueError, match=rf"{name} = .*must be 0 or at least 2.3e-308"):
                changed(**{name: value})


@pytest.mark.parametrize(
    ("k_t", "k_r", "E"),
    [(1e4, np.inf, 1e300), (1e4, 1e3, 1e300), (0.0, 1e3, 1e300), (1e4, 0.0, 1e300), (1e4, 1e3, 1e160),
     (1e-250, np.inf, 7e10), (1e-250, 1e-200, 7e10), (1e-305, 1e-200, 7e10), (1e-160, 1e-300, 7e10)],
)  # fmt: skip
def test_a_line_beside_which_a_spring_is_nothing_moves_as_a_rigid_body(k_t, k_r, E):
    """Against the rigid bar with its end mass, with digits to spare."""
    arm = ARM.replace(k_t=k_t, k_r=k_r, E=E, m_e=0.1, J_e=0.01)
    bar = mpmath.mpf(arm.rhoA)
    across, both, turn = bar + mpmath.mpf(0.1), bar / 2 + mpmath.mpf(0.1), bar / 3 + mpmath.mpf(0.1) + mpmath.mpf(0.01)
    with mpmath.workdps(400):
        if np.isinf(k_r):
            squared = [k_t / across]
        else:  # zeros of |K - z M|
            a, b, c = across * turn - both**2, mpmath.mpf(k_t) * turn + mpmath.mpf(k_r) * across, mpmath.mpf(k_t) * k_r
            high = (b + mpmath.sqrt(b**2 - 4 * a * c)) / (2 * a)
            squared = [c / (a * high), high]
        expected = [float(mpmath.sqrt(z) / (2 * mpmath.pi)) for z in squared]
    found = cra.natural_frequencies(arm, 4)
    # the accuracy of the solver
    np.testing.assert_allclose(found[: len(expected)], expected, rtol=1e-12)
    free = cra.natural_frequencies(arm.replace(k_t=0.0, k_r=k_r if np.isinf(k_r) else 0.0), 4)
    np.testing.assert_allclose(found[len(expected) :], free[len(expected) :], rtol=1e-12)


def test_what_is_asked_of_a_mode_that_a_spring_of_nothing_holds():
    arm = ARM.replace(E=1e300, k_t=1e4)
    rates, frequency = cra.sensitivities(arm), cra.natural_frequencies(arm)[0]
    assert rates.rate["k_t"][0] == pytest.approx(frequency / 2e4) and rates.log["k_t"][0] == pytest.approx(0.5)
    assert rates.compliance["k_t"][0] == pytest.approx(-frequency * 1e4 / 2)
    with pytest.raises(ValueError, match="below 1e-150 of the line's own"):
        _ = cra.modal_parameters(arm).root_shear
    motion = cra.BaseMotion(velocity=0.1)
    stiff = arm.replace(E=1e100)
    for asked in (lambda a: cra.tip_response(a, motion, [0.01, 0.02]), lambda a: cra.frequency_response(a, [3.0, 1e3])):
        np.testing.assert_allclose(asked(arm), asked(stiff), rtol=1e-10)


@pytest.mark.parametrize("k_t", [1e-8, 1e-25, 1e-40, 1e-160])
@pytest.mark.parametrize("zeta", [0.0, 0.1])
def test_a_base_that_hardly_holds_leaves_the_tip_behind(k_t, zeta):
    """The way of the base, less what an oscillator of mass rho A L + m_e loses in the time of the move.

    Rounding of the momentum over a frequency of nothing made it 2742 m of 0.1 m at 1e-40 N/m.
    """
    move = cra.BaseMotion.trapezoid(0.1, 0.2, 1.0)
    arm = ARM.replace(k_t=k_t, zeta=zeta)
    omega = np.sqrt(k_t / (arm.rhoA * arm.L + arm.m_e))
    # at rest after the move q = -0.1 + O(omega T) and q' = 2 zeta omega 0.1: the peak is q itself, to omega T
    assert cra.residual_vibration(arm, move, 1) == pytest.approx(0.1, rel=2 * omega + 1e-12)
    loose = cra.BaseMotion.sampled(None, [0.0, 1.0, 1.0, 0.0], sampling_rate=10.0)
    assert cra.residual_vibration(arm.replace(k_t=0.0), loose, 1) == np.inf
    if zeta == 0.0:
        _, gradient = cra.residual_vibration_gradient(arm, move, by=("k_t",), modes=1)
        # d/dk of omega^2 (0.1 T2 - area^2 / 0.2), T2 by the trapezoid: as of any soft spring
        soft = cra.residual_vibration_gradient(ARM.replace(k_t=1e-4), move, by=("k_t",), modes=1)[1]
        assert np.isnan(gradient) if k_t < 1e-10 else gradient == pytest.approx(soft, rel=1e-4)


# Signs ------------------------------------------------------------------------------------------------------------


PINNED_L, CLAMPED_L = [(v, 0)], [(v, 0), (v.diff(x), 0)]
PINNED_R, CLAMPED_R = [(v, 1)], [(v, 1), (v.diff(x), 1)]


@pytest.mark.parametrize(
    ("held", "place", "derivative"),
    [
        (CLAMPED_L, 1.0, 0),
        ([*CLAMPED_L, (v.diff(x), 1)], 1.0, 0),
        ([*PINNED_L, *PINNED_R], 1.0, 1),
        ([*CLAMPED_L, *PINNED_R], 1.0, 1),
        (CLAMPED_R, 0.999, 0),
        ([*PINNED_L, *CLAMPED_R], 0.999, 0),
        ([(v.diff(x), 0), *CLAMPED_R], 0.999, 0),
        ([*CLAMPED_L, *CLAMPED_R], 0.999, 0),
    ],
)
@pytest.mark.parametrize("foundation", [0, sp.Rational(1, 10)])
def test_the_sign_of_a_mode_is_that_of_its_right_end(held, place, derivative, foundation):
    """Free, guided, pinned and clamped: what moves first at the right end is positive, or else the field beside it."""
    model = cra.Model(
        v.diff(t) ** 2 / 2 - v.diff(x, 2) ** 2 / 2 - foundation * x * v**2, fields=[v], x=x, domain=(0, 1), t=t,
        essential=[displacement.subs(x, end) for displacement, end in held],
    )  # fmt: skip
    assert (cra.mode_shapes(model.at({}), place, 4, derivative) > 0).all()


def test_labelled_fields_of_a_motion_pair_by_dimension():
    motion = cra.BaseMotion(velocity=labelled([0.1, 0.2], "a"), amplitude=labelled([1e-3, 2e-3, 3e-3], "b"))
    assert motion.shape == (2, 3)
    with pytest.raises(ValueError, match="velocity has units 'km/h': must be in m/s"):
        cra.BaseMotion(velocity=labelled([0.1], "a", units="km/h"))
