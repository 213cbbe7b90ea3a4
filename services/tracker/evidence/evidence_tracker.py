"""The people of a scene, measured by the evidence map alone."""

from __future__ import annotations

from heel.schemas import Blobs, Track
from heel.services.geometry.calibration_file import Calibration
from heel.services.tracker.evidence.arrays import Image
from heel.services.tracker.evidence.front_end import EvidenceFrame, EvidenceFrontEnd
from heel.services.tracker.people.carry import CameraStep
from heel.services.tracker.people.tracker import PeopleTracker
from heel.services.tracker.people.tuning import evidence_tuning
from heel.services.tracker.report import tracks_of
from heel.services.tracker.settings import TrackerSettings
from heel.services.tracker.trace import Trace


class EvidenceTracker:
    """`PeopleTracker` on blobs messages with an evidence map."""

    def __init__(
        self, settings: TrackerSettings, image_size: tuple[int, int], next_id: int = 1,
        calibration: Calibration | None = None, trace: Trace | None = None,
    ) -> None:  # fmt: skip
        """Start without people.

        Args:
            settings: of reports and of the use of appearance.
            image_size: (width, height) of the frames, pixels.
            next_id: the first id to give out.
            calibration: how the camera is mounted; None to learn the scene's scale.
            trace: takes what is decided.
        """
        reporting = settings.reporting("foreground")
        self._front = EvidenceFrontEnd(reporting, settings.identify, calibration)
        self._people: PeopleTracker[EvidenceFrame] = PeopleTracker(
            self._front, evidence_tuning(reporting, settings.identify), image_size, next_id, trace
        )
        self._t_s = 0.0

    @property
    def next_id(self) -> int:
        """The id that the next newcomer gets."""
        return self._people.next_id

    @property
    def withheld(self) -> str:
        """Why people are not shown, see `PeopleTracker.withheld`."""
        return self._people.withheld

    def interrupt(self, next_id: int) -> None:
        """As `PeopleTracker.interrupt`."""
        self._people.interrupt(next_id)

    def update(self, blobs: Blobs, evidence: Image | None, dt_s: float) -> list[Track]:
        """Take one frame; all confirmed tracks that are not lost, by id.

        Args:
            blobs: the message.
            evidence: its evidence map, (H, W) uint8, of the same size in all frames.
            dt_s: seconds since the frame before, > 0.
        """
        self._t_s += dt_s
        camera = None if blobs.camera_motion is None else CameraStep.told(blobs.camera_motion)
        return tracks_of(self._people.update(EvidenceFrame(blobs, evidence), self._t_s, camera))

    def settle(self) -> None:
        """Take in the scene's scale of the frame before, unless that is done."""
        self._front.settle()
