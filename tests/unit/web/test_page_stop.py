"""What the page makes of the emergency stop."""

from __future__ import annotations

from heel.schemas import EStop
from heel.services.web.estop import PageStop

A, B = "a" * 16, "b" * 16


def pressed(name: str = A) -> EStop:
    return EStop(engaged=True, source="page", t_ns=5, id=name)


def released(name: str = A) -> EStop:
    return EStop(engaged=False, source="command line", t_ns=6, id=name)


def test_a_stop_is_repeated_until_the_drive_confirms_it() -> None:
    page = PageStop()
    page.says("drive", False, 9.9)
    page.engage(pressed(), 10.0)
    assert [page.repeat_due(t) for t in (10.1, 10.25, 10.3, 10.5)] == [False, True, False, True]
    page.says("follower", True, 11.0)
    assert page.pending_s(12.0) == 2.0, "the follower turns no wheels"
    page.says("drive", True, 12.0)
    assert not page.repeat_due(20.0)
    assert page.engaged(20.0)
    assert page.pending_s(20.0) is None


def test_without_a_drive_the_follower_confirms() -> None:
    page = PageStop()
    page.engage(pressed(), 10.0)
    page.says("follower", True, 10.1)
    assert page.pending() is None


def test_a_robot_that_does_not_know_yet_does_not_undo_a_stop() -> None:
    page = PageStop()
    page.engage(pressed(), 0.0)
    for step in range(1, 100):
        page.says("follower", False, 0.1 * step)
        page.settle(0.1 * step)
    assert page.engaged(9.9)
    assert page.repeat_due(9.9)


def test_a_release_of_that_engagement_ends_the_repeats() -> None:
    page = PageStop()
    page.engage(pressed(), 0.0)
    page.hear(released(B), 1.0)
    assert page.engaged(1.0)
    assert page.repeat_due(1.0)
    page.hear(released(A), 2.0)
    assert not page.engaged(2.0)
    assert not page.repeat_due(9.0)


def test_a_stop_of_somebody_else_is_shown_but_not_repeated() -> None:
    page = PageStop()
    page.hear(pressed(), 0.0)
    assert page.engaged(0.0)
    assert page.source == "page"
    assert not page.repeat_due(9.0)


def test_resume_releases_every_engagement_that_is_known() -> None:
    page = PageStop()
    page.hear(pressed(A), 0.0)
    page.hear_answers([pressed(A), pressed(B), released(A)], 1.0)
    assert {(one.engaged, one.id) for one in page.releases("page")} == {(False, A), (False, B)}
    assert all(one.t_ns >= 5 for one in page.releases("page"))


def test_what_the_robot_says_holds_after_a_lost_message() -> None:
    page = PageStop()
    page.says("follower", True, 10.0)
    assert page.engaged(10.0), "it is shown at once"
    assert page.told is None, "and told to others when it stays so"
    for step in range(20):
        page.says("follower", True, 10.0 + 0.1 * step)
        page.settle(10.0 + 0.1 * step)
    assert page.told is not None
    assert page.told.engaged
    for step in range(60):
        page.says("follower", False, 12.0 + 0.1 * step)
        page.settle(12.0 + 0.1 * step)
    assert not page.engaged(18.0)
    assert page.told is None


def test_a_part_that_was_there_and_is_silent_is_named() -> None:
    page = PageStop()
    assert page.silent(0.0) is None
    page.says("drive", True, 0.0)
    page.says("follower", True, 2.0)
    assert page.silent(0.5) is None
    assert page.silent(2.5) == "drive"
    assert page.silent(20.0) is None, "it has gone"
