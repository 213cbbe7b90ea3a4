"""Pictures of a folder in the order that a person means, and their frame numbers."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

_MAX_SPREAD = 10
"""Numbers that spread wider than this times their count are time stamps, not frame numbers."""
_DATE_AND_TIME = re.compile(
    r"(?<!\d)(?:19|20)\d\d[-_.]?[01]\d[-_.]?[0-3]\d[-_.T ]*[0-2]\d[-_.:hH]?[0-5]\d"
)
_FRACTION = re.compile(r"\d\.\d{1,3}\D*$")
"""A name that ends in a score or in seconds, like `person_12_0.93`."""


def number_frames(
    files: Iterable[Path], first_number: int | None = None, expected_count: int | None = None
) -> tuple[list[tuple[int, Path]], list[int]]:
    """Pair each picture with its index, and list the numbers that are missing.

    Pictures come in natural order: digits count as numbers, so that img2 precedes img10. A number
    in the names is the frame number if it is the only one that changes, or if it is the last and
    rises with the order; a date and time, a score or a number that leaps widely is none. Pictures
    without frame numbers are numbered as they come.

    Args:
        files: in any order; not empty.
        first_number: number of the frame with index 0; None takes the lowest there is.
        expected_count: frames there should be; None takes what there is.
    """
    ordered = sorted(files, key=_natural_key)
    numbers = _frame_numbers(ordered)
    if numbers is None:
        return list(enumerate(ordered)), []
    first = numbers[0]
    if first_number is not None:
        first = min(first, first_number)
    last = numbers[-1]
    if expected_count is not None:
        last = max(last, min(first + expected_count - 1, last + _MAX_SPREAD * len(ordered)))
    missing = sorted(set(range(first, last + 1)) - set(numbers))
    return [(number - first, path) for number, path in zip(numbers, ordered, strict=True)], missing


def ranges(numbers: Sequence[int], limit: int = 5) -> str:
    """`3, 7-9` of [3, 7, 8, 9]; the first `limit` runs only."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][1] + 1:
            runs[-1][1] = number
        else:
            runs.append([number, number])
    texts = [f"{a}" if a == b else f"{a}-{b}" for a, b in runs[:limit]]
    more = f" and more ({len(numbers)} in all)" if len(runs) > limit else ""
    return ", ".join(texts) + more


def _frame_numbers(ordered: Sequence[Path]) -> list[int] | None:
    """The frame number of every picture, rising; None if the names have none."""
    stems = [path.stem for path in ordered]
    if any(_DATE_AND_TIME.search(stem) or _FRACTION.search(stem) for stem in stems):
        return None
    columns = [[int(digits) for digits in re.findall(r"\d+", stem)] for stem in stems]
    texts = {re.sub(r"\d+", "0", stem) for stem in stems}
    numbers: list[int] | None = None
    if len(texts) == 1 and columns[0]:
        changing = [place for place, column in enumerate(zip(*columns, strict=True))
                    if len(set(column)) > 1]  # fmt: skip
        if len(changing) <= 1:
            place = changing[0] if changing else -1
            numbers = [column[place] for column in columns]
    if numbers is None and all(columns):
        numbers = [column[-1] for column in columns]
    if numbers is None or any(b <= a for a, b in itertools.pairwise(numbers)):
        return None
    leaps = numbers[-1] - numbers[0] >= _MAX_SPREAD * max(10, len(ordered))
    return None if leaps else numbers


def _natural_key(path: Path) -> tuple[list[tuple[int, int | str]], str]:
    parts = re.split(r"(\d+)", path.stem.casefold())
    key = [(0, int(part)) if part.isdecimal() else (1, part) for part in parts if part]
    return key, path.name
