"""The site: additional pages, and the settings and the extension with which Sphinx builds it."""
