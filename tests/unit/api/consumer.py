"""A program that uses `heel`, as its author's type checker sees it; `make types` checks it."""

from __future__ import annotations

from pathlib import Path
from typing import assert_type

import numpy as np
from numpy.typing import NDArray

import heel


def walk(path: Path) -> list[tuple[int, float]]:
    """Ids and confidences of all people in a recording."""
    settings = heel.FollowerSettings(max_linear_mps=0.5)
    found = []
    with heel.open(path, target=(100.0, 80.0), model="people.onnx", follower=settings) as video:
        assert_type(video, heel.Video)
        for frame in video:
            assert_type(frame, heel.Frame)
            assert_type(frame.image, NDArray[np.uint8])
            assert_type(frame.people, tuple[heel.Track, ...])
            assert_type(frame.command.linear_mps, float)
            assert_type(frame.target, heel.Track | None)
            found += [(one.id, one.identity_confidence) for one in frame.people]
        assert_type(video.choose("nearest"), heel.Target)
    return found


def own_pictures(images: list[NDArray[np.uint8]]) -> None:
    """Pictures of one's own."""
    tracker = heel.Tracker(tracker=heel.TrackerSettings(preset="paper"))
    assert_type(tracker.update(images[0], 0.0), tuple[heel.Track, ...])
    follower = heel.Follower(target=7, detector=heel.DetectorSettings(work_width_px=320))
    assert_type(follower.update(images[0], time_s=0.0, age_s=0.05), heel.Frame)
    for frame in heel.track((image, n / 25.0) for n, image in enumerate(images)):
        assert_type(frame.state, heel.FollowState)


def messages(payload: bytes) -> bytes:
    """Messages of the wire."""
    tracks = heel.decode(heel.Tracks, payload)
    assert_type(tracks, heel.Tracks)
    return heel.encode(tracks)


def mistakes() -> None:
    """What a checker must refuse; it complains about an ignored line that has no mistake."""
    heel.opne("walk.mp4")  # type: ignore[attr-defined]
    heel.open("walk.mp4", target="somebody")  # type: ignore[arg-type]
    heel.FollowerSettings(max_linear="fast")  # type: ignore[call-arg]
