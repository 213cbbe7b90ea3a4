"""A walking person: head, torso, arms and legs that swing with the stride."""

from __future__ import annotations

import math
from typing import Any

from heel.services.simulator.postures import SHAPES, UPRIGHT
from heel.services.simulator.render import clothes
from heel.services.simulator.render.materials import texture
from heel.services.simulator.render.meshes import cube, ellipsoid, loft, node, patch
from heel.services.simulator.render.panda import core
from heel.services.simulator.render.stage import SHADOW_SORT
from heel.services.simulator.state import CARDBOARD, CARRIED_M, Colour, PersonState

_HIP = 0.53
"""Height of the joint, shares of the body's height as all of these; from the drawn canon of eight
heads."""
_THIGH = 0.255
"""Length; from the same canon."""
_SHIN = 0.235
"""Length; from the same canon."""
_SHOE = 0.045
"""Height of the ankle above the ground; thigh, shin and shoe reach from the hip to the ground."""
_SHOULDER = 0.815
"""Height of the joint; from the same canon."""
_UPPER_ARM = 0.165
"""Length; from the same canon."""
_FOREARM = 0.15
"""Length; from the same canon."""
_CARRYING_RAD = 0.5, 1.0
"""Of shoulder and elbow, forward; chosen by hand: the hands hold the sides of a box."""
_SEATED, _WHEELCHAIR = SHAPES["seated"], SHAPES["in a wheelchair"]
_LOWEST_SEAT = 0.7
"""Share of the stature; who is lower neither stands nor sits on a chair."""
_CHAIR: Colour = (44, 46, 52)
"""Frame and tyres; chosen by hand."""
_NORMAL_RADIUS_M = 0.25
"""Of a body as wide as it is drawn; others are drawn wider or narrower by the ratio."""
_FULL_STRIDE_MPS = 1.2
"""From this speed on the swing of the limbs is full; chosen by hand: a usual walk."""
_THIGH_SWING_RAD = 0.46
"""To either side in full stride, 26 degrees; chosen by hand."""
_KNEE_BEND_RAD = 0.85
"""Of the leg that swings forward, 49 degrees; chosen by hand, so that its foot clears the
ground."""
_ARM_SWING_RAD = 0.5
"""To either side in full stride; chosen by hand."""


