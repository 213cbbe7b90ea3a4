"""How it is to walk beside the robot: distances kept and jolts made."""

from __future__ import annotations

import numpy as np

from heel.evaluation.following.log import EpisodeLog

PERSONAL_SPACE_M = 1.0
"""Nearer is within the personal distance of Hall's proxemics (0.45 to 1.2 m); the follower's own
`personal_space_m` by default."""
_CLOSING_MPS = 0.05
"""A robot that comes nearer more slowly than this stands, as far as a walker can tell; chosen by
hand."""
SEEN_SHARE = 0.1
"""Share of a person's box that has to be seen, for the person to be in sight."""


def personal_space_compliance(log: EpisodeLog) -> float:
    """Share of time in which the robot's centre is at least 1.0 m from everybody's, 0 to 1.

    PSC as Social-HM3D defines it (Gong et al., "From Cognition to Precognition", 2024). People who
    walk up to the robot count against it, also while it stands.
    """
    return float((log.distances_m().min(axis=1) >= PERSONAL_SPACE_M).mean())


def minimum_distance_m(log: EpisodeLog) -> float:
    """Least distance between the bodies of the robot and any person, m; 0 is contact.

    Follow-Bench 2.0's minimum human surface distance.
    """
    gaps = log.distances_m() - log.people_radius_m - log.robot_radius_m
    return max(0.0, float(gaps.min()))


def driven_to_m(log: EpisodeLog) -> float:
    """How near the robot drove to any person it could see, from centre to centre, m.

    Only moments count at which its own motion brings it nearer to them: a person that walks up to a
    standing robot is not driven at. If it never drove at a person, the least distance there was.
    """
    offsets = log.people_xy_m - log.robot_xy_m[:, None, :]
    distances = log.distances_m()
    heading = np.stack([np.cos(log.robot_heading_rad), np.sin(log.robot_heading_rad)], axis=-1)
    ahead = (offsets * heading[:, None, :]).sum(axis=2) / np.maximum(distances, 1e-9)
    closing = log.linear_mps[:, None] * ahead
    driven = (closing > _CLOSING_MPS) & (log.people_visible > SEEN_SHARE)
    return float(distances[driven].min() if driven.any() else distances.min())


def jerk_p95_mps3(log: EpisodeLog) -> float:
    """95th percentile of |d2v/dt2| of the robot's real forward speed v, m/s^3.

    Follow-Bench 2.0 averages jerk; the percentile says what the worst moments are like. Second
    differences of the log as recorded; 0 for fewer than three moments.
    """
    jerks = np.abs(np.diff(log.linear_mps, n=2)) / log.period_s**2
    return float(np.percentile(jerks, 95)) if jerks.size else 0.0
