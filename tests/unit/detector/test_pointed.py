"""Somebody a user points at: found about the point, kept by their clothes, found again."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from heel.schemas import Blobs, Pointed
from heel.services.detector.core import Detector
from heel.services.detector.pointed.colours import Exposure
from heel.services.detector.pointed.distance import Doubt, Stance
from heel.services.detector.pointed.finding import most_contrast, outline_box
from heel.services.detector.settings import DetectorSettings
from tests.unit.detector.drawn_scene import frame_id

WIDTH, HEIGHT = 480, 360
Picture = NDArray[np.uint8]
Box = tuple[float, float, float, float]
SHIRT, TROUSERS, OTHER_SHIRT = (40, 60, 200), (90, 60, 30), (60, 180, 60)


@cache
def room() -> Picture:
    """Wall and floor with a texture, the horizon in the middle, three pictures wide."""
    rng = np.random.default_rng(3)
    grain = cv2.resize(rng.normal(0, 14, (45, 180)).astype(np.float32), (3 * WIDTH, HEIGHT))
    base = np.full((HEIGHT, 3 * WIDTH, 3), (150, 150, 140), np.float32)
    base[HEIGHT // 2 + 20 :] = (90, 120, 150)
    return np.clip(base + grain[..., None], 0, 255).astype(np.uint8)


def person_box(x: float, height: float) -> Box:
    """Of somebody whose feet are so far below the horizon as belongs to their size."""
    bottom = HEIGHT / 2 + 0.47 * height
    return (x - 0.2 * height, bottom - height, x + 0.2 * height, bottom)


def draw(picture: Picture, x: float, height: float, shirt: tuple[int, int, int] = SHIRT) -> None:
    _, top, _, _ = person_box(x, height)

    def part(first: float, last: float, half: float, colour: tuple[int, int, int]) -> None:
        rows = slice(max(0, round(top + first * height)), max(0, round(top + last * height)))
        picture[rows, max(0, round(x - half * height)) : round(x + half * height)] = colour

    part(0.0, 0.14, 0.05, (40, 50, 60))
    part(0.14, 0.52, 0.14, shirt)
    part(0.52, 0.97, 0.10, TROUSERS)
    part(0.97, 1.0, 0.11, (20, 20, 20))


def seen(
    x: float | None, height: float = 150.0, pan: int = 0, light: float = 1.0,
    other: float | None = None,
) -> Picture:  # fmt: skip
    """A picture with somebody at column `x`, the camera turned by `pan` columns."""
    picture = room()[:, WIDTH + pan : 2 * WIDTH + pan].copy()
    if other is not None:
        draw(picture, other, height, OTHER_SHIRT)
    if x is not None:
        draw(picture, x, height)
    noise = np.random.default_rng(pan * 7 + round(x or 0)).normal(0, 2, picture.shape)
    return np.clip(light * picture + noise, 0, 255).astype(np.uint8)


def pointed(x: float, y: float, seq: int = 1, width: int = WIDTH) -> Pointed:
    return Pointed(frame=frame_id(seq), width=width, height=HEIGHT, x_px=x, y_px=y)


def play(pictures: Sequence[Picture], points: dict[int, Pointed]) -> list[Blobs]:
    detector = Detector(DetectorSettings())
    return [
        detector.detect(frame_id(seq), picture, (WIDTH, HEIGHT), None, points.get(seq))
        for seq, picture in enumerate(pictures)
    ]


def overlap(a: Box, b: Box) -> float:
    across = max(0.0, min(a[2], b[2]) - max(a[0], b[0]))
    down = max(0.0, min(a[3], b[3]) - max(a[1], b[1]))
    areas = sum((c[2] - c[0]) * (c[3] - c[1]) for c in (a, b))
    return across * down / (areas - across * down)


def on_person(message: Blobs, x: float, height: float = 150.0) -> bool:
    return len(message.blobs) == 1 and (
        overlap(message.blobs[0].box_xyxy, person_box(x, height)) > 0.5
    )


@pytest.mark.parametrize("height", [100.0, 150.0, 210.0])
@pytest.mark.parametrize("down", [0.3, 0.4, 0.55])
def test_a_person_at_a_point_is_found_from_head_to_foot(height: float, down: float) -> None:
    picture = cv2.GaussianBlur(seen(230.0, height), (5, 5), 0)
    true = person_box(230.0, height)
    about = most_contrast(np.asarray(picture, np.uint8), 226.0, true[1] + down * height)
    assert about is not None
    found = outline_box(np.asarray(picture, np.uint8), about.box_xyxy)
    assert overlap(found, true) > 0.8


def test_nobody_is_found_where_nobody_stands() -> None:
    assert most_contrast(seen(None), 240.0, 170.0) is None


def test_who_stands_from_the_start_is_seen_once_pointed_at_and_only_then() -> None:
    messages = play([seen(240.0)] * 10, {5: pointed(240.0, 160.0)})
    assert [message.kind for message in messages] == ["regions"] * 5 + ["people"] * 5
    assert {message.detector for message in messages[5:]} == {"pointed"}
    assert all(on_person(message, 240.0) for message in messages[5:])


def test_they_are_kept_while_they_walk_come_nearer_and_the_camera_turns() -> None:
    steps = [(240.0 + 2.0 * step, 150.0 * 1.01**step, 3 * step) for step in range(40)]
    messages = play([seen(*step) for step in steps], {0: pointed(240.0, 160.0)})
    kept = [on_person(m, x, height) for m, (x, height, _) in zip(messages, steps, strict=True)]
    assert all(kept), kept


def test_somebody_in_other_clothes_is_not_taken_for_them() -> None:
    walking = [seen(240.0 - 6.0 * step, other=100.0 + 6.0 * step) for step in range(40)]
    gone = [seen(None, other=340.0)] * 30
    messages = play([*walking, *gone], {0: pointed(240.0, 160.0)})
    assert all(message.kind == "people" for message in messages)
    assert not any(message.blobs for message in messages[45:])


def test_after_a_time_out_of_sight_they_are_found_elsewhere() -> None:
    pictures = [seen(240.0)] * 20 + [seen(None)] * 30 + [seen(100.0, 120.0)] * 10
    messages = play(pictures, {0: pointed(240.0, 160.0)})
    assert not any(message.blobs for message in messages[25:50])
    assert on_person(messages[-1], 100.0, 120.0)


def test_who_has_gone_far_away_while_nobody_looked_is_found_again() -> None:
    before, after = Detector(DetectorSettings()), Detector(DetectorSettings())
    for seq in range(20):
        point = pointed(240.0, 165.0) if seq == 0 else None
        message = before.detect(frame_id(seq), seen(240.0, 90.0), (WIDTH, HEIGHT), None, point)
    assert on_person(message, 240.0, 90.0)
    left = before.snapshot()
    assert left is not None
    after.restore(left)
    # A person of 1.75 m that is 9 m away, and then 11 m, before a lens of 90 degrees.
    for first, height in ((60, 47.0), (120, 38.0)):
        for seq in range(first, first + 10):
            picture = seen(200.0, height)
            message = after.detect(frame_id(seq), picture, (WIDTH, HEIGHT), None, None)
        assert on_person(message, 200.0, height)


def test_two_who_look_like_them_are_none() -> None:
    both = seen(100.0)
    draw(both, 380.0, 150.0)
    messages = play([seen(240.0)] * 20 + [seen(None)] * 20 + [both] * 10,
                    {0: pointed(240.0, 160.0)})  # fmt: skip
    assert not any(message.blobs for message in messages[40:])


def test_a_twin_who_crosses_in_front_is_doubted_and_left_for_them() -> None:
    def crossing(step: int) -> Picture:
        picture = seen(240.0, 180.0)
        draw(picture, 90.0 + 10.0 * step, 260.0)
        return picture

    messages = play([seen(240.0, 180.0)] * 20 + [crossing(step) for step in range(40)],
                    {0: pointed(240.0, 160.0)})  # fmt: skip
    scores = [blob.score or 0.0 for message in messages for blob in message.blobs]
    assert min(scores) == 0.5, "nobody would wait"
    sure_of_another = [
        message.seq
        for message in messages
        if message.blobs and message.blobs[0].score != 0.5 and not on_person(message, 240.0, 180.0)
    ]
    assert len(sure_of_another) <= 6, "until they are nearer than anybody can have come"
    assert on_person(messages[-1], 240.0, 180.0)


def test_who_comes_nearer_themselves_is_doubted_for_a_moment_only() -> None:
    doubt = Doubt()
    heights = [0.5] * 20 + [min(0.5 * 1.04**step, 0.9) for step in range(80)]
    doubted = [doubt.raised(height, 0.05) for height in heights]
    assert not any(doubted[:20])
    assert 0 < sum(doubted) <= 2 * 42
    assert not any(doubted[-20:])
    assert not any(Doubt().raised(0.5 * height, 0.05) for height in heights), "far away"


def test_they_are_kept_when_the_light_changes_at_once() -> None:
    pictures = [seen(240.0)] * 15 + [seen(240.0, light=0.45)] * 15 + [seen(240.0, light=1.4)] * 15
    messages = play(pictures, {0: pointed(240.0, 160.0)})
    assert all(on_person(message, 240.0) for message in messages)


@pytest.mark.parametrize(
    "other",
    [
        pointed(240.0, 160.0, width=WIDTH + 2),
        pointed(240.0, 160.0).model_copy(update={"frame": frame_id(1, epoch=2)}),
        pointed(-3e8, 9e8),
    ],
    ids=["another size", "another epoch", "far outside"],
)
def test_points_of_another_scene_or_outside_change_nothing(other: Pointed) -> None:
    plain = play([seen(240.0)] * 6, {})
    assert play([seen(240.0)] * 6, {2: other}) == plain


def test_whoever_is_long_gone_is_forgotten_and_the_background_is_believed_again() -> None:
    detector = Detector(DetectorSettings())
    kinds = []
    for seq in (0, 1, 20, 250, 400, 401):
        picture = seen(240.0 if seq < 2 else None)
        point = pointed(240.0, 160.0) if seq == 0 else None
        kinds.append(detector.detect(frame_id(seq), picture, (WIDTH, HEIGHT), None, point).kind)
    assert kinds == ["people"] * 5 + ["regions"]


def test_equal_pictures_give_equal_messages() -> None:
    pictures = [seen(240.0 + 2.0 * step) for step in range(12)]
    runs = [play(pictures, {1: pointed(242.0, 160.0)}) for _ in range(2)]
    assert runs[0] == runs[1]


def test_a_level_camera_tells_the_height_by_head_or_feet() -> None:
    stance = Stance(360, top=100.0, bottom=250.0)
    assert stance.height(None, 250.0, before=150.0) == pytest.approx(150.0)
    assert stance.height(20.0, None, before=150.0) == pytest.approx(300.0)
    assert stance.height(None, None, before=150.0) is None
    assert stance.least_height(0.0, None) == pytest.approx(337.5)
    assert stance.centre(300.0) == pytest.approx(170.0)


def test_a_wall_above_the_head_or_a_shadow_below_the_feet_makes_nobody_taller() -> None:
    stance = Stance(360, top=100.0, bottom=250.0)
    assert stance.height(60.0, 252.0, before=150.0) == pytest.approx(154.3, abs=0.1)
    assert stance.height(98.0, 285.0, before=150.0) == pytest.approx(153.75)


def test_exposure_is_taken_out() -> None:
    exposure, picture = Exposure(), seen(240.0)
    exposure.level(picture, 0.0)
    darker = np.asarray(np.clip(0.5 * picture, 0, 255), np.uint8)
    assert abs(float(exposure.level(darker, 0.05).mean()) / float(picture.mean()) - 1.0) < 0.05
