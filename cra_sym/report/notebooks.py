"""Execution of notebooks, with outputs that are independent of the machine.

``python -m cra_sym.report.notebooks notebooks`` re-executes every notebook of a folder (or the files named) in place.
"""

from __future__ import annotations

import asyncio
import os
import sys
from argparse import ArgumentParser
from base64 import b64decode, b64encode
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor, as_completed
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Any

from tqdm import tqdm

from cra_sym.ending import run_command
from cra_sym.files import write_text

if TYPE_CHECKING:
    from nbformat import NotebookNode

__all__ = ["NotebookError", "execute", "find_notebooks", "refresh"]

_COMMAND = "python -m cra_sym.report.notebooks"
_KERNEL = {"display_name": "Python 3 (ipykernel)", "language": "python", "name": "python3"}


class NotebookError(RuntimeError):
    """A notebook that failed; the message names it and shows the failing cell."""

    exit_code = 1


def find_notebooks(folder: str | Path | None = None) -> list[Path]:
    """Return the notebooks in reading order, by default those of the source checkout.

    Raises
    ------
    FileNotFoundError
        If the folder holds none.
    """
    folder = Path(__file__).resolve().parents[2] / "notebooks" if folder is None else Path(folder)
    found = sorted(folder.glob("*.ipynb"))
    if not found:
        raise FileNotFoundError(f"notebooks = {str(folder)!r}: holds no notebook; give the folder of a source checkout")
    return found


def _normalise(notebook: NotebookNode) -> None:
    """Keep kernel name and language; drop times, versions and widths."""
    notebook.metadata = {"kernelspec": _KERNEL, "language_info": {"name": "python"}}
    for number, cell in enumerate(notebook.cells, 1):
        cell.id = f"cell-{number:02d}"
        tags = cell.metadata.get("tags")
        cell.metadata = {"tags": tags} if tags else {}
        if tags and "solution" in tags:
            cell.metadata["jupyter"] = {"source_hidden": True, "outputs_hidden": True}
        for output in cell.get("outputs", []):
            if "metadata" in output:
                output.metadata = {}
            output.get("data", {}).pop("application/vnd.jupyter.widget-view+json", None)  # useless without its kernel
            if "image/png" in output.get("data", {}):
                output.data["image/png"] = _indexed(output.data["image/png"])


def _indexed(picture: str) -> str:
    """Return a base64 PNG with a palette, which takes a third of the size, since plots have few colours."""
    from PIL import Image

    full, small = Image.open(BytesIO(b64decode(picture))).convert("RGB"), BytesIO()
    full.quantize(128, dither=Image.Dither.NONE).save(small, "PNG", optimize=True)
    return b64encode(small.getvalue()).decode("ascii")


_SVG_TOO = """
def show_figures_as_svg_too(*_):
    from functools import partial
    from IPython.core.pylabtools import print_figure
    svg = get_ipython().display_formatter.formatters["image/svg+xml"]
    svg.for_type_by_name("matplotlib.figure", "Figure", partial(print_figure, fmt="svg", metadata={"Date": None}))
get_ipython().events.register("pre_run_cell", show_figures_as_svg_too)
"""


