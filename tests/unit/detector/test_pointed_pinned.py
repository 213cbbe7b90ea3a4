"""What the search for one person makes of drawn pictures and made-up numbers, pinned.

What is computed from pictures may differ by a thousandth on another processor. Grids step by less
than a factor of two, so that a threshold that is halved or doubled lies on the other side of some
value.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import astuple, replace
from functools import cache, partial
from typing import Any, cast

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from heel.services.detector.core import Detector
from heel.services.detector.pointed import proof as proof_module
from heel.services.detector.pointed.colours import Exposure, StripColours, colour_bins
from heel.services.detector.pointed.detector import PointedAt
from heel.services.detector.pointed.distance import Doubt, Stance
from heel.services.detector.pointed.finding import (
    Contrast,
    looks_upright,
    most_contrast,
    outline,
    outline_box,
)
from heel.services.detector.pointed.fitting import alike, best_fit, extent
from heel.services.detector.pointed.person import PointedPerson
from heel.services.detector.pointed.proof import Movement, MovementWatch, Proof
from heel.services.detector.pointed.silhouette import (
    PERSON_PX,
    STRIPS,
    FloatMap,
    Place,
    silhouette,
    view_around,
)
from heel.services.detector.settings import DetectorSettings
from tests.support.pinned import Pinned, Rows, Value
from tests.unit.detector.drawn_scene import frame_id
from tests.unit.detector.test_pointed import (
    HEIGHT,
    SHIRT,
    TROUSERS,
    WIDTH,
    Box,
    Picture,
    draw,
    person_box,
    pointed,
    room,
    seen,
)

Row = list[Value]
STILL = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
OF_PICTURES = {"relative": 2e-3, "absolute": 2e-3}


def smooth(picture: Picture) -> Picture:
    return np.asarray(cv2.GaussianBlur(picture, (5, 5), 0), np.uint8)


def figure(
    height: float = 150.0, head: float = 0.05, shoulders: float = 0.14, legs: float = 0.1,
    faint: float = 1.0, shadow: float = 0.0, x: float = 240.0, gap: float = 0.0,
) -> Picture:  # fmt: skip
    """Somebody drawn with these half widths, heights; `faint` is how much they cover the room."""
    plain = seen(None)
    picture = plain.copy()
    top = person_box(x, height)[1]

    def part(first: float, last: float, half: float, colour: tuple[int, int, int]) -> None:
        rows = slice(max(0, round(top + first * height)), max(0, round(top + last * height)))
        picture[rows, max(0, round(x - half * height)) : max(0, round(x + half * height))] = colour

    if shadow:
        part(0.9, 1.06, shadow, (60, 80, 100))
    part(0.0, 0.14, head, (40, 50, 60))
    part(0.14, 0.52, shoulders, SHIRT)
    part(0.52, 1.0, legs, TROUSERS)
    if gap:
        part(0.6, 1.0, gap, (90, 120, 150))
    mixed = faint * picture.astype(float) + (1.0 - faint) * plain
    return smooth(mixed.astype(np.uint8))


# --- Found about a point


FIGURES: dict[str, Callable[[], Picture]] = {
    "as usual": figure,
    "far": partial(figure, 80.0),
    "near": partial(figure, 310.0),
    "very near": partial(figure, 420.0),
    "slender": partial(figure, 150.0, 0.03, 0.08, 0.06),
    "broad": partial(figure, 150.0, 0.08, 0.22, 0.16),
    "legs apart": partial(figure, gap=0.04),
    "on a shadow": partial(figure, shadow=0.3),
    "on a small shadow": partial(figure, shadow=0.16),
    "faint": partial(figure, faint=0.5),
    "fainter": partial(figure, faint=0.35),
    "hardly there": partial(figure, faint=0.2),
    "at the border": partial(figure, x=14.0),
    "bent aside": partial(figure, head=0.02, shoulders=0.26),
}


@pytest.mark.parametrize("name", FIGURES)
def test_most_contrast(name: str, pinned: Pinned) -> None:
    picture, height = FIGURES[name](), {"far": 80.0, "near": 310.0, "very near": 420.0}
    tall = height.get(name, 150.0)
    x = 14.0 if name == "at the border" else 240.0
    top, rows = person_box(x, tall)[1], cast(dict[str, Row], {})
    for down, aside in ((0.3, 0.0), (0.2, 0.05), (0.45, -0.09), (0.6, 0.04), (0.68, 0.0)):
        found = most_contrast(picture, x + aside * tall, top + down * tall)
        rows[f"{down} {aside}"] = (
            [None] if found is None else [*found.box_xyxy, found.sides, found.ends]
        )
    pinned(rows, **OF_PICTURES)


def test_pictures_of_other_sizes(pinned: Pinned) -> None:
    rows: dict[str, Row] = {}
    for size in ((240, 180), (960, 720)):
        picture = np.asarray(cv2.resize(figure(), size, interpolation=cv2.INTER_AREA), np.uint8)
        found = most_contrast(picture, size[0] / 2, 0.45 * size[1])
        rows[f"{size}"] = [None] if found is None else [*found.box_xyxy, found.sides, found.ends]
    pinned(rows, **OF_PICTURES)


def test_many_colours(pinned: Pinned) -> None:
    """A room and a shirt of hundreds of colours each, in steps of a few levels."""
    rng = np.random.default_rng(7)
    picture = np.kron(rng.integers(60, 200, (60, 80, 3)), np.ones((6, 6, 1))).astype(np.uint8)
    left, top, right, bottom = map(round, person_box(240.0, 150.0))
    shirt = rng.integers(0, 60, (bottom - top, right - left, 3)) + np.array([0, 20, 90])
    picture[top:bottom, left:right] = shirt.astype(np.uint8)
    rows: dict[str, Row] = {}
    for x in (240.0, 246.0, 252.0):
        found = most_contrast(picture, x, 160.0)
        rows[f"{x}"] = [None] if found is None else [*found.box_xyxy, found.sides, found.ends]
    pinned(rows, **OF_PICTURES)


@pytest.mark.parametrize("name", FIGURES)
def test_outline(name: str, pinned: Pinned) -> None:
    """The box of the outline, from boxes that are right and off, and its width by row."""
    picture, tall = FIGURES[name](), {"far": 80.0, "near": 310.0, "very near": 420.0}.get(name, 150)
    x = 14.0 if name == "at the border" else 240.0
    left, top, right, bottom = person_box(x, tall)
    rows: dict[str, Row] = {}
    for down, wider in ((0.0, 0.0), (0.12, 0.1), (-0.1, -0.1)):
        box = (left, top + (down - wider) * tall, right, bottom + (down + wider) * tall)
        rows[f"box {down} {wider}"] = [*outline_box(picture, box)]
    body, at = outline(picture, (left, top, right, bottom))
    rows["widths"] = [float(part.sum()) for part in np.array_split(body, 16)]
    rows["rows"] = [float(at[0]), float(at[-1]), len(at), body.shape[1]]
    pinned(rows, relative=0.02, absolute=1.0)


def test_what_has_head_and_shoulders(pinned: Pinned) -> None:
    """Heads and shoulders of every width, faint ones and such that go on above or below."""
    rows: dict[str, Row] = {}
    kinds = [
        *(("head", {"head": head}) for head in (0.01, 0.02, 0.03, 0.05, 0.07, 0.09, 0.11, 0.14)),
        *(("shoulders", {"shoulders": half}) for half in (0.06, 0.08, 0.11, 0.17, 0.2, 0.24, 0.3)),
        *(("faint", {"faint": faint}) for faint in (0.45, 0.6, 0.8)),
        *(("legs", {"legs": legs}) for legs in (0.03, 0.06, 0.18)),
        *(("shadow", {"shadow": shadow}) for shadow in (0.14, 0.3)),
    ]
    box = person_box(240.0, 150.0)
    for kind, changes in kinds:
        picture = figure(**changes)
        contrast = most_contrast(picture, 240.0, 160.0)
        found = outline_box(picture, box)
        if contrast is None:
            rows[f"{kind} {changes}"] = [None]
            continue
        sure = replace(contrast, sides=1.0, ends=2.0)
        rows[f"{kind} {changes}"] = [looks_upright(picture, one, found) for one in (contrast, sure)]
    picture = figure()
    sure = Contrast(box, 1.0, 2.0)
    for name, one in {
        **{f"sides {at}": replace(sure, sides=at) for at in (0.3, 0.5, 0.65, 0.75)},
        **{f"ends {at}": replace(sure, ends=at) for at in (0.8, 1.2, 1.8, 1.9)},
        **{f"height {by}": replace(sure, box_xyxy=(*box[:3], box[1] + by * 150.0))
           for by in (0.5, 0.65, 0.8, 0.9, 1.1, 1.25, 1.35, 1.5, 2.2)},
    }.items():  # fmt: skip
        rows[name] = [looks_upright(picture, one, box)]
    pinned(rows)


# --- Whether it is a person


WALK = Movement(
    pixels=400, aside=0.02, inside=0.9, highest=0.1, lowest=0.95, body=0.5, beside=0.1,
    body_step=0.06, box_step=0.05,
)  # fmt: skip
FIELDS: dict[str, Sequence[float]] = {
    "pixels": (30, 60, 90, 120, 190, 300),
    "aside": (0.05, 0.1, 0.14, 0.2, 0.26, 0.32, 0.5),
    "inside": (0.1, 0.2, 0.28, 0.4, 0.5, 0.6, 0.8, 1.0),
    "beside": (0.0, 0.2, 0.3, 0.45, 0.6, 0.9),
    "highest": (0.0, 0.15, 0.2, 0.3, 0.4, 0.6),
    "lowest": (0.2, 0.35, 0.5, 0.7, 0.75, 1.0),
    "body_step": (-0.2, -0.1, -0.05, -0.02, 0.02, 0.05, 0.1, 0.15, 0.18, 0.3),
    "box_step": (-0.08, -0.04, -0.025, -0.01, 0.0, 0.01, 0.02, 0.04, 0.08),
}


def proven_at(
    movements: Iterable[Movement | None], monkeypatch: pytest.MonkeyPatch, step_s: float = 0.05,
    bottom: float = 0.9,
) -> float | None:  # fmt: skip
    """When evidence suffices, of such movements; the body's feet at this share of the picture."""
    given = iter(movements)

    class Watch:
        def look(self, *_: object) -> Movement | None:
            return next(given, None)

    monkeypatch.setattr(proof_module, "MovementWatch", Watch)
    evidence, grey = Proof(), np.zeros((100, 100), np.uint8)
    for step in range(80):
        box = (40.0, 100 * (bottom - 0.8), 60.0, 100 * bottom)
        evidence.look(grey, box, grey, step * step_s)
        if evidence.proves:
            return step * step_s
    return None


