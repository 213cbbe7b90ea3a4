"""Start of a background with people already in view.

The first frame is not an empty scene. Until a pixel has been still for a while its background is
unknown: nothing is learned there, and what moves is foreground. MOTA of Town Centre A and B: 38 and
47 with, 11 and 32 without.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas.blobs import FOREGROUND, NONE
from heel.services.detector.regions import Indices

SETTLE_S = 0.16
"""A pixel that has been still for this long is background."""

_KNOWN_SHARE = 0.9
_NOTHING = np.zeros(0, np.intp)
# Half a person at working size: plain clothes move unseen between their edges.
_CLOSE = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (9, 17))


class StillnessGate:
    """Says per pixel when the background is first known."""

    def __init__(
        self,
        shape: tuple[int, int],
        t_ns: int,
        limit_s: float,
        known: NDArray[np.uint8] | None = None,
    ) -> None:
        """Know nothing, or what another model has learned.

        Args:
            shape: height and width of the maps.
            t_ns: time of the first frame.
            limit_s: every pixel counts as known after this time: waving leaves never settle.
            known: (H, W) uint8, 255 where the background is known already.
        """
        self._known = np.zeros(shape, np.uint8) if known is None else known.copy()
        self._still_s = np.zeros(shape, np.float32)
        self._start_ns = self._last_ns = t_ns
        self._limit_s = limit_s
        self._share = float(np.count_nonzero(self._known)) / self._known.size
        self.done = False

    @property
    def known(self) -> NDArray[np.uint8]:
        """(H, W) uint8, 255 where the background is known."""
        return np.full_like(self._known, 255) if self.done else self._known

    @property
    def learning(self) -> bool:
        """Whether so much is unknown that the background is not to be believed."""
        return not self.done and self._share < _KNOWN_SHARE

    def allow(self, free: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """What may be learned of what is free; (H, W) uint8, 0 or 255."""
        return free if self.done else free & self._known

    def settle(self, moving: NDArray[np.uint8], t_ns: int) -> Indices:
        """Take one frame; the pixels whose background is known from now on.

        Args:
            moving: (H, W) uint8, 255 where it moves.
            t_ns: time of the frame.
        """
        if self.done or t_ns == self._start_ns:
            return _NOTHING
        self._still_s += np.float32(max(0, t_ns - self._last_ns) * 1e-9)
        self._still_s[_whole(moving) > 0] = 0.0
        self._last_ns = t_ns
        self.done = t_ns - self._start_ns > self._limit_s * 1e9
        still = (self._still_s >= 0.99 * SETTLE_S) | self.done
        settled = (self._known == 0) & still
        self._known[settled] = 255
        self._share = float(np.count_nonzero(self._known)) / self._known.size
        return np.flatnonzero(settled)

    def correct(self, evidence: NDArray[np.uint8], moving: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Evidence with what moves, whole, as foreground where the background is unknown."""
        if self.done:
            return evidence
        guess = np.where(_whole(moving) > 0, np.uint8(FOREGROUND), np.uint8(NONE))
        return np.where(self._known == 0, guess, evidence)


def _whole(moving: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.asarray(cv2.morphologyEx(moving, cv2.MORPH_CLOSE, _CLOSE), np.uint8)
