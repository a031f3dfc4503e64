"""The formulas of a uniform problem with up to three waves a section, as functions of the restricted form."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from cra_sym.codegen.traced import Dual, Traced
from cra_sym.codegen.waves_layout import WavesLayout
from cra_sym.codegen.waves_quantities import LENGTHS, flat, nested, one_basis, principal_minors, with_rates
from cra_sym.solvers import waves_count, waves_kernel, waves_modes, waves_problem
from cra_sym.solvers.straight import Exact, Term

__all__ = ["WavesText"]

kernel: Any = waves_kernel  # formulas of arrays and terms, without types
_WORDS = {
    "any": "",
    "near": " where all waves are long",
    "close": " where two wave numbers are complex or close together",
    "distant": " where wave numbers are real or imaginary and apart",
    "series": " of three coupled displacements where all waves are long",
}


class WavesText(WavesLayout):
    """Writer of the functions of one structure; arguments as `WavesLayout`."""

    def functions(self, *, loads: bool) -> str:
        """Return all functions; ``loads`` says whether integrals of displacements are needed."""
        found = [self._wave_numbers(), self._wave_number_rates()]
        found += [self._regime()] if len(self.kinds) > 1 else []
        found += [self._branch(), self._energy()]
        for kind in self.kinds:
            found += [self._columns(kind), self._columns(kind, places=True), self._rates(kind)]
            found += [self._integrals(kind)] if loads else []
        given = "k: Row[float, COEFFICIENTS], w: Row[float, WAVE_ENTRIES], z: float"
        rates = (
            "k: Row[float, COEFFICIENTS], k_rate: Row[float, COEFFICIENTS], w: Row[float, WAVE_ENTRIES], "
            "w_rate: Row[float, WAVE_ENTRIES], z: float, z_rate: float"
        )
        rows = {
            "waves": (given, "k, w, z", ("c",)),
            "waves_at": (f"{given}, x: float", "k, w, z, x", ("c",)),
            "rates": (rates, "k, k_rate, w, w_rate, z, z_rate", ("c", "c_rate")),
        }
        if loads:
            rows["integrals"] = rows["waves"]
        found += [self._chosen(name, *words) for name, words in rows.items()] if len(self.kinds) > 1 else []
        return "\n\n".join([*found, self._determinant(), self._determinant_rate(), self._count(), self._conditions()])

    # Terms ------------------------------------------------------------------------------------------------------------

    def _coefficients(self, traced: Traced, *, rates: bool = False) -> list[Any]:
        found: list[Any] = []
        for place, value in enumerate(self.known):
            if value is not None:
                found.append(Exact(value))
                continue
            entry: Any = traced.entry("k", self.places[place])
            if rates and place < self.structure.condition(0):  # the matrices of a section
                entry = Dual(entry, traced.entry("k_rate", self.places[place]))
            found.append(entry)
        return found

    def _traced(self, name: str, doc: str, *given: str, **options: Any) -> tuple[Traced, list[Any], Any]:
        rows = [("k", "COEFFICIENTS"), ("w", "WAVE_ENTRIES")]
        traced = Traced(name, doc, rows, ["z", *given], **options)
        return traced, self._coefficients(traced), traced.number("z")

    def _waves_of(self, traced: Traced, *, rates: bool = False) -> list[Any]:
        """Return the quantities of the waves of each block from the row that contains them."""
        found = []
        at = 0
        for size in self.structure.sizes:
            entries: list[Any] = []
            for place in range(at, at + LENGTHS[size]):
                entry = traced.entry("w", place)
                entries.append(Dual(entry, traced.entry("w_rate", place)) if rates else entry)
            at += LENGTHS[size]
            found.append(nested(entries) if size == 3 else tuple(entries))
        return found

    def _blocks(self, k: Any, z: Any, waves: Sequence[Any]) -> list[tuple[tuple[int, int], Any, Any, Any]]:
        """Return each block with its matrices and its waves."""
        matrices = waves_count.sections(self.structure, k, z)
        given = zip(self.structure.blocks, matrices, waves, strict=True)
        return [(block, a, b, own) for block, (a, b), own in given]

    def _kind(self, kind: str, block: tuple[int, int]) -> str:
        """Return the regime of a block, None for a single displacement."""
        return kind if block[1] - block[0] > 1 else "any"

    # Functions --------------------------------------------------------------------------------------------------------

    def _wave_numbers(self) -> str:
        words = "Return squared wave numbers and what follows from them."
        traced = Traced("_wave_numbers", words, [("k", "COEFFICIENTS")], ["z"], guarded=True)
        k, z = self._coefficients(traced), traced.number("z")
        return traced.text(self._numbers(k, z), [("w", "WAVE_ENTRIES", self.wave_numbers)])

    def _wave_number_rates(self) -> str:
        words = "Return squared wave numbers and what follows from them, and their rates for given rates of k and z."
        rows = [("k", "COEFFICIENTS"), ("k_rate", "COEFFICIENTS")]
        traced = Traced("_wave_number_rates", words, rows, ["z", "z_rate"], guarded=True)
        z = Dual(traced.number("z"), traced.number("z_rate"))
        found = self._numbers(self._coefficients(traced, rates=True), z)
        out = [(name, "WAVE_ENTRIES", self.wave_numbers) for name in ("w", "w_rate")]
        return traced.text(with_rates(found), out)

    def _numbers(self, k: Any, z: Any) -> list[Any]:
        found: list[Any] = []
        matrices = waves_count.sections(self.structure, k, z)
        for block, (a, b) in zip(self.structure.blocks, matrices, strict=True):
            waves = waves_count.block_waves(self.structure, block, a, b)
            found += flat(waves)
        return found

    def _regime(self) -> str:
        words = (
            "Return the regime: 0 for long waves, 1 for close or complex wave numbers, 2 for others, 3 for three long."
        )
        traced = Traced("_regime", words, [("w", "WAVE_ENTRIES")], guarded=True)
        sizes = self.structure.sizes
        found = waves_count.regime(self._waves_of(traced)[sizes.index(max(sizes))])
        return traced.text([kernel.where(found > 2.5, found - 1.0, found)])  # both signs are not a regime

    def _branch(self) -> str:
        words = "Return the lowest z = omega^2 of free waves of which a given number of half waves fits the length."
        traced = Traced("_branch", words, [("k", "COEFFICIENTS")], ["turns"], guarded=True)
        turns = traced.number("turns")
        return traced.text([waves_count.lowest_branch(self.structure, self._coefficients(traced), turns)])

    def _energy(self) -> str:
        words = "Return 1 where static strain energy inside may be negative, as in compression, else 0."
        traced = Traced("_negative_energy", words, [("k", "COEFFICIENTS")])
        k = self._coefficients(traced)
        force = [[self._static(k, i, j)[1] for j in range(self.structure.n)] for i in range(self.structure.n)]
        bad: Any = False
        for value, scale in principal_minors(force):
            below = value < (0.0 if scale is None else -1e-14 * scale)
            bad = (below | bad) if isinstance(below, Term) else bad
        return traced.text([kernel.where(bad, 1.0, 0.0)])

    def _static(self, k: Any, i: int, j: int) -> tuple[Any, Any]:
        """Return entries of A_qq and A_Pq at z = 0 times half the length."""
        odd, n = self.structure.odd, self.structure.n
        a, b = (k[first + n * i + j] for first in self.structure.matrices)
        gradient = b if not odd[i] and odd[j] else a if odd[i] and not odd[j] else Exact(0)
        force = a if not odd[i] and not odd[j] else b if odd[i] and odd[j] else Exact(0)
        return gradient, force

    def static(self) -> str:
        """Return the function of A_qq and A_Pq at z = 0."""
        words = "Return the matrices of q' and P' by q of a motion at rest, times half the length."
        traced = Traced("_at_rest", words, [("k", "COEFFICIENTS")])
        k, n = self._coefficients(traced), self.structure.n
        entries = [self._static(k, i, j) for i in range(n) for j in range(n)]
        out = [(name, "PLANE", n * n) for name in ("gradient", "force")]
        return traced.text([entry[at] for at in (0, 1) for entry in entries], out)

    def _columns(self, kind: str, *, places: bool = False) -> str:
        name = f"_waves{'_at' if places else ''}{_suffix(kind)}"
        where = "x from mid-span (in half lengths)" if places else "the right end"
        words = f"Return the waves at {where}{_WORDS[kind]}, over their size at the ends."
        traced, k, z = self._traced(name, words, *(["x"] if places else []))
        columns, bases = [], []
        for block, a, b, waves in self._blocks(k, z, self._waves_of(traced)):
            own = self._kind(kind, block)
            if places:
                signs = waves_count.signs(self.structure, block)
                columns += waves_modes.block_at(signs, a, b, waves, traced.number("x"), own)
                bases.append(1.0)
                continue
            found, basis = waves_count.block_columns(self.structure, block, a, b, waves, own)
            columns += found
            bases.append(basis)
        bases = [basis for basis, place in zip(bases, self.scaled, strict=True) if place is not None]
        return traced.text([*columns, *bases], [("c", "SECTION", self.section)])

    def _rates(self, kind: str) -> str:
        words = f"Return the waves at the right end{_WORDS[kind]}, and how they change with coefficients and z."
        rows = [("k", "COEFFICIENTS"), ("k_rate", "COEFFICIENTS"), ("w", "WAVE_ENTRIES"), ("w_rate", "WAVE_ENTRIES")]
        traced = Traced(f"_rates{_suffix(kind)}", words, rows, ["z", "z_rate"])
        z = Dual(traced.number("z"), traced.number("z_rate"))
        found: list[Any] = []
        bases: list[Any] = []
        k, own_waves = self._coefficients(traced, rates=True), self._waves_of(traced, rates=True)
        for block, a, b, waves in self._blocks(k, z, own_waves):
            columns, basis = waves_count.block_columns(self.structure, block, a, b, waves, self._kind(kind, block))
            found += columns
            bases += [basis] if block[1] - block[0] > 1 else []
        out = [(name, "SECTION", self.section) for name in ("c", "c_rate")]
        return traced.text(with_rates([*found, *bases]), out)

    def _integrals(self, kind: str) -> str:
        words = (
            f"Return half the integrals of the waves over the length{_WORDS[kind]}: E of the first, O of the others."
        )
        traced, k, z = self._traced(f"_integrals{_suffix(kind)}", words)
        found: list[Any] = []
        for block, a, b, waves in self._blocks(k, z, self._waves_of(traced)):
            size = block[1] - block[0]
            whole = waves_modes.block_integrals(
                waves_count.signs(self.structure, block), a, b, waves, self._kind(kind, block)
            )
            nothing = [0.0] * size**2
            found += [*whole[: size**2], *nothing, *whole[2 * size**2 : 3 * size**2], *nothing]
        found += [1.0] * (self.section - len(found))
        return traced.text(found, [("c", "SECTION", self.section)])

    def _chosen(self, name: str, given: str, arguments: str, rows: tuple[str, ...]) -> str:
        """Return the function that calls the one of the regime."""
        out = "".join(f", {row}: Out[Row[float, SECTION]]" for row in rows)
        doc = {
            "waves": "Return the waves at the right end.",
            "waves_at": "Return the waves at x from mid-span, in half lengths, from 0 to 1.",
            "rates": "Return the waves at the right end, and how they change.",
            "integrals": "Return half the integrals of the waves.",
        }[name]
        head = f'def _{name}({given}{out}) -> None:\n    """{doc}"""\n    kind = _regime(w)\n'
        lines = []
        for at, kind in enumerate(self.kinds):
            test = "if kind < 0.5:" if at == 0 else f"elif kind < {at}.5:" if at + 1 < len(self.kinds) else "else:"
            lines.append(f"    {test}\n        _{name}{_suffix(kind)}({arguments}, {', '.join(rows)})\n")
        return head + "".join(lines)

    def _at_end(self, traced: Traced, *, rates: bool = False) -> tuple[list[Any], list[Any]]:
        """Return the columns and bases of all blocks in the order of the row."""

        def entry(at: int) -> Any:
            value = traced.entry("c", at)
            return Dual(value, traced.entry("c_rate", at)) if rates else value

        columns = [
            [entry(at) for at in range(first, last)]
            for first, last in zip(self.offsets, self.offsets[1:], strict=False)
        ]
        return columns, [1.0 if place is None else entry(place) for place in self.scaled]

    def _determinant(self) -> str:
        words = "Return the determinant of the end conditions, entire in z up to a positive factor."
        traced = Traced("_determinant", words, [("k", "COEFFICIENTS"), ("c", "SECTION")], ["z"])
        columns, bases = self._at_end(traced)
        k, z = self._coefficients(traced), traced.number("z")
        return traced.text([waves_count.value_of(self.structure, k, z, columns, one_basis(bases))])

    def _determinant_rate(self) -> str:
        words = "Return the derivative of the determinant by z, times the same factor."
        rows = [("k", "COEFFICIENTS"), ("c", "SECTION"), ("c_rate", "SECTION")]
        traced = Traced("_determinant_rate", words, rows, ["z"])
        columns, bases = self._at_end(traced, rates=True)
        k, z = self._coefficients(traced), Dual(traced.number("z"), Exact(1))
        value = waves_count.value_of(self.structure, k, z, columns, one_basis(bases))
        return traced.text([value.rate if isinstance(value, Dual) else 0.0])

    def _count(self) -> str:
        words = "Return the number of zeros below z, exact, and the determinant."
        rows = [("k", "COEFFICIENTS"), ("w", "WAVE_ENTRIES"), ("c", "SECTION")]
        traced = Traced("_count", words, rows, ["z"])
        columns, bases = self._at_end(traced)
        k, z = self._coefficients(traced), traced.number("z")
        blocks = self._blocks(k, z, self._waves_of(traced))
        matrices = [(a, b) for _, a, b, _ in blocks]
        waves = [one for *_, one in blocks]
        return traced.text(
            waves_count.count_of(self.structure, k, z, matrices, waves, columns, bases), [("found", "2", 2)]
        )

    def _conditions(self) -> str:
        words = "Return the conditions, those of the right end first, on all unknowns: a matrix, row by row."
        traced = Traced("_conditions", words, [("k", "COEFFICIENTS"), ("c", "SECTION")], ["z"])
        columns, _ = self._at_end(traced)
        k, z, n = self._coefficients(traced), traced.number("z"), self.structure.n
        ends = waves_count.end_rows(self.structure, *waves_count.assembled(self.structure, columns))
        found: list[Any] = []
        for place in (*range(n, 2 * n), *range(n), *range(2 * n, self.structure.places)):
            found += waves_count.condition(self.structure, k, z, place, *ends)
        return traced.text(found, [("matrix", "ENTRIES", self.structure.places**2)])

    def sections(self) -> str:
        """Return the functions of the matrices of a section, and of the check of their signs."""
        n = self.structure.n
        words = "Return the matrices O' by E and E' by O, times half the length."
        traced = Traced("_matrices_of", words, [("k", "COEFFICIENTS")], ["z"])
        k, z = self._coefficients(traced), traced.number("z")
        first, second = self.structure.matrices
        found = [k[at + i] + z * k[at + n * n + i] for at in (first, second) for i in range(n * n)]
        out = [(name, "PLANE", n * n) for name in ("odd_by_even", "even_by_odd")]
        traced_too = Traced("_indefinite", "Return 1 where stiffness or mass along the length is negative, else 0.",
                            [("k", "COEFFICIENTS")])  # fmt: skip
        k = self._coefficients(traced_too)
        bad: Any = False
        for matrix in (self._compliance(k), self._inertia(k)):
            for value, scale in principal_minors(matrix):
                below = value < (0.0 if scale is None else -1e-14 * scale)
                bad = (below | bad) if isinstance(below, Term) else bad
        return traced.text(found, out) + "\n\n" + traced_too.text([kernel.where(bad, 1.0, 0.0)])

    def _compliance(self, k: Any) -> list[list[Any]]:
        """Return q' by P at z = 0."""
        a, b = self.structure.matrices
        return self._of_parity(k, b, a)

    def _inertia(self, k: Any) -> list[list[Any]]:
        """Return minus the factor of z of P' by q."""
        (a, b), slope = self.structure.matrices, self.structure.n**2
        return [[-entry for entry in row] for row in self._of_parity(k, a + slope, b + slope)]

    def _of_parity(self, k: Any, even: int, odd: int) -> list[list[Any]]:
        """Return a matrix between displacements of one parity, given the start of its entries."""
        n, parity = self.structure.n, self.structure.odd
        return [
            [Exact(0) if parity[i] != parity[j] else k[(odd if parity[i] else even) + n * i + j] for j in range(n)]
            for i in range(n)
        ]

    def dispersion(self) -> tuple[str, list[int]]:
        """Return the function of the dispersion relation, and which coefficients it returns; others are 0."""
        traced = Traced("_dispersion", "Return the coefficients of the dispersion relation, polynomials in z.",
                        [("k", "COEFFICIENTS")])  # fmt: skip
        found = {
            self.places[place]: value
            for place, value in waves_problem.dispersion(self.structure, self._coefficients(traced))
            if not isinstance(value, Exact)
        }
        return traced.text(found.values(), [("table", str(len(found)), len(found))]), list(found)


def _suffix(kind: str) -> str:
    return "" if kind == "any" else f"_{kind}"
