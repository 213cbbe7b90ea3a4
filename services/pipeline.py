"""The cores called one after the other in one process: what the separate processes must equal.

The closed loops and the in-process run are built on it; no service knows it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from heel.schemas import (
    Blobs,
    CameraInfo,
    FollowState,
    FrameId,
    MotionCommand,
    Pointed,
    Target,
    TargetRequest,
    Tracks,
)
from heel.services.capture.describe import Mounting, completed, mounting
from heel.services.capture.scene_source import open_scene
from heel.services.capture.settings import CaptureSettings
from heel.services.capture.sources import open_source
from heel.services.detector.core import Detector
from heel.services.detector.settings import DetectorServiceSettings, DetectorSettings
from heel.services.follower.core import Follower
from heel.services.follower.settings import FollowerServiceSettings, FollowerSettings
from heel.services.geometry.camera import camera_from_info
from heel.services.geometry.depth import Depth
from heel.services.geometry.pixels import fit_to_cap
from heel.services.networks.names import HeadName
from heel.services.runtime.settings import Loaded, load_settings
from heel.services.tracker.core import configured
from heel.services.tracker.depth_places import with_depth
from heel.services.tracker.settings import TrackerServiceSettings, TrackerSettings
from heel.services.tracker.trace import Trace

REPEATABLE_EPOCH = 1
"""Epoch of lossless runs of recordings, so that their messages are the same bytes every time."""
_LEAST_VISIBLE = 0.25
"""Share of a drawn person that is to be seen, below which ground truth is not scored; chosen by
hand, as people who draw boxes leave out what they can only guess."""
_TRACKER = "tracker/main@00000000"


class InProcessPipeline:
    """Detector and tracker with the fixed feedback lag of a lossless run.

    Args:
        detector, tracker: their settings.
        trace: told what the tracker decides.
        camera: how it is mounted; distances by depth need its field of view.
    """

    def __init__(
        self, detector: DetectorSettings, tracker: TrackerSettings, trace: Trace | None = None,
        camera: Mounting | None = None,
    ) -> None:  # fmt: skip
        self._detector = Detector(detector)
        self._tracker = configured(tracker, trace)
        self.camera = camera
        self._recent: deque[Tracks] = deque(maxlen=detector.feedback_lag_frames)

    def step(
        self, frame: FrameId, image: NDArray[np.uint8], source_size: tuple[int, int],
        pointed: Pointed | None = None, depth_mm: Depth | None = None,
    ) -> tuple[Blobs, Tracks]:  # fmt: skip
        """Process one frame: `detect`, then `track`.

        Args:
            frame: which frame this is; seq goes up by one within an epoch.
            image: (H, W, 3) uint8 BGR.
            source_size: width and height before capture scaled the frame, pixels.
            pointed: where a user pointed at somebody who is not tracked, since the frame before.
            depth_mm: (h, w) uint16 of what the image shows, 0 where nothing was measured.
        """
        blobs = self.detect(frame, image, source_size, pointed)
        return blobs, self.track(blobs, depth_mm)

    def detect(
        self, frame: FrameId, image: NDArray[np.uint8], source_size: tuple[int, int],
        pointed: Pointed | None = None,
    ) -> Blobs:  # fmt: skip
        """Blobs of a frame, protected with the tracks of exactly `lag` frames before."""
        lag = self._detector.settings.feedback_lag_frames
        wanted = (frame.epoch, frame.seq - lag)
        feedback = next((old for old in self._recent if (old.epoch, old.seq) == wanted), None)
        return self._detector.detect(frame, image, source_size, feedback, pointed)

    def track(self, blobs: Blobs, depth_mm: Depth | None = None) -> Tracks:
        """Tracks of the frame just detected, with distances where its depth tells them."""
        tracks = self._tracker.update(blobs)
        if depth_mm is not None and self.camera is not None:
            camera = camera_from_info(_camera_info(tracks, self.camera))
            if camera is not None:
                tracks = with_depth(tracks, depth_mm, camera)
        self._recent.append(tracks)
        return tracks

    def settle(self) -> None:
        """What the tracker does once a frame's tracks are sent, otherwise done by `track`."""
        self._tracker.settle()


