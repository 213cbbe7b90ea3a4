"""Where the network is made to look, in which turns, and how its looks become one; pinned.

Grids step by less than a factor of two, so that a threshold that is halved or doubled lies on the
other side of some value.
"""

from __future__ import annotations

import itertools
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from heel.services.detector.neural.between import Between, SeenPerson, newcomers
from heel.services.detector.neural.views import Attention, Expected, View, Views, look, together
from tests.support.pinned import Pinned, Value
from tests.unit.detector.test_neural_parts import FRAME, INPUT, STILL, box, found, person, scene

Row = list[Value]
SIZES = ((320, 240), (500, 300), (640, 480), (960, 540), (1280, 720), (1920, 1080))


def of(views: list[View] | tuple[View, ...]) -> Row:
    return [value for one in views for value in (one.left, one.top, one.width, one.height)]


def test_views_and_tiles(pinned: Pinned) -> None:
    rows: dict[str, Row] = {}
    for size in SIZES:
        views = Views(size, INPUT)
        rows[f"tiles {size}"] = of(views.tiles)
        for height in (12, 20, 30, 45, 60, 80, 110, 150, 200, 280):
            view = views.around(person(0.4 * size[0], 0.5 * size[1], height))
            rows[f"{size} {height}"] = [None] if view is None else of([view])
    pinned(rows)


def test_turns(pinned: Pinned) -> None:
    """Known people, newcomers and nobody; the left edges of what is looked at in forty frames."""
    rows: dict[str, Row] = {}
    for known, new, most in itertools.product((0, 1, 3, 5), (0, 1), (1, 2)):
        attention, row = Attention(Views(FRAME, INPUT), most), cast(Row, [])
        for turn in range(40):
            people = [Expected(person(90 + 180 * k, 270, 40), k) for k in range(known)]
            if new and turn % 3 == 0:
                people.append(Expected(person(880, 450, 36), None))
            row.append(" ".join(f"{v.left}/{v.width}" for v in attention.next_views(people)))
        rows[f"{known} {new} {most}"] = row
    pinned(rows)


def test_boxes_that_a_view_cuts(pinned: Pinned) -> None:
    """How near to each edge a box may come; the frame's own edges cut nobody."""
    rows: dict[str, Row] = {}
    for part in (View(100, 100, 200, 200), View(0, 0, 200, 200), View(440, 280, 200, 200)):
        kept: Row = []
        for side, off in itertools.product(range(4), (0.0, 0.6, 1.2, 1.6, 2.4, 3.4, 5.0)):
            inner = [60.0, 40.0, 140.0, 160.0]
            inner[side] = off if side < 2 else 200.0 - off
            model = cast(Any, SimpleNamespace(detect=lambda *_, b=inner: found((*b, 0.9))))
            image: NDArray[np.uint8] = np.zeros((480, 640, 3), np.uint8)
            kept.append(len(look(model, image, 0.3, part).boxes))
        rows[" ".join(map(str, of([part])))] = kept
    pinned(rows)


def test_two_looks_become_one(pinned: Pinned) -> None:
    """Boxes of the frame and of a view that overlap more and more, and pieces of larger people."""
    rows: dict[str, Row] = {}
    part = View(100, 100, 200, 200)
    for off in (0, 4, 8, 12, 16, 20, 26, 34):
        for tall in (120, 90, 64, 50):
            close = found((150 + off, 120, 190 + off, 120 + tall, 0.6))
            both = together(found((150, 120, 190, 240, 0.8)), close, part)
            rows[f"same {off} {tall}"] = [len(both.boxes), *map(float, both.scores)]
    for wide in (-6, -3, 0, 3, 6, 10, 16, 30, 60):
        whole, close = found((90, 90, 180, 300, 0.8)), found((170 - wide, 120, 190, 180, 0.9))
        both = together(whole, close, part)
        rows[f"piece {wide}"] = [len(both.boxes), *map(float, both.scores)]
    pinned(rows)


def test_who_is_kept_between_looks(pinned: Pinned) -> None:
    """Pixels that are less and less like those seen before, and boxes that leave the picture."""
    rows: dict[str, Row] = {}
    rng = np.random.default_rng(6)
    other = rng.integers(0, 255, (80, 30)).astype(float)
    for share in (0.0, 0.15, 0.25, 0.35, 0.45, 0.55, 0.65, 0.8):
        between = Between(longest_s=1.0)
        between.update(scene(at=(100, 60)), 0, [SeenPerson(box(100, 60), 0.8)], [], STILL)
        now = scene(at=(101, 60)).astype(float)
        now[60:140, 101:131] = (1 - share) * now[60:140, 101:131] + share * other
        kept = between.update(now.astype(np.uint8), 10**8, [], [box(101, 60)], STILL)
        rows[f"other {share}"] = [len(kept)]
    for left in (-2, -4, -6, -9, -12, -16):
        between = Between(longest_s=1.0)
        picture = np.roll(scene(at=(100, 60)), left - 100, axis=1)
        picture[:, left:] = picture[:, left - 1 : left]
        between.update(picture, 0, [SeenPerson(box(left, 60), 0.8)], [], STILL)
        kept = between.update(picture.copy(), 10**8, [], [box(left, 60)], STILL)
        rows[f"left {left}"] = [len(kept)]
    for off in (2, 5, 8, 11, 14, 17, 20, 24):
        again = [SeenPerson(box(100 + off, 60), 0.7)]
        between = Between(longest_s=1.0)
        between.update(scene(at=(100, 60)), 0, [SeenPerson(box(100, 60), 0.8)], [], STILL)
        kept = between.update(scene(at=(100, 60)), 10**8, again, [box(100, 60)], STILL)
        known = [Expected(box(100, 60), 1)]
        new = newcomers([SeenPerson(box(100 + off, 60), 0.7)], known, STILL)
        rows[f"again {off}"] = [len(kept), len(new)]
    pinned(rows)
