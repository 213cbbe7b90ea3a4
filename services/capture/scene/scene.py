"""The drawn scene: people with known positions walk, cross, stop and return before a still camera.

Every frame is a pure function of the settings and its index, so that any two processes draw the
same pixels, in any order.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.services.capture.scene.background import draw_background
from heel.services.capture.scene.drawing import paint_shadows, paint_shapes
from heel.services.capture.scene.figure import Body, Shape, figure_shapes
from heel.services.capture.scene.outfits import OUTFITS
from heel.services.capture.scene.projection import GroundCamera
from heel.services.capture.scene.settings import SceneSettings
from heel.services.capture.scene.walks import (
    CROSSING,
    DEMO,
    OUTSIDE,
    PACING,
    Path,
    Walk,
    choose_walks,
    duration_s,
)

_SCRIPTS: dict[str, tuple[Walk, ...]] = {
    "demo": DEMO,
    "crossing": CROSSING,
    "pacing": PACING,
    "empty": (),
}
_NOISE_MARGIN_PX = 64
"""Pixels by which the field of noise is larger than the picture: it is shifted every frame."""
_GOLDEN = 2654435769
"""2**32 divided by the golden ratio (Knuth, TAOCP 3, 6.4): multiples of it spread evenly."""
_EMPTY_SCENE_S = 4.0
"""Seconds that a scene without people lasts; chosen by hand."""


@dataclass(frozen=True)
class Truth:
    """Where one person really is.

    Attributes:
        person_id: from 1.
        box_xyxy: left, top, right, bottom of the whole body in pixels, clipped to the picture.
        visible_fraction: share of the body's pixels that are in the picture and not hidden.
    """

    person_id: int
    box_xyxy: tuple[float, float, float, float]
    visible_fraction: float


class Scene:
    """A drawn scene with its truth.

    Attributes:
        settings: what it was made from.
        period_s: length of one pass, after which all start again.
        frame_count: frames to play; higher indices go on with the next pass.
    """

    def __init__(self, settings: SceneSettings | None = None) -> None:
        self.settings = settings = settings or SceneSettings()
        self._camera = GroundCamera(settings.width, settings.height)
        rng = np.random.default_rng(settings.seed)
        self._background, self._occluders = draw_background(self._camera, rng)
        script = _SCRIPTS[settings.name]
        people = len(script) if settings.people is None else settings.people
        walks = choose_walks(script, people, rng)
        ends_s = [duration_s(walk, self._camera) for walk in walks]
        self.period_s = max(ends_s, default=_EMPTY_SCENE_S)
        self._paths = [Path(walk, self._camera, self.period_s, rng) for walk in walks]
        first = int(rng.integers(len(OUTFITS)))
        self._outfits = [OUTFITS[(first + i) % len(OUTFITS)] for i in range(people)]
        self.frame_count = settings.frames or max(1, int(self.period_s * settings.fps))
        self._noise = _noise_fields(settings, rng)

    def frame(self, index: int) -> NDArray[np.uint8]:
        """Frame `index` >= 0, a new (H, W, 3) uint8 BGR array."""
        bodies = self._bodies(index)
        image = self._background.copy()
        if self.settings.shadows:
            paint_shadows(image, [body for _, body in bodies], self._camera)
        waiting = list(self._occluders)
        for person, body in bodies:
            while waiting and waiting[0].z_m > body.stance.z_m:
                self._restore(image, waiting.pop(0).mask)
            paint_shapes(image, figure_shapes(body, self._outfits[person]))
        for occluder in waiting:
            self._restore(image, occluder.mask)
        return self._add_noise(image, index)

    def truth(self, index: int) -> list[Truth]:
        """All people with a part inside frame `index`, by id; also those fully hidden."""
        size = (self._camera.height, self._camera.width)
        labels = np.zeros(size, np.uint8)
        waiting = list(self._occluders)
        found: list[tuple[int, tuple[float, float, float, float], int]] = []
        for person, body in self._bodies(index):
            while waiting and waiting[0].z_m > body.stance.z_m:
                labels[waiting.pop(0).mask > 0] = 0
            shapes = figure_shapes(body, self._outfits[person])
            box = _bounds(shapes, self._camera)
            if box is not None:
                found.append((person, box, _fill(labels, shapes, person + 1)))
        for occluder in waiting:
            labels[occluder.mask > 0] = 0
        counts = np.bincount(labels.ravel(), minlength=len(self._paths) + 1)
        rows = [
            Truth(person + 1, box, min(1.0, float(counts[person + 1]) / max(1, area)))
            for person, box, area in found
        ]
        return sorted(rows, key=lambda row: row.person_id)

    def _bodies(self, index: int) -> list[tuple[int, Body]]:
        """People near the picture at frame `index`, farthest first."""
        time_s = index / self.settings.fps
        stances = [(person, path.stance(time_s)) for person, path in enumerate(self._paths)]
        near = [
            (person, Body(stance, self._camera))
            for person, stance in stances
            if abs(stance.x_m) < OUTSIDE * self._camera.half_width_m(stance.z_m) - 0.01
        ]
        return sorted(near, key=lambda item: -item[1].stance.z_m)

    def _restore(self, image: NDArray[np.uint8], mask: NDArray[np.uint8]) -> None:
        cv2.copyTo(self._background, mask, image)

    def _add_noise(self, image: NDArray[np.uint8], index: int) -> NDArray[np.uint8]:
        if self._noise is None:
            return image
        # A fresh field for every frame would cost 20 ms; a cut of a larger one at a place that
        # jumps costs 0.3 ms, and no pixel sees the same value again within a second.
        place = (index + 1) * _GOLDEN
        y, x = (place >> 8) % _NOISE_MARGIN_PX, (place >> 20) % _NOISE_MARGIN_PX
        height, width = image.shape[:2]
        above, below = (field[y : y + height, x : x + width] for field in self._noise)
        cv2.add(image, above, image)
        cv2.subtract(image, below, image)
        return image


def _noise_fields(
    settings: SceneSettings, rng: np.random.Generator
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]] | None:
    """What to add and what to subtract, (H + margin, W + margin, 3); None without noise."""
    if settings.noise == 0.0:
        return None
    shape = (settings.height + _NOISE_MARGIN_PX, settings.width + _NOISE_MARGIN_PX, 3)
    levels = np.rint(rng.standard_normal(shape, np.float32) * settings.noise)
    return np.clip(levels, 0, 255).astype(np.uint8), np.clip(-levels, 0, 255).astype(np.uint8)


def _bounds(shapes: list[Shape], camera: GroundCamera) -> tuple[float, float, float, float] | None:
    """The box around all shapes, clipped; None when nothing of it is in the picture."""
    corners = np.concatenate([shape.outline for shape in shapes])
    left, top = np.maximum(corners.min(axis=0), 0.0).tolist()
    right, bottom = np.minimum(corners.max(axis=0), (camera.width, camera.height)).tolist()
    if right - left < 1.0 or bottom - top < 1.0:
        return None
    return left, top, right, bottom


def _fill(labels: NDArray[np.uint8], shapes: list[Shape], label: int) -> int:
    """Paint one person's label; the number of pixels of the whole body, also outside."""
    corners = np.concatenate([shape.outline for shape in shapes])
    left, top = np.floor(corners.min(axis=0)).astype(int) - 1
    right, bottom = np.ceil(corners.max(axis=0)).astype(int) + 2
    body = np.zeros((bottom - top, right - left), np.uint8)
    for shape in shapes:
        outline = np.rint(shape.outline - (left, top)).astype(np.int32)
        cv2.fillConvexPoly(body, outline, 255)
    height, width = labels.shape
    x0, y0, x1, y1 = max(left, 0), max(top, 0), min(right, width), min(bottom, height)
    if x1 > x0 and y1 > y0:
        cut = body[y0 - top : y1 - top, x0 - left : x1 - left]
        labels[y0:y1, x0:x1][cut > 0] = label
    return int(np.count_nonzero(body))
