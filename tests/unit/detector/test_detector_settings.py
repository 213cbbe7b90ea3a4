"""The settings of the detector."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from heel.services.detector.settings import DetectorSettings


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"thresold": 1}, "thresold"),
        ({"blur_px": 4}, "odd"),
        ({"work_width_px": 5000}, "work_width_px"),
        ({"preset": "best"}, "preset"),
        ({"background": "gmm"}, "background"),
    ],
    ids=str,
)
def test_wrong_settings_are_named(changes: dict[str, object], word: str) -> None:
    with pytest.raises(ValidationError, match=word):
        DetectorSettings.model_validate(changes)


def test_preset_gives_way_to_what_is_given_and_not_to_none() -> None:
    settings = DetectorSettings.model_validate(
        {"preset": "paper", "work_width_px": None, "blur_px": 7}
    )
    assert settings.work_width_px == 768
    assert settings.blur_px == 7
    assert settings.protect is False


@pytest.mark.parametrize(("preset", "background"), [("default", "auto"), ("paper", "mog2")])
def test_preset_names_the_background(preset: str, background: str) -> None:
    assert DetectorSettings.model_validate({"preset": preset}).detector == background
