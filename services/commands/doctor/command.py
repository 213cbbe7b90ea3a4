"""`heel doctor`: looks at everything that a robot needs, and names what is wrong with it."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from typing import Annotated

import typer

from heel.services.commands.doctor.facts import Facts
from heel.services.commands.doctor.findings import Finding, findings
from heel.services.commands.robot import RobotFlags, for_robot
from heel.services.runtime.logs import printable


@for_robot
def doctor(
    robot: RobotFlags,
    camera: Annotated[
        str | None,
        typer.Option(
            help="open this camera and count its pictures: /dev/video0, an address",
            metavar="SOURCE",
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object")] = False,
) -> None:
    """Look at router, services, clocks, shared memory, camera, network, ports and disk.

    Each finding names its cause and, after an arrow, the next command. Ends with 1 if something is
    wrong; what is only worth knowing is a note.
    """
    from heel.services.commands.doctor import gather

    where = gather.find(robot)
    machine = gather.look_at_machine(where)
    router, bus = gather.ask_robot(where)
    router = replace(router, certificate_days=gather.certificate_days(where.zenoh.config_file))
    facts = Facts(
        router=router, machine=machine, bus=bus, model=gather.try_model(),
        camera=None if camera is None else gather.try_camera(camera), devices=gather.devices(),
    )  # fmt: skip
    found = findings(facts)
    wrong = sum(one.level == "wrong" for one in found)
    if as_json:
        typer.echo(json.dumps({"wrong": wrong, "findings": [asdict(one) for one in found]}))
    else:
        for line in lines(found):
            typer.echo(line)
    if wrong:
        raise typer.Exit(1)


def lines(found: list[Finding]) -> list[str]:
    """Findings as text; what is said of other processes' words is only shown."""
    width = max((len(one.about) for one in found), default=0)
    told = []
    for one in found:
        told.append(f"{one.level:5}  {one.about:{width}}  {printable(one.words)}")
        if one.remedy:
            told.append(f"{'':5}  {'':{width}}  -> {printable(one.remedy)}")
    return told
