"""The bridge's node on rmw_zenoh's wire, beside a robot that knows Zenoh and the keys alone."""

from __future__ import annotations

import struct
import time
from collections.abc import Iterator

import pytest
import zenoh

from heel.schemas import HeelError
from heel.services.ros2.check import check
from heel.services.ros2.joining import joined
from heel.services.ros2.node import Heard, RosNode
from heel.services.ros2.settings import Ros2Settings
from tests.support import network
from tests.support.network import wait_until

pytest.importorskip("rosbags", reason="no rosbags here: it comes with the extra ros2-zenoh")
TWIST = (
    "7/cmd_vel/geometry_msgs::msg::dds_::Twist_/"
    "RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a"
)
STOP = (
    "7/stop/std_msgs::msg::dds_::Bool_/"
    "RIHS01_feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9"
)


def settings(endpoint: str) -> Ros2Settings:
    return Ros2Settings(
        rmw="zenoh", ros_router=endpoint, domain_id=7, estop_topic="stop", image_topic="",
        camera_info_topic="", scan_topic="", odometry_topic="",
    )  # fmt: skip


class Base:
    """Hears velocities."""

    def __init__(self, session: zenoh.Session) -> None:
        self.heard: list[zenoh.Sample] = []
        session.declare_subscriber(TWIST, self.heard.append)

    @property
    def speeds(self) -> list[float]:
        return [struct.unpack_from("<d", one.payload.to_bytes(), 4)[0] for one in self.heard]


@pytest.fixture
def endpoint() -> Iterator[str]:
    with network.router() as address:
        yield address


@pytest.fixture
def session(endpoint: str) -> Iterator[zenoh.Session]:
    with network.client(endpoint) as opened:
        yield opened


def sent(node: RosNode, base: Base) -> None:
    wait_until(lambda: node.send(0.5, 0.1) is None and len(base.heard) > 0, "a velocity")


def test_velocities_are_numbered_and_the_last_ones_are_zero(
    endpoint: str, session: zenoh.Session
) -> None:
    base = Base(session)
    with joined(settings(endpoint)) as node:
        sent(node, base)
    wait_until(lambda: base.speeds[-3:] == [0.0] * 3, "three zeros")
    beside = [one.attachment.to_bytes() for one in base.heard if one.attachment is not None]
    numbers = [struct.unpack_from("<q", one)[0] for one in beside]
    assert numbers == list(range(numbers[0], numbers[0] + len(base.heard)))
    assert {(len(one), one[16], one[17:]) for one in beside} == {(33, 16, beside[0][17:])}


def test_nothing_is_kept_for_who_comes_late(endpoint: str, session: zenoh.Session) -> None:
    early = Base(session)
    with joined(settings(endpoint)) as node:
        sent(node, early)
        with network.client(endpoint) as other:
            late = Base(other)
            asked = [reply.ok for reply in other.get(TWIST, timeout=0.3)]
            time.sleep(0.2)
            assert (late.heard, asked) == ([], [])


def test_a_bridge_that_never_drove_sends_nothing(endpoint: str, session: zenoh.Session) -> None:
    base = Base(session)
    with joined(settings(endpoint)):
        time.sleep(0.2)
    time.sleep(0.2)
    assert base.heard == []


def test_stops_are_counted_and_what_is_none_is_told(endpoint: str, session: zenoh.Session) -> None:
    with joined(settings(endpoint)) as node:
        heard = Heard()

        def stopped(payload: bytes) -> bool:
            nonlocal heard
            session.put(STOP, payload)
            if not node.arrived.wait(0.5):
                return False
            heard = node.take()
            return heard.stops > 0 or bool(heard.unread)

        wait_until(lambda: stopped(b"\0\1\0\0\1"), "the stop")
        assert heard.stops >= 1
        node.take()
        wait_until(lambda: stopped(b"nonsense"), "the complaint")
        assert (heard.stops, "Bool" in heard.unread["stops"]) == (0, True)


def test_others_see_the_node_and_the_check_sees_them(
    endpoint: str, session: zenoh.Session, capsys: pytest.CaptureFixture[str]
) -> None:
    def roles() -> list[str]:
        replies = session.liveliness().get("@ros2_lv/7/**")
        return sorted(
            str(one.ok.key_expr).split("/")[5] for one in replies if one.ok is not None
        )  # fmt: skip

    with joined(settings(endpoint)):
        wait_until(lambda: roles() == ["MP", "MS", "NN"], "the node's tokens")
    dds = "geometry_msgs::msg::dds_::TwistStamped_"
    theirs = f"@ros2_lv/7/ab/0/1/MS/%/%/base/%cmd_vel/{dds}/RIHS01_ab/::,10:,:,:,,"
    with network.client(endpoint) as base:
        token = base.liveliness().declare_token(theirs)
        wait_until(lambda: roles() == ["MS"], "only the base's")
        assert check(settings(endpoint)) == 1
        token.undeclare()
    told = capsys.readouterr().out
    assert "/cmd_vel: the robot wants geometry_msgs/msg/TwistStamped" in told
    assert "next: --command-stamped" in told


def test_without_the_robots_router_there_is_one_clear_error() -> None:
    nowhere = f"tcp/127.0.0.1:{network.free_port()}"
    with pytest.raises(HeelError, match="rmw_zenohd"):
        joined(settings(nowhere))
