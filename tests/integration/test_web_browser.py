"""The page as a person meets it: headless Chromium against the real process."""

from __future__ import annotations

import queue
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import pytest
import zenoh

from heel.schemas import (
    EStop,
    FollowState,
    FrameId,
    HeelError,
    Manual,
    ManualGrant,
    ManualRequest,
    Stamp,
    Target,
    TargetRequest,
    TrackEvent,
    decode,
    encode,
    keys,
)
from heel.services.runtime.router import RouterSettings, open_router
from tests.support.network import client, collected, router, wait_until
from tests.support.web_page import (
    STANDER,
    STANDER_BOX,
    STEP_PX,
    TRACKER,
    WIDTH_PX,
    DrawnStream,
    browser,
    walker_box,
    web_process,
)

if TYPE_CHECKING:
    from selenium.webdriver import Chrome

pytestmark = pytest.mark.browser

# One script call sees one moment: nothing is drawn between reading the marks and the pixels.
_LOOK = """
const canvas = document.getElementById("picture");
if (!canvas.dataset.seq) return null;
const context = canvas.getContext("2d");
const scale = canvas.width / arguments[0];
const light = (x, y) => context.getImageData(Math.round(x * scale), Math.round(y * scale), 1, 1).data[1];
const boxes = JSON.parse(canvas.dataset.boxes);
return {
  seq: Number(canvas.dataset.seq),
  boxes,
  light: boxes.map(([, left, top, right, bottom]) => {
    const middle = (top + bottom) / 2;
    return [light(left - 10, middle), light(left + 10, middle), light(right - 10, middle), light(right + 10, middle)];
  }),
};
"""  # noqa: E501


@pytest.fixture(scope="module")
def chrome() -> Iterator[Chrome]:
    with browser() as driver:
        yield driver


@pytest.fixture
def endpoint() -> Iterator[str]:
    with router() as address:
        yield address


def text(chrome: Chrome, identity: str) -> str:
    """What a person reads in an element; empty if it is hidden."""
    return str(chrome.find_element("id", identity).text)


def shows(chrome: Chrome, identity: str, words: str) -> None:
    wait_until(lambda: words in text(chrome, identity), f"{words!r} in {identity}")


def open_page(chrome: Chrome, url: str) -> None:
    chrome.get(url)
    wait_until(lambda: text(chrome, "camera") == "front", "the first status")


def click_at(chrome: Chrome, x_px: float, y_px: float) -> None:
    """Click on a point of the picture, in pixels of the frame."""
    from selenium.webdriver import ActionChains

    canvas = chrome.find_element("id", "picture")
    scale = canvas.size["width"] / WIDTH_PX
    dx, dy = x_px * scale - canvas.size["width"] / 2, y_px * scale - canvas.size["height"] / 2
    ActionChains(chrome).move_to_element_with_offset(canvas, round(dx), round(dy)).click().perform()


@contextmanager
def pretended_follower(session: zenoh.Session) -> Iterator[queue.Queue[TargetRequest]]:
    """Answers `follow/target` as a follower would, and tells what it was asked."""
    requests: queue.Queue[TargetRequest] = queue.Queue()

    def answer(query: zenoh.Query) -> None:
        with query:
            assert query.payload is not None
            request = decode(TargetRequest, query.payload.to_bytes(), str(query.encoding))
            requests.put(request)
            if request.mode == "point":
                query.reply_err("nobody there: click on a person")
                return
            target = Target(seq=1, mode=request.mode, track_id=request.track_id)
            query.reply(keys.FOLLOW_TARGET, encode(target), encoding=target.encoding())

    queryable = session.declare_queryable(keys.FOLLOW_TARGET, answer)
    try:
        yield requests
    finally:
        queryable.undeclare()


def tell_state(session: zenoh.Session, estop: bool, track_id: int | None = None) -> None:
    target = Target(seq=1, mode="id" if track_id else "none", track_id=track_id, tracker=TRACKER)
    state = FollowState(
        seq=1, state="stopped" if estop else "following", reason="as the test says", estop=estop,
        target=target, linear_mps=0.0, angular_radps=0.0,
    )  # fmt: skip
    session.put(keys.FOLLOW_STATE, encode(state), encoding=state.encoding())


def test_boxes_are_drawn_over_the_very_frame_they_belong_to(chrome: Chrome, endpoint: str) -> None:
    seen: dict[int, Any] = {}
    with web_process(endpoint) as (url, _), client(endpoint) as session, DrawnStream(session):
        open_page(chrome, url)

        def look() -> bool:
            view = chrome.execute_script(_LOOK, WIDTH_PX)
            if view is not None and len(view["boxes"]) == 2:
                seen[view["seq"]] = view
            return len(seen) >= 20

        wait_until(look, "twenty frames")
        errors = [entry for entry in chrome.get_log("browser") if entry["level"] == "SEVERE"]
        assert errors == []
    # A box of a neighbouring frame would be off by a step and meet the wrong pixels.
    assert STEP_PX > 20
    for seq, view in seen.items():
        assert view["boxes"][0][1:] == list(walker_box(seq))
        for outside_left, inside_left, inside_right, outside_right in view["light"]:
            assert max(outside_left, outside_right) < 60, (seq, view)
            assert min(inside_left, inside_right) > 180, (seq, view)


