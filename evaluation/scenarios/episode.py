"""One episode from beginning to end: built from scenario and seed, run, scored and drawn."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from evaluation.following.log import EpisodeLog
from evaluation.following.scores import score_episode
from evaluation.scenarios.loop import ClosedLoop
from evaluation.scenarios.parallel import EpisodeTask
from evaluation.scenarios.perception import SimulatedBoxes
from evaluation.scenarios.picture import draw_episode
from evaluation.scenarios.report import EpisodeResult, Mode
from schemas.errors import HeelError
from services.drive.core import Drive
from services.drive.settings import DriveServiceSettings, DriveSettings
from services.follower.core import Follower
from services.follower.settings import FollowerServiceSettings, FollowerSettings
from services.runtime.settings import Loaded, load_settings
from services.simulator.robot import RobotBody
from services.simulator.scenarios import scenario
from services.simulator.state import CameraMount
from services.simulator.world import World
from services.tracker.settings import TrackerServiceSettings, TrackerSettings


@dataclass(frozen=True, slots=True)
class StackSettings:
    """What the cores are set to: the settings that their processes would read."""

    mode: Mode
    tracker: TrackerSettings
    follower: FollowerSettings
    drive: DriveSettings

    @property
    def max_speed_mps(self) -> float:
        """What the robot can do, and may."""
        limits = self.follower.max_linear_mps, self.drive.max_linear_mps, RobotBody().max_linear_mps
        return min(limits)


def load_stack(mode: Mode, file: Path | None) -> StackSettings:
    """The settings as the processes would load them.

    Raises:
        SettingsError: as `load_settings`.
    """
    tracker: Loaded[TrackerServiceSettings] = load_settings(
        "tracker", TrackerServiceSettings, {}, file
    )
    follower: Loaded[FollowerServiceSettings] = load_settings(
        "follower", FollowerServiceSettings, {}, file
    )
    drive: Loaded[DriveServiceSettings] = load_settings("drive", DriveServiceSettings, {}, file)
    return StackSettings(mode, tracker.service, follower.service, drive.service)


def run_episode(settings: StackSettings, task: EpisodeTask) -> EpisodeResult:
    """Run and score one episode, and draw it where a folder is given."""
    world = scenario(task.scenario, task.seed)
    log = _log_of(world, settings)
    scores = score_episode(log, settings.max_speed_mps)
    if task.out is not None:
        title = f"{task.scenario}, seed {task.seed} ({settings.mode})"
        path = task.out / f"{task.scenario}-{task.seed}.png"
        try:
            task.out.mkdir(parents=True, exist_ok=True)
            draw_episode(log, scores, world.scenery, title, path)
        except OSError as error:
            raise HeelError(f"{path}: cannot be written ({error.strerror})") from error
    return EpisodeResult(scenario=task.scenario, seed=task.seed, scores=scores)


def _log_of(world: World, settings: StackSettings) -> EpisodeLog:
    mount = CameraMount()
    perception = SimulatedBoxes(world, mount, settings.tracker)
    loop = ClosedLoop(world, mount, perception, Follower(settings.follower), Drive(settings.drive))
    return loop.run().log()
