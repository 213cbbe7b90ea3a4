"""`make mutants`: what is changed in a module, which tests are asked, and what is told."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from benchmarks.mutants.__main__ import report
from benchmarks.mutants.changes import Factor, Mutant, changed, mutants
from benchmarks.mutants.coverage import Coverage, Users
from benchmarks.mutants.runner import Result, _forked


@pytest.mark.parametrize(
    ("source", "factor", "expected"),
    [
        ("A = 3", "doubled", 6),
        ("A = 3", "halved", 1),
        ("A = 0.5", "halved", 0.25),
        ("A = -0.5", "doubled", -1.0),
        ("A: float = 2e3", "halved", 1e3),
        ("A = 4 << 20", "halved", 2 << 20),
        ("A = (1, 2.0, 'x')", "doubled", (2, 4.0, "x")),
        ("A = {1: 3}", "doubled", {1: 6}),
        ("A = dict(b=3)", "doubled", {"b": 6}),
        ("B, A = 3, 4", "doubled", 8),
        ("B = 4\nA = B", "doubled", 4),
    ],
)
def test_one_constant_is_changed(source: str, factor: Factor, expected: object) -> None:
    names: dict[str, object] = {}
    exec(compile(changed(source, Mutant("a.py", "A", factor)), "a.py", "exec"), names)
    assert names["A"] == expected
    assert names.get("B") in (None, 3, 4), "the others are as they were"


def _tree(folder: Path, **sources: str) -> None:
    (folder / "services" / "room").mkdir(parents=True)
    for name, source in sources.items():
        (folder / "services" / "room" / f"{name}.py").write_text(source)


def test_what_no_factor_changes_is_no_mutant(tmp_path: Path) -> None:
    _tree(tmp_path, one="A = 0\nB = 1.5\nC = 'text'\nd = 4\n")
    found = mutants(tmp_path, "services/room")
    assert [(one.name, one.factor) for one in found] == [("B", "halved"), ("B", "doubled")]


def test_tests_that_run_a_user_of_the_constant_are_asked_the_most_specific_first(
    tmp_path: Path,
) -> None:
    _tree(
        tmp_path,
        one="A = 1\nB = A + 1\n\n\ndef direct():\n    return A\n\n\n"
        "@cached\ndef derived():\n    return B\n",
        other="def elsewhere():\n    return one.A\n\n\ndef not_at_all():\n    return 1\n",
    )
    users = Users(tmp_path, "services/room").of("services/room/one.py", "A")
    one, other = "services/room/one.py", "services/room/other.py"
    assert users == {(one, 5), (one, 9), (other, 1)}
    coverage = Coverage({"broad": {(one, 5), (other, 5)}, "narrow": {(one, 9)}, "no": {(other, 5)}})
    assert coverage.tests_of(users) == ["narrow", "broad"]


def test_what_a_function_makes_at_import_is_made_of_the_constants_that_it_uses(
    tmp_path: Path,
) -> None:
    _tree(
        tmp_path,
        one="A = 3\n\n\ndef table():\n    return [A]\n\n\nB = table()\n\n\n"
        "def use():\n    return B\n",
    )
    users = Users(tmp_path, "services/room").of("services/room/one.py", "A")
    assert ("services/room/one.py", 11) in users


def test_numbers_that_are_pinned_are_asked_first_and_long_tests_are_passed_over() -> None:
    used = {("one.py", 1)}
    broad = used | {("one.py", 5)}
    seconds = {"long": 9.0, "short": 1.0, "test_core_pinned.py::broad": 2.0}
    coverage = Coverage({"long": used, "short": used, "test_core_pinned.py::broad": broad}, seconds)
    hit = coverage.tests_of(used)
    assert hit == ["test_core_pinned.py::broad", "long", "short"]
    assert coverage.within(hit, 4.0) == (["test_core_pinned.py::broad", "short"], 3.0)
    assert coverage.within(["long"], 4.0) == (["long"], 9.0), "one is always tried"


def test_coverage_is_read_as_it_was_written(tmp_path: Path) -> None:
    coverage = Coverage({"a.py::b": {("c.py", 1)}}, {"a.py::b": 0.5})
    coverage.save(tmp_path / "coverage.json")
    assert Coverage.load(tmp_path / "coverage.json") == coverage


def test_work_that_does_not_end_is_ended_with_what_it_has_started(tmp_path: Path) -> None:
    def work() -> int:
        child = subprocess.Popen(["sleep", "60"])
        (tmp_path / "child").write_text(str(child.pid))
        return child.wait()

    assert _forked(lambda: 3, 30.0, tmp_path) == 3
    assert _forked(work, 3.0, tmp_path) is None
    left = int((tmp_path / "child").read_text())
    status = Path(f"/proc/{left}/status")
    assert not status.exists() or "zombie" in status.read_text()


def test_the_report_counts_what_was_caught_and_lists_the_rest() -> None:
    path = "services/tracker/core.py"
    text = report(
        [
            Result(Mutant(path, "A", "halved"), "caught", 2),
            Result(Mutant(path, "A", "doubled"), "too slow", 2),
            Result(Mutant(path, "B", "halved"), "survived", 3),
            Result(Mutant(path, "C", "halved"), "no test runs it", 0),
        ],
        {"tracker": 10},
    )
    assert "| tracker | 10 | 4 | 2 | 50 % |" in text
    assert text.endswith(f"| {path} | `B` | halved | 3 |\n| {path} | `C` | halved | 0 |\n")


def test_every_mutant_of_a_room_is_a_program() -> None:
    root = Path(__file__).resolve().parents[3]
    for mutant in mutants(root, "services/geometry"):
        source = (root / mutant.path).read_text(encoding="utf-8")
        assert compile(changed(source, mutant), mutant.path, "exec")
