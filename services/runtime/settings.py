"""Settings: profile < file < environment < flags, checked, unknown keys refused by name.

A settings file is TOML with one table per service and two shared ones:

    [zenoh]
    connect = ["tcp/127.0.0.1:7447"]

    [tracker]
    show_missed_s = 1.5

A profile is a settings file that comes with Heel, for a kind of computer (`profiles/`).

The environment spells the same keys `HEEL_ZENOH__CONNECT`, `HEEL_TRACKER__SHOW_MISSED_S`.
"""

from __future__ import annotations

import difflib
import json
import os
import tomllib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any, ClassVar, Generic, Literal, Self, TypeVar, get_args, get_origin

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    SecretStr,
    ValidationError,
    create_model,
    model_validator,
)
from pydantic.fields import FieldInfo
from pydantic_settings import (
    BaseSettings,
    EnvSettingsSource,
    InitSettingsSource,
    SettingsConfigDict,
)
from pydantic_settings import PydanticBaseSettingsSource as Source

from heel.schemas.base import Name
from heel.schemas.errors import SettingsError
from heel.services.runtime.passwords import without_passwords

SERVICES = (
    "capture", "detector", "tracker", "follower", "drive", "web", "recorder", "simulator", "ros2",
    "router",
)  # fmt: skip
SECTIONS = (*SERVICES, "robot", "zenoh", "log")
ENVIRONMENT_PREFIX = "HEEL_"
PROFILE = "HEEL_PROFILE"
"""Names the profile of all processes that inherit it."""
_COMMANDS = {"robot": "status", "recorder": "record"}
"""Commands whose help tells of a table, where they are not called as it is."""
_PROFILES = Path(__file__).with_name("profiles")


class StrictSettings(BaseModel):
    """Immutable settings in which an unknown key is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _read_choices(cls, data: Any) -> Any:
        """Flags and the environment are text, and pydantic does not take "3" for Literal[3]."""
        if not isinstance(data, dict):
            return data
        return {name: _as_choice(cls.model_fields.get(name), value) for name, value in data.items()}


def _as_choice(field: FieldInfo | None, value: object) -> object:
    if field is None or get_origin(field.annotation) is not Literal or not isinstance(value, str):
        return value
    return next((one for one in get_args(field.annotation) if str(one) == value), value)


def split_list(value: object) -> object:
    """Let a comma-separated string stand for a list, as people type it in shells."""
    if isinstance(value, str):
        parts = [part for part in (piece.strip() for piece in value.split(",")) if part]
        if value.strip() and not parts:
            raise ValueError(f"{value!r} names nothing between its commas; leave it out for none")
        return parts
    return value


Endpoints = Annotated[tuple[str, ...], BeforeValidator(split_list)]


def with_addresses_of_file(data: Any, wanted: Mapping[str, str]) -> Any:
    """Settings with what their `config_file` says of addresses, where they do not say it.

    A file that cannot be read changes nothing: it is complained of where it is used.

    Args:
        data: the settings as they were given.
        wanted: the place in Zenoh's configuration of each setting.
    """
    if not isinstance(data, dict) or not data.get("config_file"):
        return data
    import zenoh

    told = {}
    with suppress(zenoh.ZError):
        config = zenoh.Config.from_file(str(data["config_file"]))
        for name, place in wanted.items():
            value = json.loads(config.get_json(place))
            # Of endpoints Zenoh's own default is a list for each mode.
            if data.get(name) is None and value and not isinstance(value, dict):
                told[name] = value
    return {**data, **told}


class ZenohSettings(StrictSettings):
    """How a process joins the robot's Zenoh network."""

    mode: Literal["client", "peer"] = Field(
        "client", description="client of one router, or peer (then listen must be reachable)"
    )
    connect: Endpoints = Field(
        ("tcp/127.0.0.1:7447",), description="endpoints to connect to, comma separated"
    )
    listen: Endpoints = Field((), description="endpoints to listen on (peer mode)")
    namespace: str = Field(
        "", description="robot name put before every key, e.g. robots/r1", max_length=128
    )
    shared_memory: bool = Field(True, description="pass large messages through shared memory")
    connect_timeout_s: float = Field(
        10.0, ge=0, le=3600, description="seconds to wait for the router before giving up"
    )
    user: str | None = Field(None, description="user name, where the router asks for one")
    password: SecretStr | None = Field(
        None, description="password of that user; better in a file or in HEEL_ZENOH__PASSWORD"
    )
    password_file: Path | None = Field(
        None, description="file that holds the password of that user and nothing else"
    )
    config_file: Path | None = Field(
        None,
        description="Zenoh JSON5 file loaded first, e.g. of `heel security`; the settings above "
        "win where they are given",
    )

    @model_validator(mode="before")
    @classmethod
    def _take_addresses(cls, data: Any) -> Any:
        return with_addresses_of_file(data, {
            "connect": "connect/endpoints", "listen": "listen/endpoints",
            "namespace": "namespace",
        })  # fmt: skip

    @model_validator(mode="after")
    def _user_has_password(self) -> Self:
        given = (self.password is not None) + (self.password_file is not None)
        if given != (self.user is not None):
            raise ValueError(
                "user and password go together: give neither, or the user and one of password and "
                "password_file"
            )
        return self

    def secret(self) -> str:
        """The user's password; empty where there is no user.

        Raises:
            SettingsError: the file cannot be read or holds no password.
        """
        if self.password_file is None:
            return "" if self.password is None else self.password.get_secret_value()
        try:
            secret = self.password_file.read_text(encoding="utf-8").strip()
        except (OSError, UnicodeDecodeError) as error:
            raise SettingsError(f"password file {self.password_file}: {error}") from None
        if not secret:
            raise SettingsError(f"password file {self.password_file} is empty")
        return secret


