"""Draw the figures into a folder, each as PNG to look at and SVG to print.

``python -m cra_sym.report.pictures notebooks/images`` redraws the SVG files that lie there.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tqdm import tqdm

from cra_sym.figures import FIGURES, draw, shows_an_arm

if TYPE_CHECKING:
    from cra_sym.arm.parameters import Arm

__all__ = ["save_figures"]

_OPTIONS: dict[str, dict[str, Any]] = {"png": {"dpi": 200}, "svg": {"metadata": {"Date": None}}}


def save_figures(
    folder: Path,
    names: Iterable[str] | None = None,
    kinds: Sequence[str] = ("png", "svg"),
    *,
    arm: Arm | None = None,
) -> list[Path]:
    """Draw the named figures, by default all, of the arm given or of the paper's; return the files made.

    The files depend on the figures alone: no date, and SVG identifiers that are the same in each run.
    """
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    folder.mkdir(parents=True, exist_ok=True)
    made = []
    chosen = [name for name in FIGURES if arm is None or shows_an_arm(name)] if names is None else set(names)
    for name in tqdm(sorted(chosen), unit="figure", disable=None):
        figure = draw(name, arm)
        FigureCanvasAgg(figure)
        with matplotlib.rc_context({"svg.hashsalt": name, "svg.fonttype": "path"}):
            for kind in kinds:
                made.append(folder / f"{name}.{kind}")
                figure.savefig(made[-1], format=kind, **_OPTIONS[kind])
    return made


if __name__ == "__main__":
    place = Path(sys.argv[1])
    save_figures(place, [path.stem for path in place.glob("*.svg")], kinds=["svg"])
