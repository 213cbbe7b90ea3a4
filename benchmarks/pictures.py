"""Pictures for the documentation, drawn from our own demo scene by the default preset.

Example run: python -m benchmarks.pictures docs
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import cv2
import typer

from schemas.errors import HeelError
from services.pipeline import RecordedFrames, load_pipeline
from services.run.annotate import Annotator
from services.runtime.command_line import run_app

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
SCENE = "scene:demo"
FRAMES = {"demo.jpg": 220}
_JPEG_QUALITY = 88


@app.command()
def main(folder: Annotated[Path, typer.Argument(help="where the pictures go")]) -> None:
    """Draw every picture of the documentation."""
    pipeline, _ = load_pipeline("default", "nearest", None)
    annotator = Annotator()
    wanted = {frame: name for name, frame in FRAMES.items()}
    with RecordedFrames(SCENE) as frames:
        for frame, image, source_size in frames:
            result = pipeline.step(frame, image, source_size)
            caption = f"frame {frame.index + 1}"
            picture = annotator.draw(image, result.tracks, result.target_id, caption)
            if frame.index + 1 in wanted:
                path = folder / wanted.pop(frame.index + 1)
                if not cv2.imwrite(str(path), picture, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY]):
                    raise HeelError(f"{path} cannot be written: give a folder that exists")
                typer.echo(f"wrote {path}")
            if not wanted:
                return


if __name__ == "__main__":
    run_app(app)
