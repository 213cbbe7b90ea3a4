"""A report holds what happened, needs nothing else, and is made of whatever is left of a run."""

from __future__ import annotations

import base64
import json
import math
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from heel.schemas import (
    DriveState,
    EStop,
    FollowState,
    FrameId,
    Message,
    MotionCommand,
    Stamp,
    Target,
    Track,
    TrackEvent,
    Tracks,
    encode,
    keys,
)
from heel.services.cli import app
from heel.services.commands.report.charts import chart, thinned, ticks
from heel.services.commands.report.facts import Curve, Facts, Sighting, Span, Spans, joined, picked
from heel.services.commands.report.page import as_html
from heel.services.commands.report.recording import read_recording
from heel.services.commands.report.run_folder import read_run
from heel.services.recordings.wire import WireMessage
from tests.support.recordings import WALL_NS, image, info, recording

HOSTILE = "<script>alert(1)</script>"
TRACKER = "tracker/main@00000001"


def made(folder: Path, *, frames: int = 50) -> Path:
    """A run at 10 frames/s: two seconds of following id 3, then unsure, then a stop."""
    folder.mkdir()
    tracks, commands = [], ["seq,frame,linear_mps,angular_radps,state,reason\n"]
    states = ["seq,state,target,distance_m,nearest_person_m,bearing_rad,identity_confidence,"
              "runner_up_confidence,tracks_age_s,speed_reason\n"]  # fmt: skip
    for n in range(frames):
        name, reason = ("following", "in sight") if n < 20 else ("unsure", f"two alike {HOSTILE}")
        if n >= 40:
            name, reason = "stopped", "emergency stop"
        speed = 0.5 if name == "following" else 0.0
        tracks.append(f"{n + 1},3,{11 + n},21.00,20.00,40.00,0.900,-1,-1,-1\n")
        commands.append(f"{n},{n + 1},{speed},0.1,{name},{reason}\n".replace("0.1,un", "0.0,un")
                        .replace("0.1,st", "0.0,st"))  # fmt: skip
        states.append(f"{n},{name},3,2.5,{1.25 if n == 30 else 2.0},0.1,0.9,0.05,0.1,\n")
    summary = {
        "mode": "lossless", "ended": "end of stream", "dropped": {"capture": 0},
        "frames": {"captured": frames, "detected": frames, "tracked": frames},
        "age_ms": {"tracks": {"median": 12.5, "p95": 20.0, "p99": 31.25}},
        "cpu_s": {"tracker": 1.5}, "peak_rss_mb": {"tracker": 80.0},
        "versions": {"heel-follow": "0.1.0"}, "perception": None,
        "settings": {"follower": {"distance_m": 1.5, "max_linear_mps": 1.0}},
        "camera": {"source": "made", "fps": 10.0, "width": 160, "height": 120},
    }  # fmt: skip
    (folder / "tracks.txt").write_text("".join(tracks))
    (folder / "commands.csv").write_text("".join(commands))
    (folder / "states.csv").write_text("".join(states))
    (folder / "summary.json").write_text(json.dumps(summary))
    return folder


