"""Cameras as their data sheets have them, and rigs of several, read from presets or files."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from ...base.arrays import Float
from ...base.files import PRESETS, preset_names, preset_path
from ...base.rotations import rotation_matrix
from ...base.schema import Finite, Model, first_repeated, quantity, read_json
from .lens import Lens, LensModel

RIGS = PRESETS / "cameras"
"""Folder of the shipped rigs."""
AXES = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Rotation from a camera's frame (x right, y down, z along its axis) to that of its mount (x forward, y left, z up)."""
_Coefficient = Annotated[float, Field(strict=True, ge=-10, le=10)]
_BORDER = 256
"""Places along each side of an image at which it is looked whether the lens's formula reaches them."""


class Camera(Model):
    """One camera of a rig: lens, sensor, shutter, and how it is mounted."""

    conditions: ClassVar[Sequence[dict[str, Any]]] = (
        {
            "if": {"properties": {"model": {"const": "equirectangular"}}, "required": ["model"]},
            "then": {"properties": {"radial": {"maxItems": 0}}},
            "else": {"required": ["focal_length_mm", "pixel_size_um"]},
        },
        {
            "if": {"properties": {"model": {"const": "fisheye"}}, "required": ["model"]},
            "else": {"properties": {"radial": {"maxItems": 3}}},
        },
    )

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9_-]*$", max_length=40, description="Folder of its images.")
    model: LensModel = Field("pinhole", description="How the lens maps rays to the image.")
    width: int = quantity(..., "px", "Pixels of a row.", (4, 32_000))
    height: int = quantity(..., "px", "Pixels of a column.", (4, 32_000))
    pixel_size_um: float | None = quantity(None, "um", "Width and height of a pixel.", (0.2, 100))
    focal_length_mm: float | None = quantity(None, "mm", "Focal length.", (0.2, 2000))
    principal_point: tuple[Finite, Finite] | None = Field(
        None, description="Place of the axis in the image, px from its upper left corner; the middle if not given."
    )
    radial: tuple[_Coefficient, ...] = Field(
        (), max_length=4, description="Radial distortion: k1, k2, k3 of a pinhole (Brown), k1 to k4 of a fisheye."
    )
    tangential: tuple[_Coefficient, _Coefficient] = Field(
        (0.0, 0.0), description="Tangential distortion of a pinhole, p1 and p2 (Brown)."
    )
    field_of_view_deg: float | None = quantity(
        None, "deg", "Full angle that the lens sees; all that its formula allows if not given.", gt=0, le=360
    )
    exposure_ms: float = quantity(1.0, "ms", "Time of exposure.", (0, 10_000))
    readout_ms: float = quantity(
        0.0, "ms", "Time from the first row's exposure to the last one's: rolling shutter.", (0, 1000)
    )
    full_well: float = quantity(10_000.0, "1", "Electrons of a full pixel.", (10, 1e6))
    read_noise: float = quantity(3.0, "1", "Noise of reading a pixel, electrons (one sigma).", (0, 1000))
    position: tuple[Finite, Finite, Finite] = Field(
        (0.0, 0.0, 0.0), description="From the scanner: forward, left and up along the platform's axes, m."
    )
    yaw_deg: float = quantity(0.0, "deg", "Direction of its axis, counter-clockwise from forward.", (-360, 360))
    pitch_deg: float = quantity(0.0, "deg", "Direction of its axis above the horizon.", (-90, 90))
    roll_deg: float = quantity(0.0, "deg", "Turn about its axis, right side down.", (-360, 360))

    @model_validator(mode="after")
    def _check_lens(self) -> Self:
        """Raise ValueError if the lens isn't complete, or its formula doesn't reach the image's edges."""
        if self.model == "equirectangular":
            if self.width != 2 * self.height:
                raise ValueError(f"an equirectangular image must be twice as wide as high (not {self.width} px)")
            if self.radial or any(self.tangential):
                raise ValueError("radial and tangential must not be given for an equirectangular image")
            return self
        if self.focal_length_mm is None or self.pixel_size_um is None:
            raise ValueError(f"focal_length_mm and pixel_size_um must be given for a {self.model} lens")
        if self.model == "pinhole" and len(self.radial) > 3:
            raise ValueError("radial must have three values at most for a pinhole: k1, k2, k3")
        if self.model == "fisheye" and any(self.tangential):
            raise ValueError("tangential must not be given for a fisheye lens")
        if self.field_of_view_deg is None and np.isnan(self.lens().rays(self._border())).any():
            raise ValueError(
                "the lens's formula doesn't reach the edges of the image: give field_of_view_deg or smaller radial"
            )
        return self

    def _border(self) -> Float:
        """Return places (2, N), px, on the border of the image."""
        share = np.linspace(0.0, 1.0, _BORDER)
        zeros, ones = np.zeros(_BORDER), np.ones(_BORDER)
        x, y = np.concatenate([share, share, zeros, ones]), np.concatenate([zeros, ones, share, share])
        return np.stack([x * self.width, y * self.height])

    def lens(self, megapixels: float | None = None) -> Lens:
        """Return the lens in front of all of the sensor's pixels, or of fewer and larger ones.

        Args:
            megapixels: largest number of pixels, in millions: the same field of view in fewer pixels; None for all.
        """
        width, height = self.width, self.height
        share = 1.0 if megapixels is None else min(1.0, math.sqrt(megapixels * 1e6 / (width * height)))
        if share < 1.0:
            height = max(2, round(height * share))
            width = 2 * height if self.model == "equirectangular" else max(2, round(self.width * share))
        scales = width / self.width, height / self.height
        focal_length = 0.0
        if self.focal_length_mm is not None and self.pixel_size_um is not None:
            focal_length = self.focal_length_mm * 1e3 / self.pixel_size_um
        middle = self.principal_point or (self.width / 2.0, self.height / 2.0)
        if self.model == "equirectangular":
            focal_length = self.width / (2.0 * math.pi)
        angle = math.pi if self.field_of_view_deg is None else math.radians(self.field_of_view_deg) / 2.0
        return Lens(
            model=self.model,
            width=width,
            height=height,
            focal=(focal_length * scales[0], focal_length * scales[1]),
            centre=(middle[0] * scales[0], middle[1] * scales[1]),
            radial=self.radial,
            tangential=self.tangential,
            largest_angle=angle,
        )

    def mounting(self) -> Float:
        """Return the rotation (3, 3) from the camera's frame to the platform's (x forward, y left, z up)."""
        return rotation_matrix(*np.deg2rad([self.yaw_deg, self.pitch_deg, self.roll_deg])) @ AXES


