"""Settings of the web page: where it listens, and what a viewer may cost."""

from __future__ import annotations

import ipaddress
import re
from pathlib import Path

from pydantic import Field, ValidationInfo, field_validator

from heel.services.runtime.settings import Endpoints, ServiceSettings

_HOST_NAME = re.compile(r"[a-z0-9]([a-z0-9.-]{0,251}[a-z0-9])?(:[0-9]{1,5})?")


def is_loopback(host: str) -> bool:
    """Whether an address to bind to is reachable from this machine only."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


class WebServiceSettings(ServiceSettings):
    """How the page is served; pictures are always live, whatever the mode of delivery."""

    # These before `host`, whose check asks for them.
    insecure: bool = Field(
        False,
        description="allow a host beyond loopback without login and TLS: whoever reaches "
        "the page can drive",
    )
    users_file: Path | None = Field(
        None, description="accounts that may log in, of `heel security login`; off"
    )
    certificate: Path | None = Field(
        None, description="PEM file with a certificate: the page is served over TLS"
    )
    certificate_key: Path | None = Field(
        None, description="PEM file with its key, if it is not in the same file"
    )
    host: str = Field("127.0.0.1", description="address to listen on")
    port: int = Field(8470, ge=0, le=65535, description="TCP port; 0 picks a free one")
    names: Endpoints = Field(
        (),
        description="further names the page may be asked for by, comma separated; with the port "
        "where it differs, e.g. localhost:8080 behind a port mapping",
    )
    robots: Endpoints = Field(
        (),
        description="list the robots of this router, in place of one robot's picture: `all`, or "
        "the names of those that have to be there, comma separated",
    )
    max_fps: float = Field(15.0, gt=0, le=60, description="pictures per second for viewers")
    max_side_px: int = Field(
        960, ge=160, le=3840, description="larger pictures are scaled to this longer side"
    )
    jpeg_quality: int = Field(80, ge=10, le=100, description="quality of coded pictures")
    max_viewers: int = Field(8, ge=1, le=64, description="viewers served at the same time")

    @field_validator("host")
    @classmethod
    def _stays_on_this_machine(cls, host: str, info: ValidationInfo) -> str:
        kept = info.data.get("users_file") and info.data.get("certificate")
        if not (is_loopback(host) or kept or info.data.get("insecure", False)):
            raise ValueError(
                "whoever reaches this address could watch and drive: keep 127.0.0.1 (and use an "
                "SSH tunnel), give --users-file and --certificate, or say --insecure if that is "
                "meant"
            )
        return host

    @field_validator("names")
    @classmethod
    def _are_host_names(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        for name in names:
            if not _HOST_NAME.fullmatch(name):
                raise ValueError(f"{name[:80]!r} is no host name: use e.g. robot.local")
        return names
