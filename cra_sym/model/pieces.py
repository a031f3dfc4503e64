"""Arguments of a model: conversion to those of Hamilton's principle, and changes to them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from sympy import Expr, S, Symbol, sympify

from cra_sym.mechanics.points import in_points
from cra_sym.model.symmetry import odd_in_time

__all__ = ["arguments", "expressions_in", "options_of", "stuck", "undamped"]

Pieces = dict[str, Any]
Works = tuple[tuple[Expr, Expr, Any], ...]


def arguments(pieces: Pieces) -> Pieces:
    """Return the arguments of Model, with stored pairs turned back into mappings."""
    return pieces | {name: dict(pieces[name]) for name in ("units", "definitions", "quadratures")}


def options_of(pieces: Pieces) -> tuple[Pieces, tuple[tuple[Expr, Expr], ...]]:
    """Return the arguments of Hamilton's principle with definitions substituted, and the interior terms as stated.

    Point loads of the density and of virtual work become terms at interior places, elastic-slip elements springs.
    """
    apart = ("units", "definitions", "small", "hysteresis")
    options = {name: piece for name, piece in pieces.items() if name not in apart}
    options |= stuck(pieces)
    definitions = dict(pieces["definitions"])

    def put(piece: Any) -> Any:
        if isinstance(piece, tuple):
            return tuple(put(part) for part in piece)
        return piece.subs(definitions) if isinstance(piece, Expr) and not isinstance(piece, Symbol) else piece

    if definitions:
        options = {name: put(piece) for name, piece in options.items()}
    density, points = in_points(options["density"], options["x"])
    stated = options["inside"]
    if points:
        options |= {"density": density, "inside": (*stated, *points)}
    options["virtual_work"] = tuple(_works_at_places(options["virtual_work"], options["x"]))
    return options, stated


def expressions_in(options: Pieces) -> list[Expr]:
    """Return the expressions in the arguments of Hamilton's principle, those of the ends left out."""
    work, inside = options["virtual_work"], options["inside"]
    found = [options["density"], *options["domain"], *options["essential"]]
    found += [sympify(place, strict=True) for place, _ in inside] + [term for _, term in inside]
    found += [part for force, displacement, _ in work for part in (force, displacement)]
    return found + [sympify(place, strict=True) for *_, place in work if not (place is None or isinstance(place, str))]


def _works_at_places(works: Works, x: Symbol) -> Iterator[tuple[Expr, Expr, Any]]:
    """Yield virtual works, those of a DiracDelta along the domain as works at its place."""
    for work in works:
        if len(work) != 3 or work[2] != "domain":
            yield work
            continue
        rest, points = in_points(work[0], x, "virtual work")
        if rest != 0 or not points:
            yield rest, work[1], "domain"
        yield from ((part, work[1], place) for place, part in points)


def stuck(pieces: Pieces) -> Pieces:
    """Return the pieces of the Lagrangian with the energy of the stuck elastic-slip elements added."""
    found = {name: pieces[name] for name in ("left", "right", "inside")}
    for element, displacement, place in pieces["hysteresis"]:
        energy = -sympify(element.stiffness, strict=True) * displacement**2 / 2
        if place is None or place in ("left", "right"):
            end = place or "left"
            found[end] = energy if found[end] is None else found[end] + energy
        else:
            found["inside"] = (*found["inside"], (place, energy))
    return found if pieces["hysteresis"] else {}


def undamped(work: Sequence[tuple[Expr, Expr, Any]], t: Symbol) -> Works:
    """Return the virtual work without forces that are odd in time."""

    def is_odd(force: Expr) -> Expr:
        terms = sympify(force, strict=True).expand().as_ordered_terms()
        return sum((term for term in terms if not odd_in_time(term, t)), S.Zero)

    kept = ((is_odd(force), displacement, place) for force, displacement, place in work)
    return tuple(work for work in kept if work[0] != 0)