class CameraRig(Model):
    """Several cameras that are triggered together, from their data sheets."""

    type: Literal["CameraRig"] = "CameraRig"
    version: Literal["1.0"] = "1.0"
    title: str = Field(description="Maker and model.")
    source: str = Field(description="Where the numbers come from, and which of them are assumptions.")
    cameras: tuple[Camera, ...] = Field(min_length=1, max_length=32, description="The cameras.")

    @model_validator(mode="after")
    def _check_names(self) -> Self:
        """Raise ValueError if two cameras have one name."""
        if (name := first_repeated([camera.name for camera in self.cameras])) is not None:
            raise ValueError(f"cameras must not have the same name twice (not {name!r})")
        return self


@dataclass(frozen=True)
class MountedCamera:
    """A camera as a scan uses it.

    Attributes:
        index: of the camera in its rig.
        camera: of the rig.
        lens: in front of the pixels that are computed.
        exposure: s.
        readout: time from the first row to the last one, s; 0 for a global shutter.
        blur: whether what moves during the exposure is blurred.
    """

    index: int
    camera: Camera
    lens: Lens
    exposure: float
    readout: float
    blur: bool


def rig_names() -> list[str]:
    """Return the names of the shipped rigs, sorted."""
    return preset_names(RIGS)


def load_rig(name_or_file: str) -> CameraRig:
    """Return the rig of a preset's name or of a file.

    Raises:
        InputError: there is none, or it is inconsistent.

    Example:
        >>> [camera.name for camera in load_rig("kitti-stereo").cameras]
        ['left', 'right']
    """
    path = preset_path(RIGS, name_or_file, "scan.cameras.rig")
    return CameraRig.from_dict(read_json(path), source=str(name_or_file))
