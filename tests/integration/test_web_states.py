"""What the page says when something is wrong, and what it does not do under a finger."""

from __future__ import annotations

import json
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Any

import pytest
import zenoh

from heel.schemas import DriveState, EStop, FollowState, Health, Target, encode, keys
from heel.services.runtime.chain import CHAIN
from tests.support.network import client, router, wait_until
from tests.support.processes import Running
from tests.support.web_client import post, status_of
from tests.support.web_page import STANDER, TRACKER, DrawnStream, browser, web_process

if TYPE_CHECKING:
    from selenium.webdriver import Chrome

pytestmark = pytest.mark.browser
PHONES = ((360, 740), (360, 640), (740, 360))
BEAT_S = 0.25
OTHERS = ("capture", "tracker", "follower")
Opened = tuple["Chrome", zenoh.Session, "Parts"]


@pytest.fixture(scope="module")
def chrome() -> Iterator[Chrome]:
    with browser() as driver:
        yield driver


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    with router() as address:
        yield address


@pytest.fixture(scope="module")
def served(endpoint: str) -> Iterator[tuple[str, Running]]:
    with web_process(endpoint) as (url, process):
        yield url, process


@pytest.fixture
def page(chrome: Chrome, endpoint: str, served: tuple[str, Running]) -> Iterator[Opened]:
    """An open page, a picture on it, and all parts of the chain well."""
    url, process = served
    with client(endpoint) as session, ExitStack() as stack:
        parts = Parts(session, process)
        stack.enter_context(parts.speaking())
        stack.enter_context(DrawnStream(session, epoch=time.monotonic_ns()))
        chrome.get(url)
        shows(chrome, "state", "following")
        wait_until(lambda: text(chrome, "banners") == "", "no complaint")
        yield chrome, session, parts
        parts.drive_stops = False
        parts.state = parts.state.model_copy(update={"estop": False})
        wait_until(lambda: post(f"{url}/api/resume", b"{}")[0] == 200, "resumed")
        wait_until(lambda: not status_of(url)["stop"]["engaged"], "released")


class Parts:
    """Plays the chain: health from every part, the follower's state, and the drive's."""

    def __init__(self, session: zenoh.Session, web: Running) -> None:
        self._session, self.web = session, web
        self._tokens = {part: self._token(part) for part in CHAIN}
        self.silent: set[str] = set()
        self.twice: set[str] = set()
        self.state = FollowState(
            seq=1, state="following", reason="target in sight", estop=False,
            target=Target(seq=1, mode="id", track_id=STANDER, tracker=TRACKER),
            linear_mps=0.4, angular_radps=0.0, tracks_age_s=0.04, distance_m=2.5,
            identity_confidence=0.91, runner_up_confidence=0.2, speed_reason="speed limit",
            obstacle_watch=True, free_distance_m=3.4,
        )  # fmt: skip
        self.drive_stops = False
        self.notice = ""

    def _token(self, part: str) -> Any:
        return self._session.liveliness().declare_token(keys.alive(part, "main"))

    def die(self, part: str) -> None:
        self.silent.add(part)
        self._tokens.pop(part).undeclare()

    def come_back(self, part: str) -> None:
        if part not in self._tokens:
            self._tokens[part] = self._token(part)
        self.silent.discard(part)

    @contextmanager
    def speaking(self) -> Iterator[None]:
        done = threading.Event()

        def speak() -> None:
            while not done.wait(BEAT_S / 2):
                self.beat()

        thread = threading.Thread(target=speak, daemon=True)
        thread.start()
        try:
            yield
        finally:
            done.set()
            thread.join(5.0)

    def beat(self) -> None:
        for part in CHAIN:
            if part in self.silent:
                continue
            for start in ("aaaaaaaa", "bbbbbbbb")[: 1 + (part in self.twice)]:
                self.put(keys.health(part, "main"), health(part, start, self.notice))
        if "follower" not in self.silent:
            self.put(keys.FOLLOW_STATE, self.state)
        if "drive" not in self.silent:
            self.put(keys.ROBOT_DRIVE, DriveState(
                seq=1, state="stopped" if self.drive_stops else "driving", estop=self.drive_stops,
                reason="emergency stop" if self.drive_stops else "target in sight", driver="log",
                linear_mps=0.0 if self.drive_stops else 0.4, angular_radps=0.0,
            ))  # fmt: skip

    def put(self, key: str, message: Any) -> None:
        self._session.put(key, encode(message), encoding=message.encoding())


