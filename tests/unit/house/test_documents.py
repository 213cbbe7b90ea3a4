"""Pages say nothing that cannot be typed, opened or read in the code."""

from __future__ import annotations

import importlib.util
import re
import shlex
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import typer
from pydantic import BaseModel

from heel.evaluation.sequence_scores import SequenceScores
from heel.schemas.export import json_schemas
from heel.services.capture.pan_window import PanSettings
from heel.services.cli import app
from heel.services.detector.interface import GROUP as DETECTORS
from heel.services.drive.drivers import ENTRY_POINTS as DRIVERS
from heel.services.runtime.settings import LogSettings, ZenohSettings, known_tables
from tests.support.documents import blocks, inline_commands, pages
from tests.support.processes import REPOSITORY

_LANGUAGES = {"sh", "python", "toml", "yaml", "text"}
_LINK = re.compile(r"\]\(([^)\s]+)\)")
_PATH = re.compile(
    r"`((?:services|schemas|evaluation|benchmarks|tests|tools|examples|docs|src)/[^`\s]*)`"
)
_FLAG = re.compile(r"(?<![\w-])--[a-z][a-z0-9-]*")


@cache
def verbs() -> dict[str, set[str]]:
    """The flags of each `heel` command."""
    commands: dict[str, Any] = getattr(typer.main.get_command(app), "commands")  # noqa: B009
    for group in [name for name, command in commands.items() if hasattr(command, "commands")]:
        commands |= {f"{group} {name}": one for name, one in commands[group].commands.items()}
    return {
        name: {flag for one in command.params for flag in (*one.opts, *one.secondary_opts)}
        | {"--help"}
        for name, command in commands.items()
    }


@cache
def targets() -> set[str]:
    makefile = (REPOSITORY / "Makefile").read_text(encoding="utf-8")
    return set(re.findall(r"^([a-z0-9-]+):", makefile, re.MULTILINE))


def shell_lines() -> list[tuple[str, str]]:
    return [(block.page, line) for block in blocks("sh") for line in block.commands]


def known(line: str) -> str | None:
    """What is wrong with a command, by its words alone; None if nothing is."""
    words = shlex.split(line.removesuffix("&").strip())
    while words and re.fullmatch(r"[A-Z_]+=.*", words[0]):
        words = words[1:]
    if words[0] == "heel":
        return _known_verb(words[1:])
    if words[0] == "make":
        unknown = [word for word in words[1:] if "=" not in word and word not in targets()]
        return f"no targets {unknown}" if unknown else None
    if words[:2] == ["python", "-m"]:
        return _known_module(words[2], line)
    return None


def _known_verb(words: list[str]) -> str | None:
    if not words or words[0] in (
        "--version",
        "--help",
        "--install-completion",
        "COMMAND",
        "SERVICE",
        "X",
        "...",
    ):
        return None
    if words[0] not in verbs():
        return f"no command {words[0]}"
    verb = " ".join(words[:2])
    if any(name.startswith(f"{words[0]} ") for name in verbs()):
        if verb not in verbs():
            return f"no command {verb}"
        words = [verb, *words[2:]]
    unknown = set(_FLAG.findall(" ".join(words))) - verbs()[words[0]]
    return f"no flags {sorted(unknown)}" if unknown else None


def _known_module(module: str, line: str) -> str | None:
    if module in ("heel.services.X", "heel.services.NAME"):
        return None
    found = importlib.util.find_spec(module)
    if found is None or found.origin is None:
        return f"no module {module}"
    home = Path(found.origin)
    files = home.parent.glob("*.py") if home.name == "__init__.py" else [home]
    source = "".join(file.read_text(encoding="utf-8") for file in files)
    missing = [flag for flag in _FLAG.findall(line)
               if flag not in source and flag[2:].replace("-", "_") not in source]  # fmt: skip
    return f"no flags {missing}" if missing else None


@pytest.mark.parametrize(("page", "line"), shell_lines() + inline_commands())
def test_every_command_and_flag_exists(page: str, line: str) -> None:
    assert known(line) is None, f"{page}: {line}: {known(line)}"


def test_a_command_that_does_not_exist_is_found() -> None:
    assert known("heel fly") == "no command fly"
    assert known("heel models fly") == "no command models fly"
    assert known("heel models get x --to y") == "no flags ['--to']"
    assert known("heel run a.mp4 --out x --nonsense") == "no flags ['--nonsense']"
    assert known("make nothing") == "no targets ['nothing']"
    assert known("python -m benchmarks.nothing") == "no module benchmarks.nothing"
    assert known("python -m benchmarks.speed --nonsense") == "no flags ['--nonsense']"


def test_every_block_says_its_language() -> None:
    odd = [(block.page, block.language) for block in blocks() if block.language not in _LANGUAGES]
    assert not odd


@pytest.mark.parametrize("block", blocks("toml"), ids=lambda block: block.page)
def test_every_settings_file_in_the_docs_is_accepted(block: Any) -> None:
    tables = tomllib.loads(block.text)
    if "project" in tables:
        assert set(tables["project"]["entry-points"]) <= {DRIVERS, DETECTORS}
        return
    models = {**known_tables(), "zenoh": ZenohSettings, "log": LogSettings}
    for name, table in tables.items():
        models[name].model_validate(table)


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.name)
def test_every_link_within_the_repository_leads_somewhere(page: Path) -> None:
    for target in _LINK.findall(page.read_text(encoding="utf-8")):
        if "://" in target:
            continue
        name, _, anchor = target.partition("#")
        file = (page.parent / name).resolve() if name else page
        assert file.exists(), f"{page.name}: {target}"
        if anchor and file.suffix == ".md" and "made:" not in file.read_text(encoding="utf-8"):
            assert anchor in _anchors(file), f"{page.name}: {target}"


def _anchors(file: Path) -> set[str]:
    headings = re.findall(r"^#+ (.*)$", file.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-")
            for heading in headings}  # fmt: skip


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.name)
def test_every_path_that_is_named_exists(page: Path) -> None:
    for named in _PATH.findall(page.read_text(encoding="utf-8")):
        pattern = re.sub(r"<[a-z]+>|NAME|\bX\b", "*", named.rstrip("/"))
        assert list(REPOSITORY.glob(pattern)), f"{page.name}: {named}"


_WORDS = {
    "cap_add", "shared_memory_full", "sequence_file",
    # Of `heel.api`, which are no fields of messages.
    "time_s", "age_s",
    # A model of lenses, by ROS's name.
    "plumb_bob",
    # Of Prometheus, and of `heel status --json`.
    "heel_emergency_stop", "estop_of",
}  # fmt: skip
"""Other words with an underscore: of Docker, health's details, the map of rooms, Python."""


@pytest.mark.parametrize(
    "page",
    [page for page in pages() if page.name != "CONTRIBUTING.md" and page.parent.name != "records"],
    ids=lambda page: page.name,
)
def test_every_setting_and_field_that_is_named_exists(page: Path) -> None:
    models: list[type[BaseModel]] = [
        *known_tables().values(), ZenohSettings, LogSettings, PanSettings, SequenceScores,
    ]  # fmt: skip
    known = _WORDS | {field for model in models for field in model.model_fields}
    for contract in json_schemas().values():
        schema = contract["schema"]
        for part in (schema, *schema.get("$defs", {}).values()):
            known |= set(part.get("properties", {}))
    named = re.findall(r"`([a-z]+(?:_[a-z0-9]+)+)`", page.read_text(encoding="utf-8"))
    assert set(named) - known == set()
