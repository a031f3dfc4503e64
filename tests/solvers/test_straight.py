"""Formulas as text: what known coefficients leave out, and names used again."""

import operator
import re

import numpy as np
import pytest

from cra_sym.solvers.straight import Exact, straight

SAFE = [operator.add, operator.sub, operator.mul, operator.lt, operator.gt, operator.eq]


@pytest.mark.parametrize("known", [0, 1])
@pytest.mark.parametrize("operation", [*SAFE, operator.truediv], ids=lambda function: function.__name__)
def test_a_known_coefficient_computes_as_its_number(operation, known):
    for other in (-2.5, 0.5, 3.0):
        assert operation(Exact(known), other) == operation(float(known), other)
        if known or operation is not operator.truediv:
            assert operation(other, Exact(known)) == operation(other, float(known))
    assert -Exact(known) == -float(known) and abs(Exact(known)) == known
    same = Exact(known) - Exact(known)
    assert isinstance(same, Exact) and same.value == 0


def test_names_are_used_again_and_the_text_means_the_same():
    def chain(k, z):
        total = k[0] * z
        for _ in range(6):
            total = total * z + k[1]
        return [total, k[2] * z]

    text = straight("_chain", chain, ["z"], [None, None, 1])
    assert len(set(re.findall(r"\bt\d+\b", text))) <= 3  # a sum, a product, a coefficient
    names = {}
    exec(text, names)
    (total, same), coefficients = names["_chain"](np.array([[0.5], [2.0]]), 0, 1.5), (0.5, 2.0)
    assert total == pytest.approx(chain([*coefficients, 1.0], 1.5)[0], rel=1e-15) and same == 1.5