def health(part: str, start: str, notice: str) -> Health:
    return Health(
        service=part, instance="main", producer=f"{part}/main@{start}", state="ok", uptime_s=1.0,
        loop_age_s=0.0, software_version="1", period_s=BEAT_S, input_age_s=0.04,
        details={"notice": notice} if notice and part == "capture" else {},
    )  # fmt: skip


def text(chrome: Chrome, identity: str) -> str:
    return str(chrome.find_element("id", identity).text)


def shows(chrome: Chrome, identity: str, words: str) -> None:
    wait_until(lambda: words in text(chrome, identity), f"{words!r} in {identity}")


@pytest.mark.parametrize(
    "part",
    ["detector", "drive", *(pytest.param(one, marks=pytest.mark.slow) for one in OTHERS)],
)
def test_a_part_that_hangs_and_one_that_dies_is_named_until_it_is_back(
    page: Opened, part: str
) -> None:
    chrome, _, parts = page
    parts.silent.add(part)
    shows(chrome, "banners", f"{part}: silent for ")
    assert text(chrome, "link") in ("fault", "stale")
    parts.come_back(part)
    wait_until(lambda: part not in text(chrome, "banners"), "well again")
    parts.die(part)
    shows(chrome, "banners", f"{part}: gone")
    parts.come_back(part)
    wait_until(lambda: part not in text(chrome, "banners"), "well again")
    shows(chrome, "reason", "target in sight")


def test_two_drives_are_named(page: Opened) -> None:
    chrome, _, parts = page
    parts.twice.add("drive")
    shows(chrome, "banners", "two drives: drive/main@aaaaaaaa, drive/main@bbbbbbbb: stop one")
    parts.twice.clear()
    wait_until(lambda: text(chrome, "banners") == "", "one drive again")


def test_what_the_follower_knows_is_shown(page: Opened) -> None:
    chrome, _, parts = page
    shows(chrome, "facts", "2.5 m away · 91 % sure, next best 20 %")
    shows(chrome, "watch", "obstacles are watched, 3.4 m free")
    parts.state = parts.state.model_copy(update={
        "state": "idle", "reason": "no target", "target": Target(seq=2, mode="none"),
        "obstacle_watch": False, "free_distance_m": None, "distance_m": None,
    })  # fmt: skip
    shows(chrome, "watch", "nothing looks out for obstacles")
    shows(chrome, "state", "idle")
    assert chrome.find_element("id", "state").get_attribute("data-tone") == "wait"
    shows(chrome, "hint", "Click somebody")


def test_a_stop_tells_what_became_of_it(page: Opened) -> None:
    chrome, _, parts = page
    chrome.find_element("id", "stop").click()
    shows(chrome, "stop", "STOPPING")
    parts.state = parts.state.model_copy(update={"estop": True, "state": "stopped"})
    shows(chrome, "stop", "NOT CONFIRMED")
    shows(chrome, "banners", "the drive has not confirmed it: use the robot")
    parts.drive_stops = True
    shows(chrome, "stop", "STOPPED")
    shows(chrome, "stop-note", "the wheels stand")
    assert "STOP was sent" not in text(chrome, "banners")


