"""Shadow removal, morphology and the paper's true-blob test, on drawn masks."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from schemas.blobs import FOREGROUND, SHADOW
from services.detector.components import find_regions
from services.detector.geometry import WorkSize
from services.detector.settings import DetectorSettings

PETS = WorkSize.of_frame(768, 576, 768)
PAPER = DetectorSettings(preset="paper")


@pytest.mark.parametrize(
    ("width", "height", "true"),
    [(39, 17, False), (67, 66, False), (67, 67, True), (80, 80, True)],
    ids=["663 px", "4422 px", "4489 px", "6400 px"],
)
def test_paper_threshold_is_a_hundredth_of_the_frame(width: int, height: int, true: bool) -> None:
    """Figure 1 and eq. 3: 663 is no person, above 4423 of 768x576 is."""
    evidence = np.zeros((576, 768), np.uint8)
    evidence[100 : 100 + height, 100 : 100 + width] = FOREGROUND
    settings = DetectorSettings(
        preset="paper", open_width_px=0, open_height_px=0, close_width_px=0, close_height_px=0
    )
    assert (len(find_regions(evidence, PETS, settings)) == 1) is true


def test_shadow_is_no_person() -> None:
    evidence = np.full((576, 768), SHADOW, np.uint8)
    assert find_regions(evidence, PETS, PAPER) == []
    assert find_regions(evidence, PETS, DetectorSettings()) == []


def test_opening_removes_what_is_thinner_than_its_kernel() -> None:
    evidence = np.zeros((576, 768), np.uint8)
    evidence[100:300, 100:200] = FOREGROUND
    evidence[150:152, 200:400] = FOREGROUND
    (region,) = find_regions(evidence, PETS, PAPER)
    assert region.left + region.width <= 202


def test_closing_joins_what_a_thin_gap_divides() -> None:
    evidence = np.zeros((576, 768), np.uint8)
    evidence[100:300, 100:200] = FOREGROUND
    evidence[200:203] = 0
    assert len(find_regions(evidence, PETS, PAPER)) == 1


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"thresold": 1}, "thresold"),
        ({"blur_px": 4}, "odd"),
        ({"work_width_px": 5000}, "work_width_px"),
        ({"preset": "best"}, "preset"),
    ],
    ids=str,
)
def test_wrong_settings_are_named(changes: dict[str, object], word: str) -> None:
    with pytest.raises(ValidationError, match=word):
        DetectorSettings.model_validate(changes)


def test_preset_gives_way_to_what_is_given_and_not_to_none() -> None:
    settings = DetectorSettings.model_validate(
        {"preset": "paper", "min_box_area_fraction": None, "blur_px": 7}
    )
    assert settings.min_box_area_fraction == 0.01
    assert settings.blur_px == 7
    assert settings.protect is False
