"""What a front end makes of one frame: measurements of tracks, and nothing of which is which."""

from __future__ import annotations

from dataclasses import dataclass, field

from heel.services.tracker.people.geometry import FloatArray
from heel.services.tracker.people.merged import Merge
from heel.services.tracker.people.track import Track


@dataclass(slots=True)
class Measurement:
    """A track, measured by itself in one frame.

    Attributes:
        track: which one.
        value: (4,) as of `geometry.boxes_to_measurements`.
        variance: (4,) of the measurement, squared units of `value`.
        score: probability in [0, 1] that what was measured is a person.
        alone: whether at least half of the person is in view.
        clear: whether the picture there is of this person alone, so that it may be learned.
        look: (D,) appearance descriptor of the picture there; None if none was taken.
        proven: whether it is known to be a person, not a thing.
        rivals: probability in [0, 1] that it is of any other track.
        best: the same of the likeliest other track.
        rival: that track.
        told: probability in [0, 1] that it is the person of the id, where the detector knows the
            person; None: the tracker decides.
    """

    track: Track
    value: FloatArray
    variance: FloatArray
    score: float = 1.0
    alone: bool = True
    clear: bool = True
    look: FloatArray | None = None
    proven: bool = True
    rivals: float = 0.0
    best: float = 0.0
    rival: Track | None = None
    told: float | None = None


@dataclass(slots=True)
class Measured:
    """All measurements of a frame.

    Attributes:
        singles: of tracks by themselves, in the order of the tracks.
        merges: of pairs of tracks by one box.
        met: pairs of tracks that can be confused from now on.
    """

    singles: list[Measurement] = field(default_factory=list)
    merges: list[Merge] = field(default_factory=list)
    met: list[tuple[Track, Track]] = field(default_factory=list)
