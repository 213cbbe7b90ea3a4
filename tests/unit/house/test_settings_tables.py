"""Every setting of capture, drive, web, simulator, router, zenoh and log does something.

Of each a value that is not its default changes what comes of the code that reads it, or is refused
with the reason. What only a running process reads is listed with the line that reads it. A new
setting fails until it has a row. Detector, tracker and follower have tables of their own.
"""

from __future__ import annotations

import io
import json
import logging
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zenoh
from pydantic import BaseModel, ValidationError

from heel.schemas import Header, HeelError, MotionCommand
from heel.schemas.image import RAW, encode_image
from heel.services.capture.describe import mounting
from heel.services.capture.settings import CaptureSettings
from heel.services.capture.sources import open_source
from heel.services.capture.video_device import VideoDeviceFormat
from heel.services.drive.core import Drive
from heel.services.drive.drivers import open_driver
from heel.services.drive.settings import DriveServiceSettings
from heel.services.geometry.calibration_file import Calibration, write_calibration
from heel.services.geometry.lens import Lens
from heel.services.geometry.lens_file import LensFile, write_lens
from heel.services.recorder.files import Limits, RecordingFiles
from heel.services.recorder.settings import RecorderSettings
from heel.services.runtime.logs import set_up_logging
from heel.services.runtime.router import RouterSettings, router_config
from heel.services.runtime.session import zenoh_config
from heel.services.runtime.settings import (
    LogSettings,
    RobotSettings,
    ServiceSettings,
    ZenohSettings,
)
from heel.services.simulator.scenarios import scenario
from heel.services.simulator.settings import SimulatorSettings
from heel.services.simulator.truth_file import open_truth
from heel.services.web.guard import HostGuard
from heel.services.web.hub import Hub
from heel.services.web.joiner import HeldImage
from heel.services.web.picture import to_jpeg
from heel.services.web.rate import RateLimiter
from heel.services.web.server import listen
from heel.services.web.settings import WebServiceSettings, is_loopback
from tests.support.processes import REPOSITORY
from tests.support.recordings import tracks

Look = Callable[[Any], object]


@dataclass(frozen=True)
class Changes:
    """A setting at work.

    Attributes:
        value: that is not the default.
        look: what comes of settings; differs from what comes of `beside` alone.
        beside: other settings that it needs.
    """

    value: Any
    look: Look
    beside: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Refused:
    """A value that is refused, alone or by what reads it, with words of the reason."""

    value: Any
    words: str
    read: Look = lambda settings: settings
    beside: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class ReadBy:
    """A setting that only a running process reads: where, and in which words."""

    file: str
    words: str


Table = dict[str, Changes | Refused | ReadBy]


# --- What is common to all services


SHARED: Table = {
    "instance": ReadBy("runtime/service.py", "{name}/{settings.instance}@"),
    "camera": ReadBy("runtime/service.py", "= settings.camera"),
    "delivery": ReadBy("capture/service.py", 'settings.delivery == "lossless"'),
    "exit_at_end": ReadBy("runtime/service.py", "self.settings.exit_at_end"),
    "health_file": ReadBy("runtime/service.py", "HealthFile(settings.health_file)"),
    "metrics_port": ReadBy("runtime/service.py", "serving_metrics(settings.metrics_port"),
}


# --- Capture


def frames_of(settings: CaptureSettings) -> object:
    with open_source(settings.source, scale=settings.scale, fps=settings.fps,
                     loop=settings.loop) as source:  # fmt: skip
        frames = [source.read() for _ in range(3)]
    return [None if one is None else (one.index, one.media_time_s, one.image.shape,
                                      int(one.image.sum())) for one in frames]  # fmt: skip


def asked_of_a_device(settings: CaptureSettings) -> object:
    """What a camera is asked for, in the words of the service."""
    return VideoDeviceFormat(settings.camera_width, settings.camera_height,
                             fourcc=settings.camera_fourcc)  # fmt: skip


