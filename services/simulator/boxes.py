"""Boxes of people as a detector would give them: with its errors, and without identities.

It stands in for a detector of people where no picture is rendered. It knows where all people are,
so its output says in every message that it is simulated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heel.schemas import Blob, Blobs, FrameId, Patch
from heel.services.geometry.boxes import iou
from heel.services.simulator.ego_motion import EgoMotion
from heel.services.simulator.errors import SimulatorError
from heel.services.simulator.exposure import Exposure
from heel.services.simulator.false_alarms import FalseAlarms
from heel.services.simulator.patches import PATCH_HEIGHT, PATCH_WIDTH, Light, Patches
from heel.services.simulator.solids import Solids
from heel.services.simulator.state import CameraMount, Scenery, WorldView
from heel.services.simulator.views import COLUMNS, ROWS, Sight, lens, look

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class DetectorErrors:
    """How wrong the boxes are.

    Attributes:
        miss: share of well visible people that are missed, each frame for itself.
        burst_hz: how often a person begins to be missed for a while.
        burst_s: how long, on average.
        jitter_px, jitter_share: an edge is off by that, plus that share of the box's height;
            for people at 10 m it is twice as much.
        jitter_memory: share of the error that stays from frame to frame.
        shrink: how much of what is hidden a box leaves out, on average; detectors guess the rest.
        false_hz: how many false alarms begin a second.
        false_s: how long they last, on average.
    """

    miss: float = 0.02
    burst_hz: float = 0.06
    burst_s: float = 0.35
    jitter_px: float = 1.0
    jitter_share: float = 0.01
    jitter_memory: float = 0.6
    shrink: float = 0.7
    false_hz: float = 0.12
    false_s: float = 0.25


class SimulatedDetector:
    """Sees the people of a world through the robot's camera.

    Args:
        mount: the camera.
        seed: of all errors.
        errors: how wrong it is.
    """

    def __init__(self, mount: CameraMount, seed: int, errors: DetectorErrors | None = None) -> None:
        self._mount = mount
        self._camera = lens(mount)
        self._errors = errors or DetectorErrors()
        self._rng, motion, self._alarm_rng, self._pixel_rng = np.random.default_rng(seed).spawn(4)
        self._azimuth_rad = float(self._rng.uniform(-np.pi, np.pi))
        self._motion = EgoMotion(mount, motion)
        self._exposure = Exposure()
        self._scenery: Scenery | None = None
        self._last_s: float | None = None

    def detect(self, world: WorldView, frame: FrameId) -> Blobs:
        """The people of this frame. Call it once a frame, in order.

        Raises:
            SimulatorError: the camera is off: there is no frame.
        """
        if not world.camera_on:
            raise SimulatorError(
                f"the camera gives no picture at {world.t_s:.2f} s: ask for none while it is off"
            )
        self._enter(world)
        dt_s = world.t_s - self._last_s if self._last_s is not None else 1.0 / self._mount.fps
        self._last_s = world.t_s
        self._exposure.expose(world.brightness, dt_s)
        light = Light(self._azimuth_rad, self._exposure.level, self._exposure.gain)
        sight = look(world, self._solids, self._mount)
        found, boxes, scores = self._find(sight, dt_s)
        pixels, share = self._patches.draw(world.people, world.robot, sight, found, boxes, light)
        self._alarms.step(world.t_s, dt_s, world.robot)
        false_boxes, false_scores, colours = self._alarms.boxes(world.robot, self._camera)
        false_boxes, large = self._clip(false_boxes)
        blobs = _blobs(boxes, scores, pixels, share)
        if large.any():
            crops = self._patches.plain(colours[large], light)
            blobs += _blobs(
                false_boxes[large], false_scores[large], crops, np.full(len(crops), 0.7)
            )
        # In order of scores, as detectors do: the order must not tell the identities.
        blobs.sort(key=lambda blob: blob.score or 0.0, reverse=True)
        return Blobs(
            **frame.model_dump(),
            width=self._mount.width_px,
            height=self._mount.height_px,
            source_width=self._mount.width_px,
            source_height=self._mount.height_px,
            blobs=tuple(blobs),
            kind="people",
            camera_motion=self._motion.since_last(world.robot, self._exposure.quality),
            detector="simulated",
        )

    def _enter(self, world: WorldView) -> None:
        """Begin anew in another world."""
        if self._scenery is world.scenery:
            return
        scenery = self._scenery = world.scenery
        count = len(world.people)
        self._solids = Solids(scenery.obstacles)
        self._patches = Patches(scenery, world.people, self._pixel_rng)
        self._alarms = FalseAlarms(
            scenery.obstacles, self._errors.false_hz, self._errors.false_s, self._alarm_rng
        )
        self._burst = np.zeros(count, np.bool_)
        self._error = self._rng.standard_normal((count, 5))
        self._last_s = None

    def _find(self, sight: Sight, dt_s: float) -> tuple[NDArray[np.intp], Array, Array]:
        """Indices (K,) of those found, their boxes (K, 4) and scores (K,)."""
        count = len(sight.visible)
        chance, wobble = self._rng.random((2, count)), self._rng.standard_normal((6, count))
        quality = self._quality(sight)
        self._burst_on(quality, chance[0], dt_s)
        memory = self._errors.jitter_memory
        self._error = memory * self._error + np.sqrt(1.0 - memory**2) * wobble[:5].T
        likely = (1.0 - self._errors.miss) * quality * np.where(self._burst, 0.1, 1.0)
        boxes, large = self._clip(self._jittered(sight))
        found = np.flatnonzero((chance[1] < likely) & large & sight.in_front)
        found = _suppress(found, boxes, sight.depth_m)
        scores = np.clip(0.3 + 0.62 * quality + 0.06 * wobble[5], 0.05, 0.99)
        return found, boxes[found], scores[found]

    def _quality(self, sight: Sight) -> Array:
        """How well each person is to be seen, 0 to 1 (N,)."""
        height = sight.box_xyxy[:, 3] - sight.box_xyxy[:, 1]
        in_picture = np.maximum(sight.in_picture.mean((1, 2)), 1e-6)
        free = _ramp(sight.visible / in_picture, 0.2, 0.7)
        return (
            free
            * _ramp(sight.visible, 0.05, 0.3)
            * _ramp(height, 15.0, 55.0)
            * self._exposure.quality
        )

    def _burst_on(self, quality: Array, chance: Array, dt_s: float) -> None:
        begins = chance < self._errors.burst_hz * dt_s * (2.0 - quality)
        lasts = chance < np.exp(-dt_s / self._errors.burst_s)
        self._burst = np.where(self._burst, lasts, begins)

    def _jittered(self, sight: Sight) -> Array:
        full, height = sight.box_xyxy, sight.box_xyxy[:, 3] - sight.box_xyxy[:, 1]
        shrink = _ramp(self._errors.shrink + 0.3 * self._error[:, 4:], 0.0, 1.0)
        spread = self._errors.jitter_px + self._errors.jitter_share * height
        spread = spread * (1.0 + 2.0 * _ramp(sight.depth_m, 0.0, 20.0))
        wrong = shrink * (_seen_extent(sight) - full) + spread[:, None] * self._error[:, :4]
        return np.asarray(full + wrong)

    def _clip(self, boxes: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Boxes cut at the picture's border, and which of them are worth reporting."""
        mount = self._mount
        size = np.array([mount.width_px, mount.height_px] * 2, np.float64)
        clipped = np.minimum(np.maximum(boxes, 0.0), size)
        width, height = clipped[:, 2] - clipped[:, 0], clipped[:, 3] - clipped[:, 1]
        return clipped, np.asarray((width > 4.0) & (height > 12.0))


