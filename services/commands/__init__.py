"""The tools of `heel`, one module each; this file only puts them together."""

from __future__ import annotations

import typer

from heel.services.commands.bus.topics import bw, echo, hz, topics
from heel.services.commands.calibrate import calibrate
from heel.services.commands.demo import demo
from heel.services.commands.doctor.command import doctor
from heel.services.commands.eval import score
from heel.services.commands.follow import follow
from heel.services.commands.models import app as models
from heel.services.commands.run import run
from heel.services.commands.scenarios import scenarios
from heel.services.commands.schema import schema
from heel.services.commands.status import status
from heel.services.commands.stopping import resume, stop
from heel.services.commands.top import top
from heel.services.commands.track_detections import track_detections
from heel.services.commands.why import why


def register_tools(app: typer.Typer) -> None:
    """Add every tool to the root command."""
    app.command()(demo)
    app.command()(run)
    app.command("eval")(score)
    app.command("track-detections")(track_detections)
    app.command()(why)
    app.add_typer(models, name="models")
    app.command()(scenarios)
    app.command()(calibrate)
    app.command()(follow)
    app.command()(stop)
    app.command()(resume)
    app.command()(status)
    app.command()(doctor)
    app.command()(top)
    app.command()(topics)
    app.command()(hz)
    app.command()(bw)
    app.command()(echo)
    app.command()(schema)
