"""The trace of a tracker: what it notes on drawn people, and that nothing of it flows back."""

from __future__ import annotations

import functools
import itertools
import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from heel.schemas import FrameId, HeelError, TrackEvent, Tracks, encode
from heel.schemas.errors import SettingsError
from heel.services.cli import app
from heel.services.pipeline import load_pipeline
from heel.services.run.options import RunOptions
from heel.services.tracker.boxes.sequence import GivenSequence, track_sequence
from heel.services.tracker.core import Tracker
from heel.services.tracker.service import Events, log_identities
from heel.services.tracker.settings import TrackerSettings
from heel.services.tracker.story import percent, sentence, told
from heel.services.tracker.trace import Changes, Event, Kind, Trace
from heel.services.tracker.trace_file import TraceFile, read_trace
from tests.support.documents import blocks
from tests.unit.tracker import drawn_detections as boxes
from tests.unit.tracker import drawn_people as regions
from tests.unit.tracker.boxes.test_newcomers_from_a_box import walker
from tests.unit.tracker.test_sought import blob, frame
from tests.unit.tracker.test_tracker_identity import meeting

Play = Callable[[Tracker], list[Tracks]]


def crossing(first: boxes.Colours, second: boxes.Colours) -> Play:
    people = [
        boxes.Person(first, lambda t_s: (100.0 + 60.0 * t_s, 400.0)),
        boxes.Person(second, lambda t_s: (560.0 - 60.0 * t_s, 400.0)),
    ]
    return lambda tracker: boxes.follow(tracker, people, 7.0)


def together(colours: boxes.Colours) -> Play:
    """Two meet, of whom one then hides the other for a while, and part slowly."""
    people = [
        boxes.Person(
            colours, lambda t_s: (100.0 + 60.0 * min(t_s, 3.5) - 50.0 * max(t_s - 6.0, 0.0), 400.0)
        ),
        boxes.Person(
            colours,
            lambda t_s: (
                (540.0 - 60.0 * t_s, 400.0)
                if t_s < 3.3
                else (330.0 + 50.0 * (t_s - 6.0), 400.0)
                if t_s >= 6.0
                else None
            ),
        ),
    ]
    return lambda tracker: boxes.follow(tracker, people, 9.0)


def away(colours: boxes.Colours, returning: boxes.Colours, gone_s: float = 4.0) -> Play:
    people = [
        boxes.Person(colours, lambda t_s: (300.0, 400.0) if t_s < 4.0 else None),
        boxes.Person(returning, lambda t_s: (100.0, 400.0) if t_s >= 4.0 + gone_s else None),
        boxes.Person(boxes.GREEN, lambda _: (200.0, 400.0)),
    ]
    return lambda tracker: boxes.follow(tracker, people, 7.0 + gone_s)


def newcomer(stays: bool) -> Play:
    hidden = (0.0, 0.0) if stays else (4.0, 5.4)
    known = walker(boxes.RED, 0 if stays else 110, 0.0, hidden)
    other = walker(boxes.GREEN, 110 if stays else 0, 5.4 if stays else 4.0)
    return lambda tracker: boxes.follow(tracker, [known, other], 9.0)


def silhouettes(second: tuple[int, int, int]) -> Play:
    people = meeting(regions.RED, second, turn_back=False)
    return lambda tracker: regions.follow(tracker, people, range(62))


def pointed_at(tracker: Tracker) -> list[Tracks]:
    scores = [0.9] * 8 + [0.4] * 8 + [0.9] * 4
    seen = [frame(seq, blob(10.0, score)) for seq, score in enumerate(scores)]
    return [tracker.update(each) for each in [*seen, *(frame(k, None) for k in range(20, 60))]]


PLAYS: dict[str, Play] = {
    "crossing": crossing(boxes.RED, boxes.GREEN),
    "twins": together(boxes.RED),
    "twins that pass": crossing(boxes.RED, boxes.RED),
    "back": away(boxes.RED, boxes.RED),
    "another": away(boxes.RED, boxes.BLUE),
    "newcomer": newcomer(stays=True),
    "newcomer took over": newcomer(stays=False),
    "silhouettes": silhouettes(regions.GREEN),
    "silhouettes alike": silhouettes(regions.RED),
    "pointed-at": pointed_at,
}


def noted(play: Play, settings: TrackerSettings | None = None) -> tuple[list[Event], list[Tracks]]:
    events: list[Event] = []
    tracks = play(Tracker(settings or TrackerSettings(), trace=Trace(events.append)))
    return events, tracks


@functools.cache
def played(name: str) -> tuple[list[Event], list[Tracks]]:
    return noted(PLAYS[name])