class LogSettings(StrictSettings):
    """What a process says of itself on standard error."""

    level: Literal["debug", "info", "warning", "error"] = Field(
        "info", description="least severe level that is written"
    )
    format: Literal["auto", "text", "json"] = Field(
        "auto", description="text for people, JSON lines for machines; auto asks the terminal"
    )
    folder: Path | None = Field(
        None,
        description="folder in which each service writes SERVICE.log besides, JSON lines, 30 MB at "
        "most",
    )


class RobotSettings(StrictSettings):
    """What a robot consists of; read by commands that look at it, and by no service."""

    stack: Annotated[tuple[Name, ...], BeforeValidator(split_list)] = Field(
        (),
        max_length=16,
        description="services that have to run, comma separated: heel status names the missing",
    )
    robots: Annotated[tuple[str, ...], BeforeValidator(split_list)] = Field(
        (),
        max_length=256,
        description="names of the robots on the router that have to be there, comma separated: "
        "heel status --all and the page of robots name the missing",
    )


class ServiceSettings(StrictSettings):
    """What every service of the pipeline has."""

    instance: Name = Field("main", description="name of this process among its kind")
    camera: Name = Field("front", description="camera whose stream is worked on")
    delivery: Literal["live", "lossless"] = Field(
        "live", description="live: the newest frame wins; lossless: nothing is dropped"
    )
    exit_at_end: bool = Field(
        False, description="end when the stream ends, instead of waiting for the next one"
    )
    health_file: Path | None = Field(
        None, description="file renewed every second with the state, for a container's check"
    )
    metrics_port: int | None = Field(
        None, ge=1, le=65535, description="serve health to Prometheus on this loopback port; off"
    )


class StandbySettings(BaseModel):
    """Of a process that another one may take over from."""

    standby: bool = Field(
        default=False,
        description="live: send nothing, work along with the one that does, and take over from it "
        "when it ends, hangs or is told to by `heel swap`",
    )


S = TypeVar("S", bound=BaseModel)


