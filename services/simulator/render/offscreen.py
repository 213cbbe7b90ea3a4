"""A camera without a display: Panda3D's software renderer into memory."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from heel.schemas.errors import HeelError
from heel.services.simulator.render.panda import core
from heel.services.simulator.state import CameraMount

_SETTINGS = """
load-display p3tinydisplay
window-type offscreen
audio-library-name null
textures-power-2 up
support-threads false
notify-level error
"""
_NEAR_M = 0.05
"""Nearest that is drawn: within the robot's own body."""
_FAR_M = 150.0
"""Farthest that is drawn: beyond the horizon's drum."""


class OffscreenCamera:
    """A pinhole with square pixels that draws a scene graph into an array.

    Args:
        mount: size and field of view.
        supersampling: pixels drawn per pixel of the picture and axis; they are averaged, which is
            what keeps edges and far texture from crawling.

    Attributes:
        root: node under which everything to be drawn is put.

    Raises:
        HeelError: the software renderer does not start.
    """

    def __init__(self, mount: CameraMount, supersampling: float) -> None:
        self._size = mount.width_px, mount.height_px
        drawn = round(mount.width_px * supersampling), round(mount.height_px * supersampling)
        self._canvas = _canvas(drawn)
        self.root = core.NodePath("world")
        # In the order of the graph: sorted by memory addresses, as by default, surfaces of equal
        # depth would hide each other now so, now so.
        self.root.set_bin("unsorted", 0)
        lens = core.PerspectiveLens()
        lens.set_aspect_ratio(mount.width_px / mount.height_px)
        lens.set_fov(math.degrees(mount.horizontal_fov_rad))
        lens.set_near_far(_NEAR_M, _FAR_M)
        self._camera = self.root.attach_new_node(core.Camera("camera", lens))
        self._canvas.region.set_camera(self._camera)

    def place(self, position_m: tuple[float, float, float], heading_rad: float, pitch_rad: float
              ) -> None:  # fmt: skip
        """Put the camera somewhere; heading 0 looks along x, left and down are positive."""
        # Panda3D's cameras look along y.
        self._camera.set_pos_hpr(
            *position_m, math.degrees(heading_rad) - 90.0, -math.degrees(pitch_rad), 0.0
        )

    def second(self, state: Any) -> SecondView:
        """What the same camera sees at half the resolution in another state of Panda3D's.

        Args:
            state: that overrides what is set in the scene.
        """
        return SecondView(self._camera, (self._size[0] // 2, self._size[1] // 2), state)

    def draw(self) -> NDArray[np.uint8]:
        """The picture, (H, W, 3) uint8 BGR."""
        picture = self._canvas.draw()
        if self._canvas.size == self._size:
            return picture
        return np.asarray(cv2.resize(picture, self._size, interpolation=cv2.INTER_AREA), np.uint8)

    def close(self) -> None:
        """Give the memory back."""
        self.root.remove_node()
        _give_back(self._canvas)


class SecondView:
    """A camera that goes with another one, and draws what that one sees in another way."""

    def __init__(self, beside: Any, size_px: tuple[int, int], state: Any) -> None:
        self._canvas = _canvas(size_px)
        self._camera = beside.attach_new_node(
            core.Camera("second", _at_middles(beside.node().get_lens(), size_px))
        )
        self._camera.node().set_initial_state(state)
        self._canvas.region.set_camera(self._camera)

    def draw(self) -> NDArray[np.uint8]:
        """The picture, (H, W, 3) uint8, each pixel of one place: nothing is averaged."""
        return self._canvas.draw()

    def close(self) -> None:
        """Give the memory back."""
        self._camera.remove_node()
        _give_back(self._canvas)


class _Canvas:
    """A buffer of the software renderer, and what draws into it.

    Raises:
        HeelError: the software renderer does not start.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        core.load_prc_file_data("", _SETTINGS)
        self.size = size
        self._engine = core.GraphicsEngine()
        pipe = core.GraphicsPipeSelection.get_global_ptr().make_pipe(
            "TinyOffscreenGraphicsPipe", "p3tinydisplay"
        )
        kind = core.FrameBufferProperties()
        kind.set_rgb_color(True)
        kind.set_depth_bits(24)
        self._buffer = pipe and self._engine.make_output(
            pipe, "camera", 0, kind, core.WindowProperties.size(*size),
            core.GraphicsPipe.BF_refuse_window,
        )  # fmt: skip
        if not self._buffer:
            raise HeelError(
                "panda3d's software renderer (p3tinydisplay) does not start: install libX11 "
                "(apt install libx11-6), or panda3d anew with pip install --force-reinstall"
            )
        self._pixels = core.Texture("pixels")
        self._buffer.add_render_texture(self._pixels, core.GraphicsOutput.RTM_copy_ram)
        self.region = self._buffer.make_display_region()

    def draw(self) -> NDArray[np.uint8]:
        """What the region's camera sees, (H, W, 3) uint8 BGR."""
        self._engine.render_frame()
        width, height = self.size
        data = np.frombuffer(self._pixels.get_ram_image(), np.uint8)
        rows, columns = self._pixels.get_y_size(), self._pixels.get_x_size()
        # Rows come from the bottom up, with an unused fourth channel.
        flipped = data.reshape(rows, columns, 4)[:height, :width][::-1]
        return np.asarray(cv2.cvtColor(flipped, cv2.COLOR_BGRA2BGR), np.uint8)

    def forget(self) -> None:
        """Let go of everything that was drawn."""
        self.region.set_camera(core.NodePath())
        self._buffer.get_gsg().get_prepared_objects().release_all()
        # Panda3D's caches hold on to states, and these to textures: 15 MB a scenery (measured).
        core.RenderState.clear_cache()
        core.TransformState.clear_cache()
        core.RenderState.garbage_collect()
        core.TransformState.garbage_collect()


_idle: dict[tuple[int, int], list[_Canvas]] = {}
"""Canvases to be used again: Panda3D never frees a buffer of its software renderer (5 MB each at
640x480, measured), which would add up where every episode opens a camera of its own."""


def _canvas(size_px: tuple[int, int]) -> _Canvas:
    idle = _idle.get(size_px)
    return idle.pop() if idle else _Canvas(size_px)


def _give_back(canvas: _Canvas) -> None:
    canvas.forget()
    _idle.setdefault(canvas.size, []).append(canvas)


def _at_middles(lens: Any, size_px: tuple[int, int]) -> Any:
    """The lens shifted by half a pixel: the renderer draws a row as it is at its lower edge.

    Where nothing is averaged that is 4 % of the distance of a floor 10 m away (measured). As much
    is left there in places, as corners of surfaces are put on whole pixels.
    """
    shifted, film = lens.make_copy(), lens.get_film_size()
    shifted.set_film_offset(0.0, film[1] / (2 * size_px[1]))
    return shifted
