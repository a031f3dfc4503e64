"""The whole work in one folder: executed notebooks, figures, tables and a report to read offline."""

from cra_sym.report.run import reproduce

__all__ = ["reproduce"]
