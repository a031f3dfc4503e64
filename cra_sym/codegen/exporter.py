"""Export: generated functions in the templates of a language, with reference vectors, written atomically."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cra_sym.checks import choice, count, flag, instance
from cra_sym.codegen.arm_library import arm_library
from cra_sym.codegen.controllers import Controller
from cra_sym.codegen.fmu import VERSIONS, fmu_archive
from cra_sym.codegen.fmu_parameters import Unit, parametric_unit
from cra_sym.codegen.frozen import frozen_library
from cra_sym.codegen.frozen_slipping import slipping_library
from cra_sym.codegen.library import PRINTERS, check_name
from cra_sym.codegen.rendering import DIGEST, licence
from cra_sym.codegen.user_model import model_library
from cra_sym.files import OutputError, path_of, staged_directory
from cra_sym.model.lagrangian import Model
from cra_sym.model.system import MOST_MODES, System

if TYPE_CHECKING:
    from sympy import Expr

__all__ = ["Export", "export"]


@dataclass(frozen=True)
class Export:
    """The result of an export.

    Attributes
    ----------
    language : str
    directory : Path
    files : tuple of str
        Paths inside the directory.
    digest : str
        SHA-256 of all files but the README, which contains it.
    """

    language: str
    directory: Path
    files: tuple[str, ...]
    digest: str

    def __repr__(self) -> str:
        names = "\n".join(f"  {name}" for name in self.files)
        title = PRINTERS[self.language].title if self.language in PRINTERS else "FMI"
        return f"<Export to {title}, {self.digest[:12]}, in {self.directory}\n{names}>"


def export(
    language: str,
    directory: str | Path,
    model: Model | None = None,
    overwrite: bool = False,
    *,
    system: System | None = None,
    name: str | None = None,
    modes: int | None = None,
    real: str = "float64",
    version: str = "3.0",
    input: str | Expr | Sequence[str | Expr] | None = None,
    outputs: Sequence[str | tuple[str, float] | Expr] | Mapping[str, str | tuple[str, float] | Expr] | None = None,
    controller: Controller | None = None,
) -> Export:
    """Write the arm, any model, or the modes of any system, as tested source code that does not need this package.

    The folder holds source, build files, reference vectors computed by this package, a self-test that compares with
    them, and a README. The same input gives the same bytes.

    Parameters
    ----------
    language : {'c', 'fortran', 'python', 'julia', 'octave', 'rust', 'javascript', 'fmu'}
        All have the same contents: for the arm the characteristic function, frequencies, modes, sensitivities,
        responses, state space and first-order stability; C also solves many arms at once. 'fmu' writes NAME.fmu, of a
        system: model exchange and co-simulation with sources, and a binary for this platform if there is a C compiler.
        The values of a system that could be exported as a model are start values of parameters, which initialization
        mode may change; those of others are frozen, and the description of the unit says why.
    directory : path
        Folder to create, with its parents.
    model : Model, optional
        It is exported instead of the arm, for any values of its parameters: characteristic function, count, natural
        frequencies, modes, sensitivities, responses to prescribed motions, state space, exact steps under held inputs
        and outputs. Its coefficients must be constant, with at most three wave numbers and without dampers; its ends
        may be joined and carry lumped coordinates. For others give `system`.
    overwrite : bool
        Whether to replace a folder that is not empty: the new one has the new files and those old ones that no earlier
        export wrote. The replacement is atomic: a failed export leaves the folder unchanged.
    system : System, optional
        Its first modes, frozen as numbers, are exported instead: exact steps under a held input, outputs, frequency
        response, input shapers. It may have dampers, vary along x, or be an arm; it is a single set of values. With
        elastic-slip elements the steps locate the events and are exact in between, as `cra_sym.slip_response`; there is
        no frequency response then, and an FMU supports co-simulation only. Nonlinear equations are linearised about
        zero, and the files say so.
    name : str, optional
        Prefix of every public symbol, and the name of package, module, crate and target. Default: of the arm
        `cra_arm`, in C and Fortran `cra`, so that its types are called `cra_arm`, `cra_mode`, ..; `model`; `system`.
    modes : int, optional
        Modes of the system that are kept, by default 3; of the arm and of a model the largest number that they are
        stepped with, by default 16, with a controller 3.
    real : {'float64', 'float32'}
        Type of real numbers in the code. Single precision is available for C, Fortran and Rust; the README states its
        accuracy.
    version : {'3.0', '2.0'}
        Of FMI.
    input, outputs
        As :func:`cra_sym.state_space` takes them; one input of a system, up to 64 of the arm or a model.
        Default input: 'base_acceleration', of a model its only prescribed motion or force; without one it is not
        stepped. Default outputs: y, v, w, root_force, root_moment and tip_acceleration, if the system has them.
    controller : Controller, optional
        Of a system or a model: a regulator and an observer are exported too, with gains computed at export.

    Returns
    -------
    Export

    Raises
    ------
    TypeError
        If the language or the name is not text, the directory not a path, the model not a Model, or the system not a
        System.
    ValueError
        If the language is unknown, the folder is not empty, the model has no closed form, or the system cannot be
        frozen. Nothing is written.

    Examples
    --------
    >>> import tempfile
    >>> import cra_sym as cra
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     made = cra.export("c", folder, system=cra.Arm.nominal(), name="crane", modes=2)
    >>> [name for name in made.files if name.startswith("crane")]
    ['crane.c', 'crane.h']
    """
    choice("language", language, [*PRINTERS, "fmu"])
    choice("version", version, VERSIONS)
    choice("real", real, ("float64", "float32"))
    overwrite = flag("overwrite", overwrite)
    if model is not None and system is not None:
        raise TypeError("model and system: give one of them; a system is a model with values")
    if name is not None:
        check_name(name)
    if language in PRINTERS and real not in PRINTERS[language].reals:
        raise ValueError(f"real = {real!r}: {PRINTERS[language].title} has {', '.join(PRINTERS[language].reals)}")
    if controller is not None:
        instance("controller", controller, Controller)
        if language == "fmu":
            raise ValueError("controller: is exported as source code; an FMU has none")
    if controller is not None and system is None and model is None:
        raise ValueError("controller: is that of a system or a model; give system= or model=")
    if language != "fmu" and version != VERSIONS[0]:
        raise ValueError(f"version = {version!r}: is that of FMI; give language='fmu'")
    if language == "fmu" and system is None:
        raise ValueError("language = 'fmu': is that of a system; give system=")
    target = Path(os.path.realpath(path_of("directory", directory)))
    _check_free(target, overwrite)
    texts: dict[str, str | bytes]
    if system is not None:
        drive = "base_acceleration" if input is None else input
        kept = 3 if modes is None else modes
        texts = _system_texts(language, system, name or "system", kept, real, version, drive, outputs, controller)
    elif model is not None:
        texts = dict(model_library(model, name or "model", real, modes, input, outputs, controller).texts(language))
    else:
        prefix = name or ("cra" if language in ("c", "fortran") else "cra_arm")
        texts = dict(_arm_texts(language, prefix, real, modes, input, outputs))
    if language != "fmu":
        texts["LICENSE"] = licence()
    digest = _digest(texts)
    texts = {file: text if isinstance(text, bytes) else text.replace(DIGEST, digest) for file, text in texts.items()}
    _write(target, texts, overwrite)
    return Export(language, Path(directory), tuple(sorted(texts)), digest)


def _system_texts(
    language: str,
    system: System,
    name: str,
    modes: int,
    real: str,
    version: str,
    drive: Any,
    outputs: Any,
    controller: Controller | None,
) -> dict[str, str | bytes]:
    instance("system", system, System)
    modes = count("modes", modes, high=MOST_MODES)
    slips = bool(system.model.pieces["hysteresis"])
    if slips and controller is not None:
        raise ValueError("controller: its gains are those of a linear system; give system.without_hysteresis")
    if language == "fmu" and real != "float64":
        raise ValueError(f"real = {real!r}: an FMU has float64")
    frozen = "Its values are frozen, as it has elastic-slip elements."
    if language == "fmu" and not slips:
        try:
            return {f"{name}.fmu": fmu_archive(parametric_unit(system, name, modes, drive, outputs), version, "")}
        except ValueError as reason:  # another than that of the input is raised again below
            frozen = f"Its values are frozen: {str(reason).partition(';')[0]}."
    if slips:
        library, given, names = slipping_library(system, name, modes, real, drive, outputs)
    else:
        library, given, names = frozen_library(system, name, modes, real, drive, outputs, controller)
    if language != "fmu":
        return dict(library.texts(language))
    return {f"{name}.fmu": fmu_archive(Unit(library, (given,), names), version, frozen)}


def _digest(texts: Mapping[str, str | bytes]) -> str:
    digest = hashlib.sha256()
    for name, text in sorted(texts.items()):
        if name != "README.md":
            content = text if isinstance(text, bytes) else text.encode()
            digest.update(f"{name} {len(content)}\n".encode() + content)
    return digest.hexdigest()


def _check_free(target: Path, overwrite: bool) -> None:
    if not os.path.lexists(target):
        return
    if not target.is_dir():
        raise OutputError(f"directory = {str(target)!r}: is not a directory")
    if not overwrite and any(target.iterdir()):
        raise OutputError(f"directory = {str(target)!r}: is not empty; overwrite=True (--force) writes into it")


def _write(target: Path, texts: Mapping[str, str | bytes], keep: bool) -> None:
    """Write the folder atomically: it is complete before it replaces the old one."""
    with staged_directory(target, keep=keep) as folder:
        for name, text in texts.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            if isinstance(text, bytes):
                (folder / name).write_bytes(text)
            else:
                (folder / name).write_text(text, encoding="utf-8", newline="\n")


def _arm_texts(language: str, name: str, real: str, modes: int | None, drive: Any, outputs: Any) -> dict[str, str]:
    from tqdm import tqdm

    with tqdm(total=0, desc=f"deriving and printing {language}", bar_format="{desc}", leave=False, disable=None):
        library = arm_library(name, real, modes, drive, outputs)
    return library.texts(language)
