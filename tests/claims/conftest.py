"""Judging a claim afresh, past the cache, so that a test can perturb the physics first."""

import pytest

from cra_sym.claims import Setting, ledger


@pytest.fixture
def judge():
    return lambda id, arm=None, **numbers: ledger._entry(id).find(Setting.of(arm, **numbers))
