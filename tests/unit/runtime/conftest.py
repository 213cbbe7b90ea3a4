"""A router for the tests that need one, and sessions of two clients."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
import zenoh

from tests.support import network


@pytest.fixture(scope="session")
def endpoint() -> Iterator[str]:
    with network.router() as address:
        yield address


@pytest.fixture(scope="session")
def sender(endpoint: str) -> Iterator[zenoh.Session]:
    with network.client(endpoint) as session:
        yield session


@pytest.fixture(scope="session")
def receiver(endpoint: str) -> Iterator[zenoh.Session]:
    with network.client(endpoint) as session:
        yield session
