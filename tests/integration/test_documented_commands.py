"""Every command and every Python block of README and docs is run, or listed with the reason.

A line that stands on a page and in none of the tables below is a failure, and so is an entry that
stands on no page any more.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import cv2
import pytest

from heel.schemas import Health, decode, keys
from heel.services.capture.sources import open_source
from heel.services.pipeline import scene_truth
from tests.integration.test_readme import free_port, run, started
from tests.support import network
from tests.support.documents import Block, blocks
from tests.support.processes import REPOSITORY, inherited_environment
from tests.support.recordings import image, info, recording

pytestmark = pytest.mark.timeout(300)

SCENE = "scene:demo?frames=300&width=320&height=240"

HERE = {
    "heel run 'scene:crossing?frames=120' --out results --annotate",
    "heel eval ground_truth results",
    "heel run incident.mp4 --out incident --annotate --trace incident.jsonl",
    "heel why incident.jsonl --id 7",
    "heel why incident.jsonl --frame 412",
    "heel why incident.jsonl --frame 412 --frames incident.mp4 --tracks incident/tracks.txt "
    "--strip why.png",
    "heel report incident --trace incident.jsonl",
    "heel report recording.mcap",
    "heel calibrate person walk.mp4 --person-height 1.75 --fov-deg 90 --out camera.toml",
    "heel track-detections ../shared/data/PETS09-S2L1 --out tracks.txt",
    "heel track-detections det.txt --out tracks.txt --fps 25 --image-size 1920x1080",
    "heel track-detections det.txt --out tracks.txt --fps 25 --frames img1 --config settings.toml",
    "heel capture 'pan:recording.mp4?width=384&height=288'",
    "heel follower --max-linear-mps 0",
    "heel follow 320 240",
    "heel drive --driver log",
    "heel record --check recording.mcap",
    "heel run recording.mcap --out again",
    "heel replay recording.mcap --topics image,info --rate 0.5",
    "heel capture /dev/video0 --calibration camera.toml",
}
"""Run below, with drawn scenes in place of cameras and recordings."""

SLOW = {
    "heel demo --scenario crowd --seed 2 --seconds 60": "a minute",
    "heel simulator doorway --seed 7 --truth truth.jsonl": "an episode takes its time",
    "heel scenarios": "42 episodes; one is run",
    "heel scenarios --scenario twin --seed 7 --episodes 1 --out DIR --video": "renders",
    "heel scenarios --processes --scenario straight --episodes 1": "an episode takes its time",
    "heel scenarios --episodes 84 --seed 5000": "84 episodes; one is run",
    "heel scenarios --episodes 84 --seed 5000 --json": "84 episodes; one is run",
    "heel scenarios --postures --no-ranges --uncalibrated": "27 episodes; one is run",
    "heel scenarios --everyday --episodes 32 --seed 12000": "32 episodes; one is run",
    "heel scenarios --everyday --episodes 112 --seed 12000": "112 episodes; one is run",
    "heel scenarios --pixels --episodes 112 --seed 9100": "112 episodes; one is run",
    "python -m benchmarks.rendering": "renders",
}
"""Run by the slow test below, of many episodes one."""

_README = "tests/integration/test_readme.py::"
_SERVICES = _README + "test_one_service_each_and_the_commands_for_what_is_running"
_TOOLS = "tests/integration/test_control.py::"
_DATAGRAMS = "tests/integration/test_datagrams.py::"
_REMOTE = "tests/integration/test_swap.py::test_tracks_go_on_when_a_service_moves_to_another_host"
_DOCKER = "tests/docker/test_docs.py::test_the_commands_do_what_the_page_says"
_DEMO_PROFILE = "tests/docker/test_demo.py::test_the_profile_shows_a_robot_in_a_world_of_its_own"
_STOPPING = "tests/integration/test_time_to_stop.py::test_the_robot_stands_in_time"
_RECORDING = "tests/integration/test_recording.py::"
_MODEL = "tests/integration/test_run_with_model.py::"

_TAKEOVER = (
    "tests/integration/test_takeover.py::test_trackers_take_over_from_each_other_with_the_same_ids"
)

ELSEWHERE = {
    "heel tracker --standby --instance remote &": _TAKEOVER,
    "heel swap tracker": _TAKEOVER,
    "heel calibrate board board.mp4 --board 9x6 --square-mm 25 --out lens.yaml":
        "tests/unit/geometry/test_board.py::test_from_pictures_to_a_file_that_capture_reads",
    "heel capture /dev/video0 --lens lens.yaml":
        "tests/unit/capture/test_describe.py::test_a_lens_tells_field_of_view_and_distortion",
    "heel foxglove":
        "tests/integration/test_foxglove.py::test_a_viewer_gets_pictures_marks_and_messages",
    "heel demo --scene": _README + "test_the_drawn_scene_is_played_once_and_scored",
    "heel demo": "tests/integration/test_demo.py::test_it_ends_after_so_long_and_says_how_it_went",
    "heel run video.mp4 --out results --annotate": _README + "test_recording_commands",
    "heel eval ground_truth results --plot plots": _README + "test_recording_commands",
    "heel run video.mp4 --out live --live": _README + "test_recording_commands",
    "heel run video.mp4 --out results --model yolox_nano.onnx":
        _MODEL + "test_a_lossless_run_with_a_network_equals_the_cores_in_one_process",
    "heel run video.mp4 --out results --model yolox-nano":
        _MODEL + "test_the_network_that_is_there_is_used_without_a_flag_and_named",
    **dict.fromkeys(
        ("heel models list", "heel models get yolox-nano --from FILE", "heel models check",
         "heel models path person-192", "heel models remove person-192"),
        "tests/unit/models/test_models_command.py::"
        "test_a_network_is_got_listed_found_checked_and_removed",
    ),
    "docker compose logs detector":
        "tests/docker/test_docs.py::test_a_network_in_the_folder_is_used",
    "heel status": _SERVICES,
    **dict.fromkeys(
        ("heel status --all", "heel web --robots all --port 8480"),
        "tests/integration/test_robots.py::"
        "test_two_robots_are_listed_and_one_that_ends_is_missed",
    ),
    **dict.fromkeys(
        ("heel router --listen tcp/127.0.0.1:7447",
         "heel router --listen tcp/127.0.0.1:7448 --connect tcp/127.0.0.1:7447"),
        "tests/integration/test_robots.py::"
        "test_a_stop_reaches_a_robot_on_another_router_that_is_linked",
    ),
    "heel follow nearest": _SERVICES,
    "heel stop": _SERVICES,
    "heel resume": _SERVICES,
    "heel doctor": _TOOLS + "test_the_doctor_finds_a_run_in_order",
    "heel top": _TOOLS + "test_what_goes_on_ends_at_ctrl_c",
    "heel topics": _TOOLS + "test_topics_are_listed_with_rate_and_sender",
    "heel hz tracks": _TOOLS + "test_how_often_and_how_much_comes_is_told",
    "heel bw": _TOOLS + "test_how_often_and_how_much_comes_is_told",
    "heel echo state": _TOOLS + "test_messages_are_told_decoded",
    "heel systemd units --config /etc/heel/heel.toml --udev":
        "tests/unit/commands/test_systemd.py::test_a_stack_and_settings_of_ones_own",
    "heel systemd --user":
        "tests/unit/commands/test_systemd.py::test_the_users_own_units_are_where_systemd_looks",
    "heel follower --cameras rear":
        "tests/integration/test_follower_service.py::"
        "test_another_camera_takes_over_the_person_that_leaves_the_picture",
    "heel router": _SERVICES,
    "heel capture scene:demo --loop": _SERVICES,
    "heel detector": _SERVICES,
    "heel tracker": _SERVICES,
    "heel follower": _SERVICES,
    "heel drive": _SERVICES,
    "heel web": _SERVICES,
    "heel router --listen tcp/0.0.0.0:7447 --users-file users.txt":
        _README + "test_remote_host_recipe",
    "heel capture /dev/video0 --user robot --password-file secret":
        _README + "test_remote_host_recipe",
    "heel detector --connect tcp/robot.local:7447 --user remote --password-file secret2":
        _README + "test_remote_host_recipe",
    "umask 077": _REMOTE,
    "echo choose-another-one > password": _REMOTE,
    "export HEEL_ZENOH__USER=heel HEEL_ZENOH__PASSWORD_FILE=$PWD/password": _REMOTE,
    'echo "heel:$(cat password)" > users.txt': _REMOTE,
    "heel router --listen tcp/127.0.0.1:7447,tcp/192.168.1.7:7447 --users-file users.txt &":
        _REMOTE,
    "heel capture /dev/video0 &": _REMOTE,
    "heel detector &": _REMOTE,
    "heel tracker &": _REMOTE,
    "heel follower &": _REMOTE,
    "export HEEL_ZENOH__CONNECT=tcp/192.168.1.7:7447": _REMOTE,
    "heel detector --instance remote &": _REMOTE,
    "heel web --instance remote &": _REMOTE,
    "heel drive --instance remote --driver log &": _REMOTE,
    "heel router --listen tcp/127.0.0.1:7447,tcp/192.168.1.7:7447,udp/192.168.1.7:7447 "
    "--users-file users.txt &": _DATAGRAMS + "test_udp_asks_for_the_password_too",
    "heel drive --instance remote --driver log --connect udp/192.168.1.7:7447 &":
        _DATAGRAMS + "test_a_lost_command_by_udp_is_lost_and_holds_up_none_behind_it",
    "heel drive --driver serial-board --driver-options /dev/ttyUSB0":
        "tests/unit/drive/test_serial_example.py::test_the_board_is_told_velocities_and_stops",
    **dict.fromkeys(
        ("heel security init security --host robot.local", "heel security show security",
         "heel security add security anna --role operate",
         "heel security add security ben --role watch",
         "heel security add security gpu-detector --role detector",
         "heel security remove security ben", "heel security renew security",
         "heel security login security anna --role operate --password-file password",
         "heel security login security ben --role watch --password-file password",
         "heel security login security ben --role nobody"),
        "tests/unit/commands/test_security_command.py::"
        "test_the_commands_of_the_page_make_a_folder_and_change_who_is_in_it",
    ),
    **dict.fromkeys(
        ("heel router --config-file security/router.json5 &",
         "heel capture /dev/video0 --config-file security/capture.json5 &",
         "heel detector --config-file security/detector.json5 &",
         "heel tracker --config-file security/tracker.json5 &",
         "heel follower --config-file security/follower.json5 &",
         "heel drive --driver log --config-file security/drive.json5 &",
         "heel status --config-file security/operator.json5"),
        "tests/integration/test_security_stack.py::"
        "test_a_robot_with_certificates_sees_follows_and_stops",
    ),
    "heel record --out recordings":
        _RECORDING + "test_sigkill_costs_a_recording_less_than_a_second",
    "heel record --last 60 --out incidents":
        _RECORDING + "test_the_last_seconds_become_a_file_when_they_are_asked_for",
    "heel record --save":
        _RECORDING + "test_the_last_seconds_become_a_file_when_they_are_asked_for",
    "heel replay recording.mcap": "tests/unit/commands/test_replay.py::"
        "test_messages_are_due_as_they_came_and_faster_by_a_factor",
    "heel web --config-file security/web.json5 --host 0.0.0.0 --users-file security/page-users "
    "--certificate security/page.pem &":
        "tests/integration/test_web_login.py::"
        "test_without_a_login_there_is_the_login_and_nothing_else",
    "docker compose build": _DOCKER,
    "docker compose up -d": _DOCKER,
    "docker compose ps": _DOCKER,
    "docker compose exec -T web heel status": _DOCKER,
    "docker compose logs tracker": _DOCKER,
    "docker compose down -v": _DOCKER,
    "HEEL_SOURCE=/videos/walk.avi docker compose up -d": _DOCKER,
    "docker compose logs capture": _DOCKER,
    "docker compose --profile demo up -d": _DEMO_PROFILE,
    "docker compose --profile demo down -v": _DEMO_PROFILE,
    "docker compose --profile demo up":
        _README + "test_docker_commands_are_those_of_the_docker_page_whose_commands_a_test_types",
    "docker compose up":
        _README + "test_docker_commands_are_those_of_the_docker_page_whose_commands_a_test_types",
    "HEEL_SOURCE=/videos/walk.avi docker compose up":
        _README + "test_docker_commands_are_those_of_the_docker_page_whose_commands_a_test_types",
    "make results": _README + "test_what_make_results_and_make_bench_call_runs_on_a_drawn_scene",
    "make bench": _README + "test_what_make_results_and_make_bench_call_runs_on_a_drawn_scene",
    "python -m benchmarks.time_to_stop --trials 20 --write docs/records/stopping.md": _STOPPING,
    'python -m benchmarks.time_to_stop --trials 50 --only "emergency stop,heel stop" '
    "--write docs/records/stopping.md": _STOPPING,
}  # fmt: skip
"""Run by a test of its own, by name."""

IN_CI = {"make demo", "make test", "make docs", "make lint", "make layers", "make types"}
"""Steps of `.ci/run`."""

NOT_RUN = {
    "heel scenarios --pixels --episodes 84 --seed 73000 --model person-192": "an hour; a network",
    "python -m benchmarks.remote --write docs/records/remote.md": "network namespaces, and minutes",
    "python -m benchmarks.soak --minutes 30 --write docs/records/soak.md": "half an hour",
    "pip install ros-rclpy ros-geometry-msgs ros-nav-msgs ros-sensor-msgs ros-rmw-fastrtps-cpp":
        "100 packages; make test-ros2 installs them",
    "pip install ros-visualization-msgs ros-diagnostic-msgs": "as above",
    ".venv-ros2/bin/python -m benchmarks.ros2 --write docs/records/ros2.md":
        "needs rclpy, minutes long",
    "python -m benchmarks.ros2_loop --python .venv-ros2/bin/python --model person-192 "
    "--write docs/records/ros2.md": "needs rclpy, a quarter of an hour",
    "python -m benchmarks.ros2_loop --python .venv-ros2/bin/python --no-episodes --kills 20 "
    "--write docs/records/ros2.md": "needs rclpy, minutes long",
    "pip install rosbags": "in [all]",
    "heel ros2 --rmw zenoh --check": "needs a robot; tests/integration/test_ros2_zenoh.py has one",
    "heel ros2 --rmw zenoh --ros-router tcp/127.0.0.1:7447 --horizontal-fov-deg 69": "as above",
    "heel ros2 --check": "needs a robot's ROS; tests/ros2 runs the bridge beside one",
    "heel ros2 --image-topic camera/image_raw --command-topic cmd_vel --horizontal-fov-deg 69":
        "needs a robot's ROS; tests/ros2 runs the bridge beside one",
    "make check": "its parts are steps of .ci/run",
    ". .venv/bin/activate": "the tests' own environment is active",
    "heel models get yolox-nano":
        "downloads from its author; tests/unit/models/test_fetch.py does from a server of its own",
    "heel models get person-192": "as above",
    "HEEL_MODELS=./models heel models get yolox-nano": "as above",
    "python -m benchmarks.models --write docs/records/models.md":
        "recordings, and networks that Heel does not ship",
    "python -m tools.wheels --write docs/records/wheels.md":
        "asks the package index; tests/unit/models/test_real_index.py does it when asked",
    "sudo chown 10001 security/*.json5 security/page.pem security/page-users": "needs another user",
    "HEEL_PUBLISH=0.0.0.0 docker compose -f docker-compose.yml -f docker-compose.secure.yml up -d":
        "listens on the whole network; tests/unit/security/test_compose.py reads the files",
    "heel capture /dev/video2 --camera rear --instance rear --mount-yaw-deg 180":
        "hardware: a second camera; benchmarks/scale.py starts the like",
    "heel detector --camera rear --instance rear": "as above",
    "heel tracker --camera rear --instance rear": "as above",
    "python -m benchmarks.scale --write docs/records/scale.md":
        "minutes on a calm machine; it is its own test",
    "python -m benchmarks.faults --trials 20 --write docs/records/faults.md":
        "an hour on a calm machine; test_demo.py kills and freezes services",
    "python -m benchmarks.hostile_messages --write docs/records/soak.md":
        "ten minutes; test_hostile_messages.py sends fewer",
    "python -m benchmarks.linked_routers --write docs/records/scale.md":
        "a minute on a calm machine; tests/integration/test_robots.py links two routers",
    "docker compose --profile demo build": "tests/docker/conftest.py builds the same image",
    "docker buildx bake -f docker-bake.hcl": "the same Dockerfile as `docker compose build`",
    "docker buildx create --use": "changes the developer's Docker",
    "docker buildx bake -f docker-bake.hcl all": "emulates another computer, for half an hour",
    "heel capture /dev/v4l/by-id/usb-046d_HD_Pro_Webcam_C920-video-index0 "
    "--camera-width 1280 --camera-height 720 --camera-fourcc MJPG --fps 30":
        "hardware: a USB camera",
    "heel scenarios --pixels --model yolox_nano.onnx --episodes 14 --seed 9200":
        "a network that Heel does not ship, and half an hour",
    "python -m benchmarks.moving_camera --model yolox_nano.onnx "
    "--write docs/records/moving-camera.md": "recordings, and a network that Heel does not ship",
    "python -m benchmarks.empty_clicks --worlds 5 --anywhere 16 "
    "--write docs/records/scenarios.md": "an hour; tests/unit/benchmarks tests its parts",
    "python -m benchmarks.swaps --swaps 50 --kills 10 --write docs/records/swaps.md":
        "minutes, and a machine of its own; test_takeover.py takes over, too",
    "make mutants": "hours",
    "python -m benchmarks.mutants --sample 40": "an hour; tests/unit/benchmarks tests its parts",
    "python -m benchmarks.mutants --only pointed/": "an hour; as above",
    "python -m benchmarks.mutants --rooms follower --tests "
    "tests/unit/follower/test_follower_parts_pinned.py,"
    "tests/unit/follower/test_follower_worlds_pinned.py --seconds 40": "an hour; as above",
    "python -m benchmarks.mutants --rooms detector --tests "
    "tests/unit/detector/test_pointed_pinned.py,"
    "tests/unit/detector/test_pointed_parts.py,"
    "tests/unit/detector/test_background_pinned.py,"
    "tests/unit/detector/test_neural_parts_pinned.py --seconds 25": "an hour; as above",
    "python -m benchmarks.mutants --rooms tracker --sample 60 --seed 1 --seconds 20 "
    "--tests tests/unit/tracker/test_tracker_pinned.py": "an hour; as above",
    "python -m benchmarks.pictures docs": "overwrites the README's picture; needs Chromium",
}  # fmt: skip
"""Nothing runs these; `tests/unit/house/test_documents.py` checks that words and flags exist."""


def documented() -> set[str]:
    return {line for block in blocks("sh") for line in block.commands}


def test_every_documented_command_is_run_or_listed_with_a_reason() -> None:
    listed = HERE | set(SLOW) | set(ELSEWHERE) | IN_CI | set(NOT_RUN)
    assert documented() - listed == set(), "on a page, and nothing runs it: add it to a table here"
    assert listed - documented() - IN_CI == set(), "on no page any more"
    parts = [HERE, SLOW, ELSEWHERE, IN_CI, NOT_RUN]
    assert sum(map(len, parts)) == len(listed), "in two tables"


def test_the_tests_and_steps_that_are_named_exist() -> None:
    for line, name in ELSEWHERE.items():
        file, _, function = name.partition("::")
        assert f"def {function}(" in (REPOSITORY / file).read_text(encoding="utf-8"), line
    steps = (REPOSITORY / ".ci" / "run").read_text(encoding="utf-8")
    run_there = {f"make {target}" for line in re.findall(r"^make (.+)$", steps, re.MULTILINE)
                 for target in line.split()}  # fmt: skip
    assert run_there >= IN_CI


@pytest.fixture(scope="module")
def desk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what the pages speak of: recordings, boxes, ground truth."""
    root = tmp_path_factory.mktemp("desk")
    folder = root / "work"
    sequence = root / "shared" / "data" / "PETS09-S2L1"
    (sequence / "det").mkdir(parents=True)
    (folder / "img1").mkdir(parents=True)
    (folder / "ground_truth" / "gt").mkdir(parents=True)
    with open_source(SCENE) as source, ExitStack() as stack:
        film = cv2.VideoWriter.fourcc(*"mp4v")
        # The window that turns is cut out of a recording wider than itself.
        sizes = {"walk.mp4": (320, 240), "incident.mp4": (320, 240), "recording.mp4": (640, 480)}
        files = {}
        for name, size in sizes.items():
            files[name] = cv2.VideoWriter(str(folder / name), film, source.fps, size)
            stack.callback(files[name].release)
        for index in range(300):
            frame = source.read()
            assert frame is not None
            cv2.imwrite(str(folder / "img1" / f"{index + 1:06d}.jpg"), frame.image)
            for name, file in files.items():
                if name != "incident.mp4" or index < 60:
                    file.write(cv2.resize(frame.image, sizes[name]))
    rows = "".join(scene_truth(SCENE).rows)
    for file in (folder / "det.txt", sequence / "det" / "det.txt"):
        # Ground truth as boxes of a detector: without identities.
        file.write_text(re.sub(r"^(\d+),\d+,", r"\1,-1,", rows, flags=re.MULTILINE))
    (sequence / "seqinfo.ini").write_text(
        "[Sequence]\nname=PETS09-S2L1\nframeRate=25\nseqLength=300\nimWidth=320\nimHeight=240\n"
    )
    (folder / "ground_truth" / "gt" / "gt.txt").write_text(
        "".join(scene_truth("scene:crossing?frames=120").rows)
    )
    (folder / "settings.toml").write_text("")
    return folder


