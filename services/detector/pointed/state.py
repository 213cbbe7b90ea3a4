"""The person pointed at as bytes, and back, for the detector that comes after a crash."""

from __future__ import annotations

from dataclasses import dataclass

from heel.services.detector.pointed.colours import Exposure, StripColours
from heel.services.detector.pointed.distance import Doubt, Stance
from heel.services.detector.pointed.person import PointedPerson
from heel.services.detector.pointed.proof import MovementWatch, Proof
from heel.services.detector.scene import SceneKey
from heel.services.runtime.state_bytes import StateClasses, StateError, read_state, write_state

_MAX_BYTES = 1 << 20
"""Of a state: one person's colours take 30 kB."""


@dataclass
class PointedState:
    """All that the search for a person goes on from.

    Attributes:
        scene: stream, epoch, width and height of the pictures; None before the first.
        person: None while nobody is looked for.
        proof: whether it is one.
        shown: whether it was reported.
        count: of the people looked for so far.
    """

    scene: tuple[str, int, int, int] | None
    person: PointedPerson | None
    proof: Proof
    shown: bool
    count: int

    @property
    def key(self) -> SceneKey | None:
        """The scene as others name it."""
        return None if self.scene is None else SceneKey(*self.scene)


CLASSES = StateClasses(
    what="detector",
    kept=(Doubt, Exposure, PointedPerson, PointedState, Proof, Stance, StripColours),
    transient={Proof: {"_watch": MovementWatch}},
)
"""Pictures are not kept: what moved since the last one cannot be told after a gap."""


def write(state: PointedState, settings: str) -> bytes:
    """As bytes; `settings` tells those that the state rests on from others."""
    return write_state(state, CLASSES, settings)


def read(data: bytes, settings: str) -> PointedState:
    """From the bytes of `write`.

    Raises:
        StateError: they are no such state, or of other settings or another version.
    """
    example = PointedState(None, PointedPerson((0.0, 0.0, 10.0, 20.0), 20), Proof(), False, 0)
    state = read_state(data, example, CLASSES, settings, _MAX_BYTES)
    if state.scene is not None and tuple(map(type, state.scene)) != (str, int, int, int):
        raise StateError("state of the detector: a scene that is none: run matching versions")
    return state
