"""Random Lagrangians from a grammar of energies: every frequency agrees with Ritz's method, or the model is refused.

``python -m tests.campaigns.lagrangians`` goes on where it was stopped; each trial is a line of the record. The suite
takes the first ones.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp

import cra_sym as cra
from tests.campaigns.trials import parser, results

RECORD = Path(__file__).with_name("lagrangians.jsonl")
TRIALS, MODES, ELEMENTS = 200, 3, 3
ROUNDING = 1e-9  # of Ritz's squares, over the largest: eps times the condition of the stiffness of 6 Hermite elements
x, t = sp.symbols("x t", real=True)
v, u = (sp.Function(name)(x, t) for name in "vu")


class Grammar:
    """Energies drawn at random; every number is a fraction, so that a trial says exactly what it is."""

    def __init__(self, trial: int) -> None:
        self._random = np.random.default_rng([41, trial])

    def chance(self, share: float) -> bool:
        """Return whether something is there."""
        return bool(self._random.random() < share)

    def number(self, low: float = 0.1, high: float = 10.0) -> sp.Rational:
        """Return a positive number of two digits."""
        return sp.Rational(f"{np.exp(self._random.uniform(np.log(low), np.log(high))):.2g}")

    def coefficient(self) -> sp.Expr:
        """Return a positive coefficient, constant or a function of x."""
        size, share = self.number(), self.number(0.1, 0.9)
        shapes = [
            1 + share * x,
            sp.exp(-share * x),
            1 + share * sp.sin(3 * x),
            1 + share * sp.Abs(x - sp.Rational(1, 4)),
            sp.Piecewise((1, x < sp.Rational(1, 2)), (1 + share, True)),
            sp.Max(sp.Rational(1, 2), 1 - x),
        ]
        return size * shapes[self._random.integers(len(shapes))] if self.chance(0.3) else size

    def beam(self, field: sp.Expr) -> tuple[sp.Expr, int]:
        """Return the density of a beam, with what it may stand on, and the number of its displacements at an end."""
        density = self.coefficient() * field.diff(t) ** 2 / 2 - self.coefficient() * field.diff(x, 2) ** 2 / 2
        if self.chance(0.3):
            density -= self.coefficient() * field.diff(x) ** 2 / 2
        if self.chance(0.3):
            density -= self.number(1.0, 100.0) * field**2 / 2
        if self.chance(0.2):
            density += self.number(0.001, 0.1) * field.diff(x, t) ** 2 / 2
        return density, 2

    def string(self, field: sp.Expr) -> tuple[sp.Expr, int]:
        """Return the density of a string or a rod, with what it may stand on."""
        density = self.coefficient() * field.diff(t) ** 2 / 2 - self.coefficient() * field.diff(x) ** 2 / 2
        if self.chance(0.3):
            density -= self.number(1.0, 100.0) * field**2 / 2
        return density, 1

    def timoshenko(self) -> sp.Expr:
        """Return the density of a thick beam, v across and u its rotation."""
        masses = self.coefficient() * v.diff(t) ** 2 / 2 + self.number(0.01, 0.5) * u.diff(t) ** 2 / 2
        return masses - self.coefficient() * u.diff(x) ** 2 / 2 - self.number(1, 100) * (v.diff(x) - u) ** 2 / 2

    def ends(self, displacements: list[sp.Expr]) -> tuple[list[sp.Expr], list[sp.Expr]]:
        """Return the energies of both ends, and the essential conditions."""
        energies, essential = [], []
        for place in (0, 1):
            energy = sp.S.Zero
            for displacement in displacements:
                kind = self._random.integers(4)
                if kind == 0:
                    essential.append(displacement.subs(x, place))
                if kind == 1:
                    energy -= self.number(0.1, 1000.0) * displacement**2 / 2
                if kind in (1, 2) and self.chance(0.3):
                    energy += self.number() * displacement.diff(t) ** 2 / 2
            energies.append(energy)
        return energies, essential

    def inside(self) -> list[tuple[sp.Expr, sp.Expr]]:
        """Return energies at places between the ends."""
        found = []
        if self.chance(0.3):
            found.append((sp.Rational(1, 4), self.number() * v.diff(t) ** 2 / 2))
        if self.chance(0.2):
            found.append((sp.Rational(1, 2), -self.number(1.0, 1000.0) * v**2 / 2))
        return found

    def model(self) -> dict[str, Any]:
        """Return the arguments of a model."""
        fields = [v]
        if self.chance(0.65):
            density, order = self.beam(v) if self.chance(0.6) else self.string(v)
            displacements = [v, v.diff(x)][:order]
        elif self.chance(0.4):
            fields, density, displacements = [v, u], self.timoshenko(), [v, u]
        else:
            fields, displacements = [v, u], []
            density = -self.number(0.1, 100.0) * (v - u) ** 2 / 2
            for field in fields:
                one, order = self.beam(field) if self.chance(0.5) else self.string(field)
                density, displacements = density + one, displacements + [field, field.diff(x)][:order]
        (left, right), essential = self.ends(displacements)
        inside = self.inside()
        ends = {"left": left, "right": right, "essential": essential, "inside": inside}
        return {"density": density, "fields": fields, "x": x, "domain": (0, 1), "t": t, **ends}


def tried(trial: int) -> dict[str, Any]:
    """Return by how much the frequencies differ from Ritz's, beyond what his elements leave; or why it was refused."""
    arguments = Grammar(trial).model()
    density = arguments.pop("density")
    try:
        model = cra.Model(density, **arguments)
        found = model.natural_frequencies({}, MODES)
    except ValueError as error:
        return {"refused": str(error), "model": sp.sstr({"density": density, **arguments})}
    nodes = [sp.Rational(1, 4), sp.Rational(1, 2)]
    coarse, fine = (
        model.ritz(elements=n, nodes=nodes).natural_frequencies({}, MODES) for n in (ELEMENTS, 2 * ELEMENTS)
    )
    # Each halving of the elements gains a factor of 4 at least: what is left is at most a third of the last gain.
    below, left = fine - found, (coarse - fine) / 2
    slack = np.sqrt(found**2 + 2.0 * ROUNDING * found.max() ** 2) - found
    gap = float(np.maximum(np.maximum(-below, below - left) - slack, 0.0).max() / found.max())
    line = {"gap": gap, "frequencies": list(found), "ritz": list(fine)}
    return line if gap == 0.0 else {**line, "model": sp.sstr({"density": density, **arguments})}


def main() -> None:
    """Go on with the record and say how it stands."""
    options = parser(__doc__, TRIALS).parse_args()
    done = results(RECORD, options, ({"trial": trial} for trial in range(options.trials)), tried)
    refused = [line for line in done if "refused" in line]
    bad = [line for line in done if line.get("gap")]
    print(f"{len(done)} of {options.trials}: {len(refused)} refused, {len(bad)} differ from Ritz")
    for line in (*bad, *refused):
        print(json.dumps(line))


if __name__ == "__main__":
    main()
