"""The simulator as a process: a robot and its camera on the topics of a real one."""

from __future__ import annotations

import math
import secrets
import time
from contextlib import ExitStack
from typing import TYPE_CHECKING

import cv2

from heel.schemas import CameraInfo, DriveState, EndOfStream, FrameId, Ranges, Taken, keys
from heel.services.geometry.depth import depth_sectors
from heel.services.runtime import qos
from heel.services.runtime.clock import monotonic_clock
from heel.services.runtime.images import (
    DepthPublisher,
    ImagePublisher,
    StreamIdentity,
    image_header,
)
from heel.services.runtime.pacing import Pacer
from heel.services.runtime.publishing import Latched
from heel.services.runtime.service import LOOP_WAIT_S, ServiceContext, run_service
from heel.services.runtime.settings import Loaded
from heel.services.simulator.boxes import SimulatedDetector
from heel.services.simulator.scenarios import scenario
from heel.services.simulator.settings import SimulatorSettings
from heel.services.simulator.state import CameraMount
from heel.services.simulator.truth_file import TruthFile, open_truth
from heel.services.simulator.views import lens
from heel.services.simulator.wheels import TIMEOUT_S, Wheels
from heel.services.simulator.world import World

if TYPE_CHECKING:
    from heel.services.simulator.render.renderer import Renderer

_LEAST_STEPS_HZ = 50.0
"""The world moves at least so often, whatever the frame rate: commands come at 50 Hz."""
_BEHIND_S = 0.25
"""A world that is later than this goes on from now instead of hurrying after the clock."""


BOXES_NOTICE = "People are the simulator's own boxes, not seen in pixels"


