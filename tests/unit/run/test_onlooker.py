"""The onlooker puts messages together as they come, and clicks until the right person is chosen."""

from __future__ import annotations

from heel.schemas import (
    FollowState,
    Pose,
    SimPerson,
    SimTruth,
    Target,
    TargetRequest,
    Track,
    Tracks,
)
from heel.services.run.onlooker import Onlooker

HERE = Pose(x_m=0.0, y_m=0.0, heading_rad=0.0)
TARGET_BOX, OTHER_BOX = (100.0, 100.0, 200.0, 350.0), (400.0, 100.0, 500.0, 350.0)
ON_TARGET, ON_OTHER = 7, 8


def truth(seq: int) -> SimTruth:
    people = tuple(
        SimPerson(
            id=number, role=role, pose=HERE, speed_mps=0.0, height_m=1.7, radius_m=0.2,
            box_xyxy=box, visible=1.0,
        )
        for number, role, box in ((1, "other", OTHER_BOX), (2, "target", TARGET_BOX))
    )  # fmt: skip
    return SimTruth(
        seq=seq, t_s=seq / 10, robot=HERE, robot_radius_m=0.2, linear_mps=0.0,
        angular_radps=0.0, people=people,
    )  # fmt: skip


def tracks(seq: int) -> Tracks:
    return Tracks(
        stream="front", epoch=1, seq=seq, index=seq, t_capture_ns=0, width=640, height=480,
        source_width=640, source_height=480,
        tracks=tuple(
            Track(
                id=number, state="tracked", box_xyxy=box, velocity_pxps=(0.0, 0.0), area_px=1.0,
                span_px=1.0, identity_confidence=1.0, shown=True,
            )
            for number, box in ((ON_TARGET, TARGET_BOX), (ON_OTHER, OTHER_BOX))
        ),
    )  # fmt: skip


class World:
    """Ten frames a second around an onlooker; each click has the next of the effects given."""

    def __init__(self, *effects: Target) -> None:
        self._effects = list(effects)
        self.clicks: list[tuple[float, TargetRequest]] = []
        self.records: list[dict[int, int]] = []
        self.episodes = 0
        self._t_s = 0.0
        self.onlooker = Onlooker(self, self._click)
        self.onlooker.episode()
        self._tell(target("none"))

    def episode(self) -> None:
        self.episodes += 1

    def record(self, truth: SimTruth, state: FollowState | None, people: dict[int, int]) -> None:
        self.records.append(people)

    def _click(self, request: TargetRequest) -> None:
        self.clicks.append((self._t_s, request))
        if self._effects:
            self._tell(self._effects.pop(0))

    def _tell(self, chosen: Target) -> None:
        self.onlooker.state(
            FollowState(
                seq=0, state="idle", reason="", estop=False, linear_mps=0.0, angular_radps=0.0,
                target=chosen,
            )
        )  # fmt: skip

    def play(self, seconds: float) -> None:
        for seq in range(round(seconds * 10)):
            self._t_s = seq / 10
            self.onlooker.truth(truth(seq))
            self.onlooker.tracks(tracks(seq))


def target(mode: str, track_id: int | None = None) -> Target:
    return Target.model_validate({"seq": 1, "mode": mode, "track_id": track_id})


def test_one_click_is_a_choice() -> None:
    world = World(target("point", ON_TARGET))
    world.play(5.0)
    ((at_s, click),) = world.clicks
    assert at_s == 1.0
    assert (click.mode, click.x_px, click.y_px) == ("point", 150.0, 200.0)


def test_a_point_that_is_still_looked_at_wants_patience() -> None:
    world = World(target("point"))
    world.play(5.0)
    assert len(world.clicks) == 1


def test_a_click_without_effect_and_a_choice_of_somebody_else_are_clicked_on_again() -> None:
    world = World(target("none"), target("point", ON_OTHER), target("point", ON_TARGET))
    world.play(5.0)
    assert [at_s for at_s, _ in world.clicks] == [1.0, 1.5, 2.0]


def test_each_world_is_chosen_in_anew() -> None:
    world = World(target("point", ON_TARGET), target("point", ON_TARGET))
    world.play(3.0)
    world.onlooker.episode()
    world.play(3.0)
    assert len(world.clicks) == 1, "who is chosen already is not clicked on"
    assert world.episodes == 2


def test_every_frame_is_recorded_with_the_newest_tracks_before_it() -> None:
    world = World()
    world.play(1.0)
    people = {ON_TARGET: 1, ON_OTHER: 0}
    assert world.records == [{}] + [people] * 9


def test_tracks_of_frames_that_are_not_known_count_for_nothing() -> None:
    world = World()
    world.onlooker.tracks(tracks(3))
    for seq in range(1000):
        world.onlooker.truth(truth(seq))
    world.onlooker.tracks(tracks(3))
    world.onlooker.truth(truth(1000))
    assert world.records[-1] == {}
    assert not world.clicks
