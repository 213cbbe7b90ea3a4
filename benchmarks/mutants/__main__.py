"""`make mutants`: every named number of the cores halved and doubled; does a unit test notice?

A constant that no test notices is one that the next change can get wrong. A mutant is a module with
one constant of module level halved or doubled (a table: all of its numbers). The unit tests that
run a function which uses the constant are run on it, those that pin numbers and then the most
specific first, until one fails; the tests run in a fork, with the module changed in memory. Tests
of processes, recordings and benchmarks are left out on purpose: they take minutes and say little of
the cause.

Why not mutmut or cosmic-ray: mutmut changes function bodies only, not constants of a module;
cosmic-ray changes numbers by one, which says nothing about 200.0 or 1e-9, and starts the whole test
command anew for each.

Example run: python -m benchmarks.mutants --sample 40
"""

from __future__ import annotations

import random
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor, Future, as_completed
from pathlib import Path
from typing import Annotated

import typer

from benchmarks.common import REPOSITORY, publish
from benchmarks.mutants.changes import Mutant, mutants
from benchmarks.mutants.coverage import Users
from benchmarks.mutants.runner import Result, Runner, prepare_worker
from heel.services.loops.scenarios.parallel import workers
from heel.services.runtime.command_line import run_app

ROOMS = ("detector", "tracker", "follower")
GOAL = 0.8
"""Share of mutants that unit tests should catch; the rest is listed and judged by hand."""
_COVERAGE_TIMEOUT_S = 3600.0

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


@app.command()
def main(
    sample: Annotated[
        int | None, typer.Option(help="so many mutants of all, drawn at random", min=1)
    ] = None,
    seed: Annotated[int, typer.Option(help="of the sample")] = 1,
    only: Annotated[
        str | None,
        typer.Option(help="mutants whose path and name contain one of these, comma separated"),
    ] = None,
    rooms: Annotated[str, typer.Option(help="services, comma separated")] = ",".join(ROOMS),
    tests: Annotated[
        str | None,
        typer.Option(help="folders or files of tests, comma separated [default: tests/unit/ROOM]"),
    ] = None,
    seconds: Annotated[
        float, typer.Option(help="longest tests of one mutant, unchanged; the rest is left out")
    ] = 20.0,
    jobs: Annotated[int, typer.Option(min=1, max=64, help="processes")] = 2,
    write: Annotated[Path | None, typer.Option(help="document to put the table into")] = None,
) -> None:
    """Print which changed constants no unit test notices."""
    chosen = [room.strip() for room in rooms.split(",")]
    every = {room: mutants(REPOSITORY, f"services/{room}") for room in chosen}
    drawn = sorted(mutant for found in every.values() for mutant in found)
    if only is not None:
        drawn = [one for one in drawn if any(part in str(one) for part in only.split(","))]
    if sample is not None:
        drawn = sorted(random.Random(seed).sample(drawn, min(sample, len(drawn))))
    among = {room: [f"tests/unit/{room}"] if tests is None else tests.split(",") for room in chosen}
    of = {room: [one for one in drawn if one in every[room]] for room in chosen}
    with workers(jobs, prepare_worker) as pool:
        results = _outcomes(pool, {room: of[room] for room in chosen if of[room]}, among, seconds)
    table = report(results, {room: len(found) for room, found in every.items()})
    publish(table, write, "mutants")


def _outcomes(
    pool: Executor, drawn: Mapping[str, Sequence[Mutant]], among: Mapping[str, Sequence[str]],
    seconds: float,
) -> list[Result]:  # fmt: skip
    """Results of the mutants of each room, in any order."""
    runners = {room: Runner(REPOSITORY, among[room]) for room in drawn}
    covering = {
        room: pool.submit(runners[room].coverage, f"services/{room}", _COVERAGE_TIMEOUT_S)
        for room in drawn
    }
    running: list[Future[Result]] = []
    for room, found in drawn.items():
        coverage, users = covering[room].result(), Users(REPOSITORY, f"services/{room}")
        _tell(f"{room}: {len(coverage.functions)} tests")
        for mutant in found:
            hit = coverage.tests_of(users.of(mutant.path, mutant.name))
            asked = coverage.within(hit, seconds)
            running.append(pool.submit(runners[room].outcome, mutant, *asked))
    results = []
    for number, done in enumerate(as_completed(running), 1):
        results.append(result := done.result())
        _tell(f"{number}/{len(running)} {result.mutant}: {result.outcome} ({result.tests} tests)")
    return results


def _tell(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def report(results: Sequence[Result], every: dict[str, int]) -> str:
    """The table of the records: share caught by room, and what survived.

    Args:
        results: of the mutants that were run.
        every: number of mutants there are, by room.
    """
    lines = ["| room | mutants | run | caught | share |", "|---|---|---|---|---|"]
    for room, count in every.items():
        ran = [one for one in results if one.mutant.path.startswith(f"services/{room}/")]
        lines.append(f"| {room} | {count} | {_counts(ran)} |")
    lines += [f"| all | {sum(every.values())} | {_counts(results)} |", "", "Not caught:", ""]
    lines += ["| module | constant | change | tests that run it |", "|---|---|---|---|"]
    lines += [
        f"| {one.mutant.path} | `{one.mutant.name}` | {one.mutant.factor} | {one.tests} |"
        for one in sorted(results, key=lambda one: one.mutant)
        if not _caught(one)
    ]
    return "\n".join(lines) + "\n"


def _caught(result: Result) -> bool:
    return result.outcome in ("caught", "too slow")


def _counts(results: Sequence[Result]) -> str:
    caught = Counter(map(_caught, results))[True]
    share = f"{100 * caught / len(results):.0f} %" if results else ""
    return f"{len(results)} | {caught} | {share}"


if __name__ == "__main__":
    run_app(app)
