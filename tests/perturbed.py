"""Public numbers of the arm under a changed Lagrangian, in a process of its own: ``python -m tests.perturbed NAME``.

The changed Lagrangian takes the place of the paper's before anything is derived. Every public number of the arm is then
computed twice, of the arm and of the model of the changed Lagrangian, and printed as JSON. Nothing that may know the
Lagrangian is read from a store: only what rests on the room of mechanics and on an oscillator alone.
"""

from __future__ import annotations

import json
import sys
import warnings
from collections.abc import Callable

import numpy as np
from sympy import Add, Expr, Rational, S

import cra_sym as cra
from cra_sym.arm import lagrangian
from cra_sym.arm.lagrangian import ArmLagrangian
from cra_sym.kernels import store
from cra_sym.symbols import A, E, I_z, J_e, L, b, h, k_r, k_t, m_b, m_e, rho, t, v, w, x

FACTOR = Rational(17, 10)
HALF = Rational(1, 2)


def scaled(end: int, marker: Expr) -> Callable[[ArmLagrangian], ArmLagrangian]:
    """Return a change that multiplies the terms of one piece that hold a symbol by `FACTOR`."""

    def change(pieces: ArmLagrangian) -> ArmLagrangian:
        parts = list(pieces)
        terms = Add.make_args(parts[end].expand())
        parts[end] = Add(*(term * FACTOR if term.has(marker) else term for term in terms))
        return ArmLagrangian(*parts)

    return change


def added(density: Expr = S.Zero, right: Expr = S.Zero) -> Callable[[ArmLagrangian], ArmLagrangian]:
    """Return a change that adds terms the paper does not have."""
    return lambda pieces: ArmLagrangian(pieces.density + density, pieces.left, pieces.right + right)


speed = (w + v).diff(t)
offset = HALF * m_e * ((speed + L / 20 * v.diff(x, t)) ** 2 - speed**2)
CHANGES: dict[str, Callable[[ArmLagrangian], ArmLagrangian]] = {
    "nothing": lambda pieces: pieces,
    "manipulator's mass": scaled(0, rho),
    "manipulator's stiffness": scaled(0, E),
    "base's mass": scaled(1, m_b),
    "translational spring": scaled(1, k_t),
    "rotational spring": scaled(1, k_r),
    "end-effector's mass": scaled(2, m_e),
    "end-effector's inertia": scaled(2, J_e),
    "axial tension": added(-HALF * (E * A / 10**6) * v.diff(x) ** 2),
    "foundation": added(-HALF * (E / 10**9) * v**2),
    "offset end-effector": added(right=offset),
}

ARM = cra.Arm.nominal().replace(k_t=[2e3, 40.0], k_r=[50.0, 3.0], m_e=0.05, J_e=1e-4, zeta=1e-3)
TIMES = np.linspace(0.0, 1.0, 9)
MOTION = cra.BaseMotion(velocity=0.1, acceleration=0.2, amplitude=1e-3, angular_frequency=10.0)
MOVE = cra.BaseMotion.trapezoid(0.2, 0.5, 1.0)
JOINT, AXIAL = cra.JointStiffness(1.0, 0.5), cra.AxialBase(0.02)
MODAL = (
    "omega frequency participation root_displacement root_slope root_moment root_shear tip_displacement tip_slope "
    "axial stiffness_translation stiffness_rotation left right left_force right_force"
).split()


