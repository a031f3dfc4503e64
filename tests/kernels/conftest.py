"""A cache directory of its own for every test that asks, shared with the processes it starts."""

from __future__ import annotations

import pytest

from cra_sym.kernels import store


@pytest.fixture
def private(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(store, "directory", lambda: tmp_path / "cra_sym")
    return tmp_path / "cra_sym"
