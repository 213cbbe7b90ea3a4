"""From the world to tracks, with the simulator's own boxes in place of pixels and detector."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from heel.schemas import CameraInfo, FrameId, Pointed, Tracks
from heel.services.simulator.boxes import SimulatedDetector
from heel.services.simulator.state import CameraMount
from heel.services.simulator.world import World
from heel.services.tracker.core import configured
from heel.services.tracker.settings import TrackerSettings

STREAM = "front"


@dataclass(frozen=True, slots=True)
class Senses:
    """What the robot has besides a camera.

    Attributes:
        ranges: a ring of range sensors.
        calibrated: mounting height and pitch of the camera are known.
        depth: the camera measures depth, too. Without a ring, free distances are those of the depth
            picture, if the mounting is known.
    """

    ranges: bool = True
    calibrated: bool = True
    depth: bool = False

    def __str__(self) -> str:
        return (
            f"{'with' if self.ranges else 'without'} ranges, "
            f"{'calibrated' if self.calibrated else 'not calibrated'}"
            f"{', with depth' if self.depth else ''}"
        )


EVERYTHING = Senses()


class Perception(Protocol):
    """What stands between the world and the follower."""

    def see(self, frame: FrameId) -> Tracks:
        """The people in the picture that the camera takes of the world now."""

    def point(self, pointed: Pointed) -> None:
        """A user points at a person who is not tracked."""


class SimulatedBoxes:
    """The simulator's own boxes, with a detector's errors, and the tracker core."""

    def __init__(self, world: World, mount: CameraMount, tracker: TrackerSettings) -> None:
        self._world = world
        self._detector = SimulatedDetector(mount, world.seed)
        self._tracker = configured(tracker)

    def see(self, frame: FrameId) -> Tracks:
        """Boxes to tracks."""
        return self._tracker.update(self._detector.detect(self._world, frame))

    def point(self, pointed: Pointed) -> None:
        """Simulated boxes do not depend on it."""


def camera_info(mount: CameraMount, calibrated: bool = True) -> CameraInfo:
    """What the simulated camera says of itself."""
    return CameraInfo(
        stream=STREAM,
        epoch=1,
        width=mount.width_px,
        height=mount.height_px,
        source_width=mount.width_px,
        source_height=mount.height_px,
        fps=mount.fps,
        source="simulated world",
        horizontal_fov_rad=mount.horizontal_fov_rad,
        mount_height_m=mount.height_m if calibrated else None,
        mount_pitch_rad=mount.pitch_rad if calibrated else None,
    )