def _seen_extent(sight: Sight) -> Array:
    """Boxes (N, 4) of people, shrunk to what is left of them where something hides the rest."""
    open_cells = sight.hidden_by < 0
    rows, columns = np.asarray(open_cells.any(2)), np.asarray(open_cells.any(1))
    box = sight.box_xyxy
    width, height = box[:, 2] - box[:, 0], box[:, 3] - box[:, 1]
    left, right = columns.argmax(1) / COLUMNS, columns[:, ::-1].argmax(1) / COLUMNS
    top, bottom = rows.argmax(1) / ROWS, rows[:, ::-1].argmax(1) / ROWS
    return np.stack(
        [
            box[:, 0] + left * width,
            box[:, 1] + top * height,
            box[:, 2] - right * width,
            box[:, 3] - bottom * height,
        ],
        axis=-1,
    )


def _suppress(found: NDArray[np.intp], boxes: Array, depth_m: Array) -> NDArray[np.intp]:
    """Of two boxes that all but coincide detectors report one: the nearer person's."""
    kept: list[int] = []
    box = boxes.tolist()
    for index in found[np.argsort(depth_m[found])].tolist():
        if all(iou(box[index], box[other]) < 0.65 for other in kept):
            kept.append(index)
    return np.array(kept, np.intp)


def _ramp(value: Array, least: float, most: float) -> Array:
    return np.asarray(np.minimum(np.maximum((value - least) / (most - least), 0.0), 1.0))


def _blobs(boxes: Array, scores: Array, pixels: NDArray[np.uint8], share: Array) -> list[Blob]:
    blobs = []
    for (left, top, right, bottom), score, crop, part in zip(
        boxes.tolist(), scores.tolist(), pixels, share.tolist(), strict=True
    ):
        blobs.append(
            Blob(
                box_xyxy=(left, top, right, bottom),
                area_px=part * (right - left) * (bottom - top),
                centroid=((left + right) / 2, (top + bottom) / 2),
                patch=Patch(width=PATCH_WIDTH, height=PATCH_HEIGHT, bgr=crop.tobytes()),
                score=score,
            )
        )
    return blobs
