"""The tracker: one frame's blobs in, its people out. No transport, no clock, deterministic."""

from __future__ import annotations

import logging
from typing import Any, Literal, get_args

import cv2
import msgpack
import numpy as np

from heel.schemas import Blobs, CameraMotion, Track, Tracks
from heel.schemas.base import MAX_DIMENSION_PX
from heel.services.geometry.calibration_file import Calibration, read_calibration
from heel.services.runtime.state_bytes import StateError, read_state, write_state
from heel.services.tracker.boxes.frame import detected
from heel.services.tracker.boxes.front_end import BoxFrontEnd
from heel.services.tracker.evidence.arrays import Image
from heel.services.tracker.evidence.front_end import EvidenceFrame, EvidenceFrontEnd
from heel.services.tracker.paper.tracker import BlobTracker
from heel.services.tracker.people.carry import CameraStep
from heel.services.tracker.people.front_end import FrontEnd
from heel.services.tracker.people.tracker import PeopleTracker
from heel.services.tracker.people.tuning import ROBOT, reporting_tuning, tuned
from heel.services.tracker.pointed.front_end import PointedFrontEnd
from heel.services.tracker.report import tracks_of
from heel.services.tracker.settings import Input, TrackerSettings
from heel.services.tracker.state import CLASSES, MAX_BYTES, TrackerState
from heel.services.tracker.timing import FrameClock
from heel.services.tracker.trace import Changes, Event, Trace

_log = logging.getLogger(__name__)

Method = PeopleTracker[Any] | BlobTracker
_IDS_APART = 100
"""Ids left out at least after an interruption: in the second or two between a state that was kept
and a crash a camera sees far fewer newcomers; chosen by hand."""
_METHODS: dict[Input, Literal["evidence", "boxes", "pointed-at"]] = {
    "foreground": "evidence", "people": "boxes", "pointed-at": "pointed-at",
}  # fmt: skip
"""What a trace calls the tracker on each kind of input."""


