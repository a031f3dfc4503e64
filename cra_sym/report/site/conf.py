"""Settings of Sphinx for the site; :mod:`cra_sym.report.site.build` writes its sources and runs it."""

from importlib import metadata

project = "cra_sym"
author = "the cra_sym developers"
copyright = f"{author}, BSD-3-Clause"
release = metadata.version("cra_sym")

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.mathjax",
    "cra_sym.report.site.extension",
]
root_doc = "index"
exclude_patterns = ["downloads"]
nitpicky = False
smartquotes_action = "D"  # dashes; quotes stay as they are written

# Notebooks are shown with their stored outputs and are not executed.
nb_execution_mode = "off"
nb_render_markdown_format = "myst"
nb_mime_priority_overrides = [("*", "text/markdown", 5)]  # preferred to HTML, in which formulas are not rendered
nb_merge_streams = True
nb_number_source_lines = False
myst_enable_extensions = ["amsmath", "attrs_inline", "colon_fence", "dollarmath", "fieldlist"]
myst_heading_anchors = 3
myst_links_external_new_tab = False

autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the docstrings say more than the annotations
autodoc_default_options = {"members": True}
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True  # attributes as a list: properties among them have entries of their own
toc_object_entries_show_parents = "hide"

# Mathematics without a network: the extension copies MathJax beside the pages.
mathjax_path = "mathjax/tex-svg.js"
mathjax3_config = {"options": {"enableMenu": False}, "svg": {"fontCache": "global"}}

html_theme = "furo"
html_title = "cra_sym"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_js_files = [("site.js", {"defer": "defer"})]
html_copy_source = False
html_show_sphinx = False
html_show_search_summary = False  # it would fetch the pages found, which a folder does not allow
html_theme_options = {"navigation_with_keys": False}
