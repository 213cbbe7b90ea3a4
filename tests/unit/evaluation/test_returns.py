"""Who comes back: the same id after an absence, and how long a loss lasts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from typer.testing import CliRunner

from heel.evaluation.alignment import AlignedSequence, align
from heel.evaluation.returns import Absences, SequenceReturns, return_scores, returns_table
from heel.schemas.errors import HeelError
from heel.services.cli import app
from tests.support.box_rows import rows_from_array

PLACES = {"a": 0.0, "b": 100.0, "c": 200.0}
FPS = 2.0


def sequence(people: dict[int, str], tracks: dict[int, str]) -> AlignedSequence:
    """One letter a frame is a place, a dot nobody there."""
    rows = [
        np.array(
            [
                [frame, identity, PLACES[letter], 10, 30, 60, 1]
                for identity, script in scripts.items()
                for frame, letter in enumerate(script, start=1)
                if letter != "."
            ]
        )
        for scripts in (people, tracks)
    ]
    return align(rows_from_array(rows[0], "ground truth"), rows_from_array(rows[1], "tracks"))


def scored(people: dict[int, str], tracks: dict[int, str]) -> SequenceReturns:
    return return_scores(sequence(people, tracks), FPS)


@pytest.mark.parametrize(
    ("frames_away", "about"), [(1, 1), (3, 1), (4, 3), (7, 3), (8, 5), (19, 5), (20, 15), (59, 15)]
)
@pytest.mark.parametrize("in_truth", [True, False])
def test_an_absence_is_of_the_class_of_its_length(
    frames_away: int, about: int, in_truth: bool
) -> None:
    away = "." * frames_away
    person = "aa" + ("a" * frames_away if in_truth else away) + "aa"
    found = scored({1: person}, {7: "aa" + away + "aa"}).absences
    assert {k for k, one in found.items() if one.count} == {about}
    assert found[about] == Absences(count=1, same=1, others=0)


def test_longer_absences_and_none_are_of_no_class() -> None:
    found = scored({1: "a" * 70}, {7: "aa" + "." * 60 + "a" * 8}).absences
    assert sum(one.count for one in found.values()) == 0
    assert sum(one.count for one in scored({1: "aaaa"}, {7: "aaaa"}).absences.values()) == 0


@pytest.mark.parametrize(
    ("tracks", "expected"),
    [
        ({7: "aa.....", 8: "bbbbbbb", 9: "....aaa"}, Absences(count=1, same=0, others=0)),
        ({7: "aa.....", 8: "bb..aaa"}, Absences(count=1, same=0, others=1)),
        ({7: "aa....a", 8: "bbbb...", 9: "....aa."}, Absences(count=1, same=1, others=0)),
    ],
    ids=["a fresh id claims nothing", "another's id", "recognised within a second"],
)
def test_claims(tracks: dict[int, str], expected: Absences) -> None:
    found = scored({1: "aaaaaaa", 2: "bbbbbbb"}, tracks).absences[1]
    assert found == expected


def test_losses_of_the_chosen_id_and_how_long_they_last() -> None:
    found = scored({1: "aaaaaaaaaa"}, {7: "aa.aa..a..", 8: "........aa"})
    assert (found.losses, found.recovered) == (3, 2)
    assert found.delay_p50_s == pytest.approx(0.75)
    assert found.delay_p95_s == pytest.approx(0.5 + 0.95 * 0.5)


def test_people_outside_of_the_ground_truth_are_not_lost() -> None:
    found = scored({1: "aa...aa"}, {7: "aa...aa"})
    assert (found.losses, found.recovered, found.delay_p50_s) == (0, 0, None)


@pytest.mark.parametrize("fps", [0.0, -1.0, float("nan")])
def test_a_rate_that_is_none_is_refused(fps: float) -> None:
    with pytest.raises(HeelError, match="fps = "):
        return_scores(sequence({1: "a"}, {7: "a"}), fps)


def test_the_table_shows_every_number_in_80_characters() -> None:
    absences = {k: Absences(count=20 + k, same=10 + k, others=2) for k in (1, 3, 5, 15)}
    row = SequenceReturns(
        sequence="PETS09-S2L1", absences=absences, losses=87, recovered=82,
        delay_p50_s=0.31, delay_p95_s=1.62,
    )  # fmt: skip
    console = Console(width=80)
    with console.capture() as captured:
        console.print(returns_table([row]))
    text = captured.get()
    for shown in ("11/13/21", "25/27/35", "87", "94", "0.3", "1.6"):
        assert shown in text
    assert "…" not in text


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        ([], "give --fps"),
        (["--fps", "0"], "give a rate above 0"),
        (["--fps", "nan"], "give a rate above 0"),
        (["--fps", "7", "--plot", "plots"], "leave --returns or --plot out"),
    ],
)
def test_the_command_refuses_in_one_line_what_it_cannot_measure(
    flags: list[str], words: str, tmp_path: Path
) -> None:
    rows = "1,1,10,10,20,40,1,-1,-1,-1\n2,1,10,10,20,40,1,-1,-1,-1\n"
    for name in ("truth.txt", "tracks.txt"):
        (tmp_path / name).write_text(rows)
    files = [str(tmp_path / "truth.txt"), str(tmp_path / "tracks.txt")]
    done = CliRunner().invoke(app, ["eval", *files, "--returns", *flags])
    assert done.exit_code != 0
    assert words in f"{done.output} {done.exception}"
