"""Checks of a run's options and source before any process is started."""

from __future__ import annotations

import sys
from pathlib import Path

from heel.services.detector.settings import DetectorServiceSettings
from heel.services.pipeline import RecordedFrames, load_pipeline
from heel.services.run.options import RunOptions
from heel.services.run.summary import Perception
from heel.services.runtime.settings import Loaded, load_settings
from heel.services.tracker.trace_file import check_place

_LIVE = ("/dev/", "pan:")
"""Sources that are not opened for a check: a camera is opened once, and a window into a recording
writes a file."""


def check_options(options: RunOptions) -> None:
    """Read every setting, make every core, open a recording, and let go of all of it.

    Without a network, where the user did not ask for none, this says what one would give.

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
    say_without_network(options)


def say_without_network(options: RunOptions) -> None:
    """Write the detector's hint to standard error, if it has one.

    Raises:
        SettingsError: a setting of the detector is not what it should be.
    """
    flags = {"preset": options.preset, "detector": options.detector, "model": options.model,
             "model_class": options.model_class}  # fmt: skip
    loaded: Loaded[DetectorServiceSettings] = load_settings(
        "detector", DetectorServiceSettings, {"detector": flags}, options.config
    )
    if loaded.service.hint is not None:
        sys.stderr.write(f"{loaded.service.hint}\n")


def check_settings(options: RunOptions) -> Perception:
    """The part of `check_options` that does not concern the source; returns what will see people.

    Raises:
        SettingsError: a setting, the detector or its model is not what it should be.
    """
    _, shown = load_pipeline(
        options.preset, options.target, options.config, options.detector, options.model,
        options.model_class, options.model_head, options.trace,
    )  # fmt: skip
    traced = shown["tracker"]["trace"]
    # The folder of the results is made when the run begins.
    if traced is not None and Path(traced).parent.resolve() != options.out.resolve():
        check_place(Path(traced))
    return Perception.of(shown["detector"], shown["tracker"])
