"""The derivation graph: one box an equation, sources to the left of what rests on them."""

from matplotlib.text import Annotation

from cra_sym.figures.derivation import figure_derivation, layers
from cra_sym.paper.equations import equations


def test_sources_come_before_what_rests_on_them():
    chosen = equations(companions=True)
    depth = layers(chosen)
    assert all(depth[source] < depth[e.number] for e in chosen for source in e.derived_from)
    assert depth[1] == depth[2] == 0 < depth[23] < depth[29]


def test_every_equation_is_a_box_and_every_source_an_arrow():
    chosen = equations(companions=True)
    (ax,) = figure_derivation(chosen).axes
    boxes = {text.get_text() for text in ax.texts if not isinstance(text, Annotation)}
    arrows = [text for text in ax.texts if isinstance(text, Annotation)]
    assert boxes == {f"({e.number})" for e in chosen}
    assert len(arrows) == sum(len(e.derived_from) for e in chosen)
