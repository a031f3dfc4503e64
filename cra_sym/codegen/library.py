"""A program in the restricted form as a library in any language: source, build files, self-test, reference vectors."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files

import cra_sym
from cra_sym.codegen.names import FORTRAN, KEYWORDS, RESERVED
from cra_sym.codegen.print_c import CPrinter
from cra_sym.codegen.print_fortran import FortranPrinter
from cra_sym.codegen.print_julia import JuliaPrinter
from cra_sym.codegen.print_python import PythonPrinter
from cra_sym.codegen.print_rust import RustPrinter
from cra_sym.codegen.print_scripts import JavaScriptPrinter, OctavePrinter
from cra_sym.codegen.printing import Printer, snake
from cra_sym.codegen.rendering import DIGEST, rendered
from cra_sym.kernels.form import FunctionDefinition, Program
from cra_sym.kernels.form_parse import parse

__all__ = ["PRINTERS", "Check", "Library", "check_name", "source"]

PRINTERS: dict[str, type[Printer]] = {
    printer.name: printer
    for printer in (
        CPrinter, FortranPrinter, PythonPrinter, JuliaPrinter, OctavePrinter, RustPrinter, JavaScriptPrinter
    )
}  # fmt: skip
_NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
_ASIDE = {"_evaluate", "_example"}
_OF_TESTS = frozenset("line file numbers inputs given expected failed failures found got near good".split())
"""Variables of the self-test in Octave, which must not be names of functions."""
_LONGEST = 24  # a Fortran name has at most 63 characters, of which the prefix is a part
_C_HELPERS = {
    name: f"static inline int {name}(int one, int other)\n{{\n    return one {sign} other ? one : other;\n}}"
    for name, sign in (("smaller_of", "<"), ("larger_of", ">"))
}
_FORTRAN_HELPERS = {
    "floor_real": (
        "Largest whole number not above x, as a real.",
        "out = aint(x)\n    if (out > x) out = out - 1.0_dp",
    ),
    "ceiling_real": (
        "Smallest whole number not below x, as a real.",
        "out = aint(x)\n    if (out < x) out = out + 1.0_dp",
    ),
}


def source(name: str) -> str:
    """Return a text of the folder of sources, without its docstring."""
    text = files("cra_sym.codegen").joinpath("sources", f"{name}.form").read_text(encoding="utf-8")
    return text.split('"""', 2)[2].lstrip()


def check_name(name: object) -> str:
    """Return a valid prefix of public names.

    Raises
    ------
    TypeError, ValueError
        If it is not text, not an identifier in lower case of at most 24 characters, or a word of a language.
    """
    if not isinstance(name, str):
        raise TypeError(f"name = {name!r}: must be a text")
    if not _NAME.fullmatch(name) or len(name) > _LONGEST or name in RESERVED | FORTRAN | _OF_TESTS:
        raise ValueError(
            f"name = {name!r}: must be lower-case letters, digits and single underscores, begin with a letter, have at "
            f"most {_LONGEST} characters and be no word of a programming language"
        )
    return name


@dataclass(frozen=True)
class Check:
    """One line of the reference vectors.

    Attributes
    ----------
    quantity : int
        Its number in the function ``_evaluate`` of the text.
    given, expected : tuple of float
        At most 64 and 256.
    relative, absolute : float
        The error allowed.
    refused : bool
        Whether the function must report an error.
    """

    quantity: int
    given: tuple[float, ...]
    expected: tuple[float, ...]
    relative: float = 0.0
    absolute: float = 0.0
    refused: bool = False

    def line(self) -> str:
        """Return the line."""
        counts = [str(len(self.given)), str(len(self.expected))]
        numbers = [repr(float(x)) for x in (self.relative, self.absolute)]
        values = [repr(float(x)) for x in (*self.given, *self.expected)]
        return " ".join([str(self.quantity), str(int(self.refused)), *numbers, *counts, *values])