def test_a_click_on_a_person_asks_the_follower_for_that_person(
    chrome: Chrome, endpoint: str
) -> None:
    with (
        web_process(endpoint) as (url, _),
        client(endpoint) as session,
        pretended_follower(session) as requests,
        DrawnStream(session),
    ):
        open_page(chrome, url)
        wait_until(lambda: chrome.execute_script(_LOOK, WIDTH_PX) is not None, "a picture")
        click_at(chrome, STANDER_BOX[0] + 15, STANDER_BOX[1] + 50)
        request = requests.get(timeout=10)
        assert (request.mode, request.track_id, request.tracker) == ("id", STANDER, TRACKER)
        assert request.x_px == pytest.approx(STANDER_BOX[0] + 15, abs=2)
        shows(chrome, "toast", f"Following person {STANDER}")

        click_at(chrome, 460, 10)
        request = requests.get(timeout=10)
        assert request.mode == "point"
        assert request.x_px == pytest.approx(460, abs=2)
        shows(chrome, "toast", "nobody there: click on a person")

        for mode in ("nearest", "none"):
            chrome.find_element("id", mode).click()
            assert requests.get(timeout=10).mode == mode
        chrome.find_element("css selector", f'#people [data-person="{STANDER}"]').click()
        assert requests.get(timeout=10).track_id == STANDER

        tell_state(session, estop=False, track_id=STANDER)
        shows(chrome, "target", f"person {STANDER}")
        shows(chrome, "reason", "as the test says")
        frame = FrameId(stream="front", epoch=1, seq=1, index=1, t_capture_ns=0)
        for number, words in ((STANDER, "ids 7 and 9 parted"), (STANDER + 1, "of another one")):
            event = TrackEvent(frame=frame, kind="decided", ids=(number,), text=words)
            session.put(
                keys.events("front"), encode(event), encoding=event.encoding(),
                attachment=encode(Stamp(producer=TRACKER, t_sent_ns=0, age_ns=0)),
            )  # fmt: skip
        shows(chrome, "story", "ids 7 and 9 parted")
        assert "of another one" not in text(chrome, "story")


def test_stop_works_without_a_stream_and_resume_appears_only_then(
    chrome: Chrome, endpoint: str
) -> None:
    with (
        web_process(endpoint) as (url, _),
        client(endpoint) as session,
        collected(session, keys.FOLLOW_ESTOP) as stops,
    ):
        open_page(chrome, url)
        shows(chrome, "banners", "Waiting for the first picture")
        assert not chrome.find_element("id", "resume").is_displayed()
        chrome.find_element("id", "stop").click()
        assert _estop(stops).engaged
        shows(chrome, "banners", "nobody has confirmed it")
        assert _estop(stops).engaged, "an unconfirmed stop is repeated"

        tell_state(session, estop=True)
        shows(chrome, "stop", "STOPPED")
        wait_until(lambda: chrome.find_element("id", "resume").is_enabled(), "resume")
        _empty(stops)
        chrome.find_element("id", "resume").click()
        assert not _estop(stops).engaged
        tell_state(session, estop=False)
        wait_until(lambda: not chrome.find_element("id", "resume").is_displayed(), "no resume")

        from selenium.webdriver import ActionChains, Keys

        ActionChains(chrome).send_keys(Keys.ESCAPE).perform()
        assert _estop(stops).engaged


def test_says_when_the_stream_is_stale_and_when_it_has_ended(chrome: Chrome, endpoint: str) -> None:
    with web_process(endpoint) as (url, _), client(endpoint) as session:
        with DrawnStream(session):
            open_page(chrome, url)
            shows(chrome, "link", "live")
        shows(chrome, "banners", "No picture for ")
        shows(chrome, "link", "stale")
        with DrawnStream(session, epoch=2) as stream:
            shows(chrome, "link", "live")
            assert text(chrome, "banners") == ""
            stream.end("end of file")
        shows(chrome, "banners", "frames: end of file")


def test_pictures_without_tracks_are_marked(chrome: Chrome, endpoint: str) -> None:
    with web_process(endpoint) as (url, _), client(endpoint) as session:
        with DrawnStream(session, with_tracks=False):
            open_page(chrome, url)
            shows(chrome, "no-tracks", "no tracks")
        with DrawnStream(session, epoch=2):
            wait_until(lambda: text(chrome, "no-tracks") == "", "tracks")


