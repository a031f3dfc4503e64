"""Exported code: derived expressions in seven languages, with build files, reference vectors and a self-test."""

from cra_sym.codegen.controllers import Controller
from cra_sym.codegen.exporter import Export, export

__all__ = ["Controller", "Export", "export"]