def test_what_walks(monkeypatch: pytest.MonkeyPatch, pinned: Pinned) -> None:
    rows: dict[str, Row] = {}
    for field, values in FIELDS.items():
        for value in values:
            one = replace(WALK, **cast(Any, {field: value}))
            fast = replace(one, body_step=0.15) if field == "box_step" else one
            rows[f"{field} {value}"] = [
                proven_at([one] * 80, monkeypatch),
                proven_at([fast] * 80, monkeypatch),
                proven_at([one] * 80, monkeypatch, bottom=1.3),
            ]
    pinned(rows)


def test_who_comes_in_from_aside(monkeypatch: pytest.MonkeyPatch, pinned: Pinned) -> None:
    """Movement off the axis, a quiet of some frames, and then a walk on it."""
    rows: dict[str, Row] = {}
    quiet = replace(WALK, pixels=10)
    for aside, inside in itertools.product((0.1, 0.2, 0.26, 0.3, 0.5), (0.1, 0.2, 0.28, 0.35, 0.5)):
        passing = replace(WALK, aside=aside, inside=inside)
        rows[f"{aside} {inside}"] = [
            proven_at([passing] * 4 + [quiet] * pause + [WALK] * 80, monkeypatch)
            for pause in (0, 2, 4, 5, 7, 9, 14)
        ]
    for step_s in (0.02, 0.1, 0.15, 0.25, 0.5):
        rows[f"every {step_s} s"] = [proven_at([WALK] * 80, monkeypatch, step_s)]
    rows["with pauses"] = [
        proven_at(([WALK] * 3 + [quiet] * pause) * 20, monkeypatch) for pause in range(1, 7)
    ]
    pinned(rows)


