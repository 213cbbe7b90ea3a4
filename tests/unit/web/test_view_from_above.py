from __future__ import annotations

import json

from heel.schemas import DriveState, Health
from heel.services.simulator.scenarios import scenario
from heel.services.simulator.state import CameraMount
from heel.services.web.above import describe_truth, describe_world
from heel.services.web.status import StatusBoard


def test_world_and_truth_are_plain_json_of_bounded_size() -> None:
    world = scenario("crowd", 1)
    described = describe_world(world.world_message())
    assert described["type"] == "sim-world"
    assert len(described["obstacles"]) == len(world.scenery.obstacles)
    truth = describe_truth(world.truth(5, CameraMount()))
    assert (truth["type"], truth["seq"]) == ("sim-truth", 5)
    assert [person["role"] for person in truth["people"]] == [p.role for p in world.people]
    for note in (described, truth):
        assert json.loads(json.dumps(note)) == note
    assert len(json.dumps(truth)) < 200 * len(world.people)


def test_the_wheels_and_their_silence_are_shown() -> None:
    board = StatusBoard("front", 1.0)
    assert board.compose(1.0)["drive"] is None
    board.drive(
        DriveState(seq=1, state="stopped", reason="e-stop", estop=True, driver="simulated",
                   linear_mps=0.0, angular_radps=0.0), 2.0)  # fmt: skip
    shown = board.compose(2.5)["drive"]
    assert (shown["state"], shown["linear_mps"], shown["age_s"]) == ("stopped", 0.0, 0.5)


def test_notices_last_as_long_as_their_service() -> None:
    board = StatusBoard("front", 1.0)

    def say(state: str, now_s: float) -> None:
        board.health(
            Health.model_validate({
                "service": "simulator", "instance": "main", "producer": "simulator/main@0123abcd",
                "state": state, "uptime_s": 1.0, "loop_age_s": 0.0, "software_version": "1",
                "details": {"notice": "not seen in pixels" + "!" * 500},
            }), now_s)  # fmt: skip

    say("ok", 1.0)
    (notice,) = board.compose(2.0)["notices"]
    assert notice["service"] == "simulator"
    assert notice["text"].startswith("not seen in pixels!")
    assert len(notice["text"]) <= 200
    assert board.compose(20.0)["notices"] == []
    say("ok", 21.0)
    assert board.compose(21.0)["notices"]
    say("ended", 22.0)
    assert board.compose(22.0)["notices"] == []
