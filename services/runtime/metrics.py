"""A service's health for Prometheus, on a port of this machine alone, where it is asked for.

The figures are those of the newest health message, a quarter of a second old at most: a scrape
costs the service's loop nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Literal

from heel.schemas import Health
from heel.schemas.errors import HeelError, SettingsError
from heel.services.runtime.stops import HOLDS, STOP_DETAIL

ADDRESS = "127.0.0.1"


@dataclass(frozen=True, slots=True)
class Figure:
    """One figure of a service, as Prometheus names such things.

    Attributes:
        name: without the unit's prefix; counters get `_total` of Prometheus itself.
        kind: whether it only goes up.
        meaning: in a few words.
        values: by the value of the label that tells them apart; "" where there is one only.
        label: name of that label.
    """

    name: str
    kind: Literal["counter", "gauge"]
    meaning: str
    values: dict[str, float]
    label: str = ""


def figures(health: Health) -> list[Figure]:
    """Everything that a health message counts, in seconds and bytes. Pure."""
    h = health
    counters = {
        "heel_received": ("messages taken in", h.received),
        "heel_sent": ("messages sent", h.sent),
        "heel_dropped": ("frames missing from the input", h.dropped),
        "heel_malformed": ("input messages refused", h.malformed),
        "heel_cpu_seconds": ("processor time", h.cpu_s),
    }
    gauges = {
        "heel_ok": ("1 while the service has no complaint", float(h.state == "ok")),
        "heel_uptime_seconds": ("since the start", h.uptime_s),
        "heel_loop_age_seconds": ("since the service loop came round", h.loop_age_s),
        "heel_rate_in_hertz": ("messages taken in per second", h.rate_in_hz),
        "heel_rate_out_hertz": ("messages sent per second", h.rate_out_hz),
        "heel_resident_bytes": ("memory", h.rss_mb * 1024.0 * 1024.0),
    }
    if h.input_age_s is not None:
        gauges["heel_input_age_seconds"] = ("since the last good input", h.input_age_s)
    if STOP_DETAIL in h.details:
        gauges["heel_emergency_stop"] = (
            "1 while the emergency stop holds here", float(h.details[STOP_DETAIL] == HOLDS)
        )  # fmt: skip
    quantiles = {
        "heel_busy_seconds": (
            "time spent on one input", (h.busy_ms_p50, h.busy_ms_p95, h.busy_ms_p99)
        ),
        "heel_frame_age_seconds": (
            "age of a frame when its result is sent", (h.age_ms_p50, h.age_ms_p95, h.age_ms_p99)
        ),
    }  # fmt: skip
    return [
        *(Figure(name, "counter", words, {"": float(one)})
          for name, (words, one) in counters.items()),
        *(Figure(name, "gauge", words, {"": float(one)}) for name, (words, one) in gauges.items()),
        *(Figure(name, "gauge", words, dict(zip(("0.5", "0.95", "0.99"),
                                                (ms / 1e3 for ms in values), strict=True)),
                 "quantile")
          for name, (words, values) in quantiles.items()),
    ]  # fmt: skip


@contextmanager
def serving_metrics(port: int, newest: Callable[[], Health | None]) -> Iterator[None]:
    """Answer Prometheus on a port of the loopback address while the block runs.

    Args:
        port: 1 to 65535.
        newest: the last health message; None before the first.

    Raises:
        SettingsError: prometheus-client is not installed.
        HeelError: the port is taken.
    """
    try:
        import prometheus_client
        from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily
    except ImportError:
        raise SettingsError(
            "metrics_port needs prometheus-client: pip install prometheus-client"
        ) from None

    class Collector:
        """Asked at every scrape."""

        def collect(self) -> Iterator[Any]:
            """The figures of the newest health message."""
            health = newest()
            if health is None:
                return
            names, own = ["service", "instance"], [health.service, health.instance]
            families = {"counter": CounterMetricFamily, "gauge": GaugeMetricFamily}
            for figure in figures(health):
                more = [figure.label] if figure.label else []
                family = families[figure.kind](figure.name, figure.meaning, labels=[*names, *more])
                for value_of, value in figure.values.items():
                    family.add_metric([*own, value_of] if more else own, value)
                yield family

    registry = prometheus_client.CollectorRegistry(auto_describe=False)
    registry.register(Collector())
    try:
        server, thread = prometheus_client.start_http_server(port, ADDRESS, registry)
    except OSError as error:
        raise HeelError(
            f"metrics port {port}: {error.strerror}: choose another with --metrics-port"
        ) from None
    try:
        yield
    finally:
        server.shutdown()
        server.server_close()
        thread.join(timeout=1.0)
