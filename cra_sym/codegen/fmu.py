"""A system as a Functional Mock-up Unit, FMI 3.0 or 2.0: model exchange and co-simulation, sources and a binary.

A system with elastic-slip elements has co-simulation only, as its steps locate the events.
"""

from __future__ import annotations

import io
import platform
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import escape

import cra_sym
from cra_sym.codegen.fmu_parameters import Parameter, Unit, reasons
from cra_sym.codegen.library import Library
from cra_sym.codegen.rendering import licence, rendered
from cra_sym.kernels.form_parse import parse
from cra_sym.symbols import unit_dimension

__all__ = ["VERSIONS", "fmu_archive"]

VERSIONS = ("3.0", "2.0")
_UNITS = {
    "m": ' m="1"', "m/s": ' m="1" s="-1"', "m/s2": ' m="1" s="-2"', "N": ' kg="1" m="1" s="-2"',
    "N.m": ' kg="1" m="2" s="-2"', "1": "",
}  # fmt: skip
_UNIT_OF = {
    "y": "m", "v": "m", "w": "m", "tip_velocity": "m/s", "tip_acceleration": "m/s2", "root_force": "N",
    "root_moment": "N.m", "tip_force": "N", "tip_moment": "N.m", "base_acceleration": "m/s2", "drive_force": "N",
    "strain": "1",
}  # fmt: skip
_OUTPUT, _PARAMETER, _STATE, _DERIVATIVE = 1000, 2000, 10000, 20000  # first value references, as in the template
_FORCE, _DISSIPATED = 3000, 5000  # of elements
_FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden")
_SYSTEMS = {"linux": ("linux", ".so"), "darwin": ("darwin", ".dylib")}
_MACHINES = {"x86_64": "x86_64", "amd64": "x86_64", "aarch64": "aarch64", "arm64": "aarch64"}


@dataclass(frozen=True)
class _Variable:
    name: str
    number: int
    causality: str
    kind: str
    description: str
    index: int
    state: int = 0
    given: Parameter | None = None

    @property
    def unit(self) -> str:
        unit = self.given.unit if self.given else _UNIT_OF.get(self.name)
        return f' unit="{escape(unit)}"' if unit else ""

    @property
    def variability(self) -> str:
        return "fixed" if self.given else "continuous"

    @property
    def more3(self) -> str:
        start = self.given.start if self.given else "0"
        return {
            "input": ' start="0"', "state": ' initial="exact" start="0"', "derivative": f' derivative="{self.state}"',
            "parameter": f' initial="exact" start="{start}"',
        }.get(self.kind, "")  # fmt: skip

    @property
    def more2(self) -> str:
        return self.more3.replace(' initial="exact"', "")

    @property
    def initial2(self) -> str:
        return {
            "state": ' initial="exact"',
            "parameter": ' initial="exact"',
            "derivative": ' initial="calculated"',
            "output": ' initial="calculated"',
        }.get(self.kind, "")


def _variables(blocks: int, elements: int, unit: Unit, version: str) -> list[_Variable]:
    """Return all variables; time is one in FMI 3.0 only, and indices count from 1."""
    found = [_Variable("time", 0, "independent", "time", "time, s", 0)] if version == "3.0" else []
    rows = [
        (name, 1 + i, "input", "input", "input, held between communication points")
        for i, name in enumerate(map(_quoted, unit.inputs))
    ]
    rows += [
        (name, _OUTPUT + i, "output", "output", f"output {name}") for i, name in enumerate(map(_quoted, unit.outputs))
    ]
    for first, of in (_FORCE, "element_force"), (_DISSIPATED, "element_dissipated"):
        meaning = "force of an elastic-slip element" if first == _FORCE else "J, energy dissipated by an element"
        rows += [(f"{of}[{i + 1}]", first + i, "output", "output", meaning) for i in range(elements)]
    start = len(rows) + 1
    for i in range(2 * blocks):
        of = f"{'position' if i % 2 == 0 else 'rate'}[{i // 2 + 1}]"
        rows.append((of, _STATE + i, "local", "state", "of a modal block"))
    found += [_Variable(*row, index) for index, row in enumerate(rows, 1)]
    for i in range(2 * blocks):
        of = f"der({'position' if i % 2 == 0 else 'rate'}[{i // 2 + 1}])"
        state = _STATE + i if version == "3.0" else start + i
        words = "local", "derivative", "time derivative of a state"
        found.append(_Variable(of, _DERIVATIVE + i, *words, len(rows) + 1 + i, state))
    for i, one in enumerate(unit.parameters):
        place = len(found) + (version == "2.0")
        about = _quoted(one.description)
        found.append(_Variable(_quoted(one.name), _PARAMETER + i, "parameter", "parameter", about, place, given=one))
    return found


