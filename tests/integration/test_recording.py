"""Recording as a user does it: a live camera, a recorder that is killed, and what is left."""

from __future__ import annotations

import json
import signal
import time
from pathlib import Path

import pytest
import zenoh

from heel.schemas import Header, Health, HeelError, Tracks, decode, encode, keys
from heel.schemas.image import RAW, encode_image
from heel.services.capture.sources import open_source
from heel.services.cli import app
from heel.services.recordings.reading import Recording, wire_messages
from heel.services.recordings.wire import WireMessage
from tests.support import network
from tests.support.processes import finished, running
from tests.support.recordings import PRODUCER, WALL_NS, image, info, recording

SCENE = "scene:crossing?frames=120&width=320&height=240"
LIVE = "scene:demo?width=320&height=240"


def scene_as_recorded(path: Path) -> Path:
    """The scene as a live run shows it: stamped by the wall clock, not quite in time."""
    messages = [info(frame_count=120)]
    with open_source(SCENE) as source:
        while (frame := source.read()) is not None:
            at_ns = WALL_NS + frame.index * 40_000_000 + frame.index % 3 * 1_700_000
            height, width = frame.image.shape[:2]
            header = Header(
                stream="front", epoch=77, seq=frame.index, index=frame.index, t_capture_ns=at_ns,
                width=width, height=height, source_width=width, source_height=height,
                image_encoding="image/raw;bgr8", producer=PRODUCER, age_ns=900_000,
            )  # fmt: skip
            payload = encode_image(frame.image, RAW)
            messages.append(
                WireMessage(keys.image("front"), RAW, payload, encode(header), at_ns)
            )  # fmt: skip
    return recording(path, messages)


def test_a_recording_is_run_and_gives_the_same_tracks_byte_for_byte(tmp_path: Path) -> None:
    path = scene_as_recorded(tmp_path / "scene.mcap")
    runs = {"scene": [SCENE, "--in-process"], "recording": [str(path)]}
    for name, words in runs.items():
        words = ["-m", "heel", "run", *words, "--frames", "90", "--out", str(tmp_path / name)]
        code, _, errors = finished(*words, deadline_s=150.0)
        assert code == 0, errors
    for file in ("tracks.txt", "commands.csv"):
        told = (tmp_path / "scene" / file).read_bytes()
        assert told.count(b"\n") > 20
        assert (tmp_path / "recording" / file).read_bytes() == told


@pytest.mark.timeout(300)
def test_sigkill_costs_a_recording_less_than_a_second(tmp_path: Path) -> None:
    out, newest = tmp_path / "out", [-1]
    with network.router() as endpoint, network.client(endpoint) as session:
        session.declare_subscriber(
            keys.image("front"),
            lambda sample: newest.append(decode(Header, sample.attachment.to_bytes()).seq),
        )
        where = ("--connect", endpoint)
        with running(
            "-m", "heel", "record", "--frames", "raw", "--out", str(out), *where
        ) as recorder:
            network.wait_until(lambda: "is up" in recorder.stderr(), "the recorder", 60.0)
            with running("-m", "heel", "capture", LIVE, *where) as capture:
                network.wait_until(
                    lambda: newest[-1] >= 40 or not capture.alive, "frames", 60.0
                )  # fmt: skip
                recorder.stop(signal.SIGKILL, 5.0)
                killed_ns = time.time_ns()
            assert newest[-1] >= 40, capture.stderr()
    (file,) = out.iterdir()
    code, told, errors = finished(
        "-m", "heel", "record", "--check", str(file), "--json", deadline_s=90.0
    )
    assert code == 0, errors
    check = json.loads(told)
    assert not check["complete"]
    assert check["lost_at_end_s"] < 1.0
    assert (killed_ns - check["last_ns"]) * 1e-9 < 1.0
    assert check["topics"]["cam/front/image"]["messages"] >= 15
    assert {one["undecodable"] for one in check["topics"].values()} == {0}
    assert "cam/front/info" in check["topics"]
    assert {"svc/capture/main/health", "cam/front/taken"} <= set(check["topics"])
    with open_source(LIVE) as scene:
        pictures = {frame.index: frame.image.tobytes() for frame in iter(scene.read, None)
                    if frame.index < 60}  # fmt: skip
    for message in wire_messages(Recording(file)):
        if message.encoding == RAW:
            header = decode(Header, message.attachment or b"")
            assert pictures.get(header.index, message.payload) == message.payload


