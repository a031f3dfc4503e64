"""Termination of commands: one-line errors, exit codes, and clean-up on signals."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from io import TextIOWrapper
from threading import Timer, current_thread, main_thread
from types import FrameType

from cra_sym.files import OutputError

__all__ = ["Ended", "orderly_ending", "run_command"]

_SOON = 0.01  # s, after which a destructor or a callback has most likely returned
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
    """Raise :class:`Ended` in the block on Ctrl-C (SIGINT), a closed terminal (SIGHUP) or SIGTERM.

    Ignored signals stay ignored (``nohup``), and further ones are ignored while the first is handled. Where Python
    ignores exceptions, as in a destructor or a callback of the garbage collector, the signal is sent again until it is
    raised elsewhere. Outside the main thread, where Python receives no signals, nothing changes.
    """
    heard = {}
    if current_thread() is main_thread():
        heard = {number: signal.getsignal(number) for number in _SIGNALS}
        heard = {number: handler for number, handler in heard.items() if handler not in (signal.SIG_IGN, None)}

    repeats: list[Timer] = []

    def end(number: int, _: FrameType | None) -> None:
        forget()
        for other in heard:
            signal.signal(other, signal.SIG_IGN)
        raise Ended(number)

    def again(lost: sys.UnraisableHookArgs) -> None:
        if isinstance(lost.exc_value, Ended):
            number = lost.exc_value.number
            signal.signal(number, end)
            repeats.append(Timer(_SOON, os.kill, (os.getpid(), number)))
            repeats[-1].start()
        else:
            unraisable(lost)

    def forget() -> None:
        while repeats:
            repeats.pop().cancel()

    unraisable = sys.unraisablehook
    for number in heard:
        signal.signal(number, end)
    try:
        if heard:
            sys.unraisablehook = again
        yield
    finally:
        forget()
        if heard:
            sys.unraisablehook = unraisable
        for number, handler in heard.items():
            signal.signal(number, handler)


def run_command(name: str, job: Callable[[], object]) -> int:
    """Run a job and return the exit code: 0, that of an expected error, or 128 plus the number of a signal.

    An expected error is printed in one line: one whose class has an ``exit_code``, or an ``OSError`` (a location that
    cannot be read or written), with the code 2.

    Parameters
    ----------
    name : str
        Prefix of the line on standard error.
    job : callable
    """
    if isinstance(sys.stdout, TextIOWrapper):  # a terminal that cannot encode a character is not an error
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        with orderly_ending():
            job()
            _flush()
        return 0
    except BrokenPipeError:  # the reader has closed the pipe, as "head" does
        told, code = "", 141
    except (Exception, Ended) as error:
        known = getattr(error, "exit_code", 2 if isinstance(error, OSError) else None)
        if known is None:
            raise
        told, code = f"{name}: {error}\n", known
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
    """Prevent a second error at exit from a standard output that is full or closed."""
    try:
        print(end="", flush=True)
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
