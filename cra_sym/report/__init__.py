"""Reproduction of all results in one folder: executed notebooks, figures, tables and a site for offline reading."""
