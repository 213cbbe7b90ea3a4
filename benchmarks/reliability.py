"""Is an identity confidence of 0.9 right nine times of ten, for the default tracker?

An id belongs to the person it is on most often in the first frames that it is on anybody; from then
on it is right while it is on that person. Leave-one-out: beside what was right of the boxes of a
recording that said 0.9 or more stands what the other recordings would have made one expect.

Example run: python -m benchmarks.reliability --write docs/records/identity.md
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import typer

from benchmarks.association_calibration import Claim, claims_of, reliability_table
from benchmarks.common import (
    Figure,
    Json,
    Recordings,
    Write,
    heel_run,
    name_of,
    publish,
    recordings,
    write_json,
)
from heel.evaluation.motchallenge import ground_truth_file, read_ground_truth, read_tracks
from heel.services.runtime.command_line import run_app

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
SURE = 0.9


def claims_on(recording: str) -> list[Claim]:
    """What the default tracker claimed on a recording with ground truth."""
    truth = read_ground_truth(ground_truth_file(Path(recording)))
    with tempfile.TemporaryDirectory() as out:
        heel_run(recording, Path(out), "--in-process")
        return claims_of(truth, read_tracks(Path(out) / "tracks.txt"))


def right_percent(claims: list[Claim]) -> float:
    """Share that was right of what was said with confidence `SURE` or more."""
    right = [was for said, was in claims if said >= SURE]
    return 100.0 * sum(right) / max(len(right), 1)


def left_out_table(claims: dict[str, list[Claim]]) -> str:
    """Markdown: right of what was said surely, by recording and by all the others."""
    lines = [
        f"| recording | said {SURE:g} or more, boxes | right, % | the others, % |",
        "|---|---|---|---|",
    ]
    for name, some in claims.items():
        others = [claim for other, theirs in claims.items() if other != name for claim in theirs]
        sure = sum(said >= SURE for said, _ in some)
        lines.append(
            f"| {name} | {sure} | {right_percent(some):.1f} | {right_percent(others):.1f} |"
        )
    return "\n".join(lines) + "\n"


@app.command()
def main(
    write: Write = None,
    recording: Recordings = None,
    json: Json = None,
) -> None:
    """Print how often ids were right, by the confidence they were given."""
    claims = {name_of(source): claims_on(source) for source in recordings(recording)}
    text = reliability_table(claims) + "\n" + left_out_table(claims)
    publish(text, write, "reliability")
    figures = [
        Figure(f"reliability/{name}", right_percent(some), "%", "90", right_percent(some) / 90.0, 1)
        for name, some in claims.items()
    ]
    write_json(figures, json)


if __name__ == "__main__":
    run_app(app)
