"""Settings of the box tracker: every number it uses, with unit, range and origin."""

from __future__ import annotations

from pydantic import Field

from heel.services.runtime.settings import StrictSettings


class MotionSettings(StrictSettings):
    """How people move and how detectors' boxes scatter. Lengths in person heights."""

    noise_x: float = Field(0.035, gt=0, le=1, description="Scatter of a box's centre x [heights]")
    noise_y: float = Field(0.043, gt=0, le=1, description="Scatter of a box's centre y [heights]")
    noise_height: float = Field(0.085, gt=0, le=1, description="Scatter of ln(box height)")
    noise_aspect: float = Field(0.13, gt=0, le=1, description="Scatter of ln(box aspect ratio)")
    acceleration_x: float = Field(
        0.8, gt=0, le=20, description="White sideways acceleration [heights / s^1.5]"
    )
    acceleration_y: float = Field(
        0.25, gt=0, le=20, description="White vertical acceleration [heights / s^1.5]"
    )
    acceleration_growth: float = Field(
        0.5, gt=0, le=20, description="White acceleration of ln(height) [1 / s^1.5]"
    )
    initial_speed_x: float = Field(
        1.1, gt=0, le=20, description="Spread of a newcomer's sideways speed [heights/s]"
    )
    initial_speed_y: float = Field(
        0.25, gt=0, le=20, description="Spread of a newcomer's vertical speed [heights/s]"
    )
    initial_growth: float = Field(
        0.2, gt=0, le=20, description="Spread of a newcomer's growth rate of ln(height) [1/s]"
    )
    speed_memory_s: float = Field(
        2.5, gt=0, le=60, description="Time in which speed decays to 1/e without evidence [s]"
    )
    growth_memory_s: float = Field(
        0.3, gt=0, le=60, description="Time in which growth decays to 1/e without evidence [s]"
    )
    aspect_mean: float = Field(
        0.39, gt=0.1, le=1, description="Aspect ratio (width / height) of a standing person"
    )
    aspect_spread: float = Field(
        0.22, gt=0, le=1, description="Spread of ln(aspect ratio) of people"
    )
    aspect_memory_s: float = Field(
        1.2, gt=0, le=60, description="Time in which a person's aspect ratio changes [s]"
    )


class AssociationSettings(StrictSettings):
    """How a box is weighed against a track, a newcomer and a false alarm."""

    tail: float = Field(
        7.0, gt=2, le=1000, description="Degrees of freedom of the Student t likelihood"
    )
    gate: float = Field(
        5.5, gt=0, le=20, description="Largest normalised distance of a box to a track [sigmas]"
    )
    newcomer_density: float = Field(
        0.6, gt=0, le=10, description="Expected unexplained boxes per square height of image"
    )
    height_spread: float = Field(
        0.5, gt=0, le=3, description="Spread of ln(height) among people of one scene"
    )
    hiding: float = Field(
        0.55, ge=0, lt=1, description="Loss of detection rate of a person fully covered by another"
    )
    hidden: float = Field(
        0.5, ge=0, le=1, description="Covered share from which a missing person counts as hidden"
    )
    detection_rate: float = Field(
        0.75, gt=0, lt=1, description="Chance that a visible person gets a box"
    )


class MemorySettings(StrictSettings):
    """How people who were lost are recognised when they come back."""

    return_rate: float = Field(
        0.5, gt=0, lt=1, description="Chance that a person just lost comes back"
    )
    return_time_s: float = Field(
        20.0, gt=0, le=600, description="Time in which the chance of a return falls to 1/e [s]"
    )
    newcomer_density: float = Field(
        0.05, gt=0, le=10, description="Expected newcomers per square height of image"
    )
    settle_speed: float = Field(
        0.15, gt=0, le=10, description="Speed at which standing still is one sigma away [heights/s]"
    )
    settle_spread: float = Field(
        0.2, gt=0, le=10, description="Wandering of a person who stays, sigma [heights]"
    )
    elsewhere: float = Field(
        0.3, gt=0, lt=1, description="Share of returns, told by looks, that are at any place"
    )
    trust: float = Field(
        0.65, ge=0, le=1, description="Least probability of a return that gives the old id back"
    )
    later_trust: float = Field(
        0.95, ge=0, le=1, description="The same for somebody who has been given an id already"
    )


class CameraSettings(StrictSettings):
    """When the camera is taken to move: people are not looked for where they were lost."""

    most_correlation: float = Field(
        0.07, ge=0, le=1, description="Correlation of people's surprises up to which it stands"
    )
    prior_boxes: float = Field(
        200.0, ge=0, le=1e6, description="Weight of the prior that it stands [boxes]"
    )
    memory_frames: float = Field(500.0, ge=1, le=1e6, description="Memory of surprises [frames]")


class GroupSettings(StrictSettings):
    """When one box is taken for two people."""

    overlap: float = Field(
        0.2, ge=0, le=1, description="Predicted overlap (of the smaller) from which two may merge"
    )
    rate: float = Field(
        0.05, gt=0, le=1, description="Chance that two who fully overlap get one box"
    )
    noise: float = Field(
        1.5, gt=0, le=10, description="Scatter of merged boxes [single boxes' scatter]"
    )
    growth: float = Field(
        0.2, ge=0, le=1, description="Least excess of the merged box's area over either member's"
    )
    longest_s: float = Field(
        1.0, ge=0, le=60, description="Longest time without a box of one's own [s]"
    )
    slack: float = Field(
        0.05, ge=0, le=1, description="Edges closer than this are shared [heights]"
    )
    edge_noise: float = Field(
        2.0, gt=0, le=10, description="Scatter of a centre told by one edge [single boxes' scatter]"
    )