_SCENE = {"source": "scene:demo?frames=2&width=160&height=120"}
_DEVICE = "VideoDeviceFormat(s.camera_width, s.camera_height, fourcc=s.camera_fourcc)"
CAPTURE: Table = {
    "source": Changes("scene:crossing?frames=2&width=160&height=120", frames_of),
    "scale": Changes(0.5, frames_of, _SCENE),
    "fps": Changes(7.0, frames_of, _SCENE),
    "loop": Changes(True, frames_of, _SCENE),
    "camera_width": Changes(320, asked_of_a_device),
    "camera_height": Changes(200, asked_of_a_device),
    "camera_fourcc": Changes("MJPG", asked_of_a_device),
    "frames": ReadBy("capture/service.py", "self._settings.frames or math.inf"),
    "jpeg_quality": ReadBy("capture/service.py", "context.settings.jpeg_quality"),
    "await_consumers": ReadBy("capture/service.py", "context.settings.await_consumers"),
    "consumer_timeout_s": ReadBy("capture/service.py", "self._settings.consumer_timeout_s"),
    "epoch": ReadBy("capture/service.py", "context.settings.epoch"),
    "calibration": Changes("camera.toml", mounting),
    "lens": Changes("lens.yaml", mounting),
    "horizontal_fov_deg": Changes(80.0, mounting, {"calibration": "camera.toml"}),
    "mount_height_m": Changes(0.4, mounting, {"calibration": "camera.toml"}),
    "mount_pitch_deg": Changes(-5.0, mounting, {"calibration": "camera.toml"}),
    "mount_yaw_deg": Changes(180.0, mounting),
}


# --- Drive


def driven(settings: DriveServiceSettings) -> object:
    """Half a second forward and turning, half a second backward, a second without commands, a
    second forward and a stop."""
    drive, told = Drive(settings), []
    for step in range(150):
        now_s = 10.0 + 0.02 * step
        if step < 50 or 100 <= step < 130:
            forward = 3.0 if step < 25 or step >= 100 else -3.0
            command = MotionCommand(seq=step, linear_mps=forward, angular_radps=3.0, ttl_s=1.0,
                                    state="following", reason="told")  # fmt: skip
            drive.take(command, "follower/main@00000001", now_s)
        state = drive.step(now_s)
        told.append((state.state, state.linear_mps, state.angular_radps))
    return told


def driver_of(settings: DriveServiceSettings) -> object:
    with closing(open_driver(settings.driver, settings.driver_options)) as driver:
        return type(driver)


DRIVE: Table = {
    "driver": Changes("simulated", driver_of),
    "rate_hz": ReadBy("drive/service.py", "1.0 / self._context.settings.rate_hz"),
    "ttl_s": Changes(0.2, driven),
    "max_linear_mps": Changes(0.4, driven),
    "max_reverse_mps": Changes(0.1, driven),
    "max_angular_radps": Changes(0.4, driven),
    "max_linear_mps2": Changes(0.5, driven),
    "max_angular_radps2": Changes(1.0, driven),
    "braking_mps2": Changes(1.0, driven),
    "delivery": Refused("lossless", "live"),
    "driver_options": Refused("/no/such/folder/wheels.txt", "name another file", driver_of,
                              {"driver": "record"}),
    "driver_deadline_s": ReadBy("drive/service.py", "s.driver_deadline_s, s.ttl_s"),
}  # fmt: skip


# --- Web


def admitted(settings: WebServiceSettings) -> object:
    limiter = RateLimiter(settings.max_fps)
    return sum(limiter.admit(0.02 * step) for step in range(100))


def answered(settings: WebServiceSettings) -> object:
    """Whether the page may be asked for by some addresses."""
    guard = HostGuard(settings.host, settings.port, settings.names, not is_loopback(settings.host))
    return [guard.refusal({"Host": host}, "/") is None
            for host in ("localhost:8470", "127.0.0.3:8470", "localhost:9000", "robot.local:8470",
                         "192.168.1.7:8470")]  # fmt: skip


def coded(settings: WebServiceSettings) -> object:
    pixels = np.random.default_rng(2).integers(0, 255, (60, 1000, 3)).astype(np.uint8)
    header = Header(stream="front", epoch=1, seq=0, index=0, t_capture_ns=0, width=1000, height=60,
                    source_width=1000, source_height=60, image_encoding=RAW, age_ns=0,
                    producer="capture/main@00000001")  # fmt: skip
    return to_jpeg(HeldImage(header, encode_image(pixels, RAW), 0.0), settings.max_side_px,
                   settings.jpeg_quality)  # fmt: skip


def let_in(settings: WebServiceSettings) -> object:
    hub = Hub(settings.max_viewers)
    with ExitStack() as viewers:
        return sum(viewers.enter_context(hub.viewer()) is not None for _ in range(20))


WEB: Table = {
    "insecure": Changes(True, answered, {"host": "0.0.0.0"}),
    "users_file": ReadBy("web/serving.py", "Login(settings.users_file)"),
    "certificate": ReadBy("web/serving.py", "tls_context(settings.certificate"),
    "certificate_key": ReadBy("web/serving.py", "settings.certificate_key)"),
    "host": Changes("127.0.0.3", answered),
    "port": Changes(9000, answered),
    "names": Changes("robot.local", answered),
    "robots": ReadBy("web/robots_page.py", "in context.settings.robots if"),
    "max_fps": Changes(5.0, admitted),
    "max_side_px": Changes(320, coded),
    "jpeg_quality": Changes(20, coded),
    "max_viewers": Changes(2, let_in),
}


