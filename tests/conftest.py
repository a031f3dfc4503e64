"""Settings shared by every test; read before NumPy is imported, so the libraries' thread pools see them."""

import gc
import os
import random
import shutil
import sys
from collections import defaultdict

import pytest

for pool in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(pool, "1")  # the test workers share the cores already; a pool each only gets in the way
os.environ.setdefault("MPLBACKEND", "agg")
gc.set_threshold(20_000, 10, 5)  # expressions and figures are many small objects, most of which fall to their counts

_QUIET = (
    "--disable-gpu",
    "--disable-quic",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
)


def pytest_addoption(parser):
    parser.addoption("--all-cases", action="store_true", help="run every case of the tests marked as samples")


def pytest_collection_modifyitems(config, items):
    """Of a test marked ``sample(count, seed)`` keep so many cases, drawn by the seed; ``make campaign`` runs all."""
    cases = defaultdict(list)
    for item in items:
        if (mark := item.get_closest_marker("sample")) and not config.getoption("--all-cases"):
            cases[item.nodeid.partition("[")[0], *mark.args].append(item)
    left = {
        item
        for (_, count, seed), drawn in cases.items()
        for item in random.Random(seed).sample(drawn, max(0, len(drawn) - count))
    }
    config.hook.pytest_deselected(items=[item for item in items if item in left])
    items[:] = [item for item in items if item not in left]


def pytest_collection_finish():
    """Leave what was collected out of every search for unreachable objects."""
    gc.freeze()


def pytest_sessionfinish(session):
    """Store what a worker covered while there is time: it is ended ten seconds after its last test."""
    coverage = sys.modules.get("coverage")
    if hasattr(session.config, "workerinput") and coverage and (running := coverage.Coverage.current()):
        running.save()


@pytest.fixture(autouse=True)
def precision_is_left_alone():
    """Fail a test that leaves mpmath at another precision: what runs after it would be slow, or not be as exact."""
    yield
    mpmath = sys.modules.get("mpmath")
    if mpmath is not None and mpmath.mp.prec != 53:
        mpmath.mp.prec = 53
        pytest.fail("mpmath: the working precision must be 53 bits after a test, as before it")


@pytest.fixture(scope="module")
def browser():
    """The system's Chromium, headless, driven by Playwright; tests that use it are marked ``browser``."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="needs Playwright: pip install playwright")
    found = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if found is None:
        pytest.skip("needs a browser: install Chromium, on Debian with apt install chromium")
    with sync_api.sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=found, args=list(_QUIET), timeout=60_000)
        yield chromium
        chromium.close()
