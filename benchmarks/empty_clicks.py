"""Clicks on nobody: does the robot show a box there, turn to it, or drive after it?

Worlds are drawn and the stack sees them without a network, in the closed loop. Every world has a
drawn person on paper, a locker and a coat stand in the colours of clothes, and a pane that mirrors
people, as far as there is room. Beside them stands what becomes of clicks on people, and how often
what was said of a box was right.

Example run:
    python -m benchmarks.empty_clicks --worlds 5 --anywhere 16 --write docs/records/scenarios.md
"""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Annotated

import cv2
import typer

from benchmarks.common import Figure, Json, Write, publish, write_json
from heel.services.loops.scenarios.clicks import AIMS, WORLDS, Aim, ClickOutcome, click_in
from heel.services.loops.scenarios.episode import StackSettings, load_stack
from heel.services.runtime.command_line import run_app

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
_NAMES: dict[Aim, str] = {
    "anything": "anywhere else", "drawn person": "a drawn person",
    "clothes": "a locker like clothes", "coat stand": "a coat stand",
    "mirror image": "a mirror image", "person": "a person",
}  # fmt: skip
_SAID = ((0.0, 0.55), (0.55, 0.65), (0.65, 0.85), (0.85, 1.01))


def played(
    settings: StackSettings, worlds: int, anywhere: int, seed: int
) -> Iterator[ClickOutcome]:
    """Every kind of click in every world, and so many anywhere."""
    for index in range(worlds):
        name = WORLDS[index % len(WORLDS)]
        for aim in AIMS:
            for turn in range(anywhere if aim == "anything" else 1):
                outcome = click_in(settings, name, seed + index + 1000 * turn, aim)
                if outcome is not None:
                    typer.echo(line_of(outcome), err=True)
                    yield outcome


def line_of(outcome: ClickOutcome) -> str:
    """What became of one click, in short."""
    told = [
        word
        for word, holds in (
            ("box on nothing", outcome.box_on_nothing),
            (f"driven after at up to {outcome.top_mps:.2f} m/s", outcome.driven),
            (f"box after {outcome.box_s or 0.0:.1f} s", outcome.box_s is not None),
            (f"proven after {outcome.proven_s or 0.0:.1f} s", outcome.proven_s is not None),
        )
        if holds
    ]  # fmt: skip
    what = ", ".join(told) or "nothing shown"
    return f"{outcome.world} {outcome.seed}, {_NAMES[outcome.aim]}: {what} ({outcome.reason})"


def clicks_table(outcomes: Sequence[ClickOutcome]) -> str:
    """Markdown: one row for each thing that was clicked on."""
    lines = [
        "| click on | clicks | box on nothing | driven after | top speed, m/s | people "
        "found | box after, s | proven | after, s |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    empty = [one for one in outcomes if one.aim != "person"]
    for aim in AIMS:
        some = [one for one in outcomes if one.aim == aim]
        if some:
            lines.append(_row(_NAMES[aim], some))
        if aim == AIMS[-2]:
            lines.append(_row("**nobody, in all**", empty))
    return "\n".join(lines) + "\n"


def _row(name: str, some: Sequence[ClickOutcome]) -> str:
    boxed = [one.box_s for one in some if one.box_s is not None]
    proven = [one.proven_s for one in some if one.proven_s is not None]
    cells = (
        name, len(some), sum(one.box_on_nothing for one in some),
        sum(one.driven for one in some), f"{max((one.top_mps for one in some), default=0.0):.2f}",
        len(boxed), f"{statistics.median(boxed):.1f}" if boxed else "-",
        len(proven), f"{statistics.median(proven):.1f}" if proven else "-",
    )  # fmt: skip
    return "| " + " | ".join(str(cell) for cell in cells) + " |"


def claims_table(outcomes: Sequence[ClickOutcome]) -> str:
    """Markdown: how often a person was under the target's box, by the confidence it had."""
    lines = [
        "| said | boxes | a person's, % | not proven | a person's, % |",
        "|---|---|---|---|---|",
    ]
    claims = [claim for one in outcomes for claim in one.claims]
    for low, high in _SAID:
        said = [claim for claim in claims if low <= claim.confidence < high]
        open_ = [claim for claim in said if not claim.proven]
        cells = [f"{low:g} to {min(high, 1.0):g}"]
        for some in (said, open_):
            right = sum(claim.right for claim in some)
            cells += [str(len(some)), f"{100.0 * right / len(some):.0f}" if some else "-"]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


@app.command()
def main(
    worlds: Annotated[int, typer.Option(min=1, help="worlds to click in")] = 5,
    anywhere: Annotated[int, typer.Option(min=0, help="clicks anywhere, of each world")] = 16,
    seed: Annotated[int, typer.Option(help="of the first world")] = 700,
    write: Write = None,
    json: Json = None,
) -> None:
    """Click on things and on people, and print what the robot made of it."""
    cv2.setNumThreads(1)
    outcomes = list(played(load_stack("pixels", None), worlds, anywhere, seed))
    publish(clicks_table(outcomes) + "\n" + claims_table(outcomes), write, "empty clicks")
    empty = [one for one in outcomes if one.aim != "person"]
    count = partial(Figure, unit="of " + str(len(empty)), against="0", ratio=None, runs=1)
    figures = [
        count("empty-clicks/driven", float(sum(one.driven for one in empty))),
        count("empty-clicks/box-on-nothing", float(sum(one.box_on_nothing for one in empty))),
    ]
    write_json(figures, json)


if __name__ == "__main__":
    run_app(app)
