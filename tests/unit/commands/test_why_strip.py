"""The picture of `heel why`: the people of each event, cut out before and after it."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from typer.testing import CliRunner

from heel.evaluation.rows import BoxRows, rows_from_xyxy
from heel.schemas import HeelError
from heel.schemas.errors import SettingsError
from heel.services.cli import app
from heel.services.commands.why_strip import MOST_EVENTS, strip
from heel.services.tracker.trace import Event
from heel.services.tracker.trace_file import TraceFile

COLOURS = {1: (0, 0, 200), 2: (0, 200, 0)}


def picture(frame: int) -> NDArray[np.uint8]:
    """Person 1 in red at the left, 2 in green at the right; darker with every frame."""
    image = np.zeros((200, 200, 3), np.uint8)
    image[50:150, 20:60] = np.array(COLOURS[1]) * (1 - frame / 200)
    image[50:150, 120:160] = np.array(COLOURS[2]) * (1 - frame / 200)
    return image


def rows(frames: range = range(1, 31)) -> BoxRows:
    """Ids that are exchanged in frame 20."""
    places = [(20.0, 50.0, 60.0, 150.0), (120.0, 50.0, 160.0, 150.0)]
    shown = [(frame, 1 + (k + (frame >= 20)) % 2, places[k]) for frame in frames for k in (0, 1)]
    return rows_from_xyxy(
        [frame for frame, _, _ in shown], [key for _, key, _ in shown],
        np.array([box for _, _, box in shown]), [0.9] * len(shown),
    )  # fmt: skip


EXCHANGE = Event("decided", id=1, other=2, outcome="exchanged", probability=0.9, frame=20)


def test_an_exchange_shows_each_id_before_and_after_it() -> None:
    drawn = strip([EXCHANGE], rows(), picture)
    assert drawn is not None
    cells = [drawn[100, 128 * k + 20] for k in range(4)]
    assert [int(np.argmax(cell)) for cell in cells] == [2, 1, 1, 2], "red, green; green, red"


def test_pictures_are_asked_for_once_each_in_rising_order() -> None:
    asked: list[int] = []

    def read(frame: int) -> NDArray[np.uint8]:
        asked.append(frame)
        return picture(frame)

    events = [EXCHANGE, Event("contact", id=1, other=2, frame=5)] * MOST_EVENTS
    drawn = strip(events, rows(), read)
    assert sorted(asked) == asked
    assert drawn is not None
    assert drawn.shape[0] == MOST_EVENTS * (128 + 2 * 18)


def test_boxes_beside_the_picture_and_ids_never_shown_do_no_harm() -> None:
    away = rows_from_xyxy([4, 6], [1, 1], np.array([[-500.0, 0, -400, 90], [9e5, 0, 9.5e5, 9]]))
    assert strip([Event("contact", id=1, other=2, frame=5)], away, picture) is not None
    assert strip([Event("contact", id=8, other=9, frame=5)], rows(), picture) is None
    assert strip([Event("input", frame=1)], rows(), picture) is None


@pytest.fixture
def run_folder(tmp_path: Path) -> Path:
    (tmp_path / "img1").mkdir()
    for frame in range(1, 31):
        cv2.imwrite(str(tmp_path / "img1" / f"{frame:06d}.png"), picture(frame))
    lines = [
        f"{frame},{key},{box[0] + 1},{box[1] + 1},{box[2] - box[0]},{box[3] - box[1]},1,-1,-1,-1\n"
        for frame, key, box in zip(
            rows().frames.tolist(), rows().identities.tolist(), rows().boxes_xyxy.tolist(),
            strict=True,
        )
    ]  # fmt: skip
    (tmp_path / "tracks.txt").write_text("".join(lines))
    with TraceFile(tmp_path / "trace.jsonl") as file:
        file.take(EXCHANGE)
    return tmp_path


def ask(folder: Path, *arguments: object) -> str:
    words = ["why", str(folder / "trace.jsonl"), "--id", "1", *map(str, arguments)]
    result = CliRunner().invoke(app, words)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.output


def test_the_command_writes_the_picture_beside_its_sentences(run_folder: Path) -> None:
    out = run_folder / "why.png"
    said = ask(run_folder, "--frames", run_folder / "img1", "--tracks",
               run_folder / "tracks.txt", "--strip", out)  # fmt: skip
    assert "the tracks had changed people, with 90 %" in said
    image = cv2.imread(str(out))
    assert image is not None
    assert image.shape == (128 + 2 * 18, 4 * 128, 3)


def test_what_is_missing_for_the_picture_is_said(run_folder: Path) -> None:
    with pytest.raises(SettingsError, match="go together"):
        ask(run_folder, "--strip", run_folder / "why.png")
    with pytest.raises(HeelError, match=r"--strip .*: give another file"):
        ask(run_folder, "--frames", run_folder / "img1", "--tracks",
            run_folder / "tracks.txt", "--strip", run_folder / "missing" / "why.png")  # fmt: skip