class Tracker:
    """The preset's tracker on regions, the box tracker on people; started over with each scene.

    A pointed-at person is known by the detector, so that the track keeps its id.

    Usage:
        tracker = Tracker(TrackerSettings())
        tracks = tracker.update(blobs)
        tracker.settle()  # once the tracks are on their way
    """

    def __init__(
        self, settings: TrackerSettings, calibration: Calibration | None = None,
        trace: Trace | None = None,
    ) -> None:  # fmt: skip
        """Start without people.

        Args:
            settings: which tracker; its calibration file is for the caller to read.
            calibration: how the camera is mounted; None to learn the scene's scale.
            trace: takes what is decided; the tracks are the same without.
        """
        self.settings = settings
        self._calibration = calibration
        self._scene: tuple[object, ...] | None = None
        self._clock = FrameClock()
        self._trace = trace or Trace()
        self._changes = Changes(self._trace)
        self._first_ns: int | None = None
        self._evidence_size: tuple[int, ...] | None = None
        self._method: Method | None = None
        self._next_id = 1

    @property
    def next_id(self) -> int:
        """The id that the next newcomer gets."""
        return self._next_id if self._method is None else self._method.next_id

    @property
    def withheld(self) -> str:
        """Why people that may be in the newest frame are not shown, in words; "" for none."""
        method = self._method
        return method.withheld if isinstance(method, PeopleTracker) else ""

    def update(self, blobs: Blobs) -> Tracks:
        """Take in one frame.

        A new size, stream, epoch, kind of blobs or pointed-at person forgets all people; ids are
        never used again all the same. A motion that no camera makes between two frames counts as
        none known.

        Raises:
            MessageError: the evidence map does not unpack; nothing has changed then.
            SettingsError: a setting has no meaning for blobs of this kind; likewise.
        """
        evidence = None if blobs.evidence is None else blobs.evidence.array()
        size = self._evidence_size if evidence is None else evidence.shape
        scene = (
            blobs.stream, blobs.epoch, blobs.width, blobs.height, blobs.kind, blobs.sought, size,
        )  # fmt: skip
        if not _is_a_step(blobs):
            blobs = blobs.model_copy(update={"camera_motion": None})
        if scene != self._scene:
            self.settings.check(_input(blobs))
        self._begin(blobs)
        method = self._method
        if method is None or scene != self._scene:
            self._scene, self._evidence_size = scene, size
            self._clock = FrameClock()
            self._changes.forget()
            next_id = self._next_id if method is None else method.next_id
            method = self._method = self._started(
                _input(blobs), (blobs.width, blobs.height), next_id
            )
            self._note_input(blobs, method)
        dt_s = self._clock.elapsed_s(blobs.t_capture_ns)
        if isinstance(method, PeopleTracker):
            tracks = self._people(method, blobs, evidence)
        else:
            tracks = method.update(blobs, dt_s)
        self._changes.observe(tracks)
        return _message(blobs, tracks)

    def _people(
        self, method: PeopleTracker[Any], blobs: Blobs, evidence: Image | None
    ) -> list[Track]:
        camera = None if blobs.camera_motion is None else CameraStep.told(blobs.camera_motion)
        frame: Any
        match _input(blobs):
            case "people":
                frame = detected(blobs, self.settings.identify)
            case "pointed-at":
                frame = blobs
            case "foreground":
                frame = EvidenceFrame(blobs, evidence)
        return tracks_of(method.update(frame, self._clock.t_s, camera))

    def _begin(self, blobs: Blobs) -> None:
        if self._first_ns is None:
            self._first_ns = blobs.t_capture_ns
        self._trace.begin(blobs.index + 1, (blobs.t_capture_ns - self._first_ns) * 1e-9)

    def _note_input(self, blobs: Blobs, method: Method) -> None:
        name = "paper" if isinstance(method, BlobTracker) else _METHODS[_input(blobs)]
        self._trace.note(Event("input", input=_input(blobs), method=name))

    def settle(self) -> None:
        """Do now what the next `update` would do first; the result is the same either way.

        Called after the tracks are sent, it spares the frame the fit of the scene's scale, and
        works while the next frame is captured and detected.
        """
        if isinstance(self._method, PeopleTracker):
            self._method.settle()

    def snapshot(self) -> bytes | None:
        """All that the next frame's tracks depend on, for `restore`; None before the first frame.

        The published method (preset paper) has no snapshot: it is run as printed.
        """
        self.settle()
        method = self._method
        if method is None or isinstance(method, BlobTracker) or self._scene is None:
            return None
        state = TrackerState(
            self._scene, self._evidence_size, self._first_ns, self._clock, self._changes, method
        )
        whole: bytes = msgpack.packb(
            {"input": self._kind, "size": self._size,
             "state": write_state(state, CLASSES, self._fingerprint())}
        )  # fmt: skip
        return whole

    def restore(self, snapshot: bytes) -> None:
        """Go on from a snapshot of a tracker with the same settings.

        The tracks of all further frames are those that it would have given, byte for byte.

        Raises:
            StateError: it is no snapshot, or one of other settings or of another version; nothing
                has changed then.
        """
        kind, size, packed = _opened(snapshot)
        changes = Changes(self._trace)
        fresh = self._started(kind, size, 1)
        if isinstance(fresh, BlobTracker):
            raise StateError("state of the tracker: preset paper has none: leave out --standby")
        begun = TrackerState(None, None, None, FrameClock(), changes, fresh)
        state = read_state(packed, begun, CLASSES, self._fingerprint(), MAX_BYTES)
        self._kind, self._size = kind, size
        self._scene, self._evidence_size = state.scene, state.evidence_size
        self._first_ns, self._clock, self._changes = state.first_ns, state.clock, state.changes
        self._method = state.method

    def interrupt(self) -> None:
        """Time has passed that no frame tells of: everybody has to be re-identified.

        Nor is it known which ids were given out meanwhile: the next ones are from far above.
        """
        method = self._method
        if method is None or isinstance(method, BlobTracker):
            return
        fresh_id = (method.next_id // _IDS_APART + 2) * _IDS_APART + 1
        method.interrupt(fresh_id)

    def _fingerprint(self) -> str:
        """What tells the settings that people rest on from others."""
        fields = {name: getattr(self.settings, name) for name in TrackerSettings.model_fields}
        return repr([*sorted(fields.items()), self._calibration])

    def _started(self, kind: Input, size: tuple[int, int], next_id: int) -> Method:
        self._kind, self._size = kind, size
        settings = self.settings
        if kind == "foreground" and settings.preset == "paper":
            return BlobTracker(next_id, self._trace)
        reporting = settings.reporting(kind)
        tuning = reporting_tuning(reporting, settings.identify)
        front: FrontEnd[Any]
        match kind:
            case "people":
                tuning = tuned(ROBOT, settings)
                front = BoxFrontEnd(tuning, size)
            case "pointed-at":
                if self._calibration is not None:
                    _log.warning("tracker.calibration has no part in tracking a person pointed at")
                front = PointedFrontEnd(reporting, size[1], settings.identify)
            case "foreground":
                front = EvidenceFrontEnd(reporting, settings.identify, self._calibration)
        return PeopleTracker(front, tuning, size, next_id, self._trace)


def _opened(snapshot: bytes) -> tuple[Input, tuple[int, int], bytes]:
    """What kind of messages a snapshot is of, their size in pixels, and the state."""
    try:
        unpacked = msgpack.unpackb(snapshot, max_bin_len=MAX_BYTES, max_map_len=8, max_array_len=8)
        kind, (width, height), packed = (unpacked[name] for name in ("input", "size", "state"))
        if kind not in get_args(Input) or not isinstance(packed, bytes):
            raise ValueError
        if not (0 < int(width) <= MAX_DIMENSION_PX and 0 < int(height) <= MAX_DIMENSION_PX):
            raise ValueError
    except Exception:
        # msgpack has no common error for bad input, see `heel.schemas.codec`.
        raise StateError("that is no snapshot of a tracker") from None
    return kind, (int(width), int(height)), packed


def configured(settings: TrackerSettings, trace: Trace | None = None) -> Tracker:
    """A tracker whose calibration file, if there is one, has been read.

    Raises:
        SettingsError: the file cannot be read.
    """
    file = settings.calibration
    return Tracker(settings, None if file is None else read_calibration(file), trace)


def _input(blobs: Blobs) -> Input:
    if blobs.sought is not None:
        return "pointed-at"
    return "people" if blobs.kind == "people" else "foreground"


_MOST_ZOOM = 2.0
"""Factor on sizes between two frames: that of a person walking at 2 m/s towards a camera 1 m away,
in frames 0.25 s apart."""


def _is_a_step(blobs: Blobs) -> bool:
    """Whether a camera can have moved like that between two frames; a picture aside at most."""
    if blobs.camera_motion is None:
        return True
    affine = np.array(blobs.camera_motion.affine).reshape(2, 3)
    size = np.array([blobs.width, blobs.height], np.float64)
    zoom = np.linalg.svd(affine[:, :2], compute_uv=False)
    shift = np.abs(affine[:, :2] @ (0.5 * size) + affine[:, 2] - 0.5 * size)
    return bool(zoom.min() >= 1 / _MOST_ZOOM and zoom.max() <= _MOST_ZOOM and (shift <= size).all())


_STOOD_STILL = CameraMotion(affine=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0), quality=1.0)
"""The identity, pixels to pixels, with full quality: no motion, and sure of it."""


def _camera_motion(blobs: Blobs) -> CameraMotion | None:
    """What a message says of the camera: a background that holds has been seen to stand still."""
    if blobs.camera_motion is None and blobs.kind == "regions" and blobs.background == "valid":
        return _STOOD_STILL
    return blobs.camera_motion


def _message(blobs: Blobs, tracks: list[Track]) -> Tracks:
    return Tracks(
        **blobs.frame_id().model_dump(),
        width=blobs.width,
        height=blobs.height,
        source_width=blobs.source_width,
        source_height=blobs.source_height,
        tracks=tuple(tracks),
        occlusion=any(track.state == "occluded" for track in tracks),
        camera_motion=_camera_motion(blobs),
    )


def warm_up() -> None:
    """Pay once, before the first frame, for what OpenCV sets up at the first call.

    Its Lab tables and template matching take long in the first frame, which a live stream pays
    with dropped frames.
    """
    pixels = np.zeros((16, 16, 3), np.uint8)
    cv2.cvtColor(pixels, cv2.COLOR_BGR2LAB)
    area = np.zeros((64, 64), np.float32)
    cv2.matchTemplate(area, area[:32, :16], cv2.TM_CCORR)
