"""Templates are texts with marks, all of which are replaced."""

import pytest

from cra_sym.kernels import template
from cra_sym.model.one_wave_family import family
from cra_sym.model.one_wave_templates import spectrum_marks


def test_every_mark_is_replaced():
    line = family((("k",), ("m",)))
    text = template("cra_sym.solvers.spectrum_lanes", spectrum_marks(line.layout, line.functions))
    assert "__" not in text and "def frequency_parameters(out, evaluations, group_0, group_1):" in text


@pytest.mark.parametrize("change", [{"NOTHING": 1}, {"NEAR": None}])
def test_marks_that_do_not_fit_are_an_error(change):
    line = family((("k",), ("m",)))
    marks = spectrum_marks(line.layout, line.functions) | change
    marks = {name: value for name, value in marks.items() if value is not None}
    with pytest.raises(ValueError, match="spectrum_lanes has the marks"):
        template("cra_sym.solvers.spectrum_lanes", marks)
