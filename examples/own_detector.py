"""A detector of one's own as a process: `python own_detector.py tcp/127.0.0.1:7447`; needs schemas."""

import sys

import cv2
import zenoh

from schemas import Blob, Blobs, FrameId, Patch, encode, keys
from schemas.image import decode_image, image_header


def blobs_of(frame: FrameId, image, source_size) -> Blobs:
    """Everything that is red is a person."""
    blue, green, red = cv2.split(image)
    mask = cv2.threshold(cv2.subtract(red, cv2.max(blue, green)), 80, 255, cv2.THRESH_BINARY)[1]
    found = []
    for x, y, w, h, area in cv2.connectedComponentsWithStats(mask)[2][1:].tolist():
        if area > 200:
            found.append(Blob(box_xyxy=(x, y, x + w, y + h), area_px=area, score=0.9,
                              centroid=(x + w / 2, y + h / 2),
                              patch=Patch.from_array(image[y : y + h, x : x + w])))
    height, width = image.shape[:2]
    return Blobs(**frame.model_dump(), width=width, height=height, source_width=source_size[0],
                 source_height=source_size[1], blobs=found, kind="people", detector="red")
