"""Export: generated functions put into the templates of a language, with reference vectors, and written as a whole."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from cra_sym.checks import choice
from cra_sym.codegen.expressions import gauss_rule, modal_functions, spectrum_functions, stability_functions
from cra_sym.codegen.languages import LANGUAGES, Language
from cra_sym.codegen.program import Function
from cra_sym.codegen.rendering import DIGEST, common_values, rendered
from cra_sym.codegen.user_model import model_texts
from cra_sym.codegen.vectors import arm_checks, written
from cra_sym.files import OutputError, path_of, staged_directory

__all__ = ["Export", "export"]

_FULL = ("c", "fortran", "python")


@dataclass(frozen=True)
class Export:
    """What an export wrote.

    Attributes
    ----------
    language : str
    directory : Path
    files : tuple of str
        Paths inside the directory.
    digest : str
        SHA-256 of all files but the README, which carries it.
    """

    language: str
    directory: Path
    files: tuple[str, ...]
    digest: str

    def __repr__(self) -> str:
        names = "\n".join(f"  {name}" for name in self.files)
        return f"<Export to {LANGUAGES[self.language].title}, {self.digest[:12]}, in {self.directory}\n{names}>"


def export(language: str, directory: str | Path, model: Any = None, overwrite: bool = False) -> Export:
    """Write the arm, or a model of one's own, as tested source code without dependence on this package.

    The folder holds source, build files, reference vectors made by this package's kernels, a self-test that compares
    with them, and a README. The same input gives the same bytes.

    Parameters
    ----------
    language : {'c', 'fortran', 'python', 'julia', 'octave', 'rust', 'javascript'}
        The first three hold everything: characteristic function, frequencies, modes, sensitivities, responses, state
        space and first-order stability. The others hold the characteristic function and the frequencies.
    directory : path
        Folder to make, with its parents.
    model : Model, optional
        Its characteristic function with the derivative by omega is exported instead of the arm.
    overwrite : bool
        Whether a folder that is not empty is replaced by one that holds the new files and, of the old ones, those no
        earlier export made. The folder changes in one step: a failed export leaves it as it was.

    Returns
    -------
    Export

    Raises
    ------
    TypeError
        If the language is no text, the directory no path or the model no Model.
    ValueError
        If the language is unknown, the folder is not empty, or the model has no real closed form. Nothing is written.
    """
    choice("language", language, LANGUAGES)
    target = Path(os.path.realpath(path_of("directory", directory)))
    _check_free(target, overwrite)
    texts = _arm_texts(language) if model is None else model_texts(language, model)
    digest = _digest(texts)
    texts = {name: text.replace(DIGEST, digest) for name, text in texts.items()}
    _write(target, texts, overwrite)
    return Export(language, Path(directory), tuple(sorted(texts)), digest)


def _digest(texts: dict[str, str]) -> str:
    digest = hashlib.sha256()
    for name, text in sorted(texts.items()):
        if name != "README.md":
            digest.update(f"{name} {len(text.encode())}\n{text}".encode())
    return digest.hexdigest()


def _check_free(target: Path, overwrite: bool) -> None:
    if not os.path.lexists(target):
        return
    if not target.is_dir():
        raise OutputError(f"directory = {str(target)!r}: is not a directory")
    if not overwrite and any(target.iterdir()):
        raise OutputError(f"directory = {str(target)!r}: is not empty; overwrite=True (--force) writes into it")


def _write(target: Path, texts: dict[str, str], keep: bool) -> None:
    """Write everything or nothing: the folder is complete before it takes its place."""
    with staged_directory(target, keep=keep) as folder:
        for name, text in texts.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(text, encoding="utf-8", newline="\n")


@cache
def _reference(everything: bool) -> str:
    return written(arm_checks(everything=everything), "a flexible Cartesian robotic arm")


def _arm_texts(name: str) -> dict[str, str]:
    texts = arm_sources(name)
    texts["reference.txt"] = _reference(name in _FULL)
    return texts


def arm_sources(name: str) -> dict[str, str]:
    """Return the texts of an arm's export, by file, all but the reference vectors."""
    from tqdm import tqdm

    language = LANGUAGES[name]
    with tqdm(total=0, desc=f"deriving and printing {language.title}", bar_format="{desc}", leave=False, disable=None):
        values = common_values(language) | _spectrum_values(language)
        if name in _FULL:
            values |= _modal_values(language)
            values["helpers"] = language.helped(values["spectrum_functions"] + values["modal_functions"])
    values["nomenclature"] = nomenclature_rows()
    return rendered(name, values) | {"LICENSE": values["licence"]}


def _spectrum_values(language: Language) -> dict[str, Any]:
    from cra_sym.solvers.one_wave import NEAR

    functions = spectrum_functions()
    terms = next(f.size for f in functions if f.name == "power_series")
    return {"spectrum_functions": _texts(language, functions), "near": int(NEAR[2]), "terms": terms}


def _modal_values(language: Language) -> dict[str, Any]:
    from cra_sym.solvers.one_wave_shapes import NEAR

    widths = stability_functions()
    nodes, weights = gauss_rule()
    return {
        "modal_functions": _texts(language, (*modal_functions(), *widths)),
        "near_shape": int(NEAR[2]),
        "nodes": [repr(x) for x in nodes],
        "weights": [repr(x) for x in weights],
        "call": caller({f.name: f for f in widths}),
    }


def caller(functions: dict[str, Function]) -> Callable[..., str]:
    """Return what writes a call with arguments given by name, in the function's own order."""

    def call(name: str, **given: str) -> str:
        return f"{name}({', '.join(given[a.name] for a in functions[name].arguments)})"

    return call


def _texts(language: Language, functions: tuple[Function, ...]) -> str:
    return "\n\n".join(language.function(f) for f in functions)


def nomenclature_rows() -> list[tuple[str, str, str]]:
    """Return name, unit and meaning of every field of the arm."""
    from dataclasses import fields

    from cra_sym.arm.parameters import Arm
    from cra_sym.symbols import nomenclature

    rows = {row.name: row for row in nomenclature()}
    return [(f.name, rows[f.name].unit, rows[f.name].meaning) for f in fields(Arm)]