@dataclass(frozen=True)
class PipelineResult:
    """What one frame led to."""

    blobs: Blobs
    tracks: Tracks
    command: MotionCommand
    state: FollowState
    target_id: int | None


class FollowingPipeline:
    """Detector, tracker and follower; in a recording the stream is their clock."""

    def __init__(
        self, detector: DetectorSettings, tracker: TrackerSettings, follower: FollowerSettings,
        camera: Mounting, trace: Trace | None = None,
    ) -> None:  # fmt: skip
        self._perception = InProcessPipeline(detector, tracker, trace, camera)
        self._follower = Follower(follower)
        self._camera: Mounting | None = camera
        self._pointed: Pointed | None = None

    def was_recorded_by(self, camera: CameraInfo | None) -> None:
        """Before the first frame: what the source says of its camera, for what is not known."""
        if self._camera is not None:
            self._camera = self._perception.camera = completed(self._camera, camera)

    def step(
        self, frame: FrameId, image: NDArray[np.uint8], source_size: tuple[int, int],
        depth_mm: Depth | None = None,
    ) -> PipelineResult:  # fmt: skip
        """Process one frame of a recording; arguments as `InProcessPipeline.step`."""
        blobs, tracks = self.perceive(frame, image, source_size, depth_mm)
        return self.act(blobs, tracks, frame.t_capture_ns * 1e-9, 0.0)

    def perceive(
        self, frame: FrameId, image: NDArray[np.uint8], source_size: tuple[int, int],
        depth_mm: Depth | None = None,
    ) -> tuple[Blobs, Tracks]:  # fmt: skip
        """The first half of `step`: blobs and tracks of a frame."""
        pointed, self._pointed = self._pointed, None
        return self._perception.step(frame, image, source_size, pointed, depth_mm)

    def act(self, blobs: Blobs, tracks: Tracks, now_s: float, age_s: float) -> PipelineResult:
        """The second half of `step`: the command that rests on a frame's tracks.

        Args:
            blobs, tracks: of `perceive`.
            now_s: the present, on the clock of the frames.
            age_s: how old the frame is by now.
        """
        if self._camera is not None:
            self._follower.set_camera(_camera_info(tracks, self._camera))
            self._camera = None
        self._follower.observe(tracks, _TRACKER)
        command = self._follower.step(now_s, age_s)
        state = self._follower.state
        return PipelineResult(blobs, tracks, command, state, self._follower.target.track_id)

    def choose(self, request: TargetRequest) -> Target:
        """Choose or clear the target; a point at which nobody is tracked is told to the detector.

        Raises:
            TargetError: as `Follower.choose`.
        """
        target = self._follower.choose(request)
        self._pointed = self._follower.pointed
        return target


def _camera_info(tracks: Tracks, camera: Mounting) -> CameraInfo:
    """What the capture process would say of its camera, as far as it matters to the follower."""
    return CameraInfo(
        stream=tracks.stream, epoch=tracks.epoch, width=tracks.width, height=tracks.height,
        source_width=tracks.source_width, source_height=tracks.source_height, fps=1.0,
        source="in process",
        horizontal_fov_rad=camera.horizontal_fov_rad(tracks.width, tracks.height),
        mount_height_m=camera.mount_height_m, mount_pitch_rad=camera.mount_pitch_rad,
        lens=camera.lens(tracks.width, tracks.height), mount_yaw_rad=camera.mount_yaw_rad,
    )  # fmt: skip


