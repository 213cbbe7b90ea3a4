"""What `heel scenarios` prints."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from made_episodes import scores
from rich.console import Console

from heel.schemas import HeelError
from heel.services.loops.scenarios.results import (
    EpisodeResult,
    field_table,
    make_report,
    report_table,
    write_episodes,
)

RESULTS = [
    EpisodeResult(scenario="straight", seed=7, scores=scores()),
    EpisodeResult(scenario="twin", seed=7, scores=scores(following_rate=0.5, wrong_time=0.1)),
]
SCORES = {
    "episodes", "sr", "tr", "cr", "s", "spl", "f", "wrong_time", "space_1m", "jerk_p95",
    "longest_loss_s", "min_distance_m", "driven_to_m", "follow_bench_sr", "returns",
}  # fmt: skip


def test_json_has_the_agreed_fields() -> None:
    report = json.loads(make_report(RESULTS, 7, "simulated boxes", wall_s=6.0).model_dump_json())

    assert set(report) == {
        "episodes", "seed", "mode", "through", "ranges", "calibrated", "depth", "real_time_factor",
        "overall", "scenarios",
    }  # fmt: skip
    assert (report["episodes"], report["mode"]) == (2, "simulated boxes")
    assert report["real_time_factor"] == pytest.approx(10.0)
    assert set(report["overall"]) == SCORES
    assert set(report["scenarios"]) == {"straight", "twin"}
    assert report["overall"]["f"] == pytest.approx(0.75)
    assert report["scenarios"]["twin"]["wrong_time"] == pytest.approx(0.1)


def test_the_table_names_the_mode_and_fits_80_characters() -> None:
    console = Console(width=80, record=True)
    console.print(report_table(make_report(RESULTS, 7, "simulated boxes", wall_s=6.0)))
    lines = console.export_text().splitlines()

    assert [line.split()[0] for line in lines if line.strip()][2:4] == ["straight", "twin"]
    assert any(line.strip().startswith("overall") for line in lines)
    assert "simulated boxes, through cores: 2 episodes from seed 7, 10.0 times" in " ".join(lines)


def test_losses_of_all_episodes_are_summed_up_in_a_second_table() -> None:
    report = make_report(RESULTS, 7, "simulated boxes", wall_s=6.0)
    console = Console(width=80, record=True)
    console.print(field_table(report))

    rows = [line.split() for line in console.export_text().splitlines()]
    assert ["overall", "1.00", *["0/0/0"] * 4, "2", "100", "2.5", "2.5"] in rows
    assert (report.overall.returns.losses, report.overall.returns.recovered) == (2, 2)


def test_every_episode_becomes_a_line_that_names_the_mode(tmp_path: Path) -> None:
    path = tmp_path / "new" / "episodes.jsonl"

    write_episodes(RESULTS, "simulated boxes", path)

    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert [(line["scenario"], line["mode"]) for line in lines] == [
        ("straight", "simulated boxes"), ("twin", "simulated boxes"),
    ]  # fmt: skip


def test_a_folder_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")

    with pytest.raises(HeelError, match="cannot be written"):
        write_episodes(RESULTS, "simulated boxes", tmp_path / "file" / "episodes.jsonl")
