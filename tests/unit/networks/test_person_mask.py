"""The mask of people: the one file that is read, and what it says of a person and of none."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from benchmarks.common import data_folder
from heel.schemas import SettingsError
from heel.services.networks.person_mask import PersonMask

FILE = data_folder() / "models" / "selfie_segmentation.tflite"
here = pytest.mark.skipif(not FILE.is_file(), reason="no models in HEEL_DATA")


def person(width: int = 90, height: int = 220) -> np.ndarray:
    """A figure before a lawn: head, shirt, arms and trousers."""
    image = np.full((height, width, 3), (70, 140, 90), np.uint8)
    rng = np.random.default_rng(3)
    image = np.clip(image + rng.normal(0, 6, image.shape), 0, 255).astype(np.uint8)
    x = width // 2
    cv2.ellipse(image, (x, 40), (13, 17), 0, 0, 360, (120, 150, 205), -1)
    cv2.ellipse(image, (x, 30), (14, 12), 0, 180, 360, (30, 40, 60), -1)
    cv2.rectangle(image, (x - 22, 58), (x + 22, 128), (60, 40, 170), -1)
    cv2.rectangle(image, (x - 18, 128), (x - 2, 208), (90, 60, 40), -1)
    cv2.rectangle(image, (x + 2, 128), (x + 18, 208), (90, 60, 40), -1)
    return image


@here
def test_a_figure_is_in_the_mask_and_the_ground_is_not() -> None:
    mask = PersonMask(FILE)
    figure, ground = person(), person()
    ground[:] = ground[:8].mean(axis=(0, 1)).astype(np.uint8)
    found = mask.of(figure)
    assert found.shape == figure.shape[:2]
    assert found.dtype == np.float32
    assert 0.0 <= found.min() <= found.max() <= 1.0
    assert found[70:120, 38:52].mean() > 0.6, "the shirt"
    assert found[:, :8].mean() < 0.2, "beside the figure"
    assert mask.of(ground).mean() < 0.05
    assert mask.of(figure).tobytes() == found.tobytes()


def test_another_file_is_refused_with_a_line(tmp_path: Path) -> None:
    other = tmp_path / "other.tflite"
    with pytest.raises(SettingsError, match="no such file"):
        PersonMask(other)
    for content in (b"", b"\x1c\0\0\0TFL3\0\0", b"\0" * 249_505):
        other.write_bytes(content)
        with pytest.raises(SettingsError, match="another network; get it again") as refused:
            PersonMask(other)
        assert "\n" not in str(refused.value)
