"""The file that says how a camera is mounted: `heel calibrate person` writes it."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from heel.schemas import SettingsError
from heel.services.geometry.town_centre import mounting_of

if TYPE_CHECKING:
    # SciPy's fitting takes longer to load than a camera takes to open.
    from heel.services.geometry.calibrate import MountEstimate


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Made(_Strict):
    """How a calibration was made."""

    source: str = Field(description="recording or tracks file")
    person_height_m: float = Field(gt=0.5, le=2.5)
    boxes: int = Field(ge=0, description="boxes that were fitted")
    residual_px: float = Field(ge=0, description="robust standard deviation of the heads' rows")


class Calibration(_Strict):
    """How a camera is mounted."""

    mount_height_m: float = Field(gt=0, le=100, description="camera above ground")
    mount_pitch_deg: float = Field(gt=-90, lt=90, description="down is positive")
    horizontal_fov_deg: float = Field(gt=0, lt=180, description="horizontal field of view")
    made: Made | None = Field(None, description="how; none if measured by hand")


def calibration_of(estimate: MountEstimate, source: str, person_height_m: float) -> Calibration:
    """The calibration that an estimate amounts to."""
    camera = estimate.camera
    return Calibration(
        mount_height_m=round(camera.mount_height_m, 4),
        mount_pitch_deg=round(math.degrees(camera.pitch_rad), 3),
        horizontal_fov_deg=round(math.degrees(camera.horizontal_fov_rad), 3),
        made=Made(
            source=source, person_height_m=person_height_m, boxes=estimate.boxes,
            residual_px=round(estimate.residual_px, 2),
        ),
    )  # fmt: skip


def write_calibration(file: Path, calibration: Calibration) -> None:
    """Write a calibration file.

    Raises:
        SettingsError: the file cannot be written.
    """
    lines = [
        f"mount_height_m = {calibration.mount_height_m}",
        f"mount_pitch_deg = {calibration.mount_pitch_deg}",
        f"horizontal_fov_deg = {calibration.horizontal_fov_deg}",
    ]
    if (made := calibration.made) is not None:
        source = made.source.replace("\\", "\\\\").replace('"', '\\"')
        lines += [
            "", "[made]", f'source = "{source}"', f"person_height_m = {made.person_height_m}",
            f"boxes = {made.boxes}", f"residual_px = {made.residual_px}",
        ]  # fmt: skip
    try:
        file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    except OSError as error:
        raise SettingsError(f"calibration file {file}: {error.strerror}: check the path") from None


def read_calibration(file: Path) -> Calibration:
    """Read a calibration file: our TOML, or the Town Centre data set's `.ci`.

    Raises:
        SettingsError: unreadable, not of its format, an unknown key or a value out of range.
    """
    try:
        if file.suffix == ".ci":
            return _of_town_centre(file)
        return Calibration.model_validate(tomllib.loads(file.read_text(encoding="utf-8")))
    except OSError as error:
        raise SettingsError(f"calibration file {file}: {error.strerror}: check the path") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SettingsError(f"calibration file {file} is not TOML: {error}") from None
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"])
        raise SettingsError(
            f"calibration file {file}: {where}: {first['msg']}; make it with `heel calibrate "
            "person`"
        ) from None


def _of_town_centre(file: Path) -> Calibration:
    try:
        height_m, pitch_deg, fov_deg = mounting_of(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise SettingsError(f"calibration file {file} is not of Town Centre: {error}") from None
    return Calibration(
        mount_height_m=round(height_m, 4),
        mount_pitch_deg=round(pitch_deg, 3),
        horizontal_fov_deg=round(fov_deg, 3),
        made=None,
    )
