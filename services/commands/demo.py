"""`heel demo`: a simulated world, or a drawn scene, through the real processes."""

from __future__ import annotations

import logging
import sys
import tempfile
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Literal

import typer

from heel.schemas.errors import HeelError, SettingsError
from heel.services.commands.drawn_demo import play_scene, results_in
from heel.services.commands.shared_options import (
    PARENT_EXIT_S,
    Detector,
    Model,
    ModelClass,
    ModelHead,
    Profile,
    Robot,
    robot_name,
    take_profile,
)
from heel.services.run.folder import DEMO_PREFIX, ScratchFolder, sweep
from heel.services.run.guard import guarded
from heel.services.run.options import RunOptions

SCENARIO = "distractor-3"
SEED = 4
"""Of the first episode where none is named; chosen by hand."""


def demo(
    seconds: Annotated[
        float | None,
        typer.Option(help="end after so many seconds [default: Ctrl-C; one episode without a "
                     "terminal]"),
    ] = None,
    port: Annotated[int, typer.Option(help="port of the live page, 0 for any free one")] = 8470,
    out: Annotated[
        Path | None,
        typer.Option(help="folder for the results [default: none are kept]", metavar="DIR"),
    ] = None,
    browser: Annotated[bool, typer.Option(help="open the page in a browser")] = True,
    scenario: Annotated[str, typer.Option(help="kind of episode")] = SCENARIO,
    seed: Annotated[int, typer.Option(help="of the episode; each is another one", min=0)] = SEED,
    perception: Annotated[
        Literal["pixels", "simulated-boxes"],
        typer.Option(help="who sees the people: the detector, or the simulator itself"),
    ] = "pixels",
    detector: Detector = None,
    model: Model = None,
    model_class: ModelClass = None,
    profile: Profile = None,
    model_head: ModelHead = None,
    robot: Robot = "",
    scene: Annotated[
        bool, typer.Option("--scene", help="play the drawn scene of a standing camera instead")
    ] = False,
) -> None:  # fmt: skip
    """Follow a person through a simulated world; needs no camera, no data, nothing else."""
    take_profile(profile)
    on_terminal = sys.stdout.isatty()
    loop = seconds is not None or on_terminal
    on_page = partial(_show_page, browser and on_terminal, loop and seconds is None)
    if perception == "simulated-boxes" and (detector is not None or model is not None):
        raise SettingsError(
            "--detector and --model look at pixels, and the people here are the simulator's own "
            "boxes: leave out --perception, or use --scene"
        )
    with _folder(out) as folder:
        options = RunOptions(
            source="scene:demo" if scene else "", out=folder, delivery="live", loop=loop,
            seconds=seconds, web_port=port, on_page=on_page, detector=detector, model=model,
            model_class=model_class, model_head=model_head,
            target="nearest" if scene else "none", robot=robot_name(robot),
        )  # fmt: skip
        if scene:
            code = guarded(lambda: play_scene(options, kept=out is not None))
        else:
            code = guarded(
                lambda: _play_world(options, scenario, seed, perception, kept=out is not None)
            )
    raise typer.Exit(code)


@contextmanager
def _folder(out: Path | None) -> Iterator[Path]:
    """Where the results go; without --out into a temporary folder that does not stay."""
    if out is not None:
        yield out
        return
    parent = Path(tempfile.gettempdir())
    sweep(parent, DEMO_PREFIX)
    scratch = ScratchFolder(parent, DEMO_PREFIX)
    try:
        yield scratch.path
    finally:
        scratch.remove()


def _play_world(
    options: RunOptions, scenario: str, seed: int,
    perception: Literal["simulated-boxes", "pixels"], kept: bool,
) -> None:  # fmt: skip
    # Imported here, in the guarded process: see `guarded`.
    from heel.services.run.checks import check_settings, say_without_network
    from heel.services.run.following import FollowingTally, write_figures
    from heel.services.run.world_run import PageOptions, WorldOptions, WorldRun
    from heel.services.runtime.logs import set_up_command_logging
    from heel.services.runtime.stop_signals import stop_signals

    set_up_command_logging()
    duration_s = _check_world(scenario, seed)
    seen = check_settings(options)
    if perception == "pixels":
        say_without_network(options)
    world = WorldOptions(
        options.out / "logs", scenario, seed, perception,
        episode_s=None if options.loop else duration_s, seconds=options.seconds,
        page=PageOptions(options.web_port or 0, options.on_page, options.robot),
        truth=options.out / "truth.jsonl" if kept else None,
        detector_flags=tuple(options.detector_flags()), revives=True,
    )  # fmt: skip
    tally = FollowingTally()
    figures = tally.figures
    with _writing(options.out):
        options.out.mkdir(parents=True, exist_ok=True)
    with stop_signals(PARENT_EXIT_S) as stopping:
        WorldRun(world, tally, stopping, logging.getLogger("heel.demo")).run()
    with _writing(options.out):
        write_figures(figures, perception, seen if perception == "pixels" else None, options.out)
    gap = "-" if figures.least_gap_m is None else f"{figures.least_gap_m:.2f} m"
    share = figures.followed_s / figures.time_s if figures.time_s else 0.0
    typer.echo(
        f"{scenario}, from seed {seed}: {figures.time_s:.0f} s in {figures.episodes} episodes\n"
        f"followed the scenario's person {figures.followed_s:.1f} s ({share:.0%}), "
        f"anybody else {figures.wrong_s:.1f} s\n"
        f"contacts {figures.contacts}, least gap to anybody {gap}, "
        f"mean distance {figures.mean_distance_m:.2f} m, driven {figures.driven_m:.1f} m"
    )
    if perception == "simulated-boxes":
        typer.echo("people are the simulator's own boxes, not seen in pixels")
    else:
        typer.echo(f"people were seen in the rendered pictures by {seen}")
    typer.echo(results_in(options.out, kept))


@contextmanager
def _writing(out: Path) -> Iterator[None]:
    """Name the folder, and what to do, where it cannot be written to."""
    try:
        yield
    except OSError as error:
        raise HeelError(
            f"--out {out}: {error.strerror}: give a folder that can be written to, on a disk with "
            "room"
        ) from None


def _check_world(scenario: str, seed: int) -> float:
    """The length of the first episode, seconds.

    Raises:
        SettingsError: there is no such scenario.
        HeelError: what draws the pictures is not installed.
    """
    from heel.services.simulator import everyday_scenarios, scenarios

    if scenario not in (drawn := scenarios.SCENARIOS | everyday_scenarios.EVERYDAY):
        known = ", ".join(drawn)
        raise SettingsError(f"no scenario {scenario!r}: choose one of {known}")
    if find_spec("panda3d") is None:
        # Says so, in the words of the simulator.
        import_module("heel.services.simulator.render.panda")
    return scenarios.scenario(scenario, seed).scenario.duration_s


def _show_page(browser: bool, endless: bool, url: str) -> None:
    typer.echo(f"live page: {url}" + ("  (Ctrl-C ends)" if endless else ""))
    if browser:
        webbrowser.open(url)