class Figure:
    """One person's body in the scene graph.

    Args:
        person: size and clothes; where and how they walk comes with `pose`.
        weave: pattern of the clothes.
    """

    def __init__(self, person: PersonState, weave: int) -> None:
        self.root = core.NodePath(f"person-{person.id}")
        self._h = person.height_m
        self._girth = self._h * min(max(person.radius_m / _NORMAL_RADIUS_M, 0.85), 1.15)
        outfit = person.outfit
        self._skin = outfit.skin
        self._shoes = outfit.shoes
        self._top = texture("top", clothes.top(outfit, weave))
        self._sleeve = texture("sleeve", clothes.cloth(outfit.top))
        self._legs_cloth = texture("legs", clothes.cloth(outfit.legs))
        self._ground = self.root.attach_new_node("ground")
        self._cast_shadow()
        self._dress_torso()
        self._set_head(outfit.hair, texture("head", clothes.head(outfit)))
        self._legs = tuple(self._leg(side) for side in (1, -1))
        self._arms = tuple(self._arm(side) for side in (1, -1))
        self._carries = person.carries
        if self._carries:
            self._take_box()
        self._chair = self._ground.attach_new_node("chair")
        if person.wide == _WHEELCHAIR.wide:
            self._set_wheelchair()
        else:
            stool = cube((0.36, 0.36, 0.24 * self._h)).moved(-0.02, 0.0, 0.12 * self._h)
            self._part(self._chair, stool, colour=_CHAIR)

    def pose(self, person: PersonState) -> None:
        """Put the body where the person is, in the step of their stride."""
        self.root.set_pos(person.x_m, person.y_m, 0.0)
        self.root.set_h(math.degrees(person.heading_rad))
        effort = min(1.0, person.speed_mps / _FULL_STRIDE_MPS)
        sits = min(max((UPRIGHT.tall - person.tall) / (UPRIGHT.tall - _SEATED.tall), 0.0), 1.0)
        # Postures below a chair are not drawn: those people stand.
        sits *= person.tall > _LOWEST_SEAT
        effort *= sits == 0.0
        bends = []
        for phase in (person.stride_rad, person.stride_rad + math.pi):
            thigh = effort * (_THIGH_SWING_RAD * math.sin(phase) + 0.06)
            # The knee bends while its leg comes forward.
            knee = effort * (_KNEE_BEND_RAD * max(0.0, math.cos(phase + 0.35)) ** 2 + 0.05)
            bends.append((thigh + sits * math.pi / 2, knee + sits * math.pi / 2))
        # The longer reach touches the ground, whatever the step: no figure sinks or floats.
        reach = max(_reach(thigh, knee) for thigh, knee in bends)
        lower_m = sits * (_HIP - reach) * self._h
        self.root.set_z(-lower_m)
        self._ground.set_z(lower_m)
        if sits:
            self._chair.show()
        else:
            self._chair.hide()
        for (hip, knee_joint, ankle), (thigh, knee) in zip(self._legs, bends, strict=True):
            hip.get_parent().set_sz(1.0 if sits else _HIP / reach)
            hip.set_r(-math.degrees(thigh))
            knee_joint.set_r(math.degrees(knee))
            ankle.set_r(-math.degrees(0.75 * (knee - thigh)))
        for (shoulder, elbow), (thigh, _) in zip(self._arms, reversed(bends), strict=True):
            if self._carries:
                shoulder.set_r(-math.degrees(_CARRYING_RAD[0]))
                elbow.set_r(-math.degrees(_CARRYING_RAD[1]))
                continue
            swing = (thigh - sits * math.pi / 2) / _THIGH_SWING_RAD * _ARM_SWING_RAD
            shoulder.set_r(-math.degrees(swing))
            elbow.set_r(-math.degrees(0.15 + effort * 0.25 + max(0.0, swing) * 0.6))

    def _part(
        self, parent: Any, mesh: Any, cloth: Any = None, colour: Colour = (255, 255, 255)
    ) -> Any:
        shape = node("part", mesh, colour)
        if cloth is not None:
            shape.set_texture(cloth)
        shape.reparent_to(parent)
        return shape

    def _take_box(self) -> None:
        """Before the chest, as high as the forearms hold it."""
        side = CARRIED_M
        middle = 0.1 * self._h + side / 2, 0.0, 0.6 * self._h + side / 4
        self._part(self.root, cube((side, side, side)).moved(*middle), colour=CARDBOARD)

    def _set_wheelchair(self) -> None:
        for side in (-1, 1):
            wheel = ellipsoid((0.3, 0.025, 0.3), rings=8, sides=14)
            self._part(self._chair, wheel.moved(-0.05, 0.29 * side, 0.3), colour=_CHAIR)
        self._part(self._chair, cube((0.05, 0.46, 0.45)).moved(-0.22, 0.0, 0.7), colour=_CHAIR)
        self._part(self._chair, cube((0.45, 0.46, 0.05)).moved(0.02, 0.0, 0.42), colour=_CHAIR)

    def _cast_shadow(self) -> None:
        across = 1.9 * self._girth * _NORMAL_RADIUS_M
        shape = node("shadow", patch((-across, -across, 0.0), (2 * across, 0, 0),
                                     (0, 2 * across, 0), (1, 1), (2, 2)))  # fmt: skip
        shape.set_texture(texture("shadow", clothes.shadow()))
        shape.set_transparency(core.TransparencyAttrib.M_alpha)
        # Right after the floor, which it would fight with for depth.
        shape.set_bin("background", SHADOW_SORT)
        shape.set_depth_test(False)
        shape.set_depth_write(False)
        shape.set_light_off()
        shape.reparent_to(self._ground)

    def _dress_torso(self) -> None:
        h, g = self._h, self._girth
        hips = [(0.47, 0.052, 0.072, 0.0), (0.5, 0.066, 0.096, 0.0), (0.55, 0.066, 0.098, 0.0),
                (0.585, 0.058, 0.086, 0.0)]  # fmt: skip
        chest = [(0.52, 0.078, 0.113, 0.0), (0.6, 0.066, 0.09, 0.003), (0.66, 0.064, 0.094, 0.006),
                 (0.73, 0.072, 0.105, 0.006), (0.785, 0.066, 0.11, 0.002),
                 (0.82, 0.052, 0.097, -0.003), (0.842, 0.036, 0.062, -0.004),
                 (0.853, 0.026, 0.03, -0.004)]  # fmt: skip
        for sections, cloth in ((hips, self._legs_cloth), (chest, self._top)):
            scaled = [(z * h, d * g, w * g, shift * g) for z, d, w, shift in sections]
            self._part(self.root, loft(scaled, sides=14), cloth)

    def _set_head(self, hair: Colour, face: Any) -> None:
        h = self._h
        neck = [(0.83 * h, 0.032 * h, 0.032 * h, -0.004 * h), (0.9 * h, 0.03 * h, 0.03 * h, 0.0)]
        self._part(self.root, loft(neck, sides=8), colour=self._skin)
        skull = ellipsoid((0.052 * h, 0.043 * h, 0.066 * h), rings=10, sides=14)
        self._part(self.root, skull.moved(0.006 * h, 0, 0.927 * h), face)
        locks = ellipsoid((0.052 * h, 0.0465 * h, 0.05 * h), rings=8, sides=12)
        self._part(self.root, locks.moved(-0.009 * h, 0, 0.95 * h), colour=hair)

    def _leg(self, side: int) -> tuple[Any, Any, Any]:
        h, g = self._h, self._girth
        socket = self.root.attach_new_node("socket")
        socket.set_pos(0.0, side * 0.052 * g, _HIP * h)
        hip = socket.attach_new_node("hip")
        thigh = [(-_THIGH * h, 0.034 * g, 0.033 * g, 0.004 * g), (-0.12 * h, 0.044 * g, 0.043 * g,
                 0.003 * g), (0.01 * h, 0.05 * g, 0.046 * g, 0.0)]  # fmt: skip
        self._part(hip, loft(thigh, sides=9), self._legs_cloth)
        knee = hip.attach_new_node("knee")
        knee.set_z(-_THIGH * h)
        shin = [(-_SHIN * h, 0.027 * g, 0.026 * g, -0.004 * g), (-0.09 * h, 0.035 * g, 0.031 * g,
                -0.007 * g), (0.014 * h, 0.034 * g, 0.033 * g, 0.003 * g)]  # fmt: skip
        self._part(knee, loft(shin, sides=9), self._legs_cloth)
        ankle = knee.attach_new_node("ankle")
        ankle.set_z(-_SHIN * h)
        shoe = [(-_SHOE * h + 0.005 * h, 0.075 * h, 0.029 * h, 0.03 * h),
                (-0.018 * h, 0.068 * h, 0.028 * h, 0.026 * h),
                (0.006 * h, 0.03 * h, 0.025 * h, -0.004 * h)]  # fmt: skip
        self._part(ankle, loft(shoe, sides=10, flat_ends=True), colour=self._shoes)
        return hip, knee, ankle

    def _arm(self, side: int) -> tuple[Any, Any]:
        h, g = self._h, self._girth
        shoulder = self.root.attach_new_node("shoulder")
        shoulder.set_pos(-0.002 * g, side * 0.109 * g, _SHOULDER * h)
        shoulder.set_p(side * 3.0)
        upper = [
            (-_UPPER_ARM * h, 0.024 * g, 0.023 * g, 0.0), (-0.08 * h, 0.029 * g, 0.027 * g, 0.0),
            (-0.01 * h, 0.034 * g, 0.031 * g, 0.0), (0.016 * h, 0.018 * g, 0.018 * g, 0.0),
        ]  # fmt: skip
        self._part(shoulder, loft(upper, sides=8), self._sleeve)
        elbow = shoulder.attach_new_node("elbow")
        elbow.set_z(-_UPPER_ARM * h)
        lower = [(-_FOREARM * h, 0.018 * g, 0.016 * g, 0.0), (-0.04 * h, 0.024 * g, 0.023 * g, 0.0),
                 (0.008 * h, 0.023 * g, 0.022 * g, 0.0)]  # fmt: skip
        self._part(elbow, loft(lower, sides=8), self._sleeve)
        hand = ellipsoid((0.02 * h, 0.013 * h, 0.03 * h), rings=5, sides=7)
        self._part(elbow, hand.moved(0.0, 0.0, -(_FOREARM + 0.02) * h), colour=self._skin)
        return shoulder, elbow


def _reach(thigh_rad: float, knee_rad: float) -> float:
    """How far a bent leg reaches down from its hip, in body heights."""
    return _THIGH * math.cos(thigh_rad) + _SHIN * math.cos(thigh_rad - knee_rad) + _SHOE - 0.005
