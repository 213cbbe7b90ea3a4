"""What the known networks do: the tables of docs/records/models.md, and `heel models list`.

Milliseconds are of processor time on one thread. A look is the network on one picture; the chain
decodes, detects, tracks and follows in pictures of 640x480 that the simulated world's camera takes,
and follows the nearest. MOTA is at IoU 0.5, every frame from the first: of recordings, and of the
drawn scene, whose people no network was trained on. `seen` is the share of the people in sight, in
the world of `heel demo` while the robot stands, that have a shown track on them.

Example run: python -m benchmarks.models --write docs/records/models.md
"""

from __future__ import annotations

import json
import tempfile
import time
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
import typer
from numpy.typing import NDArray

from benchmarks.common import Write, data_folder, heel_run, median, publish
from heel.evaluation.sequence_scores import evaluate
from heel.schemas import FrameId, SimTruth
from heel.schemas.errors import HeelError
from heel.services.commands.demo import SCENARIO, SEED
from heel.services.detector.settings import DetectorSettings
from heel.services.follower.core import Follower
from heel.services.follower.settings import FollowerSettings
from heel.services.loops.judge import people_by_track
from heel.services.models import measured
from heel.services.models.catalogue import KNOWN
from heel.services.models.store import whole_file
from heel.services.networks.person_model import PersonModel
from heel.services.pipeline import InProcessPipeline, repeatable_id, scene_truth
from heel.services.runtime.command_line import run_app
from heel.services.tracker.settings import TrackerSettings

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
RECORDINGS = ("PETS09-S2L1", "TUD-Campus", "Jogging")
STEPS = ("decode", "detect", "track", "follow")
SCENE = "scene:demo?frames=300"
_FRAMES = 160
"""Of the simulated world: 8 s, in which people come near and cross; chosen by hand."""
_LOOKS = 40
"""Of the network alone; chosen by hand."""
_LEAST_VISIBLE = 0.5
"""Share of a person that is to be seen, below which one counts as hidden; chosen by hand."""
_LEAST_HEIGHT = 0.08
"""Of the picture's height: smaller newcomers get no identity while a taller person is in sight."""
_TRACKER = "tracker/main@00000000"


@dataclass
class Figures:
    """Of one network, or of none."""

    look_ms: float | None = None
    steps_ms: dict[str, float] = field(default_factory=dict)
    seen: float = 0.0
    mota: dict[str, float] = field(default_factory=dict)

    @property
    def frame_ms(self) -> float:
        """The whole chain, milliseconds a frame."""
        return sum(self.steps_ms.values())


def world() -> tuple[list[bytes], list[SimTruth]]:
    """Pictures, as a camera's JPEG, and the truth of the world of `heel demo` with a robot that
    stands."""
    from heel.services.loops.scenarios.pixels import Camera
    from heel.services.simulator.scenarios import scenario
    from heel.services.simulator.state import CameraMount

    made, mount = scenario(SCENARIO, SEED), CameraMount()
    pictures, truths = [], []
    with Camera(made, mount) as camera:
        for seq in range(_FRAMES):
            done, jpeg = cv2.imencode(".jpg", camera.picture())
            assert done, "OpenCV writes JPEG"
            pictures.append(jpeg.tobytes())
            truths.append(made.truth(seq, mount))
            made.step(1 / mount.fps, 0.0, 0.0)
    return pictures, truths


def play(
    settings: DetectorSettings, pictures: Sequence[bytes], truths: Sequence[SimTruth]
) -> tuple[dict[str, float], float]:
    """Median milliseconds of each step, and the share of people in sight that were shown."""
    pipeline, follower = InProcessPipeline(settings, TrackerSettings()), Follower(
        FollowerSettings(target="nearest")
    )  # fmt: skip
    spent: dict[str, list[float]] = defaultdict(list)
    seen = there = 0
    for seq, (jpeg, truth) in enumerate(zip(pictures, truths, strict=True)):
        times = [time.thread_time()]
        image = _decoded(jpeg)
        times.append(time.thread_time())
        blobs = pipeline.detect(_frame(seq, truth), image, (image.shape[1], image.shape[0]))
        times.append(time.thread_time())
        tracks = pipeline.track(blobs)
        pipeline.settle()
        times.append(time.thread_time())
        follower.observe(tracks, _TRACKER)
        follower.step(truth.t_s, 0.0)
        times.append(time.thread_time())
        for step, value in zip(STEPS, np.diff(times).tolist(), strict=True):
            spent[step].append(1e3 * value)
        shown = {track.id for track in tracks.tracks if track.shown}
        on = {person for track, person in people_by_track(truth, tracks).items() if track in shown}
        in_sight = {index for index in range(len(truth.people)) if _in_sight(truth, index)}
        seen, there = seen + len(on & in_sight), there + len(in_sight)
    return {step: median(values) for step, values in spent.items()}, seen / max(1, there)


