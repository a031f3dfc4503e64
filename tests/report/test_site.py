"""The site: it is whole, asks the network for nothing, and can be read and searched by everybody, from a folder."""

import json
import py_compile
import re
import shutil
import subprocess
import sys
from collections import Counter
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

import cra_sym as cra
from cra_sym.claims import claim
from cra_sym.claims.slipping import slipping_claim
from cra_sym.extras import MissingExtraError
from cra_sym.figures import ANIMATIONS
from cra_sym.paper.equations import Equation
from cra_sym.report import run
from cra_sym.report.notebooks import find_notebooks
from cra_sym.report.pictures import save_animations, save_claims, save_figures
from cra_sym.report.site import build
from cra_sym.report.site.build import write_site
from cra_sym.report.site.reference import results

JUDGED = ("C03", "C07", "C20", "C22")  # each fares differently
SLIPPING = ("C16",)
LARGEST = 1.5e6  # bytes of a page
CHAPTERS = [path.stem for path in find_notebooks()]


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

    def all(self, attribute, *tags):
        return [a[attribute] for name, a in self.tags if attribute in a and (not tags or name in tags)]


@pytest.fixture(scope="session")
def site(tmp_path_factory):
    """The site of the notebooks as they are stored; the equations' checks have tests of their own."""
    folder = tmp_path_factory.mktemp("a site") / "pages"
    pictures = folder.parent / "pictures"
    verdicts, slipping = list(map(claim, JUDGED)), list(map(slipping_claim, SLIPPING))
    save_claims(pictures, verdicts)
    save_claims(pictures, slipping, ending="-slip")
    save_animations(pictures)
    save_figures(pictures, ["frequencies"], kinds=["svg"])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Equation, "check", lambda self: self.number != 7)
        patch.setattr(build, "accuracy_table", lambda: "| a | b |\n| --- | --- |\n| 1 | 2 |\n")  # has tests of its own
        assert write_site(folder, find_notebooks(), verdicts, slipping, sorted(pictures.iterdir())) == ""
    assert sorted(path.name for path in folder.parent.iterdir()) == ["pages", "pictures"]
    return folder


@pytest.fixture(scope="session")
def pages(site):
    paths = sorted(site.rglob("*.html"))
    return {path.relative_to(site).as_posix(): Page(path.read_text(encoding="utf-8")) for path in paths}


def test_nothing_is_fetched(pages):
    for name, page in pages.items():
        fetched = page.all("src") + page.all("srcset") + page.all("data") + page.all("href", "link", "script")
        assert fetched and not [link for link in fetched if urlsplit(link).scheme], name
        assert "@import" not in page.text and not re.search(r"url\(https?:", page.text), name


def test_links_lead_somewhere(site, pages):
    identifiers = {name: page.all("id") for name, page in pages.items()}
    twice = {name: [id for id, times in Counter(ids).items() if times > 1] for name, ids in identifiers.items()}
    assert {name: ids for name, ids in twice.items() if ids} == {}
    lost = []
    for name, page in pages.items():
        for link in page.all("href") + page.all("src"):
            parts = urlsplit(link)
            if parts.scheme or link in ("", "#"):
                continue
            target = (site / name).parent / unquote(parts.path) if parts.path else site / name
            home = target.resolve().relative_to(site.resolve()).as_posix()
            there = target.is_file() and (not parts.fragment or parts.fragment in identifiers.get(home, ()))
            lost += [] if there else [(name, link)]
    assert lost == []


def test_pages_are_small(site):
    sizes = {path.name: path.stat().st_size for path in site.rglob("*.html")}
    assert {name: size for name, size in sizes.items() if size > LARGEST} == {}


def test_pictures_have_words_and_headings_have_order(pages):
    for name, page in pages.items():
        assert all(attributes.get("alt") for tag, attributes in page.tags if tag == "img"), name
        assert page.all("lang", "html") == ["en"]
        levels = [int(tag[1]) for tag, _ in page.tags if re.fullmatch(r"h[1-6]", tag)]
        assert all(after - before <= 1 for before, after in pairwise(levels)), name


