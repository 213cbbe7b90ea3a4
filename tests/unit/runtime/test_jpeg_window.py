"""A slow receiver elsewhere costs frames; one that is gone costs the others a moment at most."""

from __future__ import annotations

import itertools

from heel.services.runtime.jpeg_window import (
    FORGET_S,
    LATE_S,
    PATIENCE_S,
    WINDOW_FRAMES,
    JpegWindow,
)

RATE_HZ = 25


def play(seconds: float, lag_s: dict[str, float], until_s: dict[str, float]) -> list[float]:
    """Times at which frames go out to receivers that confirm after a lag, until they fall silent.

    One frame at a time is on a receiver's link, as on a slow one.
    """
    window, sent_s, free_s = JpegWindow(), list[float](), dict.fromkeys(lag_s, 0.0)
    due: list[tuple[float, str, int]] = []
    for seq in range(round(seconds * RATE_HZ)):
        now_s = seq / RATE_HZ
        for one in sorted(one for one in due if one[0] <= now_s):
            due.remove(one)
            window.heard(one[1], 7, one[2], one[0])
        if not window.may_send(7, now_s):
            continue
        window.sent(seq, now_s)
        sent_s.append(now_s)
        for name, lag in lag_s.items():
            free_s[name] = max(free_s[name], now_s) + lag
            if free_s[name] <= until_s.get(name, seconds):
                due.append((free_s[name], name, seq))
    return sent_s


def test_every_frame_goes_to_a_receiver_that_keeps_up() -> None:
    assert len(play(4.0, {"detector-main": 0.005}, {})) == 100


def test_a_link_that_takes_two_frames_in_time_is_kept_busy() -> None:
    sent_s = play(20.0, {"detector-main": 0.065}, {})
    assert len(sent_s) >= 0.95 * 20.0 / 0.065
    assert all(late - early >= 0.1 for early, late in zip(sent_s[9:], sent_s[11:], strict=False))


def test_a_slow_link_gets_as_many_as_it_takes_one_by_one_and_no_queue() -> None:
    sent_s = play(20.0, {"detector-main": 0.19}, {})
    assert len(sent_s) >= 0.9 * 20.0 / 0.2
    # Before the next one goes out, the frame before has arrived: nothing else waits behind two.
    assert all(late - early > 0.18 for early, late in itertools.pairwise(sent_s[10:]))


def test_a_link_that_is_fast_again_has_two_frames_on_their_way_again() -> None:
    window = JpegWindow()

    def may_send_two(took_s: float, now_s: float, seq: int) -> bool:
        assert window.may_send(1, now_s)
        window.sent(seq, now_s)
        window.heard("web-main", 1, seq, now_s + took_s)
        sent = [window.may_send(1, now_s + 1.0)]
        window.sent(seq + 1, now_s + 1.0)
        sent.append(window.may_send(1, now_s + 1.0))
        window.heard("web-main", 1, seq + 1, now_s + 1.0 + took_s)
        return all(sent)

    may_send_two(0.01, 0.0, 0)
    assert may_send_two(0.01, 2.0, 2)
    assert not may_send_two(LATE_S + 0.01, 4.0, 4)
    assert not may_send_two(0.75 * LATE_S, 6.0, 6), "two would take too long"
    assert may_send_two(0.25 * LATE_S, 8.0, 8)


def test_the_slowest_counts() -> None:
    assert len(play(20.0, {"detector-main": 0.005, "web-main": 0.5}, {})) <= 45


def test_a_receiver_that_falls_silent_is_let_off_now_and_then_and_forgotten_soon() -> None:
    sent_s = play(10.0, {"detector-main": 0.005, "web-main": 0.005}, {"web-main": 2.0})
    during = [one for one in sent_s if 2.2 < one < 2.0 + FORGET_S]
    assert 1 <= len(during) <= 2 * FORGET_S / PATIENCE_S
    after = [one for one in sent_s if one > 2.3 + FORGET_S]
    assert len(after) >= 0.95 * (10.0 - 2.3 - FORGET_S) * RATE_HZ


def test_listeners_that_never_confirm_get_every_frame() -> None:
    assert len(play(2.0, {}, {})) == 50


def test_what_was_never_sent_and_what_is_old_confirms_nothing() -> None:
    window = JpegWindow()
    assert window.may_send(1, 0.0)
    window.sent(0, 0.0)
    window.heard("liar", 1, 10**12, 0.0)
    window.heard("late", 2, 0, 0.0)
    window.heard("web-main", 1, 0, 0.0)
    for seq in range(1, 1 + WINDOW_FRAMES):
        assert window.may_send(1, 0.1)
        window.sent(seq, 0.1)
    window.heard("web-main", 1, 0, 0.1)
    assert not window.may_send(1, 0.1)
    assert window.may_send(2, 0.1), "another start of the camera"


def test_receivers_without_number_hold_up_nothing() -> None:
    window = JpegWindow()
    window.may_send(1, 0.0)
    window.sent(0, 0.0)
    for number in range(100_000):
        window.heard(f"one-{number}", 1, 0, 0.0)
    assert len(window._receivers) <= 16