def kinds(events: Sequence[Event], track_id: int = 1) -> list[str]:
    return [event.kind for event in events if track_id in (event.id, event.other)]


@pytest.mark.parametrize("name", PLAYS)
def test_the_tracks_are_the_same_bytes_with_a_trace_and_without(name: str) -> None:
    events, traced = played(name)
    plain = PLAYS[name](Tracker(TrackerSettings()))
    assert [encode(each) for each in traced] == [encode(each) for each in plain]
    assert all(one.frame <= other.frame for one, other in itertools.pairwise(events))
    assert all(len(sentence(event)) > 10 for event in events)


def test_the_published_method_notes_its_splits_too() -> None:
    events, traced = noted(PLAYS["silhouettes"], TrackerSettings(preset="paper"))
    plain = PLAYS["silhouettes"](Tracker(TrackerSettings(preset="paper")))
    assert traced == plain
    assert events[0].method == "paper"


def test_the_first_event_says_what_the_detector_sends() -> None:
    found = {name: played(name)[0][0] for name in ("crossing", "silhouettes", "pointed-at")}
    assert {name: (one.kind, one.input, one.method) for name, one in found.items()} == {
        "crossing": ("input", "people", "boxes"),
        "silhouettes": ("input", "foreground", "evidence"),
        "pointed-at": ("input", "pointed-at", "pointed-at"),
    }


def test_a_person_that_leaves_and_comes_back_is_told_with_the_runner_up() -> None:
    events, _ = played("back")
    assert kinds(events) == ["confirmed", "unseen", "gone", "re-identified"]
    (back,) = [event for event in events if event.kind == "re-identified"]
    assert back.probability is not None
    assert back.runner_up_probability is not None
    assert back.probability > 0.9
    assert back.probability + back.runner_up_probability == pytest.approx(1.0)


def test_another_person_is_told_to_be_compared_and_new() -> None:
    events, _ = played("another")
    new = [event for event in events if event.kind == "new"]
    assert new
    assert {event.id for event in new} == {3}
    assert not [event for event in events if event.kind == "re-identified"]


def test_twins_end_undecided_and_unsure_by_motion_and_by_colours() -> None:
    events, _ = played("twins")
    assert kinds(events)[:2] == ["confirmed", "contact"]
    (end,) = [event for event in events if event.kind == "decided"]
    assert (end.id, end.other, end.outcome) == (1, 2, "open")
    assert end.looks_log_odds is not None
    assert abs(end.looks_log_odds) < 3.0
    doubts = [event for event in events if event.kind == "unsure"]
    assert {event.id for event in doubts} == {1, 2}
    assert all((event.probability or 1.0) < 0.6 for event in doubts)


def test_twins_that_pass_are_told_apart_by_motion_and_not_for_sure() -> None:
    events, tracks = played("twins that pass")
    (end,) = [event for event in events if event.kind == "decided"]
    assert end.outcome != "exchanged"
    assert (end.motion_log_odds or 0.0) > 1.0
    assert abs(end.looks_log_odds or 0.0) < 1.0
    assert {t.id: t.box_xyxy[0] > 320 for t in tracks[-1].tracks} == {1: True, 2: False}
    assert all(0.6 < t.identity_confidence < 0.95 for t in tracks[-1].tracks)


@pytest.mark.parametrize("stays", [True, False], ids=["stays", "taken over"])
def test_a_verification_is_told_from_its_begin_to_its_outcome(stays: bool) -> None:
    events, _ = played("newcomer" if stays else "newcomer took over")
    told_of = [event for event in events if event.kind in ("verifying", "verified", "given up")]
    kinds_told = [event.kind for event in told_of]
    assert kinds_told == ["verifying", "verified"] + ([] if stays else ["given up"])
    assert told_of[1].outcome == ("confirmed" if stays else "refuted")
    assert (told_of[1].before_log_odds or 0.0) * (1 if stays else -1) > 4.0
    if not stays:
        assert (told_of[2].cause, told_of[2].id, told_of[2].other) == ("newcomer", 1, 3)


def test_silhouettes_that_met_are_decided_with_odds_or_left_open() -> None:
    events, _ = played("silhouettes")
    assert [event.kind for event in events if event.kind == "contact"] == ["contact"]
    decided = [event for event in events if event.kind == "decided"]
    assert [(event.id, event.other, event.outcome) for event in decided] == [(1, 2, "kept")]
    assert all((event.probability or 0.0) > 0.9 for event in decided)
    alike, _ = played("silhouettes alike")
    left = [event for event in alike if event.kind == "decided"]
    assert [event.outcome in ("kept", "open") for event in left] == [True]


