"""Who is gone, silent or there twice, from health and liveliness tokens."""

from __future__ import annotations

from heel.schemas import Health
from heel.services.runtime.chain import CHAIN, MAX_PARTS, ChainWatch, page_of

BEAT_S = 0.25


def health(
    service: str, instance: str = "main", start: str = "0123abcd", **changes: object
) -> Health:
    values: dict[str, object] = {
        "service": service, "instance": instance, "producer": f"{service}/{instance}@{start}",
        "state": "ok", "uptime_s": 1.0, "loop_age_s": 0.0, "software_version": "1",
        "period_s": BEAT_S,
    }  # fmt: skip
    return Health.model_validate(values | changes)


def beats(watch: ChainWatch, until_s: float, *services: str, from_s: float = 0.0) -> None:
    """Health of these services four times a second, up to a moment."""
    for beat in range(int(from_s / BEAT_S), int(until_s / BEAT_S) + 1):
        for service in services:
            watch.hear(health(service), beat * BEAT_S)


def words(watch: ChainWatch, now_s: float) -> list[str]:
    return [problem.words for problem in watch.problems(now_s)]


def test_all_is_well_while_everybody_speaks() -> None:
    watch = ChainWatch()
    beats(watch, 10.0, *CHAIN)
    assert words(watch, 10.2) == []
    assert watch.missing((), 10.2) == []


def test_a_hung_part_is_named_within_a_second_and_well_again_when_it_is_back() -> None:
    watch = ChainWatch()
    for service in CHAIN:
        watch.token(service, "main", True, 0.0)
    beats(watch, 5.0, *CHAIN)
    others = [service for service in CHAIN if service != "tracker"]
    beats(watch, 8.0, *others, from_s=5.25)
    assert words(watch, 6.0) == ["tracker: silent for 1 s"]
    assert words(watch, 8.0) == ["tracker: silent for 3 s"]
    watch.hear(health("tracker"), 8.1)
    assert words(watch, 8.2) == []


def test_a_part_whose_token_went_is_gone_at_once_and_a_restarted_one_is_no_problem() -> None:
    watch = ChainWatch()
    watch.token("detector", "main", True, 0.0)
    beats(watch, 5.0, *CHAIN)
    watch.token("detector", "main", False, 5.1)
    beats(watch, 5.5, *(one for one in CHAIN if one != "detector"), from_s=5.25)
    assert words(watch, 5.5) == ["detector: gone"]
    watch.token("detector", "main", True, 6.0)
    watch.hear(health("detector", start="11111111"), 6.0)
    assert words(watch, 6.1) == []
    assert len([p for p in watch.parts if p.startswith("detector")]) == 1


def test_a_token_that_comes_right_back_was_a_new_connection() -> None:
    watch = ChainWatch()
    watch.token("drive", "main", True, 0.0)
    beats(watch, 5.0, *CHAIN)
    watch.token("drive", "main", False, 5.05)
    assert words(watch, 5.1) == []
    watch.token("drive", "main", True, 5.2)
    assert words(watch, 5.5) == []


def test_two_drives_are_named_though_they_share_one_name() -> None:
    watch = ChainWatch()
    for beat in range(8):
        watch.hear(health("drive", start="aaaaaaaa"), beat * BEAT_S)
        watch.hear(health("drive", start="bbbbbbbb"), beat * BEAT_S + 0.1)
    [problem] = watch.problems(2.0)
    assert problem.kind == "doubled"
    assert problem.words == "two drives: drive/main@aaaaaaaa, drive/main@bbbbbbbb: stop one"
    for beat in range(8, 16):
        watch.hear(health("drive", start="bbbbbbbb"), beat * BEAT_S + 0.1)
    assert words(watch, 4.0) == []


def test_a_replacement_is_no_double_and_neither_are_two_cameras_nor_two_pages() -> None:
    watch = ChainWatch()
    beats(watch, 2.0, "detector")
    watch.hear(health("detector", start="11111111"), 2.2)
    assert words(watch, 2.3) == []
    watch = ChainWatch()
    for beat in range(8):
        for camera in ("front", "rear"):
            watch.hear(health("capture", camera, details={"camera": camera}), beat * BEAT_S)
            watch.hear(health("web", camera), beat * BEAT_S)
    assert words(watch, 2.0) == []


