"""Who has fallen silent, and that somebody who slept accuses nobody."""

from __future__ import annotations

from heel.services.run.silence import Silences


def test_the_longest_silence_is_named_once_it_is_too_long() -> None:
    silences = Silences(5.0, "tracker", "follower")
    for tenth in range(100):
        now_s = tenth / 10
        silences.heard("tracker", now_s)
        if tenth < 20:
            silences.heard("follower", now_s)
        silent = silences.look(now_s)
        assert silent == ("follower" if now_s > 6.9 else None), now_s


def test_nobody_is_accused_by_somebody_who_slept() -> None:
    silences = Silences(5.0, "tracker")
    silences.heard("tracker", 0.0)
    assert silences.look(0.1) is None
    assert silences.look(30.0) is None, "what came meanwhile is not read yet"
    for tenth in range(1, 50):
        assert silences.look(30.0 + tenth / 10) is None
    assert silences.look(35.1) == "tracker", "it has been silent since"


def test_strangers_do_not_count() -> None:
    silences = Silences(5.0, "tracker")
    silences.heard("ghost", 0.0)
    for second in range(20):
        assert silences.look(float(second)) is None
