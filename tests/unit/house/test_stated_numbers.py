"""Numbers and lists that architecture, wire contract and guides state are those of the code."""

from __future__ import annotations

import re
import tomllib

import pytest

from heel.schemas import blobs, codec, image, keys
from heel.services.drive.settings import DriveServiceSettings
from heel.services.follower import pending, sensors
from heel.services.follower.settings import FollowerSettings
from heel.services.runtime import health, qos, sequence, session, stop_keeper, streams
from heel.services.web import connections
from tests.support.processes import REPOSITORY

_WIRE, _ARCHITECTURE = "docs/reference/wire.md", "docs/architecture.md"
_ROBOT, _PAGE = "docs/guides/robot.md", "docs/guides/page.md"
_FOLLOWER, _DRIVE = FollowerSettings(), DriveServiceSettings()

_STATED = [
    (_WIRE, f"at least `seq - {qos.LOSSLESS_WINDOW_FRAMES}`"),
    (_ARCHITECTURE, f"*n - {qos.LOSSLESS_WINDOW_FRAMES}*"),
    (_WIRE, f"with BLOCK and receives them with a ring of {qos.LOSSLESS_CAPACITY}"),
    (_WIRE, f"what is larger than {session.MAX_MESSAGE_BYTES >> 20} MiB never reaches a receiver"),
    (_WIRE, f"(timeout {session.QUERY_TIMEOUT_S:g} s)"),
    (_WIRE, f"silent for {streams.PRODUCER_STALE_S:g} s"),
    (_WIRE, f"nothing has followed for {streams.END_HOLD_S:g} s"),
    (_WIRE, f"by more than {sequence._AT_ONCE} and {sequence._MOST_PER_S:g} for each second"),
    (_WIRE, f"longer than its schema allows ({codec._MAX_MAP} and {codec._MAX_ARRAY} in any case)"),
    (_WIRE, f"more than {image._MAX_SCANS} scans"),
    (_WIRE, f"width times height is at most 2^{blobs.MAX_WORK_PIXELS.bit_length() - 1}"),
    (_WIRE, f"The point stays pending for {pending.PENDING_S:g} s"),
    (_WIRE, "send it four times a second" if health.PERIOD_S == 0.25 else "?"),
    (_WIRE, "ask one another once a second" if stop_keeper._ASK_PERIOD_S == 1.0 else "?"),
    (_WIRE, "1 to 64 characters of `a-z 0-9 _ -`"),
    (_ROBOT, f"tracks older than `max_tracks_age_s` | {_FOLLOWER.max_tracks_age_s:g} s |"),
    (_ROBOT, f"after good ones {_FOLLOWER.max_ranges_age_s:g} s "
             f"(odometry {sensors.MAX_ODOMETRY_AGE_S:g} s)"),
    (_ROBOT, f"| `ttl_s`, {_DRIVE.ttl_s:g} s |"),
    (_ROBOT, f"`driver_deadline_s`, {_DRIVE.driver_deadline_s:g} s"),
    (_ROBOT, f"publishes `robot/drive` {_DRIVE.rate_hz:g} times a second"),
    (_ARCHITECTURE, f"follower's {_FOLLOWER.rate_hz:g} Hz timer"),
    (_PAGE, f"keeps at most {connections.MOST_CONNECTIONS} connections"),
]  # fmt: skip


@pytest.mark.parametrize(("page", "phrase"), _STATED)
def test_the_page_states_the_number_of_the_code(page: str, phrase: str) -> None:
    text = " ".join((REPOSITORY / page).read_text(encoding="utf-8").split())
    assert phrase in text, f"{page} does not say {phrase!r}"


def test_names_in_keys_are_as_the_contract_says() -> None:
    assert keys.chunk("a" * 64, "camera") == "a" * 64
    for name in ("", "a" * 65, "A", "a/b", "a b"):
        with pytest.raises(Exception, match="camera"):
            keys.chunk(name, "camera")


def test_the_layers_of_the_page_are_those_of_the_contract() -> None:
    page = (REPOSITORY / _ARCHITECTURE).read_text(encoding="utf-8")
    section = page.partition("## Layers")[2].partition("\n## ")[0]
    shown = re.findall(r"^    (.+)$", section, re.MULTILINE)
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = project["tool"]["importlinter"]["contracts"]
    (order,) = [contract["layers"] for contract in contracts if contract["type"] == "layers"]
    assert [line.split(" | ") for line in shown] == [line.split(" | ") for line in order]


def test_every_folder_of_the_map_of_rooms_is_there_and_none_is_missing() -> None:
    page = (REPOSITORY / _ARCHITECTURE).read_text(encoding="utf-8").partition("## Layers")[0]
    named = set(re.findall(r"^    services/([a-z0-9]+)/", page, re.MULTILINE))
    rooms = {path.name for path in (REPOSITORY / "services").iterdir()
             if path.is_dir() and (path / "__init__.py").exists()}  # fmt: skip
    assert named <= rooms
    # These follow the line of `services/<name>/`.
    assert rooms - named == {"capture", "follower", "web"}
