"""What a core raises on one message costs that message, and is said."""

from __future__ import annotations

import logging
import threading
from typing import Any, cast

import pytest
from pydantic import ValidationError

from heel.schemas import Progress
from heel.services.follower.core import Follower
from heel.services.follower.settings import FollowerSettings
from heel.services.runtime.counters import ServiceStatistics
from heel.services.runtime.notify import Notifier
from heel.services.runtime.service import ServiceContext
from heel.services.runtime.settings import ServiceSettings


@pytest.fixture
def context() -> ServiceContext[ServiceSettings]:
    nothing = cast(Any, None)
    return ServiceContext(
        name="tracker", settings=ServiceSettings(), session=nothing, inbox=nothing,
        statistics=ServiceStatistics(), log=logging.getLogger("heel.test"),
        producer="tracker/main@00000001", shared_memory=False, stop=threading.Event(),
        announce=lambda: None, robot="robot", notifier=Notifier({}, logging.getLogger("heel.test")),
    )  # fmt: skip


def test_an_error_is_counted_said_and_logged_with_its_place(
    context: ServiceContext[ServiceSettings], caplog: pytest.LogCaptureFixture
) -> None:
    for _ in range(3):
        with context.surviving("tracking"):
            Progress(stream="front", epoch=-1, seq=0)
    with context.surviving("tracking"):
        pass
    assert context.statistics.failed == 3
    (problem,) = context.statistics.problems()
    assert problem.startswith("tracking failed: ValidationError: 1 validation error for Progress")
    assert len(caplog.records) == 1, "the same error is news once"
    assert caplog.records[0].exc_info is not None
    assert caplog.records[0].exc_info[0] is ValidationError


def test_who_wants_to_end_the_process_may(context: ServiceContext[ServiceSettings]) -> None:
    with pytest.raises(KeyboardInterrupt), context.surviving("tracking"):
        raise KeyboardInterrupt


def test_a_follower_that_cannot_compute_says_stand() -> None:
    follower = Follower(FollowerSettings())
    before = follower.step(1.0, None)
    command = follower.halt("the follower cannot compute a command")
    assert (command.linear_mps, command.angular_radps, command.state) == (0.0, 0.0, "stopped")
    assert command.seq == before.seq + 1
    assert follower.state.reason == "the follower cannot compute a command"
    assert follower.step(1.02, None).seq == command.seq + 1