def grey_of(picture: Picture) -> NDArray[np.uint8]:
    return np.asarray(cv2.cvtColor(smooth(picture), cv2.COLOR_BGR2GRAY), np.uint8)


def moving(
    step_px: float, height: float = 150.0, x: float = 240.0, pan: int = 0, contrast: float = 1.0,
    zoom: float = 1.0, other: float | None = None, grows: float = 0.0, plain: slice | None = None,
    noise: float = 1.0,
) -> Row:  # fmt: skip
    """All that is told of nine frames in which somebody goes so far, and the camera turns.

    Args:
        contrast: of everything: low ones leave no texture.
        zoom: of the picture from frame to frame.
        other: how far another one walks by.
        grows: share of the height by frame.
        plain: columns in which the room has no texture.
        noise: of the camera, grey levels.
    """
    watch, row, rng = MovementWatch(), cast(Row, []), np.random.default_rng(8)
    for seq in range(9):
        at, tall = x + step_px * seq - pan * seq, height * (1.0 + grows * seq)
        picture = room()[:, WIDTH + pan * seq : 2 * WIDTH + pan * seq].copy()
        if plain is not None:
            picture[:, plain] = (140, 140, 140)
        if other is not None:
            draw(picture, 40.0 + other * seq, height, (60, 180, 60))
        draw(picture, at, tall)
        picture = np.clip(picture + rng.normal(0, noise, picture.shape), 0, 255).astype(np.uint8)
        grey = grey_of(picture).astype(float)
        grey = 128 + contrast * (grey - 128)
        matrix = cv2.getRotationMatrix2D((WIDTH / 2, HEIGHT / 2), 0.0, zoom**seq)
        grey = cv2.warpAffine(grey, matrix, (WIDTH, HEIGHT), borderMode=cv2.BORDER_REPLICATE)
        box = person_box(at, tall)
        free = np.full((HEIGHT, WIDTH), 255, np.uint8)
        margin = 0.1 * tall
        free[max(0, round(box[1] - margin)) :,
             max(0, round(box[0] - margin)) : max(0, round(box[2] + margin))] = 0  # fmt: skip
        told = watch.look(grey.astype(np.uint8), box, free, 0.06 * seq)
        if seq >= 4:
            row += [None] if told is None else [*astuple(told)]
    return row


