"""One walking person as coloured convex shapes, from joints that swing in space.

The gait is the usual two-link leg model: the thigh swings as a sine of the phase, the knee bends
while the leg swings forward, the arms swing against the legs, and the lower foot carries the body.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.services.capture.scene.outfits import Bgr, Outfit
from heel.services.capture.scene.projection import GroundCamera, Points

# Lengths of the parts of a person 1.76 m tall, metres: those of adults, rounded by hand.
THIGH_M = 0.43
SHANK_M = 0.42
ANKLE_M = 0.07
UPPER_ARM_M = 0.29
FOREARM_M = 0.25
SPINE_M = 0.52
NECK_M = 0.10
HEAD_M = 0.115
HIP_HALF_M = 0.085
SHOULDER_HALF_M = 0.155
STRIDE_M = 1.30
"""Ground covered by one cycle of both legs, so that feet do not slide."""

# A circle of twelve corners, as round as a limb of some pixels can be seen to be.
_TURN = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
_CIRCLE = np.stack((np.cos(_TURN), np.sin(_TURN)), axis=-1)


@dataclass(frozen=True)
class Stance:
    """Where a person is and in which moment of the gait.

    Attributes:
        x_m: right of the camera's axis.
        z_m: distance from the camera.
        heading_rad: walking direction, 0 to the right, pi/2 away from the camera.
        phase_rad: of the gait; 2 pi is one cycle of both legs.
        swing: 0 standing to 1 walking at full stride.
        stature: height divided by 1.76 m.
    """

    x_m: float
    z_m: float
    heading_rad: float
    phase_rad: float
    swing: float
    stature: float


Joint = tuple[float, float, float]
"""Forward, left, up in metres of a person 1.76 m tall that stands at the origin."""


@dataclass(frozen=True)
class Part:
    """A limb, a garment, a head: the convex hull of balls around joints.

    Attributes:
        joints: centres of the balls.
        radii_m: their radii.
        colour: BGR.
        nearer_m: sorts it in front of what lies at the same distance.
    """

    joints: list[Joint]
    radii_m: list[float]
    colour: Bgr
    nearer_m: float = 0.0


@dataclass(frozen=True)
class Shape:
    """A filled convex polygon: (N, 2) float pixels, its colour, and its distance for sorting."""

    outline: NDArray[np.float64]
    colour: Bgr
    z_m: float


class Body:
    """Joints of one stance: body coordinates (forward, left, up) to pixels and distances."""

    def __init__(self, stance: Stance, camera: GroundCamera) -> None:
        self.stance = stance
        self._camera = camera
        self.forward = np.array([cos(stance.heading_rad), sin(stance.heading_rad)])
        self._left = np.array([-self.forward[1], self.forward[0]])
        self.scale_px = camera.focal_px / stance.z_m * stance.stature
        swing, phase = stance.swing, stance.phase_rad
        self.legs = [_leg(phase, swing), _leg(phase + np.pi, swing)]
        lowest = max(-leg[2][1] for leg in self.legs)
        self.pelvis_m = lowest + ANKLE_M
        self.arms = [_arm(phase + np.pi, swing), _arm(phase, swing)]

    def world(self, joints: Points) -> Points:
        """(N, 3) forward, left, up in metres of a 1.76 m person to (N, 3) X, Z, U."""
        scaled = joints * self.stance.stature
        flat = scaled[:, :1] * self.forward + scaled[:, 1:2] * self._left
        flat += (self.stance.x_m, self.stance.z_m)
        return np.column_stack((flat, scaled[:, 2]))

    def shapes(self, parts: list[Part]) -> list[Shape]:
        """Project all parts at once: numpy's cost per call is ten times that of the arithmetic."""
        world = self.world(np.array([joint for part in parts for joint in part.joints]))
        radii = np.array([radius for part in parts for radius in part.radii_m]) * self.scale_px
        rings = self._camera.project(world)[:, None, :] + radii[:, None, None] * _CIRCLE
        points = rings.astype(np.float32).reshape(-1, 2)
        shapes, start = [], 0
        for part in parts:
            stop = start + len(part.joints)
            outline = cv2.convexHull(points[start * len(_CIRCLE) : stop * len(_CIRCLE)])
            z_m = float(world[start:stop, 1].sum()) / (stop - start) - part.nearer_m
            shapes.append(Shape(np.asarray(outline[:, 0], np.float64), part.colour, z_m))
            start = stop
        return shapes


def figure_shapes(body: Body, outfit: Outfit) -> list[Shape]:
    """All shapes of a person, farthest first."""
    parts = [*_legs(body, outfit), *_torso(body, outfit), *_arms(body, outfit)]
    parts += [*_carried(body, outfit), *_head(body, outfit)]
    return sorted(body.shapes(parts), key=lambda shape: -shape.z_m)