def test_a_lossless_replay_leaves_no_frame_out(tmp_path: Path) -> None:
    path = scene_as_recorded(tmp_path / "scene.mcap")
    with network.router() as endpoint, network.client(endpoint) as session:
        told: list[int] = []

        def hear(sample: zenoh.Sample) -> None:
            if str(sample.encoding) == Tracks.encoding():
                told.append(decode(Tracks, sample.payload.to_bytes()).seq)

        session.declare_subscriber(keys.tracks("front"), hear)
        where = ("--connect", endpoint)
        lossless = ("--delivery", "lossless", *where)
        with (
            running("-m", "heel", "detector", "--model", "none", *lossless) as detector,
            running("-m", "heel", "tracker", *lossless) as tracker,
        ):
            network.wait_until(
                lambda: "is up" in detector.stderr() and "is up" in tracker.stderr(), "both", 60.0
            )
            words = ("-m", "heel", "replay", str(path), "--lossless", *where)
            code, said, errors = finished(*words, deadline_s=90.0)
            assert code == 0, errors
        assert told == list(range(120))
        assert "sent 121 messages" in said


def test_a_lossless_replay_that_nobody_tracks_ends_in_a_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("heel.services.commands.recording.replay._TRACKS_S", 0.5)
    path = recording(tmp_path / "a.mcap", [info(), *(image(seq) for seq in range(9))])
    with network.router() as endpoint, pytest.raises(HeelError, match="no tracks of the frames"):
        app(["replay", str(path), "--lossless", "--connect", endpoint], standalone_mode=False)


def test_what_never_came_is_counted_by_the_pictures_own_numbers(tmp_path: Path) -> None:
    with network.router() as endpoint, network.client(endpoint) as session:
        told: list[Health] = []
        session.declare_subscriber(
            keys.health("recorder", "main"),
            lambda sample: told.append(decode(Health, sample.payload.to_bytes())),
        )
        words = ("--frames", "raw", "--out", str(tmp_path), "--connect", endpoint)
        with running("-m", "heel", "record", *words) as recorder:
            network.wait_until(lambda: "is up" in recorder.stderr(), "the recorder", 60.0)
            for seq in (0, 1, 4, 5):
                sent = image(seq)
                session.put(
                    sent.key, sent.payload, encoding=sent.encoding, attachment=sent.attachment
                )
            network.wait_until(lambda: bool(told) and told[-1].dropped == 2, "the count", 10.0)
            assert told[-1].details["never came"] == "image 2"
            assert "2 messages were not recorded" in recorder.stderr()


def test_the_last_seconds_become_a_file_when_they_are_asked_for(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with network.router() as endpoint, network.client(endpoint) as session:
        where = ("--connect", endpoint)
        with running("-m", "heel", "record", "--last", "60", "--out", str(out), *where) as recorder:
            network.wait_until(lambda: "is up" in recorder.stderr(), "the recorder", 60.0)
            session.put("follow/state", b"odd", encoding="text/plain")
            time.sleep(0.3)
            assert list(out.iterdir()) == [], "nothing is written before"
            code, told, errors = finished("-m", "heel", "record", "--save", *where, deadline_s=90.0)
            assert code == 0, errors
            found = Path(told.strip())
            assert found.parent == out
            assert "asked" in found.name
            whole = Recording(found)
            assert "follow/state" in {message.key for message in wire_messages(whole)}
            assert whole.complete
            code, took_s = recorder.stop(signal.SIGINT, 5.0)
            assert code == 0
            assert took_s < 2.0
