"""Python-Markdown extension that puts into a page what is made from the code.

A line `<!-- made: settings -->` is replaced by what `_MADE` has under that name, and
`<!-- made: FILE.md -->` by a file of the repository's root without its heading; links of that file
into `docs/` then lead into the site.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from markdown import Extension, Markdown
from markdown.preprocessors import Preprocessor

from tools.site import REPOSITORY
from tools.site.commands_page import commands_page
from tools.site.settings_page import settings_page

_MADE: dict[str, Callable[[], str]] = {"settings": settings_page, "commands": commands_page}
_MARKER = re.compile(r"^<!-- made: ([\w.-]+) -->$")


def with_made_parts(lines: list[str]) -> list[str]:
    """The lines of a page with every marker replaced."""
    put: list[str] = []
    for line in lines:
        found = _MARKER.match(line)
        put += _made(found[1]).splitlines() if found else [line]
    return put


def _made(name: str) -> str:
    if name in _MADE:
        return _MADE[name]()
    text = (REPOSITORY / name).read_text(encoding="utf-8")
    return text.partition("\n")[2].replace("](docs/", "](")


class _Preprocessor(Preprocessor):  # type: ignore[misc]
    def run(self, lines: list[str]) -> list[str]:
        return with_made_parts(lines)


class MadeParts(Extension):  # type: ignore[misc]
    """Registers the preprocessor before those that take code blocks out of the text."""

    def extendMarkdown(self, md: Markdown) -> None:  # noqa: N802  (the library's name)
        md.preprocessors.register(_Preprocessor(md), "made-parts", 100)


def makeExtension() -> MadeParts:  # noqa: N802  (the library's name)
    """What Python-Markdown calls for `tools.site.extension`."""
    return MadeParts()
