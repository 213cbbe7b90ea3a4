"""`heel run` and `heel demo` with a network: the same bytes in any process, and clear refusals."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path

import pytest

from benchmarks.common import data_folder
from heel.services.detector.settings import NO_NETWORK
from heel.services.models.catalogue import KNOWN
from tests.support.processes import finished
from tests.unit.networks.drawn_networks import red_finder

pytest.importorskip("onnx")
SCENE = "scene:crossing?frames=40&width=320&height=240"
DEADLINE_S = 60.0


def heel(*arguments: str) -> tuple[int, str, str]:
    return finished("-m", "heel", *arguments, deadline_s=DEADLINE_S)


def test_a_lossless_run_with_a_network_equals_the_cores_in_one_process(tmp_path: Path) -> None:
    model = str(red_finder(tmp_path / "net.onnx"))
    config = tmp_path / "heel.toml"
    config.write_text("[detector]\nmodel_score = 0.02\nmodel_budget_ms = 0.001\n")
    for how in ("--lossless", "--in-process"):
        code, _, err = heel(
            "run", SCENE, "--out", str(tmp_path / how), how, "--detector", "onnx",
            "--model", model, "--config", str(config),
        )  # fmt: skip
        assert code == 0, err
    for name in ("tracks.txt", "commands.csv"):
        here, there = (
            (tmp_path / how / name).read_bytes() for how in ("--lossless", "--in-process")
        )
        assert here == there
    assert (tmp_path / "--lossless" / "tracks.txt").read_bytes(), "somebody in red is there"
    digest = hashlib.sha256(Path(model).read_bytes()).hexdigest()
    for how in ("--lossless", "--in-process"):
        told = json.loads((tmp_path / how / "summary.json").read_text())["perception"]
        assert told == {
            "detector": "onnx", "model": model, "model_sha256": digest,
            "model_near": None, "model_near_sha256": None, "tracker": "default",
        }  # fmt: skip


def test_the_network_that_is_there_is_used_without_a_flag_and_named(tmp_path: Path) -> None:
    models = data_folder() / "models"
    if not (models / KNOWN["yolox-nano"].file).is_file():
        pytest.skip("yolox-nano is not in the models of HEEL_DATA")
    code, out, err = finished(
        "-m", "heel", "run", SCENE, "--out", str(tmp_path), "--frames", "5",
        deadline_s=DEADLINE_S, HEEL_MODELS=str(models),
    )  # fmt: skip
    assert code == 0, err
    assert NO_NETWORK not in err
    digest = KNOWN["yolox-nano"].sha256
    assert f"people by detector onnx, network yolox-nano (sha256 {digest[:12]})" in out
    told = json.loads((tmp_path / "summary.json").read_text())["perception"]
    assert (told["model"], told["model_sha256"]) == ("yolox-nano", digest)


def test_without_a_network_one_line_says_what_one_gives_and_how_to_get_it(tmp_path: Path) -> None:
    code, out, err = heel("run", SCENE, "--out", str(tmp_path), "--frames", "5")
    assert code == 0, err
    assert err.count(NO_NETWORK) == 1
    assert "people by detector auto, tracker preset default" in out
    code, _, err = heel(
        "run", SCENE, "--out", str(tmp_path), "--frames", "5", "--model", "none", "--in-process"
    )
    assert code == 0, err
    assert NO_NETWORK not in err


@pytest.mark.parametrize("how", ["--lossless", "--in-process"])
def test_a_model_that_is_not_there_ends_the_run_with_its_name(how: str, tmp_path: Path) -> None:
    missing = str(tmp_path / "none.onnx")
    code, _, err = heel("run", SCENE, "--out", str(tmp_path), how, "--model", missing)
    assert code in (1, 2)
    assert f"model {missing}: no such file" in err
    assert "Traceback" not in err


def test_the_demo_says_that_boxes_of_the_simulator_need_no_detector(tmp_path: Path) -> None:
    code, _, err = heel("demo", "--out", str(tmp_path), "--detector", "ego", "--perception",
                        "simulated-boxes")  # fmt: skip
    assert code != 0
    assert "leave out --perception, or use --scene" in err


def test_with_a_network_the_demo_sees_in_pixels_and_says_so(tmp_path: Path) -> None:
    pytest.importorskip("panda3d", reason="the extra sim is not installed")
    model = str(red_finder(tmp_path / "net.onnx"))
    code, out, err = heel("demo", "--out", str(tmp_path), "--model", model, "--seconds", "5",
                          "--port", "0")  # fmt: skip
    assert code == 0, err
    assert "people were seen in the rendered pictures" in out
    log = (tmp_path / "logs" / "detector.log").read_text()
    assert re.search(r"received [1-9]\d*, sent [1-9]", log), log
    assert json.loads((tmp_path / "following.json").read_text())["perception"] == "pixels"