def execute(
    path: str | Path,
    advance: Callable[[], Any] | None = None,
    timeout: int = 600,
    *,
    svg: bool = False,
    begun: Callable[[Callable[[], Any]], Any] | None = None,
) -> NotebookNode:
    """Execute one notebook in a fresh kernel of this Python, in its own folder, and return it with its outputs.

    Parameters
    ----------
    path : path
        The notebook; the file itself is left as it is.
    advance : callable, optional
        Called after each code cell; what it raises ends the run.
    timeout : int
        Seconds allowed for one cell, and for the kernel to start.
    svg : bool
        Whether figures shown by value are also kept as SVG, whatever formats the notebook itself asks for.
    begun : callable, optional
        Called at the start with a function that stops the run, cell and kernel, from any thread.

    Raises
    ------
    NotebookError
        If a cell raises or takes too long.
    concurrent.futures.CancelledError
        If the run was ended.
    """
    import nbformat
    from jupyter_client import AsyncKernelManager
    from jupyter_client.kernelspec import KernelSpecManager
    from nbclient import NotebookClient
    from nbclient.exceptions import CellExecutionError, CellTimeoutError, DeadKernelError
    from nbconvert.filters import strip_ansi

    path = Path(path)
    notebook: NotebookNode = nbformat.read(path, as_version=4)
    # No kernel directories: of the kernels called python3, only that of the running Python is meant.
    manager = AsyncKernelManager(kernel_name="python3", kernel_spec_manager=KernelSpecManager(kernel_dirs=[]))
    client: Any = NotebookClient(
        notebook,
        km=manager,
        timeout=timeout,
        startup_timeout=timeout,  # a busy machine may need more than the minute it gets by default
        extra_arguments=["--log-level=40"],  # errors of the kernel, not its hints
        record_timing=False,
        coalesce_streams=True,
        resources={"metadata": {"path": str(path.parent)}},
        on_notebook_start=lambda **_: client.kc.execute(_SVG_TOO, silent=True, store_history=False) if svg else None,
        on_cell_executed=lambda **_: advance() if advance is not None else None,
    )
    ended = Event()

    async def run() -> None:
        loop, task = asyncio.get_running_loop(), asyncio.current_task()

        def end() -> None:
            ended.set()
            client.shutdown_kernel = "immediate"  # while it starts, an interrupt would show a traceback
            loop.call_soon_threadsafe(task.cancel)  # type: ignore[union-attr]

        if begun is not None:
            begun(end)
        try:
            await client.async_execute(cleanup_kc=True)  # it shuts down only kernels of its own managers by default
        finally:
            if manager.has_kernel:  # the run was ended while its kernel started
                await manager.shutdown_kernel(now=True)

    try:
        asyncio.run(run())
    except (asyncio.CancelledError, CellExecutionError, CellTimeoutError, DeadKernelError) as error:
        if ended.is_set():
            raise CancelledError from None
        raise NotebookError(f"{path.name} did not run: {strip_ansi(str(error))}") from None
    _normalise(notebook)
    return notebook


def cells_to_run(paths: Iterable[Path]) -> int:
    """Count the code cells of some notebooks: the length of a progress bar over them."""
    import nbformat

    return sum(
        cell.cell_type == "code" and bool(cell.source.strip())
        for path in paths
        for cell in nbformat.read(path, as_version=4).cells
    )


def refresh(paths: Sequence[Path], *, svg: bool = False) -> None:
    """Execute notebooks, as many at once as there are processors, and store their outputs in place.

    A failing notebook keeps its file, and no further one is started. ``svg`` is that of :func:`execute`.
    """
    import nbformat

    running: list[Callable[[], Any]] = []
    stopped = Event()

    def started(end: Callable[[], Any]) -> None:
        running.append(end)
        if stopped.is_set():  # it was taken from the queue before that was emptied
            end()

    with (
        tqdm(total=cells_to_run(paths), unit="cell", disable=None) as progress,
        ThreadPoolExecutor(max_workers=min(len(paths), os.cpu_count() or 1)) as pool,
    ):

        def run(path: Path) -> NotebookNode:
            _print_chapter(progress, path.stem)
            return execute(path, progress.update, svg=svg, begun=started)

        jobs = {pool.submit(run, path): path for path in paths}
        try:
            for finished in as_completed(jobs):
                write_text(jobs[finished], nbformat.writes(finished.result()) + "\n")
        except BaseException:  # an interrupt too
            pool.shutdown(wait=False, cancel_futures=True)
            stopped.set()
            for end in list(running):
                with suppress(RuntimeError):  # its event loop is closed, so it has finished
                    end()
            raise


def _print_chapter(progress: tqdm[Any], chapter: str) -> None:
    """Print the name of the last chapter started, before the progress bar or in a line of its own."""
    progress.set_description(chapter)
    if progress.disable:
        print(chapter, file=sys.stderr, flush=True)


def _refresh_as_asked() -> None:
    parser = ArgumentParser(_COMMAND, description="Re-execute notebooks and store what they show in place.")
    parser.add_argument("places", metavar="PLACE", type=Path, nargs="+", help="a notebook, or a folder of notebooks")
    given = parser.parse_args().places
    refresh([path for place in given for path in (find_notebooks(place) if place.is_dir() else [place])])


if __name__ == "__main__":
    sys.exit(run_command(_COMMAND, _refresh_as_asked))
