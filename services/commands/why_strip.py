"""The people that a decision was about, cut out of the pictures just before and after it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.evaluation.rows import BoxRows
from heel.services.tracker.trace import Event

MOST_EVENTS = 40
"""Rows of a strip, the last ones of the story: a picture that a screen still shows; chosen by
hand."""
_SIZE_PX = 128
"""Height and most width of a crop; chosen by hand."""
_LINE_PX = 18
"""Height of a line of text; chosen by hand."""
_LEFT_OUT = ("input", "full", "gone", "forgotten", "born")
Image = NDArray[np.uint8]
Picture = Callable[[int], Image]


@dataclass(frozen=True)
class _View:
    """One crop: of an id in a frame, xyxy pixels of the source."""

    id: int
    frame: int
    box: tuple[float, float, float, float]


def strip(events: Sequence[Event], tracks: BoxRows, picture: Picture) -> Image | None:
    """A row of crops for each event: each of its ids, last seen before and first seen since.

    Args:
        events: that are told, of a trace of the same run as the tracks.
        tracks: shown people of every frame.
        picture: gives the picture of a frame, asked in rising order.

    Returns:
        (H, W, 3) uint8 BGR; None where none of the ids is in the tracks.
    """
    chosen = [event for event in events if event.kind not in _LEFT_OUT][-MOST_EVENTS:]
    rows = [(event, _views(event, tracks)) for event in chosen]
    wanted = sorted({view for _, views in rows for view in views}, key=lambda view: view.frame)
    crops = {view: _crop(picture(view.frame), view) for view in wanted}
    drawn = [_row(event, [crops[view] for view in views]) for event, views in rows if views]
    if not drawn:
        return None
    width = max(row.shape[1] for row in drawn)
    padded = [np.pad(row, ((0, 0), (0, width - row.shape[1]), (0, 0))) for row in drawn]
    return np.concatenate(padded)


def _views(event: Event, tracks: BoxRows) -> list[_View]:
    found = []
    for key in dict.fromkeys((event.id, event.other, event.runner_up)):
        rows = np.flatnonzero(tracks.identities == key) if key else np.zeros(0, np.intp)
        rows = rows[np.argsort(tracks.frames[rows], kind="stable")]
        before = rows[tracks.frames[rows] < event.frame][-1:]
        # A decision on silhouettes falls after the frame's tracks: it shows in the next frame's.
        since = rows[tracks.frames[rows] > event.frame][:1]
        for row in (*before.tolist(), *since.tolist()):
            left, top, right, bottom = tracks.boxes_xyxy[row].tolist()
            found.append(_View(key, int(tracks.frames[row]), (left, top, right, bottom)))
    return found


def _crop(image: Image, view: _View) -> Image:
    rows, columns = image.shape[:2]
    left, top, right, bottom = (round(value) for value in view.box)
    part = image[max(top, 0) : min(bottom, rows), max(left, 0) : min(right, columns)]
    cell = np.zeros((_LINE_PX + _SIZE_PX, _SIZE_PX, 3), np.uint8)
    if part.size:
        scale = min(_SIZE_PX / part.shape[0], _SIZE_PX / part.shape[1])
        size = max(1, round(part.shape[1] * scale)), max(1, round(part.shape[0] * scale))
        cell[_LINE_PX : _LINE_PX + size[1], : size[0]] = cv2.resize(part, size)
    return _line(cell, f"id {view.id}, frame {view.frame}")


def _row(event: Event, crops: Sequence[Image]) -> Image:
    cells = np.concatenate(crops, axis=1)
    ids = " and ".join(str(key) for key in (event.id, event.other) if key)
    head = np.zeros((_LINE_PX, cells.shape[1], 3), np.uint8)
    outcome = f", {event.outcome}" if event.outcome else ""
    text = f"{event.frame}: {event.kind}{outcome}, {ids}"
    return np.concatenate([_line(head, text), cells])


def _line(image: Image, text: str) -> Image:
    place = (2, _LINE_PX - 5)
    cv2.putText(image, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.4, (255, 255, 255), 1, cv2.LINE_AA)
    return image
