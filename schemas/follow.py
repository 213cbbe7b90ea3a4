"""Motion commands, the choice of a target, the emergency stop and the follower's state."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from heel.schemas.base import (
    Count,
    Dimension,
    Flag,
    Fraction,
    Message,
    NonNegative,
    PersonId,
    Point,
    Real,
    Text,
    TimeNs,
)
from heel.schemas.frame import FrameId, Producer

FollowStateName = Literal[
    "idle", "acquiring", "following", "occluded", "unsure", "searching", "lost", "stopped"
]
TargetMode = Literal["id", "point", "nearest", "imprint", "none"]
"""`imprint`: the person that stands before the robot for a while."""


class MotionCommand(Message):
    """A velocity, valid for `ttl_s` from its arrival. Never cached, never latched."""

    schema_name: ClassVar[str] = "command"
    max_bytes: ClassVar[int] = 1024

    seq: Count = Field(description="goes up by one with each command")
    linear_mps: Annotated[float, Field(strict=True, ge=-5, le=5)] = Field(
        description="forward is positive"
    )
    angular_radps: Annotated[float, Field(strict=True, ge=-10, le=10)] = Field(
        description="left is positive"
    )
    ttl_s: Annotated[float, Field(strict=True, gt=0, le=5)] = Field(
        description="the receiver stops this long after the last command"
    )
    state: FollowStateName = Field(description="of the follower")
    reason: Annotated[str, Field(strict=True, max_length=96)] = Field(description="why, in words")
    frame: FrameId | None = Field(default=None, description="the newest tracks it rests on")
    manual: Flag = Field(default=False, description="whether a hand drives, not the follower")


class TargetRequest(Message):
    """Payload of a query on `follow/target`; a query without payload only reads."""

    schema_name: ClassVar[str] = "target-request"
    max_bytes: ClassVar[int] = 1024

    mode: TargetMode = Field(description="how the target is chosen; none: nobody is to be followed")
    track_id: PersonId | None = Field(default=None, description="mode id: of whom")
    x_px: Real | None = Field(
        default=None,
        description="mode point: in pixels of the frame; mode id: where the user clicked, if so",
    )
    y_px: Real | None = Field(default=None, description="likewise, down")
    tracker: Producer | None = Field(
        default=None,
        description="who gave out track_id, so that 7 cannot mean another 7 after a restart",
    )

    @model_validator(mode="after")
    def _is_complete(self) -> Self:
        if self.mode == "id" and self.track_id is None:
            raise ValueError("mode 'id' needs track_id")
        if self.mode == "point" and (self.x_px is None or self.y_px is None):
            raise ValueError("mode 'point' needs x_px and y_px")
        return self


class Target(Message):
    """Who is followed or waited for. Reply of `follow/target` and published there on change."""

    schema_name: ClassVar[str] = "target"
    max_bytes: ClassVar[int] = 4096

    seq: Count = Field(description="goes up by one with each change")
    mode: TargetMode = Field(description="how the target was chosen")
    track_id: PersonId | None = Field(default=None, description="of whom; none: nobody yet")
    tracker: Producer | None = Field(default=None, description="that gave out `track_id`")
    reason: Text = Field(default="", description="why it is so, in words")


class Pointed(Message):
    """A choice by a point at which nobody is tracked: the detector may look there."""

    schema_name: ClassVar[str] = "pointed"
    max_bytes: ClassVar[int] = 1024

    frame: FrameId = Field(description="the newest tracks when it was chosen")
    width: Dimension = Field(description="of the frame, pixels")
    height: Dimension
    x_px: Real = Field(description="of the point, pixels of that frame")
    y_px: Real = Field(description="likewise, down")


class EStop(Message):
    """Emergency stop. Engaging latches; only a release of that engagement resumes."""

    schema_name: ClassVar[str] = "estop"
    max_bytes: ClassVar[int] = 512

    engaged: Flag = Field(description="true: stop; false: release")
    source: Annotated[str, Field(strict=True, max_length=96)] = Field(
        description="who pressed it, in words"
    )
    t_ns: TimeNs = Field(default=0, description="when it was pressed; a release is not older")
    id: Annotated[str, Field(strict=True, pattern=r"^[0-9a-f]{0,32}$")] = Field(
        default="",
        description="random per engagement; a release repeats that of the engagement it ends",
    )


class FollowState(Message):
    """What the follower is doing and why. Latched."""

    schema_name: ClassVar[str] = "state"
    max_bytes: ClassVar[int] = 8192

    seq: Count = Field(description="of the newest command")
    state: FollowStateName = Field(description="of the follower")
    reason: Text = Field(description="why, in words")
    estop: Flag = Field(description="whether an emergency stop holds")
    target: Target = Field(description="whom it follows or waits for")
    tracks_age_s: NonNegative | None = Field(default=None, description="none: no tracks yet")
    linear_mps: Real = Field(description="commanded; forward is positive")
    angular_radps: Real = Field(description="commanded; left is positive")
    distance_m: NonNegative | None = Field(default=None, description="of the target, if in sight")
    bearing_rad: Real | None = Field(default=None, description="of the target, left is positive")
    identity_confidence: Fraction | None = Field(default=None, description="of the target")
    runner_up_confidence: Fraction | None = Field(
        default=None, description="that somebody else is the target: the best other known person"
    )
    speed_reason: Annotated[str, Field(strict=True, max_length=96)] = Field(
        default="", description="what bounds the speed; empty: nothing moves, `reason` says why"
    )
    pending_point_px: Point | None = Field(
        default=None,
        description="where somebody is looked for who was pointed at, carried along with the "
        "picture, in the newest frame",
    )
    pending_for_s: NonNegative | None = Field(
        default=None, description="for how much longer somebody is looked for there"
    )
    obstacle_watch: Flag = Field(
        default=False, description="whether fresh ranges cap the speed; if not, nothing does"
    )
    free_distance_m: NonNegative | None = Field(
        default=None, description="in the direction of travel, while ranges are fresh"
    )
    nearest_person_m: NonNegative | None = Field(
        default=None, description="distance of the nearest person in sight, whoever it is"
    )
    driven_by: Annotated[str, Field(strict=True, max_length=96)] = Field(
        default="", description="who drives by hand, in words; empty: the follower drives"
    )
