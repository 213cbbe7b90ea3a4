"""A detector of one's own as a process: `python own_detector.py tcp/127.0.0.1:7447 front`."""

import json
import secrets
import sys
import time

import cv2
import numpy as np
import zenoh

from heel.schemas import Blob, Blobs, EndOfStream, Header, Patch, Stamp, decode, encode, keys
from heel.schemas.image import decode_image


def detect(header: Header, image: np.ndarray) -> Blobs:
    """Whatever is red is a person."""
    blue, green, red = cv2.split(image)
    x, y, w, h = cv2.boundingRect((cv2.subtract(red, cv2.max(blue, green)) > 80).astype(np.uint8))
    patch = Patch.from_array(image[y : y + h, x : x + w]) if w else None
    box, centre = (x, y, x + w, y + h), (x + w / 2, y + h / 2)
    people = (
        [Blob(box_xyxy=box, area_px=w * h, centroid=centre, patch=patch, score=0.9)] if w else []
    )
    frame = header.model_dump(exclude={"v", "image_encoding", "producer", "age_ns"})
    return Blobs(**frame, blobs=people, kind="people", detector="red")


config, producer = zenoh.Config(), f"detector/red@{secrets.token_hex(4)}"
config.insert_json5("mode", json.dumps("client"))
config.insert_json5("connect/endpoints", json.dumps([sys.argv[1]]))
with zenoh.open(config) as session:
    out = session.declare_publisher(keys.blobs(sys.argv[2]))
    images = session.declare_subscriber(keys.image(sys.argv[2]), zenoh.handlers.RingChannel(1))
    for sample in images:
        arrived_s, encoding = time.monotonic(), str(sample.encoding)
        if encoding == EndOfStream.encoding():
            out.put(sample.payload, encoding=encoding)
            break
        header = decode(Header, sample.attachment.to_bytes())
        blobs = detect(header, decode_image(sample.payload.to_bytes(), header, encoding))
        age_ns = header.age_ns + round(1e9 * (time.monotonic() - arrived_s))
        stamp = Stamp(producer=producer, t_sent_ns=time.time_ns(), age_ns=age_ns)
        out.put(encode(blobs), encoding=blobs.encoding(), attachment=encode(stamp))
