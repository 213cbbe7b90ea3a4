"""Every setting of the tracker changes what comes out, or is refused by name, on every input."""

from __future__ import annotations

import functools
import itertools
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from heel.schemas import Blobs, SettingsError, Tracks
from heel.services.geometry.calibration_file import Calibration, write_calibration
from heel.services.pipeline import load_pipeline
from heel.services.tracker.core import Tracker, configured
from heel.services.tracker.settings import TrackerSettings
from tests.unit.tracker import drawn_detections, drawn_people

FPS = 10
_AWAY = range(30, 66)
"""Frames in which one person is out of sight: longer than any default of `forget_s`."""
_FRAMES = range(96)


def foreground(seq: int) -> Blobs:
    """One person is away for a while and comes back a little farther on; another stays."""
    leaving = drawn_people.Walker(
        drawn_people.RED, lambda k: None if k in _AWAY else (60.0 + 2.0 * k, 200.0)
    )
    staying = drawn_people.straight(drawn_people.BLUE, 290.0, -0.7, row=150.0)
    return drawn_people.blobs_of([leaving, staying], seq)


def people(seq: int) -> Blobs:
    """The same, but the one who was away comes back elsewhere."""

    def where(t_s: float) -> tuple[float, float] | None:
        if round(t_s * FPS) in _AWAY:
            return None
        return (150.0 + 3.0 * t_s, 400.0) if round(t_s * FPS) < _AWAY.stop else (330.0, 400.0)

    leaving = drawn_detections.Person(drawn_detections.RED, where)
    staying = drawn_detections.Person(drawn_detections.BLUE, lambda t_s: (500.0, 390.0))
    return drawn_detections.message([leaving, staying], seq, FPS)


def pointed_at(seq: int) -> Blobs:
    blobs = people(seq)
    return blobs.model_copy(
        update={"sought": 1, "blobs": blobs.blobs[:1] if seq not in _AWAY else ()}
    )


INPUTS: dict[str, Callable[[int], Blobs]] = {
    "foreground": foreground, "people": people, "pointed-at": pointed_at,
}  # fmt: skip
VALUES: dict[str, tuple[Any, ...]] = {
    "preset": ("paper",),
    "min_height": (0.9,),
    "show_missed_s": (3.0,),
    "forget_s": (0.0, 10.0),
    "identify": (False,),
    "calibration": ("camera.toml",),
}
REFUSED = {
    ("preset", "people"), ("preset", "pointed-at"), ("calibration", "people"),
}  # fmt: skip
NO_PART = {("calibration", "pointed-at")}
"""A click must not end a tracker that was right so far: it is told instead."""


def made(settings: dict[str, Any], folder: Path) -> Tracker:
    """A tracker with these settings; a calibration is of a camera much higher than that drawn."""
    if "calibration" in settings:
        settings = {**settings, "calibration": folder / settings["calibration"]}
        write_calibration(
            settings["calibration"],
            Calibration(mount_height_m=8.0, mount_pitch_deg=20.0, horizontal_fov_deg=40.0),
        )
    return configured(TrackerSettings.model_validate(settings))


def tracked(tracker: Tracker, given: str) -> list[Tracks]:
    return [tracker.update(INPUTS[given](seq)) for seq in _FRAMES]


@functools.cache
def usual(given: str) -> list[Tracks]:
    return tracked(Tracker(TrackerSettings()), given)


def test_every_setting_is_looked_at() -> None:
    assert set(VALUES) == set(TrackerSettings.model_fields)


@pytest.mark.parametrize("given", INPUTS)
@pytest.mark.parametrize(
    ("name", "value"), [(name, value) for name, values in VALUES.items() for value in values]
)
def test_a_setting_changes_the_tracks_or_is_refused_by_name(
    name: str, value: Any, given: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    tracker = made({name: value}, tmp_path)
    if (name, given) in REFUSED:
        with pytest.raises(SettingsError, match=rf"tracker\.{name} = .*sends.*: ") as caught:
            tracker.update(INPUTS[given](0))
        assert "\n" not in str(caught.value)
        return
    with caplog.at_level(logging.WARNING):
        found = tracked(tracker, given)
    if (name, given) in NO_PART:
        assert [f"tracker.{name}" in line for line in caplog.messages] == [True]
    else:
        assert found != usual(given)


@pytest.mark.parametrize(("name", "value"), [(k, v[0]) for k, v in VALUES.items() if k != "preset"])
def test_the_paper_has_its_numbers_as_printed(name: str, value: Any) -> None:
    with pytest.raises(ValidationError, match=f"{name} = .*preset paper.*leave out {name}"):
        TrackerSettings.model_validate({"preset": "paper", name: value})


@pytest.mark.parametrize("given", INPUTS)
@pytest.mark.parametrize("shorter", ["show_missed_s", "forget_s"])
def test_a_longer_time_is_never_a_shorter_one(shorter: str, given: str) -> None:
    """Frames in which the person who is away is still reported, or still shown."""
    counts = []
    for value in (0.2, 1.0, 2.5):
        patient = {"forget_s": 3.0} if shorter == "show_missed_s" else {}
        tracker = Tracker(TrackerSettings.model_validate({**patient, shorter: value}))
        frames = [tracker.update(INPUTS[given](seq)) for seq in range(_AWAY.stop)][_AWAY.start :]
        missed = [[t for t in found.tracks if t.missed_frames] for found in frames]
        if shorter == "show_missed_s":
            missed = [[t for t in tracks if t.shown] for tracks in missed]
        counts.append(sum(map(bool, missed)))
    assert all(few < more for few, more in itertools.pairwise(counts)), counts


@pytest.mark.parametrize("given", INPUTS)
def test_a_person_who_was_forgotten_is_known_again_by_appearance_alone(given: str) -> None:
    unknown = tracked(Tracker(TrackerSettings(identify=False)), given)
    first, (known, new) = shown_ids(usual(given)[_AWAY.start - 1]), (
        shown_ids(usual(given)[-1]), shown_ids(unknown[-1]),
    )  # fmt: skip
    assert known == first
    assert len(new) == len(first)
    assert new - first


def shown_ids(tracks: Tracks) -> set[int]:
    return {track.id for track in tracks.tracks if track.shown}


@pytest.mark.parametrize("detector", ["onnx", "auto"])
def test_a_run_with_a_network_and_the_papers_tracker_does_not_begin(
    detector: str, tmp_path: Path
) -> None:
    config = tmp_path / "heel.toml"
    config.write_text('[tracker]\npreset = "paper"\n')
    with pytest.raises(SettingsError, match=r"tracker\.preset = paper: .*people's boxes"):
        load_pipeline("paper", "none", config, detector, model=tmp_path / "people.onnx")
