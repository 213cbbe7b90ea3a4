"""Choosing without the sequence that is reported, on made-up claims."""

from __future__ import annotations

import pytest

from benchmarks.association_calibration import left_out, reliability_table


def claims(said: float, right: int, wrong: int) -> list[tuple[float, bool]]:
    return [(said, True)] * right + [(said, False)] * wrong


def test_a_sequence_is_judged_by_what_the_others_say() -> None:
    """The others say 0.5 and are right in 2 of 10, say 0.9 and are right in 8 of 10."""
    others = claims(0.5, 2, 8) + claims(0.9, 8, 2)
    found = left_out({"one": others, "other": others, "new": claims(0.7, 4, 0)})
    new = found[-4:]
    assert [was for _, was in new] == [True] * 4
    assert [said for said, _ in new] == pytest.approx([0.5] * 4)


def test_one_sequence_alone_has_no_others() -> None:
    assert left_out({"one": claims(0.9, 3, 1)}) == []
    assert "| all, fitted without | - |" in reliability_table({"one": claims(0.9, 3, 1)})
