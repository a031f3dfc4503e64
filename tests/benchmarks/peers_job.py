"""Peers' packages on the same arms, run by `tests.benchmarks.peers` in an environment of their own.

Reads arms (unit length, mass and bending stiffness) as JSON and prints a row for each package: version, seconds a
round, and lambda. Each package is used as its manual says; what does not depend on the arm is made once.
"""

import json
import sys
from importlib.metadata import version
from time import perf_counter

import numpy as np


def by_scikit_fem(arms, modes, elements):
    """Hermite elements assembled by the library once, a sparse generalised eigenproblem for each arm."""
    import skfem
    from skfem.helpers import dd, ddot
    from skfem.utils import solver_eigen_scipy_sym

    basis = skfem.Basis(skfem.MeshLine(np.linspace(0.0, 1.0, elements + 1)), skfem.ElementLineHermite())
    bending = skfem.BilinearForm(lambda u, v, w: ddot(dd(u), dd(v))).assemble(basis).tolil()
    inertia = skfem.BilinearForm(lambda u, v, w: u * v).assemble(basis).tolil()
    (root, root_slope), (tip, _) = basis.nodal_dofs[:, 0], basis.nodal_dofs[:, -1]
    found = []
    for kappa_t, kappa_r, mu in arms:
        stiffness, mass = bending.copy(), inertia.copy()
        stiffness[root, root] += kappa_t
        stiffness[root_slope, root_slope] += kappa_r
        mass[tip, tip] += mu
        squares = solver_eigen_scipy_sym(k=modes, sigma=-1e-3)(stiffness.tocsc(), mass.tocsc())[0]
        found.append(np.sort(np.maximum(squares, 0.0)) ** 0.25)
    return np.array(found)


def by_opensees(arms, modes, elements):
    """Elastic beam-column elements with consistent mass, zero-length springs, ARPACK."""
    import openseespy.opensees as ops

    found = []
    for kappa_t, kappa_r, mu in arms:
        ops.wipe()
        ops.model("basic", "-ndm", 2, "-ndf", 3)
        ops.node(0, 0.0, 0.0)
        ops.fix(0, 1, 1, 1)
        for number in range(elements + 1):
            ops.node(number + 1, number / elements, 0.0)
            ops.fix(number + 1, 1, 0, 0)
        ops.uniaxialMaterial("Elastic", 1, kappa_t)
        ops.uniaxialMaterial("Elastic", 2, kappa_r)
        ops.element("zeroLength", 1, 0, 1, "-mat", 1, 2, "-dir", 2, 6)
        ops.geomTransf("Linear", 1)
        for e in range(1, elements + 1):
            ops.element("elasticBeamColumn", e + 1, e, e + 1, 1.0, 1.0, 1.0, 1, "-mass", 1.0, "-cMass")
        ops.mass(elements + 1, 0.0, mu, 0.0)
        squares = ops.eigen(modes)
        found.append(np.maximum(squares, 0.0) ** 0.25)
    return np.array(found)


PEERS = {"scikit-fem": by_scikit_fem, "openseespy": by_opensees}


def main():
    """Run every package that imports."""
    job = json.load(sys.stdin)
    rows = {}
    for name, function in PEERS.items():
        try:
            lam = function(job["arms"], job["modes"], job["elements"])
            seconds = []
            for _ in range(job["rounds"]):
                start = perf_counter()
                function(job["arms"], job["modes"], job["elements"])
                seconds.append(perf_counter() - start)
            rows[name] = {"version": version(name), "seconds": seconds, "lam": lam.tolist()}
        except Exception as error:
            rows[name] = {"failed": f"{type(error).__name__}: {error}"}
    print("\n" + json.dumps(rows))


if __name__ == "__main__":
    main()
