"""Real processes follow a real person through a recording by turning the window."""

from __future__ import annotations

import csv
import os
import queue
from collections.abc import Callable
from contextlib import ExitStack
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import zenoh

from heel.schemas import EndOfStream, Target, TargetRequest, Tracks, decode, encode, keys
from heel.services.geometry.boxes import iou_matrix
from heel.services.loops.panning.truth import TruePeople, in_window, read_people
from tests.support import network
from tests.support.network import wait_until
from tests.support.processes import Running, running

DATA = Path(os.environ.get("HEEL_DATA", Path(__file__).parents[3] / "shared" / "data"))
PETS = DATA / "PETS09-S2L1"
PERSON, START = 9, (514.0, 195.0)
"""Who walks left from the first frame on, and where the window begins."""
RECORDING, WINDOW = (768, 576), (384, 288)
FRAMES, CHOSEN_IN = 100, 12
FOLLOWER = ("--max-linear-mps", "0", "--max-tracks-age-s", "0.6")


@pytest.mark.slow
@pytest.mark.skipif(not PETS.is_dir(), reason=f"no recordings in {DATA}: set HEEL_DATA")
def test_the_person_pointed_at_stays_in_the_window_with_the_same_id(tmp_path: Path) -> None:
    file = tmp_path / "window.csv"
    source = f"pan:{PETS}?x={START[0]}&y={START[1]}&window_file={file}"
    with ExitStack() as stack:
        endpoint = stack.enter_context(network.router())
        session = stack.enter_context(network.client(endpoint))
        arrivals = stack.enter_context(network.collected(session, keys.tracks("front")))
        for name, flags in (("detector", ()), ("tracker", ()), ("follower", FOLLOWER),
                            ("drive", ())):  # fmt: skip
            command = ("-m", f"heel.services.{name}", "--connect", endpoint, *flags)
            service = stack.enter_context(running(*command))
            wait_until(_is_up(service), name, 60.0)
        stack.enter_context(
            running("-m", "heel.services.capture", source, "--connect", endpoint, "--frames",
                    str(FRAMES))
        )  # fmt: skip
        seen, target = _played(arrivals, session)
    offsets = _offsets(file)
    assert target is not None
    kept = [_kept(tracks, target, offsets[tracks.index + 1]) for tracks in seen]
    assert len(kept) > 0.5 * FRAMES
    assert min(left for left, _ in offsets.values()) < START[0] - WINDOW[0] / 2 - 50
    assert np.mean(kept[CHOSEN_IN:]) >= 0.9


@cache
def _people() -> dict[int, TruePeople]:
    return read_people(PETS)


def _is_up(service: Running) -> Callable[[], bool]:
    return lambda: "is up" in service.stderr()


def _played(
    arrivals: queue.Queue[zenoh.Sample], session: zenoh.Session
) -> tuple[list[Tracks], int | None]:
    """All tracks up to the stream's end, and the id of the person pointed at on the way."""
    seen: list[Tracks] = []
    target: int | None = None
    while True:
        sample = arrivals.get(timeout=60.0)
        if str(sample.encoding) == EndOfStream.encoding():
            return seen, target
        seen.append(decode(Tracks, sample.payload.to_bytes()))
        if target is None:
            target = _pointed_at(session, seen[-1])


def _pointed_at(session: zenoh.Session, tracks: Tracks) -> int | None:
    """Click on the person; until somebody is chosen the window stands where it began."""
    left, top = START[0] - WINDOW[0] / 2, START[1] - WINDOW[1] / 2
    people = _people()[tracks.index + 1]
    box = people.boxes_xyxy[people.identities == PERSON][0]
    request = TargetRequest(
        mode="point", x_px=float(box[0] + box[2]) / 2 - left, y_px=float(box[1] + box[3]) / 2 - top
    )
    replies = session.get(
        keys.FOLLOW_TARGET, payload=encode(request), encoding=TargetRequest.encoding(), timeout=1.0
    )
    answer = next((reply.ok for reply in replies if reply.ok is not None), None)
    return None if answer is None else decode(Target, answer.payload.to_bytes()).track_id


def _offsets(file: Path) -> dict[int, tuple[float, float]]:
    with file.open() as lines:
        return {
            int(row["frame"]): (float(row["left_px"]), float(row["top_px"]))
            for row in csv.DictReader(lines)
        }


def _kept(tracks: Tracks, target: int, offset: tuple[float, float]) -> bool:
    truth = in_window(_people()[tracks.index + 1], RECORDING, offset, WINDOW)
    mine = truth.identities == PERSON
    boxes = [track.box_xyxy for track in tracks.tracks if track.id == target]
    if truth.inside[mine][0] < 0.5 or not boxes:
        return False
    return bool(iou_matrix(np.array(boxes[:1]), truth.boxes_xyxy[mine])[0, 0] >= 0.5)