@dataclass(frozen=True)
class Library:
    """A library to be exported in any language.

    Attributes
    ----------
    name : str
        Prefix, module, crate, target.
    summary : str
        One line.
    text : str
        In the restricted form; of its private functions ``_evaluate`` is for the self-test and ``_example``, which
        fills one row, for the README.
    provenance : tuple of str
        Lines at the head of every file.
    checks : tuple of Check
    readme : str
        Part of the README specific to this library, in Markdown.
    real : {'float64', 'float32'}
    batch : tuple of three str
        Declarations, definitions and self-test, in C, of functions for many sets at once.
    stack : str
        Stack size that the C code needs.
    """

    name: str
    summary: str
    text: str
    provenance: tuple[str, ...]
    checks: tuple[Check, ...]
    readme: str = ""
    real: str = "float64"
    batch: tuple[str, str, str] = ("", "", "")
    stack: str = "a few hundred bytes"

    def texts(self, language: str) -> dict[str, str]:
        """Return the texts of all files, by name, but for the licence."""
        whole = parse(self.text)
        public = whole.used_by([name for name, f in whole.functions.items() if f.public]).functions
        functions = {name: f for name, f in public.items() if name not in _ASIDE}
        taken = KEYWORDS & {name for f in functions.values() for name in (*f.parameters, *f.locals, *f.loops)}
        if taken:
            raise ValueError(f"words of a language cannot name variables: {', '.join(sorted(taken))}")
        printer = PRINTERS[language](whole, self.name, self.real)
        printed = self._values(printer, list(functions.values()))
        for name in _ASIDE & set(whole.functions):
            needed = [f for n, f in whole.used_by([name]).functions.items() if n not in functions]
            printed[name.strip("_")] = printer.several(needed)
        if "_example" in whole.functions:
            length = whole.functions["_example"].parameters["found"].length
            printed["shown"] = length if isinstance(length, int) else whole.constants[str(length)].values[0]
        texts = rendered(f"library/{language}", printed) | rendered("library/common", printed)
        texts = {name.replace("NAME", self.name): _tidy(text) for name, text in texts.items() if text.strip()}
        if language == "c" and self.batch[1]:
            texts[f"{self.name}_batch.c"] = _tidy(f"{self._commented('/* ', ' * ', ' */')}\n{self.batch[1]}")
        texts["reference.txt"] = "".join(f"{check.line()}\n" for check in self.checks)
        return texts

    def _values(self, printer: Printer, functions: Sequence[FunctionDefinition]) -> dict[str, object]:
        form = printer.form
        kept = Program(
            form.doc, form.constants, form.records, {f.name: f for f in functions}, form.comments, form.alone
        )
        printer.form = kept
        text = printer.all_functions()
        values: dict[str, object] = {
            "name": self.name,
            "upper": self.name.upper(),
            "language": printer.name,
            "title": printer.title,
            "summary": self.summary,
            "version": cra_sym.__version__,
            "real": self.real,
            "word": getattr(printer, "word", ""),
            "constants": printer.constants(),
            "records": printer.records(),
            "functions": text,
            "errors": getattr(printer, "errors", str)(),
            "exported": _exported(printer),
            "tasks": [f.name for f in functions if f.public],
            "helpers": _helpers(printer, text),
            "of_c": [n for n in ("expm1", "log1p") if f"{n}(" in text] if printer.name == "fortran" else [],
            "kind_of_c": "c_double" if self.real == "float64" else "c_float",
            "digest": DIGEST,
            "header": printer.header() if isinstance(printer, CPrinter) else "",
            "provenance": self._commented,
            "readme": self.readme,
            "batch": self.batch[0],
            "batch_test": self.batch[2],
            "stack": self.stack,
            "timed": _is_stepped(form),
            "checks": len(self.checks),
            "listed": [(f.name, f.doc.splitlines()[0]) for f in functions if f.public],
        }
        printer.form = form
        return values

    def _commented(self, first: str, further: str, last: str) -> str:
        lines = ["SPDX-License-Identifier: BSD-3-Clause", *self.provenance]
        marked = [f"{first if n == 0 else further}{line}".rstrip() for n, line in enumerate(lines)]
        return "\n".join([*marked, last] if last else marked)


def _is_stepped(form: Program) -> bool:
    """Tell whether the library steps one system, prepared for a sampling time."""
    functions = form.functions
    return "step" in functions and list(functions["discretise"].parameters) == ["time", "sampled"]


def _tidy(text: str) -> str:
    """Return a text with at most two successive empty lines and one newline at the end."""
    return re.sub(r"\n{4,}", "\n\n\n", text).rstrip("\n") + "\n"


def _exported(printer: Printer) -> list[str]:
    form = printer.form
    functions = [printer.function_name(f) for f in form.functions.values() if f.public]
    constants = [name for name in form.constants if name in form.interface]
    records = [name for name in form.records if name in form.interface]
    if isinstance(printer, FortranPrinter):
        errors = [f"{printer.prefix}_ok", *map(printer.error, form.errors)]
        types = [printer.record_name(name) for name in records]
        return [f"{printer.prefix}_version", *errors, *constants, *types, *functions]
    if isinstance(printer, JavaScriptPrinter):
        return [*constants, *(f"new_{snake(name)}" for name in records), *functions]
    return [*(form.errors if isinstance(printer, PythonPrinter) else []), *constants, *records, *functions]


def _helpers(printer: Printer, text: str) -> str:
    if isinstance(printer, CPrinter):
        return "\n\n".join(helper for name, helper in _C_HELPERS.items() if f"{name}(" in text)
    if isinstance(printer, FortranPrinter):
        return "\n".join(_fortran_helper(n, *words) for n, words in _FORTRAN_HELPERS.items() if f"{n}(" in text)
    return getattr(printer, "helpers", "")


def _fortran_helper(name: str, doc: str, body: str) -> str:
    return (
        f"  !> {doc}\n  pure elemental function {name}(x) result(out)\n    real(dp), intent(in) :: x\n"
        f"    real(dp) :: out\n    {body}\n  end function {name}\n"
    )
