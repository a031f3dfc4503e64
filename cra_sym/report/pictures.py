"""Draw the figures into a folder, each as PNG to look at and SVG to print."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from tqdm import tqdm

from cra_sym.figures import FIGURES, draw

__all__ = ["save_figures"]


def save_figures(folder: Path, names: Iterable[str] | None = None) -> list[Path]:
    """Draw the named figures, by default all, and return the files made.

    The files depend on the figures alone: no date, and SVG identifiers that are the same in each run.
    """
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    folder.mkdir(parents=True, exist_ok=True)
    made = []
    for name in tqdm(sorted(FIGURES if names is None else set(names)), unit="figure", disable=None):
        figure = draw(name)
        FigureCanvasAgg(figure)
        with matplotlib.rc_context({"svg.hashsalt": name, "svg.fonttype": "path"}):
            for kind, options in (("png", {"dpi": 200}), ("svg", {"metadata": {"Date": None}})):
                made.append(folder / f"{name}.{kind}")
                figure.savefig(made[-1], format=kind, **options)
    return made
