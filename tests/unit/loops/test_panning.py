"""The closed loop of a virtual pan: who is kept in the window, and what counts as kept."""

from __future__ import annotations

import os
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from heel.schemas import FrameId, Track, Tracks
from heel.schemas.errors import HeelError
from heel.services.capture.pan_window import PanSettings
from heel.services.loops.panning.episode import Episode, PanOutcome
from heel.services.loops.panning.everybody import Appearance, appearances, follow_everybody
from heel.services.loops.panning.perception import TrueBoxes, WindowPerception
from heel.services.loops.panning.truth import InWindow, TruePeople, in_window, read_people

DATA = Path(os.environ.get("HEEL_DATA", Path(__file__).parents[4] / "shared" / "data"))
PETS = DATA / "PETS09-S2L1"
SIZE, FPS = (900, 300), 25.0
WINDOW = PanSettings(width=300, height=240, x=120.0, y=150.0)


def walkers(index: int) -> TruePeople:
    """One walks right at 80 px/s, the other stands at the right."""
    x = 100.0 + 80.0 * index / FPS
    return TruePeople(
        np.array([1, 2]), np.array([[x, 80.0, x + 40.0, 180.0], [700.0, 90.0, 740.0, 190.0]])
    )


def picture(people: TruePeople) -> NDArray[np.uint8]:
    image = np.full((SIZE[1], SIZE[0], 3), 90, np.uint8)
    image[:, ::50] = 140
    for identity, box in zip(people.identities, people.boxes_xyxy.astype(int), strict=True):
        left, top, right, bottom = box
        image[top:bottom, left:right] = (40 * identity, 200 - 60 * identity, 30)
    return image


def played(
    perception: WindowPerception, frames: int = 150, settings: PanSettings = WINDOW
) -> PanOutcome:
    episode = Episode(1, SIZE, settings, perception)
    for index in range(frames):
        people = walkers(index)
        episode.frame(index, index / FPS, picture(people), people)
    return episode.outcome


class Swaps:
    """A tracker whose only box jumps from the person to whoever comes next, or vanishes."""

    def __init__(self, frame: int, to: int | None) -> None:
        self._frame, self._to = frame, to

    def see(
        self, frame: FrameId, image: NDArray[np.uint8], offset_px: tuple[float, float],
        truth: InWindow,
    ) -> Tracks:  # fmt: skip
        who = 1 if frame.index < self._frame else self._to
        boxes = truth.boxes_xyxy[truth.identities == who].tolist()
        tracks = tuple(
            Track(
                id=5, state="tracked", box_xyxy=tuple(box), velocity_pxps=(0.0, 0.0), area_px=1.0,
                span_px=1.0, identity_confidence=1.0, shown=True,
            )
            for box in boxes
        )  # fmt: skip
        height, width = image.shape[:2]
        return Tracks(
            **frame.model_dump(), width=width, height=height, source_width=width,
            source_height=height, tracks=tracks,
        )  # fmt: skip


def test_boxes_are_cut_at_the_window_and_the_recording() -> None:
    people = TruePeople(
        np.array([3, 4, 5]),
        np.array([[-20.0, 10.0, 20.0, 50.0], [90.0, 10.0, 130.0, 50.0], [500.0, 0, 510, 9]]),
    )
    seen = in_window(people, (600, 300), (10.0, 20.0), (100, 80))
    # Half of the first lies outside the recording, where nobody could show it.
    assert seen.inside.tolist() == pytest.approx([0.5 * 0.75, 0.5 * 0.75, 0.0])
    assert seen.boxes_xyxy[:2].tolist() == [[0, 0, 10, 30], [80, 0, 100, 30]]


def test_who_is_seen_for_too_short_is_not_followed() -> None:
    people = {
        frame: TruePeople(np.array([1, 2] if frame in (3, 4) else [2]), np.zeros((2, 4)))
        for frame in range(1, 9)
    }
    assert appearances(people, 3) == [Appearance(2, 1, 8, 8)]


def test_ignored_rows_are_nobody(tmp_path: Path) -> None:
    (tmp_path / "gt").mkdir()
    (tmp_path / "gt" / "gt.txt").write_text("1,1,1,1,5,9,1\n1,2,1,1,5,9,0\n3,2,11,1,5,9,1\n")
    people = read_people(tmp_path)
    assert {frame: seen.identities.tolist() for frame, seen in people.items()} == {1: [1], 3: [2]}
    assert people[3].boxes_xyxy.tolist() == [[10.0, 0.0, 15.0, 9.0]]


def test_a_walker_is_kept() -> None:
    outcome = played(TrueBoxes())
    assert outcome.visible == 150
    assert outcome.since_chosen > 140
    assert outcome.kept == outcome.in_window == outcome.since_chosen
    assert outcome.wrong == 0


def test_a_walker_who_is_not_seen_any_more_leaves_the_window_and_is_not_kept() -> None:
    outcome = played(Swaps(20, None))
    assert outcome.kept < 20
    assert outcome.in_window < outcome.since_chosen
    assert outcome.lost[-1] in ((150, "searching"), (150, "lost"))


def test_the_same_loop_gives_the_same_outcome() -> None:
    assert asdict(played(TrueBoxes(), 60)) == asdict(played(TrueBoxes(), 60))


def test_the_target_s_box_on_somebody_else_is_wrong_and_not_kept() -> None:
    both = PanSettings(width=900, height=300)
    outcome = played(Swaps(50, 2), 100, both)
    assert outcome.in_window == outcome.since_chosen
    assert outcome.wrong == 50
    assert 0 < outcome.acted_wrong <= 50
    assert outcome.kept == outcome.since_chosen - 50


def test_a_sequence_without_anybody_to_follow_is_refused() -> None:
    if not PETS.is_dir():
        pytest.skip(f"no recordings in {DATA}: set HEEL_DATA")
    with pytest.raises(HeelError, match="visible for 5000 s"):
        follow_everybody(PETS, PanSettings(), TrueBoxes, least_visible_s=5000.0)


def test_a_real_person_is_kept_with_true_boxes() -> None:
    if not PETS.is_dir():
        pytest.skip(f"no recordings in {DATA}: set HEEL_DATA")
    (outcome,) = follow_everybody(PETS, PanSettings(), TrueBoxes, frozenset({15}))
    assert outcome.kept >= 0.95 * outcome.since_chosen
    assert outcome.wrong == 0