def test_recordings_are_run_and_scored_as_the_pages_say(desk: Path) -> None:
    for line in ("heel run 'scene:crossing?frames=120' --out results --annotate",
                 "heel eval ground_truth results",
                 "heel run incident.mp4 --out incident --annotate --trace incident.jsonl",
                 "heel why incident.jsonl --frame 412"):  # fmt: skip
        done = run(line, desk)
        assert done.returncode == 0, f"{line}: {done.stderr}"
    assert "(0.00 s): the detector sends regions" in done.stdout
    # A scene of a few seconds has no seventh person, and nobody shown.
    assert "no id 7 in it" in run("heel why incident.jsonl --id 7", desk).stderr
    strip = "--frames incident.mp4 --tracks incident/tracks.txt --strip why.png"
    done = run(f"heel why incident.jsonl --frame 412 {strip}", desk)
    assert done.returncode == 0 or "incident/tracks.txt: " in done.stderr, done.stderr
    done = run("heel report incident --trace incident.jsonl", desk)
    assert done.returncode == 0, done.stderr
    page = "docs/guides/first-run.md"
    assert any("scene:crossing" in block.text for block in blocks("sh", page))
    told = (REPOSITORY / page).read_text(encoding="utf-8")
    for name in ("results", "incident"):
        for file in (desk / name).iterdir():
            assert f"`{file.name}" in told, f"the table of {page} leaves out {file.name}"


