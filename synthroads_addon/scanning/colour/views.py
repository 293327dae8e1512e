"""Calibrated pinhole cameras along the path: where they stand, what they see, and where points lie in their images."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Float, Float32, UInt16
from ..platforms.path import Path, Strip
from ..scene.mesh import SceneMesh
from .colour import ColourSettings

OVERLAP = 1.3
"""Length that an image covers as a multiple of the image spacing: what stands up is seen from aside. Chosen: neighbours
see each other's edges."""
_STEEPEST = np.tan(np.deg2rad(62.0))
"""Tangent of the largest angle off the axis that a camera facing down sees. Chosen: an image's size grows with it."""
_HIGH = 20.0
"""Platforms that are higher above the ground than this look down; others look around, m. Chosen: above masts of
vehicles, below UAVs."""
_BESIDE = 3.0
"""How far beyond an image's limit along the path the scene counts for its width."""
_SAMPLE = 40_000
"""Vertices, and as many places on faces, that the images are cut out by. Chosen: bounds the work."""
_NADIR = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""Camera's axes (right, up, backwards) as columns in a level frame that looks forward (x), left (y) and up (z)."""


@dataclass(frozen=True)
class View:
    """A pinhole camera without distortion.

    Attributes:
        position: (3,) of the projection centre, local, m.
        rotation: (3, 3) columns: the camera's right, up and backwards in the local frame.
        focal: focal length, px.
        centre: (2,) principal point, px from the left and from the top.
        size: width and height, px.
        time: when it sees the scene, s since the scan's start.
    """

    position: Float
    rotation: Float
    focal: float
    centre: tuple[float, float]
    size: tuple[int, int]
    time: float

    def project(self, points: Float) -> tuple[Float, Float, Float]:
        """Return columns x, rows y (px; the first pixel's middle is 0.5) and depths (m) of points (N, 3).

        Depth is measured along the axis; points behind the camera have none above 0, and columns and rows that mean
        nothing.
        """
        right, up, backward = ((points - self.position) @ self.rotation).T
        depth = -backward
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = self.focal / depth
            return self.centre[0] + right * scale, self.centre[1] - up * scale, depth

    def unproject(self, column: NDArray[np.integer], row: NDArray[np.integer], depth: NDArray[np.floating]) -> Float:
        """Return the places (..., 3) that the middles of pixels (...) show at depths (...) along the axis, m."""
        right, up = (column + 0.5 - self.centre[0]) / self.focal, (self.centre[1] - row - 0.5) / self.focal
        ray = np.stack([right, up, -np.ones_like(right)], axis=-1) @ self.rotation.T
        return np.asarray(self.position + depth.astype(np.float64)[..., None] * ray)

    def crop_to(self, points: Float, margin: int) -> View | None:
        """Return the camera cropped to the pixels that show points (N, 3), plus a margin, px; None if it shows none."""
        x, y, depth = self.project(points)
        is_shown = (depth > 0.0) & (x >= 0.0) & (x <= self.size[0]) & (y >= 0.0) & (y <= self.size[1])
        if not is_shown.any():
            return None
        left_edge, top_edge = (max(0, int(values[is_shown].min()) - margin) for values in (x, y))
        right_edge, bottom_edge = (
            min(size, int(values[is_shown].max()) + 1 + margin) for values, size in zip((x, y), self.size, strict=True)
        )
        centre = (self.centre[0] - left_edge, self.centre[1] - top_edge)
        return View(
            self.position,
            self.rotation,
            self.focal,
            centre,
            (right_edge - left_edge, bottom_edge - top_edge),
            self.time,
        )

    @property
    def pixels(self) -> int:
        """Return the number of pixels of the image."""
        return self.size[0] * self.size[1]


