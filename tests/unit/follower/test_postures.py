"""Who bends, sits, crouches, is small or half hidden is not driven at, whatever is known."""

from __future__ import annotations

import math

import pytest

from tests.unit.follower.posed_world import (
    Body,
    Eye,
    Moment,
    PosedWorld,
    Span,
    change,
    still,
    upright,
)

KNOWN_M, UNKNOWN_M = 1.0, 0.6
"""Between centres: with calibration or ranges, and with neither."""
POSTURES = {
    "bends": change(0.0, 1.0),
    "leans": change(0.0, 1.4),
    "ties their shoes": change(0.0, 0.9, until_s=9.0),
    "crouches slowly": change(0.0, 0.9, within_s=3.0),
    "drops into a crouch": change(0.0, 0.9, within_s=0.3),
    "crouches while the robot comes": change(0.0, 0.9, from_s=1.6),
    "sits on a chair": change(0.0, 1.25),
    "sits on a chair while the robot comes": change(0.0, 1.25, from_s=1.9, within_s=0.6),
    "sits on the ground": change(0.0, 0.8),
    "lies": change(0.0, 0.35),
    "sits down behind a table": change(0.75, 1.25),
    "stands behind a table": change(0.75, 1.7),
    "sits behind a table from the start": lambda _t_s: (0.75, 1.25),
    "stands on a step": lambda _t_s: (0.17, 1.87),
}
SMALL = {1.3: 0.36, 1.1: 0.31, 0.9: 0.25}


def followed(
    span: Span, eye: Eye, ranges: bool = False, width_m: float = 0.5, seconds: float = 13.0
) -> list[Moment]:
    """Somebody 3 m ahead; postures change after 6 s."""
    world = PosedWorld({1: Body(still(3.0), span, lambda _t_s: width_m)}, eye, ranges)
    return world.run(seconds)


def nearest_m(moments: list[Moment]) -> float:
    """Nearest that the robot drove to anybody in sight."""
    return min(moment.driven_to_m for moment in moments)


@pytest.mark.parametrize("known", ["nothing", "calibration", "ranges", "both"])
@pytest.mark.parametrize("posture", POSTURES)
def test_nobody_who_changes_posture_is_driven_at(posture: str, known: str) -> None:
    eye = Eye(calibrated=known in ("calibration", "both"))
    moments = followed(POSTURES[posture], eye, ranges=known in ("ranges", "both"))
    least_m = UNKNOWN_M if known == "nothing" else KNOWN_M
    assert nearest_m(moments) >= least_m - 0.01


@pytest.mark.parametrize("known", ["nothing", "calibration", "ranges"])
@pytest.mark.parametrize("tall_m", SMALL)
def test_children_are_kept_from(tall_m: float, known: str) -> None:
    eye = Eye(calibrated=known == "calibration")
    moments = followed(lambda _t_s: (0.0, tall_m), eye, known == "ranges", SMALL[tall_m])
    assert nearest_m(moments) >= (UNKNOWN_M if known == "nothing" else KNOWN_M) - 0.01


@pytest.mark.parametrize("calibrated", [True, False])
def test_somebody_in_a_wheelchair_is_followed_at_a_distance(calibrated: bool) -> None:
    moments = followed(lambda _t_s: (0.0, 1.3), Eye(calibrated=calibrated), width_m=0.68)
    assert nearest_m(moments) >= KNOWN_M
    assert moments[-1].distance_m < 2.0


@pytest.mark.parametrize("calibrated", [True, False])
def test_somebody_upright_is_still_followed(calibrated: bool) -> None:
    def walks(t_s: float) -> tuple[float, float]:
        return 3.0 + 1.0 * max(0.0, min(t_s, 14.0) - 3.0), 0.0

    moments = PosedWorld({1: Body(walks)}, Eye(calibrated=calibrated)).run(20.0)
    assert max(moment.distance_m for moment in moments) < 3.6
    assert math.isclose(moments[-1].distance_m, 1.6, abs_tol=0.4)


@pytest.mark.parametrize("calibrated", [True, False])
def test_a_second_person_who_crouches_in_the_way_is_not_driven_at(calibrated: bool) -> None:
    people = {
        1: Body(still(7.0, 0.4), upright),
        2: Body(still(3.6, 0.1), change(0.0, 0.9, from_s=1.0)),
    }
    moments = PosedWorld(people, Eye(calibrated=calibrated)).run(10.0)
    # Passed at the picture's edge, where half of them is out of sight.
    assert nearest_m(moments) >= (0.9 if calibrated else UNKNOWN_M)
