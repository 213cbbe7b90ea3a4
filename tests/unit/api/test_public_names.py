"""What `import heel` offers, what it costs, and that nothing else is promised."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

import heel
import heel.api
import heel.schemas

_SERVICES = Path(__file__).resolve().parents[3] / "services"
EXPORTED = [
    "MESSAGES", "Blob", "Blobs", "CameraInfo", "CameraMotion", "DetectorSettings", "DriveState",
    "EStop", "EndOfStream", "Evidence", "FollowState", "Follower", "FollowerSettings", "Frame",
    "FrameId", "Handover", "Header", "Health", "HeelError", "Image", "KeyNameError", "Manual",
    "ManualGrant", "ManualRequest", "Message", "MessageError", "MotionCommand", "Odometry",
    "Patch", "Pointed", "Pose", "Progress", "RangeSector", "Ranges", "SettingsError",
    "SimObstacle", "SimPerson", "SimTruth", "SimWorld", "Snapshot", "SourceError", "Stamp",
    "Taken", "Target", "TargetChoice", "TargetRequest", "Track", "TrackEvent", "Tracker",
    "TrackerSettings", "Tracks", "Video", "__version__", "decode", "encode", "open", "track",
]  # fmt: skip
"""Programs of others rest on these names: what is taken away or renamed breaks them."""


def test_exported_members() -> None:
    assert heel.__all__ == EXPORTED


def test_every_exported_member_is_there_and_is_that_of_its_home() -> None:
    assert {*heel.api.__all__, *heel.schemas.__all__, "__version__"} == set(EXPORTED)
    for home in (heel.api, heel.schemas):
        for name in home.__all__:
            assert getattr(heel, name) is getattr(home, name)


def test_type_checkers_see_every_name_that_is_loaded_later() -> None:
    tree = ast.parse(Path(heel.__file__).read_text(encoding="utf-8"))
    branch = next(
        node for node in tree.body
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    )  # fmt: skip
    imported = {
        alias.name: node.module
        for node in branch.body if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }  # fmt: skip
    assert set(imported) | {"__version__"} == set(EXPORTED)
    assert {name for name, home in imported.items() if home == "heel.api"} == set(heel.api.__all__)


def test_completion_shows_what_is_exported_before_it_is_used() -> None:
    assert set(EXPORTED) <= set(dir(heel))


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="'heel' has no attribute 'opne'"):
        _ = heel.opne  # type: ignore[attr-defined]


def _python(code: str) -> str:
    environment = {k: v for k, v in os.environ.items() if not k.startswith("OPENBLAS")}
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True,
        env={**environment, "PYTHONPATH": str(_SERVICES.parent / "src")},
    ).stdout  # fmt: skip


def test_importing_heel_loads_nothing_heavy() -> None:
    """Less than 0.3 s are promised; `python -m benchmarks.importing` measures it."""
    started_s = time.monotonic()
    loaded = set(_python("import sys, heel; print(*sys.modules)").split())
    assert not loaded & {"numpy", "cv2", "scipy", "zenoh", "pydantic", "av", "typer", "aiohttp"}
    assert time.monotonic() - started_s < 5.0, "of which Python itself takes a part"


def test_messages_load_neither_opencv_nor_the_bus() -> None:
    loaded = set(_python("import sys, heel; heel.decode; print(*sys.modules)").split())
    assert not loaded & {"cv2", "scipy", "zenoh", "av", "typer", "aiohttp"}


def test_commands_and_cameras_load_nothing_that_they_do_not_use() -> None:
    """Fits, downloads and tables take longer to load than most commands take to run."""
    loaded = _python(
        "import sys, heel.services.cli; print(*sys.modules); "
        "import heel.services.capture.service; print(*sys.modules)"
    )
    commands, cameras = map(set, map(str.split, loaded.splitlines()))
    assert not commands & {"scipy", "aiohttp", "rich", "matplotlib"}
    assert not cameras & {"scipy", "aiohttp", "matplotlib"}


def test_a_program_that_imports_heel_keeps_its_environment() -> None:
    """Threads of its own arithmetic, above all; OpenCV adds to LD_LIBRARY_PATH."""
    code = "import os; before = {*os.environ.items()}; import heel; heel.open; "
    added = _python(code + "print(*dict({*os.environ.items()} - before))").split()
    assert set(added) <= {"LD_LIBRARY_PATH"}


@pytest.mark.parametrize(
    "entry", [_SERVICES / "cli.py", *sorted(_SERVICES.glob("*/__main__.py"))],
    ids=lambda path: str(path.relative_to(_SERVICES)),
)  # fmt: skip
def test_every_process_takes_one_blas_thread_before_numpy_is_loaded(entry: Path) -> None:
    imports = [
        ast.unparse(node) for node in ast.parse(entry.read_text(encoding="utf-8")).body
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("heel")
    ]  # fmt: skip
    assert imports[0] == "from heel.services.runtime import one_blas_thread"


def test_taking_one_blas_thread_loads_no_numpy() -> None:
    loaded = _python("import sys, heel.services.runtime.one_blas_thread; print(*sys.modules)")
    assert "numpy" not in loaded.split()