class AppearanceSettings(StrictSettings):
    """How much the look of a box counts, where pictures are given."""

    weight: float = Field(0.7, ge=0, le=10, description="Share of the log odds that is believed")
    most: float = Field(6.0, ge=0, le=100, description="Most log odds a look can give")
    most_against: float = Field(12.0, ge=0, le=100, description="Most log odds a look can take")
    most_against_present: float = Field(
        12.0,
        ge=0,
        le=100,
        description="The same from somebody seen a moment ago whom nobody covers: light changes "
        "at once, people do not",
    )
    reassure: float = Field(
        0.0,
        ge=0,
        le=10,
        description="How much looks settle a doubt [share of their log odds per second]; 0: not",
    )
    present_s: float = Field(0.25, ge=0, le=10, description="How long a moment is [s]")
    least_spread: float = Field(0.05, gt=0, le=1, description="Least spread of distances of looks")
    crowd: float = Field(
        0.5, ge=0, le=1, description="Share of its weight a look loses if wholly overlapped"
    )
    memory: float = Field(0.03, gt=0, le=1, description="Share of a new look in a person's gallery")
    most_views: int = Field(5, ge=1, le=50, description="Most views in a person's gallery")
    new_view: float = Field(
        0.4, gt=0, le=1, description="Distance to all views of a look that becomes a view"
    )
    recent_s: float = Field(
        2.0, ge=0, le=60, description="As life.recent_s, where looks guard against a wrong box [s]"
    )
    decide: float = Field(
        3.0, gt=0, le=20, description="Log odds that decide who is who after two people met"
    )
    alike: float = Field(
        0.05,
        ge=0,
        le=10,
        description="Odds that somebody who is back is another missing person of the same look",
    )
    alike_at_edge: float = Field(
        0.4, ge=0, le=10, description="The same at the edge of the picture, where people come in"
    )
    settle_s: float = Field(
        2.0, ge=0, le=60, description="Time in clear view after which who is who stays open [s]"
    )
    contact: float = Field(
        0.02, gt=0, le=1, description="Probability of being the other from which two are in contact"
    )
    memory_s: float = Field(
        120.0, ge=0, le=3600, description="As life.memory_s, where looks tell who is back [s]"
    )
    clear: float = Field(
        0.25, ge=0, le=1, description="Overlap with other boxes up to which a look is learned"
    )


class LifeSettings(StrictSettings):
    """When a track is born, shown, lost and forgotten, and when its identity is given up."""

    birth_score: float = Field(
        0.6, ge=0, le=1, description="Least score of a box that starts a track"
    )
    keep_score: float = Field(
        0.3, ge=0, le=1, description="Least score of a box that is used at all"
    )
    duplicate_iou: float = Field(
        0.5, ge=0, le=1, description="Overlap with a matched track above which no track is born"
    )
    confirm_hits: int = Field(3, ge=1, le=100, description="Boxes before a track is shown")
    confirm_existence: float = Field(
        0.95, ge=0, le=1, description="Probability of being a person before a track is shown"
    )
    shown_score: float = Field(
        0.92, ge=0, le=1, description="Mean score below which a track is not shown"
    )
    hidden_score: float = Field(
        0.85, ge=0, le=1, description="Mean score below which a shown track is hidden again"
    )
    walker_score: float = Field(
        0.6, ge=0, le=1, description="The same for a track that has walked, camera standing"
    )
    walk: float = Field(
        0.7, ge=0, le=100, description="Distance from its birthplace that makes a walker [heights]"
    )
    least_height: float = Field(
        0.0,
        ge=0,
        le=1,
        description="Height below which a newcomer is too far away to be shown while somebody "
        "nearer is in sight [picture heights]",
    )
    score_memory_s: float = Field(1.0, gt=0, le=60, description="Memory of the mean score [s]")
    coast_s: float = Field(
        0.0, ge=0, le=60, description="Time without a box during which a track is still shown [s]"
    )
    tentative_s: float = Field(
        0.3, ge=0, le=60, description="Time without a box after which a newcomer is dropped [s]"
    )
    recent_s: float = Field(
        0.7, ge=0, le=60, description="Time without a box during which a track takes boxes [s]"
    )
    memory_s: float = Field(
        16.0, ge=0, le=3600, description="Time without a box after which a person is forgotten [s]"
    )
    exit_s: float = Field(
        0.5, ge=0, le=60, description="The same for a person at the edge of the picture [s]"
    )
    edge: float = Field(
        0.6,
        ge=-1,
        le=2,
        description="Distance from the picture's edge that counts as at it [widths]",
    )
    doubt_s: float = Field(
        10.0, gt=0, le=1000, description="Time out of sight that makes an identity 1/e as sure [s]"
    )
    give_up: float = Field(
        0.03, ge=0, le=1, description="Identity confidence below which a track gets a fresh id"
    )
    rivals: float = Field(
        0.1,
        ge=0,
        le=1,
        description="Probability that the box of somebody who was out of sight is another's, above "
        "which it gets a fresh id; where looks are known they decide instead",
    )
    away_s: float = Field(0.2, ge=0, le=60, description="Time without a box for that to apply [s]")
    memory_size: int = Field(64, ge=1, le=10000, description="Most people remembered at a time")


class BoxTrackerSettings(StrictSettings):
    """All settings of `BoxTracker`."""

    motion: MotionSettings = MotionSettings()
    association: AssociationSettings = AssociationSettings()
    memory: MemorySettings = MemorySettings()
    camera: CameraSettings = CameraSettings()
    group: GroupSettings = GroupSettings()
    appearance: AppearanceSettings = AppearanceSettings()
    life: LifeSettings = LifeSettings()
