"""The person that the robot acts upon, judged by the truth of a simulated world."""

from __future__ import annotations

from heel.evaluation.alignment import best_pairs
from heel.schemas import FollowState, SimTruth, Tracks
from heel.services.geometry.boxes import as_array, clipped, iou_matrix

_LEAST_IOU = 0.3
"""Of a track with the person that it is on; chosen by hand, below the 0.5 of the scores of boxes: a
person half hidden is still the one that the robot drives after."""
ACTING = ("following", "occluded")
"""States in which the follower moves, or would, for the person that its track is on."""


def people_by_track(truth: SimTruth, tracks: Tracks) -> dict[int, int]:
    """Which person each track is on, by index in the truth; tracks on nobody are left out.

    Tracks and people are paired one to one at the highest total IoU, from 0.3 on, within the
    picture. Others than the target only count while anything of them can be seen.

    Args:
        truth: of the frame that the tracks are of.
        tracks: those of one frame, boxes in pixels.
    """
    present = [
        index
        for index, person in enumerate(truth.people)
        if person.box_xyxy is not None and (person.visible > 0 or person.role == "target")
    ]
    size = (tracks.width, tracks.height)
    people = as_array(truth.people[index].box_xyxy or (0, 0, 0, 0) for index in present)
    shown = as_array(track.box_xyxy for track in tracks.tracks)
    overlaps = iou_matrix(clipped(shown, size), clipped(people, size))
    rows, columns = best_pairs(overlaps, _LEAST_IOU)
    return {
        tracks.tracks[row].id: present[column]
        for row, column in zip(rows.tolist(), columns.tolist(), strict=True)
    }


def acted_upon(state: FollowState, people: dict[int, int]) -> int | None:
    """Index of the person that the robot drives after now, None if it drives after nobody.

    Args:
        state: of the follower.
        people: index of the person by track id, of the newest tracks that the follower has.
    """
    track_id = state.target.track_id
    return None if track_id is None or state.state not in ACTING else people.get(track_id)
