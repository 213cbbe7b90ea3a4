"""Morphology and the paper's true-blob test, on drawn masks."""

from __future__ import annotations

import numpy as np
import pytest

from heel.schemas.blobs import FOREGROUND, SHADOW
from heel.services.detector.mog2 import true_blobs
from heel.services.detector.scene import WorkSize

PETS = WorkSize.of_frame(768, 576, 768)


@pytest.mark.parametrize(
    ("width", "height", "true"),
    [(39, 17, False), (67, 66, False), (67, 67, True), (80, 80, True)],
    ids=["663 px", "4422 px", "4489 px", "6400 px"],
)
def test_paper_threshold_is_a_hundredth_of_the_frame(width: int, height: int, true: bool) -> None:
    """Figure 1 and eq. 3: 663 is no person, above 4423 of 768x576 is."""
    evidence = np.zeros((576, 768), np.uint8)
    evidence[100 : 100 + height, 100 : 100 + width] = FOREGROUND
    assert (len(true_blobs(evidence, PETS)) == 1) is true


def test_shadow_is_no_person() -> None:
    evidence = np.full((576, 768), SHADOW, np.uint8)
    assert true_blobs(evidence, PETS) == []


def test_opening_removes_what_is_thinner_than_its_kernel() -> None:
    evidence = np.zeros((576, 768), np.uint8)
    evidence[100:300, 100:200] = FOREGROUND
    evidence[150:152, 200:400] = FOREGROUND
    (region,) = true_blobs(evidence, PETS)
    assert region.left + region.width <= 202


def test_closing_joins_what_a_thin_gap_divides() -> None:
    evidence = np.zeros((576, 768), np.uint8)
    evidence[100:300, 100:200] = FOREGROUND
    evidence[200:203] = 0
    assert len(true_blobs(evidence, PETS)) == 1
