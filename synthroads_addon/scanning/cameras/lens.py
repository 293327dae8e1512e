"""Lenses: which ray each place of an image sees, and where in the image a point is seen.

Camera frame: x right, y down, z along the axis (OpenCV's and COLMAP's). Places in an image are pixels from its upper
left corner: the middle of the first pixel is (0.5, 0.5), as COLMAP and nerfstudio count; in OpenCV and KITTI it is
(0, 0), half a pixel less.

- ``pinhole``: Brown's distortion (Brown 1971, Close-range camera calibration, Photogrammetric Engineering 37), with the
  coefficients and signs of OpenCV: radial k1, k2, k3, tangential p1, p2.
- ``fisheye``: equidistant, r = f (t + k1 t^3 + k2 t^5 + k3 t^7 + k4 t^9) for the angle t from the axis (Kannala and
  Brandt 2006, A generic camera model, IEEE TPAMI 28; OpenCV's module ``fisheye``).
- ``equirectangular``: columns are even in azimuth, rows in elevation, over the whole sphere; the axis is in the middle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from ...base.arrays import Float

LensModel = Literal["pinhole", "fisheye", "equirectangular"]
_MOST_STEPS = 30
"""Newton's steps of an inversion. Chosen: a handful are enough for real lenses."""
_PRECISE = 1e-13
"""Step at which an inversion ends, as a share of the focal length."""
_STEEPEST = 1.55
"""Largest angle from a pinhole's axis, rad: it sees less than a half space."""
_ANGLES = 4096
"""Angles at which it is looked whether a lens's image still grows outwards."""


