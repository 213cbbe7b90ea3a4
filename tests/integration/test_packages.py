"""What is built and installed: the packages hold what they should, and work where they are put."""

from __future__ import annotations

import hashlib
import os
import re
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import zipfile
from email.parser import Parser
from pathlib import Path

import pytest

from heel.services.cli import app
from heel.services.runtime.process import software_version
from tools.release import SUMS

REPOSITORY = Path(__file__).resolve().parents[2]
SCENE = "scene:crossing?frames=30&width=320&height=240"
PACKAGES = ("schemas", "services", "evaluation")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("hatchling", reason="hatchling, which builds the packages, is missing")
    folder = tmp_path_factory.mktemp("built")
    subprocess.run(
        [sys.executable, "-m", "tools.release", "--image", "none", "--out", str(folder)],
        cwd=REPOSITORY, check=True, capture_output=True, timeout=60,
    )  # fmt: skip
    return folder


def test_every_file_of_a_release_has_its_checksum(built: Path) -> None:
    lines = (built / SUMS).read_text().splitlines()
    listed = {name: digest for digest, name in (line.split("  ") for line in lines)}
    files = {file.name: file for file in built.iterdir() if file.name != SUMS}
    assert listed == {
        name: hashlib.sha256(file.read_bytes()).hexdigest() for name, file in files.items()
    }
    assert {file.suffix for file in files.values()} == {".whl", ".gz"}


def tracked(*folders: str) -> set[str]:
    """Files of the repository in these folders."""
    done = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard", *folders], cwd=REPOSITORY, text=True,
        capture_output=True, check=False,
    )  # fmt: skip
    if done.returncode:
        pytest.skip("not a git checkout")
    return {name for name in done.stdout.splitlines() if (REPOSITORY / name).is_file()}


def packaged() -> set[str]:
    """What is installed: the folders that `src/heel` links to, and its own files."""
    own = {name.removeprefix("src/") for name in tracked("src")}
    return own | {f"heel/{name}" for name in tracked(*PACKAGES)}


def test_the_wheel_holds_the_packages_whole_and_nothing_else(built: Path) -> None:
    (wheel,) = built.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        metadata = next(name for name in names if name.endswith(".dist-info/METADATA"))
        told = Parser().parsestr(archive.read(metadata).decode())
    info = metadata.partition("/")[0]
    assert {name for name in names if not name.startswith(f"{info}/")} == packaged()
    assert f"{info}/licenses/LICENSE" in names
    assert "heel/services/web/static/app.js" in names
    wanted = told.get_all("Requires-Dist") or []
    assert not any("trackeval" in line.lower() for line in wanted)
    opencv = {line.split(";")[0].split(">")[0] for line in wanted if "opencv" in line}
    assert opencv == {"opencv-python-headless"}, "the one with windows needs libGL"


def test_the_sdist_holds_docs_and_examples_and_no_stray_tests(built: Path) -> None:
    (sdist,) = built.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        names = {member.name.partition("/")[2] for member in archive if member.isfile()}
    added = {"PKG-INFO", "pyproject.toml", ".gitignore"}
    whole = tracked("docs", "examples", "README.md", "LICENSE", "constraints.txt")
    assert names - added == whole | {f"src/{name}" for name in packaged()}
    assert {"constraints.txt", "README.md", "LICENSE", "examples/own_detector.py"} <= names


def test_every_extra_is_in_all_and_every_hint_names_what_pip_finds_anywhere() -> None:
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    assert extras["all"] == ["heel-follow[eval,metrics,neural,record,ros2-zenoh,secure,sim]"]
    assert set(extras) == {
        "eval",
        "metrics",
        "neural",
        "record",
        "ros2",
        "ros2-zenoh",
        "secure",
        "sim",
        "all",
        "dev",
        "docs",
    }
    # The robot's own ROS does instead; nothing in the repository needs those wheels.
    assert all(package.startswith("ros-") for package in extras["ros2"])
    own = set(extras) - {"all", "dev", "docs", "ros2"}
    offered = {line.split(">")[0] for name in own for line in extras[name]}
    texts = [path.read_text() for name in PACKAGES for path in (REPOSITORY / name).rglob("*.py")]
    texts += [path.read_text() for path in (REPOSITORY / "docs").rglob("*.md")]
    texts.append((REPOSITORY / "README.md").read_text())
    assert not any("pip install 'heel-follow" in text for text in texts), "it is on no index"
    assert offered == {
        "cryptography", "foxglove-sdk", "matplotlib", "mcap",
        "mcap-ros2-support", "onnx", "onnxruntime", "panda3d",
        "prometheus-client", "rosbags", "segno",
    }  # fmt: skip
    for package in offered:
        hint = re.compile(rf"(pip install|--force-reinstall) ([\w-]+ )*{package}\b")
        assert any(hint.search(text) for text in texts), package


