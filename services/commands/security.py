"""`heel security`: certificates or passwords for everything on the robot's bus, and its rules."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from heel.services.security.folder import SecurityFolder

app = typer.Typer(
    help="Keep strangers out: certificates, passwords and access rules.",
    no_args_is_help=True,
    rich_markup_mode=None,
)

_Folder = Annotated[Path, typer.Argument(help="made by `heel security init`", metavar="DIR")]
_Name = Annotated[str, typer.Argument(help="of the member", metavar="NAME")]


@app.command()
def init(
    folder: Annotated[Path, typer.Argument(help="new folder, keys included", metavar="DIR")],
    host: Annotated[
        list[str] | None,
        typer.Option(
            help="further name or address by which the robot is reached; may come again",
            metavar="NAME",
        ),
    ] = None,
    camera: Annotated[
        list[str] | None,
        typer.Option(help="name of a camera [default: front]; may come again", metavar="NAME"),
    ] = None,
    namespace: Annotated[
        str, typer.Option(help="robot's name before every key", metavar="NAME")
    ] = "",
    days: Annotated[
        int, typer.Option(help="that a certificate is valid", min=1, max=3650, metavar="N")
    ] = 730,
    passwords: Annotated[
        bool,
        typer.Option(
            "--passwords", help="passwords in place of certificates: nothing is encrypted then"
        ),
    ] = False,
) -> None:
    """Make a file of Zenoh's for the router, every service and one operator.

    The router then lets nobody else in, and each of them do only what its role needs.
    """
    from heel.schemas.keys import chunk
    from heel.services.security.folder import SecurityFolder

    cameras = tuple(chunk(name, "--camera") for name in camera or ["front"])
    made = SecurityFolder.create(
        folder, "password" if passwords else "certificate", tuple(host or ()), namespace, cameras,
        days,
    )  # fmt: skip
    for line in _described(made):
        typer.echo(line)
    typer.echo("now, each in its own terminal or container:")
    typer.echo(f"  heel router --config-file {folder / 'router.json5'}")
    typer.echo(f"  heel detector --config-file {folder / 'detector.json5'}   # and so on")
    typer.echo(f"  heel status --config-file {folder / 'operator.json5'}")


@app.command()
def add(
    folder: _Folder,
    name: _Name,
    role: Annotated[
        str, typer.Option(help="operate, watch, sensor, or a service's name", metavar="ROLE")
    ],
) -> None:
    """Let another member in: a person, a program, or a service a second time."""
    from heel.schemas.keys import chunk

    file = _opened(folder).add(chunk(name), role)
    typer.echo(f"{file}: keep it secret; start the router again to let {name} in")


@app.command()
def remove(folder: _Folder, name: _Name) -> None:
    """Let a member in no longer, whatever copies of its file there are."""
    _opened(folder).remove(name)
    typer.echo(f"{name} has no rights any more: start the router again")


@app.command()
def renew(folder: _Folder) -> None:
    """Make every certificate or password anew, before they run out or after one was lost."""
    made = _opened(folder)
    made.renew()
    for line in _described(made):
        typer.echo(line)
    typer.echo("copies on other hosts have to be replaced; start router and services again")


@app.command()
def show(folder: _Folder) -> None:
    """Say who the members are, what each may do, and when certificates end."""
    for line in _described(_opened(folder)):
        typer.echo(line)


def _opened(folder: Path) -> SecurityFolder:
    from heel.services.security.folder import SecurityFolder

    return SecurityFolder(folder)


def _described(made: SecurityFolder) -> list[str]:
    from heel.services.security.roles import ROLES

    lines = [f"{made.folder}: by {made.members.by}"]
    width = max(map(len, made.members.roles), default=0)
    for name, role in made.members.roles.items():
        told = ROLES[role].purpose
        lines.append(f"  {name:{width}}  {told if role == name else f'{role}: {told}'}")
    ends = list(made.ends())
    if ends:
        file, end = ends[0]
        left = round((end - datetime.datetime.now(datetime.UTC)) / datetime.timedelta(days=1))
        lines.append(f"certificates end from {end:%Y-%m-%d} on ({file}, in {left} days)")
    return lines