@dataclass(frozen=True)
class RenderedImage:
    """One camera's rendered image: layers, depths and materials of its pixels, rows from the top.

    Attributes:
        view: the camera.
        layers: (H, W, C) float16 in the order of `ImageLayers.channels`.
        depth: (H, W) float32 along the axis, m.
        material: (H, W) uint16: index in the scene mesh's materials plus 1; 0 where there is nothing.
    """

    view: View
    layers: NDArray[np.float16]
    depth: Float32
    material: UInt16


def views_along(
    path: Path, points: Float, settings: ColourSettings, field_of_view: float, largest_side: int
) -> list[View]:
    """Return the cameras along a path, each cut to what it can see of the scene.

    High platforms look straight down, with images as wide as the swath. Others look around: ahead, back, to both
    sides, up and down, at right angles.

    Args:
        path: the scanner's.
        points: (N, 3) places on the scene's surfaces, local, m; see `scene_sample`.
        settings: spacing and resolution of the images.
        field_of_view: of the scanner, all of it, rad.
        largest_side: largest side of an image, px.
    """
    if not len(points):
        return []
    views: list[View | None] = []
    for strip in path.strips:
        times = _image_times(path, strip, settings.image_spacing)
        position, heading = _travel_directions(path, strip, times)
        for place, forward, time in zip(position, heading, times, strict=True):
            level = np.array([[*forward, 0.0], [-forward[1], forward[0], 0.0], [0.0, 0.0, 1.0]]).T
            focal, limits, cameras = _cameras(points - place, level, path.typical_range, settings, field_of_view)
            views += [
                _cut_view(place, level @ axes, focal, float(time), points, limits, largest_side) for axes in cameras
            ]
    return [view for view in views if view is not None]


def scene_sample(mesh: SceneMesh) -> Float:
    """Return places (N, 3) that a mesh extends over: some of its vertices, and others spread evenly over its faces."""
    if not len(mesh):
        return np.empty((0, 3))
    vertices = mesh.vertices[:: max(1, len(mesh.vertices) // _SAMPLE)]
    summed_area = np.cumsum(mesh.areas())
    number = np.arange(_SAMPLE)
    face = np.minimum(np.searchsorted(summed_area, (number + 0.5) / _SAMPLE * summed_area[-1]), len(mesh) - 1)
    # Even over a triangle: two shares that fill the square evenly, folded at its diagonal.
    a, b = (number * 0.7548776662466927) % 1.0, (number * 0.5698402909980532) % 1.0
    a, b = np.where(a + b > 1.0, [1.0 - a, 1.0 - b], [a, b])
    corner = mesh.vertices[mesh.triangles[face]].astype(np.float64)
    face_places = corner[:, 0] + a[:, None] * (corner[:, 1] - corner[:, 0]) + b[:, None] * (corner[:, 2] - corner[:, 0])
    return np.concatenate([vertices.astype(np.float64), face_places])


def _image_times(path: Path, strip: Strip, spacing: float) -> Float:
    """Return the times (K,), s, of a strip's images: each in the middle of an equal share of the way."""
    knots = strip.start_time + np.linspace(0.0, strip.duration, 257)
    position, _ = path.pose(strip, knots)
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(position, axis=0), axis=1))])
    if way[-1] < spacing / 100.0:
        return np.array([strip.start_time + strip.duration / 2.0])
    count = max(1, int(np.ceil(way[-1] / spacing - 1e-9)))
    return np.interp((np.arange(count) + 0.5) / count * way[-1], way, knots)


def _travel_directions(path: Path, strip: Strip, times: Float) -> tuple[Float, Float]:
    """Return positions (K, 3), m, and horizontal unit directions of travel (K, 2), at times (K,), s.

    Where the platform stands still the direction is that of its forward axis, in plan.
    """
    position, rotation = path.pose(strip, times)
    step = min(0.05, strip.duration / 4.0)
    begin, end = strip.start_time, strip.start_time + strip.duration
    place_before, _ = path.pose(strip, np.clip(times - step, begin, end))
    place_after, _ = path.pose(strip, np.clip(times + step, begin, end))
    travel = (place_after - place_before)[:, :2]
    is_still = np.linalg.norm(travel, axis=1) < 1e-6
    travel[is_still] = rotation[is_still, :2, 0]
    length = np.linalg.norm(travel, axis=1, keepdims=True)
    return position, np.where(length > 1e-9, travel / np.maximum(length, 1e-9), [1.0, 0.0])


