from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from pydantic import ValidationError

from heel.schemas import DriveState, HeelError, SimTruth, SimWorld
from heel.services.simulator.scenarios import scenario
from heel.services.simulator.settings import SimulatorSettings
from heel.services.simulator.state import CameraMount
from heel.services.simulator.truth_file import open_truth
from heel.services.simulator.wheels import TIMEOUT_S, Wheels


def told(linear_mps: float) -> DriveState:
    return DriveState(
        seq=1, state="driving", reason="x", estop=False, driver="simulated",
        linear_mps=linear_mps, angular_radps=-0.3,
    )  # fmt: skip


def test_wheels_obey_the_last_word_until_it_is_old() -> None:
    wheels = Wheels()
    assert wheels.speed(100.0) == (0.0, 0.0)
    assert not wheels.silent(100.0), "nobody has spoken yet"
    wheels.hear(told(0.5), 100.0)
    assert wheels.speed(99.99 + TIMEOUT_S) == (0.5, -0.3)
    assert wheels.speed(100.01 + TIMEOUT_S) == (0.0, 0.0)
    assert wheels.silent(100.01 + TIMEOUT_S)
    wheels.hear(told(0.2), 101.0)
    assert wheels.speed(101.1) == (0.2, -0.3)


def test_truth_is_one_json_object_a_line_and_there_at_once(tmp_path: Path) -> None:
    world = scenario("distractor-2", 3)
    path = tmp_path / "truth.jsonl"
    with open_truth(path) as truth:
        assert truth is not None
        truth.write(world.world_message())
        for seq in range(3):
            truth.write(world.truth(seq, CameraMount()))
            world.step(0.02, 0.5, 0.1)
        lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert SimWorld.model_validate_json(json.dumps(lines[0]["sim-world"])) == world.world_message()
    truths = [SimTruth.model_validate_json(json.dumps(line["sim-truth"])) for line in lines[1:]]
    assert [truth.seq for truth in truths] == [0, 1, 2]


def test_a_truth_file_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(HeelError, match=r"--truth .*give a file that can be written"):
        with open_truth(tmp_path / "missing" / "truth.jsonl"):
            pass
    with open_truth(None) as nothing:
        assert nothing is None


def test_somebody_has_to_see() -> None:
    SimulatorSettings(perception="simulated-boxes", pictures=False)
    with pytest.raises(ValidationError, match="nobody can see people in pixels"):
        SimulatorSettings(perception="pixels", pictures=False)
    with pytest.raises(ValidationError, match="delivery"):
        SimulatorSettings(delivery="lossless")


def test_the_default_settings_are_the_default_mount() -> None:
    mount, default = SimulatorSettings().mount(), CameraMount()
    assert mount.horizontal_fov_rad == pytest.approx(default.horizontal_fov_rad, abs=1e-4)
    assert (mount.width_px, mount.height_px, mount.fps, mount.height_m, mount.pitch_rad) == (
        default.width_px, default.height_px, default.fps, default.height_m, default.pitch_rad
    )  # fmt: skip


def test_without_panda3d_the_remedy_is_named_and_boxes_still_work() -> None:
    script = (
        "import sys; sys.modules['panda3d'] = None\n"
        "from schemas import HeelError\n"
        "import services.simulator.service, services.cli\n"
        "try: import services.simulator.render.renderer\n"
        "except HeelError as error: print(error)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=True
    )
    assert "pip install panda3d" in done.stdout
