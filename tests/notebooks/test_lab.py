"""The notebooks in JupyterLab, as a reader meets them: opened by the command of ``make lab``, run, and looked at."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import socket
import subprocess
import sys
import time
from pathlib import Path
from urllib.parse import urlsplit

import pytest

playwright = pytest.importorskip("playwright.sync_api", reason="needs the extra test: playwright")
ROOT = Path(__file__).resolve().parents[2]
PATIENCE = 300_000  # ms; a limit for hanging, on any machine
# Cells outside the window are not rendered by default; here all are looked at.
SETTINGS = {"@jupyterlab/notebook-extension/tracker": {"windowingMode": "none"}}
QUIET = ("--no-browser", "--allow-root")
DONE = """(count) => {
    const shown = '.jp-CodeCell .jp-InputPrompt:not(.jp-Placeholder-prompt)';
    const prompts = [...document.querySelectorAll(shown)].map(p => p.textContent.trim());
    return prompts.length === count && prompts.every(text => /^\\[\\d+\\]:?$/.test(text));
}"""
FRAMED = "() => [...document.querySelectorAll('.jp-RenderedImage img')].every(i => i.complete && i.naturalWidth > 200)"
SHOWN = """() => ({
    errors: [...document.querySelectorAll('[data-mime-type$="jupyter.error"], [data-mime-type$="jupyter.stderr"]')]
        .map(e => e.textContent.slice(0, 500)),
    pictures: document.querySelectorAll('.jp-RenderedImage img').length,
    maths: document.querySelectorAll('.jp-RenderedMarkdown mjx-container').length,
    outputs: document.querySelectorAll('.jp-OutputArea mjx-container').length,
    broken: document.querySelectorAll('mjx-merror, [data-mjx-error]').length,
})"""


def lab_command():
    """What ``make lab`` runs, as arguments of this Python."""
    recipe = re.search(r"^lab:.*\n\t\$\(RUN\) (.+)$", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M)
    assert recipe, "the Makefile has no recipe lab"
    return [sys.executable, *shlex.split(recipe[1])]


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture(scope="module")
def lab(browser, tmp_path_factory):
    """A JupyterLab over a copy of the notebooks, with no settings but its own; yields the address it opens."""
    pytest.importorskip("jupyterlab", reason="needs the extra notebooks: jupyterlab")
    home = tmp_path_factory.mktemp("lab")
    shutil.copytree(ROOT / "notebooks", home / "notebooks", ignore=shutil.ignore_patterns(".*"))
    for name, settings in SETTINGS.items():
        file = home / "settings" / f"{name}.jupyterlab-settings"
        file.parent.mkdir(parents=True)
        file.write_text(json.dumps(settings), encoding="utf-8")
    folders = {"JUPYTER_CONFIG_DIR": "config", "JUPYTER_RUNTIME_DIR": "runtime", "JUPYTER_DATA_DIR": "data",
               "JUPYTERLAB_SETTINGS_DIR": "settings", "JUPYTERLAB_WORKSPACES_DIR": "workspaces",
               "IPYTHONDIR": "ipython"}  # fmt: skip
    places = {variable: str(home / name) for variable, name in folders.items()}
    path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
    environment = {name: value for name, value in os.environ.items() if name != "MPLBACKEND"}
    with open(home / "log", "w") as log:
        server = subprocess.Popen(
            [*lab_command(), *QUIET, f"--port={free_port()}"],
            cwd=home, env=environment | places | {"PYTHONPATH": path}, stdout=log, stderr=subprocess.STDOUT,
        )  # fmt: skip
        try:
            yield opened(server, home)
        finally:
            server.terminate()
            server.wait(60)


def opened(server, home):
    """Return the address in the page that the server writes for the browser it opens."""
    until = time.monotonic() + PATIENCE / 1000
    while time.monotonic() < until and server.poll() is None:
        for page in (home / "runtime").glob("jpserver-file-to-run-*-open.html"):
            address = re.search(r'url=(http[^"]+)"', page.read_text(encoding="utf-8"))
            if address:
                return address[1]
        time.sleep(0.1)
    raise AssertionError((home / "log").read_text())


@pytest.fixture
def page(browser, lab):
    """A window on the server, and the requests it made elsewhere."""
    context = browser.new_context(viewport={"width": 1400, "height": 1000})
    context.set_default_timeout(PATIENCE / 4)
    page, page.elsewhere = context.new_page(), []
    page.on("request", lambda request: abroad(request.url, lab) and page.elsewhere.append(request.url))
    yield page
    keep(page, "last")
    context.close()


def abroad(url, lab):
    return urlsplit(url).scheme in ("http", "https", "ws", "wss") and urlsplit(url).netloc != urlsplit(lab).netloc


def run_all(page, address, name):
    """Open a notebook, clear it, run it by the menu, and return what it shows at the end."""
    stored = json.loads((ROOT / "notebooks" / name).read_text(encoding="utf-8"))["cells"]
    code = [cell for cell in stored if cell["cell_type"] == "code"]
    folded = sum(cell["metadata"].get("jupyter", {}).get("source_hidden", False) for cell in code)
    address = address.replace("00_overview.ipynb", name) + "&reset"  # without the tabs of the test before
    try:
        clear_and_run(page, address, len(code), folded)
    except playwright.TimeoutError:  # a command given while the kernel connects can get lost: again, as a reader would
        clear_and_run(page, address, len(code), folded)
    page.wait_for_function(FRAMED)
    page.wait_for_function("() => document.querySelectorAll('mjx-container').length > 0")
    return page.evaluate(SHOWN), sum("image/png" in o.get("data", {}) for cell in code for o in cell["outputs"])


def clear_and_run(page, address, cells, folded):
    """Clear a notebook and run it until all cells have their number; folded ones show none."""
    page.goto(address)
    page.wait_for_function("count => document.querySelectorAll('.jp-CodeCell').length === count", arg=cells)
    menu(page, "Edit", "Clear Outputs of All Cells")
    page.wait_for_function("() => !document.querySelector('.jp-RenderedImage')")
    page.get_by_text("Python 3 (ipykernel) | Idle").wait_for()
    menu(page, "Run", "Run All Cells")
    page.wait_for_function(DONE, arg=cells - folded, timeout=PATIENCE / 2)


def menu(page, title, entry):
    page.locator(".lm-MenuBar-item", has_text=re.compile(f"^{title}$")).click()
    page.locator(".lm-Menu-item", has_text=re.compile(f"^{re.escape(entry)}")).first.click()


def keep(page, name):
    """Leave a picture of the page where ``SCREENSHOTS`` says, for people to look at."""
    if folder := os.environ.get("SCREENSHOTS"):
        page.screenshot(path=Path(folder) / f"{name}.png")


@pytest.mark.browser
def test_the_overview_opens_and_runs(page, lab):
    assert urlsplit(lab).path == "/lab/tree/00_overview.ipynb"
    shown, pictures = run_all(page, lab, "00_overview.ipynb")
    keep(page, "overview")
    assert (shown["errors"], shown["broken"], page.elsewhere) == ([], 0, [])
    assert shown["pictures"] == pictures > 0
    assert shown["maths"] > 0 and shown["outputs"] > 0


@pytest.mark.browser
def test_a_chapter_runs(page, lab):
    shown, pictures = run_all(page, lab, "03_joint.ipynb")
    keep(page, "chapter_3")
    assert (shown["errors"], shown["broken"], page.elsewhere) == ([], 0, [])
    assert shown["pictures"] == pictures > 0
    assert shown["maths"] > 0 and shown["outputs"] > 0


@pytest.mark.browser
def test_a_slider_moves_the_pictures(page, lab):
    pytest.importorskip("ipywidgets", reason="needs the extra explore: ipywidgets")
    shown, _ = run_all(page, lab, "12_explore.ipynb")
    assert (shown["errors"], page.elsewhere) == ([], [])
    panel = page.locator(".jp-OutputArea-output .widget-vbox").first
    pictures = panel.locator("img.widget-image")
    assert (panel.locator(".noUi-handle").count(), pictures.count()) == (15, 3)
    before = [picture.get_attribute("src") for picture in pictures.all()]
    panel.locator(".noUi-handle").first.press("ArrowLeft")
    page.wait_for_function(
        "([old]) => document.querySelector('.widget-vbox img.widget-image').src !== old", arg=[before[0]]
    )
    panel.locator("mjx-container").first.wait_for()  # the labels are typeset
    keep(page, "explore")
