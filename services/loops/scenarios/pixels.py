"""The simulated camera's pictures: what the detector gets of them, and the film of an episode.

Needs the extra `sim`; nothing else of the scenarios does.
"""

from __future__ import annotations

from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from heel.schemas import FollowState, FrameId, Pointed, Ranges, Tracks
from heel.services.detector.settings import DetectorSettings
from heel.services.drawing import AnnotatedVideo
from heel.services.geometry.camera import GroundCamera, camera_from_info
from heel.services.geometry.depth import Depth, depth_sectors
from heel.services.loops.scenarios.perception import Perception, camera_info
from heel.services.pipeline import InProcessPipeline
from heel.services.simulator.render.renderer import Renderer
from heel.services.simulator.state import CameraMount
from heel.services.simulator.world import World
from heel.services.tracker.depth_places import with_depth
from heel.services.tracker.settings import TrackerSettings


class Camera:
    """Takes pictures of a world; one of each moment, however often it is asked for.

    Raises:
        HeelError: the software renderer does not start.
    """

    def __init__(self, world: World, mount: CameraMount) -> None:
        self._world = world
        self._renderer = Renderer(world.scenery, mount, seed=world.seed)
        self._taken_s: float | None = None
        self._picture: NDArray[np.uint8] = np.zeros((0, 0, 3), np.uint8)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._renderer.close()

    def picture(self) -> NDArray[np.uint8]:
        """The world now, (H, W, 3) uint8 BGR."""
        if self._taken_s != self._world.t_s:
            self._picture = self._renderer.draw(self._world)
            self._taken_s = self._world.t_s
        return self._picture

    def depth_mm(self) -> Depth:
        """What the same camera measures of the world now, (H / 2, W / 2) uint16."""
        return self._renderer.measure(self._world)


class DepthSeen:
    """Any perception, and how far its people are by the camera's depth.

    Args:
        perception: whose tracks they are.
        camera: of the same world.
        mount: of that camera.
        calibrated: whether its mounting is known.
    """

    def __init__(
        self, perception: Perception, camera: Camera, mount: CameraMount, calibrated: bool
    ) -> None:
        self._perception, self._source = perception, camera
        told = camera_from_info(camera_info(mount, calibrated))
        assert told is not None
        self._camera = told
        self._depth_mm: Depth | None = None

    def see(self, frame: FrameId) -> Tracks:
        """Tracks with distances."""
        tracks = self._perception.see(frame)
        self._depth_mm = self._source.depth_mm()
        return with_depth(tracks, self._depth_mm, self._camera)

    def point(self, pointed: Pointed) -> None:
        """As the perception itself."""
        self._perception.point(pointed)

    def ranges(self, seq: int) -> Ranges | None:
        """Free distances by the newest depth picture; None where the mounting is not known."""
        if self._depth_mm is None or not isinstance(self._camera, GroundCamera):
            return None
        return Ranges(seq=seq, sectors=depth_sectors(self._depth_mm, self._camera))


class RenderedPixels:
    """Rendered pictures, the detector core and the tracker core: the full stack."""

    def __init__(
        self, camera: Camera, detector: DetectorSettings, tracker: TrackerSettings
    ) -> None:
        self._camera = camera
        self._pipeline = InProcessPipeline(detector, tracker)
        self._pointed: Pointed | None = None

    def see(self, frame: FrameId) -> Tracks:
        """Pixels to tracks."""
        picture = self._camera.picture()
        height, width = picture.shape[:2]
        pointed, self._pointed = self._pointed, None
        return self._pipeline.step(frame, picture, (width, height), pointed)[1]

    def point(self, pointed: Pointed) -> None:
        """For the detector, with the next picture."""
        self._pointed = pointed


class Film:
    """What the robot sees and does, as an mp4."""

    def __init__(self, camera: Camera, path: Path, fps: float) -> None:
        self._camera = camera
        self._fps = fps
        self._video = AnnotatedVideo(path)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._video.close()

    def add(self, tracks: Tracks, state: FollowState) -> None:
        """Append the picture of now, with its tracks and what the follower does.

        Raises:
            HeelError: the video cannot be written.
        """
        caption = f"{state.state}: {state.reason}"
        picture = self._camera.picture()
        self._video.write(picture, tracks, state.target.track_id, caption, self._fps)
