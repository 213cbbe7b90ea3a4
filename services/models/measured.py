"""What the known networks were measured to do: `measured.json`, which a benchmark writes."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from heel.services.models.catalogue import KnownModel

FILE = Path(__file__).with_name("measured.json")


@dataclass(frozen=True)
class Measured:
    """Figures by the name of a network.

    Attributes:
        how: the command that measured them, and on what.
        models: name to figures, see `benchmarks/models.py`.
    """

    how: str
    models: dict[str, dict[str, Any]]

    def lines(self, model: KnownModel) -> list[str]:
        """What is known of a network, for people; nothing where its file was another one."""
        figures = self.models.get(model.name, {})
        if figures.get("sha256") != model.sha256:
            return []
        scores = ", ".join(f"{name} {value:.1f}" for name, value in figures["mota"].items())
        return [
            f"a look    {figures['look_ms']:.1f} ms; a whole frame of 640x480 "
            f"{figures['frame_ms']:.1f} ms",
            f"MOTA      {scores}",
        ]


def measured() -> Measured:
    """The figures that come with this version."""
    told = json.loads(FILE.read_text(encoding="utf-8"))
    return Measured(told["how"], told["models"])
