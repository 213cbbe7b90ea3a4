"""Two meet and go out of sight before anybody can tell who is who: it is told when one is back."""

from __future__ import annotations

import pytest

from heel.services.tracker.core import Tracker
from heel.services.tracker.settings import TrackerSettings
from heel.services.tracker.trace import Event, Trace
from tests.unit.tracker.drawn_detections import RED, Colours, Person, follow

MEET_S, HIDDEN_S = 3.0, (3.05, 5.65)
"""Both are behind a wall for longer than a track takes boxes."""
OTHER_TROUSERS = RED[0], (120, 60, 60)


def crossing(colours: Colours, direction: float, back: bool) -> Person:
    """A walk along one line in front of the camera, in the middle of the picture at `MEET_S`."""

    def where(t_s: float) -> tuple[float, float] | None:
        if HIDDEN_S[0] < t_s < HIDDEN_S[1] or (t_s > HIDDEN_S[1] and not back):
            return None
        return 320.0 + direction * 40.0 * (t_s - MEET_S), 400.0

    return Person(colours, where)


def test_a_contact_is_decided_by_the_looks_of_the_one_who_is_back(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Drawn people walk too evenly to be confused as soon as recorded ones are.
    monkeypatch.setattr("heel.services.tracker.boxes.front_end._CONTACT", 1e-9)
    events: list[Event] = []
    people = [crossing(RED, 1.0, back=False), crossing(OTHER_TROUSERS, -1.0, back=True)]
    frames = follow(Tracker(TrackerSettings(), trace=Trace(events.append)), people, 8.0)
    back = max(track.id for track in frames[20].tracks)
    assert [track.id for track in frames[-1].tracks if track.shown] == [back]
    kinds = [event.kind for event in events]
    assert "contact" in kinds
    assert "re-identified" in kinds[kinds.index("contact") :]
    decided = [event.outcome for event in events if event.kind == "decided"]
    assert decided == ["kept"]