def load_pipeline(
    preset: str, target: str, file: Path | None, detector_name: str | None = None,
    model: str | Path | None = None, model_class: int | None = None,
    model_head: HeadName | None = None, trace_file: Path | None = None, trace: Trace | None = None,
) -> tuple[FollowingPipeline, dict[str, Any]]:  # fmt: skip
    """The cores with the settings that the processes would read, and those settings to show.

    What the tracker decides goes to `trace`; `trace_file` only overrides the setting, whose file is
    for the caller to write.

    Raises:
        SettingsError: as `load_settings`.
    """
    flags = {"preset": preset, "detector": detector_name, "model": model,
             "model_class": model_class, "model_head": model_head}  # fmt: skip
    detector: Loaded[DetectorServiceSettings] = load_settings(
        "detector", DetectorServiceSettings, {"detector": flags}, file
    )
    tracker: Loaded[TrackerServiceSettings] = load_settings(
        "tracker",
        TrackerServiceSettings,
        {"tracker": {"preset": preset, "trace": trace_file}},
        file,
    )
    if detector.service.sends_people:
        tracker.service.check("people")
    follower: Loaded[FollowerServiceSettings] = load_settings(
        "follower", FollowerServiceSettings, {"follower": {"target": target}}, file
    )
    capture: Loaded[CaptureSettings] = load_settings("capture", CaptureSettings, {}, file)
    shown = detector.shown("detector") | tracker.shown("tracker") | follower.shown("follower")
    pipeline = FollowingPipeline(
        detector.service, tracker.service, follower.service, mounting(capture.service), trace
    )
    return pipeline, shown


def repeatable_id(seq: int, index: int, time_s: float) -> FrameId:
    """Name of a frame, the same in every run.

    Args:
        seq: frames before it that were taken in.
        index: frames before it in the source, also those that were left out.
        time_s: on the source's own clock, from 0.
    """
    return FrameId(
        stream="front", epoch=REPEATABLE_EPOCH, seq=seq, index=index,
        t_capture_ns=round(time_s * 1e9),
    )  # fmt: skip


class RecordedFrames:
    """The frames of a recording as a lossless capture process would send them.

    Attributes:
        depth_mm: of the frame given last, (h, w) uint16; None without.

    Raises:
        SourceError: the source cannot be opened.
    """

    def __init__(self, spec: str, scale: float = 1.0, fps: float | None = None) -> None:
        self.source = open_source(spec, scale=scale, fps=fps)
        self.depth_mm: Depth | None = None

    def __enter__(self) -> RecordedFrames:
        return self

    def __exit__(self, *_: object) -> None:
        self.source.close()

    def __iter__(self) -> Iterator[tuple[FrameId, NDArray[np.uint8], tuple[int, int]]]:
        """Frame id, image and source size of every frame."""
        seq = 0
        while (frame := self.source.read()) is not None:
            self.depth_mm = frame.depth_mm
            frame_id = repeatable_id(seq, frame.index, frame.media_time_s)
            yield frame_id, fit_to_cap(frame.image), (frame.source_width, frame.source_height)
            seq += 1


@dataclass(frozen=True)
class SceneTruth:
    """Ground truth of a drawn scene: MOTChallenge rows, pixels and frames counted from 1."""

    frame_count: int
    rows: tuple[str, ...]


def scene_truth(spec: str) -> SceneTruth:
    """What is really to be seen in a drawn scene; people hardly visible carry flag 0.

    Raises:
        SourceError: the scene is unknown.
    """
    scene = open_scene(spec).scene
    rows = []
    for index in range(scene.frame_count):
        for person in scene.truth(index):
            left, top, right, bottom = person.box_xyxy
            flag = int(person.visible_fraction >= _LEAST_VISIBLE)
            rows.append(
                f"{index + 1},{person.person_id},{left + 1:.2f},{top + 1:.2f},"
                f"{right - left:.2f},{bottom - top:.2f},{flag},-1,-1,-1\n"
            )
    return SceneTruth(scene.frame_count, tuple(rows))
