"""Checks of a run's options and source before any process is started."""

from __future__ import annotations

from heel.services.pipeline import RecordedFrames, load_pipeline
from heel.services.run.options import RunOptions

_LIVE = ("/dev/", "pan:")
"""Sources that are not opened for a check: a camera is opened once, and a window into a recording
writes a file."""


def check_options(options: RunOptions) -> None:
    """Read every setting, make every core, open a recording, and let go of all of it.

    Raises:
        SettingsError: a setting, the detector or its model is not what it should be.
        SourceError: the source cannot be opened.
    """
    check_settings(options)
    if not (
        options.source.isdigit() or options.source.startswith(_LIVE) or "://" in options.source
    ):
        with RecordedFrames(options.source, options.scale, options.fps):
            pass


def check_settings(options: RunOptions) -> None:
    """The part of `check_options` that does not concern the source.

    Raises:
        SettingsError: a setting, the detector or its model is not what it should be.
    """
    load_pipeline(options.preset, options.target, options.config, options.detector, options.model,
                  options.model_class)  # fmt: skip
