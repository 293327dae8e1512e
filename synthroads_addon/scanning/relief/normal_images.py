"""Slopes of surfaces as normal images say, at points, each over its beam's footprint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...base.arrays import AnyArray, Float, Float32, Index
from .pavement import PavementRelief

_STEEPEST = 0.1
"""Least share of a normal's upward part: beyond it slopes would have no end; the materials' nodes have the same."""


@dataclass(frozen=True)
class NormalImage:
    """A normal image that is repeated over a surface.

    Attributes:
        levels: tilts (H, W, 2) of the normals to the image's right and upwards, for an upward part of 1, lowest row
            first; each level is the mean of two by two pixels of the one before.
        tile: length that the image's width covers, m.
        along: whether it lies by station and offset on pavements, else by the place in the world.
    """

    levels: tuple[Float32, ...]
    tile: float
    along: bool

    @classmethod
    def of(cls, pixels: Float, tile: float, along: bool) -> NormalImage:
        """Return the image of pixels (H, W, 3), 0 to 1, lowest row first: tangential normals, green upwards."""
        normal = 2.0 * pixels - 1.0
        level = (normal[..., :2] / np.maximum(normal[..., 2:], _STEEPEST)).astype(np.float32)
        levels = [level]
        while min(level.shape[:2]) > 1:
            even = level[: level.shape[0] // 2 * 2, : level.shape[1] // 2 * 2]
            level = even.reshape(even.shape[0] // 2, 2, even.shape[1] // 2, 2, 2).mean(axis=(1, 3), dtype=np.float32)
            levels.append(level)
        return cls(tuple(levels), tile, along)

    def tilts(self, place: Float, footprint: Float) -> Float:
        """Return the tilts (N, 2) at places (N, 2) along the image's width and height, m.

        Args:
            place: from its lower left corner.
            footprint: (N,) width over which tilts are averaged, m.
        """
        pixel = self.tile / self.levels[0].shape[1]
        number = np.rint(np.log2(np.maximum(footprint / pixel, 1.0))).astype(np.intp)
        number = np.minimum(number, len(self.levels) - 1)
        result = np.empty((len(place), 2))
        for level in np.unique(number).tolist():
            rows = np.flatnonzero(number == level)
            result[rows] = _interpolate(self.levels[level], place[rows] / (pixel * 2.0**level))
        return result


def _interpolate(image: Float32, place: Float) -> Float:
    """Return the values (N, C) of a repeated image (H, W, C) at places (N, 2) in pixels from its corner, bilinear."""
    corner = np.floor(place - 0.5)
    share = place - 0.5 - corner
    column, row = (corner[:, axis].astype(np.int64) for axis in range(2))
    height, width = image.shape[:2]
    result = np.zeros((len(place), image.shape[2]))
    for right, x in ((0, 1.0 - share[:, 0]), (1, share[:, 0])):
        for up, y in ((0, 1.0 - share[:, 1]), (1, share[:, 1])):
            result += (x * y)[:, None] * image[(row + up) % height, (column + right) % width]
    return result


@dataclass(frozen=True)
class NormalImages:
    """Normal images of a scene's materials.

    Attributes:
        images: by the material's index.
        pavement: of the road, whose station and offset some images follow; None without a road.
    """

    images: Mapping[int, NormalImage]
    pavement: PavementRelief | None

    def tilts(
        self, material: AnyArray, instance: AnyArray, place: Float, local: Float, normal: Float, footprint: Float
    ) -> tuple[Index, Float]:
        """Return the rows (K,) of points whose material has a normal image, and by what these tilt their normals.

        Args:
            material: (N,) indices of materials.
            instance: (N,) instance numbers.
            place: (N, 3) map coordinates, m.
            local: (N, 3) the same in the frame of the whole road, m.
            normal: (N, 3) unit normals of the faces.
            footprint: (N,) diameter of the beams on the surface, m.

        Returns:
            rows: (K,).
            tilts: (K, 3), tangential: a normal n becomes n + tilt, of length 1.
        """
        rows = np.flatnonzero(np.isin(material, list(self.images)))
        result = np.zeros((len(rows), 3))
        for number, image in self.images.items():
            mine = np.flatnonzero(material[rows] == number)
            chosen = rows[mine]
            on_image, width, height = _mapping_by_world(local[chosen], normal[chosen])
            if image.along and self.pavement is not None:
                lies = self.pavement.on_pavement(instance[chosen])
                station, offset, forwards = self.pavement.along_road(place[chosen[lies]])
                left = np.cross(normal[chosen[lies]], forwards)
                left *= np.where(normal[chosen[lies], 2:] < 0.0, -1.0, 1.0)
                left /= np.linalg.norm(left, axis=1)[:, None]
                on_image[lies] = np.column_stack([station, offset])
                height[lies] = left
                width[lies] = np.cross(left, normal[chosen[lies]])
            tilt = image.tilts(on_image, footprint[chosen])
            result[mine] = tilt[:, :1] * width + tilt[:, 1:] * height
        return rows, result


def _mapping_by_world(place: Float, normal: Float) -> tuple[Float, Float, Float]:
    """Return where places (N, 3) lie on an image, (N, 2) m, and the directions (N, 3) of its width and height there.

    Seen from above on what lies, from the side on what stands: as the nodes of textures have it
    (`blender.materials.texture_nodes`).
    """
    east, north, up = np.abs(normal).T
    lies, beside = up > np.maximum(east, north), east > north
    standing_across = np.where(beside, place[:, 1], place[:, 0])
    on_image = np.column_stack([np.where(lies, place[:, 0], standing_across), np.where(lies, place[:, 1], place[:, 2])])
    width, height = np.zeros_like(place), np.zeros_like(place)
    width[:, 0], width[:, 1] = lies | ~beside, ~lies & beside
    height[:, 1], height[:, 2] = lies, ~lies
    return on_image, width, height