def test_every_chapter_leads_on_and_can_be_taken_along(site, pages):
    assert {f"chapters/{name}.html" for name in CHAPTERS} <= set(pages)
    for before, after in pairwise(CHAPTERS):
        assert f"{after}.html" in pages[f"chapters/{before}.html"].all("href")
        assert f"{before}.html" in pages[f"chapters/{after}.html"].all("href")
    for path in find_notebooks():
        page = pages[f"chapters/{path.stem}.html"]
        book, script = (
            site / "chapters" / next(link for link in page.all("href", "a") if link.endswith(f"{path.stem}.{kind}"))
            for kind in ("ipynb", "py")
        )
        assert book.read_bytes() == path.read_bytes()
        py_compile.compile(str(script), cfile=str(site.parent / "compiled"), doraise=True)
        (site.parent / "compiled").unlink()


def test_a_script_runs(site, tmp_path):
    (script,) = site.rglob("03_joint.py")
    shutil.copy(script, tmp_path / "joint.py")
    done = subprocess.run(
        [sys.executable, "-c", "import runpy; from IPython.display import display; runpy.run_path('joint.py')"],
        cwd=tmp_path, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]


def test_every_equation_is_in_the_ledger_with_the_chapter_that_shows_it(site, pages):
    ledger = (site / "equations.html").read_text(encoding="utf-8")
    for e in cra.equations(companions=True):
        entry = re.search(rf'id="eq-{e.number}".*?(?=id="eq-|</article>)', ledger, re.S)[0]
        links = dict(re.findall(r"<dt[^>]*>([\w ]+)<.*?<dd[^>]*>(.*?)</dd>", entry, re.S))
        assert re.findall(r'href="#eq-(\w+)"', links.get("rests on", "")) == [str(n) for n in e.derived_from]
        uses = [str(o.number) for o in cra.equations(companions=True) if e.number in o.derived_from]
        assert re.findall(r'href="#eq-(\w+)"', links.get("used in", "")) == uses
        (chapter,) = re.findall(rf'href="(chapters/\w+\.html)#eq-{e.number}"', links["shown in"])
        assert f"eq-{e.number}" in pages[chapter].all("id")
        assert ("NOT confirmed by" in entry) == (e.number == 7)


def test_claims_come_first_with_what_they_rest_on(pages):
    page = pages["claims.html"]
    assert "claims.html" in pages["index.html"].all("href")
    identifiers = [*map(str.lower, JUDGED), *(f"{id.lower()}-slip" for id in SLIPPING)]
    assert {*identifiers, "claims-with-slip"} <= {*page.all("id")} and "claims --slipping C16" in page.text
    assert all(any(f"{id}-slip" in link for link in page.all("src")) for id in SLIPPING)
    for verdict in [*map(claim, JUDGED), *map(slipping_claim, SLIPPING)]:
        assert verdict.source in page.text and verdict.headline in page.text
        for told in (verdict.plain, verdict.sentence, verdict.criterion, verdict.remedy or "", verdict.missing or ""):
            prose = " ".join(told.split("$")[::2])  # mathematics stands between
            assert {*re.findall("[a-z]{4,}", prose)} <= {*re.findall("[a-z]{4,}", page.text)}
        assert all(name in page.text for name in verdict.evidence)
    for verdict in map(claim, JUDGED):
        assert f"../claims.html#{verdict.id.lower()}" in pages["chapters/10_claims.html"].all("href")


def test_numbers_say_where_they_come_from(pages):
    assert {"published", "calibrated", "assumed"} <= set(pages["provenance.html"].text.split())
    assert "furo" in pages["provenance.html"].text and cra.__version__ in pages["index.html"].text


