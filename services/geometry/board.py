"""A lens from pictures of a flat board: corners found, views chosen, the lens fitted, and judged.

Z. Zhang, "A flexible new technique for camera calibration", IEEE T-PAMI 22(11), 2000, as OpenCV
implements it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas.errors import HeelError
from heel.services.geometry.lens import Lens
from heel.services.geometry.lens_file import LensFile

FloatArray = NDArray[np.float64]

LEAST_VIEWS = 8
"""Views from which a lens is fitted; chosen by hand: five numbers of distortion, four of the
projection, and six of each view's pose."""
MOST_VIEWS = 40
"""Views that are kept: more make the fit slower, and hardly better; chosen by hand."""
_LEAST_CORNERS = 8
"""Corners of a view; fewer do not tell a pose well. Chosen by hand."""
_NEW_VIEW = 0.06
"""Mean distance of a view's corners to those of every other [picture widths]; chosen by hand."""
_CELLS = (4, 3)
"""Cells across and down a picture, in each of which corners are wanted."""
_LEAST_COVERED = 0.75
"""Share of these cells with corners: beyond the outermost ones the distortion is guessed; chosen by
hand."""
_MOST_RESIDUAL = 1.5e-3
"""Root mean square distance of corners to where they are expected [picture widths]: 2 pixels of
1280; a moving or bent board is worse. Chosen by hand."""
_NAMES = (("upper", "middle", "lower"), ("left", "middle left", "middle right", "right"))


class View(NamedTuple):
    """Corners of one picture: (N, 3) places on the board in metres, and (N, 2) pixels."""

    places: FloatArray
    pixels: FloatArray


class Board(Protocol):
    """Something flat with corners that are found in pictures."""

    def find(self, grey: NDArray[np.uint8]) -> View | None:
        """The corners in an (H, W) picture; None where the board is not seen well enough."""
        ...


@dataclass(frozen=True, slots=True)
class Checkerboard:
    """A checkerboard, all of which has to be seen.

    Attributes:
        columns, rows: inner corners, where four squares meet.
        square_m: side of a square.
    """

    columns: int
    rows: int
    square_m: float

    def find(self, grey: NDArray[np.uint8]) -> View | None:
        """All corners, to a fraction of a pixel."""
        size = self.columns, self.rows
        found, corners = cv2.findChessboardCornersSB(grey, size)
        if not found:
            return None
        places = np.zeros((self.columns * self.rows, 3))
        places[:, :2] = np.mgrid[: self.columns, : self.rows].T.reshape(-1, 2) * self.square_m
        return View(places, np.asarray(corners, np.float64).reshape(-1, 2))


class CharucoBoard:
    """A ChArUco board, of which a part is enough: the corners of wide pictures are reached by it.

    Args:
        columns, rows: squares.
        square_m, marker_m: sides of a square and of the marker in it.
        dictionary: of the markers, OpenCV's name, such as `4X4_50`.

    Raises:
        HeelError: there is no such dictionary, or it has too few markers.
    """

    def __init__(
        self, columns: int, rows: int, square_m: float, marker_m: float, dictionary: str
    ) -> None:
        number = getattr(cv2.aruco, f"DICT_{dictionary.upper()}", None)
        if number is None:
            raise HeelError(f"no dictionary {dictionary} of markers: 4X4_50, 5X5_100, 6X6_250, ...")
        if not 0 < marker_m < square_m:
            raise HeelError(f"markers of {marker_m:g} m in squares of {square_m:g} m: smaller fit")
        markers = cv2.aruco.getPredefinedDictionary(number)
        if columns * rows // 2 > len(markers.bytesList):
            raise HeelError(
                f"a board of {columns}x{rows} squares has {columns * rows // 2} markers, and "
                f"{dictionary} {len(markers.bytesList)}: name a larger dictionary"
            )
        self._board = cv2.aruco.CharucoBoard((columns, rows), square_m, marker_m, markers)
        self._detector = cv2.aruco.CharucoDetector(self._board)

    def find(self, grey: NDArray[np.uint8]) -> View | None:
        """The corners between two markers that are seen."""
        corners, ids, _, _ = self._detector.detectBoard(grey)
        if ids is None or len(ids) < _LEAST_CORNERS:
            return None
        places = np.asarray(self._board.getChessboardCorners(), np.float64)[ids.ravel()]
        if np.linalg.matrix_rank(places[:, :2] - places[0, :2]) < 2:
            return None  # all on one line
        return View(places, np.asarray(corners, np.float64).reshape(-1, 2))


class Views:
    """Views of the board that differ, and which parts of the picture they have covered.

    Args:
        size_px: (width, height) of the pictures.
    """

    def __init__(self, size_px: tuple[int, int]) -> None:
        self.size_px = size_px
        self.chosen: list[View] = []

    def add(self, view: View) -> bool:
        """Keep a view that differs from those there are; whether it was kept."""
        new = all(_apart(view, known) > _NEW_VIEW * self.size_px[0] for known in self.chosen)
        if new and len(self.chosen) < MOST_VIEWS:
            self.chosen.append(view)
            return True
        return False

    @property
    def covered(self) -> NDArray[np.bool_]:
        """In which cells (down, across) of the picture corners were seen."""
        across, down = _CELLS
        seen = np.zeros((down, across), bool)
        for view in self.chosen:
            cells = (view.pixels / self.size_px * _CELLS).astype(int)
            inside = ((cells >= 0) & (cells < _CELLS)).all(axis=1)
            seen[cells[inside, 1], cells[inside, 0]] = True
        return seen

    @property
    def wanted(self) -> tuple[int, int] | None:
        """The cell (down, across) in which the board should be shown next; None: it was in all."""
        rows, columns = np.nonzero(~self.covered)
        if not len(rows):
            return None
        # The corners first: there the distortion is largest.
        outward = np.abs(columns - 1.5) + np.abs(rows - 1.0)
        at = int(np.argmax(outward))
        return int(rows[at]), int(columns[at])

    @property
    def missing(self) -> str:
        """The same in words; "" if it was everywhere."""
        wanted = self.wanted
        return "" if wanted is None else f"{_NAMES[0][wanted[0]]} {_NAMES[1][wanted[1]]}"


