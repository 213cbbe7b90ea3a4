"""A sighting of the person pointed at as a blobs message."""

from __future__ import annotations

from heel.schemas import Blob, Blobs, FrameId
from heel.schemas.base import BoxXyxy
from heel.services.detector.background_detector import camera_motion
from heel.services.detector.camera_motion import MotionEstimate
from heel.services.detector.geometry import WorkSize
from heel.services.detector.interface import Frame
from heel.services.detector.neural.between import Seen
from heel.services.detector.neural.packing import person_blobs
from heel.services.detector.pointed.person import Sighting

NAME = "pointed"
_BEST_SCORE, _UNPROVEN_SCORE, _DOUBTED_SCORE = 0.95, 0.6, 0.5
"""Chosen by hand."""


def people_message(
    frame: Frame, size: WorkSize, sighting: Sighting | None, motion: MotionEstimate, sought: int
) -> Blobs:
    """Blobs of kind `people`; the score is how alike they look to themselves before.

    It goes no higher than such boxes are trusted. How often boxes of which score are on people,
    benchmarks/empty_clicks.py prints.
    """
    blobs: tuple[Blob, ...] = ()
    if sighting is not None:
        most = _BEST_SCORE if sighting.proven else _UNPROVEN_SCORE
        score = _DOUBTED_SCORE if sighting.doubted else min(most, sighting.likeness)
        (blob,) = person_blobs([Seen(_frame_box(sighting.box_xyxy, size), score)], frame.image)
        blobs = (blob.model_copy(update={"proven": sighting.proven}),)
    return Blobs(
        **frame.id.model_dump(include=set(FrameId.model_fields)),
        width=size.frame_width,
        height=size.frame_height,
        source_width=frame.source_size[0],
        source_height=frame.source_size[1],
        blobs=blobs,
        kind="people",
        sought=sought,
        camera_motion=camera_motion(motion, size),
        detector=NAME,
    )


def _frame_box(box: BoxXyxy, size: WorkSize) -> BoxXyxy:
    """A box of working pixels in frame pixels."""
    left, top, right, bottom = box
    return (
        left * size.scale_x, top * size.scale_y, right * size.scale_x, bottom * size.scale_y,
    )  # fmt: skip
