"""What every benchmark shares: running `heel run`, interleaving, medians, and the JSON report."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer

from heel.schemas.errors import HeelError

REPOSITORY = Path(__file__).resolve().parent.parent
STATIC_SEQUENCES = (
    "PETS09-S2L1", "PETS09-S3MF1", "TUD-Campus", "TownCentre-A", "TownCentre-B", "TownCentre-C",
)  # fmt: skip
_RUN_TIMEOUT_S = 900
_POLL_S = 0.02
"""Processes are asked so often whether they have come so far: 50 times a second costs nothing."""

NAMED_NETWORKS = {"HEEL_DETECTOR__MODEL": "none"}
"""Environment of what is measured: a flag may name a network; one that happens to be there counts
for nothing."""

T = TypeVar("T")

Json = Annotated[Path | None, typer.Option(help="write the figures here")]
Write = Annotated[Path | None, typer.Option(help="file whose tables are replaced")]
Recordings = Annotated[list[str] | None, typer.Option(help="measure these instead")]


@dataclass(frozen=True)
class Figure:
    """One measured figure; `ratio` is `value` divided by the value it is compared with."""

    name: str
    value: float
    unit: str
    against: str
    ratio: float | None
    runs: int


def wait_for(look: Callable[[], T], within_s: float, complaint: str) -> T:
    """What `look` finds, once that is true.

    Raises:
        HeelError: it is not within so many seconds.
    """
    deadline_s = time.monotonic() + within_s
    while not (found := look()):
        if time.monotonic() > deadline_s:
            raise HeelError(f"{complaint} within {within_s:g} s")
        time.sleep(_POLL_S)
    return found


def data_folder() -> Path:
    """The evaluation recordings: `HEEL_DATA`, by default `../shared/data` beside the project."""
    return Path(os.environ.get("HEEL_DATA", REPOSITORY.parent / "shared" / "data"))


def recordings(chosen: Sequence[str] | None = None) -> list[str]:
    """Sources to measure on: the chosen ones, or the static recordings that are here.

    Args:
        chosen: drawn scenes, paths, or names of recordings in the data folder.

    Raises:
        HeelError: none is there, or one of the chosen is not.
    """
    if chosen:
        return [_found(source) for source in chosen]
    found = [data_folder() / name for name in STATIC_SEQUENCES]
    found = [path for path in found if path.is_dir()]
    if not found:
        raise HeelError(f"no recordings in {data_folder()}: set HEEL_DATA to their folder")
    return [str(path) for path in found]


def _found(source: str) -> str:
    if source.startswith("scene:") or Path(source).exists():
        return source
    if (data_folder() / source).is_dir():
        return str(data_folder() / source)
    raise HeelError(f"--recording {source}: neither a path nor in {data_folder()}")


def name_of(source: str) -> str:
    """What a table calls a source."""
    return source if source.startswith("scene:") else Path(source).name


def heel_run(source: str, out: Path, *flags: str) -> dict[str, Any]:
    """Run `heel run` in a process of its own and return its summary.

    Raises:
        HeelError: it failed.
    """
    done = subprocess.run(
        [sys.executable, "-m", "heel", "run", source, "--out", str(out), *flags],
        capture_output=True, text=True, timeout=_RUN_TIMEOUT_S, check=False,
        env=os.environ | NAMED_NETWORKS,
    )  # fmt: skip
    if done.returncode != 0:
        raise HeelError(f"heel run {source}: {done.stderr.strip() or done.stdout.strip()}")
    summary: dict[str, Any] = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    return summary


def interleaved(runs: int, *candidates: Callable[[], float]) -> list[list[float]]:
    """Measure candidates in turn, so that whatever else the machine does hits all of them alike."""
    values: list[list[float]] = [[] for _ in candidates]
    for turn in range(runs):
        order = list(enumerate(candidates))
        for index, candidate in order if turn % 2 == 0 else reversed(order):
            values[index].append(candidate())
    return values


def median(values: Sequence[float]) -> float:
    """The median, which one disturbed run does not move."""
    return statistics.median(values)


def write_json(figures: Sequence[Figure], file: Path | None) -> None:
    """Write the figures as a JSON list, if a file was asked for."""
    if file is not None:
        text = json.dumps([asdict(figure) for figure in figures], indent=2)
        file.write_text(text + "\n", encoding="utf-8")


def publish(text: str, document: Path | None, name: str = "scores") -> None:
    """Print a table, and put it between the two marks of that name in a document, if one is given.

    Raises:
        HeelError: the document cannot be read or written.
    """
    typer.echo(text)
    if document is None:
        return
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    try:
        head, _, rest = document.read_text("utf-8").partition(begin)
        _, _, tail = rest.partition(end)
        document.write_text(f"{head}{begin}\n{text}{end}{tail}", encoding="utf-8")
    except OSError as error:
        raise HeelError(f"{document}: {error.strerror}: give a document that exists") from None
