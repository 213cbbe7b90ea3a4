"""Numbers that a core gave when they were last looked at, kept beside the tests that compare.

A pinned number does not say what is right, but that something has moved: a constant, a formula, an
order of steps. Where a value matters (a distance, a speed, a wait), a test beside says what for.

A change that is meant to move figures renews the files, and says in its commit what moved and why:

    python -m pytest tests/unit/follower -k pinned --renew-pins
    git diff --stat -- '*/pinned/*.json'
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

Value = float | str | bool | None
Rows = Mapping[str, Sequence[Value]]
"""Values by what they are of: every row is one line of the file."""
_DIGITS = 8


@dataclass(frozen=True)
class Pinned:
    """Compares with the rows of one test in the file of its module, or renews them.

    Attributes:
        file: JSON, rows by test and by label.
        test: name of the test.
        renew: whether what is found is kept from now on.
    """

    file: Path
    test: str
    renew: bool

    def __call__(self, rows: Rows, relative: float = 1e-6, absolute: float = 1e-6) -> None:
        """Compare every row with what was kept.

        Args:
            rows: what is found now.
            relative, absolute: differences that may come of another processor's last digits; for
                what is computed from pictures more than the defaults.

        Raises:
            AssertionError: a value has moved, or a row is new or gone.
        """
        found = {label: [_plain(value) for value in row] for label, row in rows.items()}
        every = json.loads(self.file.read_text("utf-8")) if self.file.exists() else {}
        if self.renew:
            every[self.test] = found
            self.file.parent.mkdir(exist_ok=True)
            self.file.write_text(_written(every), "utf-8")
            return
        kept = every.get(self.test)
        assert kept is not None, f"{self.file} has nothing of {self.test}: --renew-pins keeps it"
        assert list(found) == list(kept), f"other rows: {sorted({*found} ^ {*kept})}"
        moved = [
            line
            for label, row in found.items()
            for line in _moved(label, kept[label], row, relative, absolute)
        ]
        assert not moved, (
            f"{len(moved)} numbers have moved; if they are meant to, --renew-pins: "
            + ("; ".join(moved[:8]))
        )


def sums(rows: Iterable[Sequence[float]]) -> list[float]:
    """Of a long run one number a column that any change moves: values weighted by when they were.

    Infinite ones count as 1000.
    """
    total: list[float] = []
    for number, row in enumerate(rows, 1):
        total = total or [0.0] * len(row)
        for column, value in enumerate(row):
            total[column] += (1.0 + math.sin(number)) * min(max(value, -1e3), 1e3)
    return total


def _plain(value: Value) -> Value:
    if isinstance(value, bool | str) or value is None:
        return value
    return float(f"{float(value):.{_DIGITS}g}")


def _moved(
    label: str, kept: Sequence[Value], found: Sequence[Value], relative: float, absolute: float
) -> list[str]:
    if len(kept) != len(found):
        return [f"{label}: {len(found)} values, were {len(kept)}"]
    return [
        f"{label}[{place}] is {now}, was {was}"
        for place, (was, now) in enumerate(zip(kept, found, strict=True))
        if not _same(was, now, relative, absolute)
    ]


def _same(was: Value, now: Value, relative: float, absolute: float) -> bool:
    if not isinstance(was, float) or not isinstance(now, float):
        return was == now
    if math.isnan(was) or math.isnan(now):
        return math.isnan(was) and math.isnan(now)
    return was == now or math.isclose(was, now, rel_tol=relative, abs_tol=absolute)


def _written(every: Mapping[str, Rows]) -> str:
    """JSON with a line for each row: a difference of two versions names what moved."""
    tests = []
    for test, rows in sorted(every.items()):
        lines = [f"  {json.dumps(label)}: {json.dumps(row)}" for label, row in rows.items()]
        tests.append(f" {json.dumps(test)}: {{\n" + ",\n".join(lines) + "\n }")
    return "{\n" + ",\n".join(tests) + "\n}\n"
