"""The files of a run, written row by row: a run cut short leaves them readable."""

from __future__ import annotations

import csv
from pathlib import Path

from schemas import HeelError, MotionCommand, Tracks

_COMMAND_COLUMNS = ("seq", "frame", "linear_mps", "angular_radps", "state", "reason")


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
    """`tracks.txt` and `commands.csv` in one folder.

    Raises:
        HeelError: the folder cannot be made or written to.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
            # Line buffering: what was produced before a crash is there.
            self._tracks = (folder / "tracks.txt").open("w", buffering=1, encoding="ascii")
            self._commands = (folder / "commands.csv").open(
                "w", buffering=1, encoding="utf-8", newline=""
            )
        except OSError as error:
            raise HeelError(
                f"--out {folder}: {error.strerror}: give a folder that can be written to"
            ) from None
        self._writer = csv.writer(self._commands, lineterminator="\n")
        self._writer.writerow(_COMMAND_COLUMNS)

    def __enter__(self) -> RunOutputs:
        return self

    def __exit__(self, *_: object) -> None:
        self._tracks.close()
        self._commands.close()

    def tracks(self, tracks: Tracks) -> None:
        """Write the shown people of one frame."""
        self._tracks.writelines(track_rows(tracks))

    def command(self, command: MotionCommand) -> None:
        """Write one motion command."""
        frame = "" if command.frame is None else command.frame.index + 1
        self._writer.writerow(
            (command.seq, frame, f"{command.linear_mps:.4f}", f"{command.angular_radps:.4f}",
             command.state, command.reason)
        )  # fmt: skip
