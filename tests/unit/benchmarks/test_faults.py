"""The rig that kills and freezes: what it reads of units and of truth, and what its table says."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.faults import Trial, table
from benchmarks.operating.units import Unit
from benchmarks.operating.watch import fastest_mps
from heel.services.commands.systemd import Layout, unit_name, units


def test_a_unit_is_what_systemd_would_read() -> None:
    text = units(Layout(("/usr/bin/heel",), ("tracker",), user=True))[unit_name("tracker")]
    unit = Unit.parsed("tracker", text)
    assert unit.command == ("/usr/bin/heel", "tracker")
    assert (unit.watchdog_s, unit.restart_s, unit.most_starts, unit.within_s) == (2, 0.2, 5, 60)
    assert unit.prevented == {2}
    with pytest.raises(ValueError, match="another kind"):
        Unit.parsed("tracker", text.replace("on-failure", "always"))


def test_the_speed_is_that_of_the_last_episode(tmp_path: Path) -> None:
    file = tmp_path / "truth.jsonl"
    rows = [{"sim-world": {}}, *({"sim-truth": {"t_s": t, "linear_mps": 1.6}} for t in range(9)),
            {"sim-world": {}}, *({"sim-truth": {"t_s": t, "linear_mps": -0.1 * t}}
                                 for t in range(9))]  # fmt: skip
    file.write_text("".join(f"{json.dumps(row)}\n" for row in [{}, *rows]))
    assert fastest_mps(file, 1.0, 3.0) == pytest.approx(0.3)
    assert fastest_mps(file, 20.0, 30.0) is None


def test_the_table_counts_what_was_in_time_and_what_never_came_back() -> None:
    trials = [
        Trial("units", "drive", "SIGKILL", 2.0, 0.01, True, False, False),
        Trial("units", "drive", "SIGKILL", 6.0, 0.03, False, True, False),
        Trial("units", "drive", "SIGKILL", None, None, False, False, True),
    ]
    row = table(trials).splitlines()[-1]
    assert row == "| units | drive | SIGKILL | 3 | 2 | 1 | 4.0 | 6.0 | 0.03 | 1 | 1 | 1 |"
