"""The arm as a library: frequencies, modes and responses around the functions derived from its Lagrangian."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import Any

from cra_sym.arm.parameters import Arm
from cra_sym.codegen.arm_batch import arm_batch
from cra_sym.codegen.arm_energies import energy_functions
from cra_sym.codegen.arm_in_time import arm_in_time, arm_signals
from cra_sym.codegen.arm_time_checks import arm_time_checks
from cra_sym.codegen.expressions import gauss_rule, modal_functions, spectrum_functions, stability_functions
from cra_sym.codegen.library import Check, Library, source
from cra_sym.codegen.model_time import Signals, in_time_readme
from cra_sym.codegen.printers import FormPrinter
from cra_sym.codegen.statement import stated
from cra_sym.codegen.vectors import TOLERANCE, arm_checks

__all__ = ["arm_library"]

_MODAL = (
    "omega", "participation", "root_displacement", "root_slope", "root_moment", "root_shear", "tip_displacement",
    "tip_slope",
)  # fmt: skip
_QUANTITIES = {"frequency_parameters": 0, "characteristic": 1, "natural_frequencies": 2} | {
    name: 3 + i for i, name in enumerate(_MODAL)
} | {
    name: 11 + i for i, name in enumerate((
        "mode_shape", "tip_response", "df_dk_t", "df_dk_r", "log_k_t", "log_k_r", "state_space_acceleration_A",
        "state_space_acceleration_B", "state_space_acceleration_C", "state_space_force_A", "state_space_force_B",
        "state_space_force_C", "excitation_joint", "excitation_axial", "boundary_joint", "boundary_axial",
        "in_time", "response", "input_shaper",
    ))
}  # fmt: skip
_README = """\
An Euler-Bernoulli manipulator on a driven base, with an elastic bolted joint (any stiffness from 0 to infinity) and
an end-effector. The frequencies are complete: an exact count says how many there are below any lambda. A frequency
takes some three evaluations of the characteristic function, whatever the arm; responses are sums over the modes in
closed form.
"""

_MODES, _TESTED = 16, 4  # modes in time, and of these in the reference vectors, at most
_STACK = """\
at most 10 kB, of which
`modes_of` takes 8 kB for `NAME_MOST_MODES` = 1000 modes, and 160 kB in the functions for many arms at once, `_batch`,
for blocks of `NAME_MOST_LANES` = 64 arms and up to `NAME_MOST_MODES_TOGETHER` = 16 modes; each may be set to less when
compiling (`-DNAME_MOST_MODES=20`). These functions become SIMD code as wide as the compiler may use:
`make ARCH=-march=native`"""
_OF_PRECISION = {  # in the order of _constants
    "float64": (1.7976931348623157e308, 2.2250738585072014e-308, 1e-16, 1e-13, 1e-12, 1e5),
    "float32": (2.9e38, 1.1754944e-38, 5e-8, 1e-5, 1e-5, 1e4),
}
LEAST_SHARE = _OF_PRECISION["float32"][4]
_IN_TIME = 1e-12  # error of time-domain outputs, relative to the largest term
_SINGLE, _SINGLE_MODAL = 1e-5, 5e-4  # errors allowed in single precision: of frequencies, of all other results
_PRECISION = {
    "float64": "",
    "float32": f"""
