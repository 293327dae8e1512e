"""Platforms that move along a guide: UAV, airborne and vehicle."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ...base.errors import InputError
from ...base.rotations import rotation_matrix
from .base import KNOT_RANGE, USUAL, Strip, knots_for, mounting, strips_of
from .guides import Float, Guide, SmoothedGuide
from .platform import Platform
from .strip_line import Eased, StripTrack, Sway

AXLES = 3.0
"""Distance between a vehicle's axles, m: its pitch is that of the line through both."""
WHEELS = 1.6
"""Distance between a vehicle's left and right wheels, m: its roll is that of the line through both."""

_HEIGHT_STEP = 1.0  # m
_ATTITUDE_STEP = 5.0  # m
_TRACKS_KEPT = 4


class MovingPath:
    """Strips along a guide at a constant speed over ground.

    An aircraft flies level at its height above the guide's elevation, its nose along the path. A vehicle drives on the
    undamaged surface at its offset, and stands on it with four wheels.

    Attributes:
        strips: in the order of time.
        knot_spacing: s, see `Path`.
        typical_range: m, see `Path`.
        deviation: largest horizontal distance of the path's form from the guide and its offsets, m: that of the
            fitted polynomials, or the sway.

    Args:
        platform: uav, airborne or vehicle.
        guide: what to follow.

    Raises:
        InputError: a strip would turn back on itself, or leaves what is known of the ground.
    """

    def __init__(self, platform: Platform, guide: Guide) -> None:
        usual = USUAL[platform.kind]
        self._vehicle = platform.kind == "vehicle"
        self._guide, self._sway, self.deviation = _form(platform, guide)
        self._offsets = platform.lateral_offsets or usual.lateral_offsets or self._guide.driving_offsets()
        self._forward = [self._runs_forward(platform, i) for i in range(len(self._offsets))]
        self._height = usual.height if platform.height is None else platform.height
        self._speed = usual.speed if platform.speed is None else platform.speed
        self._mounting = mounting(platform)
        self._named = platform.lateral_offsets is not None
        self.typical_range = usual.seen_from(self._height)
        self._strip_track = lru_cache(_TRACKS_KEPT)(self._make_track)
        lengths, spacings = [], []
        for index in range(len(self._offsets)):
            lengths.append(self._strip_track(index).length)
            spacings.append(self._knots(index))
        self.strips = strips_of([length / self._speed for length in lengths])
        self.knot_spacing = min(spacings)

    def pose(self, strip: Strip, time: Float) -> tuple[Float, Float]:
        """Return local positions (K, 3), m, and rotations (K, 3, 3) at times (K,) since the first strip's start."""
        track = self._strip_track(strip.index)
        distance = (np.asarray(time, dtype=np.float64) - strip.start_time) * self._speed
        within = np.clip(distance, 0.0, track.length)
        plan, course, _, _ = track.place(within)
        beyond = (distance - within)[:, None]
        plan = plan + beyond * np.stack([np.cos(course), np.sin(course)], axis=1)
        height, attitude = self._eased(track)
        position = np.column_stack([plan, height(distance)])
        return position, rotation_matrix(*attitude(distance).T) @ self._mounting

    def _runs_forward(self, platform: Platform, index: int) -> bool:
        if self._vehicle:
            return self._offsets[index] <= 0.0  # traffic keeps to the right
        return index % 2 == 0 or not platform.there_and_back

    def _make_track(self, index: int) -> StripTrack:
        field = f"scan.platform.lateral_offsets[{index}]" if self._named else "scan.platform.lateral_offsets"
        return StripTrack(self._guide, self._offsets[index], self._sway, self._forward[index], field)

    def _eased(self, track: StripTrack) -> tuple[Eased, Eased]:
        """Return height (K, 1) and heading, pitch, roll (K, 3) as functions of the distance travelled."""
        step = min(_ATTITUDE_STEP, self._sway.wavelength / 40.0) if self._sway else _ATTITUDE_STEP
        return (
            Eased(lambda distance: self._heights(track, distance)[:, None], track.length, _HEIGHT_STEP, False),
            Eased(lambda distance: self._attitudes(track, distance), track.length, step, True),
        )

    def _heights(self, track: StripTrack, distance: Float) -> Float:
        if self._vehicle:
            return self._height + self._surface(track, distance, 0.0)
        return self._height + self._guide.elevation(track.stations(distance))

    def _attitudes(self, track: StripTrack, distance: Float) -> Float:
        course = track.place(distance)[1]
        if not self._vehicle:
            return np.column_stack([course, np.zeros((len(course), 2))])
        reach = min(AXLES, track.length) / 2.0
        # At the ends the axles stay on the track.
        middle = np.clip(distance, reach, track.length - reach)
        rise = self._surface(track, middle + reach, 0.0) - self._surface(track, middle - reach, 0.0)
        pitch = np.arctan(rise / (2.0 * reach))
        across = self._surface(track, distance, WHEELS / 2.0) - self._surface(track, distance, -WHEELS / 2.0)
        # Left of the body is a tangent of the surface: tan(roll) is the slope across times cos(pitch).
        return np.column_stack([course, pitch, np.arctan(across / WHEELS * np.cos(pitch))])

    def _surface(self, track: StripTrack, distance: Float, left: float) -> Float:
        """Return the surface's elevation (K,) on the track or beside it, by the direction of travel."""
        station = track.stations(distance)
        offset = track.offsets(station)[0] + (left if track.forward else -left)
        ground = self._guide.ground(station, offset, False)
        unknown = np.flatnonzero(~np.isfinite(ground))
        if len(unknown):
            at, beside = float(station[unknown[0]]), float(offset[unknown[0]])
            field = "scan.platform.lateral_offsets"
            raise InputError(field, beside, f"there is no ground known at station {at:.1f} m; a smaller one is needed")
        return ground

    def _knots(self, index: int) -> float:
        track = self._strip_track(index)
        height, attitude = self._eased(track)
        rate, turn = attitude.bends()
        curvature, jump = track.bend
        # A rotation's second derivative is at most the angular velocity squared plus the angular acceleration.
        swing = float(rate.sum() ** 2 + turn.sum())
        bend = np.hypot(curvature, float(height.bends()[1][0])) + KNOT_RANGE * swing
        return knots_for(bend * self._speed**2, jump * self._speed)


def _form(platform: Platform, guide: Guide) -> tuple[Guide, Sway | None, float]:
    """Return what the strips lie beside, their sway, and how far this form leaves the guide."""
    if platform.path == "smoothed":
        smoothed = SmoothedGuide(guide, platform.polynomial_degree)
        return smoothed, None, smoothed.deviation
    if platform.path == "direct" or platform.zigzag_amplitude == 0.0:
        return guide, None, 0.0
    if platform.zigzag_wavelength < platform.zigzag_amplitude:
        allowed = f"at least the amplitude, {platform.zigzag_amplitude:g} m, is needed: a shorter sway runs across"
        raise InputError("scan.platform.zigzag_wavelength", platform.zigzag_wavelength, allowed)
    return guide, Sway(platform.zigzag_amplitude, platform.zigzag_wavelength), platform.zigzag_amplitude
