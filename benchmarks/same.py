"""What detector, tracker and follower make of everything there is: does it still come out the same?

Plays recordings, drawn scenes and episodes (`same_cases.py`), hashes the rows that each leaves, and
compares with `same.txt`. A change that is meant to change no figures is proved by it; one that is
meant to says in its commit what moved, and renews the file (`--renew`, for the cases played).

The promise: the same source gives the same bytes on the same machine and versions, in any order of
cases and on any number of processes. Rows have two decimals of a pixel, three of a confidence and
four of a velocity (m/s, rad/s), which hides most last digits; but a last digit can decide which of
two people a box is given to, and last digits differ between processors (vector instructions) and
versions of libraries. So the file says what it was made on, and nothing else is compared with it.
Elsewhere two commits are compared with each other:

    python -m benchmarks.same --out /tmp/before        (at the commit before)
    python -m benchmarks.same --out /tmp/after --against /tmp/before

This names the first line of each file that differs, too.

Example run: make same (short: make same-short)
"""

from __future__ import annotations

import difflib
import hashlib
import itertools
import os
import platform
import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import as_completed
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
import typer

from benchmarks.common import data_folder
from benchmarks.same_cases import FILES, MODEL_FRAMES, MOST_FRAMES, Case, all_cases
from heel.schemas.errors import HeelError, SettingsError
from heel.services.loops.scenarios.parallel import workers
from heel.services.runtime.command_line import run_app
from heel.services.runtime.settings import ENVIRONMENT_PREFIX

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
KEPT = Path(__file__).with_suffix(".txt")
_LONGEST_S = 3 * 3600.0
_DIGITS = 16
_MADE_ON = "# made on: "
_HEAD = f"""\
# What `make same` compares with: hash, rows and name of every file that a case leaves.
# Renew with `python -m benchmarks.same --renew`, with --short or --only NAME for some of them.
# Of recordings the first {MOST_FRAMES} frames are played, boxes from files whole; with a network
# the first {MODEL_FRAMES}.
# Left out: episodes on rendered pictures, which take minutes each; live runs, which depend on time;
# lossless runs through the processes, which equal these byte for byte (tests/integration).
"""


@dataclass(frozen=True)
class Rows:
    """One file of a case: the first digits of its SHA-256, and its number of lines."""

    digest: str
    count: int


Files = Mapping[str, Rows]
"""By name: that of the case, a slash and that of the file."""


@dataclass(frozen=True)
class Kept:
    """What is compared with: the file of hashes, or the folder of another run.

    Attributes:
        made_on: versions and machine, as `this_machine`; empty for a folder.
    """

    files: dict[str, Rows] = field(default_factory=dict)
    made_on: str = ""


@dataclass(frozen=True)
class Played:
    """A case that was played: what it left, or what went wrong."""

    name: str
    files: dict[str, Rows]
    seconds: float
    error: str = ""


def this_machine() -> str:
    """All that figures may depend on beside the source: versions of libraries, the processor."""
    python = ".".join(platform.python_version_tuple()[:2])
    versions = {"python": python, "numpy": np.__version__, "opencv": cv2.__version__}
    for name in ("scipy", "onnx", "onnxruntime", "av"):
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            versions[name] = "none"
    listed = ", ".join(f"{name} {version}" for name, version in versions.items())
    features = cv2.getCPUFeaturesLine().replace("*", "")
    return f"{listed}, {platform.machine()} {_processor()} {features}"


def _processor() -> str:
    """Maker and model of the processor, by which libraries choose their kernels.

    Two kinds with the same features, as OpenCV lists them, differed in the last digits of 10 of 89
    cases: OpenBLAS took other kernels.
    """
    wanted = ("vendor_id", "cpu family", "model", "CPU implementer", "CPU part")
    with suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text(errors="replace").partition("\n\n")[0].splitlines()
        said = {key.strip(): value.strip() for key, _, value in (x.partition(":") for x in lines)}
        return "/".join(said[key] for key in wanted if key in said)
    return "unknown"


def read_kept(file: Path) -> Kept:
    """The file of hashes; an empty one if there is none.

    Raises:
        HeelError: a line of it is malformed.
    """
    if not file.exists():
        return Kept()
    files, made_on = {}, ""
    for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1):
        if line.startswith(_MADE_ON):
            made_on = line.removeprefix(_MADE_ON)
        elif line and not line.startswith("#"):
            try:
                digest, count, name = line.split()
                files[name] = Rows(digest, int(count))
            except ValueError:
                raise HeelError(
                    f"{file}:{number}: {line!r} is not `hash rows name`: take that line from the "
                    "history, or renew it"
                ) from None
    return Kept(files, made_on)


