# mypy: ignore-errors
"""End stiffness and mass of the compiled versions as pairs that add up to 1, so that they may be infinite.

This text is put before those of `cra_sym.solvers.spectrum_lanes` and `cra_sym.solvers.modal_lanes`.
"""

import numpy as np


def _stiff(kappa):
    return 1.0 if kappa == np.inf else kappa / (1.0 + kappa), 1.0 / (1.0 + kappa)


def _heavy(mu):
    return mu / (1.0 + mu), 1.0 / (1.0 + mu)


def _both(kappa, mu):
    total = 1.0 + (kappa + mu)
    return 1.0 if kappa == np.inf else kappa / total, mu / total, 1.0 / total
