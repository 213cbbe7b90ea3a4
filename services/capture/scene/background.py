"""The still part of the drawn scene: sky, trees, a brick wall, grass, paving, and two occluders."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.services.capture.scene.projection import GroundCamera

# Where things stand, metres to the right (x), away (z) and up (top); chosen by hand.
WALL_Z_M = 17.0
WALL_TOP_M = 5.0
GRASS_Z_M = 14.2
LAMP_X_M = 1.15
LAMP_Z_M = 7.6
BUSH_X_M = -3.0
BUSH_Z_M = 9.4
SUN_X = 0.85
"""Metres that the shadow of a point one metre high lies to the right; chosen by hand."""
SUN_Z = 0.35
"""Metres that it lies away; chosen by hand."""

Image = NDArray[np.uint8]
_SUPERSAMPLE = 2
"""Factor by which the picture is drawn larger before it is shrunk; chosen by hand."""
_PAVING_M = 12.0
"""Side of the drawn piece of paving, metres; chosen by hand."""
_PAVING_PX_PER_M = 120.0
"""Pixels per metre of it; finer than the camera sees it anywhere."""


@dataclass(frozen=True)
class Occluder:
    """Something still that people walk behind.

    Attributes:
        z_m: distance from the camera.
        mask: (H, W) uint8, 255 where its pixels are in the background picture.
        box: left, top, right, bottom around the mask.
    """

    z_m: float
    mask: Image
    box: tuple[int, int, int, int]


def draw_background(camera: GroundCamera, rng: np.random.Generator) -> tuple[Image, list[Occluder]]:
    """The empty scene, (H, W, 3) BGR, and what stands in it."""
    large = GroundCamera(camera.width * _SUPERSAMPLE, camera.height * _SUPERSAMPLE)
    canvas = _sky(large, rng)
    _trees(canvas, large, rng)
    _ground(canvas, large, rng)
    _wall(canvas, large, rng)
    canvas = _still_shadows(canvas, large)
    occluders = []
    for z_m, draw in ((BUSH_Z_M, _bush), (LAMP_Z_M, _lamp)):
        mask = draw(canvas, large, rng)
        small = cv2.resize(mask, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
        solid = np.where(np.asarray(small) > 96, 255, 0).astype(np.uint8)
        left, top, width, height = cv2.boundingRect(solid)
        occluders.append(Occluder(z_m, solid, (left, top, left + width, top + height)))
    size = (camera.width, camera.height)
    return np.asarray(cv2.resize(canvas, size, interpolation=cv2.INTER_AREA), np.uint8), occluders


def cloud_noise(
    rng: np.random.Generator, size: tuple[int, ...], cells: tuple[int, ...]
) -> NDArray[np.float32]:
    """Smooth noise in about [-1, 1], (H, W) = `size`: one octave per cell size in pixels."""
    height, width = size
    total = np.zeros((height, width), np.float32)
    for cell in cells:
        coarse = rng.standard_normal((height // cell + 2, width // cell + 2)).astype(np.float32)
        total += np.asarray(cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC))
    return np.asarray(total / (1.6 * np.sqrt(len(cells))), np.float32)


def _tint(noise: NDArray[np.float32], colour: tuple[int, int, int], depth: float) -> Image:
    """A colour modulated by noise: `depth` levels for noise 1."""
    picture = np.array(colour, np.float32) + depth * noise[..., None]
    return np.clip(picture, 0, 255).astype(np.uint8)


def _sky(camera: GroundCamera, rng: np.random.Generator) -> Image:
    rows = np.linspace(0.0, 1.0, camera.height, dtype=np.float32)[:, None]
    clouds = cloud_noise(rng, (camera.height, camera.width), (160, 80, 40))
    return _tint(np.clip(clouds, 0, 1) * 1.2 + rows * 1.4, (214, 186, 160), 38)


def _trees(canvas: Image, camera: GroundCamera, rng: np.random.Generator) -> None:
    leaves = cloud_noise(rng, (camera.height, camera.width), (24, 10, 5))
    foliage = _tint(leaves, (48, 84, 66), 26)
    mask = np.zeros(canvas.shape[:2], np.uint8)
    for _ in range(26):
        x = int(rng.uniform(0, camera.width))
        y = int(rng.uniform(0.05, 0.12) * camera.height)
        radius = int(rng.uniform(0.05, 0.08) * camera.height)
        cv2.circle(mask, (x, y), radius, 255, -1)
    mask[leaves > 0.95] = 0
    cv2.copyTo(foliage, mask, canvas)


def _paving(rng: np.random.Generator) -> Image:
    """A top view of paving slabs, `_PAVING_M` square."""
    size, rows, columns = round(_PAVING_M * _PAVING_PX_PER_M), 30, 20
    tone = np.zeros((size, size), np.float32)
    joints = np.zeros((size, size), np.uint8)
    slab_h, slab_w = size // rows, size // columns
    for row in range(rows):
        shift = (row % 2) * slab_w // 2
        for column in range(columns):
            x, y = column * slab_w + shift, row * slab_h
            level = float(rng.normal(0.0, 0.45))
            for wrap in (0, -size):
                cv2.rectangle(tone, (x + wrap, y), (x + wrap + slab_w, y + slab_h), level, -1)
                corner = (x + wrap + slab_w, y + slab_h)
                cv2.rectangle(joints, (x + wrap, y), corner, 255, 2)
    grain = cloud_noise(rng, (size, size), (90, 30, 3, 2))
    slabs = _tint(tone + 0.8 * grain, (150, 160, 166), 11)
    slabs[joints > 0] = (slabs[joints > 0] * 0.72).astype(np.uint8)
    return slabs


def _ground(canvas: Image, camera: GroundCamera, rng: np.random.Generator) -> None:
    top = int(camera.horizon_px) + 4
    rows = np.arange(top, camera.height, dtype=np.float64)
    z = camera.row_distance_m(rows)[:, None]
    x = (np.arange(camera.width) - camera.width / 2)[None, :] * z / camera.focal_px
    # The texture's edges do not match: they are put outside the picture, but for its far corners.
    map_x = ((x + _PAVING_M / 2) % _PAVING_M * _PAVING_PX_PER_M).astype(np.float32)
    map_y = ((z - 3.0) % _PAVING_M * _PAVING_PX_PER_M + 0.0 * x).astype(np.float32)
    paving = _paving(rng)
    sharp = cv2.remap(paving, map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    soft_slabs = cv2.GaussianBlur(paving, (0, 0), 3.0)
    soft = cv2.remap(soft_slabs, map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    # Far slabs are smaller than a pixel column of the texture: the blurred copy keeps them calm.
    far = np.clip((z - 6.0) / 6.0, 0.0, 1.0)[..., None]
    ground = (sharp * (1 - far) + soft * far).astype(np.uint8)
    wear = cloud_noise(rng, ground.shape[:2], (200, 90))
    ground = np.clip(ground.astype(np.float32) + 6.0 * wear[..., None], 0, 255).astype(np.uint8)
    blades = cloud_noise(rng, ground.shape[:2], (60, 8, 4, 3))
    grass = _tint(blades, (58, 122, 92), 20)
    lawn = np.broadcast_to(z > GRASS_Z_M, x.shape)
    ground[lawn] = grass[lawn]
    canvas[top:] = ground
    kerb = camera.project(np.array([[0.0, GRASS_Z_M, 0.0], [0.0, GRASS_Z_M, 0.12]]))[:, 1]
    cv2.rectangle(canvas, (0, int(kerb[1])), (camera.width, int(kerb[0])), (176, 182, 184), -1)
    cv2.line(canvas, (0, int(kerb[0]) + 1), (camera.width, int(kerb[0]) + 1), (96, 100, 104), 2)


def _wall(canvas: Image, camera: GroundCamera, rng: np.random.Generator) -> None:
    corners = camera.project(np.array([[0.0, WALL_Z_M, WALL_TOP_M], [0.0, WALL_Z_M, 0.0]]))
    top, bottom = int(corners[0, 1]), int(corners[1, 1])
    metre = camera.focal_px / WALL_Z_M
    tone = np.zeros((bottom - top, camera.width), np.float32)
    mortar = np.zeros(tone.shape, np.uint8)
    brick_h, brick_w = max(3, round(0.11 * metre)), max(6, round(0.34 * metre))
    for row, y in enumerate(range(0, bottom - top, brick_h)):
        for x in range(-(row % 2) * brick_w // 2, camera.width, brick_w):
            level = float(rng.normal(0.0, 0.6))
            cv2.rectangle(tone, (x, y), (x + brick_w, y + brick_h), level, -1)
            cv2.rectangle(mortar, (x, y), (x + brick_w, y + brick_h), 255, 1)
    tone += cloud_noise(rng, tone.shape, (90, 30, 4))
    bricks = _tint(tone, (84, 104, 148), 11)
    bricks[mortar > 0] = (126, 138, 150)
    canvas[top:bottom] = bricks
    cv2.rectangle(canvas, (0, top - 8), (camera.width, top + 4), (150, 156, 160), -1)
    cv2.rectangle(canvas, (0, bottom - 14), (camera.width, bottom), (92, 96, 104), -1)
    for x_m in np.arange(-9.0, 9.1, 3.0):
        _window(canvas, camera, float(x_m))


def _window(canvas: Image, camera: GroundCamera, x_m: float) -> None:
    frame = camera.project(
        np.array([[x_m - 0.6, WALL_Z_M, 3.6], [x_m + 0.6, WALL_Z_M, 1.6], [x_m, WALL_Z_M, 2.6]])
    ).astype(int)
    (left, top), (right, bottom), (middle, cross) = frame.tolist()
    cv2.rectangle(canvas, (left, top), (right, bottom), (92, 78, 66), -1)
    glint = np.array([[left, bottom], [left, top], [right, top]], np.int32)
    cv2.fillConvexPoly(canvas, glint, (128, 112, 96), cv2.LINE_AA)
    cv2.rectangle(canvas, (left, top), (right, bottom), (206, 210, 212), 4)
    cv2.line(canvas, (middle, top), (middle, bottom), (206, 210, 212), 3)
    cv2.line(canvas, (left, cross), (right, cross), (206, 210, 212), 3)
    cv2.rectangle(canvas, (left - 6, bottom + 2), (right + 6, bottom + 9), (170, 176, 180), -1)


def _still_shadows(canvas: Image, camera: GroundCamera) -> Image:
    mask = np.zeros(canvas.shape[:2], np.uint8)
    foot, tip = np.array([LAMP_X_M, LAMP_Z_M, 0.0]), np.array([LAMP_X_M, LAMP_Z_M, 0.0])
    tip[:2] += 4.4 * np.array([SUN_X, SUN_Z])
    ends = camera.project(np.stack((foot, tip))).astype(int).tolist()
    cv2.line(mask, tuple(ends[0]), tuple(ends[1]), 255, 14)
    centre = np.array([BUSH_X_M + 0.5 * SUN_X, BUSH_Z_M + 0.5 * SUN_Z, 0.0])
    x, y = camera.project(centre[None])[0].astype(int).tolist()
    metre = camera.focal_px / BUSH_Z_M
    cv2.ellipse(mask, (x, y), (int(1.1 * metre), int(0.28 * metre)), 0, 0, 360, 255, -1)
    soft = np.asarray(cv2.GaussianBlur(mask, (0, 0), 5.0), np.float32)[..., None] / 255
    return np.asarray(canvas * (1.0 - 0.4 * soft), np.uint8)


def _bush(canvas: Image, camera: GroundCamera, rng: np.random.Generator) -> Image:
    mask = np.zeros(canvas.shape[:2], np.uint8)
    light = np.zeros(canvas.shape[:2], np.float32)
    for _ in range(60):
        across, up = float(rng.uniform(-0.85, 0.85)), float(rng.uniform(0.1, 0.8))
        up *= 1.0 - 0.5 * across**2
        point = np.array([[BUSH_X_M + across, BUSH_Z_M, up]])
        x, y = camera.project(point)[0].astype(int).tolist()
        radius = int(rng.uniform(0.10, 0.2) * camera.focal_px / BUSH_Z_M)
        cv2.circle(mask, (x, y), radius, 255, -1)
        cv2.circle(light, (x, y), radius, up - 0.25 * across - 0.3, -1)
    mask[:] = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((25, 25), np.uint8))
    leaves = cloud_noise(rng, mask.shape, (14, 7, 4))
    soft = np.asarray(cv2.GaussianBlur(light, (0, 0), 6.0), np.float32)
    cv2.copyTo(_tint(leaves * 0.9 + soft * 1.8, (44, 92, 60), 30), mask, canvas)
    return mask


def _lamp(canvas: Image, camera: GroundCamera, rng: np.random.Generator) -> Image:
    mask = np.zeros(canvas.shape[:2], np.uint8)
    metre = camera.focal_px / LAMP_Z_M
    ends = camera.project(np.array([[LAMP_X_M, LAMP_Z_M, 0.0], [LAMP_X_M, LAMP_Z_M, 4.2]]))
    (x, foot), (_, top) = ends.astype(int).tolist()
    half = max(2, round(0.065 * metre))
    base = round(0.11 * metre)
    for target, colour in ((mask, (255, 255, 255)), (canvas, (74, 70, 66))):
        cv2.rectangle(target, (x - half, max(top, 0)), (x + half, foot), colour, -1)
        cv2.rectangle(target, (x - base, foot - round(0.5 * metre)), (x + base, foot), colour, -1)
        cv2.ellipse(target, (x, foot), (base, base // 3), 0, 0, 180, colour, -1)
        arm = (x - round(0.55 * metre), max(top, 0) + round(0.16 * metre))
        cv2.line(target, (x, max(top, 0) + round(0.3 * metre)), arm, colour, max(2, half))
        size = (round(0.24 * metre), round(0.07 * metre))
        cv2.ellipse(target, arm, size, 0, 0, 360, colour, -1)
    lit = (124, 120, 116)
    cv2.rectangle(canvas, (x - half, max(top, 0)), (x - half // 3, foot), lit, -1)
    cv2.rectangle(canvas, (x - base, foot - round(0.5 * metre)), (x - base // 3, foot), lit, -1)
    return mask
