"""A progress bar on terminals, silence elsewhere."""

from __future__ import annotations

import sys

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn


class RunProgress:
    """Shows how many frames are tracked; knows the total once the camera describes itself."""

    def __init__(self, wanted: bool) -> None:
        console = Console(file=sys.stderr)
        self._bar = Progress(
            TextColumn("tracked"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(),
            console=console, disable=not (wanted and console.is_terminal),
        )  # fmt: skip
        self._task = self._bar.add_task("tracked", total=None)

    def __enter__(self) -> RunProgress:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def update(self, tracked: int, total: int | None) -> None:
        """Show the number of frames tracked so far, of `total` if that is known."""
        self._bar.update(self._task, completed=tracked, total=total)
