"""How commands end: by signals, full disks and closed outputs, with a line, a code and nothing half made."""

import errno
import os
import signal
import subprocess
import sys
import time

import pytest

from cra_sym.__main__ import COMMANDS, main
from cra_sym.codegen import exporter
from cra_sym.ending import Ended, orderly_ending, run_command

posix = pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
SLOW = """
import signal, sys, time
for number in (signal.SIGHUP, signal.SIGINT, signal.SIGTERM):
    signal.signal(number, signal.SIG_DFL)  # whoever runs the tests may ignore it, as nohup and & do

from cra_sym.ending import run_command
from cra_sym.files import staged_directory

def job():
    with staged_directory(sys.argv[1]) as folder:
        (folder / "half").write_text("made")
        print("ready", flush=True)
        time.sleep(60)

sys.exit(run_command("slow", job))
"""


@posix
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_leaves_nothing_half_made(name, tmp_path):
    command = [sys.executable, "-c", SLOW, str(tmp_path / "out")]
    with subprocess.Popen(command, stdout=-1, stderr=-1, text=True) as process:
        assert process.stdout.readline() == "ready\n"
        process.send_signal(signal.Signals[name])
        _, said = process.communicate(timeout=60)
    assert (process.returncode, said) == (128 + signal.Signals[name], f"slow: ended by {name}\n")
    assert not list(tmp_path.iterdir())


@pytest.fixture
def heard():
    """SIGINT is not ignored, as it is for what nohup and & run."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@posix
@pytest.mark.usefixtures("heard")
def test_a_signal_before_a_command_runs_is_told_in_a_line(monkeypatch, capsys):
    """While modules are imported, and options are looked up."""

    def interrupted(parser):
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setitem(COMMANDS, "frequencies", COMMANDS["frequencies"]._replace(options=interrupted))
    assert main(["frequencies"]) == 128 + signal.SIGINT
    assert capsys.readouterr() == ("", "python -m cra_sym frequencies: ended by SIGINT\n")


@posix
@pytest.mark.usefixtures("heard")
def test_a_signal_in_a_destructor_is_raised_after_it():
    """Where Python ignores exceptions, and again in the next destructor."""

    class Interrupted:
        def __del__(self):
            signal.raise_signal(signal.SIGINT)
            time.sleep(0.001)

    hook = sys.unraisablehook
    with pytest.raises(Ended, match="SIGINT"), orderly_ending():
        Interrupted()
        Interrupted()
        time.sleep(10.0)
    assert sys.unraisablehook is hook


def test_handlers_return_to_what_they_were():
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    with orderly_ending():
        assert signal.getsignal(signal.SIGTERM) != before[1]
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before


@posix
def test_an_ignored_signal_stays_ignored():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with orderly_ending():
            signal.raise_signal(signal.SIGHUP)
    finally:
        signal.signal(signal.SIGHUP, before)


def test_foreseen_errors_have_their_codes(capsys):
    class ForeseenError(Exception):
        exit_code = 7

    def fail(error):
        raise error

    assert run_command("name", lambda: fail(ForeseenError("no"))) == 7
    assert capsys.readouterr() == ("", "name: no\n")
    with pytest.raises(KeyError):
        run_command("name", lambda: fail(KeyError()))


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs /dev/full")
def test_a_full_or_closed_output_is_said_in_a_line():
    command = [sys.executable, "-m", "cra_sym", "frequencies", "--csv"]
    with open("/dev/full", "w") as full:
        done = subprocess.run(command, stdout=full, stderr=-1, text=True, check=False)
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and "No space left on device" in done.stderr


def test_letters_that_the_output_does_not_know_are_written_otherwise():
    job = "from cra_sym.ending import run_command; raise SystemExit(run_command('n', lambda: print('λ')))"
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = subprocess.run([sys.executable, "-c", job], env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "\\u03bb\n", "")


WRITING = {
    "export": ["export", "python", "{}"],
    "figures": ["figures", "--only", "fig02", "--output", "{}"],
    "reproduce": ["reproduce", "--output", "{}"],
}


@pytest.mark.parametrize("command", WRITING)
@pytest.mark.parametrize("disk", ["full", "read-only"])
def test_every_command_that_writes_names_the_place_and_leaves_nothing(command, disk, tmp_path, capsys, monkeypatch):
    resource = pytest.importorskip("resource", reason="the size of files is limited the Unix way")
    monkeypatch.setattr(
        exporter, "_arm_texts", lambda language, *options: {"README.md": "", f"arm.{language}": 2000 * "x"}
    )
    arguments = [word.format(tmp_path / "out put") for word in WRITING[command]]
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    if disk == "full":
        resource.setrlimit(resource.RLIMIT_FSIZE, (1024, limits[1]))
    else:

        def closed(path, *_, **__):
            raise OSError(errno.EROFS, "Read-only file system", str(path))

        monkeypatch.setattr("os.mkdir", closed)
    try:
        code = main(arguments)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    out, err = capsys.readouterr()
    assert code == 2 and out == "" and err.count("\n") == 1
    assert (
        err.startswith(f"python -m cra_sym {command}: output = '{tmp_path / 'out put'}") and "cannot be written" in err
    )
    assert not list(tmp_path.iterdir())