def test_another_of_the_same_work_takes_over() -> None:
    watch = ChainWatch()
    for beat in range(20):
        if beat < 4:
            watch.hear(health("detector", "near"), beat * BEAT_S)
        if beat > 5:
            watch.hear(health("detector", "far"), beat * BEAT_S)
    assert words(watch, 4.9) == []


def test_a_part_that_said_goodbye_is_missed_too_but_a_page_is_not() -> None:
    watch = ChainWatch()
    beats(watch, 2.0, *CHAIN, "web")
    watch.hear(health("follower", state="ended"), 2.1)
    watch.hear(health("web", state="ended"), 2.1)
    assert words(watch, 2.2) == ["follower: ended"]


def test_one_who_has_a_token_and_never_speaks_hung_before_we_came() -> None:
    watch = ChainWatch()
    watch.token("detector", "main", True, 0.0)
    beats(watch, 1.25, *(one for one in CHAIN if one != "detector"))
    assert words(watch, 0.5) == []
    assert words(watch, 1.3) == ["detector: silent for 1 s or more"]


def test_what_stands_between_two_that_are_there_is_missed() -> None:
    watch = ChainWatch()
    beats(watch, 1.0, "capture", "tracker", "follower")
    assert [p.words for p in watch.missing((), 1.0)] == ["detector: not there"]
    assert [p.words for p in watch.missing(["drive"], 1.0)] == [
        "detector: not there", "drive: gone",
    ]  # fmt: skip


def test_a_simulator_or_somebody_unknown_stands_in_for_parts() -> None:
    watch = ChainWatch()
    beats(watch, 1.0, "tracker", "follower", "drive")
    watch.hear(health("simulator", details={"perception": "simulated-boxes"}), 1.0)
    assert watch.missing((), 1.0) == []
    watch = ChainWatch()
    beats(watch, 1.0, "follower", "drive")
    assert [p.part for p in watch.missing((), 1.0)] == ["capture", "detector", "tracker"]
    watch.hear(health("follower", input_age_s=0.04), 1.0)
    assert watch.missing((), 1.0) == [], "whose tracks these are is somebody else's affair"
    watch.hear(health("capture"), 1.0)
    assert [p.part for p in watch.missing((), 1.0)] == ["detector"]


def test_when_nobody_at_all_is_heard_it_is_the_bus() -> None:
    watch = ChainWatch(own="web/main@00000000")
    beats(watch, 3.0, *CHAIN)
    for beat in range(20):
        watch.hear(health("web", start="00000000"), beat * BEAT_S)
    assert words(watch, 5.0) == ["nothing is heard from any service for 2 s"]
    beats(watch, 5.0, *CHAIN, from_s=5.0)
    assert words(watch, 5.1) == []


def test_those_who_speak_are_not_pushed_out_by_any_number_of_newcomers() -> None:
    watch = ChainWatch()
    beats(watch, 1.0, *CHAIN)
    for number in range(2000):
        watch.hear(health(f"x{number}"), 1.0)
        watch.hear(health("drive", f"x{number}"), 1.0)
    watch.token("x1", "main", True, 1.0)
    assert len(watch.parts) <= MAX_PARTS
    assert {f"{service}/main@0123abcd" for service in CHAIN} <= set(watch.parts)
    rows = [part.health.service for part, _ in watch.rows(1.1)]
    assert rows[:3] == ["capture", "detector", "tracker"]
    assert rows[-1].startswith("x")
    # Once they have gone there is a place for others.
    watch.hear(health("recorder2"), 10.0)
    assert any(producer.startswith("recorder2/") for producer in watch.parts)


def test_a_sender_without_a_period_of_its_own_is_given_three_seconds() -> None:
    watch = ChainWatch()
    for second in range(5):
        watch.hear(health("tracker", period_s=1.0), float(second))
    assert words(watch, 6.5) == []
    assert words(watch, 7.5) == ["tracker: silent for 4 s"]


def test_only_a_web_service_says_where_a_page_is_and_only_such_an_address() -> None:
    ours = health("web", details={"url": "http://127.0.0.1:8470/"})
    assert page_of(ours) == "http://127.0.0.1:8470/"
    assert page_of(health("web", details={"url": "http://[::1]:8470/"})) == "http://[::1]:8470/"
    for url in ("file:///etc/passwd", "javascript:alert(1)", "http://evil/x", "\x1b[2J", ""):
        assert page_of(health("web", details={"url": url})) is None
    assert page_of(health("drive", details={"url": "http://127.0.0.1:8470/"})) is None
