"""What `heel status` says of the follower."""

from __future__ import annotations

from heel.schemas import FollowState, Target
from heel.services.commands.observed import facts

STATE = FollowState(
    seq=1, state="idle", reason="no target", estop=False, target=Target(seq=0, mode="none"),
    linear_mps=0.0, angular_radps=0.0,
)  # fmt: skip


def test_without_ranges_it_is_said_that_nothing_looks_out_for_obstacles() -> None:
    assert facts(STATE) == "0.00 m/s, nothing looks out for obstacles"


def test_distance_confidence_and_why_this_speed() -> None:
    state = STATE.model_copy(update={
        "distance_m": 2.51, "identity_confidence": 0.91, "runner_up_confidence": 0.2,
        "linear_mps": 0.4, "speed_reason": "speed\nlimit", "obstacle_watch": True,
        "free_distance_m": 3.4,
    })  # fmt: skip
    assert facts(state) == (
        "2.5 m away, 91% sure (next best 20%), 0.40 m/s (speed\\nlimit), "
        "obstacles are watched, 3.4 m free"
    )
