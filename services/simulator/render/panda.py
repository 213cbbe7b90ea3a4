"""Panda3D, the kept renderer, or a clear word that it is not installed."""

from __future__ import annotations

from heel.schemas.errors import HeelError

try:
    from panda3d import core
except ImportError:
    raise HeelError(
        "panda3d, which draws the simulated camera's picture, is not installed: pip install panda3d"
    ) from None

__all__ = ["core"]