# --- Simulator


def mounted(settings: SimulatorSettings) -> object:
    return settings.mount()


def world_of(settings: SimulatorSettings) -> object:
    world = scenario(settings.scenario, settings.seed)
    return world.world_message().model_dump()


def truth_of(settings: SimulatorSettings) -> object:
    with open_truth(settings.truth):
        return None if settings.truth is None else settings.truth.exists()


SIMULATOR: Table = {
    "delivery": Refused("lossless", "live"),
    "scenario": Changes("straight", world_of),
    "seed": Changes(7, world_of),
    "perception": ReadBy("simulator/service.py", "self._settings.perception"),
    "loop": ReadBy("simulator/service.py", "self._settings.loop and context.running"),
    "truth": Changes("truth.jsonl", truth_of),
    "depth": ReadBy("simulator/service.py", "DepthPublisher(context) if s.depth else None"),
    "pictures": Refused(False, "leave out --no-pictures"),
    "jpeg_quality": ReadBy("simulator/service.py", "s.jpeg_quality"),
    "width_px": Changes(320, mounted),
    "height_px": Changes(200, mounted),
    "fps": Changes(10.0, mounted),
    "horizontal_fov_deg": Changes(60.0, mounted),
    "mount_height_m": Changes(1.1, mounted),
    "mount_pitch_deg": Changes(8.0, mounted),
}


# --- Router, zenoh and log


def of_router(settings: RouterSettings) -> object:
    return configured(router_config(settings))


def of_session(settings: ZenohSettings) -> object:
    return configured(zenoh_config(settings))


def configured(config: zenoh.Config) -> object:
    return {key: json.loads(config.get_json(key))
            for key in ("mode", "connect", "listen", "namespace", "transport")}  # fmt: skip


def wide(settings: RouterSettings) -> object:
    """What is made of an address beyond this machine."""
    try:
        return of_router(settings.model_copy(update={"listen": ("tcp/0.0.0.0:7447",)}))
    except HeelError as error:
        return str(error)


def logged(settings: LogSettings) -> object:
    stream = io.StringIO()
    log = set_up_logging(settings, "test", stream)
    log.debug("one")
    log.info("two")
    return [bool(line.startswith("{")) for line in stream.getvalue().splitlines()]


ROUTER: Table = {
    "listen": Changes("tcp/127.0.0.1:7999", of_router),
    "connect": Changes("tcp/127.0.0.1:7998", of_router),
    "insecure": Changes(True, wide),
    "users_file": Changes("users.txt", of_router),
    "shared_memory": Changes(False, of_router),
    "config_file": Changes("zenoh.json5", of_router),
}
ZENOH: Table = {
    "mode": Changes("peer", of_session),
    "connect": Changes("tcp/127.0.0.1:7999", of_session),
    "listen": Changes("tcp/127.0.0.1:7998", of_session, {"mode": "peer"}),
    "namespace": Changes("robots/r1", of_session),
    "shared_memory": Changes(False, of_session),
    "connect_timeout_s": ReadBy("runtime/session.py", "settings.connect_timeout_s"),
    "user": Refused("robot", "user and password go together"),
    "password": Changes("secret", lambda settings: settings.secret(), {"user": "robot"}),
    "password_file": Changes("password.txt", lambda settings: settings.secret(),
                             {"user": "robot"}),
    "config_file": Changes("zenoh.json5", of_session),
}  # fmt: skip


def log_files(settings: LogSettings) -> object:
    """The files that a service logs to."""
    set_up_logging(settings, "tracker", io.StringIO())
    found = [one for one in logging.getLogger().handlers if isinstance(one, logging.FileHandler)]
    for one in found:
        one.close()
    return [one.baseFilename for one in found]


LOG: Table = {
    "level": Changes("debug", logged),
    "format": Changes("text", logged),
    "folder": Changes(Path("logs"), log_files),
}
# --- Recorder


def written(settings: RecorderSettings) -> object:
    """The folders that a recording goes to."""
    files = RecordingFiles(settings.out, Limits(10**6, 60.0, 0), {}, "test")
    files.add(tracks(0), 0.0)
    files.close(1.0)
    return {path.parent.name for path in Path().rglob("*.mcap")}


