"""Pictures inside a page: identifiers that clash with nobody, words for screen readers, no style that leaks."""

import re
from xml.etree import ElementTree

import pytest

from cra_sym.report.svg import inline_svg

TEXT = """<?xml version="1.0"?><svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"
 width="9pt" height="9pt" viewBox="0 0 9 9" version="1.1"><metadata>who</metadata>
 <defs><style type="text/css">*{stroke-linejoin: round}</style><path id="dot" d="M 1.23456 2.5  L 3 -0.00049 "/></defs>
 <g id="figure_1"><use xlink:href="#dot" x="1.000001"/><path id="line" clip-path="url(#box)" d="M 0 0  L 9 9"/>
 <clipPath id="box"><rect width="9" height="9"/></clipPath></g></svg>"""


@pytest.fixture
def root():
    return ElementTree.fromstring(inline_svg(TEXT, "one", "A & B", "Both."))


def test_identifiers_are_its_own(root):
    assert {e.get("id") for e in root.iter() if "id" in e.attrib} == {"one-dot", "one-box", "one-title", "one-desc"}
    use, line = root.find(".//{*}use"), root.findall(".//{*}path")[1]
    assert use.get("{http://www.w3.org/1999/xlink}href") == "#one-dot"
    assert line.get("clip-path") == "url(#one-box)"


def test_it_has_words(root):
    assert root.get("role") == "img" and root.get("aria-labelledby") == "one-title one-desc"
    assert [e.text for e in root[:2]] == ["A & B", "Both."]
    alone = inline_svg(TEXT, "one", "A")
    assert 'aria-labelledby="one-title"' in alone and "<desc" not in alone


def test_it_fills_its_place_and_leaks_no_style(root):
    assert root.get("viewBox") == "0 0 9 9" and not {"width", "height"} & set(root.attrib)
    assert root.find(".//{*}style") is None and root.find(".//{*}metadata") is None


def test_points_are_rounded_and_drawn_the_same(root):
    points = [float(n) for n in re.findall(r"-?[\d.]+", root.find(".//{*}path").get("d"))]
    assert points == pytest.approx([1.23456, 2.5, 3, 0], abs=0.005)
    assert root.find(".//{*}use").get("x") == "1"
