"""True distances of what the camera sees, from the same scene graph.

The software renderer hands out no depth buffer. So everything is drawn once more, with one texture
in place of its own that is looked up by the distance from the camera and whose colours count.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from heel.services.simulator.render.offscreen import OffscreenCamera
from heel.services.simulator.render.panda import core

_FARTHEST_M = 12.0
"""Distances that are told; farther than depth cameras see."""
_STEPS = 4096
"""Distances that are told apart: 3 mm, a tenth of what such cameras err at 3 m."""
_OVERRIDE = 100
"""Priority over everything that is set in the scene, which sets none itself."""


class DepthView:
    """Looks through a camera at half its resolution.

    Raises:
        HeelError: the software renderer does not start.
    """

    def __init__(self, camera: OffscreenCamera) -> None:
        self._view = camera.second(_counting())

    def draw(self) -> NDArray[np.float32]:
        """(H / 2, W / 2) metres along the optical axis; 0 for what is farther than 12 m."""
        picture = self._view.draw().astype(np.int32)
        step = picture[..., 0] + 256 * picture[..., 1]
        return np.where(step > 0, (step + 0.5) * (_FARTHEST_M / _STEPS), 0).astype(np.float32)

    def close(self) -> None:
        """Give the memory back."""
        self._view.close()


def _counting() -> Any:
    """Panda3D's state by which everything has the colour of its distance."""
    count = np.arange(_STEPS)
    # Beyond the last step nothing is told.
    count[-1] = 0
    colours = np.stack([count & 255, count >> 8, 0 * count], axis=-1).astype(np.uint8)
    ramp = core.Texture("distance")
    ramp.setup_2d_texture(_STEPS, 1, core.Texture.T_unsigned_byte, core.Texture.F_rgb)
    ramp.set_ram_image(colours.tobytes())
    ramp.set_minfilter(core.SamplerState.FT_nearest)
    ramp.set_magfilter(core.SamplerState.FT_nearest)
    ramp.set_wrap_u(core.SamplerState.WM_clamp)
    ramp.set_wrap_v(core.SamplerState.WM_clamp)
    stage, holder = core.TextureStage.get_default(), core.NodePath("distance")
    holder.set_texture(ramp, _OVERRIDE)
    holder.set_light_off(_OVERRIDE)
    holder.set_color(1, 1, 1, 1, _OVERRIDE)
    holder.set_color_scale_off(_OVERRIDE)
    holder.set_transparency(core.TransparencyAttrib.M_none, _OVERRIDE)
    holder.set_tex_gen(stage, core.TexGenAttrib.M_eye_position, _OVERRIDE)
    # Along the texture goes what is ahead: Panda3D's y.
    across = core.Mat4(0, 0, 0, 0, 1 / _FARTHEST_M, 0, 0, 0, 0, 0, 0, 0, 0, 0.5, 0, 1)
    holder.set_tex_transform(stage, core.TransformState.make_mat(across))
    return holder.get_state()
