"""The rows in which exported functions keep coefficients, waves and columns of a uniform problem, and their lengths."""

from __future__ import annotations

from collections.abc import Sequence

from cra_sym.cached import cached_property
from cra_sym.codegen.waves_quantities import LENGTHS
from cra_sym.solvers.waves import Structure

__all__ = ["WavesLayout"]

_KINDS = {1: ("any",), 2: ("near", "close", "distant"), 3: ("near", "close", "distant", "series")}


class WavesLayout:
    """Rows of the functions of one structure.

    Parameters
    ----------
    structure : Structure
    known : sequence of (0, 1 or None)
        Coefficients that are the same for all parameters.
    """

    def __init__(self, structure: Structure, known: Sequence[int | None]) -> None:
        self.structure, self.known = structure, tuple(known)

    @cached_property
    def places(self) -> dict[int, int]:
        """Positions of the unknown coefficients in the row of coefficients, by their number."""
        varying = [place for place, value in enumerate(self.known) if value is None]
        return {place: at for at, place in enumerate(varying)}

    @property
    def kinds(self) -> tuple[str, ...]:
        """Regimes of the largest block."""
        return _KINDS[max(self.structure.sizes)]

    @cached_property
    def offsets(self) -> list[int]:
        """Start of the columns of each block in the row of all columns, and their number."""
        found = [0]
        for size in self.structure.sizes:
            found.append(found[-1] + 4 * size * size)
        return found

    @cached_property
    def scaled(self) -> list[int | None]:
        """Position of the basis of each block after the columns; None if it is 1."""
        place = iter(range(self.offsets[-1], self.offsets[-1] + len(self.structure.sizes)))
        return [next(place) if size > 1 else None for size in self.structure.sizes]

    @property
    def wave_numbers(self) -> int:
        """Length of the row of wave numbers."""
        return sum(LENGTHS[size] for size in self.structure.sizes)

    @property
    def section(self) -> int:
        """Length of the row of columns and bases."""
        return self.offsets[-1] + sum(size > 1 for size in self.structure.sizes)

    def constants(self) -> str:
        """Return the sizes as constants."""
        n = self.structure.n
        blocks = zip(self.structure.blocks, self.structure.sizes, self.offsets, strict=False)
        rows = [(start, size, offset) for (start, _), size, offset in blocks]
        sizes = {
            "DISPLACEMENTS": (n, "of a section"),
            "COLUMNS": (2 * n, "waves there and back, or a state: displacements and forces"),
            "MOVING": (self.structure.moving, "displacements of both ends, then lumped coordinates"),
            "UNKNOWNS": (self.structure.places, "waves, lumped coordinates, forces of links"),
            "ENTRIES": (self.structure.places**2, "entries of a matrix of that size"),
            "PLANE": (n * n, "entries of a matrix of a section"),
            "COEFFICIENTS": (len(self.places), "of the matrices of a section, of end conditions and dispersion"),
            "SECTION": (self.section, "entries of the columns at a place"),
            "WAVE_ENTRIES": (self.wave_numbers, "squared wave numbers and what follows from them"),
            "BLOCKS": (len(rows), "groups of displacements that are coupled along the length"),
        }
        lines = [f"{name} = {value}  # {words}" for name, (value, words) in sizes.items()]
        words = (
            ("GROUP_FIRST", "displacement of each group"),
            ("GROUP_SIZE", "of each group"),
            ("GROUP_COLUMNS", "of its columns"),
        )
        for at, (name, comment) in enumerate(words):
            lines.append(f"{name} = ({', '.join(str(row[at]) for row in rows)},)  # {comment}")
        signs = ", ".join("-1.0" if odd else "1.0" for odd in self.structure.odd)
        lines.append(f"PARITY = ({signs},)  # of each displacement under reflection")
        return "\n".join(lines) + "\n"
