"""The command line: ``python -m cra_sym COMMAND``. Each command is one row of a table and one function."""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from cra_sym.ending import run_command
from cra_sym.files import OutputError

if TYPE_CHECKING:
    from cra_sym.arm.parameters import Arm

__all__ = ["main"]

Options = argparse.Namespace
_PROGRAM = "python -m cra_sym"


class UsageError(ValueError):
    """A value given on the command line that is not allowed."""

    exit_code = 2


@contextmanager
def _reading_input() -> Iterator[None]:
    """Convert the package's errors about a value to a usage error."""
    try:
        yield
    except OutputError:
        raise
    except (ValueError, TypeError) as error:
        raise UsageError(str(error)) from error


class Command(NamedTuple):
    """A command: its one-line summary, the options it adds to its parser, and the function that runs it."""

    summary: str
    options: Callable[[argparse.ArgumentParser], None]
    run: Callable[[Options], None]


def _add_output(parser: argparse.ArgumentParser, default: str) -> None:
    parser.add_argument(
        "--output", metavar="DIR", type=Path, default=Path(default), help="folder to make (%(default)s)"
    )


def _reproduce_options(parser: argparse.ArgumentParser) -> None:
    _add_output(parser, "output")
    parser.add_argument("--notebooks", metavar="DIR", type=Path, help="folder of the notebooks (that of the checkout)")


def _reproduce(options: Options) -> None:
    from cra_sym.report.run import reproduce

    print(reproduce(options.output, notebooks=options.notebooks))


def _site_options(parser: argparse.ArgumentParser) -> None:
    _add_output(parser, "site")
    parser.add_argument("--notebooks", metavar="DIR", type=Path, help="folder of the notebooks (that of the checkout)")


def _site(options: Options) -> None:
    from cra_sym.report.run import site

    print(site(options.output, notebooks=options.notebooks))


def _figures_options(parser: argparse.ArgumentParser) -> None:
    from cra_sym.figures import FIGURES

    _add_output(parser, "figures")
    parser.add_argument("--only", nargs="+", choices=sorted(FIGURES), metavar="FIG", help=f"of {', '.join(FIGURES)}")
    _arm_options(parser)


def _figures(options: Options) -> None:
    from cra_sym.files import staged_directory
    from cra_sym.report.pictures import save_figures

    with _reading_input():
        arm = _changed_arm(options)
    with staged_directory(options.output) as folder, _reading_input():
        made = save_figures(folder, options.only, arm=arm)
    print("\n".join(str(options.output / path.name) for path in made))


def _arm_options(parser: argparse.ArgumentParser) -> None:
    """One option a field of ``Arm``, its meaning and unit read from the nomenclature."""
    from cra_sym.arm.parameters import Arm
    from cra_sym.symbols import nomenclature

    rows = {row.name: row for row in nomenclature()}
    nominal = Arm.nominal()
    group = parser.add_argument_group("the arm (SI units; inf is a stiffness too; the nominal value is the default)")
    for field in dataclasses.fields(Arm):
        row = rows[field.name]
        unit = f", {row.unit}" if row.unit != "1" else ""
        text = f"{row.meaning}{unit} ({getattr(nominal, field.name):g})"
        group.add_argument(f"--{field.name.replace('_', '-')}", type=float, metavar=row.unit, help=text)


def _chosen_arm(options: Options) -> Arm:
    return _changed_arm(options) or _nominal()


def _changed_arm(options: Options) -> Arm | None:
    """Return the arm of the options, or None if none of its parameters is given."""
    given = {f.name: getattr(options, f.name) for f in dataclasses.fields(_nominal())}
    given = {name: value for name, value in given.items() if value is not None}
    return _nominal().replace(**given) if given else None


def _nominal() -> Arm:
    from cra_sym.arm.parameters import Arm

    return Arm.nominal()


def _modes_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--modes", type=int, default=3, metavar="N", help="number of modes (%(default)s)")
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true", help="print JSON")
    form.add_argument("--csv", action="store_true", help="print comma-separated values")
    _arm_options(parser)


def _print_modes(options: Options, title: str, columns: dict[str, Any], digits: int = 6) -> None:
    """Print one row per mode, in the requested form."""
    from cra_sym.report.tables import Table

    if options.json:
        print(json.dumps({head.partition(" / ")[0]: values.tolist() for head, values in columns.items()}))
        return
    rows = [(n, *map(float, row)) for n, row in enumerate(zip(*columns.values(), strict=True), 1)]
    table = Table(title, ("mode", *columns), rows, digits)
    print(table.csv() if options.csv else table.text(), end="")


