"""Command-line flags made from settings models, so that no setting is described twice."""

from __future__ import annotations

import errno
import inspect
import json
import os
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, Literal, NoReturn, TypeVar, get_args, get_origin

import typer
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from heel.schemas.errors import HeelError, SettingsError
from heel.services.runtime.logs import printable
from heel.services.runtime.process import leave, open_standard_streams
from heel.services.runtime.settings import (
    ENVIRONMENT_PREFIX,
    Loaded,
    LogSettings,
    ZenohSettings,
    load_settings,
)

S = TypeVar("S", bound=BaseModel)
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EIO)
"""Errors of a disk, or of what standard output is sent to, which are no fault of the command's."""
_SHARED: dict[str, type[BaseModel]] = {"zenoh": ZenohSettings, "log": LogSettings}


def settings_command(
    service: str,
    model: type[S],
    run: Callable[[Loaded[S]], int],
    summary: str,
    shared: tuple[str, ...] = ("zenoh", "log"),
) -> Callable[..., None]:
    """Make a function that typer turns into `heel SERVICE` with a flag per setting.

    A field whose `json_schema_extra` has `positional` becomes an argument; `flag` in it names the
    flag where the field's name does not. Flags of the shared tables keep their table's name where
    they would be ambiguous (`--log-level`).

    Args:
        service: name of the service and of its table in files and the environment.
        model: its settings.
        run: called with the merged settings; returns the exit code.
        summary: help text of the command.
        shared: shared tables that this command has a use for.
    """
    owners: dict[str, tuple[str, str]] = {}
    parameters = [_CONFIG, _PROFILE, _SHOW]
    tables: dict[str, type[BaseModel]] = {
        service: model,
        **{name: _SHARED[name] for name in shared},
    }
    for table, owner in tables.items():
        for name, field in owner.model_fields.items():
            parameter = f"log_{name}" if table == "log" else name
            owners[parameter] = (table, name)
            parameters.append(_parameter(parameter, field))

    def command(**values: Any) -> None:
        config, show = values.pop("config"), values.pop("show_config")
        profile = values.pop("profile")
        flags: dict[str, dict[str, object]] = {}
        for parameter, value in values.items():
            if value is not None:
                table, name = owners[parameter]
                flags.setdefault(table, {})[name] = value
        loaded = load_settings(service, model, flags, config, profile)
        if show:
            typer.echo(json.dumps(loaded.shown(service), indent=2))
            return
        raise typer.Exit(run(loaded))

    command.__doc__ = summary
    command.__name__ = service
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    command.__annotations__ = {p.name: p.annotation for p in parameters}
    return command


def _keyword(name: str, annotation: Any) -> inspect.Parameter:
    return inspect.Parameter(
        name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=annotation
    )


_CONFIG = _keyword(
    "config", Annotated[Path | None, typer.Option(help="settings file (TOML)", metavar="FILE")]
)
_PROFILE = _keyword(
    "profile",
    Annotated[str | None, typer.Option(help="settings for a kind of computer: pi", metavar="NAME")],
)
_SHOW = inspect.Parameter(
    "show_config",
    inspect.Parameter.KEYWORD_ONLY,
    default=False,
    annotation=Annotated[bool, typer.Option("--show-config", help="print the settings and end")],
)


def _parameter(name: str, field: FieldInfo) -> inspect.Parameter:
    default = field.get_default(call_default_factory=True, validated_data={})
    shown = ",".join(map(str, default)) if isinstance(default, tuple) else default
    described = f"{field.description or ''} [default: {shown}]" if shown not in (None, "") else (
        field.description or ""
    )  # fmt: skip
    extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
    if extra.get("positional"):
        argument = typer.Argument(help=described, metavar=name.upper())
        return _keyword(name, Annotated[str | None, argument])
    option = f"--{str(extra.get('flag', name)).replace('_', '-')}"
    if field.annotation is bool:
        flag = f"{option}/--no-{option[2:]}"
        return _keyword(name, Annotated[bool | None, typer.Option(flag, help=described)])
    # Values stay text here: pydantic parses them, so that flags, environment and file give the
    # same errors.
    metavar = _metavar(field.annotation)
    return _keyword(name, Annotated[str | None, typer.Option(option, help=described,
                                                             metavar=metavar)])  # fmt: skip


def _metavar(annotation: Any) -> str:
    choices = get_args(annotation)
    if get_origin(annotation) is Literal:
        return "|".join(map(str, choices))
    for kind in (*choices, annotation):
        if kind in (int, float):
            return "NUMBER"
        if get_origin(kind) is tuple or kind is tuple:
            return "A,B"
    return "TEXT"


def later(module: str) -> Callable[[Loaded[Any]], int]:
    """The `run` function of a service module, imported when it is called.

    `heel --help` and every process import only what they need: OpenCV and aiohttp take longer to
    load than most commands take to run.
    """

    def run(loaded: Loaded[Any]) -> int:
        code: int = import_module(module).run(loaded)
        return code

    return run


def service_app(service: str, model: type[S], summary: str) -> None:
    """Run one service as `python -m heel.services.SERVICE` and end the process."""
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
    app.command()(
        settings_command(service, model, later(f"heel.services.{service}.service"), summary)
    )
    run_process(app)


def run_app(app: typer.Typer) -> None:
    """Run a command line; a `HeelError` becomes one line on standard error and an exit code."""
    try:
        app()
    except HeelError as error:
        sys.stderr.write(f"heel: {printable(str(error))}\n")
        sys.exit(2 if isinstance(error, SettingsError) else 1)
    except OSError as error:
        # A reader that went away (`heel status | head`) ends the command before it comes here.
        if error.errno not in _FULL:
            raise
        sys.stderr.write(f"heel: {error.filename or 'standard output'}: {error.strerror}\n")
        sys.exit(1)


def hide_password() -> None:
    """Start this process anew with `--password` in its environment instead of on its command line.

    All users of the machine can read a command line in `ps`, and only the same one an environment.
    It is to be seen until here, for the time that Python takes to start.
    """
    kept, arguments = [], list(sys.orig_argv[1:])
    password = None
    while arguments:
        argument = arguments.pop(0)
        name, given, value = argument.partition("=")
        if name == "--password" and (given or arguments):
            password = value if given else arguments.pop(0)
        else:
            kept.append(argument)
    if password is not None:
        os.environ[f"{ENVIRONMENT_PREFIX}ZENOH__PASSWORD"] = password
        os.execv(sys.executable, [sys.executable, *kept])


def run_process(app: typer.Typer) -> NoReturn:
    """`run_app` as all that this process is for: it ends with the command."""
    open_standard_streams()
    hide_password()
    try:
        run_app(app)
    except SystemExit as ended:
        leave(ended.code if isinstance(ended.code, int) else 0 if ended.code is None else 1)
    leave(0)
