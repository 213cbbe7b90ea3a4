"""The tools of `heel`, one module each; this file only puts them together."""

from __future__ import annotations

import typer

from services.commands.calibrate import calibrate
from services.commands.control import follow
from services.commands.demo import demo
from services.commands.run import run
from services.commands.scenarios import scenarios
from services.commands.schema import schema
from services.commands.score import score
from services.commands.status import status
from services.commands.stopping import resume, stop
from services.commands.track_detections import track_detections


def register_tools(app: typer.Typer) -> None:
    """Add every tool to the root command."""
    app.command()(demo)
    app.command()(run)
    app.command("eval")(score)
    app.command("track-detections")(track_detections)
    app.command()(scenarios)
    app.command()(calibrate)
    app.command()(follow)
    app.command()(stop)
    app.command()(resume)
    app.command()(status)
    app.command()(schema)
