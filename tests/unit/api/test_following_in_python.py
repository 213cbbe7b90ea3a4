"""`heel.open`, `heel.track`, `heel.Follower` and `heel.Tracker`, on drawn scenes."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
import pytest

import heel
from heel.services.capture.sources import open_source

SCENE = "scene:crossing?frames=112&width=320&height=240"
SHOWN_FROM = 100
"""Both people of the scene are tracked by then."""


@pytest.fixture(scope="module")
def pictures() -> list[tuple[heel.Image, float]]:
    with open_source(SCENE) as source:
        frames = iter(source.read, None)
        return [(frame.image, frame.media_time_s) for frame in frames]


@pytest.fixture(scope="module")
def frames(pictures: list[tuple[heel.Image, float]]) -> list[heel.Frame]:
    assert pictures
    with heel.open(SCENE) as video:
        return list(video)


def _results(frames: list[heel.Frame]) -> list[tuple[object, ...]]:
    return [(frame.tracks, frame.command, frame.state) for frame in frames]


def test_a_frame_has_its_picture_its_people_and_a_command(frames: list[heel.Frame]) -> None:
    assert [frame.index for frame in frames] == list(range(112))
    last = frames[-1]
    assert last.image.shape == (240, 320, 3)
    assert last.time_s == pytest.approx(111 / 25)
    assert [one.id for one in last.people] == sorted(one.id for one in last.people)
    assert all(one.shown and 0.0 <= one.identity_confidence <= 1.0 for one in last.people)
    assert len(last.people) == 2
    assert last.target in last.people
    assert last.command.state == last.state.state == "following"
    assert last.command.linear_mps > 0.0


def test_tracking_alone_finds_the_same_people(
    frames: list[heel.Frame], pictures: list[tuple[heel.Image, float]]
) -> None:
    tracker = heel.Tracker()
    assert [tracker.update(*picture) for picture in pictures] == [f.people for f in frames]


def test_own_pictures_give_what_the_same_source_gives_whatever_is_drawn_on_them(
    frames: list[heel.Frame], pictures: list[tuple[heel.Image, float]]
) -> None:
    buffer = np.empty_like(pictures[0][0])

    def reused() -> object:
        for image, time_s in pictures:
            buffer[:] = image
            yield buffer, time_s

    drawn = []
    for frame in heel.track(reused()):  # type: ignore[arg-type]
        frame.image[:] = 0
        buffer[:] = 255
        drawn.append(frame)
    assert _results(drawn) == _results(frames)
    with heel.open(SCENE) as video:
        drawn = []
        for frame in video:
            frame.image[:] = 0
            drawn.append(frame)
    assert _results(drawn) == _results(frames)


def test_folders_files_and_scales(tmp_path: Path, pictures: list[tuple[heel.Image, float]]) -> None:
    for number, (image, _) in enumerate(pictures[:5], 1):
        cv2.imwrite(str(tmp_path / f"{number:06d}.png"), image)
    with heel.open(tmp_path, scale=0.5, fps=10.0) as video:
        assert (video.frame_count, video.fps, video.is_live) == (5, 10.0, False)
        found = list(video)
    assert [frame.time_s for frame in found] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])
    assert found[0].image.shape == (120, 160, 3)
    assert (found[0].tracks.width, found[0].tracks.source_width) == (160, 320)


def test_a_point_given_at_the_start_is_looked_at(frames: list[heel.Frame]) -> None:
    """No person is tracked yet where it lies; the person that comes to be tracked there is it."""
    wanted = frames[-1].people[-1]
    first = next(f for f in frames if any(one.id == wanted.id for one in f.people))
    left, top, right, bottom = next(o for o in first.people if o.id == wanted.id).box_xyxy
    with heel.open(SCENE, target=((left + right) / 2, (top + bottom) / 2)) as video:
        found = list(video)
    assert found[2].state.pending_point_px is not None
    assert found[-1].state.target.mode == "point"
    assert found[-1].target is not None


def test_an_id_given_at_the_start_is_followed_once_it_is_there(frames: list[heel.Frame]) -> None:
    nearest = frames[-1].state.target.track_id
    other = next(one.id for one in frames[-1].people if one.id != nearest)
    with heel.open(SCENE, target=other) as video:
        found = list(video)
    assert found[0].state.target.track_id is None
    assert found[-1].state.target.track_id == other


def test_the_target_can_be_changed_and_cleared(frames: list[heel.Frame]) -> None:
    with heel.open(SCENE, target="none") as video:
        before = list(islice(video, SHOWN_FROM))
        assert not any(frame.command.linear_mps for frame in before)
        wanted = before[-1].people[0]
        assert video.choose(wanted.id).track_id == wanted.id
        assert next(video).target is not None
        assert video.choose("none").track_id is None
        assert next(video).target is None


def test_the_source_is_closed_at_the_end_of_the_block_and_of_the_recording() -> None:
    with heel.open(SCENE) as video:
        assert next(video).index == 0
    assert list(video) == []
    video.close()


def test_settings_reach_the_cores() -> None:
    slow, tall = heel.FollowerSettings(max_linear_mps=0.2), heel.TrackerSettings(min_height=0.9)
    with heel.open(SCENE, follower=slow) as video:
        assert 0.0 < max(frame.command.linear_mps for frame in video) <= 0.2
    with heel.open(SCENE, tracker=tall) as video:
        assert not any(frame.people for frame in video)
    model = heel.DetectorSettings(detector="mixture")
    with pytest.raises(heel.SettingsError, match=r"model.*mixture|mixture.*model"):
        heel.open(SCENE, detector=model, model="people.onnx")


def test_an_old_picture_moves_no_robot(pictures: list[tuple[heel.Image, float]]) -> None:
    follower = heel.Follower()
    fresh = [follower.update(image, time_s) for image, time_s in pictures[:-1]]
    assert fresh[-1].command.linear_mps > 0.0
    late = follower.update(*pictures[-1], age_s=1.0)
    assert (late.command.linear_mps, late.command.angular_radps) == (0.0, 0.0)


_BLACK = np.zeros((48, 64, 3), np.uint8)


@pytest.mark.parametrize(
    ("mistake", "complaint"),
    [
        (lambda: heel.open("nowhere.mp4"), "nowhere.mp4.*no such file"),
        (lambda: heel.open(SCENE, model="nowhere.onnx"), "nowhere.onnx"),
        (lambda: heel.open(SCENE, calibration="nowhere.toml"), "nowhere.toml.*check the path"),
        (lambda: heel.open(SCENE, scale=2.0), "scale"),
        (lambda: heel.open(f"pan:{SCENE}"), "use `heel run`"),
        (lambda: heel.open(SCENE, target="somebody"), "target 'somebody'.*give 'nearest'"),
        (lambda: heel.open(SCENE, target=(1.0, 2.0, 3.0)), "give 'nearest'"),
        (lambda: heel.Follower().choose(7), "nobody has id 7"),
        (lambda: heel.Follower().choose((1.0, 1.0)), "no picture yet"),
        (lambda: heel.Tracker().update("picture.png", 0.0), "type str: give an array"),
        (lambda: heel.Tracker().update(np.zeros((4, 4, 3)), 0.0), "float64"),
        (lambda: heel.Tracker().update(_BLACK, -1.0), "time -1 s of picture 0"),
        (lambda: heel.Tracker().update(_BLACK, math.nan), "time nan s"),
        (lambda: heel.Tracker().update(_BLACK, 1e300), r"time 1e\+300 s of picture 0"),
        (lambda: heel.Tracker().update(_BLACK, "now"), "time 'now' s of picture 0"),
        (lambda: heel.Follower().update(_BLACK, 0.0, math.nan), "age nan of a picture"),
        (lambda: heel.Follower().update(_BLACK, 0.0, -0.1), "age -0.1 of a picture"),
        (lambda: list(heel.track([(_BLACK, 2.0), (_BLACK, 1.0)])), "time 1 s of picture 1"),
        (lambda: list(heel.track([_BLACK])), "ndarray among the frames: give pairs"),
        (lambda: list(heel.track("walk.mp4")), "str among the frames: give pairs"),
        (lambda: heel.open(SCENE, follower={"distance_m": 2.0}), "dict: give a heel.FollowerSett"),
        (lambda: heel.open(SCENE, tracker=heel.FollowerSettings()), "give a heel.TrackerSettings"),
        (lambda: heel.Tracker(detector="mixture"), "type str: give a heel.DetectorSettings"),
    ],
)  # fmt: skip
def test_mistakes_are_told_with_their_remedy(mistake: Callable[[], object], complaint: str) -> None:
    with pytest.raises(heel.HeelError, match=complaint):
        mistake()


def test_a_refused_age_leaves_the_follower_as_it_was() -> None:
    follower = heel.Follower()
    with pytest.raises(heel.HeelError, match="age"):
        follower.update(_BLACK, 1.0, math.inf)
    assert follower.update(_BLACK, 0.5).index == 0


def test_a_wrong_setting_is_named() -> None:
    with pytest.raises(ValueError, match="max_linear"):
        heel.FollowerSettings.model_validate({"max_linear": 1.0})


def test_grey_pictures_are_tracked_as_well() -> None:
    assert heel.Tracker().update(np.zeros((48, 64), np.uint8), 0.0) == ()
