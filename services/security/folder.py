"""The folder with everything that tells the robot's members apart: made once, added to later.

One file of Zenoh's for each member, key included, so that moving a service to another host means
copying one file. Every file with a secret is readable by its owner alone.
"""

from __future__ import annotations

import base64
import datetime
import json
import os
import secrets
import socket
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from heel.schemas.base import Name
from heel.schemas.errors import HeelError, SettingsError
from heel.services.security.accounts import (
    Account,
    PageRole,
    as_text,
    checked_password,
    hashed,
    read_accounts,
)
from heel.services.security.certificates import Certified, certify, new_authority
from heel.services.security.roles import ROLES, SERVICES
from heel.services.security.rules import access_control, size_limits

PAGE_CERTIFICATE = "page.pem"
"""Certificate and key of the page."""
AUTHORITY = "authority.crt"
"""What browsers and others may be told to trust."""
PAGE_USERS = "page-users"
"""Who may log in on the page."""
ROUTER = "router"
_AUTHORITY_KEY = "authority.key"
_INDEX = "members.json"
_BUS_USERS = "bus-users"
_AUTHORITY_DAYS = 3650
"""Ten years: what it signs ends sooner, and everything has to be made anew when it ends."""
_PORT = 7447
"""Zenoh's usual one."""
_PROTOCOLS = ("tls", "quic")
"""What proves who the other side is; QUIC only where an endpoint names it."""


class Members(BaseModel):
    """What a folder was made for; kept in it."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    by: Literal["certificate", "password"]
    """How members prove who they are."""
    hosts: tuple[str, ...]
    """Names and addresses under which router and page are reached."""
    namespace: str
    cameras: tuple[Name, ...]
    days: int = Field(ge=1, le=3650)
    """That a certificate is valid."""
    roles: dict[Name, str]
    """Of each member, by its name."""
    until: dict[str, datetime.datetime] = {}
    """End of each certificate, by its file."""


def own_names() -> tuple[str, ...]:
    """Names under which this machine is usually reached, and the router's in docker compose."""
    host = socket.gethostname().lower()
    return tuple(dict.fromkeys((
        "localhost", "127.0.0.1", "::1", ROUTER, host, f"{host.partition('.')[0]}.local",
    )))  # fmt: skip


