"""People found by a network: whole frames, closer looks at small people, and pixels in between."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas import Blobs, SettingsError, Tracks
from heel.schemas.blobs import MAX_BLOBS
from heel.services.detector.background.evidence import smoothed
from heel.services.detector.feedback import free_mask
from heel.services.detector.interface import Frame
from heel.services.detector.messages import blobs_message, camera_motion, person_blobs
from heel.services.detector.neural.between import (
    Between,
    SeenPerson,
    confirmed_people,
    newcomers,
)
from heel.services.detector.neural.pointed_place import PointedPlace
from heel.services.detector.neural.views import (
    Attention,
    View,
    Views,
    look,
    nobody,
    together,
    usual_looks,
)
from heel.services.detector.scene import Scene, Scenes, WorkSize
from heel.services.detector.settings import DetectorSettings
from heel.services.geometry.picture_motion import CameraPath, EgoMotion, MotionEstimate
from heel.services.networks.budget import Budget
from heel.services.networks.onnx_file import doubtful
from heel.services.networks.person_model import Detections, PersonModel

_WHOLE_PERIOD_NS = 120_000_000
"""Time between whole frames that the larger of two networks sees: who has come in is known so much
later, and pixels bridge less than `bridge_s`. By capture times, so that a recording decides it."""
_log = logging.getLogger("heel.detector")
Clock = Callable[[], float]
"""Seconds, of any origin."""


@dataclass(slots=True, eq=False)
class _People:
    """What is known of the people and the camera of one scene."""

    views: Views
    near_whole: View
    attention: Attention
    between: Between
    ego: EgoMotion
    path: CameraPath
    place: PointedPlace
    whole_ns: int = -_WHOLE_PERIOD_NS
    """When the network last saw a whole frame, of the near network's looks apart."""


class NeuralDetector:
    """One box a person, with a score, and how the camera has moved."""

    def __init__(self, settings: DetectorSettings, clock: Clock | None = None) -> None:
        """Load the network.

        Args:
            settings: which, and all numbers.
            clock: times the network; without it `model_budget_ms` is no bound, so that what is
                found depends on the pictures alone.

        Raises:
            SettingsError: there is none, or it cannot be used.
        """
        if settings.model is None:
            raise SettingsError(
                "detector onnx needs a network: `heel models get yolox-nano`, or --model FILE"
            )
        self._settings = settings
        self._model = self._loaded(
            settings.model, person_class=settings.model_class, head=settings.model_head
        )
        self._near = self._model
        if settings.model_near is not None:
            self._near = self._loaded(settings.model_near)
        self._clock = clock
        self._budget = Budget(settings.model_budget_ms if clock is not None else 0.0)
        self._scenes = Scenes(settings.work_width_px, self._begin)

    def detect(self, frame: Frame) -> Blobs:
        """Find the people of one frame."""
        scene = self._scenes.of(frame.scene)
        people = scene.state
        feedback = scene.key.matching(frame.feedback)
        motion = self._ego_motion(scene, frame, feedback)
        sent = camera_motion(motion, scene.size)
        step = np.eye(2, 3) if sent is None else np.array(sent.affine).reshape(2, 3)
        people.path.add(frame.id.seq, step)
        known = confirmed_people(feedback, frame.id, people.path)
        expected = [*known, *newcomers(people.between.people, known, step)]
        expected += people.place.expected(frame, people.path, expected)
        found = self._look(frame, people, people.attention.next_views(expected))
        seen = [
            SeenPerson((left, top, right, bottom), min(1.0, score))
            for (left, top, right, bottom), score in zip(
                found.boxes.tolist(), found.scores.tolist(), strict=True
            )
        ]
        grey = np.asarray(cv2.cvtColor(frame.image, cv2.COLOR_BGR2GRAY), np.uint8)
        where = [person.box_xyxy for person in known]
        kept = people.between.update(grey, frame.id.t_capture_ns, seen, where, step)
        found_and_kept = [(one.box_xyxy, one.score) for one in (*seen, *kept)]
        blobs = person_blobs(found_and_kept[:MAX_BLOBS], frame.image)
        return blobs_message(
            frame, scene.size, "onnx", blobs, motion,
            kind="people", blobs_left_out=len(found_and_kept) - len(blobs),
        )  # fmt: skip

    def _begin(self, size: WorkSize) -> _People:
        frame_size = (size.frame_width, size.frame_height)
        views = Views(frame_size, self._input(self._model))
        near = Views(frame_size, self._input(self._near), near=True)
        two = self._near is not self._model
        chosen = self._settings.model_closer_looks
        most = usual_looks(self._input(self._near), two) if chosen is None else chosen
        if two:
            far = min(most, usual_looks(self._input(self._model)))
            attention = Attention(views, far, (near, most))
        else:
            attention = Attention(views, most)
        between = Between(self._settings.bridge_s)
        return _People(
            views, near.whole, attention, between, EgoMotion(), CameraPath(), PointedPlace()
        )

    @staticmethod
    def _input(model: PersonModel) -> tuple[int, int]:
        return model.width, model.height

    def _ego_motion(
        self, scene: Scene[_People], frame: Frame, feedback: Tracks | None
    ) -> MotionEstimate:
        small = smoothed(scene.size.shrink(frame.image), self._settings.blur_px)
        grey = np.asarray(cv2.cvtColor(small, cv2.COLOR_BGR2GRAY), np.uint8)
        return scene.state.ego.update(grey, free_mask(feedback, frame.id, scene.size))

    def _look(self, frame: Frame, people: _People, parts: Sequence[View]) -> Detections:
        two = self._near is not self._model
        due = not two or frame.id.t_capture_ns - people.whole_ns >= _WHOLE_PERIOD_NS
        looks = self._budget.choose(len(parts) + two, due)
        if two and not looks.whole:
            # Of the whole frame the near network shows at least those that are large.
            parts = [people.near_whole, *parts]
        found, whole_ms = nobody(), None
        if looks.whole:
            people.whole_ns = frame.id.t_capture_ns
            found, whole_ms = self._timed(self._model, frame.image, people.views.whole)
        parts_ms = []
        for part in parts[: looks.parts]:
            model = self._near if part.near else self._model
            close, part_ms = self._timed(model, frame.image, part)
            if part.reaches_beyond:  # the frame itself is the closer look
                found = together(close, found, people.views.whole)
            else:
                found = together(found, close, part)
            parts_ms.append(part_ms)
        self._budget.spent(whole_ms, parts_ms)
        return found

    def _timed(
        self, model: PersonModel, image: NDArray[np.uint8], part: View
    ) -> tuple[Detections, float]:
        started_s = self._clock() if self._clock is not None else 0.0
        found = look(model, image, self._settings.model_score, part)
        if self._clock is None:
            return found, 0.0
        return found, 1e3 * (self._clock() - started_s)

    def _loaded(self, file: Path, **told: Any) -> PersonModel:
        settings = self._settings
        model = PersonModel(
            Path(file), engine=settings.model_engine, providers=settings.model_providers,
            threads=settings.model_threads, **told,
        )  # fmt: skip
        _log.info("network %s: %s", file, model.description)
        if (doubt := doubtful(Path(file))) is not None:
            _log.warning("network %s: %s", file, doubt)
        return model
