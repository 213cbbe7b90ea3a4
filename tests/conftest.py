"""What holds for every test."""

from __future__ import annotations

import atexit
import os
import shutil
import tempfile

from heel.services.runtime import one_blas_thread  # noqa: F401

# isort: split
from heel.services.runtime.places import VARIABLE
from heel.services.runtime.quiet import silence_decoders

# FFmpeg reads its log level when the first video of a process is opened; in the suite that may be
# a test's own video, long before capture is asked for one.
silence_decoders()

# A run folder for these tests alone, and for the processes that they start: those get an
# environment without variables of Heel's, so it is named by the session's folder.
_session = tempfile.mkdtemp(prefix="heel-tests-")
atexit.register(shutil.rmtree, _session, ignore_errors=True)
os.environ["XDG_RUNTIME_DIR"] = _session
os.environ.pop(VARIABLE, None)