class SecurityFolder:
    """A folder made by `create`, or one that is there.

    Raises:
        SettingsError: it was not made by `heel security init`.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            self.members = Members.model_validate_json((folder / _INDEX).read_text("utf-8"))
        except OSError as error:
            raise SettingsError(
                f"{folder / _INDEX}: {error.strerror}: make the folder with "
                f"`heel security init {folder}`"
            ) from None
        except (ValidationError, UnicodeDecodeError):
            raise SettingsError(
                f"{folder / _INDEX} is not one of `heel security init`: make another folder"
            ) from None

    @classmethod
    def create(
        cls, folder: Path, by: Literal["certificate", "password"] = "certificate",
        hosts: tuple[str, ...] = (), namespace: str = "", cameras: tuple[str, ...] = ("front",),
        days: int = 730,
    ) -> SecurityFolder:  # fmt: skip
        """Make a folder with an authority, all services, and an operator named `operator`.

        Raises:
            SettingsError: there is something in the folder already.
            HeelError: it cannot be written, or `cryptography` is not installed.
        """
        with suppress(FileNotFoundError):
            if any(folder.iterdir()):
                raise SettingsError(
                    f"{folder} is not empty, and nothing in it is overwritten: name a new folder, "
                    f"or add to this one with `heel security add {folder} NAME --role ROLE`"
                )
        members = Members(
            by=by, hosts=tuple(dict.fromkeys((*own_names(), *hosts))), namespace=namespace,
            cameras=cameras, days=days, roles={},
        )  # fmt: skip
        authority = new_authority("Heel robot", _AUTHORITY_DAYS) if by == "certificate" else None
        try:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if authority is not None:
                _write(folder / _AUTHORITY_KEY, authority.key)
                _write(folder / AUTHORITY, authority.certificate, 0o644)
                members = members.model_copy(update={"until": {AUTHORITY: authority.until}})
            _write(folder / _INDEX, members.model_dump_json(indent=2).encode())
        except OSError as error:
            raise _unwritable(folder, error) from None
        made = cls(folder)
        made._issue({**{name: name for name in SERVICES}, "operator": "operate"})
        return made

    def add(self, name: str, role: str) -> Path:
        """Let another member in; its file.

        The router has to be started again to know it.

        Raises:
            SettingsError: the name is taken, or there is no such role.
        """
        if name in self.members.roles or name == ROUTER:
            raise SettingsError(f"{name} is there already: choose another name, or remove it first")
        if role not in ROLES:
            raise SettingsError(f"no role {role!r}: there are {', '.join(ROLES)}")
        self._issue({name: role})
        return self.file_of(name)

    def remove(self, name: str) -> None:
        """Let a member in no longer, whatever it still holds; the router has to be started again.

        Raises:
            SettingsError: there is no such member.
        """
        if name not in self.members.roles:
            raise SettingsError(f"no {name!r} here: there are {', '.join(self.members.roles)}")
        kept = {other: role for other, role in self.members.roles.items() if other != name}
        until = {file: end for file, end in self.members.until.items() if file != f"{name}.json5"}
        self._keep(self.members.model_copy(update={"roles": kept, "until": until}))
        self.file_of(name).unlink(missing_ok=True)
        self._write_router()

    def set_login(self, name: str, role: PageRole, password: str) -> None:
        """Let somebody log in on the page, or give them another role or password.

        Raises:
            SettingsError: the password is too short, or the file of accounts is none.
        """
        file = self.folder / PAGE_USERS
        accounts = read_accounts(file) if file.exists() else {}
        accounts[name] = Account(role, hashed(checked_password(password)))
        self._write_secret(file, as_text(accounts).encode())

    def remove_login(self, name: str) -> None:
        """Let somebody log in on the page no longer; the page has to be started again.

        Raises:
            SettingsError: there is no such account, or it is the last one.
        """
        file = self.folder / PAGE_USERS
        accounts = read_accounts(file)
        if name not in accounts:
            raise SettingsError(f"no {name!r} in {file}: there are {', '.join(accounts)}")
        if len(accounts) == 1:
            raise SettingsError(f"{name!r} is the last one that may log in: let another in first")
        del accounts[name]
        self._write_secret(file, as_text(accounts).encode())

    def renew(self) -> None:
        """Make every certificate but the authority's anew; copies elsewhere have to be replaced."""
        self._issue(dict(self.members.roles))

    def file_of(self, name: str) -> Path:
        """The file of Zenoh's of a member."""
        return self.folder / f"{name}.json5"

    def ends(self) -> Iterator[tuple[str, datetime.datetime]]:
        """Every certificate's file and its end, the first to end first."""
        yield from sorted(self.members.until.items(), key=lambda one: one[1])

    def _issue(self, roles: dict[str, str]) -> None:
        until, members = dict(self.members.until), self.members
        try:
            for name, role in roles.items():
                identity, end = self._client_identity(name)
                document = {
                    "mode": "client",
                    "connect": {"endpoints": [f"{self._protocol}/127.0.0.1:{_PORT}"]},
                    "scouting": {"multicast": {"enabled": False}},
                    "transport": identity,
                    **_about(name, role, end),
                }
                if members.namespace:
                    document["namespace"] = members.namespace
                self._write_zenoh(name, f"member {name}, role {role}", document)
                if end is not None:
                    until[self.file_of(name).name] = end
        except OSError as error:
            raise _unwritable(self.folder, error) from None
        self._keep(members.model_copy(update={
            "roles": {**members.roles, **roles}, "until": until,
        }))  # fmt: skip
        self._write_router()

    @property
    def _protocol(self) -> str:
        return "tls" if self.members.by == "certificate" else "tcp"

    def _client_identity(self, name: str) -> tuple[dict[str, Any], datetime.datetime | None]:
        """The table `transport` of a client that proves to be `name`, and how long it can."""
        if self.members.by == "password":
            password = secrets.token_urlsafe(24)
            self._set_password(name, password)
            return {"auth": {"usrpwd": {"user": name, "password": password}}}, None
        own = certify(self._authority(), name, self.members.days)
        return {"link": {"protocols": list(_PROTOCOLS), "tls": {
            "root_ca_certificate_base64": _base64((self.folder / AUTHORITY).read_bytes()),
            "enable_mtls": True,
            "connect_certificate_base64": _base64(own.certificate),
            "connect_private_key_base64": _base64(own.key),
            "verify_name_on_connect": True,
        }}}, own.until  # fmt: skip

    def _write_router(self) -> None:
        """The router's file, and the page's certificate: what depends on who the members are."""
        members, end = self.members, None
        identity: dict[str, Any]
        try:
            if members.by == "password":
                # Without those that were removed.
                self._set_password(None, "")
                file = (self.folder / _BUS_USERS).absolute()
                identity = {"auth": {"usrpwd": {"dictionary_file": str(file)}}}
            else:
                own = certify(self._authority(), ROUTER, members.days, members.hosts)
                page = certify(self._authority(), "page", members.days, members.hosts)
                _write(self.folder / PAGE_CERTIFICATE, page.certificate + page.key)
                end = own.until
                identity = {"link": {"protocols": list(_PROTOCOLS), "tls": {
                    "root_ca_certificate_base64": _base64((self.folder / AUTHORITY).read_bytes()),
                    "enable_mtls": True,
                    "listen_certificate_base64": _base64(own.certificate),
                    "listen_private_key_base64": _base64(own.key),
                }}}  # fmt: skip
                until = {
                    **members.until, PAGE_CERTIFICATE: page.until,
                    self.file_of(ROUTER).name: own.until,
                }  # fmt: skip
                self._keep(members.model_copy(update={"until": until}))
            by: Literal["cert_common_names", "usernames"] = (
                "cert_common_names" if members.by == "certificate" else "usernames"
            )
            self._write_zenoh(ROUTER, "the router", {
                "mode": "router",
                "listen": {"endpoints": [f"{self._protocol}/0.0.0.0:{_PORT}"]},
                "scouting": {"multicast": {"enabled": False}},
                "transport": identity,
                "access_control":
                    access_control(members.roles, by, members.namespace, members.cameras),
                "low_pass_filter": size_limits(members.namespace),
                **_about(ROUTER, ROUTER, end),
            })  # fmt: skip
        except OSError as error:
            raise _unwritable(self.folder, error) from None

    def _authority(self) -> Certified:
        until = self.members.until[AUTHORITY]
        certificate = (self.folder / AUTHORITY).read_bytes()
        return Certified(certificate, (self.folder / _AUTHORITY_KEY).read_bytes(), until)

    def _set_password(self, name: str | None, password: str) -> None:
        """Give a member a password, and take it from those that are none any more."""
        file, known = self.folder / _BUS_USERS, {}
        with suppress(FileNotFoundError):
            for line in file.read_text("utf-8").splitlines():
                user, _, own = line.partition(":")
                known[user] = own
        if name is None:
            known = {user: own for user, own in known.items() if user in self.members.roles}
        else:
            known[name] = password
        _write(file, "".join(f"{user}:{own}\n" for user, own in known.items()).encode())

    def _keep(self, members: Members) -> None:
        self.members = members
        self._write_secret(self.folder / _INDEX, members.model_dump_json(indent=2).encode())

    def _write_secret(self, file: Path, content: bytes) -> None:
        try:
            _write(file, content)
        except OSError as error:
            raise _unwritable(self.folder, error) from None

    def _write_zenoh(self, name: str, what: str, document: dict[str, Any]) -> None:
        text = f"// {what}: written by `heel security`; keep it secret.\n"
        _write(self.file_of(name), (text + json.dumps(document, indent=2) + "\n").encode())


def _about(name: str, role: str, end: datetime.datetime | None) -> dict[str, Any]:
    """What Zenoh keeps and does not look at: `heel doctor` and health read it."""
    told = {"name": name, "role": role}
    if end is not None:
        told["until"] = end.isoformat(timespec="seconds")
    return {"metadata": {"heel": told}}


def _base64(content: bytes) -> str:
    return base64.b64encode(content).decode()


def _write(file: Path, content: bytes, mode: int = 0o600) -> None:
    """Write a file as a whole: nobody finds half of it, nor one with another mode."""
    beside = file.with_name(f".{file.name}.new")
    beside.unlink(missing_ok=True)
    descriptor = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
    with os.fdopen(descriptor, "wb") as out:
        os.fchmod(descriptor, mode)
        out.write(content)
        out.flush()
        os.fsync(descriptor)
    os.replace(beside, file)


def _unwritable(folder: Path, error: OSError) -> HeelError:
    return HeelError(f"{error.filename or folder}: {error.strerror}: choose another folder")
