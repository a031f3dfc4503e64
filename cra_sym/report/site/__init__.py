"""The site: pages beside the chapters, and the settings and the extension with which Sphinx builds it all."""