def test_what_a_follower_said_before_it_died_keeps_no_stop(page: Opened) -> None:
    chrome, _, parts = page
    stop = EStop(engaged=True, source="test", id="0123456789abcdef", t_ns=1)
    parts.put(keys.FOLLOW_ESTOP, stop)
    parts.state = parts.state.model_copy(update={"estop": True, "state": "stopped"})
    parts.drive_stops = True
    shows(chrome, "stop", "STOPPED")
    parts.die("follower")
    shows(chrome, "banners", "follower: gone")
    parts.drive_stops = False
    # As `heel resume --without-follower` does.
    parts.put(keys.FOLLOW_ESTOP, stop.model_copy(update={"engaged": False}))
    shows(chrome, "stop-note", "or press Esc")
    parts.state = parts.state.model_copy(update={"estop": False, "state": "following"})
    parts.come_back("follower")
    wait_until(lambda: text(chrome, "banners") == "", "well again")


def test_all_is_grey_while_the_web_service_hangs(
    page: Opened,
) -> None:
    chrome, _, parts = page
    parts.web.process.send_signal(signal.SIGSTOP)
    try:
        shows(chrome, "banners", "No word from the web service")
        assert chrome.find_element("tag name", "body").get_attribute("data-lost") is not None
        assert text(chrome, "state") == "unknown"
        assert text(chrome, "linear") != "0.40 m/s"
        chrome.find_element("id", "stop").click()
        shows(chrome, "stop", "pressed")
    finally:
        parts.web.process.send_signal(signal.SIGCONT)
    shows(chrome, "stop", "STOPPING")


_PLACES = """
return [...document.querySelectorAll("#people button:not(:disabled)")].map((button) => {
  const { left, top } = button.getBoundingClientRect();
  return [button.dataset.person, Math.round(left), Math.round(top)];
});
"""


def test_buttons_of_people_stay_where_they_are(
    page: Opened,
) -> None:
    chrome, _, _ = page
    people = """
      const { People } = await import("./people.js");
      const list = document.createElement("div");
      list.id = "list";
      list.className = "people";
      document.body.prepend(list);
      const people = new People(list, (person) => { list.dataset.chosen = person.id; });
      const show = (...ids) => people.show(ids.map((id) => ({ id })), null, "tracker/main@0123abcd");
      const places = () => [...list.children].map((one) => [one.dataset.person, one.getBoundingClientRect().left]);
      const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
      const seen = [];
      show(7, 9, 12); seen.push(places());
      show(3, 9, 12, 7); seen.push(places());
      show(12, 3); people.tick(); seen.push(places());
      list.children[0].click(); seen.push(list.dataset.chosen ?? "nobody");
      await pause(3300);
      show(12, 3, 20); seen.push(places());
      list.children[0].click(); seen.push(list.dataset.chosen ?? "nobody");
      await pause(800);
      list.children[0].click(); seen.push(list.dataset.chosen ?? "nobody");
      list.remove();
      return seen;
    """  # noqa: E501
    chrome.set_script_timeout(20)
    seen = chrome.execute_async_script(
        f"const end = arguments[0]; (async () => {{ {people} }})().then(end, (e) => end(`${{e}}`))"
    )
    assert isinstance(seen, list), seen
    first, grown, left, pressed_gone, reused, pressed_fresh, pressed = seen
    assert [who for who, _ in first] == ["7", "9", "12"]
    assert grown[:3] == first, "somebody with a lower id is put behind those who are there"
    assert left == grown, "who has left keeps the place"
    assert pressed_gone == "nobody"
    assert [who for who, _ in reused] == ["20", "9", "12", "3"]
    assert [place for _, place in reused] == [place for _, place in grown]
    assert pressed_fresh == "nobody", "the finger was on its way to somebody else"
    assert pressed == "20"


