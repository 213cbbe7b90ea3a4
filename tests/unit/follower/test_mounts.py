"""However the camera is mounted and however its boxes err, nobody is touched."""

from __future__ import annotations

import itertools
import random

import pytest

from tests.unit.follower.posed_world import (
    CONTACT_M,
    Body,
    Eye,
    PosedWorld,
    Span,
    change,
    still,
)

PEOPLE: dict[str, tuple[Span, float]] = {
    "bends": (change(0.0, 1.0), 0.5),
    "crouches while the robot comes": (change(0.0, 0.9, from_s=1.6), 0.5),
    "sits on a chair": (change(0.0, 1.25), 0.5),
    "sits from the start": (lambda _t_s: (0.0, 1.25), 0.5),
    "sits down behind a table": (change(0.75, 1.25), 0.5),
    "sits behind a table from the start": (lambda _t_s: (0.75, 1.25), 0.5),
    "is 1.3 m tall": (lambda _t_s: (0.0, 1.3), 0.36),
    "is 0.9 m tall": (lambda _t_s: (0.0, 0.9), 0.25),
}
TABLE, CHILD = "sits behind a table from the start", "is 0.9 m tall"


def driven_m(person: str, eye: Eye, ahead_m: float = 3.0, seed: int = 0) -> tuple[float, float]:
    """Least distance at all, and least that the robot drove to."""
    span, width_m = PEOPLE[person]
    world = PosedWorld({1: Body(still(ahead_m), span, lambda _t_s: width_m)}, eye)
    moments = world.run(12.0, seed)
    return min(one.distance_m for one in moments), min(one.driven_to_m for one in moments)


@pytest.mark.parametrize(
    ("person", "eye", "ahead_m", "least_m"),
    [
        # A camera as high as a chest: table edge and head are the ends of an adult far away.
        (TABLE, Eye(True, 1.05, -8, 60, 0.05, 0.3), 1.6, 1.0),
        (TABLE, Eye(True, 1.16, 16, 90, 0.05), 2.8, 1.0),
        (TABLE, Eye(True, 0.99, 1), 2.3, 1.0),
        ("sits down behind a table", Eye(True, 1.18, -2, 110), 2.9, 1.0),
        # Never sees feet.
        ("sits from the start", Eye(True, 0.89, -9, 60, 0.03, 0.3), 2.3, 1.0),
        ("is 1.3 m tall", Eye(True, 0.8, -10), 3.0, 1.0),
        # Looks down on a child who sinks out of the picture.
        (CHILD, Eye(False, 1.5, 20), 3.0, 0.6),
        (CHILD, Eye(False, 1.5, 20, 90), 3.0, 0.5),
        (TABLE, Eye(False, 0.8, 0, 60, 0.05), 3.0, 0.6),
    ],
)
def test_people_are_kept_from(person: str, eye: Eye, ahead_m: float, least_m: float) -> None:
    assert driven_m(person, eye, ahead_m)[1] >= least_m - 0.01


@pytest.mark.slow
@pytest.mark.parametrize("calibrated", [True, False])
@pytest.mark.parametrize("person", PEOPLE)
def test_no_mounting_leads_to_contact(person: str, calibrated: bool) -> None:
    mounts = itertools.product((0.3, 0.8, 1.1, 1.5), (-10, 0, 10, 20), (60, 90))
    for height_m, pitch_deg, fov_deg in mounts:
        eye = Eye(calibrated, height_m, pitch_deg, fov_deg)
        assert driven_m(person, eye)[0] > CONTACT_M, eye


@pytest.mark.slow
@pytest.mark.parametrize("person", PEOPLE)
def test_no_noise_leads_to_contact(person: str) -> None:
    chance = random.Random(person)
    for seed in range(40):
        eye = Eye(
            chance.random() < 0.5,
            chance.uniform(0.3, 1.5),
            chance.uniform(-10, 20),
            chance.choice((60, 75, 90, 110)),
            chance.choice((0.02, 0.03, 0.05)),
            chance.choice((0.0, 0.1, 0.3)),
        )
        ahead_m = chance.uniform(1.5, 5.0)
        assert driven_m(person, eye, ahead_m, seed)[0] > CONTACT_M, (eye, ahead_m, seed)
