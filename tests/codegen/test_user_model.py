"""The characteristic function of a model, as it is exported."""

import importlib.util

import numpy as np
import sympy as sp

import cra_sym as cra
from cra_sym.symbols import L, t, v, x


def test_a_function_without_a_zero_at_rest_is_exported(tmp_path):
    """A string between fixed ends: sin(z)/z, of which 60 digits cancel in the derivative as derived, next to rest."""
    m, N = sp.symbols("m N")
    string = cra.Model(
        m * v.diff(t) ** 2 / 2 - N * v.diff(x) ** 2 / 2,
        fields=[v], x=x, domain=(0, L), t=t, essential=[v.subs(x, 0), v.subs(x, L)],
    )  # fmt: skip
    made = cra.export("python", tmp_path / "out", model=string, name="fixed_string")
    (path,) = [path for path in made.directory.rglob("fixed_string.py")]
    spec = importlib.util.spec_from_file_location("fixed_string", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    names = [str(symbol) for symbol in string.symbols]
    values = dict(zip(names, (1.0,) * len(names), strict=True)) | {"L": 0.5, "m": 2.0, "N": 8.0}
    for omega in (0.0, 1.0, 3.9 * np.pi, 4.1 * np.pi):  # k L = omega / 4
        found = module.characteristic(omega, *(values[name] for name in names))
        value = found[0] if np.ndim(found) else found
        assert np.isclose(value, np.sinc(omega / 4 / np.pi), atol=1e-14)
