"""How a command ends: one line about what was wrong, an exit code, and nothing half made, whoever ends it."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from io import TextIOWrapper
from threading import current_thread, main_thread
from typing import Any

from cra_sym.files import OutputError

__all__ = ["Ended", "orderly_ending", "run_command"]

_SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


class Ended(SystemExit):
    """A signal ended the run; the exit code is 128 plus its number, as of a shell."""

    def __init__(self, number: int) -> None:
        super().__init__(128 + number)
        self.number, self.exit_code = number, 128 + number

    def __str__(self) -> str:
        return f"ended by {signal.Signals(self.number).name}"


@contextmanager
def orderly_ending() -> Iterator[None]:
    """Raise :class:`Ended` where the block stands when Ctrl-C is pressed, the terminal closes or the system asks.

    A signal that is ignored stays so (``nohup``), and while the first one is obeyed no second one disturbs. Outside the
    main thread, where Python hears no signals, nothing changes.
    """
    heard = {}
    if current_thread() is main_thread():
        heard = {number: signal.getsignal(number) for number in _SIGNALS}
        heard = {number: handler for number, handler in heard.items() if handler not in (signal.SIG_IGN, None)}

    def end(number: int, _: Any) -> None:
        for other in heard:
            signal.signal(other, signal.SIG_IGN)
        raise Ended(number)

    for number in heard:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number, handler in heard.items():
            signal.signal(number, handler)


def run_command(name: str, job: Callable[[], Any], codes: Mapping[type[Exception], int]) -> int:
    """Do a job and return the exit code: 0, that of a foreseen error, or 128 plus the number of a signal.

    Parameters
    ----------
    name : str
        What the line on standard error begins with.
    job : callable
    codes : mapping of exception class to int
        Errors to say in a line, besides a place that cannot be read or written, which is 2.
    """
    codes = {**codes, OutputError: 2, OSError: 2}
    if isinstance(sys.stdout, TextIOWrapper):  # a terminal without a letter for it is no reason to fail
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        with orderly_ending():
            job()
            _flush()
        return 0
    except Ended as end:
        told, code = f"{name}: {end}\n", end.exit_code
    except BrokenPipeError:  # who reads has read enough, as "head" does
        told, code = "", 141
    except tuple(codes) as error:
        told, code = f"{name}: {error}\n", next(codes[kind] for kind in codes if isinstance(error, kind))
    if sys.stderr is not None:
        with suppress(OSError):
            sys.stderr.write(told)
    _give_up_a_closed_output()
    return code


def _flush() -> None:
    try:
        print(end="", flush=True)
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OutputError(f"standard output: cannot be written ({error.strerror})") from None


def _give_up_a_closed_output() -> None:
    """Keep Python from complaining once more, at its very end, of a standard output that is full or was closed."""
    try:
        print(end="", flush=True)
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