def _frequencies(options: Options) -> None:
    from cra_sym import modal_parameters

    with _reading_input():
        modal = modal_parameters(_chosen_arm(options), modes=options.modes)
    columns = {"frequency / Hz": modal.frequency, "omega / (rad/s)": modal.omega, "lambda": modal.lam}
    _print_modes(options, "Natural frequencies", columns)


def _certify(options: Options) -> None:
    from cra_sym import certify

    with _reading_input():
        proof = certify(_chosen_arm(options), modes=options.modes)
    if not proof.complete:
        raise UsageError("nothing is proved for this arm: its parameters are too extreme for the certificate")
    columns = {"lower / Hz": proof.lower, "upper / Hz": proof.upper}
    _print_modes(options, "Certified natural frequencies", columns, digits=17)
    if not (options.json or options.csv):
        print("Proved: each frequency lies between its bounds, and none is missed.")


def _claims_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("id", nargs="*", metavar="ID", help="claims to judge, such as C03 (all)")
    parser.add_argument(
        "--slipping", action="store_true", help="ask those again that a bolted joint that slips changes"
    )
    parser.add_argument("--json", action="store_true", help="print JSON, evidence included")
    _arm_options(parser)


def _claims(options: Options) -> None:
    from cra_sym.claims import claim, claims
    from cra_sym.claims.slipping import slipping_claim, slipping_claims
    from cra_sym.claims.table import verdict_text

    one, every = (slipping_claim, slipping_claims) if options.slipping else (claim, claims)
    with _reading_input():
        arm = _chosen_arm(options)
        verdicts = [one(id, arm) for id in options.id] if options.id else every(arm)
    print(json.dumps([v.as_dict() for v in verdicts], indent=1) if options.json else verdict_text(verdicts))


def _export_options(parser: argparse.ArgumentParser) -> None:
    from cra_sym.codegen.library import PRINTERS

    parser.add_argument("language", choices=PRINTERS, metavar="LANGUAGE", help=f"of {', '.join(PRINTERS)}")
    parser.add_argument("directory", metavar="DIR", type=Path, help="folder to make")
    parser.add_argument("--force", action="store_true", help="write into a folder that is not empty")


def _export(options: Options) -> None:
    from cra_sym import export

    print(export(options.language, options.directory, overwrite=options.force))


COMMANDS = {
    "export": Command("write the arm as tested source code of another language", _export_options, _export),
    "reproduce": Command("run every notebook; write them, figures, tables and site", _reproduce_options, _reproduce),
    "site": Command("write the site of the notebooks as they are stored", _site_options, _site),
    "claims": Command("judge the paper's claims", _claims_options, _claims),
    "figures": Command("draw the figures as PNG and SVG", _figures_options, _figures),
    "frequencies": Command("natural frequencies of an arm", _modes_options, _frequencies),
    "certify": Command("natural frequencies with a proof that none is missed", _modes_options, _certify),
}


class _Parser(argparse.ArgumentParser):
    """A parser with one-line errors."""

    def error(self, message: str) -> None:  # type: ignore[override]
        self.exit(2, f"{self.prog}: {' '.join(message.split())}\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; return its exit code.

    0 is success, 2 an invalid input or output location (with one line on standard error), 1 a notebook that failed, and
    128 plus the signal number a run ended by a signal, also while modules are imported.
    """
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    command = next((word for word in arguments if word in COMMANDS), "")
    return run_command(f"{_PROGRAM} {command}".strip(), lambda: _run(arguments))


def _run(arguments: Sequence[str]) -> None:
    import cra_sym

    parser = _Parser(prog=_PROGRAM, description="Dynamics and stability of a flexible Cartesian robotic arm.")
    parser.add_argument("--version", action="version", version=f"cra_sym {cra_sym.__version__}")
    commands = parser.add_subparsers(title="commands", dest="command", metavar="COMMAND", required=True)
    for name, command in COMMANDS.items():
        sub = commands.add_parser(
            name, help=command.summary, description=f"{command.summary[0].upper()}{command.summary[1:]}."
        )
        if name in arguments:  # options are looked up in the package: only those of the command that runs
            command.options(sub)
        sub.set_defaults(run=command.run)
    options = parser.parse_args(arguments)
    options.run(options)


if __name__ == "__main__":
    sys.exit(main())
