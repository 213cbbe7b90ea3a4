"""What a service says of itself several times a second."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from heel.schemas.base import Count, Flag, Message, Name, NonNegative, Text
from heel.schemas.frame import Producer


class Health(Message):
    """State and counters of one service since its start; rates are of the last two seconds."""

    schema_name: ClassVar[str] = "health"
    max_bytes: ClassVar[int] = 65536

    service: Name
    instance: Name
    producer: Producer
    state: Literal["starting", "ok", "degraded", "error", "ended"]
    reason: Text = ""
    uptime_s: NonNegative
    input_age_s: NonNegative | None = Field(default=None, description="since the last good input")
    loop_age_s: NonNegative = Field(description="since the service loop last came round")
    rate_in_hz: NonNegative = 0.0
    rate_out_hz: NonNegative = 0.0
    received: Count = 0
    sent: Count = 0
    dropped: Count = Field(default=0, description="frames missing from the input, by seq gaps")
    malformed: Count = Field(default=0, description="input messages refused")
    busy_ms_p50: NonNegative = Field(default=0.0, description="time spent on one input")
    busy_ms_p95: NonNegative = 0.0
    busy_ms_p99: NonNegative = 0.0
    age_ms_p50: NonNegative = Field(default=0.0, description="frame age when the result is sent")
    age_ms_p95: NonNegative = 0.0
    age_ms_p99: NonNegative = 0.0
    shared_memory: Flag | None = Field(
        default=None, description="whether the last large input came through shared memory"
    )
    cpu_s: NonNegative = 0.0
    rss_mb: NonNegative = 0.0
    peak_rss_mb: NonNegative = 0.0
    software_version: Text
    period_s: Annotated[float, Field(strict=True, gt=0, le=60)] = Field(
        default=1.0, description="to the next message: whoever misses three in a row is silent"
    )
    details: Annotated[dict[str, str], Field(max_length=32)] = Field(default_factory=dict)
