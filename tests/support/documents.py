"""What README and docs tell people to type: their fenced blocks and the commands in their text."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from tests.support.processes import REPOSITORY

_BLOCK = re.compile(r"^( *)```([\w-]*)\n(.*?)^\1```$", re.DOTALL | re.MULTILINE)
_INLINE = re.compile(r"`((?:heel|make|python -m) [^`\n]+)`")


@dataclass(frozen=True)
class Block:
    """A fenced block: the page it stands on, relative to the repository, language and text."""

    page: str
    language: str
    text: str

    @property
    def commands(self) -> list[str]:
        """Lines of a shell block as they are typed: joined at backslashes, without comments."""
        lines = re.sub(r" *\\\n *", " ", self.text).splitlines()
        typed = [re.sub(r"(^|\s+)# .*$", "", line).strip() for line in lines]
        return [line for line in typed if line]


def pages() -> list[Path]:
    """Every page that people read."""
    roots = [REPOSITORY / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")]
    return [*roots, *sorted((REPOSITORY / "docs").rglob("*.md"))]


def blocks(language: str | None = None, page: str | None = None) -> list[Block]:
    """The fenced blocks of all pages, or those of one language, of one page."""
    found = [
        Block(file.relative_to(REPOSITORY).as_posix(), match[2], match[3])
        for file in ([REPOSITORY / page] if page else pages())
        for match in _BLOCK.finditer(file.read_text(encoding="utf-8"))
    ]
    return [block for block in found if language in (None, block.language)]


def inline_commands() -> list[tuple[str, str]]:
    """Commands within sentences and tables, each with its page."""
    return [
        (page.relative_to(REPOSITORY).as_posix(), match[1].replace("\\|", "|"))
        for page in pages()
        for match in _INLINE.finditer(_BLOCK.sub("", page.read_text(encoding="utf-8")))
    ]
