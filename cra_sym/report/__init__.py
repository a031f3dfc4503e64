"""The whole work in one folder: executed notebooks, figures, tables and a site to read offline."""