def silhouette(body: Body) -> tuple[Points, list[tuple[int, float]]]:
    """What casts the shadow: joints of six limbs, and for each limb how many and how thick.

    Returns:
        (N, 3) X, Z, U in metres, and (number of joints, thickness in metres) limb by limb.
    """
    pelvis, neck = body.pelvis_m, body.pelvis_m + SPINE_M
    joints: list[Joint] = [(0.0, 0.0, pelvis), (0.0, 0.0, neck)]
    joints += [(0.0, 0.0, neck), (0.02, 0.0, neck + NECK_M + HEAD_M)]
    limbs = [(2, 0.34), (2, 0.19)]
    for side, leg in zip((1, -1), body.legs, strict=True):
        joints += [(f, side * HIP_HALF_M, pelvis + u) for f, u in leg[:3]]
        limbs.append((3, 0.14))
    for side, arm in zip((1, -1), body.arms, strict=True):
        joints += [(f, side * (SHOULDER_HALF_M + 0.05), neck - 0.04 + u) for f, u in arm]
        limbs.append((3, 0.09))
    return body.world(np.array(joints)), limbs


def shade(colour: Bgr, factor: float) -> Bgr:
    """A colour made darker (factor < 1) or lighter, clipped to 0..255."""
    blue, green, red = (min(255, round(channel * factor)) for channel in colour)
    return blue, green, red


def _leg(phase: float, swing: float) -> list[tuple[float, float]]:
    """(forward, up) of hip, knee, ankle and toe, relative to the hip."""
    hip = swing * (0.38 * sin(phase) + 0.02)
    knee = swing * (0.08 + 0.85 * max(0.0, cos(phase + 0.12)))
    shank = hip - knee
    knee_f, knee_u = THIGH_M * sin(hip), -THIGH_M * cos(hip)
    ankle_f, ankle_u = knee_f + SHANK_M * sin(shank), knee_u - SHANK_M * cos(shank)
    foot = 0.55 * shank if shank < 0 else 0.5 * shank
    toe_f, toe_u = ankle_f + 0.17 * cos(foot), ankle_u + 0.17 * sin(foot) - 0.035
    return [(0.0, 0.0), (knee_f, knee_u), (ankle_f, ankle_u), (toe_f, toe_u)]


def _arm(phase: float, swing: float) -> list[tuple[float, float]]:
    """(forward, up) of shoulder, elbow and hand, relative to the shoulder."""
    upper = swing * 0.38 * sin(phase) - 0.04
    lower = upper + 0.18 + swing * (0.22 + 0.18 * sin(phase))
    elbow = (UPPER_ARM_M * sin(upper), -UPPER_ARM_M * cos(upper))
    hand = (elbow[0] + FOREARM_M * sin(lower), elbow[1] - FOREARM_M * cos(lower))
    return [(0.0, 0.0), elbow, hand]


def _legs(body: Body, outfit: Outfit) -> list[Part]:
    parts = []
    bare = outfit.cut in ("skirt", "shorts")
    for side, leg in zip((1, -1), body.legs, strict=True):
        hip, knee, ankle, toe = [(f, side * HIP_HALF_M, body.pelvis_m + u) for f, u in leg]
        heel = (ankle[0] - 0.03, ankle[1], ankle[2] - 0.03)
        far = 0.8 if side * body.forward[0] > 0 else 1.0
        cloth = shade(outfit.legs, far)
        lower = shade(outfit.skin, far) if bare else cloth
        parts.append(Part([heel, toe], [0.05, 0.035], shade(outfit.shoes, far), -0.01))
        parts.append(Part([knee, ankle], [0.068, 0.045], lower))
        parts.append(Part([hip, knee], [0.098, 0.07], cloth, 0.01))
        if not bare:
            # A lighter streak where the light falls makes a tube of a flat shape.
            lit = shade(cloth, 1.18)
            parts.append(Part([hip, knee], [0.04, 0.025], lit, 0.011))
    if outfit.cut in ("skirt", "coat"):
        knees = [body.legs[0][1], body.legs[1][1]]
        reach = 0.55 if outfit.cut == "skirt" else 0.75
        hem = [
            (f * 0.8, side * 0.10, body.pelvis_m + u * reach)
            for side, (f, u) in zip((1, -1), knees, strict=True)
        ]
        waist = [(0.0, side * 0.05, body.pelvis_m + 0.08) for side in (1, -1)]
        colour = outfit.legs if outfit.cut == "skirt" else shade(outfit.top, 0.9)
        parts.append(Part(hem + waist, [0.10, 0.10, 0.11, 0.11], colour, 0.12))
    return parts


