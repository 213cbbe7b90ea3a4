"""What was measured, and its table in the documentation."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.common import median
from heel.schemas.errors import HeelError

_TABLE = re.compile(r"(<!-- measured -->\n)(.*?)(<!-- end of measured -->)", re.DOTALL)
_HEAD = "| fault | trials | median | p95 | p99 | max | bound, ms |\n|---|---|---|---|---|---|---|\n"


@dataclass(frozen=True)
class Row:
    """All trials of one fault, ms; infinity for a robot that did not stop."""

    name: str
    bound_ms: float
    times_ms: tuple[float, ...]

    def percentile_ms(self, percent: float) -> float:
        """The smallest measured time that so many percent of the trials do not exceed."""
        return float(np.percentile(self.times_ms, percent, method="inverted_cdf"))

    @property
    def worst_ms(self) -> float:
        """The longest."""
        return max(self.times_ms)

    def cells(self) -> list[str]:
        """Name, trials, median, p95, p99, maximum and bound, as text."""
        figures = (
            median(self.times_ms), self.percentile_ms(95), self.percentile_ms(99), self.worst_ms,
            self.bound_ms,
        )  # fmt: skip
        return [self.name, str(len(self.times_ms)), *(f"{figure:.0f}" for figure in figures)]


def write_table(rows: Sequence[Row], order: Sequence[str], document: Path) -> None:
    """Put the rows into the document's table; rows of other faults stay as they are.

    Args:
        rows: what was measured.
        order: names of all faults; others leave the table.
        document: has the table between `<!-- measured -->` and `<!-- end of measured -->`.

    Raises:
        HeelError: the document cannot be read or has no such place.
    """
    try:
        text = document.read_text(encoding="utf-8")
    except OSError as error:
        raise HeelError(f"{document}: {error.strerror}: name another with --write") from None
    found = _TABLE.search(text)
    if found is None:
        raise HeelError(f"{document}: no place for the table: put `<!-- measured -->` there")
    lines = {line.split("|")[1].strip(): line for line in found[2].splitlines()[2:]}
    lines |= {row.name: f"| {' | '.join(row.cells())} |" for row in rows}
    table = "".join(f"{lines[name]}\n" for name in order if name in lines)
    document.write_text(
        text[: found.start(2)] + _HEAD + table + text[found.end(2) :], encoding="utf-8"
    )
