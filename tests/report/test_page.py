"""The report: one page that is whole, asks the network for nothing, and can be read by everybody."""

import re
import shutil
from collections import Counter
from html.parser import HTMLParser
from itertools import pairwise

import pytest

import cra_sym as cra
from cra_sym.claims import claim
from cra_sym.figures import ANIMATIONS, FIGURES
from cra_sym.paper.equations import Equation
from cra_sym.report import page as page_module
from cra_sym.report.notebooks import find_notebooks
from cra_sym.report.page import write_page
from cra_sym.report.pictures import save_animations, save_claims, save_figures

DRAWN = ["fig01", "fig04", "mode_shapes"]  # the others, which have tests of their own, are shown as copies of the last
JUDGED = [claim(id) for id in ("C03", "C07", "C20", "C22")]  # one of each outcome


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
    save_figures(folder / "figures", DRAWN, kinds=["svg"])
    for name in set(FIGURES) - set(DRAWN):
        shutil.copy(folder / "figures" / f"{DRAWN[-1]}.svg", folder / "figures" / f"{name}.svg")
    save_animations(folder / "figures")
    save_claims(folder / "claims", JUDGED)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Equation, "check", lambda self: self.number != 7)
        patch.setattr(page_module, "claims", lambda: JUDGED)
        return write_page(folder)


@pytest.fixture(scope="module")
def page(path):
    return Page(path.read_text(encoding="utf-8"))


def test_nothing_is_fetched(page):
    sources = [a[k] for _, a in page.tags for k in ("src", "srcset", "data", "action", "xlink:href") if k in a]
    assert sources and all(source.startswith(("data:image/", "#")) for source in sources)
    assert not {"script", "link", "iframe", "object", "base"} & {tag for tag, _ in page.tags}
    assert "@import" not in page.text and "url(" not in page.text


def test_links_lead_somewhere(page):
    identifiers = [a["id"] for _, a in page.tags if "id" in a]
    assert [name for name, times in Counter(identifiers).items() if times > 1] == []
    inner = [a[k][1:] for _, a in page.tags for k in ("href", "xlink:href") if a.get(k, "").startswith("#")]
    assert set(inner) <= set(identifiers)
    named = [name for _, a in page.tags for name in a.get("aria-labelledby", "").split()]
    assert named and set(named) <= set(identifiers)
    painted = re.findall(r"url\(#([^)]+)\)", " ".join(v or "" for _, a in page.tags for v in a.values()))
    assert painted and set(painted) <= set(identifiers)


def test_every_chapter_equation_and_figure_is_there(page):
    identifiers = {a["id"] for _, a in page.tags if "id" in a}
    assert {f"eq-{e.number}" for e in cra.equations(companions=True)} <= identifiers
    assert {path.stem.replace("_", "-") for path in find_notebooks()} <= identifiers
    assert {name.replace("_", "-") for name in (*FIGURES, *ANIMATIONS)} <= identifiers
    assert {f"claim-{verdict.id.lower()}" for verdict in JUDGED} <= identifiers


def test_claims_are_shown_with_what_they_rest_on(path):
    text = path.read_text(encoding="utf-8")
    for verdict in JUDGED:
        article = re.search(rf'<article id="claim-{verdict.id.lower()}".*?</article>', text, re.S)[0]
        words = Page(article).text
        assert verdict.source in words and verdict.headline in words
        for told in (verdict.plain, verdict.sentence, verdict.criterion, verdict.remedy or "", verdict.missing or ""):
            assert all(prose in words for prose in told.split("$")[::2])  # mathematics stands between
        assert all(name in words and quantity.meaning in words for name, quantity in verdict.evidence.items())
        assert f'id="picture-{verdict.id.lower()}-title"' in article
    linked = re.findall(r'<a href="#claim-(c\d\d\w?)">', text)
    assert {"c03", "c07"} <= set(linked) <= {verdict.id.lower() for verdict in JUDGED}


def test_numbers_say_where_they_come_from(page):
    assert {"published", "calibrated", "assumed"} <= set(page.text.split())
    assert "One number, a family of arms" in page.text and "Nomenclature" in page.text


