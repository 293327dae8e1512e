"""Platforms that move along a guide at a constant speed over ground: what they share, and those that fly level."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from ...base.arrays import Float
from ...base.errors import InputError
from ...base.rotations import rotation_matrix
from ...base.schema import Finite, notes, quantity
from .guides import Guide, SmoothedGuide
from .path import KNOT_RANGE, Strip, knot_spacing_for, make_strips
from .platform import Platform
from .strip_line import EasedFunction, StripTrack, Sway

_HEIGHT_STEP = 1.0
"""Step at which the height along a track is sampled, m. Chosen: vertical curves are far longer."""
_ATTITUDE_STEP = 5.0
"""Step of the attitude, m. Chosen: a vehicle's own length."""
_TRACKS_KEPT = 4
"""Tracks that are kept. Chosen: blocks in work at once are of few strips."""


class MovingPlatform(Platform):
    """Platform that moves along a guide, in strips."""

    height: float | None = quantity(None, "m", "Height above the road.", (0.1, 5000))
    speed: float | None = quantity(None, "m/s", "Speed over ground.", (0.1, 150))
    lateral_offsets: tuple[Finite, ...] | None = Field(
        None,
        min_length=1,
        max_length=64,
        title="Strips at (m)",
        description="Offset of each strip from the centreline, m.",
        json_schema_extra=notes(unset="In the lanes"),
    )
    path: Literal["direct", "smoothed", "zigzag"] = Field(
        "direct",
        description="Along the centreline, along a polynomial fitted to it, or swaying about it.",
        json_schema_extra=notes(labels={"direct": "The Centreline"}),
    )
    polynomial_degree: int = quantity(
        3, "1", "Degree of the smoothed path's polynomials.", (1, 9), only_with={"path": ("smoothed",)}
    )
    zigzag_amplitude: float = quantity(5.0, "m", "Sway to either side.", (0, 500), only_with={"path": ("zigzag",)})
    zigzag_wavelength: float = quantity(100.0, "m", "Length of a sway.", (5, 5000), only_with={"path": ("zigzag",)})

    def make_path(self, guide: Guide, origin: Sequence[float] | None = None) -> MovingPath:
        """Return the path of strips along a guide, at constant speed over ground; `origin` isn't used."""
        return MovingPath(self, guide)

    def runs_forward(self, strip: int, offset: float) -> bool:
        """Return whether the platform moves along a strip, at an offset (m), in the direction of the stations."""
        raise NotImplementedError


class AerialPlatform(MovingPlatform):
    """Platform that flies level at its height above the guide's elevation, its nose along the path."""

    there_and_back: bool = Field(True, description="Every second strip against the stations.")

    def runs_forward(self, strip: int, offset: float) -> bool:
        """Return whether a strip is flown in the direction of the stations: all are, or every other one."""
        return strip % 2 == 0 or not self.there_and_back

    def as_single_strip(self) -> AerialPlatform:
        """Return a copy with one strip, on the guide itself; the platform as it is if offsets are given."""
        return self if self.lateral_offsets is not None else self.model_copy(update={"lateral_offsets": (0.0,)})


class Uav(AerialPlatform):
    """UAV that flies level along the road, usually 60 m up at 8 m/s."""

    order: ClassVar[int] = 0
    label: ClassVar[str] = "UAV"
    usual: ClassVar[Mapping[str, Any]] = {"height": 60.0, "speed": 8.0, "lateral_offsets": (10.0, -10.0)}

    kind: Literal["uav"] = Field("uav", title="Platform", description="Platform.")


class Aircraft(AerialPlatform):
    """Aircraft that flies level along the road, usually 800 m up at 60 m/s."""

    order: ClassVar[int] = 3
    label: ClassVar[str] = "Aircraft"
    usual: ClassVar[Mapping[str, Any]] = {"height": 800.0, "speed": 60.0, "lateral_offsets": (0.0,)}

    kind: Literal["airborne"] = Field("airborne", title="Platform", description="Platform.")


