"""Numbers of the tracker as printed; where the paper prints none, what its text implies."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class BlobSettings:
    """Lengths in heights are multiples of the person's own height in the picture.

    Attributes:
        acceleration: Kalman, standard deviation of acceleration, heights/s^2.
        growth: Kalman, deviation of relative growth of area and span, 1/s^2.
        position_noise: Kalman, deviation of a measured centre, heights.
        size_noise: Kalman, deviation of measured area and span, share.
        coasting_friction: velocity decays at this rate while the person is missed, 1/s.
        aspect_ratio: occlusion test, eq. 4: s^2 / A above this.
        min_cover: share of a person's box under a blob that hides that person.
        max_group: most people in one blob.
        min_part_height: smaller parts of a split are fragments, share of the mean height.
        reference_memory_s: time constant of a person's reference features.
        identity_sharpness: softmax over relative cost differences of assignments.
        doubt_s: identity confidence falls to 1/e in this time while coasting.
        trust_s: and comes back with this time constant when seen alone.
        confirm_hits: frames seen before a person counts.
        show_missed_s: a person not seen is shown for this long.
        forget_s: and forgotten after this.
    """

    acceleration: float = 1.2
    growth: float = 0.25
    position_noise: float = 0.05
    size_noise: float = 0.15
    coasting_friction: float = 0.35
    aspect_ratio: float = 0.5
    min_cover: float = 0.5
    max_group: int = 8
    min_part_height: float = 0.5
    reference_memory_s: float = 2.0
    identity_sharpness: float = 20.0
    doubt_s: float = 4.0
    trust_s: float = 1.0
    confirm_hits: int = 3
    show_missed_s: float = 0.5
    forget_s: float = 3.0
