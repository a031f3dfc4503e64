"""Writing: all or nothing, and never over somebody else's files."""

import json
import os
import stat

import pytest

from cra_sym.files import OutputError, staged_directory, write_text


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
    assert json.loads((tmp_path / "new" / "manifest.json").read_text()) == {"files": ["a"]}


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
    with pytest.raises(OutputError, match=r"out.*'thesis\.tex'.*allowed are"), staged_directory(tmp_path / "out"):
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
    assert json.loads((tmp_path / "out" / "manifest.json").read_text()) == {"files": ["a", "c"]}
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
