"""How a camera is mounted, from the boxes of one person of known height who walks about.

Feet at row `v` stand at a distance that follows from mounting height, pitch and focal length; the
head of a person of known height is then expected at a certain row. The three are fitted so that
the heads are where they are expected (nonlinear least squares, Cauchy loss, so that boxes that
are torn or too large count little).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares

from heel.schemas import HeelError
from heel.services.geometry.camera import GroundCamera, focal_length_px

FloatArray = NDArray[np.float64]
_LEAST_BOXES = 30
"""Below it three unknowns and a share of wrong boxes are too much; chosen by hand: a second of a
walk."""
_BORDER_PX = 2.0
"""A box this near to the border of the picture may be cut off by it, so its feet or head are not
where it ends; chosen by hand."""
_SOFT_PX = 3.0
"""Scale of the Cauchy loss: heads farther off than this hardly count; chosen by hand."""
_ALIKE_BOXES = 10.0
"""Boxes of neighbouring frames are wrong alike: ten of them are worth one."""
_LEAST_PITCH_RAD = -0.6
"""Lowest pitch that is tried, 34 degrees upwards; chosen by hand: people at any distance are cut
off beyond."""
_GREATEST_PITCH_RAD = 1.4
"""Steepest pitch that is tried, 80 degrees downwards; chosen by hand: straight down, heads and feet
cover each other."""


class CalibrationError(HeelError):
    """Boxes that do not tell how the camera is mounted."""


@dataclass(frozen=True, slots=True)
class MountEstimate:
    """The camera, and how well the boxes tell.

    Attributes:
        mount_height_sigma_m, pitch_sigma_rad, fov_sigma_rad: standard deviations; 0 for a field
            of view that was given.
        boxes: how many were used.
        residual_px: robust standard deviation of the heads' rows.
        residual_share: the same, as a share of the median box height.
    """

    camera: GroundCamera
    mount_height_sigma_m: float
    pitch_sigma_rad: float
    fov_sigma_rad: float
    boxes: int
    residual_px: float
    residual_share: float


def estimate_mount(
    boxes_xyxy: FloatArray, size_px: tuple[int, int], person_height_m: float,
    horizontal_fov_rad: float | None = None,
) -> MountEstimate:  # fmt: skip
    """Fit height, pitch and, if it is not given, field of view.

    Args:
        boxes_xyxy: (N, 4) boxes of one person, in pixels.
        size_px: width and height of the picture.
        person_height_m: of that person, with shoes.
        horizontal_fov_rad: of the camera.

    Raises:
        CalibrationError: too few boxes, or they do not determine the camera, or do not fit it.
    """
    boxes = _whole(np.asarray(boxes_xyxy, np.float64), size_px)
    spans = boxes[:, 3] - boxes[:, 1]
    if np.ptp(np.percentile(spans, [5, 95])) < 0.25 * float(np.median(spans)):
        raise CalibrationError(
            f"the person is about {np.median(spans):.0f} px tall in all boxes: let them walk "
            "towards the camera and away, from twice as near to twice as far"
        )
    fit, focal_px = _fit(boxes, size_px, person_height_m, horizontal_fov_rad)
    residuals = _head_errors(fit.x, boxes, size_px, person_height_m, focal_px)
    residual_px = float(1.4826 * np.median(np.abs(residuals)))
    sigmas = _sigmas(fit, residual_px)
    camera = _camera(fit.x, size_px, focal_px)
    share = residual_px / float(np.median(spans))
    estimate = MountEstimate(
        camera, sigmas[0] * camera.mount_height_m, sigmas[1],
        0.0 if focal_px is not None else sigmas[2] * math.sin(camera.horizontal_fov_rad),
        len(boxes), residual_px, share,
    )  # fmt: skip
    _judge(estimate, fit.x)
    return estimate


def _whole(boxes: FloatArray, size_px: tuple[int, int]) -> FloatArray:
    """Boxes that no border cuts.

    Raises:
        CalibrationError: too few are left.
    """
    width, height = size_px
    seen = np.isfinite(boxes).all(axis=1)
    seen &= (boxes[:, :2] > _BORDER_PX).all(axis=1)
    seen &= (boxes[:, 2:] < np.array([width, height]) - _BORDER_PX).all(axis=1)
    seen &= (boxes[:, 2:] > boxes[:, :2]).all(axis=1)
    if np.count_nonzero(seen) < _LEAST_BOXES:
        raise CalibrationError(
            f"{np.count_nonzero(seen)} of {len(boxes)} boxes show the whole person: "
            f"{_LEAST_BOXES} are needed; step back and walk for longer"
        )
    return boxes[seen]


def _fit(
    boxes: FloatArray, size_px: tuple[int, int], person_height_m: float, fov_rad: float | None
) -> tuple[OptimizeResult, float | None]:
    """The best of fits from several starts, and the focal length if that was given."""
    focal_px = None if fov_rad is None else focal_length_px(size_px[0], fov_rad)
    starts = itertools.product(
        np.log([0.4, 1.0, 3.0]), (-0.1, 0.1, 0.5),
        [()] if focal_px is not None else [(math.log(size_px[0] * share),) for share in (0.5, 1.2)],
    )  # fmt: skip
    lower = [math.log(0.02), _LEAST_PITCH_RAD, math.log(size_px[0] * 0.1)]
    upper = [math.log(50.0), _GREATEST_PITCH_RAD, math.log(size_px[0] * 20.0)]
    count = 2 if focal_px is not None else 3
    fits = [
        least_squares(
            _head_errors, [height, pitch, *focal], loss="cauchy", f_scale=_SOFT_PX,
            bounds=(lower[:count], upper[:count]), x_scale=[0.3, 0.1, 0.3][:count],
            args=(boxes, size_px, person_height_m, focal_px),
        )
        for height, pitch, focal in starts
    ]  # fmt: skip
    return min(fits, key=lambda fit: float(fit.cost)), focal_px


def _camera(
    parameters: FloatArray, size_px: tuple[int, int], focal_px: float | None
) -> GroundCamera:
    """Parameters are log mounting height, pitch and, unless it is given, log focal length."""
    focal = float(np.exp(parameters[2])) if focal_px is None else focal_px
    return GroundCamera(
        *size_px, focal, mount_height_m=float(np.exp(parameters[0])), pitch_rad=float(parameters[1])
    )


def _head_errors(
    parameters: FloatArray, boxes: FloatArray, size_px: tuple[int, int], person_height_m: float,
    focal_px: float | None,
) -> FloatArray:  # fmt: skip
    """(N,) rows by which heads are not where they are expected."""
    camera = _camera(parameters, size_px, focal_px)
    feet = np.stack([(boxes[:, 0] + boxes[:, 2]) / 2, boxes[:, 3]], axis=-1)
    heads = np.concatenate(
        [camera.ground(feet), np.full((len(boxes), 1), person_height_m)], axis=-1
    )
    errors = camera.pixels(heads)[:, 1] - boxes[:, 1]
    # Towards the horizon people shrink to nothing, their heads meet their feet: so it goes on.
    above = boxes[:, 3] - boxes[:, 1] + camera.horizon_px - boxes[:, 3]
    return np.where(np.isfinite(errors), errors, above)


def _sigmas(fit: OptimizeResult, residual_px: float) -> FloatArray:
    """Standard deviations of the parameters, infinite where the boxes say nothing."""
    information = fit.jac.T @ fit.jac
    if np.linalg.cond(information) > 1e12:
        return np.full(len(fit.x), math.inf)
    covariance = np.linalg.inv(information) * max(residual_px, 0.5) ** 2 * _ALIKE_BOXES
    return np.sqrt(np.diag(covariance))


def _judge(estimate: MountEstimate, parameters: FloatArray) -> None:
    """Refuse what is not good enough to drive by.

    Raises:
        CalibrationError: with the reason and the remedy.
    """
    camera = estimate.camera
    if estimate.residual_share > 0.08:
        raise CalibrationError(
            f"heads are {estimate.residual_px:.1f} px off, {estimate.residual_share:.0%} of the "
            "box height: is there one upright person of that height on flat ground?"
        )
    doubts = {
        f"mounting height {camera.mount_height_m:.2f} m": estimate.mount_height_sigma_m
        / camera.mount_height_m / 0.15,
        f"pitch {math.degrees(camera.pitch_rad):.1f} degrees": estimate.pitch_sigma_rad / 0.03,
        f"field of view {math.degrees(camera.horizontal_fov_rad):.0f} degrees":
        estimate.fov_sigma_rad / 0.1,
    }  # fmt: skip
    what, doubt = max(doubts.items(), key=lambda item: item[1])
    if not doubt <= 1:
        remedy = "give --fov-deg" if what.startswith("field") else "walk nearer and farther"
        if len(parameters) == 3:
            remedy = "give --fov-deg"
        raise CalibrationError(f"the boxes do not tell the {what}: {remedy}")