def test_doubt_in_the_person_pointed_at_and_their_loss_are_told() -> None:
    events, _ = played("pointed-at")
    assert kinds(events) == ["confirmed", "unsure", "sure", "unseen", "gone"]


def test_another_scene_forgets_everybody_by_name() -> None:
    events: list[Event] = []
    tracker = Tracker(TrackerSettings(), trace=Trace(events.append))
    crossing(boxes.RED, boxes.GREEN)(tracker)
    tracker.update(boxes.message([], 80, 10.0, epoch=2))
    assert [(event.kind, event.id) for event in events[-3:]] == [
        ("forgotten", 1), ("forgotten", 2), ("input", 0),
    ]  # fmt: skip


def test_without_a_sink_nothing_is_noted() -> None:
    trace = Trace()
    for name in ("newcomer took over", "back", "silhouettes"):
        PLAYS[name](Tracker(TrackerSettings(), trace=trace))
    assert not trace.explained


def test_a_file_of_boxes_is_traced_without_another_track() -> None:
    frames = np.arange(1, 31).repeat(2)
    left = np.where(np.arange(60) % 2, 300.0 - 3.0 * frames, 100.0 + 3.0 * frames)
    rows = np.stack([left, np.full(60, 100.0), left + 40.0, np.full(60, 200.0)], axis=1)
    given = GivenSequence(frames, rows, np.full(60, 0.9), 10.0)
    events: list[Event] = []
    traced = list(track_sequence(given, trace=Trace(events.append)))
    assert traced == list(track_sequence(given))
    assert [(event.kind, event.frame) for event in events[:2]] == [("input", 1), ("confirmed", 3)]


def test_short_gaps_are_not_told() -> None:
    events: list[Event] = []
    trace = Trace(events.append)
    changes = Changes(trace)
    _, tracks = played("crossing")
    seen = tracks[20].tracks[0]
    for number, state in enumerate(["tracked", "lost", "lost", "tracked", *["lost"] * 5]):
        trace.begin(number + 1, number / 10)
        changes.observe([seen.model_copy(update={"state": state})])
    assert [(event.kind, event.frame) for event in events] == [("confirmed", 1), ("unseen", 7)]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "trace.jsonl"
    with TraceFile(path) as trace:
        for event in played("newcomer took over")[0]:
            trace.take(event)
    return path


def ask(*arguments: object) -> list[str]:
    result = CliRunner().invoke(app, ["why", *map(str, arguments)])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.output.splitlines()


def test_a_file_holds_what_was_noted(file: Path) -> None:
    events, _ = played("newcomer took over")
    read = read_trace(file)
    assert [sentence(event) for event in read] == [sentence(event) for event in events]
    assert json.loads(file.read_text().splitlines()[0]) == {"heel_trace": 1}


def test_heel_why_tells_the_story_of_an_id_in_time_order(file: Path) -> None:
    lines = ask(file, "--id", 1)
    assert lines[0].startswith("frame 1 (0.00 s): the detector sends people's boxes")
    text = "\n".join(lines)
    assert "a newcomer without an id yet came forth from the box of id 1" in text
    assert "id 1 against newcomer id 2: refuted" in text
    assert "the track goes on as id 3" in text
    assert [int(line.split()[1]) for line in lines] == sorted(int(x.split()[1]) for x in lines)
    assert not [line for line in lines if "id 3 is compared" in line and "id 1" not in line]


def test_a_frame_narrows_the_story_to_what_is_near_and_the_last_before(file: Path) -> None:
    near = ask(file, "--frame", 110)
    assert [int(line.split()[1]) >= 60 for line in near][1:] == [True] * (len(near) - 1)
    assert len(near) < len(told(read_trace(file)))


def test_an_unknown_id_is_one_line_with_those_that_are_there(file: Path) -> None:
    with pytest.raises(HeelError, match=r"no id 9 in it; its ids: 1, 2, 3$"):
        ask(file, "--id", 9)
    with pytest.raises(SettingsError, match="--id, --frame, or both"):
        ask(file)


