"""A drawn scene as a frame source: `scene:NAME?seed=1&people=6&frames=400`."""

from __future__ import annotations

from urllib.parse import parse_qsl

from pydantic import ValidationError

from heel.schemas.errors import SourceError
from heel.services.capture.scene import Scene, SceneSettings
from heel.services.capture.source import Frame, FrameSource

SCENE_PREFIX = "scene:"


class SceneSource(FrameSource):
    """A scene played once.

    Attributes:
        scene: for its truth.
    """

    def __init__(self, scene: Scene, name: str) -> None:
        self.scene, self.name = scene, name
        self.width, self.height = scene.settings.width, scene.settings.height
        self.fps, self.frame_count = scene.settings.fps, scene.frame_count
        self._count = scene.frame_count
        self._next = 0

    def read(self, timeout_s: float = 5.0) -> Frame | None:
        """The next frame, None after the last."""
        if self._next >= self._count or self.end_reason:
            self.end_reason = self.end_reason or "end of scene"
            return None
        index = self._next
        self._next += 1
        image = self.scene.frame(index)
        return Frame(image, index, index / self.fps, self.width, self.height)

    def close(self) -> None:
        """Stop delivering."""
        self.end_reason = self.end_reason or "closed"


def open_scene(spec: str) -> SceneSource:
    """Open `scene:NAME?key=value&...`; the keys are those of `SceneSettings`.

    Raises:
        SourceError: the scene or a key is unknown, or a value is out of range.
    """
    return SceneSource(Scene(parse_scene(spec)), spec)


def parse_scene(spec: str) -> SceneSettings:
    """The settings that `scene:NAME?...` stands for.

    Raises:
        SourceError: the scene or a key is unknown, or a value is out of range.
    """
    name, _, query = spec.removeprefix(SCENE_PREFIX).partition("?")
    try:
        pairs = parse_qsl(query, keep_blank_values=True, strict_parsing=bool(query))
        return SceneSettings.model_validate({**dict(pairs), "name": name or "demo"})
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"]))
        known = ", ".join(SceneSettings.model_fields)
        raise SourceError(
            f"{spec}: {key}={first['input']!r}: {first['msg']}; the keys are {known}"
        ) from None
    except ValueError:
        raise SourceError(f"{spec}: give key=value pairs, as in scene:demo?seed=2") from None
