"""Settings of the follower: geometry, control law, limits, timeouts."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from services.runtime.settings import ServiceSettings, StrictSettings


class FollowerSettings(StrictSettings):
    """How a person is turned into motion."""

    target: Literal["none", "nearest"] = Field(
        "none", description="what to follow from the start; people choose with `heel follow`"
    )
    rate_hz: float = Field(50.0, ge=5, le=200, description="motion commands per second")
    ttl_s: float = Field(
        0.5, gt=0, le=2, description="the robot stops this long after the last command"
    )
    max_tracks_age_s: float = Field(
        0.25, gt=0, le=5, description="tracks of an older frame mean zero velocity"
    )
    min_identity_confidence: float = Field(
        0.6, ge=0, le=1, description="below this the robot waits"
    )
    lost_after_s: float = Field(
        1.0, ge=0, le=60, description="a target missing for so long is called lost"
    )
    distance_m: float = Field(1.5, gt=0, le=20, description="wished distance to the person")
    person_height_m: float = Field(
        1.7, gt=0.5, le=2.5, description="assumed height, for the apparent distance"
    )
    horizontal_fov_deg: float = Field(
        60.0, gt=5, lt=175, description="field of view, where the camera does not state its own"
    )
    linear_gain_per_s: float = Field(0.8, ge=0, le=10, description="speed per metre too far")
    angular_gain_per_s: float = Field(1.5, ge=0, le=10, description="turn rate per radian off axis")
    distance_deadband_m: float = Field(0.1, ge=0, le=2, description="error that is left alone")
    bearing_deadband_rad: float = Field(0.03, ge=0, le=1, description="error that is left alone")
    max_linear_mps: float = Field(0.8, ge=0, le=5, description="speed limit, forward")
    max_reverse_mps: float = Field(0.0, ge=0, le=5, description="speed limit, backward; 0 forbids")
    max_angular_radps: float = Field(1.2, ge=0, le=10, description="turn rate limit")
    max_linear_mps2: float = Field(
        0.8, gt=0, le=20, description="acceleration limit; stops ignore it"
    )
    max_angular_radps2: float = Field(
        3.0, gt=0, le=50, description="angular acceleration limit; stops ignore it"
    )


class FollowerServiceSettings(ServiceSettings, FollowerSettings):
    """Settings of the follower process."""
