"""Options of `heel run`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from heel.services.networks.names import HeadName


@dataclass(frozen=True)
class RunOptions:
    """Options of one run.

    Every other setting of the services comes from the settings file and the environment, which
    all processes read.
    """

    source: str
    out: Path
    delivery: Literal["live", "lossless"] = "lossless"
    preset: Literal["default", "paper"] = "default"
    detector: str | None = None
    model: str | Path | None = None
    model_class: int | None = None
    model_head: HeadName | None = None
    annotate: bool = False
    target: Literal["none", "nearest"] = "nearest"
    scale: float = 1.0
    fps: float | None = None
    loop: bool = False
    frames: int | None = None
    seconds: float | None = None
    web_port: int | None = None
    config: Path | None = None
    trace: Path | None = None
    robot: str = ""
    """Name by which commands choose this run."""
    progress: bool = True
    on_page: Callable[[str], None] | None = None
    """Called with the live page's address once it is served."""

    def detector_flags(self) -> list[str]:
        """Flags of the detector process."""
        flags = ["--preset", self.preset]
        flags += ["--detector", self.detector] if self.detector is not None else []
        flags += ["--model", str(self.model)] if self.model is not None else []
        flags += ["--model-class", str(self.model_class)] if self.model_class is not None else []
        flags += ["--model-head", self.model_head] if self.model_head is not None else []
        return flags

    def tracker_flags(self) -> list[str]:
        """Flags of the tracker process."""
        trace = ["--trace", str(self.trace)] if self.trace is not None else []
        return ["--preset", self.preset, *trace]

    def capture_flags(self) -> list[str]:
        """Flags of the capture process."""
        flags = [self.source, "--scale", str(self.scale)]
        flags += ["--loop"] if self.loop else []
        flags += ["--fps", str(self.fps)] if self.fps is not None else []
        flags += ["--frames", str(self.frames)] if self.frames is not None else []
        return flags
