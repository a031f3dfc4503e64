"""Markdown and LaTeX become HTML and MathML; numbers of equations become links."""

import re
from xml.etree import ElementTree

import pytest

import cra_sym as cra
from cra_sym.report.markup import Markup, mathml


@pytest.mark.parametrize("number", [e.number for e in cra.equations(companions=True)])
def test_no_latex_is_left_in_a_formula(number):
    text = mathml(cra.equation(number)._repr_latex_(), block=True)
    root = ElementTree.fromstring(text)  # a stray alignment mark would not even parse
    assert root.get("display") == "block"
    assert not [word for word in root.itertext() if "\\" in word or word in {"&", "4pt"}]


def test_rows_become_rows():
    formula = mathml(r"$\begin{gathered} \begin{aligned} a = &b \\ &+ c \end{aligned} \\[4pt] d \end{gathered}$")
    outer = ElementTree.fromstring(formula).find(".//{*}mtable")
    assert len(outer) == 2
    assert len(outer.find(".//{*}mtable")) == 2


def test_numbers_of_known_equations_are_links():
    markup = Markup("x", numbers={"7", "16a"})
    html = markup("See (7), (16a) and (8), not f(7) nor $g(7)$ nor `(7)`.")
    assert re.findall(r'<a href="#([\w-]+)">\((\w+)\)</a>', html) == [("eq-7", "7"), ("eq-16a", "16a")]


def test_chapters_are_links_and_headings_go_down():
    markup = Markup("01_b", chapters={"00_a"})
    html = markup("# Title\n\n## A $x$ part\n\n[back](00_a.ipynb), [on](02_c.ipynb), [out](https://example.org)")
    assert '<h2 id="01-b">' in html and '<h3 id="01-b-a-' in html
    assert '<a href="#00-a">back</a>, on, <a href="https://example.org">out</a>' in html
    assert [level for level, _, _ in markup.headings] == [1, 2]
