"""Surroundings of the pavement, in the road's frame: ground, verge, and points above them."""

from __future__ import annotations

from typing import Literal

import numpy as np
from scipy import ndimage

from ..base.arrays import Bool, Float
from .assemble import GroundShape
from .cloud import STANDING, PointKind, RoadCloud
from .objects import FoundBarrier, StandingObject, facing
from .path import SPACING, CloudPath
from .profiles import ACROSS, STRETCH, Profiles
from .section import MeasuredSection

USUAL_VERGE = 1.5
"""Width of the verge where classes don't tell, m."""
_FARTHEST, _FARTHEST_UNKNOWN = 12.0, 4.0  # m outside of the pavement, of what has a class and what hasn't
_IN_THE_MIDDLE = 0.4  # m from the axis: a guardrail there has a beam on either side
_COARSE = 5  # bins of which a median makes the ground
_BEYOND = 4.0  # m outside of the verge, where the ground no longer is the road's


def standing_points(cloud: RoadCloud, path: CloudPath, profiles: Profiles, section: MeasuredSection) -> StandingObject:
    """Return what stands within reach of the road, with heights above the surface below."""
    chosen = cloud.of(*STANDING)
    xyz, kind = cloud.xyz[chosen], cloud.kind[chosen]
    station, offset = path.project(xyz[:, :2])
    reach = max(_outer(section, 1), _outer(section, -1)) + _FARTHEST
    near = (station > -5.0) & (station < path.length + 5.0) & (np.abs(offset) < reach)
    station, offset, kind, height = station[near], offset[near], kind[near], xyz[near, 2]
    outside = np.where(offset > 0.0, offset - _outer(section, 1), -offset - _outer(section, -1))
    kept = (outside < _FARTHEST_UNKNOWN) | (kind != PointKind.FURNITURE)
    station, offset, kind, height = station[kept], offset[kept], kind[kept], height[kept]
    return StandingObject(station, offset, height - ground_below(profiles, station, offset), kind)


def ground_below(profiles: Profiles, station: Float, offset: Float) -> Float:
    """Return the height (N,) of the surface at stations and offsets (N,), m: medians of 5 m by 0.5 m, gaps filled."""
    rows, columns = profiles.height.shape
    long, wide = -(-rows // _COARSE), -(-columns // _COARSE)
    padded = np.full((long * _COARSE, wide * _COARSE), np.nan)
    padded[:rows, :columns] = profiles.height
    cells = padded.reshape(long, _COARSE, wide, _COARSE).swapaxes(1, 2).reshape(long, wide, -1)
    known = np.isfinite(cells).any(axis=2)
    coarse = np.full((long, wide), np.nan)
    coarse[known] = np.nanmedian(cells[known], axis=1)
    nearest = ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True)
    filled = coarse[tuple(nearest)]
    row = (station - profiles.stations[0]) / _COARSE + 0.5 / _COARSE - 0.5
    column = (offset - profiles.offsets[0]) / (ACROSS * _COARSE) + 0.5 / _COARSE - 0.5
    return np.asarray(ndimage.map_coordinates(filled, np.stack([row, column]), order=1, mode="nearest"))


def face_guardrails(barriers: list[FoundBarrier], section: MeasuredSection) -> list[FoundBarrier]:
    """Return barriers with guardrails' beams on the side of the traffic that they protect from."""
    return [facing(barrier, _face(barrier.offset, section)) for barrier in barriers]


def _face(offset: float, section: MeasuredSection) -> Literal["left", "right", "both"]:
    side = section.sides["left" if offset > 0.0 else "right"]
    if abs(offset) <= side.inner_offset.value:
        if abs(offset) < _IN_THE_MIDDLE:
            return "both"
        return "left" if offset > 0.0 else "right"
    return "right" if offset > 0.0 else "left"


def measure_ground(cloud: RoadCloud, path: CloudPath, section: MeasuredSection, axis_height: Float) -> GroundShape:
    """Return what the ground beside the road is like.

    Args:
        cloud: with ground beyond the verges, or without.
        path: the alignment.
        section: of the road.
        axis_height: (M,) height of the axis at each point of the path, m.
    """
    chosen = np.flatnonzero(cloud.of(PointKind.GROUND, PointKind.VERGE))
    chosen = chosen[:: max(1, len(chosen) // 300_000)]
    station, offset = path.project(cloud.xyz[chosen, :2])
    inside = (station > 0.0) & (station < path.length)
    chosen, station, offset = chosen[inside], station[inside], offset[inside]
    beyond = np.where(offset > 0.0, offset - _outer(section, 1), -offset - _outer(section, -1))
    beside = _usual(section, station, offset)
    verge = beyond[(cloud.kind[chosen] == PointKind.VERGE) & (beyond > 0.1) & beside]
    seen = len(verge) > 200
    width = float(np.clip(np.percentile(verge, 97), 0.5, 5.0)) if seen else USUAL_VERGE
    far = beyond > width + _BEYOND
    outermost = max(_outer(section, 1), _outer(section, -1)) + width
    if far.sum() < 200:
        return GroundShape(outermost + 10.0, 0.0, 0.05, width, seen)
    below = axis_height[np.clip(station[far].astype(np.int64), 0, len(axis_height) - 1)] - cloud.xyz[chosen[far], 2]
    reach = float(np.percentile(np.abs(offset[far]), 99))
    spread = float(np.clip(0.5 * (np.percentile(below, 84) - np.percentile(below, 16)), 0.05, 2.0))
    return GroundShape(max(reach, outermost + 5.0), float(np.median(below)), spread, width, seen)


def _usual(section: MeasuredSection, station: Float, offset: Float) -> Bool:
    """Return which places (N,) lie where the pavement's edge on their side is the road's own."""
    result = np.zeros(len(station), dtype=bool)
    for side in section.sides.values():
        stretch = np.clip((station / (STRETCH * SPACING)).astype(np.int64), 0, len(side.usual) - 1)
        result |= (offset * side.sign > 0.0) & side.usual[stretch]
    return result


def _outer(section: MeasuredSection, sign: int) -> float:
    """Return the distance of one side's outer paved edge from the axis, m."""
    side = section.sides["left" if sign > 0 else "right"]
    return side.inner_offset.value + side.paved_width.value
