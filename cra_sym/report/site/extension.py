"""Sphinx extension of the site: links from equation numbers, text for pictures, a local copy of MathJax."""

from __future__ import annotations

import json
import re
import shutil
from importlib import import_module
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx

from cra_sym.report.site.reference import results

__all__ = ["setup"]

LINKS = "links.json"
"""File among the sources that names the equations and claims of the site, and the page each is found on."""

_CITED = re.compile(r"(?<![\w)])\((\d{1,2}[a-z]?)\)|\b(C\d\d[a-z]?)\b")
_TAG = re.compile(r"\\qquad (?:\\mathrm\{)?\((\d{1,2}[a-z]?)\)\}?\s*$|\\tag\{(\d{1,2}[a-z]?)\}")
_UNTOUCHED = (nodes.reference, nodes.literal, nodes.literal_block, nodes.math, nodes.math_block, nodes.title, nodes.raw)
_MATHJAX = ("tex-svg.js", "input/tex/extensions")


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect the functions below to Sphinx events."""
    app.connect("doctree-read", plain_types)
    app.connect("doctree-resolved", link_numbers)
    app.connect("doctree-resolved", mark_equations)
    app.connect("doctree-resolved", describe_pictures)
    app.connect("html-page-context", level_captions, priority=1000)  # after the theme, which makes the tree
    app.connect("build-finished", copy_mathjax)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}


def _links(app: Sphinx) -> dict[str, str]:
    path = Path(app.srcdir) / LINKS
    return dict(json.loads(path.read_text(encoding="utf-8"))) if path.exists() else {}


def link_numbers(app: Sphinx, doctree: nodes.document, docname: str) -> None:
    """Make every number of an equation, such as (16), and every name of a claim a link to it."""
    homes = _links(app)
    for text in list(doctree.findall(nodes.Text)):
        if _inside(text, _UNTOUCHED):
            continue
        pieces: list[nodes.Node] = []
        place = 0
        for found in _CITED.finditer(text):
            home = homes.get(found[1] or found[2])
            page, _, anchor = (home or "").partition("#")
            if home is None or (page == docname and _inside_section(text, anchor)):
                continue
            address = f"#{anchor}" if page == docname else f"{app.builder.get_relative_uri(docname, page)}#{anchor}"
            pieces += [nodes.Text(text[place : found.start()])]
            pieces += [nodes.reference("", found[0], internal=True, refuri=address)]
            place = found.end()
        if pieces:
            text.parent.replace(text, [*pieces, nodes.Text(text[place:])])


def _inside_section(node: nodes.Node, anchor: str) -> bool:
    up: Any = node.parent
    while up is not None and not isinstance(up, nodes.section):
        up = up.parent
    return up is not None and anchor in up["ids"]


def _inside(node: nodes.Node, kinds: tuple[type[nodes.Node], ...]) -> bool:
    up = node.parent
    while up is not None:
        if isinstance(up, kinds):
            return True
        up = up.parent
    return False


def mark_equations(app: Sphinx, doctree: nodes.document, docname: str) -> None:
    """Give the first formula of a chapter that carries an equation's number the identifier ``eq-`` and the number."""
    if not docname.startswith("chapters/"):
        return
    taken: set[str] = set()
    for formula in doctree.findall(nodes.math_block):
        found = _TAG.search(formula.astext())
        name = f"eq-{found[1] or found[2]}" if found else ""
        if name and name not in taken:
            taken.add(name)
            formula["ids"].append(name)


def describe_pictures(app: Sphinx, doctree: nodes.document, docname: str) -> None:
    """Give every picture without alternative text the text of its section."""
    for picture in doctree.findall(nodes.image):
        if not picture.get("alt"):
            section: Any = picture.parent
            while section is not None and not isinstance(section, nodes.section):
                section = section.parent
            picture["alt"] = "Figure: " + (section[0].astext() if section is not None else docname)


def level_captions(
    app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: nodes.document | None
) -> None:
    """Give the captions in the sidebar, which are headings, a heading level."""
    tree = str(context.get("furo_navigation_tree", ""))
    context["furo_navigation_tree"] = tree.replace('role="heading"', 'role="heading" aria-level="2"')


def copy_mathjax(app: Sphinx, error: Exception | None) -> None:
    """Copy the MathJax files that the pages load from the installed package."""
    if error is not None:
        return
    source = Path(str(import_module("sphinx-mathjax-offline").__file__)).parent / "static" / "mathjax"
    target = Path(app.outdir) / "_static" / "mathjax"
    for name in _MATHJAX:
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        if (source / name).is_dir():
            shutil.copytree(source / name, target / name, dirs_exist_ok=True)
        else:
            shutil.copyfile(source / name, target / name)


def plain_types(app: Sphinx, doctree: nodes.document) -> None:
    """Leave the words of a type such as ``ndarray, shape (3,)`` unlinked, except fully qualified class names."""
    known = {kind.__name__: f"{kind.__module__}.{kind.__name__}" for kinds in results().values() for kind in kinds}
    for link in list(doctree.findall(addnodes.pending_xref)):
        if link.get("refdomain") == "py" and not link.get("refexplicit") and _inside(link, (nodes.field,)):
            name = link["reftarget"].rpartition(".")[2]
            if not name[:1].isupper():
                link.replace_self(link.children)
            link["reftarget"] = known.get(name, link["reftarget"])
