"""Valid messages of any content end no core: a service lives whatever others send."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import cv2
import msgpack
import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from heel.schemas import Blobs, MessageError, Tracks, decode, encode
from heel.schemas.errors import SettingsError
from heel.services.detector.core import Detector
from heel.services.detector.settings import DetectorSettings
from heel.services.tracker.core import Tracker
from heel.services.tracker.settings import TrackerSettings
from tests.support.arrivals import frame
from tests.support.generated import valid_maps, with_boxes_by_the_frame

_QUICK = settings(
    max_examples=60, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck),
    phases=[Phase.generate],
)  # fmt: skip
_SAME = ("stream", "epoch", "width", "height")


@pytest.fixture(autouse=True, scope="module")
def one_thread() -> None:
    cv2.setNumThreads(1)


@_QUICK
@given(st.lists(valid_maps("blobs"), min_size=2, max_size=5), st.sampled_from(["default", "paper"]))
def test_any_valid_blobs_give_valid_tracks(maps: list[dict[str, Any]], preset: str) -> None:
    tracker = Tracker(TrackerSettings.model_validate({"preset": preset}))
    for fields in maps:
        # Of one scene, so that what is tracked meets what comes next.
        fields = with_boxes_by_the_frame(fields | {key: maps[0][key] for key in _SAME})
        with suppress(MessageError, SettingsError):
            encode(tracker.update(decode(Blobs, msgpack.packb(fields))))


@_QUICK
@given(valid_maps("tracks"), st.integers(1, 64), st.integers(1, 64))
def test_any_valid_tracks_leave_the_detector_whole(
    fields: dict[str, Any], width: int, height: int
) -> None:
    same_scene = {"stream": "front", "epoch": 1, "width": width, "height": height}
    feedback = decode(Tracks, msgpack.packb(fields | same_scene))
    detector = Detector(DetectorSettings())
    for seq in range(2):
        image = np.full((height, width, 3), 50 + seq, np.uint8)
        encode(detector.detect(frame(seq), image, (width, height), feedback))
