"""Writing: all or nothing, and never over somebody else's files."""

import errno
import json
import os
import shutil
import signal
import stat
import subprocess
import sys
import time

import pytest

from cra_sym import files
from cra_sym.files import OutputError, draft, staged_directory, write_text

locks = pytest.mark.skipif(sys.platform == "win32", reason="folders are locked the POSIX way")


def fill(target, **files):
    with staged_directory(target) as folder:
        for name, text in files.items():
            (folder / name).write_text(text)


def contents(folder):
    return {path.name: path.read_text() for path in folder.iterdir() if path.name != "manifest.json"}


def test_text_is_replaced_whole(tmp_path):
    path = tmp_path / "a file.txt"
    write_text(path, "first\n")
    write_text(path, "λ\n")
    assert path.read_bytes() == "λ\n".encode()
    assert list(tmp_path.iterdir()) == [path]


def test_new_and_empty_directories_are_filled(tmp_path):
    for name in ("new", "deep/er", "empty"):
        (tmp_path / "empty").mkdir(exist_ok=True)
        fill(tmp_path / name, a="1")
        assert contents(tmp_path / name) == {"a": "1"}
    assert json.loads((tmp_path / "new" / "manifest.json").read_text()) == {"made by": "cra_sym", "files": ["a"]}


def test_an_earlier_output_is_replaced_as_a_whole(tmp_path):
    fill(tmp_path / "out", a="1", b="1")
    fill(tmp_path / "out", b="2")
    assert contents(tmp_path / "out") == {"b": "2"}
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_failure_leaves_everything_as_it_was(tmp_path):
    fill(tmp_path / "out", a="1")
    with pytest.raises(RuntimeError), staged_directory(tmp_path / "out") as folder:
        (folder / "a").write_text("2")
        raise RuntimeError
    assert contents(tmp_path / "out") == {"a": "1"}
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_foreign_files_are_safe(tmp_path):
    fill(tmp_path / "out", a="1")
    (tmp_path / "out" / "thesis.tex").write_text("mine")
    with pytest.raises(OutputError, match=r"out.*'thesis\.tex'.*must be"), staged_directory(tmp_path / "out"):
        pytest.fail("no work before the check")
    assert (tmp_path / "out" / "thesis.tex").read_text() == "mine"


def test_a_file_that_appears_meanwhile_is_safe(tmp_path):
    fill(tmp_path / "out", a="1")
    with pytest.raises(OutputError), staged_directory(tmp_path / "out") as folder:
        (folder / "a").write_text("2")
        (tmp_path / "out" / "late").write_text("mine")
    assert contents(tmp_path / "out") == {"a": "1", "late": "mine"}


def test_unusable_places_are_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match=r"file'.*not a directory"), staged_directory(tmp_path / "file"):
        pass
    with pytest.raises(OutputError, match="cannot be written"), staged_directory(tmp_path / "file" / "below"):
        pass
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe")
        with pytest.raises(OutputError, match="cannot be written"), staged_directory(tmp_path / "pipe" / "below"):
            pass
    with (
        pytest.raises(OutputError, match=r"output = '.*': (is a mount point|cannot be written)"),
        staged_directory("/"),
    ):
        pytest.fail("no work before the check")


def test_permissions_follow_the_umask(tmp_path):
    before = os.umask(0o027)
    try:
        fill(tmp_path / "out", a="1")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "out").stat().st_mode) == 0o750


def test_what_is_kept(tmp_path):
    fill(tmp_path / "out", a="1", b="1")
    (tmp_path / "out" / "mine").mkdir()
    (tmp_path / "out" / "mine" / "note").write_text("mine")
    (tmp_path / "out" / "link").symlink_to("mine")
    (tmp_path / "out" / "c").write_text("old")
    with staged_directory(tmp_path / "out", keep=True) as folder:
        (folder / "a").write_text("2")
        (folder / "c").write_text("2")
    left = {path.relative_to(tmp_path / "out").as_posix() for path in (tmp_path / "out").rglob("*")}
    assert left == {"a", "c", "link", "mine", "mine/note", "manifest.json"}
    assert json.loads((tmp_path / "out" / "manifest.json").read_text())["files"] == ["a", "c"]
    assert (tmp_path / "out" / "link" / "note").read_text() == "mine" and (tmp_path / "out" / "c").read_text() == "2"