def mota(source: str, truth: Path, model: str) -> float:
    """Of a recording or a drawn scene."""
    with tempfile.TemporaryDirectory() as out:
        heel_run(source, Path(out), "--in-process", "--model", model)
        return evaluate(truth, Path(out)).mota


def look_ms(file: Path, picture: NDArray[np.uint8]) -> float:
    """Median milliseconds of the network on one picture."""
    network, spent = PersonModel(file), []
    for _ in range(_LOOKS):
        started_s = time.thread_time()
        network.detect(picture, 0.3)
        spent.append(1e3 * (time.thread_time() - started_s))
    return median(spent)


def _decoded(jpeg: bytes) -> NDArray[np.uint8]:
    image = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None, "written above"
    return np.asarray(image, np.uint8)


def _frame(seq: int, truth: SimTruth) -> FrameId:
    return repeatable_id(seq, seq, truth.t_s)


def _in_sight(truth: SimTruth, index: int) -> bool:
    person = truth.people[index]
    if person.box_xyxy is None or person.visible < _LEAST_VISIBLE:
        return False
    _, top, _, bottom = person.box_xyxy
    return bottom - top >= _LEAST_HEIGHT * 480


def tables(found: dict[str, Figures]) -> str:
    """Markdown: what is seen, and what the chain takes."""
    names = list(next(iter(found.values())).mota)
    lines = ["| network | ms a look | seen, simulated | "
             + " | ".join(f"MOTA {name}" for name in names) + " |",
             "|---|" + "---|" * (2 + len(names))]  # fmt: skip
    for name, one in found.items():
        cells = ["-" if one.look_ms is None else f"{one.look_ms:.1f}", f"{one.seen:.0%}",
                 *(f"{one.mota[key]:.1f}" for key in names)]  # fmt: skip
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    lines += ["", "| network | " + " | ".join(f"{step} ms" for step in STEPS) + " | chain ms |",
              "|---|" + "---|" * (len(STEPS) + 1)]  # fmt: skip
    for name, one in found.items():
        cells = [f"{one.steps_ms[step]:.1f}" for step in STEPS]
        lines.append(f"| {name} | " + " | ".join(cells) + f" | {one.frame_ms:.1f} |")
    return "\n".join(lines) + "\n"


@app.command()
def main(
    model: Annotated[
        list[str] | None, typer.Option(help="only this one; repeatable [default: all and none]")
    ] = None,
    recordings: Annotated[bool, typer.Option(help="score recordings, too")] = True,
    write: Write = None,
) -> None:
    """Measure every known network that finds people; the files have to be there."""
    cv2.setNumThreads(1)
    people = [name for name, one in KNOWN.items() if one.kind == "people"]
    chosen = model or ["none", *people]
    if unknown := sorted(set(chosen) - {"none", *people}):
        raise HeelError(f"model {unknown[0]!r}: choose of none, {', '.join(people)}")
    if write is not None and set(people) - set(chosen):
        raise HeelError("--write wants all networks: leave out --model")
    pictures, truths = world()
    found = {}
    for name in chosen:
        file = None if name == "none" else whole_file(KNOWN[name])
        settings = DetectorSettings(model=file)
        steps_ms, seen = play(settings, pictures, truths)
        one = found[name] = Figures(steps_ms=steps_ms, seen=seen)
        if file is not None:
            one.look_ms = look_ms(file, _decoded(pictures[-1]))
        for recording in RECORDINGS if recordings else ():
            source = data_folder() / recording
            one.mota[recording] = mota(str(source), source, name)
        with tempfile.TemporaryDirectory() as truth:
            rows = Path(truth, "gt", "gt.txt")
            rows.parent.mkdir()
            rows.write_text("".join(scene_truth(SCENE).rows), encoding="ascii")
            one.mota["drawn scene"] = mota(SCENE, Path(truth), name)
        typer.echo(f"{name}: {one}", err=True)
    publish(tables(found), write)
    if write is not None:
        _keep(found)


def _keep(found: dict[str, Figures]) -> None:
    """Write the file that `heel models list` reads."""
    told = {
        "how": "python -m benchmarks.models --write docs/records/models.md; ms of processor time "
        "on one thread of a busy machine",
        "models": {
            name: {
                "sha256": KNOWN[name].sha256,
                "look_ms": round(one.look_ms or 0.0, 2),
                "frame_ms": round(one.frame_ms, 2),
                "mota": {key: round(value, 2) for key, value in one.mota.items()},
            }
            for name, one in found.items() if name in KNOWN
        },
    }  # fmt: skip
    measured.FILE.write_text(json.dumps(told, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    run_app(app)
