"""What is written down by hand for the proofs, in numbers."""

import numpy as np
from sympy import lambdify

from cra_sym.paper.oracles import by_hand


def test_elimination_leaves_the_conditions_at_the_tip_of_shapes_that_meet_those_at_the_root():
    symbols = by_hand.lamda, by_hand.mu, by_hand.iota, by_hand.s_t, by_hand.c_t, by_hand.s_r, by_hand.c_r
    numbers = 1.7, 0.3, 0.1, 0.8, 0.2, 0.6, 0.4
    rows = by_hand.root_rows(), by_hand.tip_rows(), by_hand.eliminated()
    root, tip, eliminated = (np.array(lambdify(symbols, matrix)(*numbers), float) for matrix in rows)
    free = np.array([0.9, -0.4])
    shape = np.append(free, np.linalg.solve(root[:, 2:], -root[:, :2] @ free))
    np.testing.assert_allclose(eliminated @ free, np.linalg.det(root[:, 2:]) * (tip @ shape), rtol=1e-12)
