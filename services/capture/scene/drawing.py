"""Paints people and their shadows into a picture, anti-aliased, with sub-pixel corners."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.services.capture.scene.background import SUN_X, SUN_Z
from heel.services.capture.scene.figure import Body, Shape, silhouette
from heel.services.capture.scene.projection import GroundCamera

Image = NDArray[np.uint8]
_SHIFT = 4
"""Binary places of a pixel that OpenCV draws with."""
_SHADOW = 0.42
"""Share of light that a shadow takes; chosen by hand."""
_SHADOW_SCALE = 0.5
"""Scale at which shadows are drawn and blurred; chosen by hand."""


def paint_shapes(image: Image, shapes: list[Shape]) -> None:
    """Fill the shapes in their order."""
    for shape in shapes:
        corners = np.rint(shape.outline * (1 << _SHIFT)).astype(np.int32)
        cv2.fillConvexPoly(image, corners, shape.colour, cv2.LINE_AA, _SHIFT)


def paint_shadows(image: Image, bodies: list[Body], camera: GroundCamera) -> None:
    """Darken the ground where the bodies keep the sun away; the edges are soft.

    The mask is drawn at half size: a blurred edge needs no more, and it is four times faster.
    """
    height, width = round(camera.height * _SHADOW_SCALE), round(camera.width * _SHADOW_SCALE)
    mask = np.zeros((max(1, height), max(1, width)), np.uint8)
    for body in bodies:
        _cast(mask, body, camera)
    left, top, width, height = cv2.boundingRect(mask)
    if not width:
        return
    edge = 4
    x0, y0 = max(0, left - edge), max(0, top - edge)
    x1, y1 = min(mask.shape[1], left + width + edge), min(mask.shape[0], top + height + edge)
    soft = cv2.GaussianBlur(mask[y0:y1, x0:x1], (0, 0), 1.2)
    box = [round(value / _SHADOW_SCALE) for value in (x0, y0, x1, y1)]
    region = image[box[1] : box[3], box[0] : box[2]]
    size = (region.shape[1], region.shape[0])
    light = cv2.resize(255 - np.asarray(soft) * _SHADOW, size, interpolation=cv2.INTER_LINEAR)
    shade = cv2.cvtColor(np.asarray(light, np.uint8), cv2.COLOR_GRAY2BGR)
    cv2.multiply(region, shade, region, 1.0 / 255.0)


def _cast(mask: Image, body: Body, camera: GroundCamera) -> None:
    metre_px = camera.focal_px / body.stance.z_m * _SHADOW_SCALE
    world, limbs = silhouette(body)
    ground = world + world[:, 2:] * (SUN_X, SUN_Z, -1.0)
    corners = np.rint(camera.project(ground) * _SHADOW_SCALE * (1 << _SHIFT)).astype(np.int32)
    start = 0
    for count, width_m in limbs:
        thickness = max(1, round(width_m * metre_px * 0.7))
        line = corners[start : start + count]
        cv2.polylines(mask, [line], False, 255, thickness, cv2.LINE_8, _SHIFT)
        start += count