def test_a_file_in_the_way_of_a_folder_is_safe(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "src").write_text("mine")
    with (
        pytest.raises(OutputError, match="'src' cannot be kept"),
        staged_directory(tmp_path / "out", keep=True) as folder,
    ):
        (folder / "src").mkdir()
        (folder / "src" / "a").write_text("1")
    assert contents(tmp_path / "out") == {"src": "mine"}


@pytest.mark.parametrize("calls", [1, 2])
@pytest.mark.parametrize("error", [OSError, KeyboardInterrupt])
def test_an_interrupted_exchange_is_undone(tmp_path, monkeypatch, calls, error):
    fill(tmp_path / "out", a="1")
    rename, left = os.rename, [calls]

    def failing(*paths):
        left[0] -= 1
        if left[0] == 0:
            raise error
        rename(*paths)

    with pytest.raises(error), staged_directory(tmp_path / "out") as folder:
        (folder / "a").write_text("2")
        monkeypatch.setattr(os, "rename", failing)
    assert contents(tmp_path / "out") == {"a": "1"}
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_failure_takes_the_folders_above_along(tmp_path):
    with pytest.raises(KeyboardInterrupt), staged_directory(tmp_path / "deep" / "er"):
        raise KeyboardInterrupt
    assert not list(tmp_path.iterdir())


def test_a_file_is_made_in_one_step_with_the_folders_above(tmp_path):
    place = tmp_path / "new folder" / "λ.svg"
    with draft(place) as here:
        assert here.name == place.name and not place.exists()
        here.write_text("<svg/>")
    assert place.read_text() == "<svg/>" and list(place.parent.iterdir()) == [place]
    with pytest.raises(ZeroDivisionError), draft(place) as here:
        here.write_text("half")
        raise ZeroDivisionError
    assert place.read_text() == "<svg/>" and list(place.parent.iterdir()) == [place]


@pytest.mark.parametrize("path", [None, 3, "nul\0", "\ud800x"])
def test_what_is_no_path_is_named(path):
    with pytest.raises((TypeError, ValueError), match=r"output = .*must be a path"):
        write_text(path, "")
    with pytest.raises((TypeError, ValueError), match=r"output = .*must be a path"), staged_directory(path):
        pass


@pytest.fixture
def little_disk():
    """Let no file grow beyond 1 kB, as on a full disk: what is written up to there stays."""
    resource = pytest.importorskip("resource", reason="the size of files is limited the Unix way")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1024, limits[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def test_a_full_disk_leaves_what_there_was_and_is_named(tmp_path, little_disk):
    fill(tmp_path / "out", a="1")
    write_text(tmp_path / "file", "old")
    with pytest.raises(OutputError, match=rf"output = '{tmp_path}/out': cannot be written \(File too large\)"):
        fill(tmp_path / "out", a="2", b="x" * 2000)
    with pytest.raises(OutputError, match=rf"output = '{tmp_path}/file': cannot be written"):
        write_text(tmp_path / "file", "x" * 2000)
    with pytest.raises(OutputError, match=rf"'{tmp_path}/out/deep/file'"), staged_directory(tmp_path / "out") as folder:
        write_text(folder / "deep" / "file", "x" * 2000)
    assert contents(tmp_path / "out") == {"a": "1"} and (tmp_path / "file").read_text() == "old"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "out"]


