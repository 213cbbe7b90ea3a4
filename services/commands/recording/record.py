"""`heel record`: the recorder as a command, with what is done with recordings besides."""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from heel.schemas import HeelError, keys
from heel.services.commands.columns import aligned
from heel.services.commands.robot import RobotFlags, session_with
from heel.services.recorder.settings import RecorderSettings
from heel.services.runtime.command_line import later, settings_command

_SAVED_S = 20.0
"""Longest wait for a file of the last seconds; slow disks take some seconds. Chosen by hand."""
_OWN: dict[str, Any] = {
    "check": Annotated[
        Path | None,
        typer.Option(
            "--check", help="say what is in a recording and what is missing, and end",
            metavar="FILE",
        ),
    ],
    "save": Annotated[
        bool,
        typer.Option("--save", help="have the recorder that runs write its last seconds, and end"),
    ],
    "as_json": Annotated[bool, typer.Option("--json", help="print the check as JSON")],
    "run": Annotated[
        int | None, typer.Option("--run", help="one of several runs here, by its process",
                                 metavar="PID")
    ],
    "robot": Annotated[
        str | None, typer.Option("--robot", help="one of several runs here, by its name",
                                 metavar="NAME")
    ],
}  # fmt: skip


def record_command() -> Callable[..., None]:
    """`heel record`: a flag for each setting of the recorder, and those above."""
    start = settings_command(
        "recorder",
        RecorderSettings,
        later("heel.services.recorder.service"),
        "Record what passes on the bus to MCAP files.",
    )
    settings = list(inspect.signature(start).parameters.values())
    own = [
        inspect.Parameter(
            name, inspect.Parameter.KEYWORD_ONLY, annotation=annotation,
            default=False if name in ("save", "as_json") else None,
        )
        for name, annotation in _OWN.items()
    ]  # fmt: skip

    def record(**values: Any) -> None:
        check, save, as_json, run, robot = (values.pop(name) for name in _OWN)
        if check is not None:
            _check(check, as_json)
            return
        flags = RobotFlags(
            connect=values["connect"], run=run, robot=robot, namespace=values["namespace"],
            user=values["user"], password_file=values["password_file"], config=values["config"],
        )  # fmt: skip
        if save:
            _save(flags)
            return
        if not values["show_config"] and (found := flags.find()).run is not None:
            values["connect"] = found.run.endpoint
        start(**values)

    record.__doc__ = start.__doc__
    parameters = [*own, *settings]
    record.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    record.__annotations__ = {one.name: one.annotation for one in parameters}
    return record


def _check(file: Path, as_json: bool) -> None:
    """Print what is in a recording.

    Raises:
        HeelError: nothing in it can be read.
    """
    from heel.services.commands.recording.checking import check
    from heel.services.recordings.reading import Recording

    found = check(Recording(file))
    if as_json:
        typer.echo(json.dumps(found.as_object(), indent=2))
        return
    if not found.topics:
        raise HeelError(f"{file}: no message of Heel's in it")
    table = [("topic", "messages", "per s", "missing", "undecodable", "MB")]
    for key, one in sorted(found.topics.items()):
        rate = f"{(one.messages - 1) / one.seconds:.1f}" if one.seconds > 0 else "-"
        table.append((key, str(one.messages), rate, str(one.missing), str(one.undecodable),
                      f"{one.bytes / 1e6:.1f}"))  # fmt: skip
    for line in aligned(table, right=frozenset({1, 2, 3, 4, 5})):
        typer.echo(line)
    lost = found.lost_at_end_s
    if found.recording.complete:
        end = "closed by its recorder, nothing is lost at the end"
    else:
        most = "" if lost is None else f"; at most {lost:g} s are lost at the end"
        end = f"cut off ({found.recording.damage or 'without an index'}, {found.cut_bytes} bytes "
        end += f"of it are left out){most}"
    typer.echo(f"{found.seconds:.1f} s by {found.recording.library or 'an unknown writer'}: {end}")


def _save(flags: RobotFlags) -> None:
    """Have the recorder write what it holds.

    Raises:
        HeelError: there is none, or it cannot.
    """
    from heel.services.runtime.asking import EVERY_ANSWER, EVERYBODY, refusal

    with session_with(flags.find()) as session:
        files = []
        for reply in session.get(
            keys.ALL_SAVE, target=EVERYBODY, consolidation=EVERY_ANSWER, timeout=_SAVED_S
        ):
            if (refused := refusal(reply)) is not None:
                raise HeelError(refused)
            if reply.ok is not None:
                files.append(str(json.loads(reply.ok.payload.to_bytes())["file"]))
    if not files:
        raise HeelError("no recorder answers: start one with `heel record --last 60`")
    for file in files:
        typer.echo(file)
