"""Which tracks depth is measured for; the identities and boxes are those without it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from heel.schemas import Track, Tracks, encode
from heel.services.geometry.camera import Pinhole
from heel.services.tracker.depth_places import with_depth

CAMERA = Pinhole.from_fov(640, 480, math.pi / 2)
BOX = (288.0, 96.0, 352.0, 368.0)


def track(track_id: int, **changes: object) -> Track:
    values: dict[str, object] = {
        "id": track_id, "state": "tracked", "box_xyxy": BOX, "velocity_pxps": (0.0, 0.0),
        "area_px": 1.0, "span_px": 1.0, "identity_confidence": 0.9, "shown": True,
    }  # fmt: skip
    return Track.model_validate(values | changes)


def tracks(*people: Track) -> Tracks:
    return Tracks(
        stream="front", epoch=1, seq=0, index=0, t_capture_ns=0, width=640, height=480,
        source_width=640, source_height=480, tracks=people,
    )  # fmt: skip


def flat(millimetres: int) -> np.ndarray:
    return np.full((240, 320), millimetres, np.uint16)


def test_a_tracked_person_gets_a_place_and_keeps_everything_else() -> None:
    before = tracks(track(1))
    after = with_depth(before, flat(2000), CAMERA)
    (person,) = after.tracks
    assert person.distance_m == pytest.approx(2.11, abs=0.02)
    assert person.distance_sigma_m == pytest.approx(0.045, abs=0.01)
    assert person.bearing_rad == pytest.approx(0.0, abs=0.02)
    assert person.bearing_sigma_rad == pytest.approx(0.025, abs=0.01)
    places = ("distance_m", "distance_sigma_m", "bearing_rad", "bearing_sigma_rad")
    assert after.model_copy(update={"tracks": (person.model_copy(update=dict.fromkeys(places)),)}
                            ) == before  # fmt: skip
    encode(after)


@pytest.mark.parametrize(
    "changes",
    [
        {"state": "lost", "missed_frames": 3}, {"state": "occluded"}, {"state": "new"},
        {"distance_m": 1.0},
    ],
)  # fmt: skip
def test_who_is_not_measured_on_their_own_or_has_a_place_is_left_as_they_are(
    changes: dict[str, object],
) -> None:
    before = tracks(track(1, **changes))
    assert with_depth(before, flat(2000), CAMERA) == before


def test_nothing_measured_is_nothing_told() -> None:
    before = tracks(track(1))
    assert with_depth(before, flat(0), CAMERA) == before


def test_who_stands_before_somebody_is_not_measured_for_them() -> None:
    depth = flat(2500)
    depth[:, 150:165] = 1800
    front = track(2, box_xyxy=(300.0, 60.0, 330.0, 420.0))
    behind, nearer = with_depth(tracks(track(1), front), depth, CAMERA).tracks
    assert behind.distance_m == pytest.approx(2.61, abs=0.02)
    assert nearer.distance_m == pytest.approx(1.91, abs=0.02)
