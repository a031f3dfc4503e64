"""What a long refinement tells: a progress bar on a terminal, nothing elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from tqdm.auto import tqdm

__all__ = ["Told", "refinement"]

Told = Callable[[float, str], None]
"""Takes the relative error reached and what it was reached with."""


@contextmanager
def refinement() -> Iterator[Told]:
    """Yield what is to be called after each refinement along x."""
    bars: list[tqdm] = []

    def told(error: float, mesh: str) -> None:
        if not bars:
            bars.append(tqdm(desc="refining along x", unit="mesh", disable=None, leave=False))
        bars[0].set_postfix_str(f"{mesh}, relative error {error:.1g}", refresh=True)
        bars[0].update()

    try:
        yield told
    finally:
        for bar in bars:
            bar.close()
