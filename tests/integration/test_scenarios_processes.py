"""The closed loop of the cores foretells what becomes of an episode through the real processes."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

import pytest

pytestmark = pytest.mark.slow
EPISODES = [("straight", 0), ("doorway", 0), ("distractor-2", 0)]


def scenarios(name: str, seed: int, *flags: str) -> Any:
    done = subprocess.run(
        [sys.executable, "-m", "heel", "scenarios", "--episodes", "1", "--scenario", name,
         "--seed", str(seed), "--json", *flags],
        capture_output=True, text=True, timeout=115, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def outcome(report: Any) -> tuple[bool, bool, bool]:
    """Kept to the end, touched somebody, followed somebody else for long."""
    scores = report["overall"]
    return scores["sr"] == 1.0, scores["cr"] > 0.0, scores["wrong_time"] > 0.02


@pytest.mark.parametrize(("name", "seed"), EPISODES)
@pytest.mark.timeout(240)
def test_processes_and_cores_come_to_the_same_outcome(name: str, seed: int) -> None:
    through_cores = scenarios(name, seed, "--jobs", "1")
    through_processes = scenarios(name, seed, "--processes")

    assert through_processes["through"] == "processes"
    assert through_processes["real_time_factor"] < 1.1
    assert outcome(through_processes) == outcome(through_cores) == (True, False, False)
