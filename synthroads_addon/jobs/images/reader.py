"""Images of a job read back from their folder: where points of the cloud are seen, and what each pixel shows."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
from PIL import Image as Picture

from ...base.arrays import AnyArray, Float
from ...base.errors import InputError
from ...base.rotations import quaternion_matrices
from ...base.schema import read_json
from ...scanning.cameras.choice import IMAGE_LAYERS, ImageLayer
from ...scanning.cameras.lens import Lens


@dataclass(frozen=True)
class TakenImage:
    """One image of a job.

    Attributes:
        folder: of the job's images.
        camera: name of the camera.
        exposure: number of the exposure.
        time: of the middle of the exposure, as ``gps_time`` of points, s.
        lens: of the camera.
        position: (3,) measured place of the optical centre, map, m.
        rotation: (3, 3) measured, from the camera's frame (x right, y down, z along the axis) to the map's axes.
        files: path of the file of each layer, from the folder.
    """

    folder: Path
    camera: str
    exposure: int
    time: float
    lens: Lens
    position: Float
    rotation: Float
    files: dict[str, str]

    def project(self, xyz: Float) -> tuple[Float, Float]:
        """Return where points (N, 3) of the map are seen: places (N, 2), px, NaN where not; and distances (N,), m."""
        point = (xyz - self.position) @ self.rotation
        return self.lens.project(point.T).T, np.asarray(np.linalg.norm(point, axis=1))

    def points(self, place: Float, distance: Float) -> Float:
        """Return the map coordinates (N, 3) of what is seen at places (N, 2), px, at distances (N,), m."""
        return np.asarray(self.position + distance[:, None] * (self.lens.rays(place.T).T @ self.rotation.T))

    def layer(self, name: ImageLayer) -> AnyArray:
        """Return the pixels (H, W, ...) of a layer: rgb, depth (m), normal, class or instance (numbers).

        Raises:
            InputError: the job wrote no such layer.
        """
        if name not in self.files:
            raise InputError("layer", name, f"must be one of {', '.join(self.files)}, which the job wrote")
        path = self.folder / self.files[name]
        if name == "normal":
            import OpenEXR  # large, and rarely needed

            with OpenEXR.File(str(path)) as file:
                return np.asarray(file.channels()["RGB"].pixels)
        pixels = np.array(Picture.open(path))
        if name != "instance":
            return pixels
        return np.asarray(pixels.astype(np.uint32) @ np.array([1, 1 << 8, 1 << 16], np.uint32))


def read_images(folder: Path) -> list[TakenImage]:
    """Return the images in a job's folder ``images``, in the order in which they were taken.

    Raises:
        InputError: there is no ``images.json`` in it.
    """
    content = read_json(folder / "images.json")
    lenses = {row["name"]: _lens(row) for row in content["cameras"]}
    return [
        TakenImage(
            folder=folder,
            camera=row["camera"],
            exposure=row["exposure"],
            time=row["time"],
            lens=lenses[row["camera"]],
            position=np.array(row["position_map"]),
            rotation=quaternion_matrices(np.array([row["quaternion"]]))[0],
            files={name: row["files"][name] for name in IMAGE_LAYERS if name in row["files"]},
        )
        for row in content["images"]
    ]


def _lens(row: dict[str, Any]) -> Lens:
    """Return the lens that a camera's entry describes."""
    tangential = cast(tuple[float, float], tuple(row["tangential"]))
    size = (row["model"], row["width"], row["height"])
    limits = float(np.deg2rad(row["largest_angle_deg"]))
    return Lens(*size, tuple(row["focal"]), tuple(row["centre"]), tuple(row["radial"]), tangential, limits)
