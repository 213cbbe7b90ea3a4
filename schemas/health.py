"""Health of a service, which it sends several times a second."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from heel.schemas.base import Count, Flag, Message, Name, NonNegative, Text
from heel.schemas.frame import Producer


class Health(Message):
    """State and counters of one service since its start; rates are of the last two seconds."""

    schema_name: ClassVar[str] = "health"
    max_bytes: ClassVar[int] = 65536

    service: Name = Field(description="kind of process")
    instance: Name = Field(description="name among its kind")
    producer: Producer = Field(description="this very process")
    state: Literal["starting", "ok", "degraded", "error", "ended"] = Field(
        description="ok, or what is wrong with it"
    )
    reason: Text = Field(default="", description="why, in words; empty: ok")
    uptime_s: NonNegative = Field(description="since its start")
    input_age_s: NonNegative | None = Field(default=None, description="since the last good input")
    loop_age_s: NonNegative = Field(description="since the service loop last came round")
    rate_in_hz: NonNegative = Field(default=0.0, description="messages taken in per second")
    rate_out_hz: NonNegative = Field(default=0.0, description="messages sent per second")
    received: Count = Field(default=0, description="messages taken in")
    sent: Count = Field(default=0, description="messages sent")
    dropped: Count = Field(default=0, description="frames missing from the input, by seq gaps")
    malformed: Count = Field(default=0, description="input messages refused")
    busy_ms_p50: NonNegative = Field(default=0.0, description="time spent on one input")
    busy_ms_p95: NonNegative = Field(default=0.0, description="the same, 95th percentile")
    busy_ms_p99: NonNegative = Field(default=0.0, description="the same, 99th percentile")
    age_ms_p50: NonNegative = Field(default=0.0, description="frame age when the result is sent")
    age_ms_p95: NonNegative = Field(default=0.0, description="the same, 95th percentile")
    age_ms_p99: NonNegative = Field(default=0.0, description="the same, 99th percentile")
    shared_memory: Flag | None = Field(
        default=None, description="whether the last large input came through shared memory"
    )
    cpu_s: NonNegative = Field(default=0.0, description="processor time")
    rss_mb: NonNegative = Field(default=0.0, description="memory now")
    peak_rss_mb: NonNegative = Field(default=0.0, description="most memory so far")
    software_version: Text = Field(description="of Heel")
    period_s: Annotated[float, Field(strict=True, gt=0, le=60)] = Field(
        default=1.0, description="to the next message: whoever misses three in a row is silent"
    )
    details: Annotated[dict[str, str], Field(max_length=32)] = Field(
        description="of this kind of service, in words", default_factory=dict
    )
