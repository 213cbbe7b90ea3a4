"""The command reference: what `heel COMMAND --help` prints."""

from __future__ import annotations

import re

import typer
from typer.testing import CliRunner

from heel.services.cli import app
from heel.services.runtime.settings import known_tables

# As wide as the lines of the docs, so that a help text needs no scroll bar.
_COLUMNS = 100


def command_names() -> list[str]:
    """Every verb of `heel`, in the order of `heel --help`, each with those that it has itself."""
    found: list[str] = []
    commands = getattr(typer.main.get_command(app), "commands")  # noqa: B009  (untyped by typer)
    for name, command in commands.items():
        found += [name, *(f"{name} {own}" for own in getattr(command, "commands", ()))]
    return found


def commands_page() -> str:
    """Markdown: a section for each command; flags of services are left to the settings page."""
    return "\n".join(["```text", _help(), "```", "", *map(_section, command_names())])


def _section(name: str) -> str:
    text = _help(*name.split())
    if name in known_tables():
        # Each of its settings is a flag.
        text = re.split(r"^Options:$", text, maxsplit=1, flags=re.MULTILINE)[0].rstrip()
        return (
            f"## heel {name}\n\n```text\n{text}\n```\n\nIts flags are the settings of "
            f"`[{name}]`, `[zenoh]` and `[log]` ([settings](settings.md)), and `--config FILE` "
            "and `--show-config`.\n"
        )
    return f"## heel {name}\n\n```text\n{text}\n```\n"


def _help(*words: str) -> str:
    done = CliRunner().invoke(
        app, [*words, "--help"], prog_name="heel", terminal_width=_COLUMNS,
        env={"COLUMNS": str(_COLUMNS), "NO_COLOR": "1"},
    )  # fmt: skip
    if done.exit_code != 0:
        raise RuntimeError(f"heel {' '.join(words)} --help ended with {done.exit_code}")
    return done.output.rstrip()
