"""Pictures as textures of the renderer."""

from __future__ import annotations

from typing import Any

import numpy as np

from heel.services.simulator.render.noise import Picture
from heel.services.simulator.render.panda import core


def texture(name: str, picture: Picture) -> Any:
    """A repeating texture with mipmaps from an RGB or RGBA picture with sides of powers of two."""
    height, width, channels = picture.shape
    made = core.Texture(name)
    form = core.Texture.F_rgba if channels == 4 else core.Texture.F_rgb
    made.setup_2d_texture(width, height, core.Texture.T_unsigned_byte, form)
    order = [2, 1, 0, 3][:channels]
    # The renderer wants rows from the bottom up and blue first.
    made.set_ram_image(np.ascontiguousarray(picture[::-1, :, order]).tobytes())
    made.set_wrap_u(core.SamplerState.WM_repeat)
    made.set_wrap_v(core.SamplerState.WM_repeat)
    made.set_minfilter(core.SamplerState.FT_linear_mipmap_linear)
    made.set_magfilter(core.SamplerState.FT_linear)
    return made