@dataclass(frozen=True)
class Lens:
    """One lens in front of one sensor.

    Attributes:
        model: see the module.
        width, height: of the image, px.
        focal: focal lengths (horizontal, vertical), px; without meaning for ``equirectangular``.
        centre: place of the axis in the image, px.
        radial: k1, k2, k3 of a pinhole, k1 to k4 of a fisheye.
        tangential: p1, p2 of a pinhole.
        largest_angle: from the axis, rad: nothing farther out is seen.
    """

    model: LensModel
    width: int
    height: int
    focal: tuple[float, float]
    centre: tuple[float, float]
    radial: tuple[float, ...] = ()
    tangential: tuple[float, float] = (0.0, 0.0)
    largest_angle: float = math.pi

    def rays(self, place: Float) -> Float:
        """Return the unit directions (3, N), camera frame, that places (2, N), px, see; NaN where they see nothing."""
        if self.model == "equirectangular":
            azimuth = (place[0] / self.width - 0.5) * (2.0 * np.pi)
            depression = (place[1] / self.height - 0.5) * np.pi
            level = np.cos(depression)
            return np.stack([level * np.sin(azimuth), np.sin(depression), level * np.cos(azimuth)])
        flat = np.stack([(place[axis] - self.centre[axis]) / self.focal[axis] for axis in (0, 1)])
        if self.model == "fisheye":
            return self._fisheye_rays(flat)
        straight = self._undistorted(flat)
        length = np.sqrt(straight[0] ** 2 + straight[1] ** 2 + 1.0)
        result = np.stack([straight[0], straight[1], np.ones_like(length)]) / length
        result[:, np.arccos(np.clip(result[2], -1.0, 1.0)) > self.reach + 1e-9] = np.nan
        return np.asarray(result)

    def project(self, point: Float) -> Float:
        """Return the places (2, N), px, at which points (3, N), camera frame, are seen; NaN where they aren't.

        A point is seen where its ray meets the image, at half the way between its first and last pixels' outer edges
        or anywhere else within them.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            place = self._places(point)
        inside = (place[0] >= 0.0) & (place[0] <= self.width) & (place[1] >= 0.0) & (place[1] <= self.height)
        place[:, ~inside] = np.nan
        return place

    def _places(self, point: Float) -> Float:
        """Return places (2, N), px, of points (3, N), inside the image or not; NaN beyond the lens's reach."""
        x, y, z = point
        if self.model == "equirectangular":
            azimuth, depression = np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))
            return np.stack([(azimuth / (2.0 * np.pi) + 0.5) * self.width, (depression / np.pi + 0.5) * self.height])
        aside = np.hypot(x, y)
        angle = np.arctan2(aside, z)
        if self.model == "fisheye":
            factor = self._fisheye_radius(angle) / np.where(aside > 0.0, aside, 1.0)
            flat = np.stack([x * factor, y * factor])
        else:
            flat = self._distorted(np.stack([x / z, y / z]))
        flat[:, ~(angle <= self.reach + 1e-9)] = np.nan
        return np.stack([flat[axis] * self.focal[axis] + self.centre[axis] for axis in (0, 1)])

    @cached_property
    def reach(self) -> float:
        """Return the largest angle from the axis, rad, up to which the image grows outwards, within `largest_angle`."""
        limit = min(self.largest_angle, _STEEPEST if self.model == "pinhole" else math.pi)
        if self.model == "equirectangular":
            return math.pi
        angle = np.linspace(0.0, limit, _ANGLES)
        if self.model == "fisheye":
            radius = self._fisheye_radius(angle)
        else:
            tangent = np.tan(angle)
            radius = tangent * self._radial_factor(tangent**2)
        shrinking = np.flatnonzero(np.diff(radius) <= 0.0)
        return float(angle[shrinking[0]]) if len(shrinking) else limit

    @property
    def pixel_angle(self) -> float:
        """Return the angle of a pixel on the axis, rad."""
        return 2.0 * math.pi / self.width if self.model == "equirectangular" else 1.0 / self.focal[0]

    def _radial_factor(self, squared: Float) -> Float:
        """Return 1 + k1 r^2 + k2 r^4 + k3 r^6 at squared radii (N,)."""
        k1, k2, k3 = (*self.radial, 0.0, 0.0, 0.0)[:3]
        return 1.0 + squared * (k1 + squared * (k2 + squared * k3))

    def _distorted(self, straight: Float) -> Float:
        """Return places (2, N) in the plane at distance 1 as a pinhole's lens bends them."""
        x, y = straight
        (p1, p2), squared = self.tangential, x * x + y * y
        factor = self._radial_factor(squared)
        return np.stack(
            [
                x * factor + 2.0 * p1 * x * y + p2 * (squared + 2.0 * x * x),
                y * factor + p1 * (squared + 2.0 * y * y) + 2.0 * p2 * x * y,
            ]
        )

    def _undistorted(self, flat: Float) -> Float:
        """Return the places (2, N) that the lens bends to given ones, by Newton's method; NaN where there is none."""
        if not any(self.radial) and not any(self.tangential):
            return flat.copy()
        k1, k2, k3 = (*self.radial, 0.0, 0.0, 0.0)[:3]
        p1, p2 = self.tangential
        result = flat.copy()
        for _ in range(_MOST_STEPS):
            x, y = result
            squared = x * x + y * y
            factor = self._radial_factor(squared)
            slope = 2.0 * (k1 + squared * (2.0 * k2 + 3.0 * k3 * squared))  # of the factor, by half the squared radius
            along = factor + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x
            down = factor + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x
            cross = slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y
            error = self._distorted(result) - flat
            determinant = along * down - cross * cross
            step = np.stack([down * error[0] - cross * error[1], along * error[1] - cross * error[0]]) / determinant
            result -= step
            if not (np.abs(step) > _PRECISE).any():
                break
        lost = ~(np.abs(self._distorted(result) - flat).max(axis=0) < 1e-9)
        result[:, lost] = np.nan
        return result

    def _fisheye_radius(self, angle: Float) -> Float:
        """Return radii (N,), in focal lengths, of angles (N,) from the axis, rad."""
        k1, k2, k3, k4 = (*self.radial, 0.0, 0.0, 0.0, 0.0)[:4]
        squared = angle * angle
        return np.asarray(angle * (1.0 + squared * (k1 + squared * (k2 + squared * (k3 + squared * k4)))))

    def _fisheye_rays(self, flat: Float) -> Float:
        """Return directions (3, N) of places (2, N), in focal lengths from the axis, of a fisheye lens."""
        k1, k2, k3, k4 = (*self.radial, 0.0, 0.0, 0.0, 0.0)[:4]
        radius = np.hypot(*flat)
        angle = radius.copy()
        if any(self.radial):
            for _ in range(_MOST_STEPS):
                squared = angle * angle
                slope = 1.0 + squared * (3.0 * k1 + squared * (5.0 * k2 + squared * (7.0 * k3 + 9.0 * k4 * squared)))
                step = (self._fisheye_radius(angle) - radius) / np.where(np.abs(slope) > 1e-6, slope, 1e-6)
                angle = np.clip(angle - step, 0.0, math.pi)
                if not (np.abs(step) > _PRECISE).any():
                    break
        lost = (np.abs(self._fisheye_radius(angle) - radius) > 1e-9) | (angle > self.reach + 1e-9)
        factor = np.sin(angle) / np.where(radius > 0.0, radius, 1.0)
        result = np.stack([flat[0] * factor, flat[1] * factor, np.cos(angle)])
        result[:, lost] = np.nan
        return result


def pixel_centres(lens: Lens, first_row: int, last_row: int) -> Float:
    """Return the middles (2, N), px, of the pixels of rows `first_row` to `last_row` (exclusive), row by row."""
    column, row = np.meshgrid(np.arange(lens.width) + 0.5, np.arange(first_row, last_row) + 0.5)
    return np.stack([column.ravel(), row.ravel()])
