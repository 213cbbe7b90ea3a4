from __future__ import annotations

import asyncio

from heel.services.web.frames import ViewFrame
from heel.services.web.hub import Hub


def frame(seq: int) -> ViewFrame:
    return ViewFrame({"seq": seq}, b"jpeg")


def test_a_busy_server_loop_gets_one_call_and_the_newest_of_all() -> None:
    async def run() -> None:
        hub = Hub(max_viewers=2)
        calls = 0
        loop = asyncio.get_running_loop()
        schedule = loop.call_soon_threadsafe

        def count(*arguments: object) -> object:
            nonlocal calls
            calls += 1
            return schedule(*arguments)  # type: ignore[arg-type]

        loop.call_soon_threadsafe = count  # type: ignore[method-assign, assignment]
        hub.attach(loop)
        await asyncio.to_thread(_put_many, hub)
        shown = await hub.next_frame(timeout_s=5.0)
        assert shown is not None
        assert shown.header["seq"] == 99 or calls > 1
        assert hub.status()[0] == {"n": 99} or calls > 1
        # One wake-up for all of them would be ideal; one for each would be unbounded.
        assert calls < 100

    asyncio.run(run())


def _put_many(hub: Hub) -> None:
    for n in range(100):
        hub.put_frame(frame(n))
        hub.put_note("status", {"n": n})


def test_places_are_limited_and_given_back() -> None:
    hub = Hub(max_viewers=1)
    with hub.viewer() as first:
        assert first is not None
        assert hub.viewer_count == 1
        with hub.viewer() as second:
            assert second is None
    assert hub.viewer_count == 0
    with hub.viewer() as third:
        assert third is not None


def test_without_a_server_loop_the_newest_waits() -> None:
    async def run() -> None:
        hub = Hub(max_viewers=1)
        hub.put_note("status", {"n": 1})
        hub.put_note("status", {"n": 2})
        hub.attach(asyncio.get_running_loop())
        async with asyncio.timeout(5.0):
            while not hub.status()[0]:
                await asyncio.sleep(0)
        assert hub.status()[0] == {"n": 2}

    asyncio.run(run())


def test_many_who_want_one_picture_take_nobodys_place_and_get_the_same() -> None:
    async def run() -> None:
        hub = Hub(max_viewers=1)
        hub.attach(asyncio.get_running_loop())
        waiting = [asyncio.create_task(hub.next_frame(5.0)) for _ in range(50)]
        await asyncio.sleep(0)
        assert hub.watched, "so that a picture is coded at all"
        with hub.viewer() as viewer:
            assert viewer is not None
        hub.put_frame(frame(7))
        shown = await asyncio.gather(*waiting)
        assert {one.header["seq"] for one in shown if one is not None} == {7}
        assert not hub.watched
        assert hub.viewer_count == 0

    asyncio.run(run())


def test_nobody_waits_for_ever_for_a_picture() -> None:
    async def run() -> None:
        hub = Hub(max_viewers=1)
        assert await hub.next_frame(timeout_s=0.01) is None
        assert not hub.watched

    asyncio.run(run())
