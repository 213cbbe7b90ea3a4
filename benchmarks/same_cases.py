"""What `make same` plays, case by case; each leaves its rows in a folder.

Every case runs the cores that the processes run, one frame after the other in one process on one
thread. None depends on time: recordings and drawn scenes are their own clock, episodes have a
simulated one, and the network's time budget (`model_budget_ms`) binds live runs alone.
"""

from __future__ import annotations

import csv
import itertools
import tempfile
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.common import data_folder
from benchmarks.scripted_pan import SEQUENCE, WINDOW
from benchmarks.virtual_pan import SEQUENCES
from heel.evaluation.following.log import EpisodeLog
from heel.evaluation.motchallenge import write_tracks
from heel.schemas import FrameId, MotionCommand, Pointed, Tracks
from heel.services.capture.numbered_pictures import pictures_by_number
from heel.services.capture.pan_window import PanSettings, PanWindow
from heel.services.capture.scene_source import open_scene
from heel.services.commands.track_detections import read_given, shown_rows
from heel.services.detector.settings import DetectorSettings
from heel.services.drive.core import Drive
from heel.services.drive.settings import DriveSettings
from heel.services.follower.core import Follower
from heel.services.follower.settings import FollowerSettings
from heel.services.loops.panning.everybody import follow_everybody
from heel.services.loops.panning.perception import PerceptionName, WindowPerception
from heel.services.loops.panning.perception import perception as perception_of
from heel.services.loops.panning.scripted import Script, following, panning, scripted_frames
from heel.services.loops.panning.truth import InWindow
from heel.services.loops.scenarios.loop import ClosedLoop
from heel.services.loops.scenarios.perception import Perception, SimulatedBoxes
from heel.services.pipeline import InProcessPipeline, RecordedFrames, load_pipeline
from heel.services.run.in_process import run_in_process
from heel.services.run.options import RunOptions
from heel.services.run.outputs import RunOutputs, track_rows
from heel.services.run.summary import RunSummary
from heel.services.simulator.scenarios import SCENARIOS, scenario
from heel.services.simulator.state import CameraMount
from heel.services.simulator.world import World
from heel.services.tracker.boxes.sequence import track_sequence
from heel.services.tracker.settings import TrackerSettings
from tests.unit.networks.drawn_networks import red_finder

TRACKS, COMMANDS = "tracks.txt", "commands.csv"
POSES, OUTCOMES = "poses.csv", "outcomes.csv"
FILES = (TRACKS, COMMANDS, POSES, OUTCOMES)
PRESETS = ("default", "paper")
SCENES = ("demo", "crossing", "pacing", "empty")
SHORT_FRAMES = 200
"""Of a drawn scene in the short form; only `demo` goes on for much longer."""
MOST_FRAMES = 300
"""Of a recording; only one is longer. With all limits the whole set takes some minutes."""
MODEL_FRAMES = 60
"""Of a recording with a network, which takes several times as long as without. The paper's preset
takes none."""
SEED = 1
SHORT_EPISODE = "drop-out"
_SHORT_S = 25.0
"""Time for a choice, following, and the camera's first drop-out."""
_POINTED_AT = 20
"""Frame, chosen by hand."""


@dataclass(frozen=True)
class Case:
    """Something that is played the same way every time.

    Attributes:
        name: its folder in the output, with slashes.
        play: writes some of `FILES` into an existing folder; can be pickled.
        short: whether it belongs to the short form.
    """

    name: str
    play: Callable[[Path], None]
    short: bool = False


def all_cases() -> list[Case]:
    """Everything that can be played here: recordings only where `HEEL_DATA` has some."""
    return [*_drawn(), *_boxes(), *_recorded(), *_windows(), *_episodes()]


