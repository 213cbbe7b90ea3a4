"""Messages that every decoder accepts and no honest service sends: extreme in every number.

They follow one another as in a stream, with what came before in mind, so that what they do adds up.
"""

from __future__ import annotations

import math
import random
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from heel.schemas import (
    Blob,
    Blobs,
    CameraInfo,
    CameraMotion,
    Evidence,
    FrameId,
    Odometry,
    Patch,
    Pointed,
    Ranges,
    RangeSector,
    TargetRequest,
    Track,
    Tracks,
)

_ODD = (
    0.0, -0.0, 5e-324, 1e-300, 1e-12, 1e-6, 0.001, 0.5, 1.0, 2.0, 10.0, 100.0, 320.5, 639.0, 640.0,
    1e3, 1e6, 999_999_999.0, 1e9, -1e9, -1.0, -0.5, -1e-9,
)  # fmt: skip
_LAST = 2**63 - 1
_SIZES = (1, 2, 3, 16, 63, 64, 480, 640, 1920, 16383, 16384)
Kind = Literal["regions", "people"]


class Extremes:
    """One hostile stream.

    Args:
        seed: equal seeds give equal streams.
    """

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.kind: Kind = "regions"
        self._epoch, self._seq, self._t_ns = 1, 0, 10**9
        self.size = (640, 480)
        self._boxes: list[tuple[float, ...]] = []

    def real(self, least: float = -1e9, most: float = 1e9) -> float:
        """Any number that schemas take in most places."""
        r = self.random
        made = r.choice(_ODD) if r.random() < 0.6 else r.uniform(-1000.0, 1000.0)
        return min(max(made, least), most)

    def share(self) -> float:
        """0 to 1."""
        return self.random.choice([0.0, 1.0, 0.5, 5e-324, 0.7, 1.0 - 2**-53, self.random.random()])

    def count(self) -> int:
        """Any count."""
        return self.random.choice([0, 1, 7, 2**31, 2**53, _LAST, self.random.randrange(10**6)])

    def size_of_anything(self) -> float:
        """0 to 1e12."""
        return self.random.choice([0.0, 5e-324, 1e-9, 1.0, 1e6, 1e12, self.random.uniform(0, 1e3)])

    def frame(self) -> dict[str, Any]:
        """The next frame: mostly the next of its epoch, now and then of anything."""
        r = self.random
        if r.random() < 0.01:
            self._epoch, self._seq = r.randrange(2**63), r.choice([0, 2**40])
        self._seq = min(self._seq + r.choice([1, 1, 1, 1, 1000]), _LAST)
        self._t_ns = min(self._t_ns + 40_000_000, _LAST)
        if r.random() < 0.1:
            self._t_ns = r.choice([0, 1, self._t_ns, 10**15, _LAST, max(0, self._t_ns - 10**9)])
        if r.random() < 0.02:
            odd = (r.choice(_SIZES), r.choice(_SIZES))
            self.size = r.choice([(640, 480), (64, 48), odd, (1, 16384), (16384, 1)])
        width, height = self.size
        return {
            "stream": "front", "epoch": self._epoch, "seq": self._seq, "index": self.count(),
            "t_capture_ns": self._t_ns, "width": width, "height": height,
            "source_width": r.choice([width, *_SIZES]), "source_height": height,
        }  # fmt: skip

    def box(self) -> tuple[float, ...]:
        """A box by the frame, often like one of before."""
        r, (width, height) = self.random, self.size
        if self._boxes and r.random() < 0.6:
            box = tuple(side + r.choice([0.0, r.gauss(0, 3)]) for side in r.choice(self._boxes))
        else:
            wide = r.choice([r.uniform(1, width), 80.0, 1e-6, 5e-324, float(width)])
            tall = r.choice([r.uniform(1, height), 200.0, 1e-6, float(height)])
            left, top = r.uniform(-wide / 2, width), r.uniform(-tall / 2, height)
            box = (left, top, left + wide, top + tall)
        self._boxes = [*self._boxes[-8:], box]
        return box

    def motion(self) -> CameraMotion | None:
        """A camera that does anything, or zooms in a little, frame after frame."""
        r = self.random
        zoom = r.choice([1.0, 1.2, 1.2, 0.8])
        kinds: list[list[float]] = [
            [zoom, 0.0, 320 * (1 - zoom), 0.0, zoom, 240 * (1 - zoom)],
            [1.0, 0.0, r.gauss(0, 30), 0.0, 1.0, r.gauss(0, 5)],
            [1.0, 0.0, self.real(), 0.0, 1.0, self.real()],
            [self.real() for _ in range(6)],
            [0.0] * 6,
        ]
        if r.random() < 0.5:
            return None
        affine = tuple(r.choice(kinds))
        return CameraMotion.model_validate({"affine": affine, "quality": self.share()})

    def patch(self) -> Patch:
        """Pixels of any shape."""
        r = self.random
        width, height = r.choice([(1, 1), (2, 1), (1, 4096), (4096, 1), (8, 16), (30, 80)])
        size = width * height * 3
        return Patch(
            width=width,
            height=height,
            bgr=r.choice([bytes(size), b"\xff" * size, r.randbytes(size)]),
        )

    def blobs(self) -> Blobs:
        """What a detector could say of the next frame."""
        r = self.random
        if r.random() < 0.05:
            self.kind = r.choice(["regions", "people"])
        fields, made = self.frame(), []
        width, height = self.size
        for _ in range(r.choice([0, 1, 1, 2, 5, 20])):
            left, top, right, bottom = self.box()
            if -width <= left < right <= 2 * width and -height <= top < bottom <= 2 * height:
                made.append(
                    Blob(
                        box_xyxy=(left, top, right, bottom), area_px=self.size_of_anything(),
                        centroid=(self.real(), self.real()), patch=self.patch(),
                        score=self.share() if self.kind == "people" else None,
                    )
                )  # fmt: skip
        sought = self.count() if self.kind == "people" and len(made) < 2 else None
        evidence = None
        if r.random() < 0.2:
            rows, columns = r.choice([(1, 1), (48, 64), (512, 2048)])
            filled = np.full((rows, columns), r.randrange(4), np.uint8)
            evidence = Evidence.from_array(filled)
        return Blobs(
            **fields, blobs=tuple(made), kind=self.kind,
            sought=sought if r.random() < 0.5 else None, blobs_left_out=self.count(),
            evidence=evidence, camera_motion=self.motion(), detector="odd",
            background=r.choice(["learning", "valid", "invalid"]),
        )  # fmt: skip

    def tracks(self) -> Tracks:
        """What a tracker could say of the next frame."""
        r, fields = self.random, self.frame()
        made = [
            {
                "id": r.choice([1, 1, 2, 3, r.randrange(1, 2**31)]),
                "state": r.choice(["tracked", "tracked", "tracked", "new", "occluded", "lost"]),
                "box_xyxy": self.box() if r.random() < 0.8 else [self.real() for _ in range(4)],
                "velocity_pxps": (self.real(), self.real()), "area_px": self.size_of_anything(),
                "span_px": self.size_of_anything(),
                "identity_confidence": 1.0 if r.random() < 0.6 else self.share(),
                "runner_up_confidence": 0.0 if r.random() < 0.6 else self.share(),
                "missed_frames": self.count(), "shown": r.random() < 0.9,
                "distance_m": r.choice([None, None, self.size_of_anything()]),
                "distance_sigma_m": r.choice([None, self.size_of_anything()]),
                "bearing_rad": r.choice([None, None, self.real()]),
                "bearing_sigma_rad": r.choice([None, self.size_of_anything()]),
            }
            for _ in range(r.choice([0, 1, 1, 2, 3, 128]))
        ]  # fmt: skip
        motion = self.motion()
        return Tracks(
            **fields, tracks=tuple(Track.model_validate(track) for track in made),
            occlusion=r.random() < 0.2, camera_motion=motion,
        )  # fmt: skip

    def info(self) -> CameraInfo:
        """What a camera could say of itself."""
        r = self.random
        return CameraInfo(
            stream="front", epoch=self._epoch, width=r.choice(_SIZES), height=r.choice(_SIZES),
            source_width=1, source_height=16384, fps=r.choice([5e-324, 25.0, 1000.0]), source="odd",
            horizontal_fov_rad=r.choice([None, 5e-324, 1e-9, 0.01, 1.0, 3.14159, 3.1415927]),
            mount_height_m=r.choice([None, 0.0, 5e-324, 1e-9, 1.0, 100.0]),
            mount_pitch_rad=r.choice([None, 0.0, math.pi / 2, -1.5707, 3.2, 1e9, self.real()]),
        )  # fmt: skip

    def odometry(self) -> Odometry:
        """What a robot could say of itself."""
        return Odometry(
            seq=self.count(), x_m=self.real(), y_m=self.real(),
            heading_rad=self.random.choice([0.0, math.pi, -math.pi, 5e-324]),
            linear_mps=self.real(), angular_radps=self.real(),
        )  # fmt: skip

    def ranges(self) -> Ranges:
        """What a lidar could see."""
        r = self.random
        far = [0.0, 5e-324, 0.3, 5.0, 1000.0, math.inf, -math.inf, math.nan]
        return Ranges(
            seq=self.count(),
            sectors=tuple(
                RangeSector(
                    bearing_rad=r.choice([0.0, math.pi, -math.pi, r.uniform(-3.1, 3.1)]),
                    width_rad=r.choice([5e-324, 1e-9, 0.1, math.pi, 2 * math.pi]),
                    distance_m=r.choice(far),
                )
                for _ in range(r.choice([0, 1, 3, 36, 720]))
            ),
        )  # fmt: skip

    def request(self) -> TargetRequest:
        """What a user could ask for."""
        r = self.random
        return TargetRequest(
            mode=r.choice(["nearest", "imprint", "none", "id", "point"]),
            track_id=r.choice([1, 2, 2**31 - 1]), x_px=self.real(), y_px=self.real(),
        )  # fmt: skip

    def picture(self) -> tuple[FrameId, NDArray[np.uint8], tuple[int, int]]:
        """A frame, its pixels (at most a million) and the size it says it had before."""
        r, fields = self.random, self.frame()
        width, height = self.size
        if width * height > 1_000_000:
            width, height = r.choice([(16384, 40), (40, 16384)])
            self.size = width, height
        grey = np.full((height, width, 3), r.randrange(256), np.uint8)
        for _ in range(r.randrange(4)):
            x, y = r.randrange(width), r.randrange(height)
            grey[y : y + 150, x : x + 60] = [r.randrange(256) for _ in range(3)]
        frame = FrameId.model_validate({key: fields[key] for key in FrameId.model_fields})
        return frame, grey, (fields["source_width"], fields["source_height"])

    def pointed(self, frame: FrameId) -> Pointed:
        """A click on anything."""
        r, (width, height) = self.random, self.size
        other = frame.model_copy(update={"epoch": self.count(), "seq": self.count()})
        return Pointed(
            frame=r.choice([frame, frame, other]), width=r.choice([width, *_SIZES]),
            height=r.choice([height, *_SIZES]), x_px=r.choice([self.real(), r.uniform(0, width)]),
            y_px=r.choice([self.real(), r.uniform(0, height)]),
        )  # fmt: skip
