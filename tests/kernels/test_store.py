"""The store returns what it saved, or nothing."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from cra_sym.kernels import store

posix = pytest.mark.skipif(os.name != "posix", reason="POSIX permissions")


@pytest.fixture
def entry(private):
    assert store.save("key", b"content\nof two lines")
    (path,) = private.iterdir()
    return path


def test_round_trip(private):
    assert store.load("key") is None
    assert store.save("key", b"first")
    assert store.save("key", b"second\n\x00")
    assert store.load("key") == b"second\n\x00"
    assert store.load("other") is None
    assert len(list(private.iterdir())) == 1


@posix
def test_closed_to_everybody_else(private, entry):
    assert stat.S_IMODE(private.stat().st_mode) == 0o700
    assert stat.S_IMODE(entry.stat().st_mode) == 0o600


@pytest.mark.parametrize("damage", [b"", b"x", b"no tag\ncontent", b"\n" * 9])
def test_damage_is_a_miss_and_heals(entry, damage):
    entry.write_bytes(damage)
    assert store.load("key") is None
    assert store.save("key", b"new")
    assert store.load("key") == b"new"


def test_each_changed_byte_is_a_miss(entry):
    good = entry.read_bytes()
    for place in range(len(good)):
        entry.write_bytes(good[:place] + bytes([good[place] ^ 1]) + good[place + 1 :])
        assert store.load("key") is None
    entry.write_bytes(good)
    assert store.load("key") is not None


def test_an_entry_of_another_key_is_a_miss(private, entry):
    planted = entry.read_bytes()
    store.save("victim", b"true")
    (victim,) = set(private.iterdir()) - {entry}
    victim.write_bytes(planted)
    assert store.load("victim") is None


@posix
@pytest.mark.parametrize("mode", [0o620, 0o604, 0o660, 0o777])
def test_a_file_open_to_others_is_a_miss(entry, mode):
    entry.chmod(mode)
    assert store.load("key") is None


@posix
@pytest.mark.parametrize("mode", [0o770, 0o707, 0o777, 0o755])
def test_a_directory_open_to_others_is_not_used(private, entry, mode):
    private.chmod(mode)
    assert store.load("key") is None
    assert not store.save("key", b"x")
    private.chmod(0o700)
    assert store.load("key") is not None


@posix
def test_links_are_not_followed(private, entry, tmp_path):
    moved = tmp_path / "elsewhere"
    entry.rename(moved)
    entry.symlink_to(moved)
    assert store.load("key") is None
    entry.unlink()
    os.link(moved, entry)
    assert store.load("key") is None
    entry.unlink()
    os.mkfifo(entry, 0o600)
    assert store.load("key") is None
    entry.unlink()
    private.rename(tmp_path / "real")
    private.symlink_to(tmp_path / "real")
    assert not store.save("key", b"x")


@posix
def test_a_foreign_owner_is_a_miss(entry, monkeypatch):
    monkeypatch.setattr(os, "geteuid", lambda: entry.stat().st_uid + 1)
    assert store.load("key") is None
    assert not store.save("key", b"x")


def test_where_nothing_can_be_written(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("not a directory")
    monkeypatch.setattr(store, "directory", lambda: tmp_path / "file" / "cra_sym")
    assert not store.save("key", b"x")
    assert store.load("key") is None


def test_a_full_disk_leaves_nothing_behind(private):
    resource = pytest.importorskip("resource", reason="the size of files is limited the Unix way")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1024, limits[1]))
    try:
        assert not store.save("key", 2000 * b"x")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert list(private.iterdir()) == []


KILLED = """
import builtins, os
from cra_sym.kernels import store
def cut(descriptor, _):
    os.write(descriptor, b"4fa0")
    os.kill(os.getpid(), 9)
builtins.open = cut
store.save("key", b"content")
"""


@posix
def test_a_killed_process_leaves_a_miss_and_nothing_beside_it(private, entry):
    """The file it was writing is cut short; the next one who saves makes it whole."""
    whole = entry.read_bytes()
    assert subprocess.run([sys.executable, "-c", KILLED], check=False).returncode == -9
    assert list(private.iterdir()) == [entry] and entry.read_bytes() == b"4fa0"
    assert store.load("key") is None
    assert store.save("key", b"content\nof two lines") and entry.read_bytes() == whole


def test_somebody_else_who_saves_just_now_is_left_alone(private, entry, monkeypatch):
    monkeypatch.setattr(Path, "unlink", lambda *_, **__: None)
    assert not store.save("key", b"x")
    assert store.load("key") == b"content\nof two lines"


def test_without_a_home(monkeypatch):
    def homeless():
        raise RuntimeError("no home directory")

    monkeypatch.setattr(Path, "home", homeless)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.delenv("LOCALAPPDATA", raising=False)
    assert not store.save("key", b"x")
    assert store.load("key") is None


@pytest.mark.parametrize(
    ("system", "variable", "tail"),
    [
        ("linux", "XDG_CACHE_HOME", "there/cra_sym"),
        ("win32", "LOCALAPPDATA", "there/cra_sym"),
        ("darwin", None, "Library/Caches/cra_sym"),
        ("linux", None, ".cache/cra_sym"),
        ("win32", None, "AppData/Local/cra_sym"),
    ],
)
def test_each_platform_has_its_place(system, variable, tail, monkeypatch, tmp_path):
    monkeypatch.setattr(sys, "platform", system)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.delenv("LOCALAPPDATA", raising=False)
    if variable:
        monkeypatch.setenv(variable, str(tmp_path / "there"))
    assert store.directory().as_posix().endswith(tail)
