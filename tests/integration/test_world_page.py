"""The whole demo as a person meets it: click somebody, the robot follows; STOP, it stands."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.support.network import wait_until
from tests.support.processes import Running, running
from tests.support.web_page import browser

if TYPE_CHECKING:
    from selenium.webdriver import Chrome

pytestmark = [pytest.mark.browser, pytest.mark.timeout(180)]

WIDTH_PX = 640
Box = tuple[float, float, float, float]
_LOOK = """
const [picture, map] = ["picture", "map"].map((id) => document.getElementById(id).dataset);
return {boxes: picture.boxes ?? "[]", people: map.people ?? "[]", names: map.names ?? "[]",
        followed: map.followed ?? "", speed: Number(map.speed ?? 0), time: Number(map.time ?? 0)};
"""


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, Running]]:
    """A crowded corridor, without an end; the page's address."""
    pytest.importorskip("panda3d", reason="the extra sim is not installed")
    out = tmp_path_factory.mktemp("demo")
    flags = ("--port", "0", "--scenario", "crowd", "--seed", "2", "--seconds", "150",
             "--perception", "simulated-boxes", "--out", str(out))  # fmt: skip
    with running("-m", "heel", "demo", *flags) as process:
        page = re.compile(r"live page: (\S+)")
        wait_until(lambda: bool(page.search(process.stdout())) or not process.alive, "page", 40.0)
        found = page.search(process.stdout())
        assert found is not None, process.stderr()
        yield found[1], process


class Page:
    """What is to be seen on the page, and clicks on it."""

    def __init__(self, chrome: Chrome) -> None:
        self.chrome = chrome

    def text(self, identity: str) -> str:
        return str(self.chrome.find_element("id", identity).text)

    def look(self) -> dict[str, str | float]:
        seen: dict[str, str | float] = self.chrome.execute_script(_LOOK)
        return seen

    @property
    def tracks(self) -> dict[int, Box]:
        return _boxes(self.look()["boxes"])

    @property
    def people(self) -> dict[int, Box]:
        """True boxes of those before the camera, by the simulator's ids."""
        return _boxes(self.look()["people"])

    @property
    def followed(self) -> str:
        return str(self.look()["followed"])

    def name_on_the_map(self, person: int) -> int | None:
        """What the map calls one of the simulator's people."""
        return dict(json.loads(str(self.look()["names"]))).get(person)

    @property
    def speed_mps(self) -> float:
        return float(self.look()["speed"])

    def click_on(self, box: Box) -> None:
        from selenium.webdriver import ActionChains

        canvas = self.chrome.find_element("id", "picture")
        size = canvas.size
        scale = size["width"] / WIDTH_PX
        x_px, y_px = (box[0] + box[2]) / 2 * scale, (0.7 * box[1] + 0.3 * box[3]) * scale
        offset = round(x_px - size["width"] / 2), round(y_px - size["height"] / 2)
        ActionChains(self.chrome, duration=0).move_to_element_with_offset(
            canvas, *offset
        ).click().perform()

    def press(self, identity: str) -> None:
        self.chrome.find_element("id", identity).click()


def test_click_a_person_and_the_robot_follows_that_one_stop_and_it_stands(
    demo: tuple[str, Running], tmp_path: Path
) -> None:
    url, process = demo
    with browser() as chrome:
        page = Page(chrome)
        chrome.get(url)
        wait_until(lambda: chrome.find_element("id", "map").is_displayed(), "the map", 30.0)
        assert "not seen in pixels" in page.text("notices")
        wait_until(lambda: bool(page.tracks), "people in the picture", 20.0)

        # Nobody is followed, although the demo has chosen somebody at first.
        wait_until(lambda: float(page.look()["time"]) > 2.0, "the demo's own choice", 20.0)
        page.press("none")
        wait_until(lambda: page.followed == "", "nobody")
        wait_until(lambda: abs(page.speed_mps) < 0.05, "standstill")

        # The one in the middle who is nearest is whom the scenario is about: number 1.
        def click_the_target_until_followed() -> bool:
            if page.followed != "1" and 1 in page.people:
                page.click_on(page.people[1])
                wait_until(lambda: page.text("toast") != "", "an answer")
            return page.followed == "1"

        wait_until(click_the_target_until_followed, "person 1 is followed", 20.0)
        # The map names people as the picture does: the followed one's number is the target's.
        wait_until(lambda: f"person {page.name_on_the_map(1)}" == page.text("target"), "one name")
        wait_until(lambda: page.speed_mps > 0.3, "the robot drives", 20.0)
        began_s = float(page.look()["time"])
        seen = set()

        def six_seconds_pass() -> bool:
            seen.add(page.followed)
            return float(page.look()["time"]) > began_s + 6.0

        wait_until(six_seconds_pass, "six seconds", 40.0)
        assert seen <= {"1", ""}, "nobody else, in a corridor full of people"
        # On a busy machine the pictures may be too old for a moment.
        follows = ("following", "occluded", "acquiring")
        wait_until(lambda: page.text("state") in follows, "the follower's state")
        chrome.save_screenshot(str(tmp_path / "following.png"))

        wait_until(lambda: page.speed_mps > 0.2, "the robot drives", 20.0)
        page.press("stop")
        wait_until(lambda: page.text("drive-state") == "stopped", "the drive has stopped")
        wait_until(lambda: page.text("drive-linear") == "0.00 m/s", "zero at the wheels")
        wait_until(lambda: abs(page.speed_mps) < 0.02, "standstill")
        wait_until(lambda: page.text("stop").startswith("STOPPED"), "the page says so")
        chrome.save_screenshot(str(tmp_path / "stopped.png"))
        assert process.alive
        errors = [entry for entry in chrome.get_log("browser") if entry["level"] == "SEVERE"]
        assert errors == []
        print(f"screenshots in {tmp_path}")


def _boxes(text: str | float) -> dict[int, Box]:
    return {int(number): (left, top, right, bottom)
            for number, left, top, right, bottom in json.loads(str(text))}  # fmt: skip