class Loaded(BaseModel, Generic[S]):
    """Settings of one process: its own, and the two shared tables."""

    model_config = ConfigDict(frozen=True)

    service: S
    zenoh: ZenohSettings
    log: LogSettings

    def shown(self, name: str) -> dict[str, Any]:
        """The settings as `--show-config` and the config queryable print them, secrets hidden."""
        return {
            name: {
                key: _hidden(value) for key, value in self.service.model_dump(mode="json").items()
            },
            "zenoh": self.zenoh.model_dump(mode="json"),
            "log": self.log.model_dump(mode="json"),
        }


def _hidden(value: Any) -> Any:
    """A value of a setting without the passwords of the addresses in it."""
    if isinstance(value, list):
        return [_hidden(one) for one in value]
    return without_passwords(value) if isinstance(value, str) else value


class _Environment(EnvSettingsSource):
    def decode_complex_value(self, field_name: str, field: Any, value: Any) -> Any:
        """Accept `a,b` where JSON is expected: people set lists in compose files."""
        try:
            return super().decode_complex_value(field_name, field, value)
        except ValueError:
            return value


class _Merged(BaseSettings):
    """Base of the model that holds one service's table beside the shared ones."""

    model_config = SettingsConfigDict(
        extra="forbid", env_prefix=ENVIRONMENT_PREFIX, env_nested_delimiter="__"
    )
    file_tables: ClassVar[dict[str, Any]] = {}

    @classmethod
    def settings_customise_sources(
        cls, settings_cls: type[BaseSettings], init_settings: Source, *_: Source, **__: Source
    ) -> tuple[Source, ...]:
        known = {
            name: cls.file_tables[name] for name in cls.file_tables if name in cls.model_fields
        }
        return init_settings, _Environment(settings_cls), InitSettingsSource(settings_cls, known)


def load_settings(
    service: str,
    model: type[S],
    flags: Mapping[str, Mapping[str, object]],
    file: Path | None = None,
    profile: str | None = None,
) -> Loaded[S]:
    """Merge profile, file, environment and flags into checked settings.

    Args:
        service: the service's table name.
        model: its settings model.
        flags: table name to flag values; None is a flag that was not given.
        file: TOML file; None means `HEEL_CONFIG` if that is set, else no file.
        profile: name of a profile; None means `HEEL_PROFILE` if that is set, else none.

    Raises:
        SettingsError: unknown profile, table or key, wrong type, out of range, unreadable file.
    """
    models: dict[str, type[BaseModel]] = {
        "zenoh": ZenohSettings, "log": LogSettings, **_known_tables, service: model,
    }  # fmt: skip
    _check_environment(os.environ, models)
    named = os.environ.get("HEEL_CONFIG")
    file = file or (Path(named) if named else None)
    tables = read_tables(file)
    _check_keys(tables, models, f"settings file {file}: ")
    usual = profile_tables(profile or os.environ.get(PROFILE))
    tables = {
        name: {**usual.get(name, {}), **tables.get(name, {})} for name in {*usual, *tables}
    }  # fmt: skip
    merged: type[_Merged] = create_model(
        "Merged",
        __base__=_Merged,
        **{
            service: (model, Field(default_factory=model)),
            "zenoh": (ZenohSettings, Field(default_factory=ZenohSettings)),
            "log": (LogSettings, Field(default_factory=LogSettings)),
        },  # type: ignore[call-overload]
    )
    merged.file_tables = tables
    try:
        given: dict[str, Any] = {}
        for name, table in flags.items():
            if said := {flag: value for flag, value in table.items() if value is not None}:
                given[name] = said
        values = merged(**given)
    except ValidationError as error:
        raise SettingsError(_explain(error, service, model)) from None
    return Loaded(**{"service" if name == service else name: getattr(values, name)
                     for name in (service, "zenoh", "log")})  # fmt: skip


def profile_tables(name: str | None) -> dict[str, dict[str, Any]]:
    """The tables of a profile; none without a name.

    Raises:
        SettingsError: there is no such profile.
    """
    if not name:
        return {}
    file = _PROFILES / f"{name}.toml"
    known = sorted(one.stem for one in _PROFILES.glob("*.toml"))
    if name not in known:
        raise SettingsError(f"no profile {name!r}: there is {', '.join(known)}")
    return read_tables(file)


