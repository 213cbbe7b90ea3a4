"""`heel run`: a recording or camera through the real processes; files and figures come out."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Annotated, Literal

import typer

from heel.schemas.errors import SettingsError
from heel.services.commands.shared_options import (
    PARENT_EXIT_S,
    Config,
    Detector,
    Model,
    ModelClass,
    ModelHead,
    Profile,
    Robot,
    TraceTo,
    robot_name,
    take_profile,
)
from heel.services.run.folder import STAGING_PREFIX, sweep
from heel.services.run.guard import guarded
from heel.services.run.options import RunOptions
from heel.services.runtime.passwords import without_passwords

_Source = Annotated[
    str, typer.Argument(help="video file, image folder, camera or scene:NAME", metavar="SOURCE")
]
_Out = Annotated[Path, typer.Option(help="folder for the results", metavar="DIR")]
_Lossless = Annotated[
    bool | None,
    typer.Option(
        "--lossless/--live",
        help="every frame, or the newest frame wins "
        "[default: lossless for recordings, live for cameras]",
    ),
]
_InProcess = Annotated[
    bool, typer.Option("--in-process", help="the same cores in one process, for comparison")
]
_Preset = Annotated[Literal["default", "paper"], typer.Option(help="ours, or the paper as printed")]
_Annotate = Annotated[bool, typer.Option("--annotate", help="write annotated.mp4 as well")]
_Target = Annotated[Literal["nearest", "none"], typer.Option(help="whom the follower follows")]
_Scale = Annotated[
    float, typer.Option(help="factor for both sides of every frame", min=0.001, max=1.0)
]
_Fps = Annotated[
    float | None, typer.Option(help="rate instead of the source's own", min=0.001, max=240.0)
]
_Loop = Annotated[bool, typer.Option("--loop", help="play a recording again and again")]
_Frames = Annotated[int | None, typer.Option(help="end after so many frames", min=1)]
_Seconds = Annotated[float | None, typer.Option(help="end after so many seconds", min=0.0)]
_Web = Annotated[
    int | None, typer.Option(help="serve the live page on this loopback port", metavar="PORT")
]


def run(
    source: _Source, out: _Out, lossless: _Lossless = None, in_process: _InProcess = False,
    preset: _Preset = "default", detector: Detector = None, model: Model = None,
    model_class: ModelClass = None, model_head: ModelHead = None, annotate: _Annotate = False,
    target: _Target = "nearest",
    scale: _Scale = 1.0, fps: _Fps = None, loop: _Loop = False, frames: _Frames = None,
    seconds: _Seconds = None, web: _Web = None, trace: TraceTo = None, config: Config = None,
    profile: Profile = None, robot: Robot = "",
) -> None:  # fmt: skip
    """Run SOURCE through the real processes; write tracks.txt, commands.csv and summary.json."""
    take_profile(profile)
    live_source = is_camera(source)
    if lossless is None:
        lossless = not live_source
    if lossless and live_source:
        raise SettingsError(
            f"{without_passwords(source)}: a camera does not wait: leave out --lossless"
        )
    options = RunOptions(
        source=source, out=out, delivery="lossless" if lossless else "live", preset=preset,
        detector=detector, model=model, model_class=model_class, model_head=model_head,
        annotate=annotate, target=target, scale=scale, fps=fps, loop=loop, frames=frames,
        seconds=seconds, web_port=web, config=config, trace=trace,
        on_page=_print_page, robot=robot_name(robot),
    )  # fmt: skip
    code = guarded(lambda: _work(options, in_process))
    sweep(out, STAGING_PREFIX)
    raise typer.Exit(code)


def _print_page(url: str) -> None:
    typer.echo(f"live page: {url}")


def _work(options: RunOptions, in_process: bool) -> None:
    # Imported here, in the guarded process: see `guarded`.
    from heel.services.run.checks import check_options, say_without_network
    from heel.services.run.distributed import DistributedRun
    from heel.services.run.in_process import run_in_process
    from heel.services.run.summary import print_summary
    from heel.services.runtime.logs import set_up_command_logging
    from heel.services.runtime.stop_signals import stop_signals

    set_up_command_logging()
    with stop_signals(PARENT_EXIT_S) as stopping:
        if in_process:
            summary = run_in_process(options, stopping)
            say_without_network(options)
        else:
            check_options(options)
            summary = DistributedRun(options, stopping, logging.getLogger("heel.run")).run()
    where = "results in" if summary.tracked else "no frame was tracked: nothing is written to"
    print_summary(summary, f"{where} {options.out}")


def is_camera(source: str) -> bool:
    """Whether a source is live: a device, a window that turns, or a network stream.

    Of an `http://` address the name does not tell: the server is asked. Where it does not answer,
    the address counts as a camera, and capture will say what is wrong with it.
    """
    if source.isdigit() or source.startswith(("/dev/", "pan:")):
        return True
    if source.lower().startswith(("http://", "https://")):
        from heel.services.capture.camera import holds_recording

        return not holds_recording(source)
    return "://" in source