def test_an_equation_leads_to_its_sources(path):
    article = re.search(r'<article id="eq-16".*?</article>', path.read_text(encoding="utf-8"), re.S)[0]
    rests_on = article.partition("rests on")[2].partition("</dd>")[0]
    assert re.findall(r'href="#eq-(\w+)"', rests_on) == [str(n) for n in cra.equation(16).derived_from]


def test_a_failed_check_is_not_hidden(path):
    text = path.read_text(encoding="utf-8")
    assert text.count("NOT confirmed by") == 1
    assert "NOT confirmed" in re.search(r'<article id="eq-7".*?</article>', text, re.S)[0]


def test_an_equation_leads_to_what_rests_on_it(path):
    text = path.read_text(encoding="utf-8")
    for e in cra.equations(companions=True):
        for source in e.derived_from:
            used_in = re.search(rf'<article id="eq-{source}".*?</article>', text, re.S)[0].partition("used in")[2]
            assert f'href="#eq-{e.number}"' in used_in.partition("</dd>")[0]


def test_pictures_have_words_and_headings_have_order(page):
    assert all(page.all("img", "alt"))
    assert page.all("html", "lang") == ["en"]
    levels = [int(tag[1]) for tag, _ in page.tags if re.fullmatch(r"h[1-6]", tag)]
    assert levels.count(1) == 1 and levels[0] == 1
    assert all(after - before <= 1 for before, after in pairwise(levels))


_PROBE = """() => {
  const seen = e => { const box = e.getBoundingClientRect(); return box.width >= 2 && box.height >= 2; };
  const sticks_out = e => {  // to the right, and no box around it can be scrolled there
    if (e.getBoundingClientRect().right <= innerWidth + 1) return false;
    for (let up = e.parentElement; up; up = up.parentElement)
      if (["auto", "scroll", "hidden"].includes(getComputedStyle(up).overflowX)) return up === document.body;
    return true; };
  const print = matchMedia("print").matches;
  const elsewhere = print ? "details, .formula:has(+ .on-paper)" : "details";
  const shown = [...document.querySelectorAll("main math, main svg, main img")].filter(e => !e.closest(elsewhere));
  const cut = [...document.querySelectorAll("main .formula, main .scroll, main figure, main .output")]
    .filter(e => print && e.scrollWidth > e.clientWidth + 1);
  const name = e => `${e.tagName} ${e.id} ${e.textContent.trim().slice(0, 40)}`;
  return { shown: shown.length, unseen: shown.filter(e => !seen(e)).map(name),
    out: [...document.querySelectorAll("main :not(svg *, math *)")].filter(sticks_out).map(name),
    wide: Math.max(0, document.documentElement.scrollWidth - innerWidth), cut: cut.map(name) };
}"""


@pytest.mark.browser
def test_in_a_browser(path, browser):
    """It asks for nothing but itself, shows everything on a phone, a screen and paper, and can be used by keyboard."""
    page = browser.new_page()
    page.set_default_timeout(120_000)
    asked, said = [], []
    page.on("request", lambda request: asked.append(request.url))
    page.on("console", lambda message: said.append(message.text))
    page.goto(path.as_uri())
    for width, medium in ((390, "screen"), (1400, "screen"), (718, "print")):
        page.set_viewport_size({"width": width, "height": 900})
        page.emulate_media(media=medium)
        found = page.evaluate(_PROBE)
        assert found.pop("shown") > 300
        assert found == {"unseen": [], "out": [], "wide": 0, "cut": []}, (width, medium)
    page.emulate_media(media="screen")

    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.className") == "skip"
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.id") == "main"
    page.click('#eq-16 a[href="#eq-14"]')
    assert page.evaluate("document.querySelector(':target').id") == "eq-14"
    assert page.locator("#eq-14").is_visible()

    films = "[...document.querySelectorAll('.film')].map(e => getComputedStyle(e).animationPlayState)"
    assert set(page.evaluate(films)) == {"running"}
    for box in page.locator(".pause input").all():
        box.check()
    assert set(page.evaluate(films)) == {"paused"}
    for box in page.locator(".pause input").all():
        box.uncheck()
    page.emulate_media(reduced_motion="reduce")
    assert set(page.evaluate(films)) == {"paused"}
    assert (asked, said) == ([path.as_uri()], [])
    page.close()
