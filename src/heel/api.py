"""Tracking and following from Python: the cores of `heel run` in your own process.

No processes are started, no bus is joined, and no settings file or environment variable is read:
what is not given as an argument has its default; a network that `heel models get` has brought is
used where none is given. The names here are those of `heel` itself.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from numbers import Real
from pathlib import Path
from types import TracebackType
from typing import Literal, Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ValidationError

from heel.schemas import (
    FollowState,
    HeelError,
    MotionCommand,
    SettingsError,
    SourceError,
    Target,
    TargetRequest,
    Track,
    Tracks,
)
from heel.services.capture.describe import mounting
from heel.services.capture.settings import CaptureSettings
from heel.services.capture.source import FrameSource
from heel.services.capture.sources import open_source
from heel.services.capture.virtual_pan import PAN_PREFIX
from heel.services.detector.settings import DetectorSettings, with_network
from heel.services.follower.settings import FollowerSettings
from heel.services.geometry.depth import Depth
from heel.services.geometry.pixels import fit_to_cap, to_bgr8
from heel.services.pipeline import FollowingPipeline, InProcessPipeline, repeatable_id
from heel.services.tracker.settings import TrackerSettings

__all__ = [
    "DetectorSettings", "Follower", "FollowerSettings", "Frame", "Image", "TargetChoice", "Tracker",
    "TrackerSettings", "Video", "open", "track",
]  # fmt: skip

Image = NDArray[np.uint8]
"""A picture: (height, width, 3) uint8, blue, green, red, as OpenCV has it."""

TargetChoice = Literal["nearest", "imprint", "none"] | int | tuple[float, float]
"""Which person is followed.

