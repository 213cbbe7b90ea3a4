"""A recording holds what went over the bus, is read by others, and says what is missing."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from mcap.reader import make_reader

from heel.schemas import Tracks, decode
from heel.schemas.errors import SourceError
from heel.services.commands.recording.checking import check
from heel.services.recordings.reading import Recording, wire_messages
from heel.services.recordings.wire import ATTACHMENT_OF, WireMessage
from tests.support.recordings import image, info, jpeg, recording, tracks


def everything() -> list[WireMessage]:
    strange = WireMessage("follow/command", "text/plain", b"go", None, 7)
    frames = [one for seq in range(8) for one in (image(seq), jpeg(seq), tracks(seq))]
    return [info(), strange, *frames]


def test_messages_come_out_as_they_went_in(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", everything())
    read = Recording(path)
    assert list(wire_messages(read)) == everything()
    assert (read.complete, read.profile, read.damage) == (True, "heel", "")
    assert read.session["flush_period_s"] == "0.25"


def test_other_readers_find_payloads_with_their_schema(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", everything())
    with path.open("rb") as file:
        found = list(make_reader(file, validate_crcs=True).iter_messages(topics="cam/front/tracks"))
    assert len(found) == 8
    schema, channel, message = found[3]
    assert schema is not None
    assert (schema.name, schema.encoding) == ("heel.tracks.v1", "jsonschema")
    assert "tracks" in json.loads(schema.data)["properties"]
    assert channel.message_encoding == "msgpack"
    assert ATTACHMENT_OF not in channel.metadata
    assert decode(Tracks, message.data).seq == 3


@pytest.mark.parametrize("share", [0.1, 0.37, 0.5, 0.83, 0.97])
def test_a_recording_that_is_cut_off_is_read_up_to_there(tmp_path: Path, share: float) -> None:
    whole = recording(tmp_path / "a.mcap", everything() * 200).read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: int(share * len(whole))])
    read = Recording(cut)
    found = list(wire_messages(read))
    assert found == (everything() * 200)[: len(found)]
    assert not read.complete
    assert len(whole) * share - read.whole_bytes < 1.2e6, "a chunk at most is missing"


def test_bytes_that_were_changed_end_a_recording_before_them(tmp_path: Path) -> None:
    whole = bytearray(recording(tmp_path / "a.mcap", everything() * 200).read_bytes())
    whole[len(whole) // 2] ^= 1
    changed = tmp_path / "changed.mcap"
    changed.write_bytes(whole)
    read = Recording(changed)
    found = list(wire_messages(read))
    assert 0 < len(found) < len(everything()) * 200
    assert found == (everything() * 200)[: len(found)]
    assert "damaged record" in read.damage


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"not a recording")
    with pytest.raises(SourceError, match=r"no MCAP file: record one with"):
        list(wire_messages(Recording(tmp_path / "a.mcap")))
    with pytest.raises(SourceError, match="No such file"):
        list(wire_messages(Recording(tmp_path / "absent.mcap")))


def test_a_check_counts_messages_and_gaps(tmp_path: Path) -> None:
    missing = [info(), *(tracks(seq) for seq in range(50) if seq not in (7, 8, 30))]
    broken = WireMessage("cam/front/tracks", Tracks.encoding(), b"\xc1", tracks(0).attachment, 9)
    found = check(Recording(recording(tmp_path / "a.mcap", [*missing, broken])))
    topic = found.topics["cam/front/tracks"]
    assert (topic.messages, topic.missing, topic.undecodable) == (48, 3, 1)
    assert found.lost_at_end_s == 0.0
    assert found.topics["cam/front/info"].missing == 0


def test_a_check_says_what_a_kill_costs_at_most(tmp_path: Path) -> None:
    path = recording(tmp_path / "a.mcap", [tracks(seq) for seq in range(50)], closed=False)
    path.write_bytes(path.read_bytes() + b"\x06half a chunk")
    found = check(Recording(path))
    assert not found.recording.complete
    assert found.cut_bytes == 13
    assert found.lost_at_end_s == 0.25
    assert found.topics["cam/front/tracks"].messages == 50
