"""The `heel` command: every service, and the tools around them.

Exit codes: 0 done, 1 failed with a one-line reason, 2 wrong usage.
"""

from __future__ import annotations

from typing import Annotated

import typer

from heel.services.runtime import one_blas_thread  # noqa: F401

# isort: split
from heel.services.capture.settings import CaptureSettings
from heel.services.commands import SERVICES, register_tools
from heel.services.commands.grouped import GroupedCommands
from heel.services.commands.recording.record import record_command
from heel.services.detector.settings import DetectorServiceSettings
from heel.services.drive.settings import DriveServiceSettings
from heel.services.follower.settings import FollowerServiceSettings
from heel.services.recorder.settings import RecorderSettings
from heel.services.ros2.settings import Ros2Settings
from heel.services.runtime.command_line import later, run_process, settings_command
from heel.services.runtime.process import software_version
from heel.services.runtime.router import RouterSettings
from heel.services.runtime.settings import RobotSettings, know_tables
from heel.services.simulator.settings import SimulatorSettings
from heel.services.tracker.settings import TrackerServiceSettings
from heel.services.web.settings import WebServiceSettings

_SERVICES = (
    ("capture", CaptureSettings, "Send the frames of a file, folder, camera or drawn scene."),
    ("detector", DetectorServiceSettings, "Find people-sized foreground in every frame."),
    ("tracker", TrackerServiceSettings, "Give people identities and keep them."),
    ("follower", FollowerServiceSettings, "Turn the chosen person into motion commands."),
    ("drive", DriveServiceSettings, "Turn motion commands into wheels; stop when they stop."),
    ("simulator", SimulatorSettings, "Simulate a world with people and a robot in it."),
    ("ros2", Ros2Settings, "Bridge a robot's ROS 2 topics to Heel."),
    ("web", WebServiceSettings, "Serve the live picture and control page."),
)

app = typer.Typer(
    name="heel",
    cls=GroupedCommands,
    help="Person following for robots: one camera, CPU only, Python processes over Zenoh.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"heel {software_version()}")
        raise typer.Exit


@app.callback()
def _heel(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="print and end"),
    ] = False,
) -> None:
    pass


know_tables(
    {name: model for name, model, _ in _SERVICES}
    | {"recorder": RecorderSettings, "router": RouterSettings, "robot": RobotSettings}
)
register_tools(app)
for _name, _model, _summary in _SERVICES:
    _run = later(f"heel.services.{_name}.service")
    app.command(_name, rich_help_panel=SERVICES)(settings_command(_name, _model, _run, _summary))
app.command("record", rich_help_panel=SERVICES)(record_command())
# By the service's name as well, for units of systemd: it looks for no run.
app.command("recorder", hidden=True)(
    settings_command(
        "recorder", RecorderSettings, later("heel.services.recorder.service"), "As heel record."
    )
)
app.command("router", rich_help_panel=SERVICES)(
    settings_command(
        "router",
        RouterSettings,
        later("heel.services.runtime.router"),
        "Run a Zenoh router, where no zenohd is installed.",
        shared=("log",),
    )
)


def main() -> None:
    """Entry point of the `heel` command."""
    run_process(app)


if __name__ == "__main__":
    main()
