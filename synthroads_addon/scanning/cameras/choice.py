"""Cameras of a scan: which rig, when it is triggered, and what is written of each image."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from ...base.errors import InputError
from ...base.schema import ClosedModel, notes, quantity
from .rig import CameraRig, MountedCamera

ImageLayer = Literal["rgb", "depth", "normal", "class", "instance"]
IMAGE_LAYERS: tuple[ImageLayer, ...] = ("rgb", "depth", "normal", "class", "instance")


class CameraChoice(ClosedModel):
    """Choice of the cameras beside the scanner, their trigger and their images."""

    conditions: ClassVar[Sequence[dict[str, Any]]] = (
        {
            "if": {"properties": {"point_colours": {"const": "images"}}, "required": ["point_colours"]},
            "then": {"properties": {"layers": {"contains": {"const": "rgb"}}}},
        },
    )

    rig: str = Field("ladybug5-plus", title="Rig", description="Rig of cameras: a preset or a file.")
    trigger: Literal["distance", "time"] = Field(
        "distance",
        description="Whether all cameras are triggered after a distance or a time.",
        json_schema_extra=notes(labels={"distance": "By Distance", "time": "By Time"}),
    )
    spacing: float = quantity(
        5.0,
        "m",
        "Distance between two exposures.",
        (0.01, 10_000),
        title="Every (m)",
        only_with={"trigger": ("distance",)},
    )
    interval: float = quantity(
        0.5, "s", "Time between two exposures.", (0.001, 10_000), title="Every (s)", only_with={"trigger": ("time",)}
    )
    megapixels: float | None = quantity(
        None,
        "1",
        "Largest number of pixels of an image, in millions: the same field of view in fewer pixels.",
        (1e-4, 1000),
        unset="The sensor's",
    )
    layers: Annotated[tuple[ImageLayer, ...], Field(min_length=1)] = Field(
        IMAGE_LAYERS,
        title="Image Files",
        description="What is written of each image.",
        json_schema_extra=notes(
            labels={
                "rgb": "Picture",
                "depth": "Depth",
                "normal": "Normals",
                "class": "Classes",
                "instance": "Instances",
            }
        ),
    )
    picture: Literal["png", "jpeg"] = Field(
        "png",
        description="File format of the pictures.",
        json_schema_extra=notes(labels={"png": "PNG", "jpeg": "JPEG"}),
    )
    samples: int = quantity(4, "1", "Rays of each pixel's colour.", (1, 256), title="Rays per Pixel")
    farthest: float = quantity(300.0, "m", "Distance beyond which a camera sees the sky.", (1, 10_000))
    exposure_ms: float | None = quantity(
        None,
        "ms",
        "Time of exposure; the camera's if not given.",
        (0, 10_000),
        title="Exposure (ms)",
        unset="The camera's",
    )
    auto_exposure: bool = Field(
        True, description="Expose each image for its own brightness, by two stops at most; else all images alike."
    )
    exposure_compensation: float = quantity(
        0.0, "1", "Brighter (+) or darker (-) by so many stops.", (-10, 10), title="Stops Brighter"
    )
    noise: float = quantity(1.0, "1", "Factor on the noise of the sensor; 0 is none.", (0, 100), title="Image Noise")
    motion_blur: bool = Field(False, description="Blur what moves during the exposure.")
    rolling_shutter: bool = Field(
        False, description="Expose row after row, in the time that the camera's sensor takes."
    )
    boresight_sigma_deg: float = quantity(
        0.0,
        "deg",
        "Error of each camera's direction against the navigation, each axis (one sigma).",
        (0, 5),
        title="Boresight (°)",
    )
    lever_arm_sigma: float = quantity(
        0.0,
        "m",
        "Error of each camera's place against the navigation, each axis (one sigma).",
        (0, 5),
        title="Lever Arm",
    )
    point_colours: Literal["exact", "images"] = Field(
        "exact",
        description="Points have the colours of their own places, or those of the images in which they are seen.",
        json_schema_extra=notes(labels={"exact": "Of Their Places", "images": "From Images"}),
    )

    @model_validator(mode="after")
    def _check_colours(self) -> Self:
        """Raise ValueError if points take colours of pictures that aren't made."""
        if self.point_colours == "images" and "rgb" not in self.layers:
            raise ValueError("layers must contain rgb where point_colours is images")
        return self

    def mounted(self, rig: CameraRig) -> list[MountedCamera]:
        """Return the cameras of a rig with this choice's pixels, exposure and shutter.

        Raises:
            InputError: a rolling shutter is asked for, and no camera of the rig takes time to read its rows.
        """
        if self.rolling_shutter and not any(camera.readout_ms for camera in rig.cameras):
            text = "no camera of the rig has one: give them readout_ms in a rig file of your own, or make it false"
            raise InputError("scan.cameras.rolling_shutter", True, text)
        return [
            MountedCamera(
                index=index,
                camera=camera,
                lens=camera.lens(self.megapixels),
                exposure=1e-3 * (camera.exposure_ms if self.exposure_ms is None else self.exposure_ms),
                readout=1e-3 * camera.readout_ms if self.rolling_shutter else 0.0,
                blur=self.motion_blur,
            )
            for index, camera in enumerate(rig.cameras)
        ]
