"""`heel foxglove`: what passes on the robot's bus, for Foxglove and viewers of its protocol."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Annotated, Any

import typer

from heel.schemas import HeelError, Message, keys
from heel.schemas.errors import SettingsError
from heel.services.commands.bus.listening import For, listening
from heel.services.commands.bus.message import Received, as_object, tell
from heel.services.commands.robot import RobotFlags, for_robot

if TYPE_CHECKING:
    from heel.services.foxglove_messages import FoxgloveMessages
    from heel.services.runtime.inbox import Arrival

_LEFT_OUT = ("image", "depth", "blobs", "progress", "taken")
"""Topics that are not served: pictures come as JPEG, and the others are of no use to a viewer."""
_MOST_CHANNELS = 512
"""Topics that are told apart; bounds the memory, chosen by hand."""
_BACKLOG = 64
"""Messages that wait for a viewer that is slow: two seconds of pictures. Chosen by hand."""


@for_robot
def foxglove(
    robot: RobotFlags,
    host: Annotated[str, typer.Option(help="address to listen on")] = "127.0.0.1",
    port: Annotated[
        int, typer.Option(help="TCP port; 0 picks a free one", min=0, max=65535)
    ] = 8765,
    insecure: Annotated[
        bool,
        typer.Option("--insecure", help="allow an address beyond loopback: whoever reaches it can "
                     "watch"),
    ] = False,
    for_s: For = None,
) -> None:  # fmt: skip
    """Serve what passes on the bus to Foxglove, live: pictures with marks, poses, log, messages."""
    from heel.services.foxglove_messages import FoxgloveMessages, library
    from heel.services.web.settings import is_loopback

    if not (insecure or is_loopback(host)):
        raise SettingsError(
            f"--host {host}: whoever reaches this address could watch: keep 127.0.0.1 (and use an "
            "SSH tunnel), or say --insecure if that is meant"
        )
    library()
    import foxglove as sdk

    wanted = {name: key for name, key in keys.TOPICS.items() if name not in _LEFT_OUT}
    context = sdk.Context()
    with listening(robot.find(), wanted, for_s) as bus:
        try:
            server = sdk.start_server(
                name="heel", host=host, port=port, context=context, message_backlog_size=_BACKLOG
            )
        except (RuntimeError, OSError) as error:
            raise HeelError(f"--port {port}: cannot listen on {host} ({error})") from None
        try:
            shown = f"[{host}]" if ":" in host else host
            typer.echo(f"Foxglove: open connection, ws://{shown}:{server.port}")
            channels = _Channels(context, FoxgloveMessages())
            for arrival in bus.turns():
                if arrival is not None:
                    channels.pass_on(arrival)
        finally:
            server.stop()


class _Channels:
    """One channel for each topic, made when its first message comes."""

    def __init__(self, context: Any, made: FoxgloveMessages) -> None:
        self._context, self._made = context, made
        self._channels: dict[str, Any] = {}
        self._wall_minus_monotonic_s = time.time() - time.monotonic()

    def pass_on(self, arrival: Arrival) -> None:
        """Send what an arrival is to Foxglove, and the message itself as JSON."""
        logged_ns = round((arrival.arrived_s + self._wall_minus_monotonic_s) * 1e9)
        for one in self._made.of(
            arrival.key, arrival.encoding, arrival.payload, arrival.attachment, logged_ns
        ):
            channel = self._channel(one.topic, one.kind.get_schema(), "protobuf")
            if channel is not None:
                channel.log(one.data, log_time=one.logged_ns)
        if not arrival.encoding.startswith("image/"):
            self._as_json(arrival, logged_ns)

    def _as_json(self, arrival: Arrival, logged_ns: int) -> None:
        told = tell(
            Received(arrival.key, arrival.arrived_s, arrival.size, arrival.encoding,
                     arrival.attachment, arrival.payload)
        )  # fmt: skip
        if not isinstance(told.content, Message):
            return
        from heel.schemas.export import json_schemas

        if arrival.key not in self._channels:
            schema = json_schemas()[told.content.schema_name]["schema"]
            self._channel(arrival.key, schema, None)
        channel = self._channels.get(arrival.key)
        if channel is not None:
            channel.log(as_object(arrival.key, told)["message"], log_time=logged_ns)

    def _channel(self, topic: str, schema: Any, encoding: str | None) -> Any | None:
        """The channel of a topic; None for one too many."""
        import foxglove as sdk

        channel = self._channels.get(topic)
        if channel is None and len(self._channels) < _MOST_CHANNELS:
            channel = self._channels[topic] = sdk.Channel(
                topic, schema=schema, message_encoding=encoding, context=self._context
            )
        return channel
