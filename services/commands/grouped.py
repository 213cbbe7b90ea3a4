"""`heel --help` with its commands in groups, by what they are for."""

from __future__ import annotations

from typing import Any

from typer.core import TyperGroup


class GroupedCommands(TyperGroup):
    """Lists commands below the titles that they were registered with (`rich_help_panel`)."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write a section for each title, in the order of its first command."""
        groups: dict[str, list[tuple[str, Any]]] = {}
        for name, command in self.commands.items():
            if not command.hidden:
                title = getattr(command, "rich_help_panel", None) or "Commands"
                groups.setdefault(str(title), []).append((name, command))
        widest = max((len(name) for name in self.commands), default=0)
        # Of all groups alike, so that the texts stand below one another.
        limit = formatter.width - 6 - widest
        for title, commands in groups.items():
            with formatter.section(title):
                formatter.write_dl(
                    [(name.ljust(widest), one.get_short_help_str(limit)) for name, one in commands]
                )
