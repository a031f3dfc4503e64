"""Pictures as SVG inside the page: small, with identifiers of their own, and with words for who cannot see them."""

from __future__ import annotations

import re
from xml.etree import ElementTree

__all__ = ["inline_svg"]

_SVG, _XLINK = "http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"
_REFERENCE = re.compile(r"url\(#([^)]+)\)|^#(.+)$")
_DECIMALS = re.compile(r"-?\d+\.\d{3,}")
_SPACES = re.compile(r"\s*([A-Za-z])\s*")
_GONE = {f"{{{_SVG}}}metadata", f"{{{_SVG}}}style", f"{{{_SVG}}}title", f"{{{_SVG}}}desc"}

ElementTree.register_namespace("", _SVG)
ElementTree.register_namespace("xlink", _XLINK)


def inline_svg(text: str, name: str, title: str, description: str = "") -> str:
    """Return an SVG document as an element of a page.

    Parameters
    ----------
    text : str
        The document, as Matplotlib writes it. Its style sheet and metadata are dropped: the page's rules apply.
    name : str
        What all identifiers begin with; unlike on any other picture of the page.
    title, description : str
        What a screen reader says.

    Returns
    -------
    str
        ``<svg role="img" ...>`` that fills the width it is given; only identifiers that are referred to are kept.
    """
    root = ElementTree.fromstring(text)
    used = {found[1] or found[2] for e in root.iter() for v in e.attrib.values() for found in _REFERENCE.finditer(v)}
    for element in root.iter():
        for child in [child for child in element if child.tag in _GONE]:
            element.remove(child)
        for key, value in list(element.attrib.items()):
            if key == "id" and value not in used:
                del element.attrib[key]
            elif key == "id":
                element.set(key, f"{name}-{value}")
            elif key in {"d", "points", "x", "y"}:
                element.set(key, _SPACES.sub(r"\1", _DECIMALS.sub(_rounded, value)).strip())
            else:
                element.set(key, _REFERENCE.sub(lambda found: _renamed(found, name), value))
    for key in ("width", "height", "version"):
        root.attrib.pop(key, None)
    words = {"title": title, "desc": description}
    for place, (tag, said) in enumerate((tag, said) for tag, said in words.items() if said):
        child = ElementTree.Element(f"{{{_SVG}}}{tag}", {"id": f"{name}-{tag}"})
        child.text = said
        root.insert(place, child)
    root.set("role", "img")
    root.set("aria-labelledby", " ".join(f"{name}-{tag}" for tag, said in words.items() if said))
    return re.sub(r">\s+<", "><", ElementTree.tostring(root, encoding="unicode"))


def _rounded(number: re.Match[str]) -> str:
    return f"{float(number[0]):.2f}".rstrip("0").rstrip(".")


def _renamed(found: re.Match[str], name: str) -> str:
    return f"url(#{name}-{found[1]})" if found[1] else f"#{name}-{found[2]}"
