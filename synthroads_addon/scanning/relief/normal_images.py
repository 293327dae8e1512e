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
        follows_road: whether it lies by station and offset on pavements, else by the place in the world.
    """

    levels: tuple[Float32, ...]
    tile: float
    follows_road: bool

    @classmethod
    def of(cls, pixels: Float, tile: float, follows_road: bool) -> NormalImage:
        """Return the image of pixels (H, W, 3), 0 to 1, lowest row first: tangential normals, green upwards.

        Args:
            pixels: a normal's components, from -1 to 1, as (1 + n) / 2.
            tile: length that the image's width covers, m.
            follows_road: see the attribute.
        """
        normal = 2.0 * pixels - 1.0
        level = (normal[..., :2] / np.maximum(normal[..., 2:], _STEEPEST)).astype(np.float32)
        levels = [level]
        while min(level.shape[:2]) > 1:
            rows, columns = level.shape[0] // 2, level.shape[1] // 2
            # An odd last row or column is left out.
            pairs = level[: rows * 2, : columns * 2].reshape(rows, 2, columns, 2, 2)
            level = pairs.mean(axis=(1, 3), dtype=np.float32)
            levels.append(level)
        return cls(tuple(levels), tile, follows_road)

    def tilts(self, place: Float, footprint: Float) -> Float:
        """Return the tilts (N, 2) of normals at places, to the image's right and upwards.

        Args:
            place: (N, 2) along the image's width and height from its lower left corner, m.
            footprint: (N,) width over which tilts are averaged, m.
        """
        pixel = self.tile / self.levels[0].shape[1]
        # The level whose pixels are nearest to the footprint's width, on a logarithmic scale.
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
    for step_right, share_x in ((0, 1.0 - share[:, 0]), (1, share[:, 0])):
        for step_up, share_y in ((0, 1.0 - share[:, 1]), (1, share[:, 1])):
            result += (share_x * share_y)[:, None] * image[(row + step_up) % height, (column + step_right) % width]
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
        self, material: AnyArray, instance: AnyArray, place: Float, road_place: Float, normal: Float, footprint: Float
    ) -> tuple[Index, Float]:
        """Return the rows (K,) of points whose material has a normal image, and by what these tilt their normals.

        Args:
            material: (N,) indices of materials.
            instance: (N,) instance numbers.
            place: (N, 3) map coordinates, m.
            road_place: (N, 3) the same in the frame of the whole road, m.
            normal: (N, 3) unit normals of the faces.
            footprint: (N,) diameter of the beams on the surface, m.

        Returns:
            rows: (K,).
            tilts: (K, 3), tangential: a normal n becomes n + tilt, of length 1.
        """
        rows = np.flatnonzero(np.isin(material, list(self.images)))
        result = np.zeros((len(rows), 3))
        for number, image in self.images.items():
            result_rows = np.flatnonzero(material[rows] == number)
            point_rows = rows[result_rows]
            on_image, width, height = _mapping_by_world(road_place[point_rows], normal[point_rows])
            if image.follows_road and self.pavement is not None:
                # On pavements the image's width lies along the road, and its height to the left of that.
                paved = self.pavement.on_pavement(instance[point_rows])
                paved_normal = normal[point_rows[paved]]
                station, offset, forwards = self.pavement.along_road(place[point_rows[paved]])
                leftwards = np.cross(paved_normal, forwards)
                leftwards *= np.where(paved_normal[:, 2:] < 0.0, -1.0, 1.0)
                leftwards /= np.linalg.norm(leftwards, axis=1)[:, None]
                on_image[paved] = np.column_stack([station, offset])
                height[paved] = leftwards
                width[paved] = np.cross(leftwards, paved_normal)
            tilt = image.tilts(on_image, footprint[point_rows])
            result[result_rows] = tilt[:, :1] * width + tilt[:, 1:] * height
        return rows, result


def _mapping_by_world(place: Float, normal: Float) -> tuple[Float, Float, Float]:
    """Return where places (N, 3) lie on an image, (N, 2) m, and the directions (N, 3) of its width and height there.

    Level surfaces are mapped from above (width east, height north), upright ones from the side that they face most
    (height up): as the nodes of textures do it (`blender.materials.texture_nodes`).
    """
    east, north, up = np.abs(normal).T
    is_level, faces_east = up > np.maximum(east, north), east > north
    upright_width = np.where(faces_east, place[:, 1], place[:, 0])
    on_image = np.column_stack(
        [np.where(is_level, place[:, 0], upright_width), np.where(is_level, place[:, 1], place[:, 2])]
    )
    width, height = np.zeros_like(place), np.zeros_like(place)
    width[:, 0], width[:, 1] = is_level | ~faces_east, ~is_level & faces_east
    height[:, 1], height[:, 2] = is_level, ~is_level
    return on_image, width, height