class MovingPath:
    """Strips along a guide at a constant speed over ground, level at the platform's height above the guide.

    What moves otherwise says so by `heights` and `attitudes`.

    Attributes:
        strips: in the order of time.
        height: of the scanner above what it follows, m.
        knot_spacing: s, see `Path`.
        typical_range: m, see `Path`.

    Args:
        platform: what moves.
        guide: what to follow.

    Raises:
        InputError: a strip would turn back on itself, or leaves what is known of the ground.
    """

    def __init__(self, platform: MovingPlatform, guide: Guide) -> None:
        self._guide, self._sway = _guide_and_sway(platform, guide)
        self._offsets: tuple[float, ...] = platform.value("lateral_offsets") or self._guide.driving_offsets()
        self._forward = [platform.runs_forward(strip, offset) for strip, offset in enumerate(self._offsets)]
        self.height, self._speed = float(platform.value("height")), float(platform.value("speed"))
        self._mounting = platform.mounting()
        self._named = platform.lateral_offsets is not None
        self.typical_range = platform.typical_range() or self.height
        self._strip_track = lru_cache(_TRACKS_KEPT)(self._make_track)
        lengths, spacings = [], []
        for index in range(len(self._offsets)):
            lengths.append(self._strip_track(index).length)
            spacings.append(self._knots(index))
        self.strips = make_strips([length / self._speed for length in lengths])
        self.knot_spacing = min(spacings)

    def pose(self, strip: Strip, time: Float) -> tuple[Float, Float]:
        """Return local positions (K, 3), m, and rotations (K, 3, 3) at times (K,) since the first strip's start."""
        track = self._strip_track(strip.index)
        distance = (np.asarray(time, dtype=np.float64) - strip.start_time) * self._speed
        distance_on_track = np.clip(distance, 0.0, track.length)
        plan, course, _, _ = track.place(distance_on_track)
        # Before its beginning and after its end the track goes on straight.
        distance_beyond = (distance - distance_on_track)[:, None]
        plan = plan + distance_beyond * np.stack([np.cos(course), np.sin(course)], axis=1)
        height, attitude = self._eased_functions(track)
        position = np.column_stack([plan, height(distance)])
        return position, rotation_matrix(*attitude(distance).T) @ self._mounting

    def _make_track(self, index: int) -> StripTrack:
        """Return the track of the strip with this index."""
        field = f"scan.platform.lateral_offsets[{index}]" if self._named else "scan.platform.lateral_offsets"
        return StripTrack(self._guide, self._offsets[index], self._sway, self._forward[index], field)

    def _eased_functions(self, track: StripTrack) -> tuple[EasedFunction, EasedFunction]:
        """Return height (K, 1), m, and heading, pitch, roll (K, 3), rad, as smooth functions of the distance."""
        step = min(_ATTITUDE_STEP, self._sway.wavelength / 40.0) if self._sway else _ATTITUDE_STEP
        return (
            EasedFunction(lambda distance: self.heights(track, distance)[:, None], track.length, _HEIGHT_STEP, False),
            EasedFunction(lambda distance: self.attitudes(track, distance), track.length, step, True),
        )

    def heights(self, track: StripTrack, distance: Float) -> Float:
        """Return the scanner's local elevation (K,) at distances travelled (K,), m."""
        return self.height + self._guide.elevation(track.stations(distance))

    def attitudes(self, track: StripTrack, distance: Float) -> Float:
        """Return heading, pitch, roll (K, 3), rad, at distances travelled (K,), m: level, along the course."""
        course = track.place(distance)[1]
        return np.column_stack([course, np.zeros((len(course), 2))])

    def surface(self, track: StripTrack, distance: Float, leftward: float) -> Float:
        """Return the undamaged surface's elevation (K,), m, beside the track.

        Args:
            track: of a strip.
            distance: (K,) travelled, m.
            leftward: how far to the left in the direction of travel, m.

        Raises:
            InputError: there is no ground known.
        """
        station = track.stations(distance)
        offset = track.offsets(station)[0] + (leftward if track.forward else -leftward)
        return self._guide.known_ground(station, offset, False)

    def _knots(self, index: int) -> float:
        """Return the largest time between two knots, s, of the strip with this index: see `Path.knot_spacing`."""
        track = self._strip_track(index)
        height, attitude = self._eased_functions(track)
        turn_rate, turn_bend = attitude.bends()  # rad/m and rad/m^2, largest of heading, pitch and roll
        curvature, jump = track.bend
        # A rotation's second derivative is at most the angular velocity squared plus the angular acceleration.
        swing = float(turn_rate.sum() ** 2 + turn_bend.sum())
        bend = np.hypot(curvature, float(height.bends()[1][0])) + KNOT_RANGE * swing
        # By the distance; by time they are the speed's square and the speed as much.
        return knot_spacing_for(bend * self._speed**2, jump * self._speed)


def _guide_and_sway(platform: MovingPlatform, guide: Guide) -> tuple[Guide, Sway | None]:
    """Return the guide that the strips follow, smoothed if asked for, and their zigzag; None without."""
    if platform.path == "smoothed":
        return SmoothedGuide(guide, platform.polynomial_degree), None
    if platform.path == "direct" or platform.zigzag_amplitude == 0.0:
        return guide, None
    if platform.zigzag_wavelength < platform.zigzag_amplitude:
        requirement = f"at least the amplitude, {platform.zigzag_amplitude:g} m, is needed: a shorter sway runs across"
        raise InputError("scan.platform.zigzag_wavelength", platform.zigzag_wavelength, requirement)
    return guide, Sway(platform.zigzag_amplitude, platform.zigzag_wavelength)
