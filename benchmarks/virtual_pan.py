"""Every person of real recordings followed by a window that turns: docs/records/virtual-pan.md.

The window of a recording is the robot's picture; detector, tracker, follower and drive are the
cores that the services run, on a simulated clock, and what the wheels are told turns the window.
`--perception true-boxes` puts the ground truth, cut to the window and without identities, in the
place of the detector: such figures say nothing of seeing.

Example run: python -m benchmarks.virtual_pan --perception true-boxes --json pan.json
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated

import cv2
import typer

from benchmarks.common import Figure, Json, data_folder, write_json
from heel.schemas.errors import HeelError
from heel.services.capture.pan_window import PanSettings
from heel.services.loops.panning.episode import PanOutcome
from heel.services.loops.panning.everybody import follow_everybody
from heel.services.loops.panning.perception import PerceptionName
from heel.services.loops.panning.perception import perception as perception_of
from heel.services.runtime.command_line import run_app

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
SEQUENCES = ("PETS09-S2L1", "TownCentre-A", "TownCentre-B", "TownCentre-C")
HEAD = ("sequence", "perception", "people", "chosen", "kept%", "in window%", "wrong%",
        "acted upon%", "people >= 95%", "kept% of all")  # fmt: skip


def row(sequence: str, how: str, outcomes: Sequence[PanOutcome]) -> str:
    """One line of the Markdown table, over all people's frames together."""
    since = max(1, sum(one.since_chosen for one in outcomes))
    visible = max(1, sum(one.visible for one in outcomes))
    kept, inside, wrong, acted = (
        sum(getattr(one, what) for one in outcomes)
        for what in ("kept", "in_window", "wrong", "acted_wrong")
    )
    well = sum(one.kept >= 0.95 * one.since_chosen for one in outcomes if one.chosen)
    cells = (
        sequence, how, str(len(outcomes)), str(sum(one.chosen for one in outcomes)),
        f"{100 * kept / since:.1f}", f"{100 * inside / since:.1f}", f"{100 * wrong / since:.1f}",
        f"{100 * acted / since:.1f}", str(well), f"{100 * kept / visible:.1f}",
    )  # fmt: skip
    return "| " + " | ".join(cells) + " |"


def lines_of(outcomes: Sequence[PanOutcome]) -> list[str]:
    """One line for everybody who was not kept throughout."""
    lines = []
    for one in outcomes:
        if not one.chosen:
            lines.append(f"  person {one.person}: never chosen in {one.visible} frames")
        elif one.lost:
            states = ", ".join(sorted({state for _, state in one.lost}))
            lines.append(
                f"  person {one.person}: kept {one.kept} of {one.since_chosen} frames, in window "
                f"{one.in_window}, wrong {one.wrong}; not kept in frames {one.lost[0][0]} to "
                f"{one.lost[-1][0]} ({states})"
            )
    return lines


def recordings(chosen: Sequence[str] | None) -> list[Path]:
    """Folders of the sequences to follow people in.

    Raises:
        HeelError: none is there.
    """
    paths = [data_folder() / name for name in chosen or SEQUENCES]
    found = [path for path in paths if chosen or path.is_dir()]
    if not found:
        raise HeelError(f"no recordings in {data_folder()}: set HEEL_DATA to their folder")
    return found


@app.command()
def main(
    sequence: Annotated[
        list[str] | None, typer.Option(help="these, by path or by name in HEEL_DATA")
    ] = None,
    perception: Annotated[
        PerceptionName | None, typer.Option(help="true-boxes or pixels; both if not given")
    ] = None,
    model: Annotated[
        Path | None, typer.Option(help="pixels: network that finds people, an ONNX file")
    ] = None,
    person: Annotated[list[int] | None, typer.Option(help="follow these only")] = None,
    fov_deg: Annotated[float, typer.Option(help="field of view of the window")] = 60.0,
    json: Json = None,
) -> None:
    """Follow everybody who is visible for three seconds or more, and print how long that held."""
    cv2.setNumThreads(1)
    settings = PanSettings(fov_deg=fov_deg)
    rows, figures = [], []
    ways: tuple[PerceptionName, ...] = (perception,) if perception else ("true-boxes", "pixels")
    for how in ways:
        name = f"{how} ({model.stem})" if model and how == "pixels" else how
        for path in recordings(sequence):
            look = partial(perception_of, how, model)
            outcomes = follow_everybody(path, settings, look, frozenset(person or ()))
            rows.append(row(path.name, name, outcomes))
            for line in [rows[-1], *lines_of(outcomes)]:
                typer.echo(line, err=True)
            since = max(1, sum(one.since_chosen for one in outcomes))
            for what in ("kept", "in_window", "wrong", "acted_wrong"):
                share = 100.0 * sum(getattr(one, what) for one in outcomes) / since
                figures.append(
                    Figure(f"virtual-pan/{path.name}/{name}/{what}", share, "%", "", None, 1)
                )
    head = ["| " + " | ".join(HEAD) + " |", "|" + "---|" * len(HEAD)]
    typer.echo("\n".join(head + rows))
    write_json(figures, json)


if __name__ == "__main__":
    run_app(app)