def _drawn() -> Iterator[Case]:
    short = partial(Case, short=True)
    for name, preset in itertools.product(SCENES, PRESETS):
        run = partial(_run, f"scene:{name}", preset=preset)
        yield short(f"drawn/{name}/{preset}", partial(run, frames=SHORT_FRAMES))
        if name == "demo":
            yield Case(f"drawn/{name}-whole/{preset}", run)
    # What a network, a turning camera and a user's click bring about shows in no run above.
    yield short("drawn/crossing/network", partial(_network, "scene:crossing", SHORT_FRAMES // 2))
    yield short("drawn/demo/turning", partial(_turning, "scene:demo", 3 * SHORT_FRAMES // 4))
    yield short("drawn/pacing/pointed", partial(_pointed, "scene:pacing", SHORT_FRAMES // 2))


def _episodes() -> Iterator[Case]:
    yield Case("episode/short", partial(_episode, SHORT_EPISODE, duration_s=_SHORT_S), short=True)
    for name in SCENARIOS:
        yield Case(f"episode/{name}", partial(_episode, name))


def _boxes() -> Iterator[Case]:
    for file in sorted(data_folder().rglob("det/det.txt")):
        sequence = file.parent.parent
        yield Case(f"boxes/{sequence.name}/alone", partial(_given_boxes, sequence, False))
        if _has_pictures(sequence):
            yield Case(f"boxes/{sequence.name}/pictures", partial(_given_boxes, sequence, True))


def _recorded() -> Iterator[Case]:
    models = sorted((data_folder() / "models").glob("*.onnx"))
    for sequence in sorted(path for path in data_folder().glob("*") if _has_pictures(path)):
        for preset in PRESETS:
            name, run = f"recorded/{sequence.name}", partial(_run, str(sequence), preset=preset)
            yield Case(f"{name}/{preset}", partial(run, frames=MOST_FRAMES))
        for model in models:
            look = partial(_run, str(sequence), preset="default", model=model, detector="onnx",
                           frames=MODEL_FRAMES)  # fmt: skip
            yield Case(f"recorded/{sequence.name}/default-{model.stem}", look)


def _windows() -> Iterator[Case]:
    if (moved_over := data_folder() / SEQUENCE).is_dir():
        for name, script in {"follows": following, "pans": panning}.items():
            yield Case(f"window/{SEQUENCE}/{name}", partial(_scripted, moved_over, script))
    for sequence in (data_folder() / name for name in SEQUENCES):
        if sequence.is_dir():
            yield Case(
                f"turned/{sequence.name}/true-boxes", partial(_turned, sequence, "true-boxes")
            )


def _has_pictures(sequence: Path) -> bool:
    return (sequence / "img1").is_dir() or (sequence / "video.mp4").is_file()


def _run(source: str, out: Path, **options: Any) -> None:
    """What `heel run --in-process` does."""
    run = RunOptions(source=source, out=out, progress=False, **{"model": "none", **options})
    run_in_process(run, threading.Event())


def _network(scene: str, frames: int, out: Path) -> None:
    """The same with a network that takes for people what is red."""
    with tempfile.TemporaryDirectory() as folder:
        model, config = red_finder(Path(folder) / "red.onnx"), Path(folder) / "settings.toml"
        config.write_text("[detector]\nmodel_score = 0.02\n", encoding="utf-8")
        _run(scene, out, detector="onnx", model=model, config=config, frames=frames)


def _turning(scene: str, frames: int, out: Path) -> None:
    """A window that turns before a drawn scene, as a robot's camera would."""
    cv2.setNumThreads(1)
    pipeline, _ = load_pipeline("default", "nearest", None, model="none")
    with RecordedFrames(scene) as source, _outputs(out) as outputs:
        size = source.source.width, source.source.height
        path = panning({}, frames, size, WINDOW)
        for (frame, image, _), (x, y) in zip(source, path.tolist(), strict=False):
            place = PanSettings(width=WINDOW[0], height=WINDOW[1], x=x, y=y)
            view = PanWindow(size, place).view(image, frame.index)
            result = pipeline.step(frame, view, WINDOW)
            outputs.tracks(result.tracks)
            outputs.command(result.command)


def _pointed(scene: str, frames: int, out: Path) -> None:
    """A user points at the first person of a drawn scene, who is looked for from then on."""
    cv2.setNumThreads(1)
    pipeline = InProcessPipeline(DetectorSettings(), TrackerSettings())
    truth = open_scene(scene).scene
    with RecordedFrames(scene) as source, _outputs(out) as outputs:
        for frame, image, size in itertools.islice(source, frames):
            click = None
            if frame.seq == _POINTED_AT:
                left, top, right, bottom = truth.truth(frame.index)[0].box_xyxy
                click = Pointed(frame=frame, width=size[0], height=size[1],
                                x_px=(left + right) / 2, y_px=(top + bottom) / 2)  # fmt: skip
            outputs.tracks(pipeline.step(frame, image, size, click)[1])
    (out / COMMANDS).unlink()  # there is no follower


def _given_boxes(sequence: Path, pictures: bool, out: Path) -> None:
    """What `heel track-detections` does."""
    cv2.setNumThreads(1)
    picture = pictures_by_number(sequence) if pictures else None
    tracked = track_sequence(read_given(sequence), picture=picture)
    write_tracks(out / TRACKS, shown_rows(tracked))


def _scripted(sequence: Path, script: Script, out: Path) -> None:
    """A window that goes over a recording by a script (`benchmarks/scripted_pan.py`)."""
    cv2.setNumThreads(1)
    pipeline, _ = load_pipeline("default", "nearest", None, model="none")
    with _outputs(out) as outputs:
        frames = scripted_frames(sequence, WINDOW, script, SEED)
        for frame in itertools.islice(frames, MOST_FRAMES):
            result = pipeline.step(frame.id, frame.image, WINDOW)
            outputs.tracks(result.tracks)
            outputs.command(result.command)


def _turned(sequence: Path, how: PerceptionName, out: Path) -> None:
    """Everybody of a recording followed by a window that turns (`benchmarks/virtual_pan.py`)."""
    cv2.setNumThreads(1)
    rows: list[list[str]] = []

    def look() -> _NotedWindow:
        rows.append([])
        return _NotedWindow(perception_of(how), rows[-1])

    outcomes = follow_everybody(sequence, PanSettings(), look)
    (out / TRACKS).write_text("".join("".join(one) for one in rows), encoding="ascii")
    columns = ("person", "visible", "since_chosen", "in_window", "kept", "wrong")
    lines = [",".join(columns), *(
        ",".join(str(getattr(one, column)) for column in columns) for one in outcomes
    )]  # fmt: skip
    (out / OUTCOMES).write_text("".join(f"{line}\n" for line in lines), encoding="ascii")


def _episode(name: str, out: Path, duration_s: float | None = None) -> None:
    """The closed loop on simulated boxes, from the first click to the end or to `duration_s`."""
    cv2.setNumThreads(1)
    world, mount = scenario(name, SEED), CameraMount()
    if duration_s is not None:
        world = World(replace(world.scenario, duration_s=duration_s), SEED)
    with _outputs(out) as outputs:
        boxes = _Noted(SimulatedBoxes(world, mount, TrackerSettings()), outputs)
        drive = _NotedDrive(DriveSettings(), outputs)
        loop = ClosedLoop(world, mount, boxes, Follower(FollowerSettings()), drive)
        log = loop.run().log()
    _write_poses(log, out / POSES)


class _Noted:
    """A perception whose tracks are written down."""

    def __init__(self, perception: Perception, outputs: RunOutputs) -> None:
        self._perception, self._outputs = perception, outputs

    def see(self, frame: FrameId) -> Tracks:
        tracks = self._perception.see(frame)
        self._outputs.tracks(tracks)
        return tracks

    def point(self, pointed: Pointed) -> None:
        self._perception.point(pointed)


class _NotedWindow:
    """The same in a window of a recording."""

    def __init__(self, perception: WindowPerception, rows: list[str]) -> None:
        self._perception, self._rows = perception, rows

    def see(
        self, frame: FrameId, image: NDArray[np.uint8], offset_px: tuple[float, float],
        truth: InWindow,
    ) -> Tracks:  # fmt: skip
        tracks = self._perception.see(frame, image, offset_px, truth)
        self._rows += track_rows(tracks)
        return tracks


class _NotedDrive(Drive):
    """A drive that writes down what it is told."""

    def __init__(self, settings: DriveSettings, outputs: RunOutputs) -> None:
        super().__init__(settings)
        self._outputs = outputs

    def take(
        self, command: MotionCommand, producer: str, now_s: float, line: str | None = None,
        turn: int = 0,
    ) -> bool:  # fmt: skip
        self._outputs.command(command)
        return super().take(command, producer, now_s)


def _write_poses(log: EpisodeLog, file: Path) -> None:
    """Where the robot was at every moment, whom it followed and in which state."""
    x_m, y_m = log.robot_xy_m.T
    columns = (log.t_s, x_m, y_m, log.robot_heading_rad, log.linear_mps, log.angular_radps)
    with file.open("w", encoding="ascii", newline="") as text:
        rows = csv.writer(text, lineterminator="\n")
        rows.writerow(("t_s", "x_m", "y_m", "heading_rad", "linear_mps", "angular_radps",
                       "followed", "state"))  # fmt: skip
        for *reals, followed, state in zip(*columns, log.followed, log.state, strict=True):
            rows.writerow((*(f"{value:.4f}" for value in reals), followed, state))


def _outputs(out: Path) -> RunOutputs:
    return RunOutputs(out, RunSummary(mode="in-process"), annotate=False)
