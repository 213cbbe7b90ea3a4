"""What each idea of the default adds: every recording without it, beside the default.

Protocol as in `benchmarks.accuracy`. A calibration file is used where `--calibration` names one for
recordings whose name begins with the same word, as the data set's does.

Example run: python -m benchmarks.ablation --write docs/records/results.md
"""

from __future__ import annotations

import typer

from benchmarks.accuracy import measure
from benchmarks.common import (
    Figure,
    Json,
    Recordings,
    Write,
    data_folder,
    name_of,
    publish,
    recordings,
    write_json,
)
from heel.services.runtime.command_line import run_app

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
CALIBRATION = data_folder() / "TownCentre-GT-first-half" / "TownCentre-calibration.ci"
VARIANTS = {
    "default": "",
    "without looks (identify)": "[tracker]\nidentify = false\n",
    "people learned as background (protect)": "[detector]\nprotect = false\n",
    "without the search for ghosts (dissolve_ghosts)": "[detector]\ndissolve_ghosts = false\n",
    "first frame is background (startup_s)": "[detector]\nstartup_s = 0.0\n",
}
"""What is changed, and how."""
WITH_CALIBRATION = "scale from a calibration file (calibration)"
_COLUMNS = ("keep", "wrong", "mota", "idf1", "idsw")


def variants_of(recording: str) -> dict[str, str]:
    """Settings to run a recording with, by name."""
    known = CALIBRATION.is_file() and name_of(recording).startswith(CALIBRATION.name.split("-")[0])
    given = {WITH_CALIBRATION: f'[tracker]\ncalibration = "{CALIBRATION}"\n'} if known else {}
    return VARIANTS | given


@app.command()
def main(
    write: Write = None,
    recording: Recordings = None,
    json: Json = None,
) -> None:
    """Score the default and the default without each idea."""
    lines = [
        "| recording | changed | keep% | wrong% | MOTA | IDF1 | IDsw | ms/frame |",
        "|" + "---|" * 8,
    ]
    figures = []
    for source in recordings(recording):
        for name, settings in variants_of(source).items():
            scores, milliseconds = measure(source, settings=settings)
            values = (getattr(scores, column) for column in _COLUMNS)
            cells = [f"{value:.1f}" if isinstance(value, float) else str(value) for value in values]
            lines.append(
                "| " + " | ".join((scores.sequence, name, *cells, f"{milliseconds:.1f}")) + " |"
            )
            typer.echo(lines[-1], err=True)
            figures.append(
                Figure(f"ablation/{scores.sequence}/{name}/mota", scores.mota, "%", "", None, 1)
            )
    text = "\n".join(lines) + "\n"
    publish(text, write, "ablation")
    write_json(figures, json)


if __name__ == "__main__":
    run_app(app)
