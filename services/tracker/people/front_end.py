"""What stands between one kind of frames and the people: detections or evidence to measurements."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from heel.services.tracker.people.carry import CameraStep
from heel.services.tracker.people.geometry import FloatArray
from heel.services.tracker.people.identity import Identity
from heel.services.tracker.people.measured import Measured
from heel.services.tracker.people.track import Track


@dataclass(frozen=True, slots=True)
class Scene:
    """The people as predicted for a frame.

    Attributes:
        tracks: N in sight, or shortly out of it.
        mean, covariance: (N, 4, 2) and (N, 4, 2, 2), see `kalman`.
        covered: (N, N) share in [0, 1] of each box that each nearer one covers.
        identity: what is known of appearance.
        t_s: time of the frame; elapsed_s: since the frame before.
        camera: how the picture moved since then; None: not told.
    """

    tracks: Sequence[Track]
    mean: FloatArray
    covariance: FloatArray
    covered: FloatArray
    identity: Identity
    t_s: float
    elapsed_s: float
    camera: CameraStep | None

    @property
    def hidden(self) -> FloatArray:
        """(N,) share in [0, 1] of each box that the nearer one which hides most of it covers."""
        return np.asarray(self.covered.max(axis=1, initial=0.0))


UNSEEN = "out of sight"
"""Why a track is not shown that is no person in the picture."""
Frame = TypeVar("Frame", contravariant=True)


class FrontEnd(Protocol[Frame]):
    """Turns frames of one kind into measurements, births and deaths of tracks.

    Attributes:
        pictures: whether descriptors are taken.
        detection_rate: probability that a visible person is measured, as far as a miss speaks
            against a track being a person.
    """

    pictures: bool
    detection_rate: float

    @property
    def doubt(self) -> str:
        """Why nobody can be shown in this scene so far; "" without such a reason."""
        ...

    def settle(self) -> None:
        """Do now what `measure` would do first, no track of the frame before depending on it."""
        ...

    def measure(self, frame: Frame, scene: Scene) -> Measured:
        """Measure the tracks of a scene."""
        ...

    def take_stock(self, tracks: list[Track], measured: Measured, t_s: float) -> list[Track]:
        """The tracks that go on after they were corrected, newborn ones among them."""
        ...

    def ready(self, tracks: Sequence[Track]) -> list[Track]:
        """New tracks that are known to be people by now."""
        ...

    def parted(self, newcomer: Track, tracks: Sequence[Track]) -> list[Track]:
        """Known tracks whose measurements were of two people, one of them the newcomer."""
        ...

    def hides(self, track: Track, t_s: float, at_side: bool) -> str:
        """Why a track is not shown, `UNSEEN` among others; "": it is.

        At the side of the picture (`at_side`) people leave it.
        """
        ...
