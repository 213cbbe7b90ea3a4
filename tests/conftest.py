"""What holds for every test."""

from __future__ import annotations

import atexit
import os
import shutil
import tempfile
from pathlib import Path

import pytest

from heel.services.runtime import one_blas_thread  # noqa: F401

# isort: split
from heel.services.models.store import VARIABLE as MODELS
from heel.services.runtime.places import VARIABLE
from heel.services.runtime.quiet import silence_decoders
from tests.support.pinned import Pinned

pytest_plugins = ["tests.support.failed_scenes"]

# FFmpeg reads its log level when the first video of a process is opened; in the suite that may be
# a test's own video, long before capture is asked for one.
silence_decoders()

# A run folder for these tests alone, and for the processes that they start: those get an
# environment without variables of Heel's, so it is named by the session's folder.
_session = tempfile.mkdtemp(prefix="heel-tests-")
atexit.register(shutil.rmtree, _session, ignore_errors=True)
os.environ["XDG_RUNTIME_DIR"] = _session
os.environ.pop(VARIABLE, None)

# A network that a developer has got must not decide what tests find.
os.environ[MODELS] = os.path.join(_session, "models")


def pytest_addoption(parser: pytest.Parser) -> None:
    """`--renew-pins`: numbers that have moved on purpose."""
    parser.addoption(
        "--renew-pins", action="store_true", help="keep what tests find now in pinned/*.json"
    )


@pytest.fixture
def pinned(request: pytest.FixtureRequest) -> Pinned:
    """Compares with numbers in `pinned/NAME.json` beside `test_NAME_pinned.py`."""
    module = Path(request.path)
    name = module.stem.removeprefix("test_").removesuffix("_pinned")
    file = module.parent / "pinned" / f"{name}.json"
    return Pinned(file, request.node.name, request.config.getoption("--renew-pins"))
