"""`heel ros2 --check`: what the robot's side has of the topics, and what does not fit."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

from heel.services.ros2.joining import joined
from heel.services.ros2.node import End, RosNode, subscriptions, velocity_kind
from heel.services.ros2.outputs import outputs_of
from heel.services.ros2.settings import Ros2Settings


@dataclass(frozen=True)
class Finding:
    """What is said of one topic; `remedy` is the next thing to do, "" where all is well."""

    words: str
    remedy: str = ""


def judged_input(topic: str, wanted: End, ends: Sequence[End], others: Sequence[str]) -> Finding:
    """Of a topic that Heel listens to.

    Args:
        topic: by its full name.
        wanted: what Heel reads there.
        ends: the robot's publishers there.
        others: topics on which the robot publishes that kind.
    """
    if not ends:
        there = f"the robot publishes {wanted.kind} on {', '.join(others)}" if others else ""
        remedy = f"name one of those, or '' for none; {there}" if there else (
            "start the robot's driver, or name '' for none"
        )  # fmt: skip
        return Finding(f"{topic}: nobody publishes there", remedy)
    wrong = sorted({end.kind for end in ends} - {wanted.kind})
    if wrong:
        return Finding(
            f"{topic}: {', '.join(wrong)} instead of {wanted.kind}", "name another topic"
        )
    if (other := _other_definition(topic, wanted, ends)) is not None:
        return other
    return Finding(f"{topic}: {wanted.kind}, {len(ends)} publisher{'s' * (len(ends) > 1)}")


def judged_output(topic: str, wanted: End, ends: Sequence[End]) -> Finding:
    """Of the topic that velocities go to; `ends` are the robot's subscribers there."""
    if not ends:
        return Finding(
            f"{topic}: nobody listens there", "name the topic of the base or of twist_mux"
        )
    wrong = sorted({end.kind for end in ends} - {wanted.kind})
    if wrong:
        stamped = any(other.endswith("TwistStamped") for other in wrong)
        flag = "--command-stamped" if stamped else "--no-command-stamped"
        return Finding(f"{topic}: the robot wants {', '.join(wrong)}, not {wanted.kind}", flag)
    if any(end.latched for end in ends):
        return Finding(
            f"{topic}: a listener wants velocities of before it came (transient local), and so "
            "hears none of Heel's, which are never kept", "let it listen with durability volatile"
        )  # fmt: skip
    if (other := _other_definition(topic, wanted, ends)) is not None:
        return other
    return Finding(f"{topic}: {wanted.kind}, {len(ends)} listener{'s' * (len(ends) > 1)}")


def judged_told(topic: str, wanted: End, ends: Sequence[End]) -> Finding:
    """Of a topic on which something is told that no robot needs: without listeners all is well."""
    wrong = ", ".join(sorted({end.kind for end in ends} - {wanted.kind}))
    if wrong:
        return Finding(f"{topic}: the robot wants {wrong}, not {wanted.kind}", "another topic")
    if (other := _other_definition(topic, wanted, ends)) is not None:
        return other
    count = f"{len(ends) or 'no'} listener{'s' * (len(ends) != 1)}"
    return Finding(f"{topic}: {wanted.kind}, {count}")


def _other_definition(topic: str, wanted: End, ends: Sequence[End]) -> Finding | None:
    """What is said where an end's type is of that name, and not what Heel knows by it."""
    other = sorted({end.type_hash for end in ends} - {wanted.type_hash})
    if not other:
        return None
    return Finding(
        f"{topic}: the robot's {wanted.kind} is another one (hash {other[0][:16]}, not "
        f"{wanted.type_hash[:16]}): nothing passes",
        "let the robot's node be of ROS 2 Jazzy or later, or use --rmw dds",
    )


def check(settings: Ros2Settings) -> int:
    """Print what is there; 0 if all fits, 1 if not.

    Raises:
        HeelError: as `RosNode`.
    """
    failed = False
    with joined(settings) as node:
        time.sleep(node.discovery_s)
        there = node.topics()
        findings = []
        for topic, kind in subscriptions(settings).values():
            name, wanted = node.full_name(topic), _wanted(node, kind)
            alike = sorted(other for other, kinds in there.items() if kind in kinds)
            others = [other for other in alike if node.publishers(other)]
            findings.append(judged_input(name, wanted, node.publishers(name), others))
        name = node.full_name(settings.command_topic)
        wanted = _wanted(node, velocity_kind(settings))
        findings.append(judged_output(name, wanted, node.subscribers(name)))
        for topic, kind in outputs_of(settings).values():
            name = node.full_name(topic)
            findings.append(judged_told(name, _wanted(node, kind), node.subscribers(name)))
    for finding in findings:
        failed = failed or bool(finding.remedy)
        print(f"{'wrong' if finding.remedy else 'ok   '}  {finding.words}")
        if finding.remedy:
            print(f"       next: {finding.remedy}")
    return int(failed)


def _wanted(node: RosNode, kind: str) -> End:
    return End(kind, type_hash=node.type_hash(kind))
