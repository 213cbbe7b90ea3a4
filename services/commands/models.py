"""`heel models`: networks that see people, brought by name, checked, and kept for all commands."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

from heel.schemas.errors import HeelError
from heel.services.models import store
from heel.services.models.catalogue import KNOWN, KnownModel
from heel.services.models.measured import measured
from heel.services.runtime.logs import printable

if TYPE_CHECKING:
    from heel.services.models.download import Progress as Told

app = typer.Typer(
    help="Networks that see people: list them, get one by name, and every command uses it.",
    no_args_is_help=True,
    rich_markup_mode=None,
)

_Name = Annotated[
    str, typer.Argument(help="of the network, see `heel models list`", metavar="NAME")
]
_From = Annotated[
    str | None,
    typer.Option(
        "--from",
        help="in place of its own source: a file or an address of it, or of a wheel or tarball "
        "that holds it",
        metavar="FILE|URL",
    ),
]


@app.command("list")
def list_models() -> None:
    """Say which networks there are, what each is good for, and what it was measured to do."""
    found = measured()
    for model in KNOWN.values():
        state = "not here"
        if store.is_there(model):
            state = "here" if store.damage(model) is None else "here, damaged"
        typer.echo(f"{model.name}  {_size(model)}  {model.licence}  {state}")
        typer.echo(f"    good for   {model.good_for}")
        for line in found.lines(model):
            typer.echo(f"    {line}")
        typer.echo(f"    by         {model.author}")
        typer.echo(f"    from       {model.source}")
        typer.echo(f"    sha256     {model.sha256}")
    typer.echo(f"kept in {printable(str(store.models_folder()))}")
    typer.echo(f"measured: {found.how}")


@app.command()
def get(name: _Name, source: _From = None) -> None:
    """Bring a network, check its hash and keep it; from then on it is used without a flag."""
    # aiohttp takes longer to load than most commands take to run.
    from heel.services.models.fetch import fetch

    model = store.known_model(name)
    there = store.is_there(model) and store.damage(model) is None
    with _bar(model) as progress:
        file = fetch(model, source, progress, lambda line: typer.echo(line, err=True))
    typer.echo(
        f"{name} {'was there already' if there else 'is there, its hash is right'}: "
        f"{printable(str(file))}"
    )
    if model.kind == "people":
        first = store.first_there()
        told = "used" if first == model else f"used with --model {name}"
        typer.echo(f"{told} by heel demo, run and detector" + (
            "" if first == model or first is None else f"; without it they use {first.name}"
        ))  # fmt: skip


@app.command()
def path(name: _Name) -> None:
    """Print the file of a network that is here and whole."""
    typer.echo(store.whole_file(store.known_model(name)))


@app.command()
def remove(name: _Name) -> None:
    """Remove a network and what broken downloads of it have left."""
    from heel.services.models.fetch import leftovers

    model = store.known_model(name)
    file = store.place_of(model)
    there = [one for one in (file, *leftovers(model)) if one.exists()]
    try:
        for one in there:
            one.unlink()
    except OSError as error:
        raise HeelError(f"{error.filename}: {error.strerror}: remove it as its owner") from None
    typer.echo(f"{name} {'removed' if there else 'was not here'}")


@app.command()
def check() -> None:
    """Check the hash of every network that is here; ends with 1 if one is damaged."""
    there = [model for model in KNOWN.values() if store.is_there(model)]
    broken = {model.name: what for model in there if (what := store.damage(model)) is not None}
    for model in there:
        typer.echo(f"{model.name}  {broken.get(model.name, 'ok')}")
    if not there:
        typer.echo(f"none in {store.models_folder()}: `heel models get NAME` brings one")
    if broken:
        raise HeelError(f"damaged: {', '.join(broken)}: `heel models get NAME` brings it anew")


@contextmanager
def _bar(model: KnownModel) -> Iterator[Told]:
    """A bar on a terminal; elsewhere nothing."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        DownloadColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), DownloadColumn(),
               TimeRemainingColumn())  # fmt: skip
    with Progress(*columns, console=console, disable=not sys.stderr.isatty()) as bar:
        task = bar.add_task(model.name, total=None)
        yield lambda there, total: bar.update(task, completed=there, total=total)


def _size(model: KnownModel) -> str:
    return f"{model.size_bytes / 1e6:.1f} MB"