@dataclass(frozen=True, slots=True)
class LensEstimate:
    """A lens that was fitted.

    Attributes:
        found: the lens.
        residual_px: root mean square distance of corners to where they are expected.
        views: pictures that were used.
        covered: share in [0, 1] of the picture's cells with corners.
    """

    found: LensFile
    residual_px: float
    views: int
    covered: float


def estimate_lens(views: Views, fisheye: bool) -> LensEstimate:
    """Fit a lens to views of a board.

    Args:
        views: of pictures of one size.
        fisheye: fit a fisheye's model; Brown's otherwise.

    Raises:
        HeelError: the views are too few, cover too little, or do not fit; with what to do.
    """
    chosen, covered = views.chosen, float(views.covered.mean())
    if len(chosen) < LEAST_VIEWS:
        raise HeelError(
            f"the board was found in {len(chosen)} places, {LEAST_VIEWS} are wanted: move and "
            "tilt it slowly, and check --board, which counts inner corners"
        )
    if covered < _LEAST_COVERED:
        raise HeelError(
            f"the board has covered {covered:.0%} of the picture, {_LEAST_COVERED:.0%} is wanted: "
            f"show it in the {views.missing}, too"
        )
    residual_px, lens = (_fisheye if fisheye else _brown)(chosen, views.size_px)
    if not math.isfinite(residual_px) or residual_px > _MOST_RESIDUAL * views.size_px[0]:
        raise HeelError(
            f"corners are {residual_px:.1f} px off: hold the board still and flat, and "
            + ("try without --fisheye" if fisheye else "for a lens above 110 degrees try --fisheye")
        )
    width_px, height_px = views.size_px
    if not lens.covers(width_px, height_px):
        raise HeelError(
            "the fitted distortion does not hold as far as the picture's rim: show the board "
            f"nearer to its corners{'' if fisheye else ', or try --fisheye'}"
        )
    return LensEstimate(LensFile(width_px, height_px, lens), residual_px, len(chosen), covered)


def _brown(chosen: list[View], size_px: tuple[int, int]) -> tuple[float, Lens]:
    places = [view.places.astype(np.float32) for view in chosen]
    pixels = [view.pixels.astype(np.float32) for view in chosen]
    start = np.array(
        [[size_px[0], 0, size_px[0] / 2], [0, size_px[0], size_px[1] / 2], [0, 0, 1.0]]
    )
    residual, matrix, coefficients, _, _ = cv2.calibrateCamera(
        places, pixels, size_px, start, np.zeros(5), flags=cv2.CALIB_USE_INTRINSIC_GUESS
    )
    return float(residual), _lens(False, np.asarray(matrix), np.asarray(coefficients))


def _fisheye(chosen: list[View], size_px: tuple[int, int]) -> tuple[float, Lens]:
    places = [view.places.reshape(1, -1, 3) for view in chosen]
    pixels = [view.pixels.reshape(1, -1, 2) for view in chosen]
    flags = _flag("CALIB_RECOMPUTE_EXTRINSIC") | _flag("CALIB_FIX_SKEW")
    try:
        residual, matrix, coefficients, _, _ = cv2.fisheye.calibrate(
            places, pixels, size_px, np.eye(3), np.zeros(4), flags=flags
        )
    except cv2.error as error:
        raise HeelError(
            f"the fisheye's fit failed ({error.err}): show the board at more tilts, or try "
            "without --fisheye"
        ) from None
    return float(residual), _lens(True, np.asarray(matrix), np.asarray(coefficients))


def _flag(name: str) -> int:
    """A flag of the fisheye's fit, which OpenCV 4 and 5 keep in different places."""
    return int(getattr(cv2.fisheye, name, None) or getattr(cv2, name))


def _lens(fisheye: bool, matrix: FloatArray, coefficients: FloatArray) -> Lens:
    focal_px, centre_px = (float(matrix[0, 0]), float(matrix[1, 1])), matrix[:2, 2].tolist()
    return Lens(
        fisheye, focal_px, (centre_px[0], centre_px[1]), tuple(coefficients.ravel().tolist())
    )


def _apart(one: View, other: View) -> float:
    """Mean distance of the two views' common corners, pixels; infinite without any."""
    places = {
        tuple(place): pixel
        for place, pixel in zip(one.places.round(6).tolist(), one.pixels, strict=True)
    }
    steps = [
        float(np.hypot(*(places[tuple(place)] - pixel)))
        for place, pixel in zip(other.places.round(6).tolist(), other.pixels, strict=True)
        if tuple(place) in places
    ]
    return float(np.mean(steps)) if steps else math.inf
