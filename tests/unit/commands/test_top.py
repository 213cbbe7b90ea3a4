"""The live table of the services, from their health messages."""

from __future__ import annotations

import pytest

from heel.schemas import Health
from heel.services.commands.top import UseOverTime, table
from heel.services.runtime.chain import Part

PRODUCER = "tracker/main@0123abcd"


def health(uptime_s: float, cpu_s: float, dropped: int = 0, producer: str = PRODUCER) -> Health:
    return Health(
        service="tracker", instance="main", producer=producer, state="ok", uptime_s=uptime_s,
        loop_age_s=0.0, software_version="1", cpu_s=cpu_s, dropped=dropped, rate_in_hz=25.0,
        rate_out_hz=24.5, busy_ms_p50=3.14, age_ms_p50=41.0, age_ms_p99=80.4, rss_mb=120.0,
    )  # fmt: skip


def test_processor_time_is_per_second_of_the_senders_own_clock() -> None:
    use = UseOverTime()
    assert use.cpu_percent(PRODUCER) is None
    use.hear(health(10.0, 2.0))
    assert use.cpu_percent(PRODUCER) is None
    use.hear(health(10.5, 2.2, dropped=3))
    assert use.cpu_percent(PRODUCER) == pytest.approx(40.0)
    assert use.dropped(PRODUCER) == 3


def test_figures_are_of_the_last_two_seconds() -> None:
    use = UseOverTime()
    use.hear(health(0.0, 50.0, dropped=7))
    for n in range(20):
        use.hear(health(1.0 + n * 0.25, 50.0 + n * 0.05, dropped=7))
    assert use.cpu_percent(PRODUCER) == pytest.approx(20.0)
    assert use.dropped(PRODUCER) == 0


def test_a_clock_that_goes_back_gives_no_figure() -> None:
    use = UseOverTime()
    use.hear(health(5.0, 3.0, dropped=9))
    use.hear(health(1.0, 1.0))
    assert use.cpu_percent(PRODUCER) is None
    assert use.dropped(PRODUCER) == 0


def test_senders_are_bounded() -> None:
    use = UseOverTime()
    for n in range(1000):
        use.hear(health(1.0, 1.0, producer=f"tracker/main@{n:08x}"))
    assert len(use._heard) == 128


def test_a_row_tells_rates_latency_use_and_losses_and_of_one_that_is_gone_nothing_old() -> None:
    use = UseOverTime()
    use.hear(health(10.0, 2.0, dropped=2))
    newest = health(11.0, 2.25, dropped=5)
    use.hear(newest)
    part = Part(newest, 0.0, 0.0)
    head, row, gone = table([(part, "ok"), (part, "gone")], use)
    assert head.split() == ["service", "state", "in/s", "out/s", "busy", "ms", "latency", "ms",
                            "p99", "cpu", "%", "MB", "dropped", "refused"]  # fmt: skip
    assert row.split() == ["tracker/main", "ok", "25.0", "24.5", "3.1", "41", "80", "25", "120",
                           "5", "+3", "0"]  # fmt: skip
    assert gone.split() == ["tracker/main", "gone"]
