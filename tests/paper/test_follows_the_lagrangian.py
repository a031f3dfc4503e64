"""Change one term of the Lagrangian where it is stated: what is derived follows, and the second routes disagree."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

import cra_sym as cra
from cra_sym.paper.evaluation import termwise

#: Equations in the parameters of the Lagrangian that follow from it.
DERIVED = [6, "10a", "10b", "10c", 14, 15, 16, "16a", "16b", "16c", "16d", 17, 30, "35b", "36a", "36b"]
#: For the parameter of each term the equations of which the proof no longer holds, because what is written down by hand
#: has the old term.
REFUTED = {
    "rho": [3, 6, 8, "10a", "10b", 11, 17, 19, 23, 30, "36b"],
    "m_b": [3, 8, "10a", "10c"],
    "m_e": [3, 6, 8, "10a", 11, 14, 16, "16a", 19, 23, "36b"],
    "J_e": [3, 6, 8, 11, 14, 16, "16a", 19, 23],
    "E": [4, 6, 8, "10a", "10b", 11, 14, 15, 16, "16a", 17, 18, 23, 30],
    "k_t": [4, 6, 8, "10c", 11, 14, 16, "16a", 18, 23, "36a"],
    "k_r": [4, 6, 8, 11, 14, 16, "16a", 18, 23, "36a"],
}
PROVED = [e.number for e in cra.equations(companions=True) if any(e.number in refuted for refuted in REFUTED.values())]

#: To be run in a process of its own: the energies are replaced before anything is derived from them.
CHANGED = """
import json, sys
from sympy import Rational
from cra_sym.arm import lagrangian
from cra_sym.symbols import symbol

name, derived, proved = json.loads(sys.argv[1])
parameter, factor = symbol(name), Rational(17, 10)

def changed(energy):
    def scaled(**options):
        return lagrangian.ArmLagrangian(*(part.subs(parameter, factor * parameter) for part in energy(**options)))
    return scaled

lagrangian.kinetic_energy = changed(lagrangian.kinetic_energy)
lagrangian.potential_energy = changed(lagrangian.potential_energy)

import cra_sym as cra
from tests.paper.test_follows_the_lagrangian import text

print(json.dumps({
    "back": [text(n, {parameter: parameter / factor}) for n in derived],
    "refuted": [n for n in proved if not cra.equation(n).prove()],
}))
"""


def text(number, values=None):
    """Return both sides of an equation in a normal form."""
    expression = cra.equation(number).expression
    parts = expression if isinstance(expression, tuple) else (expression,)
    return [str(termwise((e.lhs - e.rhs).subs(values or {}))) for e in parts]


@pytest.mark.sample(2, 6)
@pytest.mark.parametrize("name", REFUTED)
def test_every_equation_follows_and_the_hand_written_ones_refute_it(name):
    argument = json.dumps([name, DERIVED, PROVED])
    root = Path(__file__).resolve().parents[2]
    command = [sys.executable, "-c", CHANGED, argument]
    found = json.loads(subprocess.run(command, cwd=root, capture_output=True, text=True, check=True).stdout)
    assert found["back"] == [text(number) for number in DERIVED]
    assert found["refuted"] == [number for number in PROVED if number in REFUTED[name]]
