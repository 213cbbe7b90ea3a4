"""Shared memory is used only by processes that may lock all of it."""

from __future__ import annotations

import json
import resource

import pytest

from heel.services.runtime import process
from heel.services.runtime.router import RouterSettings, router_config
from heel.services.runtime.session import zenoh_config
from heel.services.runtime.settings import ZenohSettings


@pytest.mark.parametrize(
    ("limit_bytes", "privileged", "allowed"),
    [
        (resource.RLIM_INFINITY, False, True),
        (1 << 30, False, True),
        (8 << 20, False, False),
        (0, True, True),
    ],
)
def test_shared_memory_needs_the_right_to_lock_it(
    limit_bytes: int, privileged: bool, allowed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(resource, "getrlimit", lambda _: (limit_bytes, limit_bytes))
    monkeypatch.setattr(process, "_may_ignore_limit", lambda: privileged)
    assert process.may_lock_memory() is allowed
    for config in (zenoh_config(ZenohSettings()), router_config(RouterSettings())):
        assert json.loads(config.get_json("transport/shared_memory/enabled")) is allowed
