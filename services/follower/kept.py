"""The chosen person, written down for the follower that comes after this one."""

from __future__ import annotations

import logging
import os
import time
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from heel.schemas import Target

_KEPT_S = 10.0
"""A follower that comes later than this after the last word of the one before asks anew: a
robot is not expected to set off by itself then. Chosen by hand; starting takes 1 to 3 s."""
_RENEWED_S = 1.0
"""Seconds between two renewals of an unchanged note; a tenth of `_KEPT_S`."""
_MAX_BYTES = 4096
"""Of the note; it takes some hundred bytes."""

Scene = tuple[str, int, int, int]
"""Stream, epoch, width and height: in other pictures the same id is another person."""


class KeptTarget(BaseModel):
    """The person chosen, the tracker that gave the id, and the pictures."""

    model_config = ConfigDict(frozen=True)

    target: Target
    scene: Scene


class TargetFile:
    """The note in the run folder; a follower that cannot write it goes on without.

    Args:
        file: where it lies.
        log: of the service.
    """

    def __init__(self, file: Path, log: logging.Logger) -> None:
        self._file = file
        self._log = log
        self._there = False
        self._renewed_s = 0.0

    def load(self) -> KeptTarget | None:
        """What the follower before has left, if it ended a moment ago."""
        try:
            age_s = time.time() - self._file.stat().st_mtime
            if not -_RENEWED_S <= age_s <= _KEPT_S:
                return None
            with self._file.open("rb") as note:
                return KeptTarget.model_validate_json(note.read(_MAX_BYTES))
        except FileNotFoundError:
            return None
        except (OSError, ValidationError) as error:
            self._log.warning("%s cannot be read (%s): nobody is chosen", self._file,
                              type(error).__name__)  # fmt: skip
            return None

    def save(self, kept: KeptTarget | None) -> None:
        """Write down which person is chosen now, or that none is."""
        try:
            if kept is None:
                self._file.unlink(missing_ok=True)
            else:
                beside = self._file.with_suffix(".new")
                beside.write_text(kept.model_dump_json())
                os.replace(beside, self._file)
            self._there = kept is not None
        except OSError as error:
            self._there = False
            self._log.warning("the target cannot be written to %s (%s): after a restart of the "
                              "follower it has to be chosen again", self._file,
                              error.strerror)  # fmt: skip

    def renew(self, now_s: float) -> None:
        """Say once a second that this follower lives.

        Args:
            now_s: monotonic time.
        """
        if not self._there or now_s - self._renewed_s < _RENEWED_S:
            return
        self._renewed_s = now_s
        try:
            os.utime(self._file)
        except OSError:
            self._there = False
