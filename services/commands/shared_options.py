"""Options that several commands have, and how long their processes take to end."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from heel.schemas.keys import chunk
from heel.services.networks.names import HeadName
from heel.services.runtime.settings import PROFILE, profile_tables

PARENT_EXIT_S = 12.0
"""Longest orderly end of a run [s], in which its children are ended and their last messages taken;
chosen by hand."""

Detector = Annotated[
    str | None,
    typer.Option(help="how people are found in pixels: auto, mixture, ego, onnx, ..."),
]
Model = Annotated[
    str | None,
    typer.Option(
        help="network that finds people in pixels: a name of `heel models list`, an ONNX file, or "
        "none [default: one that `heel models get` has brought]",
        metavar="NAME|FILE",
    ),
]
NamedModel = Annotated[
    str | None,
    typer.Option(
        help="network that finds people in pixels: a name of `heel models list`, or an ONNX file",
        metavar="NAME|FILE",
    ),
]
ModelClass = Annotated[
    int | None,
    typer.Option(help="its class that is a person, where the file names none", metavar="N"),
]
ModelHead = Annotated[
    HeadName | None, typer.Option(help="what its output means, where the file does not tell")
]
Profile = Annotated[
    str | None,
    typer.Option(help="settings of every service for a kind of computer: pi", metavar="NAME"),
]
Config = Annotated[
    Path | None, typer.Option(help="settings file (TOML) for every service", metavar="FILE")
]
Robot = Annotated[
    str,
    typer.Option(help="name by which heel status, follow and stop choose this run", metavar="NAME"),
]
TraceTo = Annotated[
    Path | None,
    typer.Option(
        "--trace", help="write every decision about an identity there, for heel why", metavar="FILE"
    ),
]


def take_profile(name: str | None) -> None:
    """Let this process and those that it starts have a profile.

    Raises:
        SettingsError: there is no such profile.
    """
    if name is not None:
        profile_tables(name)
        os.environ[PROFILE] = name


def robot_name(name: str) -> str:
    """A robot's name as it was given; "" is none.

    Raises:
        KeyNameError: it has other characters than names have.
    """
    return chunk(name, "--robot") if name else ""