def read_tables(file: Path | None) -> dict[str, Any]:
    """Read a settings file's tables.

    Raises:
        SettingsError: unreadable, not TOML, or a table that no service owns.
    """
    if file is None:
        return {}
    try:
        tables = tomllib.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise SettingsError(f"settings file {file}: {error.strerror}: check the path") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SettingsError(f"settings file {file} is not TOML: {error}") from None
    for name, table in tables.items():
        if name not in SECTIONS or not isinstance(table, dict):
            raise SettingsError(
                f"settings file {file}: [{name}] is not a table of Heel's{_nearest(name, SECTIONS)}"
            )
    return tables


def know_tables(models: Mapping[str, type[BaseModel]]) -> None:
    """Tell which tables there are, so that every process refuses unknown keys in all of them.

    A process that is not told, such as a service started by itself, knows its own and the shared
    ones.
    """
    _known_tables.update(models)


def known_tables() -> Mapping[str, type[BaseModel]]:
    """The tables told so far, by name; the shared ones, `zenoh` and `log`, are not among them."""
    return dict(_known_tables)


_known_tables: dict[str, type[BaseModel]] = {}


def _check_keys(
    tables: Mapping[str, Mapping[str, Any]], models: Mapping[str, type[BaseModel]], where: str
) -> None:
    """Refuse keys that no service reads, in tables of other services too.

    Raises:
        SettingsError: there is one.
    """
    for name, table in tables.items():
        model = models.get(name)
        for key in table:
            if model is not None and key not in model.model_fields:
                raise SettingsError(
                    f"{where}{name}.{key}: unknown key{_nearest(key, model.model_fields)}"
                )


def _check_environment(names: Iterable[str], models: Mapping[str, type[BaseModel]]) -> None:
    """Refuse variables that look like settings and would be ignored.

    Raises:
        SettingsError: a table that no service owns, a key that it does not have, or one underscore
            where two are needed.
    """
    for name in names:
        if not name.upper().startswith(ENVIRONMENT_PREFIX):
            continue
        table, separator, key = name.upper().removeprefix(ENVIRONMENT_PREFIX).partition("__")
        table = table.lower()
        if separator and table not in SECTIONS:
            raise SettingsError(
                f"environment variable {name}: {table} is not a table of Heel's"
                f"{_nearest(table, SECTIONS)}"
            )
        fields = models[table].model_fields if separator and table in models else {}
        key = key.partition("__")[0].lower()
        if fields and key not in fields:
            raise SettingsError(
                f"environment variable {name}: {table}.{key}: unknown key{_nearest(key, fields)}"
            )
        section, _, rest = table.partition("_")
        if section in SECTIONS and rest and not separator:
            raise SettingsError(
                f"environment variable {name}: write {ENVIRONMENT_PREFIX}{section.upper()}__"
                f"{rest.upper()}, with two underscores behind the table"
            )


def _nearest(name: str, known: Iterable[str]) -> str:
    close = difflib.get_close_matches(name, list(known), n=1)
    return f"; did you mean {close[0]!r}?" if close else f"; known: {', '.join(sorted(known))}"


def _explain(error: ValidationError, service: str, model: type[BaseModel]) -> str:
    """Turn the first complaint into one line that names the key, the value and the remedy."""
    first = error.errors(include_url=False)[0]
    path = [str(part) for part in first["loc"]]
    where = ".".join(path)
    owners: dict[str, type[BaseModel]] = {
        service: model,
        "zenoh": ZenohSettings,
        "log": LogSettings,
    }
    if first["type"] == "extra_forbidden" and len(path) > 1:
        return f"{where}: unknown key{_nearest(path[1], owners[path[0]].model_fields)}"
    given = without_passwords(repr(first.get("input")))
    value = "" if len(path) < 2 or path[-1] == "password" else f" = {given:.80}"
    command = _COMMANDS.get(service, service)
    return f"{where}{value}: {first['msg']}; see `heel {command} --help`"