def test_a_full_disk_is_named_when_folders_are_copied(tmp_path):
    (tmp_path / "source").mkdir()
    with (
        pytest.raises(OutputError, match=r"out': cannot .*No space .*/out/copy/a"),
        staged_directory(tmp_path / "out") as folder,
    ):
        raise shutil.Error([("source/a", str(folder / "copy" / "a"), f"No space left on device: '{folder}/copy/a'")])
    assert [path.name for path in tmp_path.iterdir()] == ["source"]


def test_a_disk_that_cannot_be_written_is_named(tmp_path, monkeypatch):
    def closed(path, *_, **__):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))

    monkeypatch.setattr(os, "mkdir", closed)
    for write in (lambda: write_text(tmp_path / "out", ""), lambda: fill(tmp_path / "out", a="1")):
        with pytest.raises(OutputError, match=rf"output = '{tmp_path}/out': cannot be written \(Read-only file system"):
            write()


def test_errors_about_other_places_stay_what_they_are(tmp_path):
    with pytest.raises(FileNotFoundError, match="elsewhere"), staged_directory(tmp_path / "out"):
        open(tmp_path / "elsewhere")


def test_a_manifest_of_somebody_else_tells_nothing(tmp_path):
    """Other programs list their files in a manifest.json too; and one may be a pipe, which nobody writes to."""
    for text in ('{"files": ["mine"]}', "[" * 10**5, "[]", '{"made by": "cra_sym", "files": 3}'):
        (tmp_path / "out").mkdir(exist_ok=True)
        (tmp_path / "out" / "mine").write_text("mine")
        (tmp_path / "out" / "manifest.json").write_text(text)
        with pytest.raises(OutputError, match="did not write"), staged_directory(tmp_path / "out"):
            pytest.fail("no work before the check")
    if hasattr(os, "mkfifo"):
        (tmp_path / "out" / "manifest.json").unlink()
        os.mkfifo(tmp_path / "out" / "manifest.json")
        with pytest.raises(OutputError, match="did not write"), staged_directory(tmp_path / "out"):
            pytest.fail("no work before the check")


def test_the_working_folder_is_refused(tmp_path, monkeypatch):
    """Who stands in a folder that is replaced stands in one that is gone."""
    fill(tmp_path / "out", a="1")
    (tmp_path / "out" / "below").mkdir()
    for here in ("out", "out/below"):
        monkeypatch.chdir(tmp_path / here)
        with pytest.raises(OutputError, match="is the working folder or holds it"), staged_directory(tmp_path / "out"):
            pytest.fail("no work before the check")


def test_what_is_replaced_keeps_its_permissions(tmp_path):
    fill(tmp_path / "out", a="1")
    write_text(tmp_path / "file", "1")
    (tmp_path / "out").chmod(0o710)
    (tmp_path / "file").chmod(0o600)
    fill(tmp_path / "out", a="2")
    write_text(tmp_path / "file", "2")
    assert [stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ("out", "file")] == [0o710, 0o600]


def test_what_is_kept_stays_the_file_it_is(tmp_path, monkeypatch):
    """It is linked, so that no copy can be cut short; where that is not possible it is copied."""
    fill(tmp_path / "out", a="1")
    (tmp_path / "out" / "mine").write_text("mine")
    number = (tmp_path / "out" / "mine").stat().st_ino
    with staged_directory(tmp_path / "out", keep=True):
        pass
    assert (tmp_path / "out" / "mine").stat().st_ino == number

    def impossible(*_, **__):
        raise NotImplementedError

    monkeypatch.setattr(os, "link", impossible)
    with staged_directory(tmp_path / "out", keep=True):
        pass
    assert contents(tmp_path / "out") == {"mine": "mine"}


