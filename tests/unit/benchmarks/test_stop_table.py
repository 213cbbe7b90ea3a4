"""The table of stopping times in the documentation: new rows come in, others stay."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from benchmarks.stopping.rows import Row, write_table
from heel.schemas.errors import HeelError

ORDER = ["camera frozen", "router killed", "emergency stop"]


def test_rows_are_put_in_their_order_and_others_stay(tmp_path: Path) -> None:
    document = tmp_path / "drive.md"
    document.write_text("before\n<!-- measured -->\n<!-- end of measured -->\nafter\n")
    times_ms = tuple(float(time_ms) for time_ms in range(1, 21))
    write_table([Row("emergency stop", 50.0, times_ms)], ORDER, document)
    write_table([Row("camera frozen", 300.0, (250.0, math.inf))], ORDER, document)
    assert document.read_text().splitlines() == [
        "before",
        "<!-- measured -->",
        "| fault | trials | median | p95 | p99 | max | bound, ms |",
        "|---|---|---|---|---|---|---|",
        "| camera frozen | 2 | inf | inf | inf | inf | 300 |",
        "| emergency stop | 20 | 10 | 19 | 20 | 20 | 50 |",
        "<!-- end of measured -->",
        "after",
    ]


def test_a_document_without_a_place_for_it_is_named(tmp_path: Path) -> None:
    document = tmp_path / "drive.md"
    document.write_text("nothing here\n")
    with pytest.raises(HeelError, match="no place for the table"):
        write_table([], ORDER, document)
