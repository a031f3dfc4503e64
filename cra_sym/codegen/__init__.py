"""Exported code: the derived expressions in seven languages, each with build files, reference vectors and a test."""

from cra_sym.codegen.controllers import Controller
from cra_sym.codegen.exporter import Export, export

__all__ = ["Controller", "Export", "export"]
