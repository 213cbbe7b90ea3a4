"""The outline of a person: one body, and legs as they are seen."""

from __future__ import annotations

import numpy as np

from heel.services.geometry.silhouette import LEGS_OF_WALKERS, LEGS_TOGETHER, Outline


def test_the_outline_ends_at_head_and_feet() -> None:
    outline = Outline(LEGS_TOGETHER, beyond=0.03, outside=-0.2)
    down = np.array([-1.0, -0.03, 0.0, 0.35, 1.0, 1.03, 2.0])
    assert outline.half_width(down).tolist() == [-0.2, -0.2, 0.08, 0.42, 0.25, -0.2, -0.2]


def test_legs_differ_below_the_knee_only() -> None:
    down = np.linspace(0.0, 1.0, 101)
    walking, standing = (
        Outline(legs, beyond=0.05, outside=0.0).half_width(down)
        for legs in (LEGS_OF_WALKERS, LEGS_TOGETHER)
    )
    assert (walking == standing)[down <= 0.65].all()
    assert (walking > standing)[down > 0.66].all()
    assert 0.0 < walking.min() < walking.max() < 0.5