def _torso(body: Body, outfit: Outfit) -> list[Part]:
    waist, chest = body.pelvis_m + 0.02, body.pelvis_m + SPINE_M - 0.10
    hips = [(0.0, side * 0.06, waist) for side in (1, -1)]
    shoulders = [(0.01, side * 0.115, chest) for side in (1, -1)]
    radii = [0.105, 0.105, 0.11, 0.11]
    parts = [Part(hips + shoulders, radii, outfit.top, 0.03)]
    lit = shade(outfit.top, 1.14)
    # The light comes from the left of the picture.
    edge = -0.05 * body.forward[0], 0.05 * body.forward[1]
    streak = [(edge[0], edge[1], waist + 0.06), (edge[0], edge[1] * 1.6, chest)]
    parts.append(Part(streak, [0.045, 0.055], lit, 0.031))
    if outfit.pattern == "stripes":
        for height in np.linspace(waist - 0.02, chest + 0.05, 5):
            band = [(0.0, side * 0.10, float(height)) for side in (1, -1)]
            parts.append(Part(band, [0.025, 0.025], outfit.second, 0.04))
    if outfit.pattern == "jacket" and body.forward[1] < 0.5:
        front = [(0.09, 0.0, waist + 0.04), (0.085, 0.0, chest + 0.08)]
        parts.append(Part(front, [0.018, 0.04], outfit.second, 0.05))
    belt = [(0.0, side * 0.06, waist - 0.06) for side in (1, -1)]
    if outfit.cut == "trousers":
        parts.append(Part(belt, [0.09, 0.09], shade(outfit.legs, 0.95), 0.02))
    return parts


def _arms(body: Body, outfit: Outfit) -> list[Part]:
    parts = []
    top = body.pelvis_m + SPINE_M - 0.06
    for side, arm in zip((1, -1), body.arms, strict=True):
        lateral = side * (SHOULDER_HALF_M + 0.035)
        shoulder, elbow, hand = [(f, lateral, top + u) for f, u in arm]
        far = 0.78 if side * body.forward[0] > 0 else 0.93
        sleeve = shade(outfit.top, far)
        lower = sleeve if outfit.sleeves == "long" else shade(outfit.skin, far)
        fingers = (hand[0] + 0.02, lateral, hand[2] - 0.05)
        parts.append(Part([hand, fingers], [0.036, 0.03], shade(outfit.skin, far), 0.02))
        parts.append(Part([elbow, hand], [0.046, 0.036], lower, 0.03))
        parts.append(Part([shoulder, elbow], [0.066, 0.05], sleeve, 0.04))
    return parts


def _carried(body: Body, outfit: Outfit) -> list[Part]:
    chest = body.pelvis_m + SPINE_M - 0.12
    if outfit.carries == "backpack":
        pack = [(-0.17, side * 0.07, chest - h) for side in (1, -1) for h in (0.0, 0.26)]
        pocket = [(-0.23, side * 0.05, chest - 0.22) for side in (1, -1)]
        return [
            Part(pack, [0.075] * 4, outfit.second),
            Part(pocket, [0.06] * 2, shade(outfit.second, 0.8), 0.01),
        ]
    if outfit.carries == "bag":
        hand_f, hand_u = body.arms[1][2]
        lateral, top = -SHOULDER_HALF_M - 0.06, body.pelvis_m + SPINE_M - 0.06 + hand_u
        bag = [(hand_f + df, lateral, top - du) for df in (-0.09, 0.13) for du in (0.14, 0.28)]
        return [Part(bag, [0.02] * 4, shade(outfit.shoes, 0.9), 0.05)]
    return []


def _head(body: Body, outfit: Outfit) -> list[Part]:
    base = body.pelvis_m + SPINE_M
    crown = base + NECK_M + HEAD_M
    toward = -float(body.forward[1])
    neck = [(0.0, 0.0, base - 0.03), (0.015, 0.0, base + 0.07)]
    skull = [(0.015, 0.0, crown - 0.035), (-0.005, 0.0, crown + 0.025)]
    parts = [
        Part(neck, [0.06, 0.052], shade(outfit.skin, 0.85), 0.035),
        Part(skull, [0.098, 0.1], outfit.hair, 0.06),
    ]
    if outfit.long_hair:
        fall = [(-0.05, 0.0, crown), (-0.075, 0.0, crown - 0.2)]
        parts.append(Part(fall, [0.085, 0.06], shade(outfit.hair, 0.9), 0.02))
    if toward > -0.75:
        # Seen from behind there is no face; from the side only its front half.
        ahead = 0.045 if toward < 0.5 else 0.06
        face = [(ahead + 0.01, 0.0, crown - 0.075), (ahead, 0.0, crown - 0.005)]
        size = 0.062 + 0.016 * max(0.0, toward)
        parts.append(Part(face, [size * 0.9, size], outfit.skin, 0.07))
    return parts