FILMS: dict[str, Callable[[], Row]] = {
    "stands": partial(moving, 0.0),
    "slowly": partial(moving, 0.5),
    "walks": partial(moving, 2.5),
    "runs": partial(moving, 6.0),
    "far": partial(moving, 1.2, height=70.0),
    "near": partial(moving, 4.0, height=300.0),
    "very near": partial(moving, 5.0, height=420.0),
    "camera turns": partial(moving, 0.0, pan=3),
    "both": partial(moving, 2.0, pan=-4),
    "passed by": partial(moving, 0.0, other=20.0),
    "comes": partial(moving, 0.5, grows=0.02),
    "grey": partial(moving, 2.5, contrast=0.4),
    "paler": partial(moving, 2.5, contrast=0.22),
    "hardly seen": partial(moving, 2.5, contrast=0.12),
    "in noise": partial(moving, 1.5, noise=14.0),
    "in more noise": partial(moving, 2.5, noise=25.0),
    "wall on the left": partial(moving, 2.5, plain=slice(0, 215)),
    "wall on both sides": partial(moving, 2.5, plain=slice(120, 360)),
    "left border": partial(moving, 1.0, x=80.0),
    "at the left border": partial(moving, 1.0, x=45.0),
    "camera comes a little": partial(moving, 2.5, zoom=1.003),
    "camera comes": partial(moving, 2.5, zoom=1.006),
    "camera goes": partial(moving, 2.5, zoom=0.99),
}


@pytest.mark.parametrize("name", FILMS)
def test_movement(name: str, pinned: Pinned) -> None:
    pinned({"told": FILMS[name]()}, relative=0.03, absolute=0.01)


def test_how_long_pictures_are_compared(pinned: Pinned) -> None:
    """Frames at every rate: whether something is told of each."""
    rows: dict[str, Row] = {}
    free = np.full((HEIGHT, WIDTH), 255, np.uint8)
    free[:, 200:280] = 0
    greys = [grey_of(seen(240.0 + seq)) for seq in range(5)]
    for step_s in (0.03, 0.05, 0.09, 0.13, 0.2, 0.25, 0.3, 0.4, 0.6, 0.8, 1.2):
        watch, row = MovementWatch(), cast(Row, [])
        for seq, grey in enumerate(greys):
            told = watch.look(grey, person_box(240.0, 150.0), free, seq * step_s)
            row.append(None if told is None else round(-told.box_step + told.body_step, 3))
        rows[f"{step_s}"] = row
    pinned(rows, relative=0.03, absolute=0.01)


def test_where_movement_is_looked_for(pinned: Pinned) -> None:
    """What is cut out around a body, and which of its pixels are body, or beside it."""
    part, shown = proof_module._around(grey_of(seen(240.0)), person_box(240.0, 150.0), np.eye(3))
    masks = (proof_module._IS_BODY, proof_module._IS_BESIDE, *proof_module._SIDES)
    pinned(
        {
            "part": [*part.shape, int(shown.sum())],
            **{f"{at}": [*mask.shape, int(mask.sum())] for at, mask in enumerate(masks)},
        }
    )


def test_flow_of_the_background(pinned: Pinned) -> None:
    """A slanted flow with much or little scatter, and others that move within it."""
    rng, rows = np.random.default_rng(11), cast(dict[str, Row], {})
    shape = proof_module._IS_BESIDE.shape
    for scatter, share in itertools.product((0.0, 0.05, 0.12, 0.4, 1.0), (0.0, 0.15, 0.35)):
        flow = rng.normal(0, scatter + 1e-3, (*shape, 2))
        flow[..., 0] += 0.6 + 0.4 * np.linspace(-1, 1, shape[1])
        flow[rng.random(shape) < share] += (2.0, -1.0)
        background, spread = proof_module._plane(flow, proof_module._IS_BESIDE)
        rows[f"{scatter} {share}"] = [spread, *map(float, background[::60, ::50].ravel())]
    pinned(rows, relative=1e-5, absolute=1e-7)


def test_growth_of_the_picture(pinned: Pinned) -> None:
    rows: dict[str, Row] = {}
    for tilt in (0.0, 2e-4, 1e-3):
        turn = np.array([[1.01, 0.0, 4.0], [0.0, 0.99, 1.0], [tilt, 0.5 * tilt, 1.0]])
        rows[f"{tilt}"] = [proof_module._zoom(turn, (360, 480))]
    pinned(rows, relative=1e-9, absolute=1e-12)


def speckled(spots: Sequence[tuple[int, int, int, int]], x: int = 240) -> NDArray[np.uint8]:
    """A grey wall with texture at both ends of the picture and in spots (x, y, w, h)."""
    rng = np.random.default_rng(12)
    grain = cv2.resize(rng.uniform(40, 220, (120, 160)).astype(np.float32), (WIDTH, HEIGHT))
    picture = np.full((HEIGHT, WIDTH), 128.0, np.float32)
    picture[:, : x - 110] = grain[:, : x - 110]
    picture[:, x + 110 :] = grain[:, x + 110 :]
    for left, top, wide, high in spots:
        picture[top : top + high, left : left + wide] = grain[top : top + high, left : left + wide]
    return picture.astype(np.uint8)


