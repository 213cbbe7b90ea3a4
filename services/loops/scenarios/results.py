"""What a set of episodes is worth: per scenario and overall, as a table and as JSON."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field
from rich.box import SIMPLE_HEAD
from rich.table import Table

from heel.evaluation.following.episode_scores import EpisodeScores, FollowingScores, summarise
from heel.evaluation.returns import RETURNS_CAPTION, RETURNS_COLUMNS, returns_cells
from heel.schemas.errors import HeelError
from heel.services.loops.scenarios.perception import EVERYTHING, Senses

Mode = Literal["pixels", "simulated boxes"]
Through = Literal["cores", "processes"]


class EpisodeResult(BaseModel):
    """One episode that was run."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    scenario: str
    seed: int = Field(ge=0, description="of this episode's world")
    scores: EpisodeScores


class ScenarioReport(BaseModel):
    """The scores of all episodes; what `heel scenarios --json` prints."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    episodes: int = Field(ge=1, description="how many")
    seed: int = Field(ge=0, description="of the first world of each scenario; others count up")
    mode: Mode = Field(description="simulated boxes: without detector, never the full stack")
    through: Through = Field(description="cores on a simulated clock, or processes in real time")
    ranges: bool = Field(description="whether the robot has range sensors")
    calibrated: bool = Field(description="whether the camera's mounting is known")
    depth: bool = Field(description="whether the camera measures depth")
    real_time_factor: float = Field(gt=0, description="simulated seconds per second of the run")
    overall: FollowingScores
    scenarios: dict[str, FollowingScores] = Field(description="by name")


def make_report(
    results: Sequence[EpisodeResult],
    seed: int,
    mode: Mode,
    wall_s: float,
    through: Through = "cores",
    senses: Senses = EVERYTHING,
) -> ScenarioReport:
    """Sum up what was run.

    Raises:
        HeelError: nothing was run.
    """
    by_scenario: dict[str, list[EpisodeScores]] = {}
    for result in results:
        by_scenario.setdefault(result.scenario, []).append(result.scores)
    overall = summarise([result.scores for result in results])
    return ScenarioReport(
        episodes=len(results),
        seed=seed,
        mode=mode,
        through=through,
        ranges=senses.ranges,
        calibrated=senses.calibrated,
        depth=senses.depth,
        real_time_factor=sum(result.scores.duration_s for result in results) / wall_s,
        overall=overall,
        scenarios={name: summarise(scores) for name, scores in by_scenario.items()},
    )


_COLUMNS = (
    "n", "SR", "TR", "CR", "S", "SPS", "F", "wrong%", "1m%", "jerk", "loss s", "min m",
)  # fmt: skip


def write_episodes(results: Sequence[EpisodeResult], mode: Mode, path: Path) -> None:
    """Write one JSON object a line: an episode and its scores.

    Raises:
        HeelError: the file cannot be written.
    """
    lines = [json.dumps({"mode": mode, **result.model_dump(mode="json")}) for result in results]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("\n".join(lines) + "\n")
    except OSError as error:
        raise HeelError(f"{path}: cannot be written ({error.strerror})") from error


def report_table(report: ScenarioReport) -> Table:
    """A table for the terminal: one row per scenario and one overall."""
    return _table(report, _COLUMNS, _cells, _caption(report))


def field_table(report: ScenarioReport) -> Table:
    """Likewise, of people who are out of sight for a while."""
    return _table(report, ("FB", *RETURNS_COLUMNS), _field_cells, RETURNS_CAPTION)


def _table(
    report: ScenarioReport, titles: Sequence[str],
    cells: Callable[[FollowingScores], list[str]], caption: str,
) -> Table:  # fmt: skip
    table = Table(
        box=SIMPLE_HEAD, padding=0, pad_edge=False, caption=caption, caption_justify="left"
    )
    table.add_column("scenario", no_wrap=True)
    for title in titles:
        table.add_column(title, justify="right", no_wrap=True)
    for name, scores in report.scenarios.items():
        table.add_row(name, *cells(scores))
    table.add_section()
    table.add_row("overall", *cells(report.overall))
    return table


def _field_cells(scores: FollowingScores) -> list[str]:
    return [f"{scores.follow_bench_sr:.2f}", *returns_cells(scores.returns)]


def _cells(scores: FollowingScores) -> list[str]:
    fractions = (scores.sr, scores.tr, scores.cr, scores.s, scores.spl, scores.f)
    return [
        str(scores.episodes),
        *(f"{value:.2f}" for value in fractions),
        f"{100 * scores.wrong_time:.2f}",
        f"{100 * scores.space_1m:.1f}",
        f"{scores.jerk_p95:.1f}",
        f"{scores.longest_loss_s:.1f}",
        f"{scores.min_distance_m:.2f}",
    ]


def _caption(report: ScenarioReport) -> str:
    senses = Senses(report.ranges, report.calibrated, report.depth)
    but = "" if senses == EVERYTHING else f", {senses}"
    return (
        f"{report.mode}, through {report.through}{but}: {report.episodes} episodes from seed "
        f"{report.seed}, {report.real_time_factor:.1f} times real time"
    )