def write_kept(file: Path, kept: Kept) -> None:
    """Write the file of hashes."""
    width = max((len(str(rows.count)) for rows in kept.files.values()), default=1)
    lines = [
        f"{rows.digest} {rows.count:{width}d} {name}\n"
        for name, rows in sorted(kept.files.items())
    ]  # fmt: skip
    file.write_text("".join([_HEAD, _MADE_ON, kept.made_on, "\n", *lines]), encoding="utf-8")


def check_renewal(kept: Kept, cases: Iterable[Case]) -> None:
    """See that hashes of two machines do not get into one file.

    Raises:
        SettingsError: some would stay that were made elsewhere.
    """
    stay = {case_of(name) for name in kept.files} - {case.name for case in cases}
    if stay and kept.made_on != this_machine():
        raise SettingsError(f"{other_machine(kept.made_on)}: renew all cases, or none")


def renewed(kept: Kept, played: Played) -> Kept:
    """What is kept, with a case's files in the place of what it left before.

    Raises:
        HeelError: it failed.
    """
    if played.error:
        raise HeelError(f"{played.name}: {played.error}: not renewed")
    others = {name: rows for name, rows in kept.files.items() if case_of(name) != played.name}
    return Kept(others | played.files, this_machine())


def rows_in(folder: Path, case: str) -> dict[str, Rows]:
    """The files that a case has left in a run's folder."""
    found = {}
    for name in FILES:
        path = folder / case / name
        if path.is_file():
            content = path.read_bytes()
            digest = hashlib.sha256(content).hexdigest()[:_DIGITS]
            found[f"{case}/{name}"] = Rows(digest, content.count(b"\n"))
    return found


def case_of(file: str) -> str:
    """The case that a file belongs to."""
    return file.rpartition("/")[0]


def moved(kept: Files, played: Played) -> list[str]:
    """What is not as it was, a line a file; empty if nothing has moved, or nothing is kept."""
    if played.error:
        return [f"{played.name}: {played.error}"]
    before = {name: rows for name, rows in kept.items() if case_of(name) == played.name}
    if not before:
        return []
    lines = []
    for name in sorted({*before, *played.files}):
        was, now = before.get(name), played.files.get(name)
        if was is None or now is None:
            lines.append(f"{name}: {'new' if was is None else 'gone'}")
        elif was != now:
            rows = f"{now.count} rows" + (f", was {was.count}" * (was.count != now.count))
            lines.append(f"{name}: moved ({rows})")
    return lines


def first_difference(before: Path, after: Path) -> str:
    """The first line in which two text files differ; empty if none does."""
    with before.open(encoding="utf-8") as one, after.open(encoding="utf-8") as other:
        for number, (was, now) in enumerate(itertools.zip_longest(one, other), 1):
            if was != now:
                said = ("the end" if text is None else text.rstrip("\n") for text in (now, was))
                return "line {}: {}\n    was: {}".format(number, *said)
    return ""


def other_machine(made_on: str) -> str:
    """Says that hashes are those of another machine or other versions."""
    return f"{KEPT.name} was made on [{made_on}], and this is [{this_machine()}]"


def chosen(cases: Sequence[Case], names: Sequence[str], short: bool) -> list[Case]:
    """The cases asked for: by name, by the first parts of names, or the short form.

    Raises:
        SettingsError: nothing has such a name.
    """
    for name in names:
        if not any(_is_meant(case, name) for case in cases):
            names_of = {part for case in cases for part in _beginnings(case.name)}
            near = difflib.get_close_matches(name, sorted(names_of), n=3, cutoff=0.5)
            meant = f"; did you mean {' or '.join(near)}?" if near else ""
            raise SettingsError(
                f"--only {name}: no case of that name, with the recordings in {data_folder()}"
                f"{meant or '; --list prints them all'}"
            )
    found = [case for case in cases if not names or any(_is_meant(case, name) for name in names)]
    return [case for case in found if case.short or not short]


def _beginnings(name: str) -> Iterator[str]:
    return itertools.accumulate(name.split("/"), "{}/{}".format)


def _is_meant(case: Case, name: str) -> bool:
    return f"{case.name}/".startswith(f"{name.strip('/')}/")


def play_all(cases: Sequence[Case], jobs: int, out: Path) -> Iterator[Played]:
    """Play cases on several processes; yields them as they end.

    Raises:
        HeelError: a process died, or three hours are over.
    """
    with workers(min(jobs, len(cases)), _forget_settings) as pool:
        futures = [pool.submit(play, case, out) for case in cases]
        try:
            for future in as_completed(futures, timeout=_LONGEST_S):
                yield future.result()
        except TimeoutError:
            raise HeelError(
                f"not done after {_LONGEST_S:g} s: --only NAME finds what hangs"
            ) from None


