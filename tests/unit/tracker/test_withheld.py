"""People that may be in sight and are not shown: the tracker says why."""

from __future__ import annotations

import pytest

from heel.services.tracker.core import Tracker
from heel.services.tracker.settings import TrackerSettings
from tests.unit.tracker import drawn_detections as boxes
from tests.unit.tracker import drawn_people as regions
from tests.unit.tracker.test_tracker_identity import meeting

WALKER = boxes.Person(boxes.RED, lambda t_s: (100.0 + 60.0 * t_s, 400.0))
TALL = boxes.TALL / boxes.HEIGHT


@pytest.mark.parametrize(
    ("min_height", "seconds", "why"),
    [
        (None, 0.2, "1 not shown: seen too seldom so far, or too far off beside nearer people"),
        (None, 1.0, ""),
        (TALL + 0.1, 1.0, "1 not shown: smaller than tracker.min_height"),
    ],
)
def test_a_box_that_is_not_shown_is_counted_with_its_reason(
    min_height: float | None, seconds: float, why: str
) -> None:
    tracker = Tracker(TrackerSettings(min_height=min_height))
    boxes.follow(tracker, [WALKER], seconds)
    assert tracker.withheld == why


def test_the_reason_goes_with_the_person() -> None:
    tracker = Tracker(TrackerSettings(min_height=TALL + 0.1))
    boxes.follow(tracker, [WALKER], 1.0)
    for seq in range(10, 40):
        tracker.update(boxes.message([], seq, 10.0))
    assert tracker.withheld == ""


def test_before_a_background_sizes_come_first_and_a_step_then() -> None:
    people = meeting(regions.RED, regions.GREEN, turn_back=False)
    tracker, told = Tracker(TrackerSettings()), []
    for seq in range(12):
        regions.follow(tracker, people, range(seq, seq + 1))
        told.append(tracker.withheld)
    assert told[0] == "the sizes of people in this picture are not known yet: somebody has to walk"
    assert "2 not shown: has not moved enough yet" in told
    assert told[-1] == ""


def test_without_frames_there_is_nothing_to_say() -> None:
    assert Tracker(TrackerSettings()).withheld == ""
