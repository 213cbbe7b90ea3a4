from __future__ import annotations

from services.web.estop import StopLatch


def test_a_stop_is_repeated_until_the_follower_confirms_it() -> None:
    latch = StopLatch()
    latch.engage("page", now_s=10.0)
    assert [latch.repeat_due(t) for t in (10.1, 10.5, 10.6, 11.0)] == [False, True, False, True]
    assert latch.pending_s(12.0) == 2.0
    latch.follower_says(True)
    assert not latch.repeat_due(20.0)
    assert latch.engaged
    assert latch.pending_s(20.0) is None


def test_a_follower_that_does_not_know_yet_does_not_undo_a_stop() -> None:
    latch = StopLatch()
    latch.engage("page", now_s=0.0)
    latch.follower_says(False)
    assert latch.engaged
    assert latch.repeat_due(1.0)


def test_a_resume_from_anywhere_ends_the_repeats() -> None:
    latch = StopLatch()
    latch.engage("page", now_s=0.0)
    latch.hear(False, "command line")
    assert not latch.engaged
    assert not latch.repeat_due(9.0)
    latch.engage("page", now_s=10.0)
    latch.release("page")
    assert not latch.engaged
    assert not latch.repeat_due(19.0)


def test_a_stop_of_somebody_else_is_shown_but_not_repeated() -> None:
    latch = StopLatch()
    latch.hear(True, "command line")
    assert latch.engaged
    assert latch.source == "command line"
    assert not latch.repeat_due(9.0)


def test_an_older_word_of_the_follower_does_not_hide_a_stop_just_heard() -> None:
    latch = StopLatch()
    latch.hear(True, "command line")
    latch.follower_says(False)
    assert latch.engaged


def test_the_followers_word_holds_after_a_lost_message() -> None:
    latch = StopLatch()
    latch.follower_says(True)
    assert latch.engaged
    latch.follower_says(False)
    assert not latch.engaged