def test_every_public_name_is_in_the_reference(pages):
    there = {id for name, page in pages.items() if name.startswith("reference/") for id in page.all("id")}
    assert {f"cra_sym.{name}" for name in cra._HOME} <= there
    assert {f"#cra_sym.{name}" for name in cra._HOME} <= {
        f"#{link.partition('#')[2]}" for link in pages["reference/index.html"].all("href", "a")
    }


def test_what_functions_return_is_in_the_reference_and_linked(pages):
    there = {id for name, page in pages.items() if name.startswith("reference/") for id in page.all("id")}
    kinds = [f"{kind.__module__}.{kind.__name__}" for group in results().values() for kind in group]
    assert {"cra_sym.analysis.certification.Certificate", "cra_sym.analysis.identification.Identification"} <= set(
        kinds
    )
    assert set(kinds) <= set(there) and all(
        getattr(kind, "__doc__", "") for group in results().values() for kind in group
    )
    links = pages["reference/frequencies_and_modes.html"].all("href", "a")
    assert "#cra_sym.analysis.certification.Certificate" in links


def test_every_equation_is_a_node_of_the_graph(site):
    graph = re.search(
        r'<div class="graph".*?</svg></div>', (site / "equations.html").read_text(encoding="utf-8"), re.S
    )[0]
    nodes = dict(re.findall(r'<a href="#eq-(\w+)">.*?<text>(.*?)</text></a>', graph))
    for e in cra.equations(companions=True):
        words = " ".join(re.findall(r"<tspan[^>]*>(.*?)</tspan>", nodes[str(e.number)]))
        assert words == f"({e.number}) {e.title}"


@pytest.mark.parametrize("name", sorted(cra._HOME))
def test_every_public_name_has_an_example(name):
    assert ">>>" in getattr(cra, name).__doc__


def test_search_knows_the_words(site):
    index = (site / "searchindex.js").read_text(encoding="utf-8")
    terms = json.loads(index.removeprefix("Search.setIndex(").removesuffix(")"))["terms"]
    assert {"timoshenko", "orthogon", "shaper"} <= set(terms)


