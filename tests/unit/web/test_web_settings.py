from __future__ import annotations

import pytest

from heel.schemas import SettingsError
from heel.services.runtime.settings import load_settings
from heel.services.web.settings import WebServiceSettings


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.9", "::1", "localhost"])
def test_loopback_needs_no_permission(host: str) -> None:
    assert WebServiceSettings(host=host).host == host


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.7", "::", "robot.local", ""])
def test_any_other_host_needs_insecure_by_name(host: str) -> None:
    with pytest.raises(SettingsError, match="--insecure") as caught:
        load_settings("web", WebServiceSettings, {"web": {"host": host}})
    assert "\n" not in str(caught.value)
    allowed = {"web": {"host": host, "insecure": True}}
    assert load_settings("web", WebServiceSettings, allowed).service.host == host


def test_names_must_be_host_names() -> None:
    assert WebServiceSettings(names="robot.local, robot.example:443").names == (  # type: ignore[arg-type]
        "robot.local",
        "robot.example:443",
    )
    with pytest.raises(SettingsError, match="host name"):
        load_settings("web", WebServiceSettings, {"web": {"names": "http://robot/"}})


def test_an_unknown_key_is_named() -> None:
    with pytest.raises(SettingsError, match="max_fps"):
        load_settings("web", WebServiceSettings, {"web": {"maxfps": 3}})
