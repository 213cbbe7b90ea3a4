"""Which person a track is really on."""

from __future__ import annotations

import pytest

from heel.schemas import Pose, SimPerson, SimTruth, Track, Tracks
from heel.services.loops.judge import people_by_track

Box = tuple[float, float, float, float]
TARGET, OTHER = 0, 1
LEFT: Box = (100.0, 100.0, 160.0, 300.0)
RIGHT: Box = (400.0, 100.0, 460.0, 300.0)
NEAR_LEFT: Box = (120.0, 100.0, 180.0, 300.0)
CUT_OFF: Box = (-40.0, 100.0, 60.0, 700.0)
CUT_OFF_TRACK: Box = (0.0, 100.0, 60.0, 480.0)


def truth(target: Box | None, other: Box | None, target_visible: float = 1.0,
          other_visible: float = 1.0) -> SimTruth:  # fmt: skip
    pose = Pose(x_m=0.0, y_m=0.0, heading_rad=0.0)
    people = tuple(
        SimPerson(
            id=number, role=role, pose=pose, speed_mps=0.0, height_m=1.7, radius_m=0.2,
            box_xyxy=box, visible=visible,
        )
        for number, role, box, visible in (
            (1, "target", target, target_visible), (2, "other", other, other_visible),
        )
    )  # fmt: skip
    return SimTruth(
        seq=0, t_s=0.0, robot=pose, robot_radius_m=0.25, linear_mps=0.0, angular_radps=0.0,
        people=people,
    )  # fmt: skip


def tracks(boxes: dict[int, Box]) -> Tracks:
    return Tracks(
        stream="front", epoch=1, seq=0, index=0, t_capture_ns=0, width=640, height=480,
        source_width=640, source_height=480,
        tracks=tuple(
            Track(
                id=number, state="tracked", box_xyxy=box, velocity_pxps=(0.0, 0.0), area_px=1.0,
                span_px=1.0, identity_confidence=1.0, shown=True,
            )
            for number, box in boxes.items()
        ),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("seen", "boxes", "expected"),
    [
        pytest.param(
            truth(LEFT, RIGHT), {7: LEFT, 8: RIGHT}, {7: TARGET, 8: OTHER}, id="each on one"
        ),
        pytest.param(truth(LEFT, RIGHT), {7: RIGHT}, {7: OTHER}, id="on the other"),
        pytest.param(truth(LEFT, None), {7: RIGHT}, {}, id="on nobody"),
        pytest.param(
            truth(LEFT, NEAR_LEFT), {7: NEAR_LEFT, 8: LEFT}, {7: OTHER, 8: TARGET}, id="overlap"
        ),
        pytest.param(
            truth(LEFT, NEAR_LEFT, target_visible=0.0), {7: LEFT, 8: NEAR_LEFT},
            {7: TARGET, 8: OTHER}, id="predicted behind somebody is still the target's",
        ),
        pytest.param(
            truth(RIGHT, LEFT, other_visible=0.0), {7: LEFT}, {},
            id="a track cannot lie on others who are not to be seen",
        ),
        pytest.param(
            truth(CUT_OFF, RIGHT), {7: CUT_OFF_TRACK}, {7: TARGET},
            id="what is outside the picture does not count",
        ),
    ],
)  # fmt: skip
def test_who_a_track_is_on(seen: SimTruth, boxes: dict[int, Box], expected: dict[int, int]) -> None:
    assert people_by_track(seen, tracks(boxes)) == expected
