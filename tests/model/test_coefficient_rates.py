"""Derivatives of coefficients by parameters: against formulas, and with as few complex steps as the formulas allow."""

import numpy as np

from cra_sym.model.coefficient_rates import CoefficientRates


def formulas(p, counted=None):
    """Five coefficients of four parameters; an infinite p[3] holds what the fourth one describes."""
    a, b, c, d = p
    if counted is not None:
        counted.append(np.shape(p))
    held = np.isinf(d)
    finite = np.where(held, 0.0, d)
    return np.array([a * b, np.exp(b), c / (1.0 + c), np.where(held, 0.0, finite**2), 0.0 * a])


def test_derivatives_by_steps_of_several_parameters_are_those_of_the_formulas():
    rng, counted = np.random.default_rng(2), []
    columns = rng.uniform(0.1, 5.0, (4, 7))
    columns[3, 2], columns[2, 4] = np.inf, 0.0
    rates = CoefficientRates(lambda p: formulas(p, counted), 4, (3,))
    found = dict(rates(columns, (3, 1, 0, 2)))
    a, b, c, d = columns
    expected = {
        0: {3: np.where(np.isinf(d), 0.0, 2 * d)},
        1: {0: a, 1: np.exp(b)},
        2: {0: b},
        3: {2: 1 / (1.0 + c) ** 2},
    }
    assert found.keys() == expected.keys()
    for at, by_entry in expected.items():
        assert found[at].keys() == by_entry.keys()
        for entry, rate in by_entry.items():
            np.testing.assert_allclose(found[at][entry], rate, rtol=1e-15)
    assert counted[-1] == (4, 2 * 7)  # only the first two parameters share a coefficient


def test_a_parameter_that_acts_only_where_another_is_infinite_is_noticed():
    def coefficients(p):
        return np.array([np.where(np.isinf(p[1]), p[0], 1.0)])

    ((_, found),) = CoefficientRates(coefficients, 2, (1,))(np.array([[2.0, 3.0], [1.0, np.inf]]), (0,))
    np.testing.assert_array_equal(found[0], [0.0, 1.0])
