"""The numbers of the MOG2 path: as printed in the paper, and as found best with protection."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Mog2Numbers:
    """Sizes in working pixels; a size of 0 leaves its step out.

    Attributes:
        history_frames: memory of the background model.
        variance_threshold: squared Mahalanobis distance that makes a pixel foreground.
        learning_frames: frames after a start during which the background is not believed.
        median_px: median filter over the pixel labels: 0, 3 or 5.
        shadow_fill_fraction: shadow between foreground above and below is a person again, up to
            this share of the frame height.
        open_px: width and height of the opening.
        close_px: width and height of the closing.
        min_box_area_fraction: true-blob test, box area over frame area.
        min_height_fraction: true-blob test, box height over frame height.
        min_fill: true-blob test, foreground pixels over box area.
        protect_margin: protected boxes grow by this share of their size on each side.
        protect_still_s: a track on one spot for longer is learned after all.
        tells_motion: whether MOVING is told from FOREGROUND.
    """

    history_frames: int = 500
    variance_threshold: float = 16.0
    learning_frames: int = 25
    median_px: int = 5
    shadow_fill_fraction: float = 0.04
    open_px: tuple[int, int] = (0, 0)
    close_px: tuple[int, int] = (3, 9)
    min_box_area_fraction: float = 0.0012
    min_height_fraction: float = 0.07
    min_fill: float = 0.2
    protect_margin: float = 0.15
    protect_still_s: float = 10.0
    tells_motion: bool = True


COMPOSITE = Mog2Numbers()

PAPER = Mog2Numbers(
    median_px=0,
    shadow_fill_fraction=0.0,
    open_px=(3, 3),
    close_px=(5, 5),
    min_box_area_fraction=0.01,
    min_height_fraction=0.0,
    min_fill=0.0,
    tells_motion=False,
)
"""As printed where the paper prints a number (eq. 3; full 768x576 frames); OpenCV's own defaults
for MOG2 where it does not."""
