"""What `heel doctor` makes of the facts: every finding has a cause and a next step."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from heel.schemas import CameraInfo, Health
from heel.services.commands.doctor.command import lines
from heel.services.commands.doctor.facts import (
    BusFacts,
    CameraFacts,
    Facts,
    MachineFacts,
    ModelFacts,
    RouterFacts,
)
from heel.services.commands.doctor.findings import Finding, findings

ENDPOINT = "tcp/127.0.0.1:7447"
MACHINE = MachineFacts(
    cores=4, load=0.5, may_lock=True, locked_bytes=None, shared_bytes=512 << 20, shared_share=0.1,
    shared_problem=None, missing={"neural": (), "sim": (), "eval": ()},
    free_bytes={"/tmp": 50 << 30}, ports={8470: True}, run_folder=None, version="1.0",
)  # fmt: skip
ROUTER = RouterFacts(ENDPOINT, True, "zenoh", True, versions={"heel": "1.0", "zenoh": "1.10"})
INFO = CameraInfo(
    stream="front", epoch=1, width=640, height=480, source_width=640, source_height=480, fps=25.0,
    source="x", horizontal_fov_rad=1.2, mount_height_m=0.4, mount_pitch_rad=0.0,
)  # fmt: skip


def health(service: str, **changes: object) -> Health:
    usual = Health(
        service=service, instance="main", producer=f"{service}/main@0123abcd", state="ok",
        uptime_s=9.0, loop_age_s=0.0, software_version="1.0", rate_out_hz=25.0,
    )  # fmt: skip
    return usual.model_copy(update=changes)


BUS = BusFacts((health("capture"), health("tracker")), (), {"tracker/main@0123abcd": 0.003}, INFO)
FACTS = Facts(ROUTER, MACHINE, BUS, None, ModelFacts("yolox-nano", None, 30.0, "onnxruntime"))


def about(facts: Facts, name: str) -> list[Finding]:
    return [one for one in findings(facts) if one.about == name]


def test_where_all_is_well_nothing_is_to_be_done() -> None:
    found = findings(FACTS)
    assert [one for one in found if one.level != "ok" or one.remedy] == []
    assert {one.about for one in found} == {
        "router", "services", "versions", "clocks", "shared memory", "camera", "calibration",
        "network", "extras", "ports", "disk", "processor",
    }  # fmt: skip
    assert "heel 1.0, zenoh 1.10" in about(FACTS, "router")[0].words


@pytest.mark.parametrize(
    ("router", "level", "words", "remedy"),
    [
        (RouterFacts(ENDPOINT, True, "zenoh", False), "wrong", "asks for a user", "--user NAME"),
        (RouterFacts(ENDPOINT, True, "zenoh", False, "heel"), "wrong", "another password", "users"),
        (RouterFacts(ENDPOINT, True, "refused", False), "wrong", "nothing listens", "heel router"),
        (RouterFacts(ENDPOINT, False, "refused", False), "note", "nothing runs here", "heel demo"),
        (RouterFacts(ENDPOINT, True, "other", False), "wrong", "is no Zenoh router", "--connect"),
        (RouterFacts(ENDPOINT, True, "silent", False), "wrong", "hangs", "anew"),
        (RouterFacts(ENDPOINT, True, "unreachable", False), "wrong", "no way to", "ping"),
        (RouterFacts(ENDPOINT, True, "unknown host", False), "wrong", "is not known", "name"),
        (RouterFacts("tls/x:1", True, None, False, reason="bad"), "wrong", "bad", "--connect"),
        (
            RouterFacts("quic/x:1", True, None, False, reason="bad", uncertified="no certificates"),
            "wrong",
            "quic/x:1: no certificates",
            "heel security init",
        ),
    ],
)
def test_why_no_router_lets_us_in(router: RouterFacts, level: str, words: str, remedy: str) -> None:
    [found] = about(replace(FACTS, router=router, bus=None), "router")
    assert found.level == level
    assert words in found.words
    assert remedy in found.remedy


@pytest.mark.parametrize(
    ("bus", "name", "level", "words"),
    [
        (BusFacts(), "services", "note", "none is heard"),
        (replace(BUS, problems=("two drives: a, b: stop one",)), "services", "wrong", "two drives"),
        (replace(BUS, services=(health("tracker", state="error", reason="it hangs"),)),
         "services", "wrong", "it hangs"),
        (replace(BUS, services=(health("tracker", reason="two producers on cam/front/blobs: a"),)),
         "producers", "wrong", "two producers on"),
        (replace(BUS, services=(health("tracker", software_version="0.9"),)),
         "versions", "wrong", "tracker/main 0.9"),
        (replace(BUS, clocks_s={"drive/main@0123abcd": 3.2}), "clocks", "note", "3.20 s ahead"),
        (replace(BUS, clocks_s={"drive/main@0123abcd": -3.2}), "clocks", "note", "3.20 s behind"),
        (replace(BUS, services=(health("tracker", shared_memory=False),)),
         "shared memory", "note", "tracker/main: frames come through sockets"),
        (replace(BUS, services=(health("capture", rate_out_hz=0.0),)), "camera", "wrong", "0.0 f"),
        (replace(BUS, camera=INFO.model_copy(update={"horizontal_fov_rad": None})),
         "calibration", "note", "from people's size alone"),
        (replace(BUS, camera=INFO.model_copy(update={"horizontal_fov_rad": 0.02})),
         "calibration", "wrong", "field of view;"),
        (replace(BUS, camera=INFO.model_copy(update={"mount_height_m": 40.0})),
         "calibration", "wrong", "this height;"),
        (replace(BUS, camera=INFO.model_copy(update={"mount_pitch_rad": math.radians(80)})),
         "calibration", "wrong", "this pitch;"),
    ],
)  # fmt: skip
def test_what_is_heard_on_the_bus(bus: BusFacts, name: str, level: str, words: str) -> None:
    found = [one for one in about(replace(FACTS, bus=bus), name) if words in one.words]
    assert [one.level for one in found] == [level]
    assert found[0].remedy


@pytest.mark.parametrize(
    ("changes", "name", "level", "words"),
    [
        ({"shared_bytes": None}, "shared memory", "note", "no /dev/shm"),
        ({"shared_bytes": 32 << 20}, "shared memory", "note", "34 MB"),
        ({"shared_share": 0.97}, "shared memory", "wrong", "97% full"),
        ({"shared_problem": "/dev/shm is 100% full"}, "shared memory", "wrong", "100% full"),
        ({"may_lock": False, "locked_bytes": 8 << 20}, "shared memory", "note", "8 MiB"),
        ({"missing": {"neural": ("onnx",)}}, "extras", "note", "neural is not installed (onnx)"),
        ({"free_bytes": {"/": 500 << 20}}, "disk", "note", "524 MB"),
        ({"free_bytes": {"/": 5 << 20}}, "disk", "wrong", "5 MB"),
        ({"ports": {7447: False, 8470: True}}, "ports", "note", "taken by other processes: 7447"),
        ({"run_folder": "it is a link"}, "runs", "wrong", "it is a link"),
        ({"load": 9.0}, "processor", "note", "9 processes want 4 cores"),
    ],
)
def test_what_is_wrong_with_the_computer(
    changes: dict[str, object], name: str, level: str, words: str
) -> None:
    machine = replace(MACHINE, **changes)  # type: ignore[arg-type]
    [found] = about(replace(FACTS, machine=machine), name)
    assert (found.level, bool(found.remedy)) == (level, True)
    assert words in found.words


@pytest.mark.parametrize(
    ("camera", "level", "words"),
    [
        (CameraFacts("/dev/video0", "busy"), "wrong", "/dev/video0: busy"),
        (CameraFacts("/dev/video0", None, 7.5, 30.0, 640, 480), "note", "of 30 that it states"),
        (CameraFacts("/dev/video0", None, 29.0, 30.0, 640, 480), "ok", "640x480, 29.0 frames/s"),
    ],
)
def test_what_a_camera_gives(camera: CameraFacts, level: str, words: str) -> None:
    facts = replace(FACTS, bus=None, camera=camera)
    [found] = about(facts, "camera")
    assert found.level == level
    assert words in found.words


def test_a_camera_that_was_not_tried_is_offered() -> None:
    [found] = about(replace(FACTS, bus=None, devices=("/dev/video2",)), "camera")
    assert found.remedy == "heel doctor --camera /dev/video2"


@pytest.mark.parametrize(
    ("model", "level", "words"),
    [
        (None, "note", "found by what moves"),
        (ModelFacts("yolox-nano", "damaged"), "wrong", "yolox-nano: damaged"),
        (ModelFacts("yolox-nano", None, 200.0, "OpenCV"), "note", "5 pictures/s are looked at"),
    ],
)
def test_whether_the_network_fits(model: ModelFacts | None, level: str, words: str) -> None:
    [found] = about(replace(FACTS, model=model), "network")
    assert (found.level, bool(found.remedy)) == (level, True)
    assert words in found.words


def test_others_words_cannot_write_to_the_terminal() -> None:
    told = lines([Finding("wrong", "services", "x\x1b[2J\nok  all is well", "y\r")])
    assert len(told) == 2
    assert all(line.isprintable() for line in told)


@pytest.mark.parametrize(
    ("days", "level", "words"),
    [(400.0, "ok", "valid for 400 days"), (12.0, "note", "ends in 12 days"),
     (-3.0, "wrong", "ended 3 days ago")],
)  # fmt: skip
def test_a_certificate_that_ends_is_told_of_before_and_after(
    days: float, level: str, words: str
) -> None:
    (found,) = about(replace(FACTS, router=replace(ROUTER, certificate_days=days)), "certificate")
    assert (found.level, words in found.words) == (level, True)
    assert ("heel security renew" in found.remedy) == (level != "ok")


def test_a_services_certificate_that_ends_soon_is_told() -> None:
    soon = health("drive").model_copy(
        update={"details": {"certificate": "certificate ends in 9 days: nothing connects then"}}
    )
    bus = replace(BUS, services=(*BUS.services, soon))
    (found,) = about(replace(FACTS, bus=bus), "certificates")
    assert found.level == "note"
    assert "drive/main: certificate ends in 9 days" in found.words
    assert "heel security renew" in found.remedy
    assert not about(FACTS, "certificates")