@pytest.mark.parametrize("locked", ["nothing", "everything"])
def test_where_locks_tell_nothing_age_does(tmp_path, monkeypatch, locked):
    """What is a day old is cleared away where folders cannot be locked; where somebody never lets go, nobody hangs."""
    ages = {".out.cra_sym-01234567": 90_000, ".out.cra_sym-89abcdef": 3_000}
    for name, age in ages.items():
        (tmp_path / name).mkdir()
        os.utime(tmp_path / name, (time.time() - age,) * 2)

    def answer(folder, patience):
        if locked == "everything" and (folder == tmp_path or folder.name in ages):
            raise BlockingIOError
        return None

    monkeypatch.setattr(files, "_locked", answer)
    fill(tmp_path / "out", a="1") if locked == "nothing" else write_text(tmp_path / "out", "1")
    left = {path.name for path in tmp_path.iterdir() if path.name.startswith(".")}
    assert left == ({".out.cra_sym-89abcdef"} if locked == "nothing" else ages.keys())


@locks
def test_a_lock_that_is_never_let_go_is_waited_for_not_for_ever(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "_PATIENCE", 0.02)
    held = files._locked(tmp_path, 0.0)
    with pytest.raises(BlockingIOError):
        files._locked(tmp_path, 0.01)
    fill(tmp_path / "out", a="1")
    os.close(held)
    assert contents(tmp_path / "out") == {"a": "1"}


def test_a_signal_while_it_is_cleared_away_leaves_nothing(tmp_path, monkeypatch):
    whole, signals = files._discard, [KeyboardInterrupt]

    def interrupted(stage, target):
        if target.name == "out" and signals:
            raise signals.pop()
        whole(stage, target)

    monkeypatch.setattr(files, "_discard", interrupted)
    with pytest.raises(KeyboardInterrupt):
        fill(tmp_path / "out", a="1")
    assert contents(tmp_path / "out") == {"a": "1"} and [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_mount_point_is_refused_before_any_work(tmp_path, monkeypatch):
    (tmp_path / "out").mkdir()
    monkeypatch.setattr("pathlib.Path.is_mount", lambda self: True)
    with pytest.raises(OutputError, match="mount point"), staged_directory(tmp_path / "out"):
        pytest.fail("no work before the check")


KILLED = """
import os, sys
from cra_sym import files
rename = os.rename
def killed(*paths):
    rename(*paths)
    os.kill(os.getpid(), 9)
with files.staged_directory(sys.argv[1], keep=True) as folder:
    (folder / "a").write_text("2")
    if sys.argv[2] == "working":
        os.kill(os.getpid(), 9)
    os.rename = killed
"""


@locks
@pytest.mark.parametrize("when", ["working", "exchanging"])
def test_what_a_killed_process_left_is_cleared_away_and_nothing_is_lost(tmp_path, when):
    fill(tmp_path / "out", a="1")
    (tmp_path / "out" / "mine").write_text("mine")
    done = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path / "out"), when], check=False)
    assert done.returncode == -signal.SIGKILL
    assert any(path.name.startswith(".out") for path in tmp_path.iterdir())
    with pytest.raises(ZeroDivisionError), staged_directory(tmp_path / "out", keep=True) as folder:
        (folder / "a").write_text("3")
        raise ZeroDivisionError
    assert contents(tmp_path / "out") == {"a": "1", "mine": "mine"}
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@locks
def test_a_stage_in_use_is_left_alone(tmp_path):
    with staged_directory(tmp_path / "out") as outer:
        (outer / "a").write_text("outer")
        fill(tmp_path / "out", a="inner")
        assert (outer / "a").read_text() == "outer"
        assert contents(tmp_path / "out") == {"a": "inner"}
    assert contents(tmp_path / "out") == {"a": "outer"}
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


MANY = """
import sys
from cra_sym.files import staged_directory
for n in range(20):
    with staged_directory(sys.argv[1]) as folder:
        for name in "abc":
            (folder / name).write_text(sys.argv[2])
"""


@locks
def test_processes_that_write_to_one_place_at_once_all_succeed(tmp_path):
    command = [sys.executable, "-c", MANY, str(tmp_path / "out")]
    started = [subprocess.Popen([*command, name]) for name in "123"]
    assert [process.wait(timeout=120) for process in started] == [0, 0, 0]
    made = contents(tmp_path / "out")
    assert made.keys() == {"a", "b", "c"} and len({*made.values()}) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
