"""Progress bar of a long refinement along x; shown on a terminal only."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from tqdm.auto import tqdm

__all__ = ["Progress", "refinement"]

Progress = Callable[[float, str], None]
"""Callback that takes the relative error reached and a description of the mesh."""


@contextmanager
def refinement() -> Iterator[Progress]:
    """Yield a callback to be called after each refinement along x."""
    bars: list[tqdm] = []

    def report(error: float, mesh: str) -> None:
        if not bars:
            bars.append(tqdm(desc="refining along x", unit="mesh", disable=None, leave=False))
        bars[0].set_postfix_str(f"{mesh}, relative error {error:.1g}", refresh=True)
        bars[0].update()

    try:
        yield report
    finally:
        for bar in bars:
            bar.close()
