"""The page beside which a board is held up: headless Chromium, drawn boards, and the command."""

from __future__ import annotations

import json
import logging
import re
import urllib.error
import urllib.request
from pathlib import Path

import cv2
import numpy as np
import pytest

from heel.services.commands.calibrate import shown
from heel.services.geometry.board import View, Views
from heel.services.web.board_page import BoardPreview, board_page
from tests.support.network import wait_until
from tests.support.processes import running
from tests.support.web_page import browser
from tests.unit.geometry.test_board import BARREL, BOARD, SIZE, checkerboard, picture, poses

LOG = logging.getLogger("heel.test")


def pictures(count: int) -> list[np.ndarray]:
    """A board in many places, as a camera with a wide lens sees it."""
    plan = checkerboard()
    grey = [picture(BARREL, turn, away, plan, (0.24, 0.18)) for turn, away in poses(count)]
    return [np.asarray(cv2.cvtColor(one, cv2.COLOR_GRAY2BGR), np.uint8) for one in grey]


def found(image: np.ndarray) -> View | None:
    return BOARD.find(np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8))


@pytest.mark.browser
def test_the_page_shows_corners_what_is_covered_and_where_next(tmp_path: Path) -> None:
    with browser() as chrome, board_page(0, LOG) as (url, preview):
        chrome.get(url)

        def text(identity: str) -> str:
            return str(chrome.find_element("id", identity).text)

        def on_canvas(name: str) -> str | None:
            return chrome.find_element("id", "picture").get_attribute(f"data-{name}")

        wait_until(lambda: text("link") == "live", "the page")
        assert text("seen") == "no picture so far"
        views = Views(SIZE)
        for number, image in enumerate(pictures(8), 1):
            view = found(image)
            kept = view is not None and views.add(view)
            preview.show(image, shown(views, view, kept))
            wait_until(lambda number=number: on_canvas("number") == str(number), "the picture")
        wait_until(lambda: text("next") == f"show it in the {views.missing}", "the hint")
        covered = int(views.covered.sum())
        assert 0 < covered < 12
        assert on_canvas("covered") == str(covered)
        assert text("figures").startswith(f"{len(views.chosen)} of at least 8 views, ")
        left = chrome.execute_script(
            "const canvas = document.getElementById('picture');"
            "return [canvas.width, canvas.height, canvas.clientWidth / canvas.clientHeight];"
        )
        assert left == pytest.approx([*SIZE, SIZE[0] / SIZE[1]], rel=0.02)
        chrome.save_screenshot(str(tmp_path / "board.png"))
        preview.show(image, shown(views, None, False))
        wait_until(lambda: text("seen").startswith("no board found"), "that none is seen")
        preview.end("field of view 90 degrees")
        wait_until(lambda: text("next") == "field of view 90 degrees", "the result")
        assert text("link") == "ended"
        assert [one for one in chrome.get_log("browser") if one["level"] == "SEVERE"] == []


def test_the_command_serves_it_and_says_there_how_it_ended_badly(tmp_path: Path) -> None:
    for number, image in enumerate(pictures(4)):
        cv2.imwrite(str(tmp_path / f"{number:02d}.png"), image)
    words = ("-m", "heel", "calibrate", "board", str(tmp_path), "--board", "7x5", "--web", "0")
    with running(*words) as command:
        wait_until(lambda: "page at " in command.stdout() or not command.alive, "the page", 40.0)
        address = re.search(r"page at (\S+)", command.stdout())
        assert address, command.stderr()

        def told() -> bool:
            with urllib.request.urlopen(address[1] + "api/board", timeout=5.0) as answer:
                return "are wanted: move and tilt it" in json.load(answer).get("result", "")

        wait_until(told, "the result", 30.0)
        wait_until(lambda: not command.alive, "the end", 10.0)
        assert "are wanted: move and tilt it" in command.stderr()


def test_other_sites_get_nothing_of_it() -> None:
    with board_page(0, LOG) as (url, preview):
        preview.show(np.zeros((48, 64, 3), np.uint8), shown(Views((64, 48)), None, False))
        for headers in ({"Host": "evil.example"}, {"Origin": "http://evil.example"}):
            request = urllib.request.Request(url + "board.jpg", headers=headers)
            with pytest.raises(urllib.error.HTTPError) as refusal:
                urllib.request.urlopen(request, timeout=5.0)
            with refusal.value:
                assert refusal.value.code == 403


def test_large_pictures_are_shown_smaller() -> None:
    preview = BoardPreview()
    assert preview.jpeg() is None
    preview.show(np.zeros((1080, 1920, 3), np.uint8), {})
    coded = preview.jpeg()
    assert coded is not None
    read = cv2.imdecode(np.frombuffer(coded, np.uint8), cv2.IMREAD_COLOR)
    assert read is not None
    assert read.shape == (540, 960, 3)