In single precision frequencies are right to {_SINGLE:g} and all else to {_SINGLE_MODAL:g} of the largest value, with
dimensionless groups from 1e-9 to 1e9, 0 and infinity.
""",
}


def arm_library(
    name: str, real: str = "float64", modes: int | None = None, drive: Any = None, outputs: Any = None
) -> Library:
    """Return the arm as a library.

    Parameters
    ----------
    name, real : str
    modes : int, optional
        Largest number in time, by default 16.
    drive, outputs
        In time, as :func:`cra_sym.state_space` takes them.

    Raises
    ------
    TypeError, ValueError
        As :func:`cra_sym.state_space`.
    """
    kept = _MODES if modes is None else modes
    if drive is None and outputs is None:
        return _usual(name, real, kept)
    return _library(name, real, arm_signals(kept, drive, outputs))


@lru_cache(maxsize=4)
def _usual(name: str, real: str, modes: int) -> Library:
    return _library(name, real, arm_signals(modes))


def _library(name: str, real: str, in_time: Signals) -> Library:
    parts = [_with_widths(source(part)) for part in ("arm", "arm_modes", "arm_check")]
    parts[2:2] = [arm_in_time(in_time)]
    parts[3] = parts[3].replace("TESTED", str(min(_TESTED, in_time.modes)))
    text = "\n\n".join([_constants(real), _generated(), *parts])
    summary = "A flexible Cartesian robotic arm: frequencies, modes, responses"
    statement = stated(Arm.nominal().model)
    checks = tuple(_checks(real, in_time))
    batch = arm_batch(name, real, TOLERANCE if real == "float64" else _SINGLE)
    stack = _STACK.replace("NAME", name.upper()) + (f"; {in_time.stack}" if in_time.free else "")
    readme = _README + _PRECISION[real] + in_time_readme(in_time, text)
    return Library(name, summary, text, statement, checks, readme, real, batch, stack)


def _constants(real: str) -> str:
    from cra_sym.solvers.one_wave import NEAR
    from cra_sym.solvers.one_wave_shapes import NEAR as NEAR_SHAPE

    nodes, weights = gauss_rule()
    terms = next(f.size for f in spectrum_functions() if f.name == "power_series")
    kinds = {
        "LARGEST": "values above it count as infinite",
        "LEAST_NORMAL": "the least normal number",
        "NEXT_STEP": "relative size of the next step at which the iteration stops before it",
        "LAST_STEP": "relative size of a step after which the iteration stops",
        "LEAST_SHARE": "smallest share of the total mass that moves with the base alone",
        "MOST_LAMBDA": "where powers of lambda stay in range",
    }
    numbers = zip(kinds.items(), _OF_PRECISION[real], strict=True)
    return (
        f"PI = {math.pi!r}  # half a turn\n"
        + "".join(f"{key} = {value!r}  # {statement}\n" for (key, statement), value in numbers)
        + f"NEAR = {float(NEAR[2])!r}  # lambda^4 below which the power series of the determinant serves\n"
        f"TERMS = {terms}  # of that series\n"
        f"GAUSS = {len(nodes)}  # points of Gauss's rule on (0, 1)\n"
        f"NODES = ({', '.join(map(repr, nodes))})\nWEIGHTS = ({', '.join(map(repr, weights))})\n"
        f"NEAR_SHAPE = {float(NEAR_SHAPE[2])!r}  # lambda^4 below which power series of the shapes serve\n"
    )


def _with_widths(text: str) -> str:
    """Insert the calls of the half-width functions, with arguments in the order of each function."""
    one, two = "first.omega", "second.omega"
    given = {
        "P_nn": "P", "P_mn": "P", "P_nm": "P", "epsilon": "epsilon", "omega_m": one, "omega_n": two,
        "c_m": f"zeta * {one}", "c_n": f"zeta * {two}",
    }  # fmt: skip
    for f in stability_functions():
        call = f"_{f.name}({', '.join(given[a.name] for a in f.arguments)})"
        text = text.replace(f"half = {f.name.removesuffix('_width').upper()}\n", f"half = {call}\n")
    return text


def _generated() -> str:
    functions = (*energy_functions(), *spectrum_functions(), *modal_functions(), *stability_functions())
    text = "\n\n".join(FormPrinter.text_of(f, f"_{f.name}", checked=False) for f in functions)
    return FormPrinter.helped(text) + text


def _checks(real: str, in_time: Signals) -> Iterator[Check]:
    """Yield the reference vectors from the package's own kernels, for the functions of the library."""
    for check in arm_checks(everything=True):
        quantity = _QUANTITIES[check.quantity]
        # a rigid-body mode has no sensitivities
        expected = tuple(x if math.isfinite(x) else 0.0 for x in check.outputs)
        if real == "float64":
            yield Check(quantity, check.inputs, expected, TOLERANCE, check.absolute)
            continue
        size = max(map(abs, expected))
        if check.quantity.startswith("state_space_force") and check.absolute * LEAST_SHARE > TOLERANCE * size:
            yield Check(quantity, check.inputs, (), refused=True)  # the base has almost no mass
            continue
        loss = _SINGLE if quantity <= _QUANTITIES["omega"] else _SINGLE_MODAL
        yield Check(quantity, check.inputs, expected, loss, loss / TOLERANCE * check.absolute)
    for name, inputs, expected, size in arm_time_checks(in_time, real, min(_TESTED, in_time.modes)):
        loss = _IN_TIME if real == "float64" else _SINGLE_MODAL
        yield Check(_QUANTITIES[name], inputs, expected, loss, loss * size)
    nominal = tuple(float(getattr(Arm.nominal(), name)) for name in ("L", "b", "h", "E", "rho", "m_b", "m_e", "J_e"))
    for bad in (math.nan, -1.0):
        yield Check(0, (bad, 0.0, 0.0, 0.0), (), refused=True)
        yield Check(1, (0.0, 0.0, 0.0, 0.0, bad, 0.0), (), refused=True)
        for place in range(11):
            given = [*nominal, 1e4, 1e3, 0.01]
            given[place] = bad
            yield Check(2, tuple(given), (), refused=True)
            yield Check(3, tuple(given), (), refused=True)
