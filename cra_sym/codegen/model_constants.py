"""Constants at the head of an exported model: its sizes, and limits that depend on the precision."""

from __future__ import annotations

import math
from collections.abc import Sequence

from cra_sym.model.waves_form import WavesForm
from cra_sym.solvers import waves_modes

__all__ = ["model_constants"]

_NUMBERS = {  # in double precision, in single precision
    "HUGE": (1.7976931348623157e308, 2.9e38, "values above it count as infinite"),
    "EPS": (2.0**-52, 2.0**-23, "relative rounding error"),
    "TINY": (1e-300, 1e-37, "values below it count as zero"),
    "DEPENDENT": (1e-14, 1e-6, "largest entry that rounding leaves of a dependent row of unit size"),
    "SLIGHT": (1e-12, 1e-4, "a small distance from 1"),
    "TWO_SMALL": (1e-140, 1e-16, "share of the lowest z of free waves below which two zeros cannot be told apart"),
    "THREE_SMALL": (1e-95, 1e-11, "the same for three zeros"),
    "SAME": (1e-9, 1e-4, "relative distance below which squared frequencies are taken as equal"),
    "NODE": (1e-7, 1e-3, "share of the largest displacement below which a place is a node"),
    "SMALL": (waves_modes.SMALL_SHARE, 1e-2, "share of the largest condition below which a column may be rounding"),
    "ROUNDING": (waves_modes.ROUNDING, 2.0**-19, "relative rounding error of some operations"),
    "ROOT_ERROR": (waves_modes.ROOT_ERROR, 2.0**-15, "relative error of a root of three waves"),
    "BESIDE": (1e-12, 1e-5, "share of the largest displacement below which the place beside a node has no sign"),
}
_PLACES = (-1.0, -0.56, 0.06, 0.62, 1.0 - 2e-4, 1.0)
"""Stations at which the size of a motion is measured, in half lengths from mid-span."""


def model_constants(
    form: WavesForm,
    parameters: int,
    fields: Sequence[str],
    loads: tuple[Sequence[str], Sequence[str]],
    coordinates: Sequence[str],
    field_places: Sequence[int],
    real: str,
) -> str:
    """Return the constants of a model as a text in the restricted form, given names and places of its fields.

    ``loads`` are its prescribed motions and its forces.
    """
    drives, forces = loads
    structure = form.structure
    n, m, links, moving = structure.n, structure.coordinates, structure.links, structure.moving
    ranks = ((n * n + moving + links) * (n + m), (2 * moving + links) * m, (links + 1) * moving if links else 0)
    integers = {
        "PARAMETER_COUNT": (parameters, "parameters of the model"),
        "FIELDS": (len(fields), f"fields of the model: {', '.join(fields)}"),
        "ENDS": (moving**2, "entries of the stiffness matrix of ends and coordinates"),
        "END_RATES": (3 * moving**2 + links * (2 + moving), "rates of stiffness, mass, ties and links"),
        "MOTIONS": (n + m, "independent motions without strain"),
        "RESTRAINTS": (moving + links, "conditions of ends, coordinates and links"),
        "RESTING": (max(ranks), "entries of the largest matrix whose rank is found"),
        "MULTIPLICITY": (moving if structure.linked else n, "frequencies that may be equal"),
        "STATIONS": (len(_PLACES), "places where the size of a motion is measured"),
    }
    if drives:
        integers["DRIVES"] = (len(drives), f"prescribed motions: {', '.join(drives)}")
    if forces:
        integers["ACTING_FORCES"] = (len(forces), f"forces: {', '.join(forces)}")
        integers["FIRST_FORCE"] = (len(drives), "place of the first of these among all loads")
    if drives or forces:
        integers["LOADS"] = (3 * n + m, "factors of a load")
    if m:
        integers["COORDINATES"] = (m, f"lumped: {', '.join(coordinates)}")
        integers["CARRIED"] = (n * m, "displacements by coordinates")
    if links:
        integers["LINKS"] = (links, "springs and masses on combinations of what moves")
        integers["STRETCHES"] = (links * moving, "displacements of links by what moves")
    lines = [f"PI = {math.pi!r}  # half a turn"]
    for name, (double, single, words) in _NUMBERS.items():
        lines.append(f"{name} = {single if real == 'float32' else double!r}  # {words}")
    lines += [f"{name} = {value}  # {words}" for name, (value, words) in integers.items()]
    lines += [f"PLACES = {_PLACES!r}  # of these, in half lengths from mid-span"]
    lines += [f"FIELD_PLACES = ({', '.join(map(str, field_places))},)  # displacement of a section that each field is"]
    return "\n".join(lines) + "\n"
