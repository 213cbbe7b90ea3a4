"""The tools of `heel`, one module each; this file only puts them together."""

from __future__ import annotations

import typer

from heel.services.commands.bus.topics import bw, echo, hz, topics
from heel.services.commands.calibrate import app as calibrate
from heel.services.commands.demo import demo
from heel.services.commands.doctor.command import doctor
from heel.services.commands.eval import score
from heel.services.commands.follow import follow
from heel.services.commands.foxglove import foxglove
from heel.services.commands.models import app as models
from heel.services.commands.recording.replay import replay
from heel.services.commands.report.command import report
from heel.services.commands.run import run
from heel.services.commands.scenarios import scenarios
from heel.services.commands.schema import schema
from heel.services.commands.security import app as security
from heel.services.commands.status import status
from heel.services.commands.stopping import resume, stop
from heel.services.commands.swap import swap
from heel.services.commands.systemd import systemd
from heel.services.commands.top import top
from heel.services.commands.track_detections import track_detections
from heel.services.commands.why import why

_TRY, _ROBOT, _LOOK, _MEASURE = (
    "Run a camera, a recording or a world",
    "The robot",
    "Look into it",
    "Measure, calibrate, integrate",
)
SERVICES = "One service each"
"""Title of the services in `heel --help`."""


def register_tools(app: typer.Typer) -> None:
    """Add every tool to the root command."""
    app.command(rich_help_panel=_TRY)(demo)
    app.command(rich_help_panel=_TRY)(run)
    app.add_typer(models, name="models", rich_help_panel=_TRY)
    for command in (status, follow, stop, resume, swap):
        app.command(rich_help_panel=_ROBOT)(command)
    app.add_typer(security, name="security", rich_help_panel=_ROBOT)
    for command in (doctor, top, topics, hz, bw, echo, foxglove, replay):
        app.command(rich_help_panel=_LOOK)(command)
    app.command(rich_help_panel=_LOOK)(why)
    app.command(rich_help_panel=_LOOK)(report)
    app.command("eval", rich_help_panel=_MEASURE)(score)
    app.command("track-detections", rich_help_panel=_MEASURE)(track_detections)
    app.command(rich_help_panel=_MEASURE)(scenarios)
    app.add_typer(calibrate, name="calibrate", rich_help_panel=_MEASURE)
    app.command(rich_help_panel=_MEASURE)(schema)
    app.command(rich_help_panel=_MEASURE)(systemd)