def _cameras(
    offsets: Float, level: Float, typical_range: float, settings: ColourSettings, field_of_view: float
) -> tuple[float, tuple[float, float], Sequence[Float]]:
    """Return the focal length (px), limits (tangents aside and along) and axes of the cameras at one place.

    Args:
        offsets: (N, 3) places on the scene's surfaces from there, m.
        level: (3, 3) axes of the level frame: forward, left and up.
        typical_range: of the scanner, m.
        settings: spacing and resolution of the images.
        field_of_view: of the scanner, all of it, rad.
    """
    heights = -offsets[np.abs(offsets @ level[:, 0]) < settings.image_spacing, 2]
    height_above_ground = float(np.median(heights)) if len(heights) else typical_range
    if height_above_ground < _HIGH:
        return max(8.0, typical_range / settings.ground_sampling_distance), (1.0, 1.0), _AROUND
    side_limit = min(_STEEPEST, np.tan(min(field_of_view / 2.0, 1.5)) * 1.05)
    length_limit = min(_STEEPEST, OVERLAP * settings.image_spacing / 2.0 / height_above_ground)
    return height_above_ground / settings.ground_sampling_distance, (side_limit, length_limit), (_NADIR,)


def _turned_ahead(cos: float, sin: float) -> Float:
    """Return the axes (3, 3) of a level camera that looks ahead, turned about the vertical by an angle's cos, sin."""
    forward_axes = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    return np.asarray(np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]]) @ forward_axes)


_UP = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""Axes of a camera that looks up, as `_NADIR`."""
_QUARTERS = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))
"""Directions ahead, left, back and right, as (x, y)."""
_AROUND: Sequence[Float] = (*(_turned_ahead(*quarter) for quarter in _QUARTERS), _UP, _NADIR)
"""Axes of cameras that look ahead, left, back, right, up and down, in a level frame."""


def _cut_view(
    place: Float,
    rotation: Float,
    focal: float,
    time: float,
    points: Float,
    limits: tuple[float, float],
    largest_side: int,
) -> View | None:
    """Return a camera whose image holds what it sees of the scene within its limits; None if it sees nothing.

    Args:
        place: (3,) of the camera, m.
        rotation: (3, 3) its axes.
        focal: focal length, px; less where the image would be too large.
        time: s.
        points: (N, 3) places on the scene's surfaces, m.
        limits: tangents of the largest angles aside and along.
        largest_side: of the image, px.
    """
    right, up, backward = ((points - place) @ rotation).T
    in_limits = (backward < -0.1) & (np.abs(up) <= -_BESIDE * limits[1] * backward)
    if not in_limits.any():
        return None
    x, y = right[in_limits] / -backward[in_limits], up[in_limits] / -backward[in_limits]
    left_edge, right_edge = _padded_range(x, limits[0])
    bottom_edge, top_edge = _padded_range(y, limits[1])
    if right_edge <= left_edge or top_edge <= bottom_edge:
        return None
    focal = min(focal, largest_side / max(right_edge - left_edge, top_edge - bottom_edge))
    size = (int(np.ceil((right_edge - left_edge) * focal)), int(np.ceil((top_edge - bottom_edge) * focal)))
    return View(place, rotation, focal, (float(-left_edge * focal), float(top_edge * focal)), size, time)


def _padded_range(values: Float, limit: float) -> tuple[float, float]:
    """Return the range of sampled values, widened by a margin and cut at plus and minus the limit."""
    least_value, largest_value = float(values.min()), float(values.max())
    margin = 0.02 * (1.0 + largest_value - least_value)
    return max(least_value - margin, -limit), min(largest_value + margin, limit)