@pytest.mark.parametrize(
    ("damage", "complaint"),
    [
        (lambda text: "", "no trace of Heel"),
        (lambda text: "\x00\xff\n" * 50, "no trace of Heel"),
        (lambda text: "[" * 100_000, "no trace of Heel"),
        (lambda text: text.replace('{"heel_trace":1}', '{"heel_trace":2}'), "version is not 1"),
        (lambda text: text.replace('"kind":"verified"', '"kind":"evil\\u001b"'), "is damaged"),
        (lambda text: text.replace('"probability":', '"probability":NaN,"x":'), "is damaged"),
        (lambda text: text.replace('"id":1', '"id":-1'), "is damaged"),
        (lambda text: text.replace('"id":1', '"id":' + "9" * 5000), "is damaged"),
        (lambda text: text + '{"kind":"gone"', "is damaged"),
    ],
)
def test_a_damaged_file_is_one_line(
    file: Path, damage: Callable[[str], str], complaint: str
) -> None:
    file.write_text(damage(file.read_text()))
    with pytest.raises(HeelError, match=complaint) as error:
        ask(file, "--id", 1)
    assert "\n" not in str(error.value)


def test_what_is_no_file_is_one_line(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path, tmp_path / "missing", tmp_path / "pipe"):
        with pytest.raises(HeelError, match="give a file made with --trace"):
            ask(path, "--id", 1)
    (tmp_path / "link").symlink_to(tmp_path / "target")
    missing = tmp_path / "missing" / "trace"
    for path in (tmp_path, missing, tmp_path / "link", tmp_path / "pipe"):
        with pytest.raises(SettingsError, match=r"--trace .*: give a file"):
            TraceFile(path)


def test_a_full_file_says_so_and_takes_no_more(tmp_path: Path) -> None:
    path = tmp_path / "trace.jsonl"
    with TraceFile(path, most_bytes=1000) as trace:
        for number in range(100):
            trace.take(Event("contact", id=1, other=2, frame=number))
    assert path.stat().st_size < 1200
    assert told(read_trace(path))[-1].endswith("the trace file is full and ends here.")


def test_a_full_disk_ends_the_trace_and_not_the_tracker() -> None:
    trace = TraceFile(Path("/dev/full"))
    trace.take(Event("gone", id=1))


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "under 0.1 %"),
        (0.004, "0.4 %"),
        (0.5, "50 %"),
        (0.9923, "99.2 %"),
        (1.0, "over 99.9 %"),
    ],
)
def test_percentages_are_not_rounded_to_certainty(value: float, text: str) -> None:
    assert percent(value) == text


def test_the_process_logs_who_became_whom_and_nothing_else(
    caplog: pytest.LogCaptureFixture,
) -> None:
    with caplog.at_level("INFO", "heel.tracker"):
        for name in ("newcomer took over", "back", "twins that pass", "silhouettes"):
            for event in played(name)[0]:
                log_identities(event)
    lines = [record.getMessage() for record in caplog.records]
    assert [line.partition(",")[0].partition(" (")[0] for line in lines] == [
        "id 1 against newcomer id 2: refuted",
        "id 1 is given up",
        "a new track is taken for the person of id 1 that was out of sight",
    ]
    assert len({record.msg for record in caplog.records}) == 1, "one kind for the flood guard"


def test_a_setting_of_the_file_counts_and_the_flag_wins(tmp_path: Path) -> None:
    file = tmp_path / "heel.toml"
    file.write_text('[tracker]\npreset = "paper"\ntrace = "one.jsonl"\n')
    for flag, used in ((None, "one.jsonl"), (Path("other.jsonl"), "other.jsonl")):
        _, shown = load_pipeline("paper", "none", file, trace_file=flag)
        assert shown["tracker"]["trace"] == used
    assert RunOptions("scene:demo", tmp_path, trace=Path("t")).tracker_flags()[-2:] == [
        "--trace", "t",
    ]  # fmt: skip


def test_the_guide_shows_what_heel_why_says(file: Path) -> None:
    (shown,) = blocks("text", "docs/guides/wrong-person.md")
    assert ask(file, "--id", 1) == shown.text.strip().splitlines()


def test_what_becomes_of_identities_is_published_a_few_a_second() -> None:
    sent: list[TrackEvent] = []
    events = Events(sent.append)
    contact = Event("contact", id=1, other=2)
    events.take(contact)
    assert not sent, "before the first frame"
    frame = FrameId(stream="front", epoch=1, seq=4, index=4, t_capture_ns=0)
    events.begin(frame, 100.0)
    everyday: tuple[Kind, ...] = ("born", "confirmed", "unseen", "seen", "gone", "forgotten")
    for kind in everyday:
        events.take(Event(kind, id=1))
    assert not sent, "what happens to everybody is not worth a message"
    events.take(contact)
    assert (sent[0].frame, sent[0].kind, sent[0].ids) == (frame, "contact", (1, 2))
    assert sent[0].text == sentence(contact)
    for second in range(100):
        events.begin(frame, 100.0 + second)
        for _ in range(1000):
            events.take(contact)
    assert 400 < len(sent) < 600
