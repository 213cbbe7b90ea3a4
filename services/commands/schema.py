"""`heel schema`: the JSON Schema of every message, for services in other languages."""

from __future__ import annotations

import json
from typing import Annotated

import typer

from heel.schemas.errors import SettingsError


def schema(
    name: Annotated[
        str | None, typer.Argument(help="one message; all of them if left out", metavar="NAME")
    ] = None,
) -> None:
    """Print the JSON Schema, encoding and size cap of one message or of all."""
    from heel.schemas.export import json_schemas

    schemas = json_schemas()
    if name is None:
        typer.echo(json.dumps(schemas, indent=2))
        return
    if name not in schemas:
        raise SettingsError(f"no message is called {name!r}; known: {', '.join(schemas)}")
    typer.echo(json.dumps(schemas[name], indent=2))