class SimulatorService:
    """Moves a world in real time, takes pictures of it, and drives as the drive says."""

    def __init__(
        self, context: ServiceContext[SimulatorSettings], truth: TruthFile | None,
        resources: ExitStack,
    ) -> None:  # fmt: skip
        s, session = context.settings, context.session
        self._context, self._settings = context, s
        self._truth_file = truth
        self._mount = s.mount()
        # Numbers of messages go on over episodes: their producer is the same.
        self._steps = self._scans = 0
        self._steps_a_frame = max(1, math.ceil(_LEAST_STEPS_HZ / s.fps))
        self._boxes = s.perception == "simulated-boxes"
        self._wheels = Wheels()
        self._drive = context.subscribe("drive", keys.ROBOT_DRIVE, qos.DRIVE)
        self._info = resources.enter_context(Latched(session, keys.info(s.camera), qos.INFO))
        self._described = resources.enter_context(Latched(session, keys.SIM_WORLD, qos.SIM_WORLD))
        self._taken = context.publisher(keys.taken(s.camera), qos.TAKEN)
        self._image = ImagePublisher(context, s.jpeg_quality, None)
        self._depth = DepthPublisher(context) if s.depth else None
        self._blobs = context.publisher(keys.blobs(s.camera), qos.BLOBS) if self._boxes else None
        self._truth = context.publisher(keys.SIM_TRUTH, qos.SIM_TRUTH)
        self._odometry = context.publisher(keys.ROBOT_ODOMETRY, qos.ODOMETRY)
        self._ranges = context.publisher(keys.ROBOT_RANGE, qos.RANGES)

    def run(self) -> None:
        """Play one episode, or one after the other, until stopped."""
        context, seed = self._context, self._settings.seed
        context.statistics.details["perception"] = self._settings.perception
        if self._boxes:
            context.statistics.details["notice"] = BOXES_NOTICE
        context.announce()
        while True:
            world = scenario(self._settings.scenario, seed)
            context.statistics.details["episode"] = f"{self._settings.scenario}, seed {seed}"
            context.log.info("episode %s, seed %d, perception: %s", self._settings.scenario, seed,
                             self._settings.perception)  # fmt: skip
            with ExitStack() as stack:
                renderer = self._open_renderer(world, seed, stack)
                episode = _Episode(context, world, self._mount, seed, renderer)
                self._begin(episode)
                reason = self._play(episode)
            if not (self._settings.loop and context.running):
                break
            seed += 1
        self._end(episode, reason)

    def _open_renderer(self, world: World, seed: int, stack: ExitStack) -> Renderer | None:
        if not self._settings.pictures:
            return None
        # Here and not above: without pictures the simulator needs no extra.
        from heel.services.simulator.render.renderer import Renderer

        return stack.enter_context(Renderer(world.scenery, self._mount, seed=seed))

    def _begin(self, episode: _Episode) -> None:
        s, mount = self._settings, self._mount
        self._info.set(
            CameraInfo(
                stream=s.camera, epoch=episode.identity.epoch, width=mount.width_px,
                height=mount.height_px, source_width=mount.width_px, source_height=mount.height_px,
                fps=mount.fps, source=f"simulator: {s.scenario}, seed {episode.seed}",
                horizontal_fov_rad=mount.horizontal_fov_rad, mount_height_m=mount.height_m,
                mount_pitch_rad=mount.pitch_rad, host=monotonic_clock(),
            )
        )  # fmt: skip
        described = episode.world.world_message()
        self._described.set(described)
        if self._truth_file is not None:
            self._truth_file.write(described)

    def _play(self, episode: _Episode) -> str:
        """Step the world by the clock until its time is over; returns why it ended."""
        world, step_s = episode.world, 1.0 / (self._mount.fps * self._steps_a_frame)
        pacer, step = Pacer(1.0 / step_s), 0
        while self._context.running:
            if world.finished:
                return "the episode is over"
            self._await(pacer, step)
            if step % self._steps_a_frame == 0:
                self._frame(episode, step // self._steps_a_frame)
            self._listen()
            world.step(step_s, *self._wheels.speed(time.monotonic()))
            self._odometry.send(world.odometry(self._steps), 0.0)
            self._steps, step = self._steps + 1, step + 1
        return "the simulator was stopped"

    def _await(self, pacer: Pacer, step: int) -> None:
        """Wait until a step is due; a world far behind the clock slows down and says so."""
        now_s = time.monotonic()
        late_s = now_s - pacer.due_s(step, now_s)
        if late_s > _BEHIND_S:
            pacer.resume(step, now_s)
            self._context.warn.warning("late", f"{late_s:.2f} s behind the clock: slowed", now_s)
        while self._context.running:
            delay_s = pacer.delay_s(step, time.monotonic())
            if delay_s <= 0 or self._context.stop.wait(min(delay_s, LOOP_WAIT_S)):
                return

    def _listen(self) -> None:
        arrival = self._context.inbox.latest("drive")
        if arrival is not None:
            received = self._drive.message(arrival, DriveState)
            if received is not None:
                self._context.statistics.input(arrival.arrived_s)
                self._wheels.hear(received.message, arrival.arrived_s)
        silent = self._wheels.silent(time.monotonic())
        reason = f"the drive is silent for more than {TIMEOUT_S:g} s: standing" if silent else None
        if self._context.statistics.problem("drive", reason):
            self._context.log.info("%s", reason or "the drive speaks again")

    def _frame(self, episode: _Episode, index: int) -> None:
        """Truth and ranges always; picture and boxes while the camera is on."""
        world, started_ns = episode.world, time.monotonic_ns()
        truth = world.truth(episode.seq, self._mount)
        self._truth.send(truth, 0.0)
        if self._truth_file is not None:
            self._truth_file.write(truth)
        if self._depth is None:
            self._send_ranges(world.ranges(self._scans))
        if not world.camera_on:
            return
        frame = FrameId(
            stream=episode.identity.stream, epoch=episode.identity.epoch, seq=episode.seq,
            index=index, t_capture_ns=time.time_ns(),
        )  # fmt: skip
        taken = Taken(
            stream=frame.stream, epoch=frame.epoch, seq=frame.seq, clock=monotonic_clock(),
            monotonic_ns=started_ns,
        )  # fmt: skip
        self._taken.send(taken, 0.0)
        if self._depth is not None and episode.renderer is not None:
            self._send_depth(self._depth, episode, episode.renderer, frame, started_ns)
        if self._blobs is not None:
            blobs = episode.detector.detect(world, frame)
            self._blobs.send(blobs, (time.monotonic_ns() - started_ns) * 1e-9)
        if episode.renderer is not None:
            self._send_picture(episode, episode.renderer, frame, started_ns)
        episode.seq += 1
        busy_s = (time.monotonic_ns() - started_ns) * 1e-9
        self._context.statistics.output(time.monotonic(), busy_s, busy_s)

    def _send_picture(
        self, episode: _Episode, renderer: Renderer, frame: FrameId, acquired_ns: int
    ) -> None:
        image = renderer.draw(episode.world)
        size = self._mount.width_px, self._mount.height_px
        header = image_header(
            episode.identity, image, (frame.seq, frame.index), size, frame.t_capture_ns,
            time.monotonic_ns() - acquired_ns,
        )  # fmt: skip
        self._image.send(header, image)

    def _send_depth(
        self, publisher: DepthPublisher, episode: _Episode, renderer: Renderer, frame: FrameId,
        acquired_ns: int,
    ) -> None:  # fmt: skip
        """Before the people, who are known at once where they are the simulator's own boxes."""
        depth_mm = renderer.measure(episode.world)
        publisher.send(episode.identity, frame, depth_mm, time.monotonic_ns() - acquired_ns)
        self._send_ranges(
            Ranges(seq=self._scans, sectors=depth_sectors(depth_mm, lens(self._mount)))
        )

    def _send_ranges(self, ranges: Ranges) -> None:
        self._ranges.send(ranges, 0.0)
        self._scans += 1

    def _end(self, episode: _Episode, reason: str) -> None:
        # A live receiver keeps one image only: let it take the last one before the end.
        self._context.stop.wait(min(0.5, 2.0 / self._mount.fps))
        end = EndOfStream(
            stream=episode.identity.stream, epoch=episode.identity.epoch, frames=episode.seq,
            reason=reason,
        )  # fmt: skip
        self._image.end(end)
        if self._blobs is not None:
            self._blobs.end(end)
        self._context.log.info("end after %d frames: %s", episode.seq, reason)
        self._context.linger()


class _Episode:
    """One world while it is played: its stream, its eyes, and how many pictures were taken."""

    def __init__(
        self, context: ServiceContext[SimulatorSettings], world: World, mount: CameraMount,
        seed: int, renderer: Renderer | None,
    ) -> None:  # fmt: skip
        self.world, self.seed, self.renderer = world, seed, renderer
        # Each episode is a stream of its own: no person in it is one of the episode before.
        self.identity = StreamIdentity(
            context.settings.camera, secrets.randbits(63), context.producer
        )
        self.detector = SimulatedDetector(mount, seed)
        self.seq = 0


def serve(context: ServiceContext[SimulatorSettings]) -> None:
    """Simulate until the episode is over or the service is stopped."""
    with ExitStack() as resources:
        truth = resources.enter_context(open_truth(context.settings.truth))
        SimulatorService(context, truth, resources).run()


def run(loaded: Loaded[SimulatorSettings]) -> int:
    """Run the simulator process; returns its exit code."""
    # Other processes share the cores: threads inside OpenCV only take turns.
    cv2.setNumThreads(1)
    return run_service("simulator", loaded, serve)
