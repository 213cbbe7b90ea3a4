"""The files of a run, written row by row: a run cut short leaves them readable."""

from __future__ import annotations

import csv
import io
from pathlib import Path

from heel.schemas import FollowState, HeelError, MotionCommand, Tracks
from heel.services.drawing import AnnotatedVideo
from heel.services.run.folder import ResultFolder
from heel.services.run.summary import RunSummary
from heel.services.runtime.row_file import RowFile

_COMMAND_COLUMNS = ("seq", "frame", "linear_mps", "angular_radps", "state", "reason")
_STATE_COLUMNS = (
    "seq", "state", "target", "distance_m", "nearest_person_m", "bearing_rad",
    "identity_confidence", "runner_up_confidence", "tracks_age_s", "speed_reason",
)  # fmt: skip
_TRACKS, _COMMANDS, _STATES = "tracks.txt", "commands.csv", "states.csv"
_SUMMARY, _FILM = "summary.json", "annotated.mp4"
_SUMMARY_BYTES = 64 * 1024
"""Bytes that are reserved for the summary from the start, so that it states the end of the run also
on a full disk. It has 5 to 20 kB."""


def track_rows(tracks: Tracks) -> list[str]:
    """MOTChallenge rows of the shown people of one frame, in pixels of the source, from 1.

    `frame,id,left,top,width,height,confidence,-1,-1,-1` with frames and pixels counted from 1.
    """
    scale_x = tracks.source_width / tracks.width
    scale_y = tracks.source_height / tracks.height
    rows = []
    for track in sorted(tracks.tracks, key=lambda t: t.id):
        if not track.shown:
            continue
        left, top, right, bottom = track.box_xyxy
        rows.append(
            f"{tracks.index + 1},{track.id},{left * scale_x + 1:.2f},{top * scale_y + 1:.2f},"
            f"{(right - left) * scale_x:.2f},{(bottom - top) * scale_y:.2f},"
            f"{track.identity_confidence:.3f},-1,-1,-1\n"
        )
    return rows


class RunOutputs:
    """`tracks.txt`, `commands.csv`, `states.csv`, `summary.json`, logs, if wanted `annotated.mp4`.

    They are in the folder from the first tracked frame on (the summary and the film when they are
    finished); a run that comes to none leaves the folder as it was.

    Usage:
        with RunOutputs(folder, summary, annotate=False) as outputs:
            outputs.tracks(tracks)

    Raises:
        HeelError: the folder or a file cannot be written.
    """

    def __init__(self, folder: Path, summary: RunSummary, annotate: bool) -> None:
        self._summary = summary
        self._results = ResultFolder(folder, (_TRACKS, _COMMANDS, _STATES, _SUMMARY, _FILM))
        staging = self._results.staging
        try:
            self._tracks = RowFile(staging / _TRACKS)
            self._commands = RowFile(staging / _COMMANDS)
            self._commands.append(_csv_row(_COMMAND_COLUMNS))
            self._states = RowFile(staging / _STATES)
            self._states.append(_csv_row(_STATE_COLUMNS))
            _reserve(staging / _SUMMARY, _SUMMARY_BYTES)
        except OSError as error:
            self._results.close()
            raise self._results.cannot_write(error) from None
        self.film = AnnotatedVideo(staging / _FILM) if annotate else None

    def __enter__(self) -> RunOutputs:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        try:
            self._tracks.close()
            self._commands.close()
            self._states.close()
            film_is_whole = self.film is not None and self.film.close()
            if self._results.begun:
                if film_is_whole:
                    self._results.place(_FILM)
                if isinstance(error, HeelError):
                    self._summary.ended = str(error)
                _fill(self._results.staging / _SUMMARY, self._summary.as_text().encode())
                self._results.place(_SUMMARY)
        except OSError as failure:
            raise self._results.cannot_write(failure) from None
        finally:
            self._results.close()

    @property
    def log_folder(self) -> Path:
        """Where the logs of the services are at this moment."""
        return self._results.log_folder

    def tracks(self, tracks: Tracks) -> None:
        """Write the shown people of one frame."""
        self._append(self._tracks, "".join(track_rows(tracks)))
        if not self._results.begun:
            self._results.begin(_TRACKS, _COMMANDS, _STATES)

    def command(self, command: MotionCommand) -> None:
        """Write one motion command."""
        frame = "" if command.frame is None else command.frame.index + 1
        row = (command.seq, frame, f"{command.linear_mps:.4f}", f"{command.angular_radps:.4f}",
               command.state, command.reason)  # fmt: skip
        self._append(self._commands, _csv_row(row))

    def state(self, state: FollowState) -> None:
        """Write what the follower says of itself: `seq` is that of the command beside it."""
        numbers = (state.distance_m, state.nearest_person_m, state.bearing_rad,
                   state.identity_confidence, state.runner_up_confidence,
                   state.tracks_age_s)  # fmt: skip
        told = ("" if one is None else f"{one:.3f}" for one in numbers)
        row = (state.seq, state.state, state.target.track_id or "", *told, state.speed_reason)
        self._append(self._states, _csv_row(row))

    def _append(self, file: RowFile, rows: str) -> None:
        try:
            file.append(rows)
        except OSError as error:
            raise self._results.cannot_write(error) from None


def _csv_row(values: tuple[object, ...]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(values)
    return text.getvalue()


def _reserve(path: Path, size: int) -> None:
    with path.open("xb") as file:
        file.write(b" " * size)


def _fill(path: Path, content: bytes) -> None:
    """Overwrite a reserved file: content that fits needs no further room on the disk."""
    with path.open("r+b") as file:
        file.write(content)
        file.truncate(len(content))
