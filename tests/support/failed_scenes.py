"""A scene test that fails keeps a trace of the tracker, and a picture of the last frame.

Frames are noted while a test runs and played again only if it fails, as the tracker is
deterministic. Look with `heel why FOLDER/1.jsonl --id 7`, and at `FOLDER/1.png`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from heel.schemas import Blobs, HeelError, Tracks
from heel.services.drawing import Annotator
from heel.services.tracker.core import Tracker
from heel.services.tracker.trace import Trace
from heel.services.tracker.trace_file import TraceFile

FOLDER = Path(__file__).parents[2] / "out" / "failed-scenes"
_MOST_TRACKERS = 8
"""Trackers of one test that are kept, the newest: of a hundred alike the last one failed."""
_FAILED = pytest.StashKey[bool]()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Iterator[None]:
    """Note whether the test itself failed, for the fixture's end."""
    report: pytest.TestReport = yield  # type: ignore[misc,assignment]
    if report.when == "call":
        item.stash[_FAILED] = report.failed
    return report  # type: ignore[return-value]


@pytest.fixture
def kept_if_it_fails(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> Iterator[None]:
    """Note every frame that a tracker is given; keep the scenes of a test that fails."""
    given: dict[int, tuple[Tracker, list[Blobs]]] = {}
    update = Tracker.update

    def noted(tracker: Tracker, blobs: Blobs) -> Tracks:
        given.setdefault(id(tracker), (tracker, []))[1].append(blobs)
        while len(given) > _MOST_TRACKERS:
            given.pop(next(iter(given)))
        return update(tracker, blobs)

    monkeypatch.setattr(Tracker, "update", noted)
    yield
    monkeypatch.undo()
    if request.node.stash.get(_FAILED, False):
        folder = FOLDER / re.sub(r"[^\w.-]+", "_", request.node.name)
        for number, (tracker, frames) in enumerate(given.values(), 1):
            keep(tracker, frames, folder, number)
        print(f"\nscenes of this test: {folder}")


def keep(tracker: Tracker, frames: list[Blobs], folder: Path, number: int) -> None:
    """Play frames again for a tracker of the same settings; write `NUMBER.jsonl` and `.png`."""
    folder.mkdir(parents=True, exist_ok=True)
    annotator, drawn = Annotator(), np.zeros((1, 1, 3), np.uint8)
    with TraceFile(folder / f"{number}.jsonl") as file:
        again = Tracker(tracker.settings, trace=Trace(file.take))
        for blobs in frames:
            try:
                tracks = again.update(blobs)
            except HeelError as error:
                (folder / f"{number}.txt").write_text(f"frame {blobs.seq}: {error}\n")
                continue
            drawn = annotator.draw(_picture(blobs), tracks, None, f"frame {blobs.seq}")
            again.settle()
    cv2.imwrite(str(folder / f"{number}.png"), drawn)


def _picture(blobs: Blobs) -> NDArray[np.uint8]:
    """What is known of the frame's pixels: those under its boxes, on grey."""
    canvas = np.full((blobs.height, blobs.width, 3), 96, np.uint8)
    for blob in blobs.blobs:
        left, top = (max(round(value), 0) for value in blob.box_xyxy[:2])
        right, bottom = round(blob.box_xyxy[2]), round(blob.box_xyxy[3])
        right, bottom = min(right, blobs.width), min(bottom, blobs.height)
        if left < right and top < bottom:
            pixels = blob.patch.array()
            canvas[top:bottom, left:right] = cv2.resize(pixels, (right - left, bottom - top))
    return canvas