def test_a_recording_is_checked_run_and_replayed(desk: Path) -> None:
    recording(desk / "recording.mcap", [info(), *(image(seq) for seq in range(30))])
    with network.router() as endpoint, network.client(endpoint) as session:
        with network.collected(session, keys.image("front")) as heard:
            for line in ("heel record --check recording.mcap",
                         "heel report recording.mcap", "heel run recording.mcap --out again",
                         "heel replay recording.mcap --topics image,info --rate 0.5"):  # fmt: skip
                done = run(line, desk, HEEL_ZENOH__CONNECT=endpoint)
                # There are no people in it.
                assert done.returncode == 0, f"{line}: {done.stderr}"
            assert "sent 31 messages" in done.stdout
            # Pictures are live: on a busy machine some are dropped on the way.
            network.wait_until(lambda: heard.qsize() > 20, "most of 30 frames")
            assert heard.get().payload.to_bytes() in [image(seq).payload for seq in range(9)]


@contextmanager
def bus(folder: Path, lines: list[str], **environment: str) -> Iterator[dict[str, str]]:
    """Services as the pages start them, on a router of their own, once all of them send."""
    with ExitStack() as stack:
        endpoint = stack.enter_context(network.router())
        session = stack.enter_context(network.client(endpoint))
        health = stack.enter_context(network.collected(session, keys.ALL_HEALTH))
        environment["HEEL_ZENOH__CONNECT"] = endpoint
        for line in lines:
            stack.enter_context(started(line, folder, **environment))
        missing = {line.split()[1] for line in lines} - {"web"}

        def all_send() -> bool:
            while not health.empty():
                told = decode(Health, health.get().payload.to_bytes())
                if told.sent > 0:
                    missing.discard(told.service)
            return not missing

        network.wait_until(all_send, f"something sent by {sorted(missing)}", 90.0)
        yield environment


