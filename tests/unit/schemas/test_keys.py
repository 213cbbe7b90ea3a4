"""Keys are built of checked names only: nobody's camera name becomes a wildcard."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from heel.schemas import KeyNameError, keys

_BAD = {
    "empty": "", "one wildcard": "*", "two wildcards": "**", "wildcard within": "front*",
    "dollar": "a$*", "question mark": "a?x=1", "hash": "a#b", "verbatim": "@front",
    "slash": "front/left", "leading slash": "/front", "upper case": "Front", "space": "front left",
    "dot": "front.left", "newline at the end": "front\n", "newline": "a\nb", "NUL": "a\0",
    "umlaut": "f\u00fcr", "full-width letter": "\uff41", "Arabic digit": "\u0661",
    "Kelvin sign": "\u212a", "surrogate": "\ud800", "too long": "a" * 65, "very long": "a" * 10**6,
}  # fmt: skip
_ONE_NAME: list[Callable[[str], str]] = [
    keys.image,
    keys.taken,
    keys.info,
    keys.blobs,
    keys.tracks,
    keys.events,
]
_TWO_NAMES: list[Callable[[str, str], str]] = [
    keys.progress, keys.health, keys.config, keys.alive,
]  # fmt: skip


@pytest.mark.parametrize("bad", _BAD.values(), ids=_BAD.keys())
def test_bad_names_are_refused_by_every_builder(bad: str) -> None:
    attempts = [lambda build=build: build(bad) for build in _ONE_NAME]
    attempts += [lambda build=build: build(bad, "main") for build in _TWO_NAMES]
    attempts += [lambda build=build: build("main", bad) for build in _TWO_NAMES]
    for attempt in attempts:
        with pytest.raises(KeyNameError, match="use 1 to 64 characters of a-z 0-9 _ -") as error:
            attempt()
        assert len(str(error.value)) < 200
        assert str(error.value).isprintable()


@pytest.mark.parametrize("good", ["a", "0", "front", "front-left_2", "-", "_", "a" * 64])
def test_good_names_stand_unchanged(good: str) -> None:
    assert keys.image(good) == f"cam/{good}/image"
    assert keys.health("tracker", good) == f"svc/tracker/{good}/health"


@pytest.mark.parametrize(
    ("key", "expected"),
    [
        (keys.image("front"), "cam/front/image"),
        (keys.taken("front"), "cam/front/taken"),
        (keys.info("front"), "cam/front/info"),
        (keys.blobs("front"), "cam/front/blobs"),
        (keys.tracks("front"), "cam/front/tracks"),
        (keys.events("front"), "cam/front/events"),
        (keys.progress("front", "run"), "cam/front/progress/run"),
        (keys.health("tracker", "main"), "svc/tracker/main/health"),
        (keys.config("tracker", "main"), "svc/tracker/main/config"),
        (keys.alive("tracker", "main"), "alive/tracker/main"),
        (keys.FOLLOW_COMMAND, "follow/command"),
        (keys.FOLLOW_STATE, "follow/state"),
        (keys.FOLLOW_TARGET, "follow/target"),
        (keys.FOLLOW_ESTOP, "follow/estop"),
    ],
)
def test_keys_are_those_of_the_wire_contract(key: str, expected: str) -> None:
    assert key == expected