def _forget_settings() -> None:
    """Settings of the user's own must not reach the cores."""
    for name in [name for name in os.environ if name.startswith(ENVIRONMENT_PREFIX)]:
        del os.environ[name]


def play(case: Case, out: Path) -> Played:
    """Play one case into its folder in `out`; whatever fails is told, not raised."""
    started_s = time.monotonic()
    folder, error = out / case.name, ""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name in FILES:
            (folder / name).unlink(missing_ok=True)
        case.play(folder)
        # It holds times, and a run is to be compared with another by `diff -r`.
        (folder / "summary.json").unlink(missing_ok=True)
    except Exception as raised:
        error = (
            str(raised) if isinstance(raised, HeelError) else f"{type(raised).__name__}: {raised}"
        )
    return Played(case.name, rows_in(out, case.name), time.monotonic() - started_s, error)


def _word(one: Played, kept: Files | None) -> str:
    if one.error:
        return "FAILED"
    if kept is None:
        return "played"
    if not any(case_of(name) == one.name for name in kept):
        return "new"
    return "MOVED" if moved(kept, one) else "same"


def _told(lines: Sequence[str], against: Path | None, out: Path) -> Iterator[str]:
    """What is said of a case that is not as it was."""
    for line in lines:
        yield line
        name = line.partition(":")[0]
        if against is not None and (against / name).is_file() and (out / name).is_file():
            yield f"  {first_difference(against / name, out / name)}"


_Only = Annotated[
    list[str] | None,
    typer.Option(help="this case, or all whose names begin so: drawn/demo", metavar="NAME"),
]


@app.command()
def main(
    only: _Only = None,
    short: Annotated[bool, typer.Option("--short", help="drawn scenes and one episode")] = False,
    renew: Annotated[bool, typer.Option("--renew", help="keep what the cases leave now")] = False,
    out: Annotated[
        Path | None, typer.Option(help="leave the rows of this run here", metavar="DIR")
    ] = None,
    against: Annotated[
        Path | None,
        typer.Option(help="compare with a run's --out, not with the kept hashes", metavar="DIR"),
    ] = None,
    jobs: Annotated[int, typer.Option(min=1, max=64, help="processes")] = 2,
    listed: Annotated[bool, typer.Option("--list", help="print the names and end")] = False,
) -> None:
    """Play everything there is, and name what is not as it was."""
    every = all_cases()
    cases = chosen(every, only or [], short)
    if listed:
        typer.echo("\n".join(case.name for case in cases))
        return
    if against is not None and (renew or not against.is_dir() or against == out):
        raise SettingsError(f"--against {against}: give the folder of another run, and no --renew")
    kept = read_kept(KEPT)
    here = kept.made_on == this_machine()
    if against is not None:
        files = [rows_in(against, case.name) for case in every]
        kept, here = Kept({name: rows for one in files for name, rows in one.items()}), True
    elif renew:
        check_renewal(kept, cases)
        kept = kept if here else Kept()
    elif not here and out is None:
        raise HeelError(
            f"{other_machine(kept.made_on)}: compare two commits here, one with --out DIR and the "
            "other with --against DIR"
        )
    before = kept.files if here else None
    lines: list[str] = []
    new: list[str] = []
    failed = False
    with tempfile.TemporaryDirectory() as scratch:
        folder = out or Path(scratch)
        for one in _with_progress(cases, jobs, folder, before):
            failed |= bool(one.error)
            if before is not None or one.error:
                lines += _told(moved(before or {}, one), against, folder)
                new += [one.name] if _word(one, before) == "new" else []
            if renew and not one.error:
                # After each case: what was played before an interruption is not lost.
                kept = renewed(kept, one)
                write_kept(KEPT, kept)
    absent = sorted({case_of(name) for name in kept.files} - {case.name for case in every})
    if absent:
        typer.echo(f"not played, for they are not here: {', '.join(absent)}")
    if new and not renew:
        typer.echo(f"nothing to compare with, --renew keeps them: {', '.join(new)}")
    if not here and not renew:
        lines.append(f"{other_machine(kept.made_on)}: not compared; the rows are in {out}")
    typer.echo("\n".join(lines) or f"{len(cases) - len(new)} cases: nothing has moved")
    if failed or (here and lines and not renew):
        raise typer.Exit(1)


def _with_progress(
    cases: Sequence[Case], jobs: int, out: Path, before: Files | None
) -> Iterator[Played]:
    """Play cases, with a line about each and the time in all."""
    started_s = time.monotonic()
    for number, one in enumerate(play_all(cases, jobs, out), 1):
        word = _word(one, before)
        typer.echo(f"[{number}/{len(cases)}] {one.name}: {word}, {one.seconds:.1f} s")
        yield one
    typer.echo(f"{len(cases)} cases in {time.monotonic() - started_s:.0f} s")


if __name__ == "__main__":
    run_app(app)