def test_a_camera_is_calibrated_from_a_recording_and_told_of_it(desk: Path) -> None:
    line = "heel calibrate person walk.mp4 --person-height 1.75 --fov-deg 90 --out camera.toml"
    done = run(line, desk)
    assert done.returncode == 0, done.stderr
    camera = "heel capture /dev/video0 --calibration camera.toml"
    camera = camera.replace("/dev/video0", "scene:demo --loop")
    with bus(desk, [camera, "heel drive --driver log"]):
        pass


@pytest.mark.parametrize(
    "line", sorted(line for line in HERE if line.startswith("heel track-detections"))
)
def test_boxes_from_elsewhere_get_identities(desk: Path, line: str) -> None:
    (desk / "tracks.txt").unlink(missing_ok=True)
    done = run(line, desk)
    assert done.returncode == 0, done.stderr
    assert (desk / "tracks.txt").read_text().count("\n") > 100


def test_a_window_of_a_recording_turns_after_the_person_clicked_on(desk: Path) -> None:
    (block,) = [block for block in blocks("sh") if "pan:recording.mp4" in block.text]
    *services, follow = block.commands
    # A pace that a busy machine keeps, too: nobody is chosen from old tracks.
    more = {
        "HEEL_WEB__PORT": str(free_port()),
        "HEEL_CAPTURE__LOOP": "true",
        "HEEL_CAPTURE__FPS": "4",
        "HEEL_FOLLOWER__MAX_TRACKS_AGE_S": "2",
    }
    with bus(desk, services, **more) as environment:
        done = run(follow, desk, **environment)
        # Whether a drawn person walks at this point at this moment is left to chance.
        assert done.returncode == 0 or "nobody found there" in done.stderr, done.stderr


