"""`heel ros2 --check`: what the robot's side has of the topics, and what does not fit."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

from heel.services.ros2.node import RosNode, topics_of
from heel.services.ros2.outputs import outputs_of
from heel.services.ros2.settings import Ros2Settings

_DISCOVERY_S = 3.0
"""Time for the middleware to find the robot's nodes [s]; it takes one. Chosen by hand."""


@dataclass(frozen=True)
class End:
    """One publisher or subscriber of the robot: its type, and whether it is reliable."""

    kind: str
    reliable: bool


@dataclass(frozen=True)
class Finding:
    """What is said of one topic; `remedy` is the next thing to do, "" where all is well."""

    words: str
    remedy: str = ""


def judged_input(topic: str, kind: str, ends: Sequence[End], others: Sequence[str]) -> Finding:
    """Of a topic that Heel listens to.

    Args:
        topic, kind: as asked for, the kind like `sensor_msgs/msg/Image`.
        ends: the robot's publishers there. others: topics on which the robot publishes that kind.
    """
    if not ends:
        there = f"the robot publishes {kind} on {', '.join(others)}" if others else ""
        remedy = f"name one of those, or '' for none; {there}" if there else (
            "start the robot's driver, or name '' for none"
        )  # fmt: skip
        return Finding(f"{topic}: nobody publishes there", remedy)
    wrong = sorted({end.kind for end in ends} - {kind})
    if wrong:
        return Finding(f"{topic}: {', '.join(wrong)} instead of {kind}", "name another topic")
    return Finding(f"{topic}: {kind}, {len(ends)} publisher{'s' * (len(ends) > 1)}")


def judged_output(topic: str, kind: str, ends: Sequence[End]) -> Finding:
    """Of the topic that velocities go to; `ends` are the robot's subscribers there."""
    if not ends:
        return Finding(
            f"{topic}: nobody listens there", "name the topic of the base or of twist_mux"
        )
    wrong = sorted({end.kind for end in ends} - {kind})
    if wrong:
        stamped = any(other.endswith("TwistStamped") for other in wrong)
        flag = "--command-stamped" if stamped else "--no-command-stamped"
        return Finding(f"{topic}: the robot wants {', '.join(wrong)}, not {kind}", flag)
    return Finding(f"{topic}: {kind}, {len(ends)} listener{'s' * (len(ends) > 1)}")


def judged_told(topic: str, kind: str, ends: Sequence[End]) -> Finding:
    """Of a topic on which something is told that no robot needs: without listeners all is well."""
    wrong = sorted({end.kind for end in ends} - {kind})
    if wrong:
        return Finding(f"{topic}: the robot wants {', '.join(wrong)}, not {kind}", "another topic")
    return Finding(f"{topic}: {kind}, {len(ends) or 'no'} listener{'s' * (len(ends) != 1)}")


def check(settings: Ros2Settings) -> int:
    """Print what is there; 0 if all fits, 1 if not.

    Raises:
        HeelError: as `RosNode`.
    """
    failed = False
    with RosNode(settings, time.monotonic_ns) as ros:
        time.sleep(_DISCOVERY_S)
        node = ros.node
        there = dict(node.get_topic_names_and_types())
        findings = []
        for topic, kind in topics_of(settings).values():
            name = node.resolve_topic_name(topic)
            wanted = _name_of(kind)
            ends = [_end(one) for one in node.get_publishers_info_by_topic(name)]
            others = sorted(other for other, kinds in there.items() if wanted in kinds)
            findings.append(judged_input(name, wanted, ends, others))
        name = node.resolve_topic_name(settings.command_topic)
        wanted = f"geometry_msgs/msg/Twist{'Stamped' if settings.command_stamped else ''}"
        ends = [_end(one) for one in node.get_subscriptions_info_by_topic(name)]
        findings.append(judged_output(name, wanted, ends))
        for output in outputs_of(settings).values():
            name = node.resolve_topic_name(output.topic)
            ends = [_end(one) for one in node.get_subscriptions_info_by_topic(name)]
            findings.append(judged_told(name, f"{output.package}/msg/{output.message}", ends))
    for finding in findings:
        failed = failed or bool(finding.remedy)
        print(f"{'wrong' if finding.remedy else 'ok   '}  {finding.words}")
        if finding.remedy:
            print(f"       next: {finding.remedy}")
    return int(failed)


def _name_of(kind: type) -> str:
    return f"{kind.__module__.split('.')[0]}/msg/{kind.__name__}"


def _end(info: object) -> End:
    kind = str(getattr(info, "topic_type", ""))
    reliability = getattr(getattr(info, "qos_profile", None), "reliability", None)
    return End(kind, "RELIABLE" in str(reliability))