def test_a_stop_pressed_while_the_router_is_away_arrives_when_it_is_back(chrome: Chrome) -> None:
    with router() as endpoint:
        pass
    settings = RouterSettings(listen=(endpoint,))
    with open_router(settings):
        stack = web_process(endpoint)
        url, _ = stack.__enter__()
        open_page(chrome, url)
    try:
        shows(chrome, "banners", "router is away")
        chrome.find_element("id", "stop").click()
        shows(chrome, "stop", "STOPPING")
        with open_router(settings) as session, collected(session, keys.FOLLOW_ESTOP) as stops:
            assert _estop(stops, deadline_s=20).engaged
            wait_until(lambda: "router is away" not in text(chrome, "banners"), "the router")
    finally:
        stack.__exit__(None, None, None)


def test_the_page_finds_a_restarted_service_again(chrome: Chrome, endpoint: str) -> None:
    with web_process(endpoint) as (url, _):
        open_page(chrome, url)
        port = url.rpartition(":")[2]
    shows(chrome, "banners", "Connection to the web service lost")
    chrome.find_element("id", "stop").click()
    shows(chrome, "banners", "STOP does not get through")
    with client(endpoint) as session, collected(session, keys.FOLLOW_ESTOP) as stops:
        with web_process(endpoint, "--port", port):
            wait_until(lambda: "lost" not in text(chrome, "banners"), "the connection", 20)
            assert _estop(stops).engaged, "a stop that did not get through is tried again"


def _estop(stops: queue.Queue[zenoh.Sample], deadline_s: float = 10.0) -> EStop:
    sample = stops.get(timeout=deadline_s)
    try:
        return decode(EStop, sample.payload.to_bytes(), str(sample.encoding))
    except HeelError as error:
        raise AssertionError(str(error)) from error


def _empty(samples: queue.Queue[zenoh.Sample]) -> None:
    while not samples.empty():
        samples.get_nowait()


@contextmanager
def pretended_arbiter(session: zenoh.Session) -> Iterator[queue.Queue[ManualRequest]]:
    """Gives the robot to whoever asks, as a follower would, and tells who asked."""
    requests: queue.Queue[ManualRequest] = queue.Queue()

    def answer(query: zenoh.Query) -> None:
        with query:
            assert query.payload is not None
            request = decode(ManualRequest, query.payload.to_bytes())
            requests.put(request)
            grant = ManualGrant(grant="a" * 16 if request.take else None, source=request.source)
            query.reply(keys.FOLLOW_MANUAL, encode(grant), encoding=grant.encoding())

    queryable = session.declare_queryable(keys.FOLLOW_MANUAL, answer)
    try:
        yield requests
    finally:
        queryable.undeclare()


def test_the_robot_is_driven_as_long_as_a_key_or_the_pad_is_held(
    chrome: Chrome, endpoint: str
) -> None:
    from selenium.webdriver import ActionChains

    with (
        client(endpoint) as session,
        web_process(endpoint) as (url, _),
        pretended_arbiter(session) as requests,
        collected(session, keys.FOLLOW_MANUAL) as sent,
    ):

        def newest() -> Manual | None:
            wishes = [decode(Manual, one.payload.to_bytes()) for one in list(sent.queue)]
            return wishes[-1] if wishes else None

        def wished(held: bool, forward: float, left: float) -> bool:
            wish = newest()
            return wish is not None and (wish.held, wish.forward, wish.left) == (
                held, pytest.approx(forward, abs=0.1), pytest.approx(left, abs=0.1),
            )  # fmt: skip

        open_page(chrome, url)
        ActionChains(chrome).key_down("w").key_up("w").perform()
        assert sent.empty(), "nobody has asked for the robot"
        tell_state(session, estop=False)
        shows(chrome, "driver", "the follower")
        chrome.find_element("id", "take").click()
        assert requests.get(timeout=10).take
        shows(chrome, "driver", "you, by hand")
        ActionChains(chrome).key_down("w").key_down("a").perform()
        wait_until(lambda: wished(True, 1.0, 1.0), "ahead and to the left")
        ActionChains(chrome).key_up("a").perform()
        wait_until(lambda: wished(True, 1.0, 0.0), "ahead")
        chrome.execute_script("window.dispatchEvent(new Event('blur'))")
        wait_until(lambda: wished(False, 0.0, 0.0), "let go without the focus")
        ActionChains(chrome).key_up("w").perform()
        pad = chrome.find_element("id", "pad")
        ActionChains(chrome).move_to_element_with_offset(pad, 0, -60).click_and_hold().perform()
        wait_until(lambda: wished(True, 0.9, 0.0), "ahead by the pad")
        ActionChains(chrome).release().perform()
        wait_until(lambda: wished(False, 0.0, 0.0), "let go of the pad")
        chrome.find_element("id", "hand-back").click()
        assert not requests.get(timeout=10).take
        shows(chrome, "driver", "the follower")
