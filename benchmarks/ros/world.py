"""A robot of ROS 2 in the simulated world: sends its camera, ranges and odometry, drives by Twist.

A process of its own, in an environment that has ROS. It tells the truth of every picture and every
velocity that it hears on standard output; nobody but the benchmark reads that.
"""

from __future__ import annotations

import array
import math
import sys
import time
from contextlib import ExitStack
from typing import Annotated, Any

import typer

from benchmarks.ros.robots import Robot, dds_robot, zenoh_robot
from heel.schemas import HeelError
from heel.services.runtime.command_line import run_app
from heel.services.runtime.pacing import Pacer
from heel.services.simulator.render.renderer import Renderer
from heel.services.simulator.scenarios import scenario
from heel.services.simulator.settings import SimulatorSettings
from heel.services.simulator.wheels import TIMEOUT_S
from heel.services.simulator.world import World

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
CAMERA = SimulatorSettings(width_px=320, height_px=240, fps=15.0)
"""Of the robot: a quarter of the simulator's usual pixels, as renderer, ROS and all of Heel share
the cores of one computer; chosen by hand, for two."""
_STEPS_A_FRAME = 4
"""The world moves so often for a picture: at least at the drive's 50 Hz."""
_STEPS_A_TRUTH = 2
"""The truth is told at 30 Hz: three times in a step of the scores (0.1 s), into which 15 pictures a
second do not fit."""
_FIRST_S = 30.0
"""Longest wait for the first velocity [s], before which nothing moves."""


class Body:
    """The robot: a world, a camera in it, and ROS."""

    def __init__(self, world: World, renderer: Renderer, ros: Robot) -> None:
        self._world, self._renderer, self._ros = world, renderer, ros
        self._mount = CAMERA.mount()
        self._told = 0

    def live(self) -> None:
        """Step the world by the clock until its time is over."""
        until_s = time.monotonic() + _FIRST_S
        while not self._ros.heard:
            if time.monotonic() > until_s:
                raise HeelError(f"no velocity within {_FIRST_S:g} s: is the bridge up?")
            time.sleep(0.01)
        step_s = 1.0 / (self._mount.fps * _STEPS_A_FRAME)
        pacer, step = Pacer(1.0 / step_s), 0
        while not self._world.finished:
            delay_s = pacer.delay_s(step, time.monotonic())
            time.sleep(max(0.0, delay_s))
            if step % _STEPS_A_TRUTH == 0:
                stamp_ns = time.time_ns()
                truth = self._world.truth(step // _STEPS_A_TRUTH, self._mount)
                print("T", stamp_ns, truth.model_dump_json())
                if step % _STEPS_A_FRAME == 0:
                    self._see(step // _STEPS_A_FRAME, stamp_ns)
            self._tell_velocities()
            self._world.step(step_s, *self._speed())
            self._feel(step)
            step += 1

    def _speed(self) -> tuple[float, float]:
        """As any base does: what it heard last, and zero once nothing comes."""
        heard_s, linear_mps, angular_radps = self._ros.heard[-1]
        fresh = time.monotonic() - heard_s <= TIMEOUT_S
        return (linear_mps, angular_radps) if fresh else (0.0, 0.0)

    def _tell_velocities(self) -> None:
        count = len(self._ros.heard)
        for heard_s, linear_mps, angular_radps in self._ros.heard[self._told : count]:
            print("V", heard_s, linear_mps, angular_radps)
        self._told = count
        sys.stdout.flush()

    def _see(self, seq: int, stamp_ns: int) -> None:
        from sensor_msgs.msg import Image, LaserScan

        ranges = self._world.ranges(seq)
        scan = LaserScan(angle_min=ranges.sectors[0].bearing_rad,
                         angle_increment=ranges.sectors[0].width_rad, range_max=100.0)  # fmt: skip
        scan.ranges = [sector.distance_m for sector in ranges.sectors]
        self._ros.publish("scan", scan)
        if not self._world.camera_on:
            return
        pixels = self._renderer.draw(self._world)
        height, width = pixels.shape[:2]
        image = Image(height=height, width=width, encoding="bgr8", step=3 * width)
        _stamp(image.header, stamp_ns)
        image.data = array.array("B", pixels.tobytes())
        self._ros.publish("camera/camera_info", self._info(width, height, image.header))
        self._ros.publish("camera/image_raw", image)

    def _info(self, width: int, height: int, header: Any) -> Any:
        from sensor_msgs.msg import CameraInfo

        focal = width / 2 / math.tan(self._mount.horizontal_fov_rad / 2)
        info = CameraInfo(header=header, width=width, height=height, distortion_model="plumb_bob")
        info.d = [0.0] * 5
        info.k = [focal, 0.0, width / 2, 0.0, focal, height / 2, 0.0, 0.0, 1.0]
        return info

    def _feel(self, seq: int) -> None:
        from nav_msgs.msg import Odometry

        place = self._world.odometry(seq)
        told = Odometry()
        _stamp(told.header, time.time_ns())
        pose, twist = told.pose.pose, told.twist.twist
        pose.position.x, pose.position.y = place.x_m, place.y_m
        pose.orientation.z = math.sin(place.heading_rad / 2)
        pose.orientation.w = math.cos(place.heading_rad / 2)
        twist.linear.x, twist.angular.z = place.linear_mps, place.angular_radps
        self._ros.publish("odom", told)


def _stamp(header: Any, now_ns: int) -> None:
    header.stamp.sec, header.stamp.nanosec = divmod(now_ns, 10**9)


@app.command()
def main(
    name: Annotated[str, typer.Argument(help="kind of episode")],
    seed: Annotated[int, typer.Option(help="of the episode")] = 0,
    rmw: Annotated[str, typer.Option(help="dds or zenoh")] = "dds",
    router: Annotated[str, typer.Option(help="of rmw_zenoh")] = "",
) -> None:
    """Live through one episode."""
    world = scenario(name, seed)
    mount = CAMERA.mount()
    with ExitStack() as stack:
        ros: Robot
        if rmw == "zenoh":
            ros = stack.enter_context(zenoh_robot(router))
        else:
            ros = stack.enter_context(dds_robot())
        renderer = stack.enter_context(Renderer(world.scenery, mount, seed=seed))
        Body(world, renderer, ros).live()


if __name__ == "__main__":
    run_app(app)
