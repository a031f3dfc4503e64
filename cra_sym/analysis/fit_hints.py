"""Hints at why measured frequencies do not fit: one is wrong or of no mode, or one or two modes were missed."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cra_sym.analysis.fit_quality import goodness
from cra_sym.analysis.fit_search import Data, Search

__all__ = ["hints"]

_MOST_TRIALS = 12  # pairs of missed modes: those of the smallest misfit on the grid
_MOST_TOLD = 3


def hints(search: Search, data: Data, name: str, lowest: bool) -> list[str]:
    """Return which changes of the data give a fit: of one frequency or one mode, else of two modes.

    Parameters
    ----------
    search : Search
    data : Data
    name : str
        Name of the argument that holds the frequencies.
    lowest : bool
        Whether no modes were given, so that others can be tried than the lowest.
    """
    number = data.measured.size
    spare = number + sum(unknown.prior is not None for unknown in search.unknowns) - len(search.unknowns)
    found = []
    if spare >= 2:
        wrong = _fitting(search, [data.without(k) for k in range(number)])
        if wrong:
            found.append(f"without {_told([f'mode {data.modes[k] + 1}' for k in wrong])} they fit")
    if spare >= 2 and lowest:
        fewer = np.arange(number - 1)  # the others are the lowest modes
        strange = _fitting(search, [replace(data.without(k), modes=fewer) for k in range(number - 1)])
        if strange:
            texts = [f"{name}[{k}] = {data.measured[k]:.6g} Hz" for k in strange]
            found.append(f"without {_told(texts)} the others fit as the lowest modes")
    if spare >= 1 and lowest:
        found += _missed(search, data, 1)
        if not found:
            found += _missed(search, data, 2)
    return found


def _missed(search: Search, data: Data, missed: int) -> list[str]:
    """Return the sets of modes with gaps that fit."""
    highest = data.measured.size + missed
    if highest > search.system.most_modes:
        return []
    if highest > search.most_modes:
        search = Search(search.system, search.unknowns, highest)
    gaps = itertools.combinations(range(highest - 1), missed)  # below the highest, or fewer were missed
    trials = [replace(data, modes=np.delete(np.arange(highest), gap)) for gap in gaps]
    trials = sorted(trials, key=search.misfit)[: data.measured.size if missed == 1 else _MOST_TRIALS]
    fitting = [str(tuple((trials[k].modes + 1).tolist())) for k in _fitting(search, trials)]
    return [f"with other modes they fit: give modes={_told(fitting)}"] if fitting else []


def _fitting(search: Search, trials: Sequence[Data]) -> list[int]:
    """Return which of several data sets of one size can be fitted."""
    places = search.lowest(trials)
    number = len(search.unknowns)
    return [k for k, data in enumerate(trials) if goodness(search.residuals(places[k], data), number).fits]


def _told(texts: Sequence[str]) -> str:
    """Return alternatives in words, at most three of them."""
    more = [f"{len(texts) - _MOST_TOLD} more"] if len(texts) > _MOST_TOLD else []
    return " or ".join([*texts[:_MOST_TOLD], *more])
