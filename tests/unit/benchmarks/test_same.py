"""`make same`: drawn scenes come out as they are kept, and what does not is named."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest

from benchmarks import same
from benchmarks.same import Kept, Played, Rows, case_of, moved, read_kept, rows_in
from benchmarks.same_cases import COMMANDS, TRACKS, Case, all_cases
from heel.schemas.errors import HeelError, SettingsError
from tests.support.processes import finished


def write(text: str, folder: Path) -> None:
    (folder / TRACKS).write_text(text, encoding="ascii")


def broken(folder: Path) -> None:
    raise HeelError(f"{folder.name} is broken")


def played(tmp_path: Path, text: str) -> Played:
    return same.play(Case("drawn/one/default", partial(write, text)), tmp_path)


@pytest.mark.timeout(640)
def test_drawn_scenes_come_out_as_they_are_kept() -> None:
    if (made_on := read_kept(same.KEPT).made_on) != same.this_machine():
        pytest.skip(same.other_machine(made_on))
    code, out, err = finished("-m", "benchmarks.same", "--short", deadline_s=600.0)
    assert code == 0, f"moved (renew if it is meant to: benchmarks/same.py):\n{out}{err}"


def test_every_case_of_the_short_form_is_kept() -> None:
    kept = {case_of(name) for name in read_kept(same.KEPT).files}
    assert {case.name for case in all_cases() if case.short} <= kept


def test_a_file_that_has_changed_is_named_with_its_rows(tmp_path: Path) -> None:
    before = played(tmp_path, "1\n2\n")
    assert not moved(before.files, before)
    assert moved(before.files, played(tmp_path, "1\n3\n")) == [
        "drawn/one/default/tracks.txt: moved (2 rows)"
    ]
    assert moved(before.files, played(tmp_path, "1\n")) == [
        "drawn/one/default/tracks.txt: moved (1 rows, was 2)"
    ]


def test_files_that_come_and_go_are_named(tmp_path: Path) -> None:
    now = played(tmp_path, "1\n")
    commands = {f"{now.name}/{COMMANDS}": Rows("0" * 16, 1)}
    assert moved({**now.files, **commands}, now) == ["drawn/one/default/commands.csv: gone"]
    assert moved(commands, now)[1] == "drawn/one/default/tracks.txt: new"
    assert moved({}, now) == [], "nothing was kept of it"


def test_a_case_that_fails_is_told_and_never_kept(tmp_path: Path) -> None:
    failed = same.play(Case("drawn/broken/default", broken), tmp_path)
    assert moved({}, failed) == ["drawn/broken/default: default is broken"]
    with pytest.raises(HeelError, match="broken/default: default is broken: not renewed"):
        same.renewed(Kept(), failed)


def test_renewing_leaves_what_was_not_played(tmp_path: Path) -> None:
    now = played(tmp_path, "1\n")
    other = {"drawn/two/paper/tracks.txt": Rows("f" * 16, 7)}
    gone = {f"{now.name}/{COMMANDS}": Rows("0" * 16, 1)}
    kept = same.renewed(Kept({**other, **gone}, same.this_machine()), now)
    file = tmp_path / "kept.txt"
    same.write_kept(file, kept)
    assert read_kept(file) == kept
    assert kept.files == {**now.files, **other}


def test_hashes_of_two_machines_do_not_get_into_one_file() -> None:
    kept = Kept({"drawn/two/paper/tracks.txt": Rows("f" * 16, 7)}, "numpy 1.0")
    with pytest.raises(SettingsError, match=r"made on \[numpy 1.0\], and this is \[python"):
        same.check_renewal(kept, [Case("drawn/one/default", broken)])
    same.check_renewal(kept, [Case("drawn/two/paper", broken)])


def test_the_first_line_that_differs_is_named(tmp_path: Path) -> None:
    before, after = tmp_path / "before", tmp_path / "after"
    before.write_text("1\n2\n3\n")
    after.write_text("1\n2\n")
    assert same.first_difference(before, before) == ""
    assert same.first_difference(before, after) == "line 3: the end\n    was: 3"


def test_a_rows_file_of_an_earlier_run_is_not_taken_for_this_runs(tmp_path: Path) -> None:
    before = played(tmp_path, "1\n")
    (tmp_path / before.name / COMMANDS).write_text("old\n")
    assert rows_in(tmp_path, before.name) != before.files
    assert played(tmp_path, "1\n").files == before.files


def test_an_unknown_case_is_one_error_that_names_its_neighbours() -> None:
    code, out, err = finished("-m", "benchmarks.same", "--only", "drawn/dmo", deadline_s=60.0)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "--only drawn/dmo: no case of that name" in err
    assert "did you mean drawn/demo" in err


def test_cases_are_chosen_by_the_first_parts_of_their_names() -> None:
    cases = [Case(name, broken) for name in ("a/b/c", "a/b/d", "a/bb/c")]
    assert [case.name for case in same.chosen(cases, ["a/b"], short=False)] == ["a/b/c", "a/b/d"]
    assert not same.chosen(cases, [], short=True)


def test_a_malformed_line_of_the_file_is_named(tmp_path: Path) -> None:
    file = tmp_path / "kept.txt"
    file.write_text("# text\n0123 many drawn/one/default/tracks.txt\n")
    with pytest.raises(HeelError, match=r"kept\.txt:2: '0123 many"):
        read_kept(file)
