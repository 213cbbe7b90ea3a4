"""What a picture of the simulated world costs: milliseconds of one core a frame.

Example run: python -m benchmarks.rendering
"""

from __future__ import annotations

import time
from typing import Annotated

import cv2
import numpy as np
import typer

from heel.services.runtime.command_line import run_app
from heel.services.simulator.render.renderer import Renderer
from heel.services.simulator.scenarios import scenario
from heel.services.simulator.state import CameraMount

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
SCENARIOS = ("straight", "distractor-3", "crowd")
_STEP_S = 0.05


@app.command()
def main(
    frames: Annotated[int, typer.Option(help="frames a world", min=1)] = 100,
    seeds: Annotated[int, typer.Option(help="worlds a scenario", min=1)] = 3,
) -> None:
    """Draw pictures of several worlds while the robot turns in them."""
    cv2.setNumThreads(1)
    mount = CameraMount()
    typer.echo(f"{mount.width_px}x{mount.height_px}, milliseconds of a core")
    for name in SCENARIOS:
        spent_ms = [ms for seed in range(1, seeds + 1) for ms in _draw(name, seed, frames, mount)]
        p50, p95 = np.percentile(spent_ms, (50, 95))
        people = len(scenario(name, 1).people)
        typer.echo(f"{name}: median {p50:.1f}, p95 {p95:.1f} (seed 1: {people} people)")


def _draw(name: str, seed: int, frames: int, mount: CameraMount) -> list[float]:
    world = scenario(name, seed)
    spent_ms = []
    with Renderer(world.scenery, mount, seed=seed) as renderer:
        renderer.draw(world)
        for _ in range(frames):
            world.step(_STEP_S, 0.3, 0.4)
            started_s = time.process_time()
            renderer.draw(world)
            spent_ms.append((time.process_time() - started_s) * 1e3)
    return spent_ms


if __name__ == "__main__":
    run_app(app)
