"""No way of writing a camera's password gets it into a log."""

from __future__ import annotations

import pytest

from heel.services.runtime.passwords import may_hold_unescaped, without_passwords


@pytest.mark.parametrize(
    "address",
    [
        "rtsp://admin:geheim@10.0.0.2:554/main",
        "rtsp://admin:ge@heim@10.0.0.2/",
        "rtsp://admin:ge/heim@10.0.0.2/",
        "rtsp://admin:ge?heim@10.0.0.2/",
        "rtsp://admin:ge#heim@10.0.0.2/",
        "rtsp://admin:1/geheim@10.0.0.2/",
        "http://admin:g@e#1/%heim@127.0.0.1:80/auth",
        "http://admin:geheim@[fe80::1]:80/x",
        "http://admin:geheim@[::1/x",
        "RTSP://admin:geheim@10.0.0.2/",
        "rtsp:/admin:geheim@10.0.0.2/",
        "admin:geheim@10.0.0.2/main",
        "http://10.0.0.2/video.mjpg?user=admin&pwd=geheim",
        "http://10.0.0.2/video.mjpg?PWD=geheim&user=admin",
        "http://10.0.0.2/video.cgi?loginuse=admin&loginpas=geheim",
        "http://10.0.0.2/video?u=admin&p=geheim",
        "http://10.0.0.2/video?token=geheim#now",
        "http://10.0.0.2/video?api_key=geheim",
        "rtsp://10.0.0.2:554/user=admin&password=geheim&channel=1&stream=0.sdp?",
        "rtsp://10.0.0.2:554/user=admin_password=geheim_channel=1_stream=0.sdp?real_stream",
        "rtsp://10.0.0.2/ch1?username=admin;password=ge/heim",
        "pan:rtsp://admin:geheim@10.0.0.2/?width=384",
    ],
)
@pytest.mark.parametrize("text", ["{}", "cannot open '{}' (refused)", "a walk.mp4 {}: no"])
def test_a_password_in_an_address_is_never_shown(address: str, text: str) -> None:
    shown = without_passwords(text.format(address))
    assert "heim" not in shown
    assert "***" in shown
    assert without_passwords(shown) == shown


@pytest.mark.parametrize(
    "text",
    ["rtsp://10.0.0.2:554/main?channel=1&subtype=0", "scene:demo?seed=1&people=6&frames=400",
     "pan:walk.mp4?width=384&height=288&fov_deg=60", "/data/12:30:00@home/walk.mp4",
     "tcp/127.0.0.1:7447", "no such file: walk.mp4"],
)  # fmt: skip
def test_what_holds_no_password_stays_as_it_is(text: str) -> None:
    assert without_passwords(text) == text


def test_the_rest_of_an_address_stays_readable() -> None:
    assert without_passwords("rtsp://a:b@cam.local:554/s?x=1") == "rtsp://***@cam.local:554/s?x=1"
    assert without_passwords("http://h/v?user=a&pwd=b&fps=5") == "http://h/v?user=a&pwd=***&fps=5"


@pytest.mark.parametrize(
    ("address", "expected"),
    [("rtsp://a:b@h/s", False), ("rtsp://a:b/c@h/s", True), ("rtsp://a:b@c@h/s", True),
     ("rtsp://h/s", False), ("rtsp://a:p%40%2F@h/s", False)],
)  # fmt: skip
def test_characters_that_had_to_be_escaped_are_noticed(address: str, expected: bool) -> None:
    assert may_hold_unescaped(address) is expected
