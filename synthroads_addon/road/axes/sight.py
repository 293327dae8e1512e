"""How far drivers see along a road: past crests and around curves, with what stands beside it taken as a wall.

The road is taken at stations a step apart. A driver sees a target if the straight line between them passes above the
road's surface and between the walls at all stations between.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ...base.arrays import Bool, Float
from ..geometry import RoadGeometry, alignment_of, profile_of
from ..guidelines import LIMITS
from ..parameters import AlignmentObject

EYE_HEIGHT, TARGET_HEIGHT = 1.0, 0.5
"""Heights of a driver's eye and of what is seen first of an obstacle, above the road, m. Chosen: a car's."""
STEP = 10.0
"""Distance of the stations, m. Chosen: a crest of 3000 m rises 4 mm above the chord of a step."""
SHORTEST_DASHED = 100.0
"""Stretches on which drivers see far enough, but which are shorter than this (m), have a solid line. Chosen: nobody
overtakes on less."""
BESIDE_ROAD = 6.0
"""From the middle of the road to where the view ends at either side, beyond half of what is paved, m. Chosen: about
where trees and batters are."""
_BLOCK = 256
"""Eyes at a time: what is computed for a block takes some 20 MB at 1 km of sight."""


def sight_distances(axis: AlignmentObject, eye: Float, clear_width: float, longest: float, direction: int = 1) -> Float:
    """Return how far (N,), m, drivers at stations (N,) see along the axis; infinite where they see past its end.

    Args:
        axis: the alignment.
        eye: stations of the drivers, m.
        clear_width: from the axis to the walls beside the road, m.
        longest: sight (m) beyond which it doesn't matter.
        direction: 1 along the stations, -1 against them.

    Example:
        >>> from synthroads_addon.road.other_roads.axis import HorizontalElement, VerticalPoint
        >>> arc = HorizontalElement.between(600.0, 1 / 300, 1 / 300)
        >>> level = (VerticalPoint(station=0.0, elevation=0.0),)
        >>> axis = AlignmentObject(
        ...     instance=1, start_x=0.0, start_y=0.0, start_heading_deg=0.0, horizontal=(arc,), vertical=level
        ... )
        >>> float(sight_distances(axis, np.array([0.0]), clear_width=6.0, longest=400.0)[0])
        120.0
    """
    eye = np.atleast_1d(np.asarray(eye, dtype=np.float64))
    blocks = [
        _block_sight(axis, eye[first : first + _BLOCK], clear_width, longest, direction)
        for first in range(0, len(eye), _BLOCK)
    ]
    return np.concatenate(blocks) if blocks else np.zeros(0)


def _block_sight(axis: AlignmentObject, eye: Float, clear_width: float, longest: float, direction: int) -> Float:
    """Return `sight_distances` of a few drivers at stations (N,), m."""
    steps = np.arange(1, int(np.ceil(longest / STEP)) + 1)  # (S,)
    stations = eye[:, None] + direction * STEP * np.arange(
        len(steps) + 1
    )  # (N, S + 1): the driver, then the road ahead
    flat_stations = stations.ravel()
    alignment, profile = alignment_of(axis), profile_of(axis)
    positions = alignment.position(flat_stations).reshape(*stations.shape, 2)
    heading = alignment.heading(flat_stations).reshape(stations.shape)
    height = profile.elevation(flat_stations).reshape(stations.shape)
    eye_position, eye_height = positions[:, :1], height[:, :1] + EYE_HEIGHT
    sees = np.ones((len(eye), len(steps)), dtype=bool)
    for target in steps[1:].tolist():
        share = np.arange(1, target) / target  # of the way to the target
        line = eye_position + share[None, :, None] * (positions[:, target : target + 1] - eye_position)
        between = line - positions[:, 1:target]
        to_left = np.cos(heading[:, 1:target]) * between[..., 1] - np.sin(heading[:, 1:target]) * between[..., 0]
        line_height = eye_height + share * (height[:, target : target + 1] + TARGET_HEIGHT - eye_height)
        is_free = (np.abs(to_left) <= clear_width) & (line_height >= height[:, 1:target])
        sees[:, target - 1] = is_free.all(axis=1)
    seen_steps = np.where(sees.all(axis=1), len(steps), np.argmin(sees, axis=1))
    distance = STEP * seen_steps
    room = axis.length - eye if direction > 0 else eye
    return np.where((distance >= room) | sees.all(axis=1), np.inf, distance)


SOLID, WARNING, DASHED = 0, 1, 2
"""Kinds of the line between the directions: not to be crossed, better not crossed, crossed by who overtakes."""


@dataclass(frozen=True)
class LineSights:
    """Sights that decide how the line between the directions is, m.

    Attributes:
        dashed: where drivers both ways see as far as this, it is dashed.
        solid: where they see less than this, it is solid; in between it has warning dashes.
        warning_length: warning dashes lead to a solid line over this distance.
        has_warnings: whether there are warning dashes at all; else the line is solid where it isn't dashed.
    """

    dashed: float
    solid: float = 0.0
    warning_length: float = 0.0
    has_warnings: bool = False


def line_spans(
    axis: AlignmentObject, paved_half: float, sights: LineSights, length: float
) -> list[tuple[float, float, int]]:
    """Return (start m, end m, `SOLID`, `WARNING` or `DASHED`) of the line between the directions, in order.

    Args:
        axis: the alignment.
        paved_half: half of the paved width, m.
        sights: what decides.
        length: of the road, m.
    """
    if not sights.has_warnings:
        spans = overtaking_spans(axis, paved_half, sights.dashed, length)
        return [(start, end, DASHED if may_overtake else SOLID) for start, end, may_overtake in spans]
    stations = np.append(np.arange(0.0, length, STEP), length)
    middles = (stations[:-1] + stations[1:]) / 2.0
    sight = np.min(
        [sight_distances(axis, middles, paved_half + BESIDE_ROAD, sights.dashed, direction) for direction in (1, -1)],
        axis=0,
    )
    least_for_warning = sights.solid or sights.dashed
    kinds = np.where(sight < least_for_warning, SOLID, np.where(sight < sights.dashed, WARNING, DASHED))
    solid_middles = middles[kinds == SOLID]
    if len(solid_middles):
        nearest = np.abs(middles[:, None] - solid_middles[None, :]).min(axis=1)
        kinds[(kinds == DASHED) & (nearest <= sights.warning_length)] = WARNING
    spans_of_kinds: list[tuple[float, float, int]] = []
    borders = [0, *(np.flatnonzero(np.diff(kinds)) + 1).tolist(), len(middles)]
    for first, last in pairwise(borders):
        start, end, kind = float(stations[first]), float(stations[last]), int(kinds[first])
        if kind == DASHED and end - start < min(SHORTEST_DASHED, length):
            kind = WARNING
        if spans_of_kinds and spans_of_kinds[-1][2] == kind:
            start = spans_of_kinds.pop()[0]
        spans_of_kinds.append((start, end, kind))
    return spans_of_kinds


def overtaking_spans(
    axis: AlignmentObject, paved_half: float, sight: float, length: float
) -> list[tuple[float, float, bool]]:
    """Return (start m, end m, whether drivers both ways see as far as they need to overtake) along a road, in order.

    Args:
        axis: the alignment.
        paved_half: half of the paved width, m.
        sight: how far they must see, m.
        length: of the road, m.
    """
    stations = np.append(np.arange(0.0, length, STEP), length)
    middles = (stations[:-1] + stations[1:]) / 2.0
    clear_width = paved_half + BESIDE_ROAD
    far_enough: Bool = np.ones(len(middles), dtype=bool)
    for direction in (1, -1):
        far_enough &= sight_distances(axis, middles, clear_width, sight, direction) >= sight
    borders = [0, *(np.flatnonzero(np.diff(far_enough.astype(np.int8))) + 1).tolist(), len(middles)]
    spans: list[tuple[float, float, bool]] = []
    for first, last in pairwise(borders):
        start, end = float(stations[first]), float(stations[last])
        may_overtake = bool(far_enough[first]) and (end - start >= SHORTEST_DASHED or end - start >= length)
        if spans and spans[-1][2] == may_overtake:
            start = spans.pop()[0]
        spans.append((start, end, may_overtake))
    return spans


class RoadSight(NamedTuple):
    """How far drivers see along a road, and how far they need to.

    Attributes:
        station: (N,) m.
        ahead, back: (N,) sight of drivers with the stations, and of those against them, m; infinite past the end, and
            where it is farther than the longest that matters.
        stopping: sight that they need to stop, m.
        overtaking: sight from which the line between the directions is dashed, m.
    """

    station: Float
    ahead: Float
    back: Float
    stopping: float
    overtaking: float


def road_sight(geometry: RoadGeometry, station: Float) -> RoadSight | None:
    """Return the sight at stations (N,), m, of a road whose guideline asks for one to stop; None for other roads.

    Beside the road the view ends where trees may stand without a barrier.
    """
    parameters = geometry.parameters
    limits = LIMITS[parameters.design_class]
    if not limits.stopping_sight or not geometry.sections:
        return None
    marks = np.unique([0.0, geometry.length, *(s for section in geometry.sections.values() for s in section.kinks())])
    marks = marks[(marks >= 0.0) & (marks <= geometry.length)]
    paved_half = min(float(section.main_edge(marks).max()) for section in geometry.sections.values())
    clear_width, longest = paved_half + limits.obstacle_distance, max(limits.stopping_sight, limits.overtaking_sight)
    ahead, back = (
        sight_distances(parameters.alignment, station, clear_width, longest, direction) for direction in (1, -1)
    )
    return RoadSight(np.asarray(station), ahead, back, limits.stopping_sight, limits.overtaking_sight)
