"""Figures that are redrawn into the same axes, fast enough to follow a slider."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from io import BytesIO
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from cra_sym.figures import styled

if TYPE_CHECKING:
    from matplotlib.artist import Artist

__all__ = ["LiveFigure"]

_LINE = 60  # letters of a line
_FILL = 0.6  # axis limits are kept while the data fill this share of them, so that a change is visible


class LiveFigure:
    """A grid of axes in which a figure function draws; axes, ticks and labels are painted only when they change.

    Parameters
    ----------
    draw : callable
        Called with ``axes=`` and the arguments of :meth:`redraw`: a figure function of this package.
    rows, columns : int
        Of the grid.
    size : pair of float
        Width and height, inches.
    dpi : float
    options
        Passed on to ``Figure.subplots``.
    """

    def __init__(
        self,
        draw: Callable[..., Any],
        rows: int,
        columns: int,
        size: tuple[float, float],
        *,
        dpi: float = 90,
        **options: Any,
    ) -> None:
        self._draw = draw
        self._frame: Any = None
        self._look: list[tuple[Any, ...]] = []
        with styled():
            self.figure = Figure(figsize=size, dpi=dpi, layout="constrained")
            self.canvas = FigureCanvasAgg(self.figure)
            self.axes = self.figure.subplots(rows, columns, squeeze=False, **options).ravel()

    def redraw(self, *given: Any, **more: Any) -> bytes:
        """Draw with these arguments in place of what was there; return the picture as PNG."""
        limits = [(ax.get_xlim(), ax.get_ylim()) for ax in self.axes]
        with styled():
            self._wipe()
            self._draw(*given, axes=self.axes, **more)
            if self._frame is not None:
                self._hold(limits)
            self._paint()
        return self._png()

    def remark(self, words: str) -> bytes:
        """Write words in place of what was there; return the picture as PNG."""
        with styled():
            self._wipe()
            ax = self.axes[0]
            ax.text(0.03, 0.5, fill(words, _LINE), transform=ax.transAxes, fontsize=8, color="0.25", va="center")
            self._paint()
        return self._png()

    def _content(self) -> Iterator[Artist]:
        for ax in self.axes:
            yield from (*ax.collections, *ax.lines, *ax.texts)
            if ax.get_legend():
                yield ax.get_legend()
        yield from self.figure.legends

    def _wipe(self) -> None:
        """Remove what the last drawing left; axes, ticks and labels stay."""
        for artist in list(self._content()):
            artist.remove()
        for ax in self.axes:
            ax.relim()
            ax.autoscale(True)
            ax.set_prop_cycle(None)

    def _hold(self, limits: list[tuple[tuple[float, float], tuple[float, float]]]) -> None:
        """Keep the limits an axis had if what is drawn now still fits and is not lost in them."""
        for ax, (old_x, old_y) in zip(self.axes, limits, strict=True):
            if _fits(ax.get_xlim(), old_x, ax.get_xscale()):
                ax.set_xlim(old_x)
            if _fits(ax.get_ylim(), old_y, ax.get_yscale()):
                ax.set_ylim(old_y)

    def _paint(self) -> None:
        look = [(ax.get_xlim(), ax.get_ylim(), ax.get_xlabel(), ax.get_ylabel(), ax.get_title("left"))
                for ax in self.axes]  # fmt: skip
        content = list(self._content())
        if look != self._look:
            self.figure.set_layout_engine("constrained")  # makes room for ticks and labels as they are now
            self.canvas.draw()
            self.figure.set_layout_engine("none")
            for artist in content:
                artist.set_animated(True)
            self.canvas.draw()
            self._frame, self._look = self.canvas.copy_from_bbox(self.figure.bbox), look
        self.canvas.restore_region(self._frame)
        renderer = self.canvas.get_renderer()
        for artist in sorted(content, key=lambda a: a.zorder):
            artist.draw(renderer)

    def _png(self) -> bytes:
        picture, size = BytesIO(), self.canvas.get_width_height()
        Image.frombuffer("RGBA", size, self.canvas.buffer_rgba()).convert("RGB").save(picture, "PNG", compress_level=1)
        return picture.getvalue()


def _fits(new: tuple[float, float], old: tuple[float, float], scale: str) -> bool:
    (low, high), (floor, ceiling) = (np.log(pair) if scale == "log" else pair for pair in (new, old))
    return floor <= low and high <= ceiling and high - low > _FILL * (ceiling - floor)