@pytest.mark.parametrize(
    "extra, module", [("site", "furo"), ("site", "sphinx-mathjax-offline"), ("notebooks", "nbclient")]
)
def test_what_is_missing_is_named_before_any_work(extra, module, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError, match=rf"{module} is not installed.*cra_sym\[{extra}\]"):
        run.reproduce(tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


_PROBE = r"""() => {
  const sticks_out = e => {  // to the right, and no box around it can be scrolled there
    if (e.getBoundingClientRect().right <= innerWidth + 1) return false;
    for (let up = e.parentElement; up; up = up.parentElement)
      if (["auto", "scroll", "hidden"].includes(getComputedStyle(up).overflowX)) return up === document.body;
    return true; };
  const name = e => `${e.tagName} ${e.id} ${e.className} ${e.textContent.trim().slice(0, 40)}`;
  const print = matchMedia("print").matches;
  const boxes = [...document.querySelectorAll("article pre, article div.math, article figure")];
  return { formulas: document.querySelectorAll("mjx-container").length,
    raw: [...document.querySelectorAll("article .math, article p")]
      .filter(e => /\\\(|\$\$|\\\[/.test(e.textContent)).map(name),
    wrong: document.querySelectorAll("mjx-merror, [data-mjx-error]").length,
    out: [...document.querySelectorAll("article :not(svg *, mjx-container *)")].filter(sticks_out).map(name),
    cut: boxes.filter(e => print && e.scrollWidth > e.clientWidth + 1).map(name),
    wide: Math.max(0, document.documentElement.scrollWidth - innerWidth) };
}"""
SEEN = ["index", "claims", "equations", "chapters/02_hamilton", "chapters/07b_zones",
        "reference/frequencies_and_modes", "howto/sweep"]  # fmt: skip
_AXE = {"preload": False, "resultTypes": ["violations"]}  # it would fetch style sheets, which a folder does not allow
_SERIOUS = {"serious", "critical"}


def opened(browser, address, said):
    page = browser.new_page()
    page.set_default_timeout(120_000)
    page.on("request", lambda request: said.append(request.url) if not request.url.startswith("file:") else None)
    page.on("requestfailed", lambda request: said.append(request.url))
    page.on("console", lambda message: said.append(message.text))
    page.goto(address)
    page.evaluate("window.MathJax?.startup?.promise")
    return page


@pytest.mark.browser
@pytest.mark.parametrize("name", SEEN)
def test_a_page_fits_a_phone_a_screen_and_paper_and_excludes_nobody(name, site, browser):
    from axe_playwright_python.sync_playwright import Axe

    said: list[str] = []
    page = opened(browser, (site / f"{name}.html").as_uri(), said)
    for width, medium in ((390, "screen"), (1400, "screen"), (718, "print")):
        page.set_viewport_size({"width": width, "height": 900})
        page.emulate_media(media=medium)
        found = page.evaluate(_PROBE)
        assert bool(found.pop("formulas")) == bool(re.search("chapters|claims|equations", name))
        assert found == {"raw": [], "wrong": 0, "out": [], "cut": [], "wide": 0}, (width, medium)
    assert said == []
    page.set_viewport_size({"width": 390, "height": 900})
    for scheme in ("light", "dark"):
        page.emulate_media(media="screen", color_scheme=scheme)
        page.reload()
        page.evaluate("window.MathJax?.startup?.promise")
        bad = [v for v in Axe().run(page, options=_AXE).response["violations"] if v["impact"] in _SERIOUS]
        assert [(v["id"], [node["html"] for node in v["nodes"]]) for v in bad] == [], scheme
    page.close()


@pytest.mark.browser
def test_search_works_from_the_file_system(site, browser):
    said: list[str] = []
    page = opened(browser, (site / "index.html").as_uri(), said)
    page.fill("input[name=q]", "orthogonality")
    page.press("input[name=q]", "Enter")
    page.wait_for_selector("#search-results li a")
    found = [link.get_attribute("href") for link in page.locator("#search-results li a").all()]
    assert any("chapters/03_joint" in link for link in found)
    page.locator("#search-results li a").first.click()
    page.wait_for_selector("article h1")
    page.close()


@pytest.mark.browser
def test_chapters_are_turned_and_numbers_followed(site, browser):
    said: list[str] = []
    page = opened(browser, (site / "chapters" / "03_joint.html").as_uri(), said)
    page.click("a.next-page")
    assert Path(urlsplit(page.url).path).stem == "04_modes"
    page.click("a.prev-page")
    page.click('article a[href="../equations.html#eq-14"] >> nth=0')
    page.wait_for_selector("#eq-14", state="attached")  # the address changes before the page is there
    assert page.url.endswith("equations.html#eq-14") and page.locator("#eq-14").count() == 1
    page.close()


@pytest.mark.browser
def test_animations_can_be_held_and_solutions_opened(site, browser):
    said: list[str] = []
    page = opened(browser, (site / "index.html").as_uri(), said)
    films = "[...document.querySelectorAll('.film')].map(e => getComputedStyle(e).animationPlayState)"
    assert set(page.evaluate(films)) == {"running"}
    page.locator(".pause input").first.check()
    assert set(page.evaluate(films)) == {"paused"}
    page.locator(".pause input").first.uncheck()
    page.emulate_media(reduced_motion="reduce")
    assert set(page.evaluate(films)) == {"paused"}
    page.close()
    page = opened(browser, (site / "chapters" / "03_joint.html").as_uri(), said)
    solution = page.locator("details:has-text('Solution')").first
    assert not solution.locator("pre").first.is_visible()
    solution.locator("summary").first.click()
    assert solution.locator("pre").first.is_visible()
    page.close()
    assert said == []


def test_animations_are_on_the_pages(pages):
    assert {name.replace("_", "-") for name in ANIMATIONS} <= {id for page in pages.values() for id in page.all("id")}