def _quoted(text: str) -> str:
    return escape(text, {'"': "&quot;"})


def _units(parameters: Sequence[Parameter]) -> dict[str, str]:
    """Return the units by name, with their exponents of base units."""
    found = dict(_UNITS)
    for unit in sorted({one.unit for one in parameters} - {*found, ""}):
        powers = unit_dimension(unit)._asdict().items()
        found[escape(unit)] = "".join(f' {base}="{power}"' for base, power in sorted(powers) if power)
    return found


def fmu_archive(unit: Unit, version: str, frozen: str) -> bytes:
    """Return the bytes of the archive; the same input and compiler give the same bytes.

    ``frozen`` says why there are no parameters, if there are none.
    """
    library = unit.library
    constants = parse(library.text).constants
    elements = int(constants["ELEMENTS"].values[0]) if "ELEMENTS" in constants else 0
    blocks = 0 if elements else int(constants["DOFS" if unit.parameters else "BLOCKS"].values[0])
    c = library.texts("c")
    sources = {name: c[name] for name in (f"{library.name}.c", f"{library.name}.h")}
    values = {
        "name": library.name,
        "upper": library.name.upper(),
        "version": cra_sym.__version__,
        "token": _token(library, version),
        "description": _quoted(f"{library.summary}. {frozen or library.provenance[-1]}"),
        "units": _units(unit.parameters).items(),
        "variables": _variables(blocks, elements, unit, version),
        "inputs": len(unit.inputs),
        "parameters": unit.parameters,
        "reasons": reasons(library),
        "slips": elements > 0,
        "directional": "false" if elements else "true",
    }
    made = rendered("fmu", values)
    major = version[0]
    sources |= {name: made[name] for name in ("fmu.h", f"fmi{major}.c")}
    archive: dict[str, str | bytes] = {"modelDescription.xml": made[f"modelDescription{major}.xml"]}
    archive |= {f"sources/{name}": text for name, text in sources.items()}
    archive["documentation/licenses/LICENSE.txt"] = licence()
    if major == "3":
        archive["sources/buildDescription.xml"] = made["buildDescription.xml"]
    archive |= _binary(library.name, sources, major)
    return _zipped(archive)


def _token(library: Library, version: str) -> str:
    """Return an identifier that is unique to the system."""
    import hashlib
    import uuid

    digest = hashlib.sha256(f"{version}\n{library.name}\n{library.text}".encode()).digest()
    return f"{{{uuid.UUID(bytes=digest[:16])}}}"


def _binary(name: str, sources: dict[str, str], major: str) -> dict[str, bytes]:
    """Return the shared library for this platform by its path in the archive, or nothing without a compiler."""
    compiler, machine = shutil.which("cc"), _MACHINES.get(platform.machine().lower())
    if compiler is None or sys.platform not in _SYSTEMS or machine is None:
        return {}
    system, ending = _SYSTEMS[sys.platform]
    folder = f"{machine}-{system}" if major == "3" else f"{system}64"
    with tempfile.TemporaryDirectory() as place:
        for file, text in sources.items():
            (Path(place) / file).write_text(text, encoding="utf-8")
        output = f"{name}{ending}"
        command = [compiler, *_FLAGS, *(f for f in sorted(sources) if f.endswith(".c")), "-o", output, "-lm"]
        done = subprocess.run(command, cwd=place, capture_output=True, text=True)
        if done.returncode:
            raise OSError(f"{compiler} cannot build the FMU: {done.stderr.strip().splitlines()[0]}")
        return {f"binaries/{folder}/{output}": (Path(place) / output).read_bytes()}


def _zipped(files: dict[str, str | bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in sorted(files.items()):
            entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, content)
    return buffer.getvalue()
