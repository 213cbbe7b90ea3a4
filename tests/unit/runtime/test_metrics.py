"""Health as figures for Prometheus, served on this machine only."""

from __future__ import annotations

import socket
import urllib.request

import pytest

from heel.schemas import Health
from heel.schemas.errors import HeelError
from heel.services.runtime.metrics import figures, serving_metrics
from heel.services.runtime.stops import HOLDS, HOLDS_NOT, STOP_DETAIL

HEALTH = Health(
    service="tracker", instance="main", producer="tracker/main@0123abcd", state="ok", uptime_s=9.0,
    loop_age_s=0.1, software_version="1", received=100, sent=99, dropped=3, cpu_s=2.5, rss_mb=2.0,
    busy_ms_p50=4.0, busy_ms_p95=8.0, busy_ms_p99=9.0,
)  # fmt: skip


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        found: int = probe.getsockname()[1]
    return found


def test_figures_are_in_seconds_and_bytes_under_names_that_differ() -> None:
    found = {one.name: one for one in figures(HEALTH)}
    assert len(found) == len(figures(HEALTH))
    assert found["heel_dropped"].values == {"": 3.0}
    assert found["heel_resident_bytes"].values == {"": 2097152.0}
    assert found["heel_busy_seconds"].values == {"0.5": 0.004, "0.95": 0.008, "0.99": 0.009}
    assert "heel_input_age_seconds" not in found, "nothing came yet"
    assert found["heel_ok"].values == {"": 1.0}
    sick = HEALTH.model_copy(update={"state": "degraded", "input_age_s": 2.0})
    found = {one.name: one for one in figures(sick)}
    assert found["heel_ok"].values == {"": 0.0}
    assert found["heel_input_age_seconds"].values == {"": 2.0}
    assert "heel_emergency_stop" not in found, "a tracker holds none"
    for value, told in ((HOLDS, 1.0), (HOLDS_NOT, 0.0)):
        drive = HEALTH.model_copy(update={"details": {STOP_DETAIL: value}})
        found = {one.name: one for one in figures(drive)}
        assert found["heel_emergency_stop"].values == {"": told}


def test_they_are_served_on_loopback_while_the_service_runs() -> None:
    pytest.importorskip("prometheus_client", reason="extra: metrics")
    port = free_port()
    with serving_metrics(port, lambda: HEALTH):
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=5) as answer:
            text = answer.read().decode()
        with pytest.raises(HeelError, match=f"metrics port {port}: Address already in use"):
            serving_metrics(port, lambda: HEALTH).__enter__()
    assert 'heel_dropped_total{instance="main",service="tracker"} 3.0' in text
    assert 'heel_busy_seconds{instance="main",quantile="0.99",service="tracker"} 0.009' in text
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.1", port), 1.0)


def test_before_the_first_health_there_are_no_figures() -> None:
    pytest.importorskip("prometheus_client", reason="extra: metrics")
    port = free_port()
    with serving_metrics(port, lambda: None):
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=5) as answer:
            assert answer.read() == b""
