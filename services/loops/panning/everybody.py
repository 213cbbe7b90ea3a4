"""Every person of a recording followed, one episode each, in one pass over its pictures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from heel.schemas.errors import HeelError
from heel.services.capture.pan_window import PanSettings
from heel.services.capture.sources import open_source
from heel.services.loops.panning.episode import Episode, PanOutcome
from heel.services.loops.panning.perception import WindowPerception
from heel.services.loops.panning.truth import NOBODY, TruePeople, read_people

LEAST_VISIBLE_S = 3.0
"""A person that is in the recording for less is not followed: an episode would be over at once;
chosen by hand."""
LEAD_IN_S = 3.0
"""The camera has stood there for so long when the person comes, where the recording allows."""


@dataclass(frozen=True, slots=True)
class Appearance:
    """When one person is to be seen: frame numbers from 1, first to last, and how many."""

    person: int
    first: int
    last: int
    frames: int


def appearances(people: dict[int, TruePeople], least_frames: float) -> list[Appearance]:
    """Every person that is to be seen for long enough, by identity."""
    frames: dict[int, list[int]] = {}
    for frame, seen in people.items():
        for person in seen.identities.tolist():
            frames.setdefault(person, []).append(frame)
    return [
        Appearance(person, min(numbers), max(numbers), len(numbers))
        for person, numbers in sorted(frames.items())
        if len(numbers) >= least_frames
    ]


def follow_everybody(
    sequence: Path,
    settings: PanSettings,
    look: Callable[[], WindowPerception],
    only: frozenset[int] = frozenset(),
    least_visible_s: float = LEAST_VISIBLE_S,
) -> list[PanOutcome]:
    """Follow every person that is visible for long enough; outcomes by identity.

    Args:
        sequence: MOTChallenge directory with pictures and ground truth.
        settings: of the window; its start is replaced with where each person appears.
        look: makes what the follower sees with, anew for each person.
        only: identities to follow; empty for all.
        least_visible_s: people who are to be seen for less are not followed.

    Raises:
        HeelError: pictures or ground truth cannot be read, or nobody is visible for long enough.
    """
    people = read_people(sequence)
    with open_source(str(sequence)) as source:
        chosen = [
            one
            for one in appearances(people, least_visible_s * source.fps)
            if not only or one.person in only
        ]
        if not chosen:
            raise HeelError(f"{sequence}: nobody to follow is visible for {least_visible_s:g} s")
        size = (source.width, source.height)
        lead_in = round(LEAD_IN_S * source.fps)
        end = max(one.last for one in chosen)
        episodes: dict[int, Episode] = {}
        while (picture := source.read()) is not None and picture.index < end:
            frame = picture.index + 1
            for one in chosen:
                if not one.first - lead_in <= frame <= one.last:
                    continue
                if one.person not in episodes:
                    start = _start(settings, people[one.first], one.person, size)
                    episodes[one.person] = Episode(one.person, size, start, look())
                episodes[one.person].frame(
                    picture.index, picture.media_time_s, picture.image, people.get(frame, NOBODY)
                )
    return [episodes[one.person].outcome for one in chosen if one.person in episodes]


def _start(
    settings: PanSettings, seen: TruePeople, person: int, size: tuple[int, int]
) -> PanSettings:  # fmt: skip
    left, top, right, bottom = seen.boxes_xyxy[seen.identities == person][0].tolist()
    x = min(max((left + right) / 2, 0.0), float(size[0]))
    y = min(max((top + bottom) / 2, 0.0), float(size[1]))
    return settings.model_copy(update={"x": x, "y": y})