def page_of(out: Path, *flags: str) -> str:
    done = CliRunner().invoke(app, ["report", str(out), *flags], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    place = Path(done.output.removeprefix("wrote ").strip().replace("\n", ""))
    return place.read_text()


def needs_nothing(page: str) -> bool:
    """Whether a page loads nothing, runs nothing, and shows hostile text as text."""
    named = re.findall(r"""(?:src|href|url)\s*[=(]\s*["']?([^"'\s)>]*)""", page)
    loads = [one for one in named if not one.startswith("data:image/jpeg;base64,")]
    return not loads and "<script" not in page and "@import" not in page


def test_a_run_is_told_with_its_times_reasons_and_distances(tmp_path: Path) -> None:
    facts = read_run(made(tmp_path / "walk"), None)
    assert [(one.name, one.start_s, one.end_s) for one in facts.states] == [
        ("following", 0.0, 2.0), ("unsure", 2.0, 4.0), ("stopped", 4.0, 4.9),
    ]  # fmt: skip
    assert [(one.name, one.start_s) for one in facts.stops] == [("unsure", 2.0), ("stopped", 4.0)]
    assert min(facts.distances[1].known) == 1.25
    assert [one.kind for one in facts.events] == ["unsure"]
    assert "two alike" in facts.events[0].text
    assert facts.targets == {3}
    page = as_html(facts)
    assert needs_nothing(page)
    for words in ("unsure for 2.0 s", "emergency stop", "1.25 m", "12.5", "wished distance 1.5"):
        assert words in page
    assert "&lt;script&gt;" in page


def test_pictures_of_the_target_are_cut_out_of_what_was_run(tmp_path: Path) -> None:
    folder, pictures = made(tmp_path / "walk"), tmp_path / "img"
    pictures.mkdir()
    for n in range(1, 51):
        picture = np.zeros((120, 160, 3), np.uint8)
        picture[20:60, 10 + n - 1 : 30 + n - 1] = (40, 40, 220)
        cv2.imwrite(str(pictures / f"{n:06d}.png"), picture)
    page = page_of(folder, "--frames", str(pictures))
    crops = re.findall(r'src="data:image/jpeg;base64,([^"]+)"', page)
    assert 10 <= len(crops) <= 28
    crop = cv2.imdecode(np.frombuffer(base64.b64decode(crops[5]), np.uint8), cv2.IMREAD_COLOR)
    assert crop is not None
    middle = crop[crop.shape[0] // 2, crop.shape[1] // 2]
    assert middle[2] > 180 > 80 > middle[0], "red, as the person is"
    assert needs_nothing(page)


def test_what_sigkill_left_of_a_run_is_told(tmp_path: Path) -> None:
    folder = made(tmp_path / "walk")
    (folder / "summary.json").write_bytes(b" " * 65536)
    for name in ("commands.csv", "states.csv", "tracks.txt"):
        whole = (folder / name).read_bytes()
        (folder / name).write_bytes(whole[: len(whole) // 2])
    facts = read_run(folder, None)
    assert any("ended by force" in note for note in facts.notes)
    assert any("as if 25" in note for note in facts.notes)
    assert facts.states[0].name == "following"
    assert needs_nothing(as_html(facts))


@pytest.mark.parametrize("left", ["tracks.txt", "commands.csv", "summary.json"])
def test_a_run_of_which_one_file_is_left_is_told(tmp_path: Path, left: str) -> None:
    folder = made(tmp_path / "walk")
    for file in folder.iterdir():
        if file.name != left:
            file.unlink()
    page = page_of(folder)
    assert "left out" in page
    assert needs_nothing(page)


def test_an_empty_run_is_told_and_an_empty_folder_refused(tmp_path: Path) -> None:
    folder = made(tmp_path / "walk", frames=0)
    assert "nobody was found" in page_of(folder)
    (tmp_path / "nothing").mkdir()
    done = CliRunner().invoke(app, ["report", str(tmp_path / "nothing")])
    assert done.exit_code != 0
    assert "no run of `heel run --out`" in str(done.exception)


def test_scores_stand_on_the_page_where_truth_is_given(tmp_path: Path) -> None:
    folder = made(tmp_path / "walk")
    truth = tmp_path / "gt.txt"
    rows = [f"{n + 1},1,{11 + n},21.00,20.00,40.00,1,-1,-1,-1\n" for n in range(50)]
    truth.write_text("".join(rows))
    page = page_of(folder, "--truth", str(truth))
    assert re.search(r"<dt>MOTA</dt><dd>100.0 %", page)


def message(key: str, said: Message, at_ms: int, age_ms: int | None = 20) -> WireMessage:
    at_ns = WALL_NS + at_ms * 1_000_000
    stamp = Stamp(producer=TRACKER, t_sent_ns=at_ns, age_ns=(age_ms or 0) * 1_000_000)
    attachment = None if age_ms is None else encode(stamp)
    return WireMessage(key, said.encoding(), encode(said), attachment, at_ns)


def walk(frames: int = 75) -> list[WireMessage]:
    """Three seconds: id 7 is followed, the wheels are stopped from 2 s on."""
    found = [info()]
    for n in range(frames):
        ms = 40 * n
        frame = FrameId(stream="front", epoch=1, seq=n, index=n, t_capture_ns=WALL_NS)
        track = Track(
            id=7, state="tracked", box_xyxy=(8.0, 4.0, 20.0, 22.0), velocity_pxps=(0.0, 0.0),
            area_px=216.0, span_px=12.0, identity_confidence=0.9, shown=True,
        )  # fmt: skip
        size = {"width": 32, "height": 24, "source_width": 64, "source_height": 48}
        stands = n >= 50
        name, why = ("stopped", "emergency stop") if stands else ("following", "in sight")
        speed = 0.0 if stands else 0.8
        target = Target(seq=0, mode="id", track_id=7, tracker=TRACKER)
        state = FollowState(
            seq=n, state=name, reason=why, estop=stands, target=target, linear_mps=speed,
            angular_radps=0.0, distance_m=2.0, nearest_person_m=1.5 if n == 30 else 2.0,
            identity_confidence=0.9, runner_up_confidence=0.1,
        )  # fmt: skip
        command = MotionCommand(
            seq=n, linear_mps=speed, angular_radps=0.0, ttl_s=0.3, state=name, reason=why,
            frame=frame,
        )  # fmt: skip
        drive = DriveState(
            seq=n, state="stopped" if stands else "driving", reason=why, estop=stands,
            driver="log", linear_mps=speed, angular_radps=0.0,
        )  # fmt: skip
        found += [
            image(n, at_ms=ms), message(keys.FOLLOW_STATE, state, ms + 1, None),
            message(keys.tracks("front"), Tracks(**frame.model_dump(), **size, tracks=(track,)),
                    ms + 2, 15),
            message(keys.FOLLOW_COMMAND, command, ms + 3), message(keys.ROBOT_DRIVE, drive, ms + 4),
        ]  # fmt: skip
    event = TrackEvent(
        frame=FrameId(stream="front", epoch=1, seq=9, index=9, t_capture_ns=0), kind="contact",
        ids=(7, 8), text=f"ids 7 and 8 meet {HOSTILE}",
    )  # fmt: skip
    stop = EStop(engaged=True, source="page", t_ns=1, id="ab")
    return [*found, message("cam/front/events", event, 3001, None),
            message(keys.FOLLOW_ESTOP, stop, 3002, None)]  # fmt: skip


def test_a_recording_is_told_with_crops_ages_and_what_the_wheels_did(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", walk())
    facts, rows = read_recording(path)
    assert len(rows) == 75
    assert [(one.name, one.reason) for one in facts.wheels] == [
        ("driving", ""), ("stopped", "emergency stop"),
    ]  # fmt: skip
    assert facts.stops[0].start_s == pytest.approx(2.0, abs=0.05)
    ages = {curve.name: curve.known for curve in facts.ages}
    assert set(ages["tracker"]) == {15.0}
    assert set(ages["follower"]) == {20.0}
    page = page_of(path)
    assert needs_nothing(page)
    assert page.count("data:image/jpeg;base64,") >= 20
    for words in ("emergency stop pressed by page", "1.50 m", "1.6 m", "ids 7 and 8 meet"):
        assert words in page


@pytest.mark.parametrize("share", [0.02, 0.3, 0.77])
def test_a_recording_that_was_cut_off_is_told_up_to_there(tmp_path: Path, share: float) -> None:
    whole = recording(tmp_path / "a.mcap", walk() * 20).read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: int(share * len(whole))])
    page = page_of(cut)
    assert "cut off" in page
    assert needs_nothing(page)


def test_time_by_hand_is_told_as_such(tmp_path: Path) -> None:
    command = MotionCommand(seq=0, linear_mps=0.4, angular_radps=0.0, ttl_s=0.3, state="idle",
                            reason="driven by hand: a page", manual=True)  # fmt: skip
    messages = [message(keys.FOLLOW_COMMAND, command, 40 * n) for n in range(50)]
    facts, _ = read_recording(recording(tmp_path / "a.mcap", messages))
    assert [(one.name, one.reason) for one in facts.states] == [
        ("by hand", "driven by hand: a page")
    ]


def test_a_recording_without_anything_in_it_is_told(tmp_path: Path) -> None:
    page = page_of(recording(tmp_path / "a.mcap", []))
    assert "no message of Heel" in page


def test_a_recording_without_pictures_and_with_damaged_messages_is_told(tmp_path: Path) -> None:
    messages = [one for one in walk() if not one.encoding.startswith("image/")]
    broken = [
        WireMessage(one.key, one.encoding, one.payload[:-3], one.attachment, one.logged_ns)
        for one in messages[10:14]
    ]
    page = page_of(recording(tmp_path / "a.mcap", [*messages, *broken]))
    assert "no pictures in it" in page
    assert "4 messages cannot be decoded" in page


def test_the_report_is_readable_by_its_owner_alone_and_whole_or_not_there(tmp_path: Path) -> None:
    folder = made(tmp_path / "walk")
    page_of(folder)
    assert (folder / "report.html").stat().st_mode & 0o777 == 0o600
    done = CliRunner().invoke(app, ["report", str(folder), "--to", str(tmp_path)])
    assert "give a file that can be written" in str(done.exception)
    assert not list(tmp_path.glob(".*"))


def test_spans_join_what_is_the_same_and_a_long_curve_keeps_its_extremes() -> None:
    spans = Spans()
    for t_s, name in enumerate("aabba"):
        spans.take(float(t_s), name, "")
    assert spans.end(5.0) == [Span(0, 2, "a", ""), Span(2, 4, "b", ""), Span(4, 5, "a", "")]
    curve = Curve("speed", [n * 0.01 for n in range(50_000)], [0.0] * 50_000)
    curve.values[31_234], curve.values[7] = 9.0, -4.0
    kept = thinned(curve)
    assert len(kept) <= 4000
    assert {9.0, -4.0} <= {value for _, value in kept}


def test_spans_of_one_state_are_one_whose_reasons_differ_by_more_than_numbers() -> None:
    lost = [Span(0, 1, "lost", "0.19 s late"), Span(1, 2, "lost", "0.25 s late"),
            Span(2, 3, "lost", "gone")]  # fmt: skip
    spans = [*lost, Span(3, 4, "idle", ""), Span(6, 7, "idle", "x")]
    assert joined(spans) == [
        Span(0, 3, "lost", "0.19 s late; gone"), Span(3, 4, "idle", ""), Span(6, 7, "idle", "x"),
    ]  # fmt: skip


def test_a_curve_is_broken_where_nothing_is_known() -> None:
    times = [0.0, 0.1, 0.2, 0.3, 0.4, 9.0, 9.1]
    curve = Curve("speed", times, [1.0, 1.0, math.nan, 1.0, 1.0, 1.0, 1.0])
    drawn = str(chart([curve], 10.0, "m/s"))
    assert len(re.findall(r"M\d", drawn)) == 3


@pytest.mark.parametrize(
    ("low", "high", "wanted"),
    [(0.0, 1.0, [0, 0.5, 1]), (-1.2, 1.1, [-1, -0.5, 0, 0.5, 1]), (3.0, 3.0, [3.0])],
)
def test_ticks_are_round_numbers(low: float, high: float, wanted: list[float]) -> None:
    assert ticks(low, high, 2 if low == 0.0 else 5) == wanted


def test_crops_are_chosen_evenly_and_where_it_mattered() -> None:
    sightings = [Sighting(n * 0.1, (0, n), 1, (0, 0, 1, 1), None, "following") for n in range(1000)]
    chosen = picked(sightings, [33.3, 33.4, 71.0], 12)
    times = [one.t_s for one in chosen]
    assert times == sorted(times)
    assert {33.3, 33.4, 71.0} <= {round(one, 3) for one in times}
    assert max(np.diff(times)) < 15
    assert picked([], [1.0], 12) == []


def test_an_empty_report_is_a_page() -> None:
    assert needs_nothing(as_html(Facts("nothing", "run")))
