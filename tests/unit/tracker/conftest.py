"""Scene tests keep what they were given if they fail."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def _kept(kept_if_it_fails: None) -> None:
    """For every test of this folder."""
