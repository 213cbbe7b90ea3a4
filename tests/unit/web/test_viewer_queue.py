from __future__ import annotations

from heel.services.web.frames import ViewFrame
from heel.services.web.viewer import ViewerQueue


def frame(seq: int) -> ViewFrame:
    return ViewFrame({"seq": seq}, b"jpeg")


def test_the_newest_picture_wins_and_the_others_are_counted() -> None:
    queue = ViewerQueue()
    for seq in range(5):
        queue.offer_frame(frame(seq))
    assert queue.take_frame() == (1, frame(4))
    assert queue.dropped == 4
    assert queue.take_frame() is None


def test_a_viewer_that_does_not_acknowledge_gets_no_more() -> None:
    queue = ViewerQueue(max_in_flight=2)
    sent = 0
    for seq in range(100):
        queue.offer_frame(frame(seq))
        sent += queue.take_frame() is not None
    assert sent == 2
    assert queue.dropped == 97
    assert queue.acknowledge(1)
    assert queue.take_frame() == (3, frame(99))


def test_acknowledgements_may_come_out_of_order_but_not_for_what_was_never_sent() -> None:
    queue = ViewerQueue(max_in_flight=2)
    for seq in range(2):
        queue.offer_frame(frame(seq))
        queue.take_frame()
    assert queue.acknowledge(2)
    assert queue.acknowledge(1)
    assert not queue.acknowledge(3)
    assert not queue.acknowledge(0)
    assert not queue.acknowledge(-1)


def test_only_the_newest_note_of_each_kind_waits() -> None:
    queue = ViewerQueue()
    for text in ("old", "new"):
        queue.offer_note("status", text)
        queue.offer_note("sim-truth", f"{text} truth")
    assert {queue.take_note(), queue.take_note()} == {"new", "new truth"}
    assert queue.take_note() is None