def test_how_much_texture_tells_movement(pinned: Pinned) -> None:
    """Spots on the body and on either side, larger and larger: whether anything is told, and what
    counts as movement then."""
    rows: dict[str, Row] = {}
    free = np.full((HEIGHT, WIDTH), 255, np.uint8)
    free[:, 140:340] = 0
    for on_body, beside in itertools.product((1, 4, 8, 14, 30), (2, 7, 12, 18, 40)):
        watch, row = MovementWatch(), cast(Row, [])
        for seq in range(5):
            spots = [(240 - on_body // 2 + 2 * seq, 150, on_body, 2 * on_body),
                     (180, 150, beside // 2, beside), (290, 150, beside // 2, beside)]  # fmt: skip
            told = watch.look(speckled(spots), person_box(240.0, 100.0), free, 0.08 * seq)
            if seq == 4:
                row += [told is not None, told is not None and told.pixels > 0]
        rows[f"{on_body} {beside}"] = row
    pinned(rows)


def test_how_much_of_the_body_tells_movement(pinned: Pinned) -> None:
    """A box that goes on below the picture, farther and farther."""
    rows: dict[str, Row] = {}
    free = np.full((HEIGHT, WIDTH), 255, np.uint8)
    free[150:, 140:340] = 0
    greys = [grey_of(seen(240.0 + 2 * seq)) for seq in range(5)]
    for below in (0.0, 0.15, 0.25, 0.35, 0.45, 0.55, 0.65, 0.75, 0.85):
        watch, told = MovementWatch(), None
        box = (200.0, HEIGHT - (1 - below) * 100.0, 240.0, HEIGHT + below * 100.0)
        for seq, grey in enumerate(greys):
            told = watch.look(grey, box, free, 0.08 * seq)
        rows[f"{below}"] = [told is not None]
    pinned(rows)


# --- Kept by the clothes


def hidden(picture: Picture, x: float, share: float) -> Picture:
    """The lower part of a picture behind a board, or all of it from one side."""
    left, top, right, bottom = person_box(x, 150.0)
    first = round(bottom - share * (bottom - top))
    picture[max(0, first) :, max(0, round(left) - 20) : round(right) + 20] = (100, 140, 120)
    return picture


@cache
def _clothed(shirt: tuple[int, int, int]) -> Picture:
    picture = seen(None)
    draw(picture, 240.0, 150.0, shirt)
    return picture


def mixed(share: float) -> Picture:
    """Somebody whose clothes have changed by so much."""
    one, other = _clothed(SHIRT), _clothed((200, 120, 30))
    return np.asarray((1 - share) * one + share * other, np.uint8)


def twin(seq: int) -> Picture:
    picture = seen(240.0, 180.0)
    draw(picture, 60.0 + 9.0 * seq, 260.0)
    return picture


def striped(seq: int) -> Picture:
    """The wall behind changes its colour as the camera turns."""
    picture = seen(None, pan=4 * seq)
    wall = np.arange(WIDTH)[None, :, None] + 4 * seq
    colours = np.array([(90, 170, 120), (170, 110, 150), (150, 150, 90)])
    tinted = 0.5 * picture + 0.5 * colours[(wall // 90 % 3)[..., 0]]
    picture = tinted.astype(np.uint8)
    draw(picture, 240.0, 150.0)
    return picture


Script = list[tuple[Picture, float]]


def still(*pictures: Picture, dt_s: float = 0.05) -> Script:
    return [(picture, dt_s) for picture in pictures]


SCRIPTS: dict[str, Callable[[], Script]] = {
    "walks": lambda: still(*(seen(240.0 + 3.0 * seq, pan=seq) for seq in range(45))),
    "runs and stops": lambda: still(*(seen(140.0 + 7.0 * min(seq, 20)) for seq in range(35))),
    "comes": lambda: still(*(seen(240.0, 140.0 * 1.035**seq) for seq in range(30))),
    "comes near": lambda: still(*(seen(240.0, 300.0 * 1.012**seq) for seq in range(40))),
    "goes": lambda: still(*(seen(240.0, 220.0 * 0.97**seq) for seq in range(30))),
    "leaves the picture": lambda: still(*(seen(380.0 + 5.0 * seq) for seq in range(34))),
    "behind a board": lambda: still(
        *(hidden(seen(240.0), 240.0, 0.9 * math.sin(math.pi * seq / 40) ** 2) for seq in range(44))
    ),
    "hidden for a moment": lambda: still(
        *[seen(240.0)] * 15, *[seen(None)] * 4, *[seen(262.0)] * 12
    ),
    "walks out of sight": lambda: still(
        *(seen(200.0 + 4.0 * seq if not 14 <= seq < 20 else None) for seq in range(32))
    ),
    "hidden for long": lambda: still(
        *[seen(240.0)] * 15, *[seen(None)] * 14, *[seen(110.0, 120.0)] * 12
    ),
    "like it, hidden for long": lambda: still(
        *[seen(240.0)] * 15, *[seen(None)] * 12, *[mixed(0.3)] * 6, *[mixed(0.15)] * 6
    ),
    "in other clothes": lambda: still(*(mixed(min(1.0, seq / 30)) for seq in range(40))),
    "clothes changed slowly": lambda: still(
        *[_clothed(SHIRT)] * 60, *(mixed(seq / 40) for seq in range(32))
    ),
    "before another wall": lambda: still(*(striped(seq) for seq in range(40))),
    "faint": lambda: still(*(figure(faint=0.3) for _ in range(12)),
                           *(figure(faint=0.3, x=243.0) for _ in range(12))),
    "light": lambda: still(
        *(seen(240.0, light=1.0 if seq < 12 else 0.55 if seq < 24 else 1.3) for seq in range(36))
    ),
    "twin": lambda: still(*(twin(max(0, seq - 15)) for seq in range(50))),
    "pauses": lambda: [
        (seen(100.0 + 9.0 * seq), dt_s)
        for seq, dt_s in enumerate([0.05] * 8 + [0.1, 0.16, 0.2, 0.28, 0.32, 0.5, 0.7, 0.05] * 2)
    ],
}  # fmt: skip


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_person_looked_for(name: str, pinned: Pinned) -> None:
    script = SCRIPTS[name]()
    x, height = {
        "runs and stops": (140.0, 150.0), "comes": (240.0, 140.0), "comes near": (240.0, 300.0),
        "goes": (240.0, 220.0), "leaves the picture": (380.0, 150.0), "twin": (240.0, 180.0),
        "walks out of sight": (200.0, 150.0), "pauses": (100.0, 150.0),
    }.get(name, (240.0, 150.0))  # fmt: skip
    person, rows = PointedPerson(person_box(x, height), HEIGHT), cast(dict[str, Row], {})
    for seq, (picture, dt_s) in enumerate(script):
        camera = STILL.copy()
        if name in ("walks", "before another wall"):
            camera[0, 2] = -1.0 if name == "walks" else 0.0
        sighting = person.look(smooth(picture), camera, dt_s)
        row: Row = [*person.box_xyxy, person.missed_s]
        if sighting is not None:
            row += [*sighting.box_xyxy, sighting.likeness, sighting.in_view, sighting.doubted]
        if seq % 3 == 2 or seq < 3:
            rows[f"{seq}"] = row
    pinned(rows, **OF_PICTURES)


# --- What all of it sends


def test_scores_and_proof_of_a_click(pinned: Pinned) -> None:
    """Stands, is proven by walking, is doubted for a twin; the camera's motion beside."""
    detector, rows = Detector(DetectorSettings()), cast(dict[str, Row], {})
    for seq in range(64):
        picture = seen(240.0 + 2.5 * min(max(0, seq - 8), 16), 180.0, pan=max(0, seq - 44) // 2)
        if seq > 40:
            draw(picture, 60.0 + 12.0 * (seq - 40), 262.0)
        point = pointed(240.0, 160.0, seq=0) if seq == 0 else None
        sent = detector.detect(frame_id(seq), picture, (WIDTH, HEIGHT), None, point)
        motion = sent.camera_motion
        row: Row = [] if motion is None else [*motion.affine, motion.quality]
        for blob in sent.blobs:
            row += [*blob.box_xyxy, blob.score, blob.proven]
        if seq % 2 == 0:
            rows[f"{seq}"] = row
    pinned(rows, **OF_PICTURES)


def given_up_s(picture: Picture, step_s: float) -> float | None:
    """When a place is no longer watched, of pictures that stay as they are."""
    looking = PointedAt()
    if not looking.point(picture, 240.0, 160.0):
        return None
    empty = smooth(seen(None))
    for step in range(100):
        looking.look(picture if step < 3 else empty, round(step * step_s * 1e9))
        if not looking.is_looking:
            return step * step_s
    return None


def test_when_a_place_is_given_up(pinned: Pinned) -> None:
    locker = seen(None)
    left, top, right, bottom = map(round, person_box(240.0, 150.0))
    locker[top:bottom, left + 10 : right - 10] = TROUSERS
    pinned(
        {
            "a person that is gone": [given_up_s(figure(), 3.0)],
            "a thing": [given_up_s(smooth(locker), 0.6)],
        }
    )


# --- Parts: colours, places, ends, sizes


def test_colours_that_are_learned(pinned: Pinned) -> None:
    """Likeness of random pictures after learning others, at several rates."""
    rng, colours = np.random.default_rng(9), StripColours()
    cover = np.tile(np.linspace(0.0, 1.0, 60, dtype=np.float32), (60, 1))
    cover[:6, :20] = np.nan
    spans = [slice(10 * strip, 10 * strip + 10) for strip in range(STRIPS)]
    rows: dict[str, Row] = {}
    tries = [
        np.kron(rng.integers(0, 255, (12, 12, 3)), np.ones((5, 5, 1))).astype(np.uint8)
        for _ in range(3)
    ]
    for step in range(8):
        base = rng.integers(40, 200, 3)
        noise = rng.normal(0, 6, (60, 60, 3)) + 40 * (cover > 0.5)[..., None]
        image = np.clip(base + noise, 0, 255).astype(np.uint8)
        colours.learn(colour_bins(image), cover, spans, 0.3, 0.6)
        if step == 1:
            colours.keep()
        row: Row = []
        for one in (image, *tries):
            maps = colours.likeness(colour_bins(one))
            row += [float(layer.mean()) for layer in maps]
        rows[f"{step}"] = row
    pinned(rows, **OF_PICTURES)


def test_light(pinned: Pinned) -> None:
    """Pictures that get lighter and darker, at once and slowly, some nearly black or white."""
    rng, rows = np.random.default_rng(10), cast(dict[str, Row], {})
    base = np.kron(rng.uniform(4, 252, (30, 40, 3)), np.ones((6, 6, 1)))
    for name, gains in {
        "at once": [1.0, 0.5, 0.5, 1.0, 2.5, 0.3, 0.2, 1.0],
        "slowly": [1.03**step for step in range(20)],
        "hardly": [1.0, 1.005, 1.012, 1.03, 1.06],
        "dark": [0.02, 0.03, 0.05, 0.08, 0.14, 0.3],
        "bright": [1.0, 3.0, 8.0, 20.0, 60.0],
    }.items():
        exposure = Exposure()
        for step, gain in enumerate(gains):
            image = np.clip(gain * base, 0, 255).astype(np.uint8)
            levelled = exposure.level(image, 0.05 if step % 3 else 1.5)
            rows[f"{name} {step}"] = [float(levelled.mean())]
    pinned(rows, **OF_PICTURES)


def random_maps(seed: int, size: tuple[int, int] = (112, 134)) -> list[FloatMap]:
    rng = np.random.default_rng(seed)
    return [
        np.asarray(
            cv2.resize(rng.uniform(-0.6, 0.6, (14, 17)).astype(np.float32), size[::-1]), np.float32
        )
        for _ in range(STRIPS)
    ]


def test_where_a_silhouette_fits(pinned: Pinned) -> None:
    rows: dict[str, Row] = {}
    for seed, slack, size_slack in itertools.product(range(5), (1.0, 2.5), (1.0, 2.0)):
        fit = best_fit(random_maps(seed), (67.0, 56.0, 40.0), slack, size_slack)
        place = fit.place
        rows[f"{seed} {slack} {size_slack}"] = [place.row, place.column, place.height, fit.score]
    pinned(rows, **OF_PICTURES)


def body_map(head: float, feet: float, half: float, like: float, floor: float = 0.0) -> FloatMap:
    """A body 100 px high about (120, 150): where it begins and ends, half width, likeness."""
    layer = np.full((300, 300), -0.4, np.float32)
    layer[round(120 - 100 * head) : round(120 + 100 * feet),
          round(150 - 100 * half) : round(150 + 100 * half)] = like  # fmt: skip
    if floor:
        layer[round(120 + 100 * floor) : 240, 108:192] = 0.5
    return layer


def test_where_a_body_ends(pinned: Pinned) -> None:
    shape, rows = silhouette(100), cast(dict[str, Row], {})
    place = Place(120 - shape.centre[1], 150 - shape.centre[0], 100)
    bodies = {
        **{f"length {at}": body_map(at, at, 0.1, 0.6) for at in (0.15, 0.25, 0.3, 0.4, 0.5, 0.7,
                                                                 0.9, 1.0, 1.3)},
        **{f"half width {half}": body_map(0.5, 0.5, half, 0.6) for half in (0.01, 0.015, 0.02,
                                                                             0.03, 0.05, 0.3)},
        **{f"likeness {like}": body_map(0.5, 0.5, 0.1, like) for like in (0.06, 0.12, 0.18, 0.25,
                                                                          0.35, 0.45)},
        **{f"shadow {at}": body_map(0.5, 0.6, 0.1, 0.6, at) for at in (0.1, 0.2, 0.28, 0.35, 0.45,
                                                                       0.55, 0.65)},
    }  # fmt: skip
    for aside in (0.1, 0.14, 0.18, 0.25, 0.33):
        moved = np.roll(body_map(0.5, 0.5, 0.03, 0.6), round(100 * aside), axis=1)
        bodies[f"aside {aside}"] = np.asarray(moved, np.float32)
    for gap_px in (1, 2, 3, 5, 7, 10):
        gapped = body_map(0.5, 0.7, 0.1, 0.6)
        gapped[160 : 160 + gap_px] = -0.4
        bodies[f"gap {gap_px}"] = gapped
    for wide_px in (16, 26, 40, 56):
        floor = body_map(0.5, 0.6, 0.1, 0.6)
        floor[165:200, 150 - wide_px : 150 + wide_px] = 0.5
        bodies[f"wide floor {wide_px}"] = floor
    for name, body in bodies.items():
        row: Row = []
        for first, last in ((0, 300), (106, 300), (96, 134), (75, 150), (85, 165)):
            inside = np.zeros_like(body)
            inside[first:last] = 1.0
            for end in extent([body * inside] * STRIPS, inside, place):
                row += [None] if end is None else [end.row, end.cut]
        rows[name] = row
    pinned(rows)


def test_places_alike(pinned: Pinned) -> None:
    """Two or three that look alike, near and far, half out of the picture, small or large."""
    rows: dict[str, Row] = {}
    first = smooth(seen(240.0))
    colours, view = StripColours(), view_around(first, *_centre(240.0, 150.0), 150.0, (134, 112))
    shape = silhouette(PERSON_PX)
    place = Place(56 - shape.centre[1], 67 - shape.centre[0], PERSON_PX)
    cover = np.zeros_like(view.inside)
    cover[place.span] = shape.cover
    spans = [slice(place.row + strip.first_row, place.row + strip.first_row + len(strip.weights))
             for strip in shape.strips]  # fmt: skip
    colours.learn(colour_bins(view.image), cover, spans, 1.0, 1.0)
    colours.keep()
    stance = Stance(HEIGHT, *person_box(240.0, 150.0)[1::2])
    for name, people in {
        "two": [(120.0, 120.0), (350.0, 170.0)],
        "three": [(80.0, 100.0), (240.0, 150.0), (400.0, 100.0)],
        "four": [(60.0, 110.0), (180.0, 110.0), (300.0, 110.0), (420.0, 110.0)],
        "at the borders": [(0.0, 150.0), (470.0, 150.0)],
        "small": [(100.0, 24.0), (200.0, 40.0), (300.0, 60.0), (420.0, 80.0)],
        "large": [(240.0, 420.0)],
    }.items():
        picture = seen(None)
        for x, height in people:
            draw(picture, x, height)
        for before in (45.0, 90.0, 150.0, 300.0, 400.0):
            places = alike(smooth(picture), colours, stance, before)
            best = sorted(places, key=lambda one: -one.score)[:6]
            rows[f"{name} {before}"] = [len(places), *itertools.chain(*map(astuple, best))]
    pinned(rows, **OF_PICTURES)


def _centre(x: float, height: float) -> tuple[float, float]:
    box: Box = person_box(x, height)
    return x, 0.5 * (box[1] + box[3])


def test_stance(pinned: Pinned) -> None:
    rows: dict[str, Row] = {}
    for top, bottom in ((100.0, 250.0), (40.0, 200.0), (150.0, 340.0), (170.0, 300.0)):
        stance = Stance(360, top, bottom)
        row: Row = []
        for step in range(60):
            stance.correct(180.0 + 2.0 * step, 150.0)
            if step % 10 == 0:
                row += [
                    stance.horizon,
                    stance.centre(150.0),
                    stance.height(60.0, None, 150.0),
                    stance.height(None, 300.0, 150.0),
                    stance.least_height(50.0, 320.0),
                ]
        rows[f"{top} {bottom}"] = row
    pinned(rows)


def test_doubt(pinned: Pinned) -> None:
    """Heights that rise by every factor within every time; for how long they are doubted."""
    rows: dict[str, Row] = {}
    for first, factor, within_s in itertools.product(
        (0.2, 0.3, 0.42, 0.5, 0.8), (1.1, 1.18, 1.3, 1.5, 1.7), (0.05, 0.4, 0.9, 1.5)
    ):
        doubt, row = Doubt(), cast(Row, [])
        for step in range(120):
            share = min(max((0.05 * step - 1.0) / within_s, 0.0), 1.0)
            height = first * factor**share
            if doubt.raised(height, 0.05) != (len(row) % 2 == 1):
                row.append(0.05 * step)
        near = [doubt.as_before(first * by) for by in (0.7, 0.85, 0.95, 1.1, 1.15, 1.3, 1.6)]
        rows[f"{first} {factor} {within_s}"] = [*row, *near]
    pinned(rows)


def test_silhouettes(pinned: Pinned) -> None:
    rows: dict[str, Row] = {}
    for height in (20, PERSON_PX, 90):
        shape = silhouette(height)
        rows[f"{height}"] = [
            *shape.shape, *shape.centre, *(strip.first_row for strip in shape.strips),
            *(float(np.abs(strip.weights).sum()) for strip in shape.strips),
            *map(float, shape.cover[:, shape.centre[0] :: 6].sum(axis=0)),
        ]  # fmt: skip
    pinned(cast(Rows, rows), relative=1e-4)
