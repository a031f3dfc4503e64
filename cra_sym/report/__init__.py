"""The whole work in one folder: executed notebooks, figures, tables and a report to read offline."""
