"""One episode from beginning to end: built from scenario and seed, run, scored and drawn."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from heel.evaluation.following.episode_scores import score_episode
from heel.evaluation.following.log import EpisodeLog
from heel.schemas.errors import HeelError
from heel.services.detector.settings import DetectorSettings, NamedDetectorSettings
from heel.services.drive.core import Drive
from heel.services.drive.settings import DriveServiceSettings, DriveSettings
from heel.services.follower.core import Follower
from heel.services.follower.settings import FollowerServiceSettings, FollowerSettings
from heel.services.loops.scenarios.loop import ClosedLoop
from heel.services.loops.scenarios.parallel import EpisodeTask
from heel.services.loops.scenarios.perception import EVERYTHING, Perception, Senses, SimulatedBoxes
from heel.services.loops.scenarios.picture import draw_episode
from heel.services.loops.scenarios.results import EpisodeResult, Mode
from heel.services.networks.names import HeadName
from heel.services.runtime.settings import Loaded, load_settings
from heel.services.simulator.robot import RobotBody
from heel.services.simulator.scenarios import scenario
from heel.services.simulator.state import CameraMount
from heel.services.tracker.settings import TrackerServiceSettings, TrackerSettings


@dataclass(frozen=True, slots=True)
class StackSettings:
    """What the cores are set to: the settings that their processes would read."""

    mode: Mode
    detector: DetectorSettings
    tracker: TrackerSettings
    follower: FollowerSettings
    drive: DriveSettings
    senses: Senses = EVERYTHING

    @property
    def max_speed_mps(self) -> float:
        """What the robot can do, and may."""
        limits = self.follower.max_linear_mps, self.drive.max_linear_mps, RobotBody().max_linear_mps
        return min(limits)


def load_stack(
    mode: Mode,
    file: Path | None,
    detector_name: str | None = None,
    model: str | Path | None = None,
    model_class: int | None = None,
    model_head: HeadName | None = None,
) -> StackSettings:
    """The settings as the processes would load them.

    Args:
        mode: what stands for the camera.
        file: settings file of the services.
        detector_name, model, model_class, model_head: of the detector, before what the file says.

    Raises:
        SettingsError: as `load_settings`.
    """
    flags = {"detector": detector_name, "model": model, "model_class": model_class,
             "model_head": model_head}  # fmt: skip
    # What is scored does not depend on which network happens to be there.
    detector: Loaded[NamedDetectorSettings] = load_settings(
        "detector", NamedDetectorSettings, {"detector": flags}, file
    )
    tracker: Loaded[TrackerServiceSettings] = load_settings(
        "tracker", TrackerServiceSettings, {}, file
    )
    follower: Loaded[FollowerServiceSettings] = load_settings(
        "follower", FollowerServiceSettings, {}, file
    )
    drive: Loaded[DriveServiceSettings] = load_settings("drive", DriveServiceSettings, {}, file)
    return StackSettings(mode, detector.service, tracker.service, follower.service, drive.service)


def run_episode(settings: StackSettings, task: EpisodeTask) -> EpisodeResult:
    """Run the cores through one episode and score it; draw and film it if a folder is given."""
    return play_and_judge(partial(_play, settings), settings, task)


def play_and_judge(
    play: Callable[[EpisodeTask], EpisodeLog], settings: StackSettings, task: EpisodeTask
) -> EpisodeResult:
    """Score what becomes of one episode; draw it if a folder is given.

    Args:
        play: runs it.
        settings: what the stack that plays is set to.
        task: which episode.
    """
    if task.out is not None:
        _make_folder(task.out)
    log = play(task)
    scores = score_episode(log, settings.max_speed_mps)
    if task.out is not None:
        title = f"{task.scenario}, seed {task.seed} ({settings.mode})"
        scenery = scenario(task.scenario, task.seed).scenery
        draw_episode(log, scores, scenery, title, task.out / f"{task.name}.png")
    return EpisodeResult(scenario=task.scenario, seed=task.seed, scores=scores)


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise HeelError(f"{folder}: cannot be made ({error.strerror})") from error


def _play(settings: StackSettings, task: EpisodeTask) -> EpisodeLog:
    world, mount = scenario(task.scenario, task.seed), CameraMount()
    cores = Follower(settings.follower), Drive(settings.drive)
    senses = settings.senses
    if settings.mode == "simulated boxes" and not task.video and not senses.depth:
        boxes = SimulatedBoxes(world, mount, settings.tracker)
        return ClosedLoop(world, mount, boxes, *cores, senses=senses).run().log()
    # Here and not above: without pictures no extra is needed.
    from heel.services.loops.scenarios.pixels import Camera, DepthSeen, Film, RenderedPixels

    with ExitStack() as resources:
        camera = resources.enter_context(Camera(world, mount))
        perception: Perception = RenderedPixels(camera, settings.detector, settings.tracker)
        if settings.mode == "simulated boxes":
            perception = SimulatedBoxes(world, mount, settings.tracker)
        ranges = None
        if senses.depth:
            perception = seen = DepthSeen(perception, camera, mount, senses.calibrated)
            ranges = seen.ranges
        film = None
        if task.video and task.out is not None:
            film = resources.enter_context(Film(camera, task.out / f"{task.name}.mp4", mount.fps))
        loop = ClosedLoop(world, mount, perception, *cores, film, senses, ranges=ranges)
        return loop.run().log()