RECORDER: Table = {
    "delivery": Refused("lossless", "live"),
    "out": Changes(Path("elsewhere"), written),
    "foxglove": ReadBy("recorder/service.py", "FoxgloveMessages() if s.foxglove"),
    "frames": ReadBy("recorder/service.py", "match self._context.settings.frames"),
    "file_mb": ReadBy("recorder/service.py", "s.file_mb * 10**6"),
    "file_s": ReadBy("recorder/service.py", "s.file_s"),
    "spare_mb": ReadBy("recorder/service.py", "s.spare_mb * 10**6"),
    "last_s": ReadBy("recorder/service.py", "Ring(s.last_s + AFTER_S"),
    "last_mb": ReadBy("recorder/service.py", "s.last_mb * 10**6"),
}


ROBOT: Table = {
    "stack": ReadBy("commands/observed.py", "self.lacks(where.expected"),
    "robots": ReadBy("commands/robot.py", "robot.stack), robot.robots"),
}


TABLES: dict[str, tuple[type[BaseModel], Table]] = {
    "shared": (ServiceSettings, SHARED),
    "capture": (CaptureSettings, CAPTURE),
    "drive": (DriveServiceSettings, DRIVE),
    "web": (WebServiceSettings, WEB),
    "simulator": (SimulatorSettings, SIMULATOR),
    "recorder": (RecorderSettings, RECORDER),
    "router": (RouterSettings, ROUTER),
    "zenoh": (ZenohSettings, ZENOH),
    "log": (LogSettings, LOG),
    "robot": (RobotSettings, ROBOT),
}
ROWS = [(table, name) for table, (_, rows) in TABLES.items() for name in rows]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder with the files that settings name, in which they are looked for."""
    write_calibration(
        tmp_path / "camera.toml",
        Calibration(mount_height_m=0.9, mount_pitch_deg=3.0, horizontal_fov_deg=70.0),
    )
    write_lens(
        tmp_path / "lens.yaml", LensFile(640, 480, Lens(False, (500.0, 500.0), (320.0, 240.0))), ""
    )
    (tmp_path / "users.txt").write_text("robot:secret\n")
    (tmp_path / "users.txt").chmod(0o600)
    (tmp_path / "password.txt").write_text("secret\n")
    (tmp_path / "zenoh.json5").write_text("{transport: {unicast: {max_sessions: 77}}}")
    monkeypatch.chdir(tmp_path)
    for module in ("session", "router"):
        # Whether this machine allows it is another matter.
        monkeypatch.setattr(f"heel.services.runtime.{module}.may_lock_memory", lambda: True)
    root, handlers = logging.getLogger(), list(logging.getLogger().handlers)
    level = root.level
    yield tmp_path
    root.handlers[:] = handlers
    root.setLevel(level)


@pytest.mark.parametrize("table", TABLES)
def test_every_setting_has_a_row(table: str) -> None:
    model, rows = TABLES[table]
    own = set(model.model_fields)
    if issubclass(model, ServiceSettings) and model is not ServiceSettings:
        own -= set(ServiceSettings.model_fields) - set(rows)
    assert own == set(rows)


@pytest.mark.parametrize(("table", "name"), ROWS, ids=[".".join(row) for row in ROWS])
def test_a_setting_does_something_or_is_refused(table: str, name: str, folder: Path) -> None:
    model, rows = TABLES[table]
    row = rows[name]
    if isinstance(row, ReadBy):
        source = (REPOSITORY / "services" / row.file).read_text("utf-8")
        assert row.words in source, f"{row.file} no longer reads {table}.{name} like that"
    elif isinstance(row, Refused):
        with pytest.raises((ValidationError, HeelError), match=row.words):
            row.read(model.model_validate({**row.beside, name: row.value}))
    else:
        assert row.value != model.model_fields[name].default
        changed = row.look(model.model_validate({**row.beside, name: row.value}))
        try:
            usual = row.look(model.model_validate(row.beside))
        except (ValidationError, HeelError) as error:
            usual = str(error)
        assert changed != usual


def test_what_a_camera_is_asked_for_is_what_the_service_asks() -> None:
    assert _DEVICE in (REPOSITORY / "services/capture/service.py").read_text("utf-8")


def test_a_port_of_the_page_is_the_one_that_is_bound() -> None:
    settings = WebServiceSettings(port=0)
    with closing(listen(settings.host, settings.port)) as free:
        port = free.getsockname()[1]
        assert free.getsockname()[0] == settings.host
        with pytest.raises(HeelError, match="another port"):
            listen(settings.host, port)