PYTHON_ELSEWHERE = {
    "README.md": "tests/integration/test_python_api.py",
    "docs/guides/python.md": "tests/integration/test_python_api.py",
    "docs/reference/wire.md": "tests/unit/schemas/test_wire_document.py",
}
"""Pages whose Python blocks a test of their own runs."""


def test_the_tests_of_python_blocks_name_their_pages() -> None:
    for page, test in PYTHON_ELSEWHERE.items():
        text = (REPOSITORY / test).read_text(encoding="utf-8")
        assert Path(page).name in text, f"{test} does not run the blocks of {page}"
        assert blocks("python", page), f"{page} has none any more"


def python_blocks() -> list[Block]:
    return [block for block in blocks("python") if block.page not in PYTHON_ELSEWHERE]


@pytest.mark.parametrize("block", python_blocks(), ids=lambda block: block.page)
def test_every_python_block_runs(desk: Path, block: Block) -> None:
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", block.text], cwd=desk, text=True,
        capture_output=True, timeout=60, check=False, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("line", sorted(SLOW))
def test_what_takes_longer_is_run_too(tmp_path: Path, line: str) -> None:
    words = shlex.split(line)
    if words[:2] == ["heel", "scenarios"]:
        at = words.index("--episodes") if "--episodes" in words else len(words)
        words[at : at + 2] = ["--episodes", "1"]
    if words[:2] == ["heel", "demo"]:
        words += ["--port", "0"]
    with ExitStack() as stack:
        environment = {}
        if words[:2] == ["heel", "simulator"]:
            endpoint = f"tcp/127.0.0.1:{free_port()}"
            environment = {"HEEL_ROUTER__LISTEN": endpoint, "HEEL_ZENOH__CONNECT": endpoint}
            stack.enter_context(started("heel router", tmp_path, **environment))
            words += ["--exit-at-end", "--no-pictures", "--perception", "simulated-boxes"]
        command = ["-m", "heel", *words[1:]] if words[0] == "heel" else words[1:]
        done = subprocess.run(
            [sys.executable, *command], cwd=tmp_path, text=True, capture_output=True, timeout=500,
            check=False, stdin=subprocess.DEVNULL, env={**_inherited(), **environment},
        )  # fmt: skip
    assert done.returncode == 0, done.stderr


def _inherited() -> dict[str, str]:
    clean = inherited_environment()
    return {**clean, "PYTHONPATH": str(REPOSITORY)}
