"""Settings of the follower: which person, how near, how fast, and when not."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from heel.schemas.base import Name
from heel.services.runtime.settings import (
    ServiceSettings,
    StandbySettings,
    StrictSettings,
    split_list,
)


class FollowerSettings(StrictSettings):
    """How a person is turned into motion."""

    target: Literal["none", "nearest", "imprint"] = Field(
        "none",
        description="what to follow from the start; people choose with `heel follow`. nearest "
        "turns round once to find somebody, imprint stands",
    )
    rate_hz: float = Field(
        50.0,
        ge=5,
        le=200,
        description="motion commands per second: more react sooner to a stop and cost more CPU",
    )
    ttl_s: float = Field(
        0.5,
        gt=0,
        le=2,
        description="the robot stops this long after the last command, s: less stops sooner "
        "when a process hangs, and stutters where the network does",
    )
    max_tracks_age_s: float = Field(
        0.22,
        gt=0,
        le=5,
        description="tracks of an older frame mean zero velocity, s: less is safer, and stops "
        "before slow detectors",
    )
    max_ranges_age_s: float = Field(
        0.25,
        gt=0,
        le=5,
        description="ranges that were there once and are older mean zero velocity, s: more "
        "than two periods of the sensor",
    )

    min_identity_confidence: float = Field(
        0.6,
        ge=0,
        le=1,
        description="below this the robot waits: higher waits more often and follows the "
        "wrong person less",
    )
    resume_identity_confidence: float = Field(
        0.7,
        ge=0,
        le=1,
        description="from this on it follows (again): higher makes it surer and later",
    )
    min_identity_lead: float = Field(
        0.1,
        ge=0,
        le=1,
        description="confidence over the best other person; below it waits: higher waits more "
        "often among people who look alike",
    )
    resume_identity_lead: float = Field(
        0.2,
        ge=0,
        le=1,
        description="confidence over the best other person to follow (again): higher makes it "
        "surer and later",
    )
    confirm_s: float = Field(
        0.2,
        ge=0,
        le=10,
        description="how long a person has to be clearly in sight before moving, s: more "
        "starts later",
    )
    coast_s: float = Field(
        0.5,
        ge=0,
        le=2,
        description="out of sight for less, s: follow on to where the person should be by "
        "now; detectors miss people for so long now and then. More drives farther "
        "unseen",
    )
    hold_s: float = Field(
        1.0,
        ge=0,
        le=10,
        description="out of sight for less, s: brake, and turn after the person; more "
        "searches later",
    )
    ask_after_s: float = Field(
        0.0,
        ge=0,
        le=600,
        description="back in sight after as long, s: stand until a user chooses again. Where many "
        "wear the same nothing else tells who went behind a wall from who comes out; 0: never",
    )
    trail_s: float = Field(
        0.0,
        ge=0,
        le=20,
        description="hidden behind a thing for less, s: drive on along the way the person took, "
        "where ranges show it free. More follows through doors, and stands in the way of who comes "
        "back; 0: never",
    )
    search_s: float = Field(
        10.0,
        ge=0,
        le=120,
        description="longest search by turning on the spot, s; 0: none",
    )
    search_radps: float = Field(
        0.8,
        ge=0,
        le=5,
        description="turn rate of searching and of turning after the hidden, rad/s: faster "
        "blurs the picture",
    )
    imprint_s: float = Field(
        2.0,
        gt=0,
        le=60,
        description="imprint: how long one person has to stand before the robot, s",
    )

    distance_m: float = Field(
        1.6,
        gt=0,
        le=20,
        description="wished distance to the person, m: more keeps farther back",
    )
    personal_space_m: float = Field(
        1.0,
        ge=0,
        le=5,
        description="never driven nearer to anybody who is in sight, m: more stops farther "
        "from people",
    )
    person_height_m: float = Field(
        1.7,
        gt=0.5,
        le=2.5,
        description="assumed height of people, m, for the distance that a box tells: too much "
        "keeps farther from the short",
    )
    horizontal_fov_deg: float = Field(
        60.0,
        gt=5,
        lt=175,
        description="field of view where the camera does not state its own, degrees: too much "
        "keeps too near and turns too far",
    )
    linear_gain_per_s: float = Field(
        1.0,
        ge=0,
        le=10,
        description="speed per metre too far, 1/s: more catches up faster and overshoots sooner",
    )
    angular_gain_per_s: float = Field(
        2.0,
        ge=0,
        le=10,
        description="turn rate per radian off axis, 1/s: more turns faster and swings sooner",
    )

    max_linear_mps: float = Field(
        1.8,
        ge=0,
        le=5,
        description="speed limit, forward, m/s: less falls behind fast walkers",
    )
    max_reverse_mps: float = Field(
        0.0,
        ge=0,
        le=5,
        description="speed limit, backward, m/s; 0 forbids it: the robot then waits where "
        "people come near",
    )
    max_angular_radps: float = Field(
        1.5,
        ge=0,
        le=10,
        description="turn rate limit, rad/s",
    )
    manual_linear_mps: float = Field(
        0.5,
        ge=0,
        le=5,
        description="greatest speed of driving by hand, m/s; 0 forbids it. Never above the limits "
        "of following",
    )
    manual_angular_radps: float = Field(
        0.8,
        ge=0,
        le=10,
        description="greatest turn rate of driving by hand, rad/s: more turns less gently",
    )
    max_linear_mps2: float = Field(
        1.5,
        gt=0,
        le=20,
        description="limit for speeding up, m/s^2: less starts gently and falls behind",
    )
    max_braking_mps2: float = Field(
        2.5,
        gt=0,
        le=20,
        description="limit for slowing down, m/s^2: less slows gently and begins earlier; "
        "stops ignore it",
    )
    max_linear_mps3: float = Field(
        10.0,
        gt=0,
        le=1000,
        description="jerk limit, m/s^3: less is smoother and later; stops ignore it",
    )
    max_angular_radps2: float = Field(
        4.0,
        gt=0,
        le=50,
        description="angular acceleration limit, rad/s^2: less is smoother and later; stops "
        "ignore it",
    )
    max_angular_radps3: float = Field(
        40.0,
        gt=0,
        le=1000,
        description="angular jerk limit, rad/s^3: less is smoother and later; stops ignore it",
    )
    robot_delay_s: float = Field(
        0.1,
        ge=0,
        le=1,
        description="from a command to the robot's doing it, s: too little swings, too much "
        "turns hesitantly",
    )
    robot_radius_m: float = Field(
        0.25,
        ge=0,
        le=3,
        description="of the robot as a disc, m: more keeps farther from obstacles and out of "
        "narrow passages",
    )
    obstacle_margin_m: float = Field(
        0.15,
        ge=0,
        le=2,
        description="kept free around the robot where ranges tell, m: likewise",
    )

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if self.resume_identity_confidence < self.min_identity_confidence:
            raise ValueError(
                "resume_identity_confidence is below min_identity_confidence: raise it"
            )
        if self.resume_identity_lead < self.min_identity_lead:
            raise ValueError("resume_identity_lead is below min_identity_lead: raise it")
        if self.distance_m < self.personal_space_m:
            raise ValueError("distance_m is below personal_space_m: raise it or lower the other")
        return self


class FollowerServiceSettings(ServiceSettings, StandbySettings, FollowerSettings):
    """Settings of the follower process."""

    cameras: Annotated[tuple[Name, ...], BeforeValidator(split_list)] = Field(
        (),
        max_length=3,
        description="further cameras of the robot, comma separated, each with a tracker of its "
        "own: the one that sees the target better is followed by",
    )

    @model_validator(mode="after")
    def _has_cameras_that_differ(self) -> Self:
        names = (self.camera, *self.cameras)
        if len(set(names)) < len(names):
            raise ValueError(f"camera and cameras name one twice: {', '.join(names)}")
        if self.cameras and self.delivery == "lossless":
            raise ValueError("several cameras are live only: leave out cameras or lossless")
        return self
