"""A world seen by the robot's camera."""

from __future__ import annotations

import math
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from heel.services.simulator.depth_sensor import DepthSensor
from heel.services.simulator.render.clothes import weaves_of
from heel.services.simulator.render.depth_view import DepthView
from heel.services.simulator.render.effects import CameraEffects, CameraFilter
from heel.services.simulator.render.figure import Figure
from heel.services.simulator.render.offscreen import OffscreenCamera
from heel.services.simulator.render.props import mirror_images
from heel.services.simulator.render.stage import Stage
from heel.services.simulator.state import CameraMount, Outfit, PersonState, Scenery, WorldView


class Renderer:
    """Draws one scenery and the people in it. Use as a context manager.

    Equal worlds give equal pixels, apart from the automatic exposure, which depends on the frames
    drawn before.

    Args:
        scenery: what does not move.
        mount: the camera.
        effects: what the camera adds; None for those of an ordinary one.
        seed: of textures, pictures on walls and noise, and of what depth errs.
        supersampling: pixels drawn per pixel and axis.

    Raises:
        HeelError: the software renderer does not start.
    """

    def __init__(
        self, scenery: Scenery, mount: CameraMount, effects: CameraEffects | None = None,
        seed: int = 0, supersampling: float = 1.5,
    ) -> None:  # fmt: skip
        self._mount = mount
        self._camera = OffscreenCamera(mount, supersampling)
        self._stage = Stage(scenery, seed)
        self._stage.root.reparent_to(self._camera.root)
        for light in self._stage.lights:
            self._camera.root.set_light(light)
        self._figures: dict[int, tuple[Outfit, Figure]] = {}
        focal_px = mount.width_px / (2 * math.tan(mount.horizontal_fov_rad / 2))
        size = mount.height_px, mount.width_px
        self._filter = CameraFilter(effects or CameraEffects(), size, focal_px, seed)
        self._depth_view: DepthView | None = None
        self._depth_sensor = DepthSensor(mount, seed)

    def draw(self, world: WorldView) -> NDArray[np.uint8]:
        """The camera's picture, (H, W, 3) uint8 BGR."""
        picture = self.draw_clean(world)
        turn_radps = world.robot.angular_radps
        return self._filter.apply(picture, world.t_s, world.brightness, turn_radps)

    def measure(self, world: WorldView) -> NDArray[np.uint16]:
        """What a depth camera tells, (H / 2, W / 2) uint16 mm, 0 for no measurement.

        Of mirrors and panes of glass it sees what the picture shows in them.
        """
        return self._depth_sensor.measure(self.true_depth(world), world.t_s)

    def true_depth(self, world: WorldView) -> NDArray[np.float32]:
        """The same without errors, in metres along the optical axis; 0 beyond 12 m."""
        if self._depth_view is None:
            self._depth_view = DepthView(self._camera)
        self._arrange(world)
        return self._depth_view.draw()

    def draw_clean(self, world: WorldView) -> NDArray[np.uint8]:
        """The same in normal light by a perfect camera."""
        self._arrange(world)
        return self._camera.draw()

    def _arrange(self, world: WorldView) -> None:
        """Put camera and people where they are."""
        robot, mount = world.robot, self._mount
        eye = robot.x_m, robot.y_m, mount.height_m
        self._camera.place(eye, robot.heading_rad, mount.pitch_rad)
        self._stage.centre_far_view(*eye)
        images = mirror_images(world.people, world.scenery.obstacles, eye[:2])
        self._cast((*world.people, *images))

    def _cast(self, people: tuple[PersonState, ...]) -> None:
        """Pose all people; bodies come and go with their people."""
        present = {person.id for person in people}
        for gone in self._figures.keys() - present:
            self._figures.pop(gone)[1].root.remove_node()
        weaves = weaves_of([person.outfit for person in people])
        for person, weave in zip(people, weaves, strict=True):
            worn, figure = self._figures.get(person.id, (None, None))
            if figure is None or worn != person.outfit:
                if figure is not None:
                    figure.root.remove_node()
                figure = Figure(person, weave)
                figure.root.reparent_to(self._camera.root, person.id)
                self._figures[person.id] = person.outfit, figure
            figure.pose(person)

    def close(self) -> None:
        """Give the memory back."""
        self._figures.clear()
        if self._depth_view is not None:
            self._depth_view.close()
        self._stage.root.remove_node()
        self._camera.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:  # fmt: skip
        self.close()
