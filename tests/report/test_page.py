"""The report: one page that is whole, asks the network for nothing, and can be read by everybody."""

import re
import shutil
import subprocess
from collections import Counter
from html.parser import HTMLParser
from itertools import pairwise

import pytest

import cra_sym as cra
from cra_sym.arm.equations import Equation
from cra_sym.figures import FIGURES
from cra_sym.report.notebooks import find_notebooks
from cra_sym.report.page import write_page
from cra_sym.report.pictures import save_figures

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


class Page(HTMLParser):
    """Tags with their attributes, in order, and the text."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.text = [], ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data):
        self.text += data

    def all(self, tag, attribute):
        return [attributes.get(attribute) for name, attributes in self.tags if name == tag]


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """The page made from the stored notebooks; the equations' checks have tests of their own."""
    folder = tmp_path_factory.mktemp("a report")
    shutil.copytree(find_notebooks()[0].parent, folder / "notebooks")
    save_figures(folder / "figures", kinds=["svg"])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Equation, "check", lambda self: self.number != 7)
        return write_page(folder)


@pytest.fixture(scope="module")
def page(path):
    return Page(path.read_text(encoding="utf-8"))


def test_nothing_is_fetched(page):
    sources = [a[k] for _, a in page.tags for k in ("src", "srcset", "data", "action") if k in a]
    assert sources and all(source.startswith("data:image/") for source in sources)
    assert not {"script", "link", "iframe", "object", "base"} & {tag for tag, _ in page.tags}
    assert "@import" not in page.text and "url(" not in page.text


def test_links_lead_somewhere(page):
    identifiers = [a["id"] for _, a in page.tags if "id" in a]
    assert [name for name, times in Counter(identifiers).items() if times > 1] == []
    inner = [href[1:] for href in page.all("a", "href") if href.startswith("#")]
    assert set(inner) <= set(identifiers)


def test_every_chapter_equation_and_figure_is_there(page):
    identifiers = {a["id"] for _, a in page.tags if "id" in a}
    assert {f"eq-{e.number}" for e in cra.equations(companions=True)} <= identifiers
    assert {path.stem.replace("_", "-") for path in find_notebooks()} <= identifiers
    assert {name.replace("_", "-") for name in FIGURES} <= identifiers


def test_an_equation_leads_to_its_sources(path):
    article = re.search(r'<article id="eq-16".*?</article>', path.read_text(encoding="utf-8"), re.S)[0]
    rests_on = article.partition("rests on")[2].partition("</dd>")[0]
    assert re.findall(r'href="#eq-(\w+)"', rests_on) == [str(n) for n in cra.equation(16).derived_from]


def test_a_failed_check_is_not_hidden(path):
    text = path.read_text(encoding="utf-8")
    assert text.count("NOT confirmed by") == 1
    assert "NOT confirmed" in re.search(r'<article id="eq-7".*?</article>', text, re.S)[0]


def test_pictures_have_words_and_headings_have_order(page):
    assert all(page.all("img", "alt"))
    assert page.all("html", "lang") == ["en"]
    levels = [int(tag[1]) for tag, _ in page.tags if re.fullmatch(r"h[1-6]", tag)]
    assert levels.count(1) == 1 and levels[0] == 1
    assert all(after - before <= 1 for before, after in pairwise(levels))


@pytest.mark.browser
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium")
@pytest.mark.parametrize("width", [390, 1400])
def test_in_a_browser(path, tmp_path, width):
    """Everything has a size, nothing sticks out sideways, and the page tries to load nothing."""
    probe = """<script>addEventListener("load", () => {
      const bare = [...document.querySelectorAll("math, figure img, .output img")].filter(e => {
        const box = e.getBoundingClientRect(); return box.width < 2 || box.height < 2; });
      const inner = [...document.querySelectorAll('a[href^="#"]')];
      const dead = inner.filter(a => !document.getElementById(a.hash.slice(1)));
      const out = document.documentElement.scrollWidth - innerWidth;
      const loaded = performance.getEntriesByType("resource").filter(r => !r.name.startsWith("data:"));
      document.title = ["probe", innerWidth, bare.length, dead.length, Math.max(0, out), loaded.length].join(" ");
    });</script></body>"""
    text = path.read_text(encoding="utf-8").replace("style-src", "script-src 'unsafe-inline'; style-src")
    probed = tmp_path / "probed.html"
    probed.write_text(text.replace("</body>", probe), encoding="utf-8")
    quiet = ["--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync"]
    view = [f"--window-size={width},900", f"--user-data-dir={tmp_path / 'profile'}", "--dump-dom"]
    command = [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", *quiet, *view, probed.as_uri()]
    dom = subprocess.run(command, capture_output=True, text=True, timeout=240).stdout
    title = re.search(r"<title>(.*?)</title>", dom)[1]
    found = title.split()
    assert found[0] == "probe", title
    assert found[2:] == ["0", "0", "0", "0"], f"without size, dead links, pixels outside, requests: {title}"