def test_a_point_is_marked_while_somebody_is_looked_for_there(
    page: Opened,
) -> None:
    chrome, _, parts = page
    looking = Target(seq=5, mode="point", reason="looking for somebody there")
    parts.state = parts.state.model_copy(update={
        "state": "acquiring", "reason": "looking for somebody there", "target": looking,
        "pending_point_px": (120.0, 40.0), "pending_for_s": 4.0,
    })  # fmt: skip
    canvas = chrome.find_element("id", "picture")
    wait_until(lambda: canvas.get_attribute("data-pending") == "[120,40]", "the mark")
    shows(chrome, "target", "somebody pointed at")
    shows(chrome, "reason", "looking for somebody there")
    assert chrome.find_element("id", "state").get_attribute("data-tone") == "calm"
    nobody = Target(seq=6, mode="none", reason="nobody found there: click on somebody again")
    parts.state = parts.state.model_copy(update={
        "state": "idle", "reason": nobody.reason, "target": nobody, "pending_point_px": None,
    })  # fmt: skip
    shows(chrome, "toast", "Nobody found there")
    assert chrome.find_element("id", "toast").get_attribute("data-tone") == "calm"
    wait_until(lambda: canvas.get_attribute("data-pending") == "", "no mark")


_FIT = """
const box = (id) => document.getElementById(id).getBoundingClientRect();
const stop = document.querySelector(".stop-card").getBoundingClientRect();
return ["state", "target", "reason", "people", "nearest", "none"].map((id) => {
  const { left, top, right, bottom } = box(id);
  const seen = document.elementFromPoint((left + right) / 2, (top + bottom) / 2);
  const covered = !document.getElementById(id).contains(seen) && !seen?.contains(document.getElementById(id));
  const apart = bottom <= stop.top + 1 || right <= stop.left + 1;
  return [id, top >= 0 && bottom <= innerHeight && right <= innerWidth + 1 && apart && !covered];
});
"""  # noqa: E501


@pytest.mark.parametrize(("width", "height"), PHONES)
def test_on_a_phone_state_reason_and_choice_are_in_sight_also_while_stopped(
    page: Opened, width: int, height: int
) -> None:
    chrome, _, parts = page
    parts.notice = "People are the simulator's own boxes, not seen in pixels"
    shows(chrome, "notices", f"capture: {parts.notice}")
    metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": True}
    chrome.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    try:
        wait_until(lambda: bool(chrome.execute_script(_PLACES)), "people")
        assert all(fits for _, fits in chrome.execute_script(_FIT)), chrome.execute_script(_FIT)
        before = chrome.execute_script(_PLACES)
        # A reason of another length moves nothing that can be pressed.
        parts.state = parts.state.model_copy(update={
            "state": "lost", "reason": "tracks are older than 0.22 s " * 3, "distance_m": None,
        })  # fmt: skip
        shows(chrome, "state", "lost")
        assert {who: top for who, _, top in chrome.execute_script(_PLACES)} == {
            who: top for who, _, top in before
        }  # fmt: skip
        chrome.find_element("id", "stop").click()
        parts.drive_stops = True
        parts.state = parts.state.model_copy(update={"estop": True, "state": "stopped"})
        shows(chrome, "stop", "STOPPED")
        assert all(fits for _, fits in chrome.execute_script(_FIT)), chrome.execute_script(_FIT)
        assert chrome.find_element("id", "resume").is_displayed()
        wide = chrome.execute_script("return document.documentElement.scrollWidth > innerWidth")
        assert not wide
    finally:
        chrome.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_a_screen_reader_hears_of_an_alarm_once_not_with_every_second(
    page: Opened,
) -> None:
    chrome, _, parts = page
    chrome.execute_script("""
      window.said = [];
      for (const id of ["alarm", "spoken"]) {
        new MutationObserver(() => window.said.push(document.getElementById(id).textContent))
          .observe(document.getElementById(id), { childList: true, characterData: true, subtree: true });
      }
    """)  # noqa: E501
    parts.silent.add("tracker")
    shows(chrome, "banners", "tracker: silent for 3 s")
    said = json.loads(chrome.execute_script("return JSON.stringify(window.said)"))
    assert len([one for one in said if "tracker: silent" in one]) <= 3, said
    assert len(said) <= 4, said
