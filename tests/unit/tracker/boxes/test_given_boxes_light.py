"""Light changes at once, people do not: a new look alone does not end who is in sight."""

from __future__ import annotations

import numpy as np
import pytest

from heel.services.tracker.boxes.frame import checked
from heel.services.tracker.boxes.sequence import box_tracker
from heel.services.tracker.people.appearance import DESCRIPTOR_LENGTH
from heel.services.tracker.people.tuning import ROBOT

FRAME_S = 0.05
BOX = np.array([[300.0, 150.0, 380.0, 400.0]])
LIGHT, DARK = np.eye(DESCRIPTOR_LENGTH)[[0, 1]]


@pytest.mark.parametrize(
    ("gap_s", "kept"),
    [
        pytest.param(0.0, True, id="no gap"),
        pytest.param(0.15, True, id="missed for a moment"),
        pytest.param(0.8, False, id="gone for longer: it may be somebody else"),
    ],
)
def test_somebody_who_looks_different_is_the_same_only_without_a_gap(
    gap_s: float, kept: bool
) -> None:
    tracker = box_tracker(ROBOT, (640, 480))
    t_s = 0.0
    for look in [LIGHT] * 40 + [None] * round(gap_s / FRAME_S) + [DARK] * 20:
        t_s += FRAME_S
        seen = look is not None
        looks = np.zeros((0, DESCRIPTOR_LENGTH)) if look is None else look[None]
        found = tracker.update(checked(BOX[:seen], np.ones(int(seen)), looks), t_s)

    ids = {output.id for output in found if output.state == "tracked"}
    assert ids == ({1} if kept else {2})