- `"nearest"`: the person that appears largest, once one is tracked; kept from then on;
- `"imprint"`: the person that stands before the camera for two seconds;
- `"none"`: no person;
- a number: the person with this id;
- two numbers: the person at this point of the picture, x and y in pixels from its top left corner.
"""


_log = logging.getLogger(__name__)
_Ages = Callable[[], tuple[float, float]]
"""Seconds since a frame was taken, and since the newest one that showed anything new was."""
_S = TypeVar("_S", bound=BaseModel)
_LATEST_S = 9e9
"""Latest time of a picture: messages count nanoseconds in 63 bits. The year 2255, of Unix time."""
_OLDEST_S = 1e6
"""Greatest age of a picture: that of messages, 11.6 days."""


@dataclass(frozen=True, eq=False)
class Frame:
    """One picture, the people in it, and what a robot should do.

    Attributes:
        image: (H, W, 3) uint8 BGR, a copy of your own to draw on.
        index: number of the frame in its source, from 0; frames that cannot be read, or that a
            camera took while the one before was worked on, are left out.
        time_s: of the frame, seconds since the first one; of frames of your own as you gave it.
        tracks: the message with all people, also those that are not confirmed yet.
        command: velocity of the robot: `linear_mps` forward, `angular_radps` to the left; valid for
            `ttl_s` seconds, and zero whenever it is not certain enough who is who.
        state: what the follower does and why, and where the followed person is.
    """

    image: Image
    index: int
    time_s: float
    tracks: Tracks
    command: MotionCommand
    state: FollowState

    @property
    def people(self) -> tuple[Track, ...]:
        """Confirmed people, by id: `id`, `box_xyxy` in pixels of `image`, `identity_confidence`
        (0 to 1: that the id is still on the same person), `state`, `velocity_pxps` and others."""
        return _shown(self.tracks)

    @property
    def target(self) -> Track | None:
        """The person that is followed; None while no person is, or the chosen one is out of
        sight."""
        return next((one for one in self.people if one.id == self.state.target.track_id), None)


class Follower:
    """Tracks the people in pictures that you bring, and follows one of them.

    Usage:

        follower = heel.Follower(target="nearest")
        for time_s, image in pictures:
            frame = follower.update(image, time_s)
            drive(frame.command.linear_mps, frame.command.angular_radps)

    One object is for one camera, and for one thread at a time.
    """

    def __init__(
        self,
        *,
        target: TargetChoice = "nearest",
        model: str | Path | None = None,
        detector: DetectorSettings | None = None,
        tracker: TrackerSettings | None = None,
        follower: FollowerSettings | None = None,
        calibration: str | Path | None = None,
    ) -> None:
        """Start with nobody known.

        Args:
            target: which person to follow; in place of `FollowerSettings.target`. A person or
                point that is not there yet is chosen as soon as it is.
            model: network that finds people: a name of `heel models list`, an ONNX file, or
                "none" to find them by what moves; None for one that `heel models get` has brought.
            detector: settings of the detector; None for the defaults.
            tracker: settings of the tracker.
            follower: settings of the follower.
            calibration: file of `heel calibrate person` that says how the camera is mounted;
                distances are judged by the height of boxes without it.

        Raises:
            SettingsError: the model or a file cannot be used, or settings contradict each other.
        """
        _request(target)
        mode = target if isinstance(target, str) else "none"
        started = _changed(_settings(FollowerSettings, follower), target=mode)
        camera = CaptureSettings(calibration=None if calibration is None else Path(calibration))
        self._pipeline = FollowingPipeline(
            _with_model(detector, model), _settings(TrackerSettings, tracker), started,
            mounting(camera),
        )  # fmt: skip
        self._wanted = None if isinstance(target, str) else target
        self._clock = _Frames()

    def update(self, image: Image, time_s: float, age_s: float = 0.0) -> Frame:
        """Take in one picture.

        Args:
            image: (H, W, 3) uint8 BGR; grey and BGRA pictures are converted. It is not changed.
            time_s: when it was taken, seconds of any clock that does not go back; at least 0.
            age_s: how long ago that is; the robot stands while pictures are older than
                `FollowerSettings.max_tracks_age_s`. 0 for recordings.

        Raises:
            HeelError: not a picture, a time that goes back, or no age.
        """
        if not _within(age_s, 0.0, _OLDEST_S):
            raise HeelError(
                f"age {_text(age_s)} of a picture: give seconds, from 0 to {_OLDEST_S:g}"
            )
        seq, own = self._clock.taken_in(image, time_s)
        height, width = own.shape[:2]
        return self._step(own, seq, seq, time_s, (width, height), lambda: (age_s, age_s))

    def choose(self, target: TargetChoice) -> Target:
        """Choose the person to follow from now on.

        Raises:
            HeelError: no person has this id now, the point is outside the picture, or two people
                are at it.
        """
        self._wanted = None
        return self._pipeline.choose(_request(target))

    def _step(
        self, image: Image, seq: int, index: int, time_s: float, source_size: tuple[int, int],
        ages: _Ages, depth_mm: Depth | None = None,
    ) -> Frame:  # fmt: skip
        """One frame through the cores. `ages` is asked once its people are known."""
        frame_id = repeatable_id(seq, index, time_s)
        image = fit_to_cap(image)
        blobs, tracks = self._pipeline.perceive(frame_id, image, source_size, depth_mm)
        elapsed_s, age_s = ages()
        now_s = frame_id.t_capture_ns * 1e-9 + elapsed_s
        result = self._pipeline.act(blobs, tracks, now_s, age_s)
        if self._wanted is not None:
            self._choose_wanted(tracks)
        return Frame(image.copy(), index, time_s, tracks, result.command, result.state)

    def _choose_wanted(self, tracks: Tracks) -> None:
        """Choose what was asked for at the start as soon as it can be."""
        wanted = self._wanted
        if isinstance(wanted, int) and not any(one.id == wanted for one in _shown(tracks)):
            return
        self._wanted = None
        assert wanted is not None
        self._pipeline.choose(_request(wanted))


class Tracker:
    """Tracks the people in pictures that you bring, without following one.

    Usage:

        tracker = heel.Tracker(model="yolox_nano.onnx")
        for time_s, image in pictures:
            for person in tracker.update(image, time_s):
                print(person.id, person.box_xyxy)

    One object is for one camera, and for one thread at a time.
    """

    def __init__(
        self,
        *,
        model: str | Path | None = None,
        detector: DetectorSettings | None = None,
        tracker: TrackerSettings | None = None,
    ) -> None:
        """Start with nobody known.

        Args:
            model: network that finds people: a name of `heel models list`, an ONNX file, or
                "none" to find them by what moves; None for one that `heel models get` has brought.
            detector: settings of the detector; None for the defaults.
            tracker: settings of the tracker.

        Raises:
            SettingsError: the model or a file cannot be used, or settings contradict each other.
        """
        self._pipeline = InProcessPipeline(
            _with_model(detector, model), _settings(TrackerSettings, tracker)
        )
        self._clock = _Frames()

    def update(self, image: Image, time_s: float) -> tuple[Track, ...]:
        """Take in one picture; returns the confirmed people in it, by id.

        Args:
            image: (H, W, 3) uint8 BGR; grey and BGRA pictures are converted. It is not changed.
            time_s: when it was taken, seconds of any clock that does not go back; at least 0.

        Raises:
            HeelError: not a picture, or a time that goes back.
        """
        seq, own = self._clock.taken_in(image, time_s)
        height, width = own.shape[:2]
        frame_id = repeatable_id(seq, seq, time_s)
        return _shown(self._pipeline.step(frame_id, fit_to_cap(own), (width, height))[1])


class Video:
    """The frames of an open source, each with its people; made by `heel.open`.

    An iterator and a context manager: the source is closed at the end of the block, and at the end
    of the recording.

    Attributes:
        name: of the source, for people; without passwords.
        width: of the frames, pixels.
        height: of the frames, pixels.
        fps: nominal frames per second.
        frame_count: frames that a recording announces; None when endless or unknown.
        is_live: True for a camera, of which frames are skipped while one is worked on.
    """

    name: str
    width: int
    height: int
    fps: float
    frame_count: int | None
    is_live: bool

    def __init__(self, source: FrameSource, follower: Follower) -> None:
        self._source, self._follower = source, follower
        follower._pipeline.was_recorded_by(source.camera)
        self._seq = 0
        self._closed = False
        self.name = source.name
        self.width, self.height, self.fps = source.width, source.height, source.fps
        self.frame_count, self.is_live = source.frame_count, source.is_live

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def __iter__(self) -> Self:
        return self

    def __next__(self) -> Frame:
        """The next frame.

        Raises:
            StopIteration: the recording is over, or the source was closed.
            SourceError: a camera gave no picture for five seconds; the next call may succeed.
        """
        frame = None if self._closed else self._source.read()
        if frame is None:
            self.close()
            raise StopIteration
        acquired_ns, new_ns = frame.acquired_ns, frame.new_ns

        def ages() -> tuple[float, float]:
            if acquired_ns is None:
                return 0.0, 0.0
            now_ns = time.monotonic_ns()
            return (now_ns - acquired_ns) * 1e-9, (now_ns - (new_ns or acquired_ns)) * 1e-9

        seq, self._seq = self._seq, self._seq + 1
        source_size = (frame.source_width, frame.source_height)
        return self._follower._step(
            frame.image, seq, frame.index, frame.media_time_s, source_size, ages, frame.depth_mm
        )

    def choose(self, target: TargetChoice) -> Target:
        """Choose the person to follow from the next frame on.

        Raises:
            HeelError: no person has this id now, the point is outside the picture, or two people
                are at it.
        """
        return self._follower.choose(target)

    def close(self) -> None:
        """Release the file or camera; harmless when repeated."""
        self._closed = True
        self._source.close()


def open(
    source: str | Path | int,
    *,
    target: TargetChoice = "nearest",
    model: str | Path | None = None,
    scale: float = 1.0,
    fps: float | None = None,
    detector: DetectorSettings | None = None,
    tracker: TrackerSettings | None = None,
    follower: FollowerSettings | None = None,
    calibration: str | Path | None = None,
) -> Video:
    """Open a video or camera and track the people in it.

    The frames of a recording give exactly what `heel run` writes, however fast they are asked for.

    Usage:

        for frame in heel.open("walk.mp4"):
            print(frame.time_s, [person.id for person in frame.people])

    Args:
        source: a video file, a picture, a folder of pictures, a MOTChallenge sequence, the number
            of a camera or `/dev/videoN`, an `rtsp://` or `http://` address, or a drawn scene such
            as `scene:crossing`.
        target: which person to follow; in place of `FollowerSettings.target`. A person or point
            that is not there yet is chosen as soon as it is.
        model: network that finds people: a name of `heel models list`, an ONNX file, or "none" to
            find them by what moves; None for one that `heel models get` has brought.
        scale: factor for both sides of every frame, in (0, 1].
        fps: rate to use in place of the source's own, in (0, 240].
        detector: settings of the detector; None for the defaults.
        tracker: settings of the tracker.
        follower: settings of the follower.
        calibration: file of `heel calibrate person` that says how the camera is mounted.

    Raises:
        SourceError: the source cannot be read; the message says what to do.
        SettingsError: the model or a file cannot be used, or settings contradict each other.
    """
    spec = str(source)
    if spec.startswith(PAN_PREFIX):
        raise SourceError(
            f"{spec}: a window that turns with the robot needs the robot: use `heel run` for it, "
            "or open the recording itself"
        )
    following = Follower(
        target=target, model=model, detector=detector, tracker=tracker, follower=follower,
        calibration=calibration,
    )  # fmt: skip
    return Video(open_source(spec, scale=scale, fps=fps), following)


def track(
    frames: Iterable[tuple[Image, float]],
    *,
    target: TargetChoice = "nearest",
    model: str | Path | None = None,
    detector: DetectorSettings | None = None,
    tracker: TrackerSettings | None = None,
    follower: FollowerSettings | None = None,
    calibration: str | Path | None = None,
) -> Iterator[Frame]:
    """Track the people in pictures that you bring.

    Usage:

        pictures = ((image, number / 25.0) for number, image in enumerate(images))
        for frame in heel.track(pictures):
            print(frame.time_s, [person.id for person in frame.people])

    Args:
        frames: pictures, (H, W, 3) uint8 BGR, each with its time in seconds, which must not go
            back. They are taken one at a time, when a result is asked for.
        target: as of `open`.
        model: as of `open`.
        detector: settings of the detector; None for the defaults.
        tracker: settings of the tracker.
        follower: settings of the follower.
        calibration: as of `open`.

    Raises:
        SettingsError: the model or a file cannot be used, or settings contradict each other.
        HeelError: while iterating: not a picture, or a time that goes back.
    """
    following = Follower(
        target=target, model=model, detector=detector, tracker=tracker, follower=follower,
        calibration=calibration,
    )  # fmt: skip
    return (following.update(*_pair(frame)) for frame in frames)


class _Frames:
    """Checks and counts the pictures that a caller brings."""

    def __init__(self) -> None:
        self._seq = 0
        self._last_s = 0.0

    def taken_in(self, image: Image, time_s: float) -> tuple[int, Image]:
        """Number of the picture, and a copy of it that its owner cannot draw on.

        Raises:
            HeelError: it is none, or its time is no later than that of the one before.
        """
        if not isinstance(image, np.ndarray):
            raise HeelError(
                f"a picture of type {type(image).__name__}: give an array of (height, width, 3) "
                "uint8 in the order blue, green, red"
            )
        if not _within(time_s, self._last_s, _LATEST_S):
            raise HeelError(
                f"time {_text(time_s)} s of picture {self._seq}, after {self._last_s:g} s: give "
                f"seconds, from 0 to {_LATEST_S:g}, that do not go back"
            )
        own = to_bgr8(image)
        if own is image or own.base is not None:
            own = own.copy()
        seq, self._seq, self._last_s = self._seq, self._seq + 1, time_s
        return seq, own


def _shown(tracks: Tracks) -> tuple[Track, ...]:
    return tuple(sorted((one for one in tracks.tracks if one.shown), key=lambda one: one.id))


def _request(target: TargetChoice) -> TargetRequest:
    """The message that a choice amounts to.

    Raises:
        HeelError: it is none.
    """
    try:
        if isinstance(target, str):
            return TargetRequest.model_validate({"mode": target})
        if isinstance(target, tuple | list):
            x_px, y_px = map(float, target)
            return TargetRequest(mode="point", x_px=x_px, y_px=y_px)
        return TargetRequest(mode="id", track_id=target)
    except (ValidationError, ValueError, TypeError):
        raise HeelError(
            f"target {target!r}: give 'nearest', 'imprint', 'none', the id of a person or a point "
            "(x, y) in pixels"
        ) from None


def _within(value: object, least: float, most: float) -> bool:
    return isinstance(value, Real) and least <= float(value) <= most


def _text(value: object) -> str:
    return f"{float(value):g}" if isinstance(value, Real) else repr(value)


def _pair(frame: object) -> tuple[Image, float]:
    if isinstance(frame, tuple | list) and len(frame) == 2:
        return frame[0], frame[1]
    raise HeelError(
        f"{type(frame).__name__} among the frames: give pairs of a picture and its time in seconds"
    )


def _settings(kind: type[_S], given: _S | None) -> _S:
    """What was given, or the defaults.

    Raises:
        SettingsError: other settings were given, or none at all.
    """
    if given is None:
        return kind()
    if not isinstance(given, kind):
        raise SettingsError(f"settings of type {type(given).__name__}: give a heel.{kind.__name__}")
    return given


def _with_model(given: DetectorSettings | None, model: str | Path | None) -> DetectorSettings:
    """The settings with the network that is given, or else with the one that is there.

    Raises:
        SettingsError: it cannot be used, or the settings do not go with it.
    """
    settings = _settings(DetectorSettings, given)
    if model is not None:
        return _changed(settings, model=model)
    if "model" not in settings.model_fields_set:
        asked = settings.model_dump(exclude_unset=True)
        settings = DetectorSettings.model_validate(with_network(asked))
    if settings.hint is not None:
        _warn_once(settings.hint)
    return settings


@cache
def _warn_once(text: str) -> None:
    _log.warning("%s", text)


def _changed(settings: _S, **values: object) -> _S:
    """Settings with some values replaced, checked like all others."""
    given = settings.model_dump(exclude_unset=True)
    return type(settings).model_validate({**given, **values})
