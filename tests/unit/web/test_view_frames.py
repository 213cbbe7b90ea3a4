from __future__ import annotations

import json

from heel.services.web.frames import ViewFrame, describe
from heel.services.web.joiner import HeldImage, Joined
from tests.unit.web.web_builders import TRACKER, follow_state, header, held, track, tracks


def unpack(packed: bytes) -> tuple[dict[str, object], bytes]:
    length = int.from_bytes(packed[:4], "big")
    return json.loads(packed[4 : 4 + length]), packed[4 + length :]


def test_one_message_carries_picture_and_people() -> None:
    joined = Joined(held(7), tracks(7, people=(track(3),)), TRACKER)
    packed = ViewFrame(describe(joined, None, 0.05), b"\xff\xd8jpeg").pack(number=12, dropped=4)
    head, jpeg = unpack(packed)
    assert jpeg == b"\xff\xd8jpeg"
    assert (head["seq"], head["number"], head["dropped"], head["age_ms"]) == (7, 12, 4, 50.0)
    (person,) = head["tracks"]  # type: ignore[misc]
    assert person["id"] == 3
    assert person["box"] == [1.0, 2.0, 11.0, 32.0]


def test_a_frame_without_tracks_is_not_a_frame_without_people() -> None:
    assert describe(Joined(held(7), None, None), None, 0.0)["tracks"] is None
    assert describe(Joined(held(7), tracks(7), TRACKER), None, 0.0)["tracks"] == []


def test_the_epoch_survives_javascript_numbers() -> None:
    image = HeldImage(header(0, epoch=2**62 + 1), b"", 0.0)
    assert describe(Joined(image, None, None), None, 0.0)["epoch"] == str(2**62 + 1)


def test_another_trackers_target_is_not_marked() -> None:
    joined = Joined(held(7), tracks(7, people=(track(3),)), TRACKER)
    ours, theirs = follow_state(3, TRACKER), follow_state(3, "tracker/main@99999999")
    assert describe(joined, ours, 0.0)["target"] == {"id": 3, "state": "following"}
    assert describe(joined, theirs, 0.0)["target"] is None
    assert describe(joined, follow_state(None), 0.0)["target"] is None
