"""`heel security`: certificates or passwords for everything on the robot's bus, and its rules."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

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
    from heel.services.security.accounts import new_password
    from heel.services.security.folder import PAGE_CERTIFICATE, PAGE_USERS, SecurityFolder

    cameras = tuple(chunk(name, "--camera") for name in camera or ["front"])
    made = SecurityFolder.create(
        folder, "password" if passwords else "certificate", tuple(host or ()), namespace, cameras,
        days,
    )  # fmt: skip
    password = new_password()
    made.set_login("operator", "operate", password)
    for line in _described(made):
        typer.echo(line)
    typer.echo("now, each in its own terminal or container:")
    typer.echo(f"  heel router --config-file {folder / 'router.json5'}")
    typer.echo(f"  heel detector --config-file {folder / 'detector.json5'}   # and so on")
    typer.echo(f"  heel status --config-file {folder / 'operator.json5'}")
    typer.echo(
        f"  heel web --config-file {folder / 'web.json5'} --host 0.0.0.0 "
        f"--users-file {folder / PAGE_USERS} --certificate {folder / PAGE_CERTIFICATE}"
    )
    typer.echo(f"on the page, name operator, password {password} (not shown again)")


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
def login(
    folder: _Folder,
    name: Annotated[str, typer.Argument(help="that is typed on the page", metavar="NAME")],
    role: Annotated[
        Literal["watch", "operate", "nobody"],
        typer.Option(help="what the page lets them do; nobody: not even log in"),
    ],
    password_file: Annotated[
        Path | None,
        typer.Option(
            help="file that holds the password [default: it is asked for]", metavar="FILE"
        ),
    ] = None,
) -> None:
    """Let somebody log in on the page, or change their role or password."""
    from heel.schemas.errors import SettingsError
    from heel.schemas.keys import chunk

    made, name = _opened(folder), chunk(name)
    if role == "nobody":
        made.remove_login(name)
        typer.echo(f"{name} may not log in any more: start the page again to end what is open")
        return
    if password_file is None:
        password = typer.prompt("password", hide_input=True, confirmation_prompt=True)
    else:
        try:
            password = password_file.read_text(encoding="utf-8").strip()
        except (OSError, UnicodeDecodeError) as error:
            raise SettingsError(f"password file {password_file}: {error}") from None
    made.set_login(name, role, password)
    typer.echo(f"{name} may log in on the page, role {role}")


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