def numbers(system: cra.System) -> dict[str, np.ndarray]:
    """Return every public number of a system, by the name of the function that gives it."""
    one = system.replace(k_t=2e3, k_r=50.0)
    p, s = cra.modal_parameters(system, 4), cra.sensitivities(system, 4)
    found = {
        "natural_frequencies": cra.natural_frequencies(system, 5),
        **{f"mode_shapes {d}": cra.mode_shapes(system, [0.0, 0.3, 1.0], 4, d) for d in range(4)},
        **{f"modal_parameters.{name}": getattr(p, name) for name in MODAL},
        **{f"sensitivities.rate {name}": value for name, value in s.rate.items()},
        **{f"sensitivities.log {name}": value for name, value in s.log.items()},
        **{f"sensitivities.compliance {name}": value for name, value in s.compliance.items()},
        **{f"tip_response {d}": cra.tip_response(system, MOTION, TIMES, derivative=d) for d in range(3)},
        "response": cra.response(system, MOVE, TIMES, [0.2, 0.9]),
        "residual_vibration": cra.residual_vibration(system, MOVE),
        "residual_vibration_gradient": cra.residual_vibration_gradient(system, MOVE, ("k_t", "c_r", "m_e", "L"))[1],
        **{
            f"frequency_response {damping}": cra.frequency_response(system, [0.0, 3.0, 40.0], damping=damping)
            for damping in ("modal", "structural")
        },
        **{
            f"state_space {given} {part}": getattr(cra.state_space(one, 3, given), part)
            for given in ("base_acceleration", "drive_force")
            for part in "ABCD"
        },
        "forced_width": cra.forced_width(system, cra.TransverseBase(1e-3)),
    }
    grid = np.linspace(5.0, 200.0, 79)  # some of it in the principal zones of the first two modes
    for name, excitation in (("JointStiffness", JOINT), ("AxialBase", AXIAL)):
        for order in (1, 2):
            found[f"stability_boundary {name} {order}"] = cra.stability_boundary(
                system, excitation, 0.2, (2, 2), order=order
            )
        found[f"growth_rate {name}"] = cra.growth_rate(one, excitation, grid, 0.6)
        found[f"floquet_exponents {name}"] = np.sort(cra.floquet_exponents(one, excitation, grid, 0.6).real)
    found["growth_rate residual"] = cra.growth_rate(one, JOINT, grid, 0.6, residual=True)
    measured = np.array([2.0, 10.0, 30.0])
    prior = {"k_t": (2e3, 1e3), "k_r": (50.0, 20.0)}  # it spares the search
    estimate = cra.identify_joint(one, measured, 0.5, prior=prior)
    found["identify_joint"] = np.array([estimate.k_t, estimate.k_r])
    certificate = cra.certify(one, 3)
    found["certify"] = np.array([certificate.lower, certificate.upper])
    return {name: np.asarray(value) for name, value in found.items()}


def without_stored_models() -> None:
    """Let no derivation be stored or read that may have been made from a Lagrangian; machine code is that of a text."""
    load, save = store.load, store.save

    def knows(key: str) -> bool:
        return key.startswith("cra_sym.") and not key.startswith(("cra_sym.mechanics.", "cra_sym.model.oscillator:"))

    store.load = lambda key: None if knows(key) else load(key)
    store.save = lambda key, content: not knows(key) and save(key, content)


def main(name: str) -> None:
    """Print the numbers of the arm and of the model of the Lagrangian changed as ``name`` says."""
    without_stored_models()
    paper, change = lagrangian.paper_lagrangian, CHANGES[name]
    lagrangian.paper_lagrangian = lambda *, joint=True: change(paper(joint=joint))  # type: ignore[assignment]
    density, left, right = change(paper())
    model = cra.Model(
        density,
        fields=[v],
        prescribed=[w],
        x=x,
        domain=(0, L),
        t=t,
        left=left,
        right=right,
        definitions={A: b * h, I_z: b * h**3 / 12},
    )
    warnings.simplefilter("ignore")  # what a boundary or a fit has to say is not the question here
    written = {
        which: {key: [value.real.tolist(), value.imag.tolist()] for key, value in numbers(system).items()}
        for which, system in (("arm", ARM), ("model", model.at(ARM.values, zeta=ARM.zeta)))
    }
    json.dump(written, sys.stdout)


if __name__ == "__main__":
    main(sys.argv[1])
