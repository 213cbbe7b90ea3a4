"""docs/reference/wire.md and `heel schema` say what the code does, and the example in it works."""

from __future__ import annotations

import json
import re

import pytest
import zenoh

from heel.schemas import MESSAGES, EndOfStream, Message, Stamp, Track, Tracks, encode, keys
from heel.schemas.export import json_schemas
from heel.services.runtime import qos
from heel.services.runtime.qos import TopicQos
from tests.support import network
from tests.support.processes import running
from tools.site.wire_tables import DOCUMENT, named, rewritten, tables

_TEXT = DOCUMENT.read_text(encoding="utf-8")
_EXAMPLE = re.search(r"```python\n(.*?)```", _TEXT, re.DOTALL)
_TOPICS: dict[str, TopicQos] = {
    "cam/<cam>/image": qos.IMAGE,
    "cam/<cam>/jpeg": qos.JPEG,
    "cam/<cam>/depth": qos.DEPTH,
    "cam/<cam>/taken": qos.TAKEN,
    "cam/<cam>/info": qos.INFO,
    "cam/<cam>/blobs": qos.BLOBS,
    "cam/<cam>/tracks": qos.TRACKS,
    "cam/<cam>/events": qos.EVENTS,
    "cam/<cam>/progress/<consumer>": qos.PROGRESS,
    keys.FOLLOW_COMMAND: qos.COMMAND,
    keys.FOLLOW_STATE: qos.STATE,
    keys.FOLLOW_TARGET: qos.TARGET,
    keys.FOLLOW_POINTED: qos.POINTED,
    keys.FOLLOW_MANUAL: qos.MANUAL,
    keys.FOLLOW_ESTOP: qos.ESTOP,
    keys.ROBOT_ODOMETRY: qos.ODOMETRY,
    keys.ROBOT_RANGE: qos.RANGES,
    keys.ROBOT_DRIVE: qos.DRIVE,
    keys.SIM_TRUTH: qos.SIM_TRUTH,
    keys.SIM_WORLD: qos.SIM_WORLD,
    "svc/<service>/<instance>/health": qos.HEALTH,
}


def test_field_tables_are_those_of_the_schemas() -> None:
    """`python -m tools.site.wire_tables` makes them anew."""
    assert rewritten(_TEXT) == _TEXT


def test_every_message_and_every_part_of_one_has_its_table() -> None:
    assert sorted(named(_TEXT)) == sorted(tables())


def test_the_topic_table_is_that_of_the_code() -> None:
    section = _TEXT.partition("<!-- topics -->")[2].partition("<!-- end of topics -->")[0]
    rows = [
        [cell.strip().strip("`") for cell in line.strip("| \n").split("|")]
        for line in section.strip().splitlines()[2:]
    ]
    documented = {row[0]: row[3:8] for row in rows}
    assert documented == {key: _row(topic) for key, topic in _TOPICS.items()}


def test_every_topic_has_a_short_name() -> None:
    short = {key.rpartition("/")[2]: re.sub(r"<\w+>", "*", key) for key in _TOPICS}
    short["progress"] = short.pop("<consumer>")
    assert short == keys.TOPICS


def _row(topic: TopicQos) -> list[str]:
    return [
        _word(topic.priority), _word(topic.congestion), "yes" if topic.express else "no",
        str(topic.capacity), str(topic.max_bytes),
    ]  # fmt: skip


@pytest.mark.parametrize("kind", MESSAGES, ids=lambda kind: kind.schema_name)
def test_exported_schemas_state_encoding_version_and_cap(kind: type[Message]) -> None:
    contract = json_schemas()[kind.schema_name]
    assert contract["encoding"] == f"application/x-msgpack;{kind.schema_name}.v{kind.version}"
    assert (contract["version"], contract["max_bytes"]) == (kind.version, kind.max_bytes)
    schema = contract["schema"]
    assert schema["properties"]["v"]["const"] == kind.version
    assert "v" in schema["required"]
    assert set(schema["properties"]) == set(kind.model_fields)
    assert json.loads(json.dumps(contract)) == contract


def test_bytes_are_marked_as_binary_in_the_exported_schema() -> None:
    parts = json_schemas()["blobs"]["schema"]["$defs"]
    assert parts["Patch"]["properties"]["bgr"]["format"] == "binary"
    assert parts["Evidence"]["properties"]["data"]["format"] == "binary"


def test_the_example_needs_nothing_of_heel_and_is_short() -> None:
    assert _EXAMPLE is not None
    lines = [line for line in _EXAMPLE[1].splitlines() if line.strip()]
    assert len(lines) <= 20
    imported = set(re.findall(r"^import (.*)$", _EXAMPLE[1], re.MULTILINE))
    assert imported == {"json, sys", "msgpack, zenoh"}


def test_the_example_reads_tracks_until_the_stream_ends() -> None:
    assert _EXAMPLE is not None
    person = Track(
        id=7, state="tracked", box_xyxy=(1.0, 2.0, 3.5, 4.0), velocity_pxps=(0.0, 0.0),
        area_px=5.0, span_px=2.5, identity_confidence=1.0, shown=True,
    )  # fmt: skip
    message = Tracks(
        stream="front", epoch=1, seq=41, index=41, t_capture_ns=0, width=6, height=4,
        source_width=6, source_height=4, tracks=(person,),
    )  # fmt: skip
    stamp = Stamp(producer="tracker/main@0123abcd", t_sent_ns=0, age_ns=0)
    end = EndOfStream(stream="front", epoch=1, frames=42, reason="end")
    with network.router() as endpoint, network.client(endpoint) as session:
        out = session.declare_publisher(
            keys.tracks("front"), congestion_control=zenoh.CongestionControl.BLOCK
        )
        with running("-c", _EXAMPLE[1], endpoint, "front", PYTHONPATH="") as process:
            network.wait_for_listener(out)
            out.put(encode(message), encoding=message.encoding(), attachment=encode(stamp))
            out.put(encode(end), encoding=end.encoding())
            assert process.wait(network.DEADLINE_S) == 0, process.stderr()
            assert process.stdout().split(maxsplit=4) == [
                "41", "tracker/main@0123abcd", "7", "tracked", "[1.0, 2.0, 3.5, 4.0]\n",
            ]  # fmt: skip


def _word(member: object) -> str:
    return str(member).rpartition(".")[2]


def test_the_window_of_a_lossless_run_is_the_codes() -> None:
    frames = qos.LOSSLESS_WINDOW_FRAMES
    assert f"of at least `seq - {frames}`" in _TEXT
    overview = (DOCUMENT.parents[1] / "architecture.md").read_text(encoding="utf-8")
    assert f"up to\n*n - {frames}*" in overview


def test_every_field_says_what_it_means() -> None:
    rows = [row for table in tables().values() for row in table.splitlines()[2:]]
    assert [row for row in rows if row.rstrip().endswith("|  |")] == []
    assert len(rows) > 100
