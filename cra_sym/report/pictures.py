"""Draw the figures into a folder, each as PNG to look at and SVG to print.

``python -m cra_sym.report.pictures notebooks/images`` redraws the SVG files that lie there.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tqdm import tqdm

from cra_sym.ending import run_command
from cra_sym.figures import ANIMATIONS, FIGURES, animate, draw, shows_an_arm
from cra_sym.files import draft, write_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from cra_sym.arm.parameters import Arm
    from cra_sym.claims import Verdict

__all__ = ["save_animations", "save_claims", "save_figures"]

_COMMAND = "python -m cra_sym.report.pictures"
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
    chosen = [name for name in FIGURES if arm is None or shows_an_arm(name)] if names is None else set(names)
    bar = tqdm(sorted(chosen), unit="figure", disable=None)
    return [path for name in bar for path in _save(draw(name, arm), folder, name, kinds)]


def save_claims(
    folder: Path, verdicts: Iterable[Verdict], kinds: Sequence[str] = ("svg",), ending: str = ""
) -> list[Path]:
    """Draw each verdict from its evidence and return the files made, named by the claims and the ending."""
    return [
        path
        for verdict in tqdm(verdicts, unit="claim", disable=None)
        for path in _save(verdict.draw(), folder, f"{verdict.id}{ending}", kinds)
    ]


def save_animations(folder: Path) -> list[Path]:
    """Write every animation as SVG and return the files made."""
    made = [folder / f"{name}.svg" for name in ANIMATIONS]
    for path in made:
        write_text(path, animate(path.stem))
    return made


def _save(figure: Figure, folder: Path, name: str, kinds: Sequence[str]) -> list[Path]:
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    FigureCanvasAgg(figure)
    made = [folder / f"{name}.{kind}" for kind in kinds]
    with matplotlib.rc_context({"svg.hashsalt": name, "svg.fonttype": "path"}):
        for path, kind in zip(made, kinds, strict=True):
            with draft(path) as place:
                figure.savefig(place, format=kind, **_OPTIONS[kind])
    return made


def _redraw_as_asked() -> None:
    parser = ArgumentParser(_COMMAND, description="Redraw the SVG figures of a folder in place.")
    parser.add_argument("place", metavar="PLACE", type=Path, help="a folder with figures, such as notebooks/images")
    place = parser.parse_args().place
    save_figures(place, [path.stem for path in place.glob("*.svg")], kinds=["svg"])


if __name__ == "__main__":
    sys.exit(run_command(_COMMAND, _redraw_as_asked))
