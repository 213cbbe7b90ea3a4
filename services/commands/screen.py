"""Text that is shown anew: in place on a terminal, one below the other in a pipe."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from types import TracebackType
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from rich.live import Live


class Screen:
    """Shows some lines, then others in their place.

    Args:
        plain: whether they go below one another also on a terminal, as JSON does.
    """

    def __init__(self, plain: bool = False) -> None:
        self._live: Live | None = None
        self._plain = plain or not sys.stdout.isatty()

    def __enter__(self) -> Screen:
        if not self._plain:
            from rich.live import Live

            self._live = Live(screen=True, auto_refresh=False)
            self._live.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._live is not None:
            self._live.stop()

    @property
    def in_place(self) -> bool:
        """Whether lines take the place of the ones before them."""
        return self._live is not None

    def show(self, lines: Sequence[str]) -> None:
        """Show these lines, which are not markup."""
        text = "\n".join(lines)
        if self._live is None:
            typer.echo(text)
            return
        from rich.text import Text

        self._live.update(Text(text, overflow="ellipsis", no_wrap=True), refresh=True)
