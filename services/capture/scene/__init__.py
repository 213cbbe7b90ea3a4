"""A scene that Heel draws itself: people to track, with known truth and no real footage."""

from __future__ import annotations

from heel.services.capture.scene.scene import Scene, Truth
from heel.services.capture.scene.settings import SceneSettings

__all__ = ["Scene", "SceneSettings", "Truth"]
