from __future__ import annotations

import json

from schemas import EndOfStream, Health, MotionCommand
from services.web.status import MAX_SERVICES, StatusBoard
from tests.unit.web.web_builders import follow_state, header


def health(service: str, instance: str = "main") -> Health:
    return Health(
        service=service, instance=instance, producer=f"{service}/{instance}@0123abcd",
        state="ok", uptime_s=1.0, loop_age_s=0.0, software_version="1",
    )  # fmt: skip


def test_ages_grow_while_nothing_comes() -> None:
    board = StatusBoard("front", 1.0)
    assert board.compose(5.0)["picture"]["age_s"] is None
    board.image(header(0), 5.0)
    board.tracks(5.1)
    board.health(health("tracker"), 5.0)
    board.command(
        MotionCommand(seq=0, linear_mps=0.2, angular_radps=0.1, ttl_s=0.5, state="following",
                      reason="x"), 5.5)  # fmt: skip
    status = board.compose(6.2)
    assert status["picture"]["age_s"] == 1.2
    assert status["picture"]["tracks_age_s"] == 1.1
    assert status["command"]["age_s"] == 0.7
    assert status["services"][0]["silent_s"] == 1.2


def test_an_ended_stream_stays_ended_until_another_begins() -> None:
    board = StatusBoard("front", 1.0)
    board.image(header(9, epoch=1), 1.0)
    board.end(EndOfStream(stream="front", epoch=1, frames=10, reason="end of file"))
    assert board.compose(2.0)["picture"]["ended"] == {"frames": 10, "reason": "end of file"}
    board.image(header(9, epoch=1), 2.0)
    assert board.has_ended
    board.image(header(0, epoch=2), 3.0)
    assert not board.has_ended


def test_services_are_bounded_and_forgotten() -> None:
    board = StatusBoard("front", 1.0)
    for n in range(100):
        board.health(health("tracker", f"i{n}"), float(n) * 0.1)
    assert len(board.compose(10.0)["services"]) == MAX_SERVICES
    assert board.compose(100.0)["services"] == []


def test_status_is_plain_json() -> None:
    board = StatusBoard("front", 1.0)
    board.follower = follow_state(3, "tracker/main@0123abcd")
    board.health(health("tracker"), 1.0)
    status = board.compose(1.0)
    assert json.loads(json.dumps(status)) == status
    assert status["follower"]["target"]["track_id"] == 3