@pytest.fixture(scope="module")
def elsewhere(built: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel in an environment of its own, which sees the libraries of this one."""
    folder = tmp_path_factory.mktemp("elsewhere") / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True)
    (wheel,) = built.glob("*.whl")
    python = folder / "bin" / "python"
    subprocess.run(
        [sys.executable, "-m", "pip", "--python", str(python), "install", "--quiet", "--no-deps",
         "--no-compile", "--no-index", "--disable-pip-version-check", str(wheel)],
        check=True, timeout=60,
    )  # fmt: skip
    (own,) = folder.glob("lib/python3*/site-packages")
    libraries = sysconfig.get_path("purelib")
    (own / "libraries.pth").write_text(f"{libraries}\n")
    return folder


def heel(environment: Path, *arguments: object, folder: Path) -> str:
    clean = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    done = subprocess.run(
        [str(environment / "bin" / "heel"), *map(str, arguments)], cwd=folder, text=True,
        capture_output=True, timeout=90, check=False, env=clean, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def _fill_with_strangers(folder: Path) -> None:
    """Put code of the same names as ours into a folder, as a robot's project may have it."""
    stranger = "raise SystemExit('a stranger ran')\n"
    for name in ("services", "schemas", "evaluation"):
        (folder / name).mkdir()
        (folder / name / "__init__.py").write_text(stranger)
    (folder / "heel.py").write_text(stranger)


def test_the_installed_wheel_runs_and_scores_among_strangers(
    elsewhere: Path, tmp_path: Path
) -> None:
    _fill_with_strangers(tmp_path)
    assert heel(elsewhere, "--version", folder=tmp_path) == f"heel {software_version()}\n"
    heel(elsewhere, "run", SCENE, "--out", "results", folder=tmp_path)
    heel(elsewhere, "run", SCENE, "--out", "live", "--live", folder=tmp_path)
    truth = tmp_path / "gt.txt"
    truth.write_text("1,1,10,20,30,60,1,-1,-1,-1\n2,1,12,20,30,60,1,-1,-1,-1\n")
    scores = heel(elsewhere, "eval", truth, truth, "--json", folder=tmp_path)
    assert '"mota":100.0' in scores
    where = subprocess.run(
        [str(elsewhere / "bin/python"), "-P", "-c", "import heel; print(heel.__file__)"],
        cwd=tmp_path, text=True, capture_output=True, check=True,
    )  # fmt: skip
    assert where.stdout.startswith(str(elsewhere)), "not this checkout"


DOCUMENTED = (
    ("run", SCENE, "--out", "results", "--annotate"),
    ("run", SCENE, "--out", "live", "--live"),
    ("eval", "gt.txt", "gt.txt", "--plot", "plots"),
    ("scenarios", "--episodes", "1", "--scenario", "straight", "--out", "episodes"),
    ("demo", "--scene", "--seconds", "4", "--port", "0"),
    ("demo", "--seconds", "4", "--port", "0"),
    ("schema", "state"),
    ("track-detections", "gt.txt", "--fps", "25", "--out", "tracks.txt"),
)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_fresh_environment_with_everything_makes_every_command_work(tmp_path: Path) -> None:
    environment = tmp_path / "venv"
    subprocess.run([sys.executable, "-m", "venv", str(environment)], check=True)
    python = str(environment / "bin" / "python")
    subprocess.run(
        [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check",
         f"{REPOSITORY}[all]", "-c", str(REPOSITORY / "constraints.txt")],
        check=True, timeout=600, cwd=tmp_path,
    )  # fmt: skip
    (tmp_path / "gt.txt").write_text(
        "".join(f"{f},1,{10 + f},20,30,60,1,-1,-1,-1\n" for f in range(1, 20))
    )
    for arguments in DOCUMENTED:
        heel(environment, *arguments, folder=tmp_path)
    assert len(list((tmp_path / "plots").glob("*-timeline.png"))) == 1
    assert (tmp_path / "results" / "annotated.mp4").is_file()
    listed = subprocess.run([python, "-m", "pip", "list", "--format", "freeze"], text=True,
                            capture_output=True, check=True).stdout  # fmt: skip
    assert "opencv-python-headless==" in listed
    assert "opencv-python==" not in listed
    commands = {command.name or "" for command in app.registered_commands}
    shown = heel(environment, "--help", folder=tmp_path)
    assert all(name in shown for name in commands)
