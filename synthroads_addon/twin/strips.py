"""The strips of the carriageways and the median as polygons whose corners lie on the analytic surface."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..road.alignment import left_vectors
from ..road.damage import damage_columns, damage_depth, damaged_strips, space_shares
from ..road.geometry import RoadGeometry, SurfaceStrip
from ..road.section import Overlay, Pavement, Pothole, Rut, Settlement, SurfaceShape
from ..road.section_geometry import CarriagewaySection
from ..road.turnout_geometry import TURNOUT_STRIPS
from .faces import Faces, Float, drop_unused_points, grid_corners, join_faces, quad_faces, ring_faces

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class StripSurface:
    """The polygons of one strip of the road, as far as the strip belongs to one object.

    Attributes:
        strip: the strip.
        lane: number of its lane, counted from outside; None if it is no lane.
        instance: instance number of the object that it belongs to there.
        faces: its polygons.
    """

    strip: SurfaceStrip
    lane: int | None
    instance: int
    faces: Faces


@dataclass(frozen=True)
class _StripDamage:
    """One rut or pothole on one strip: its stations (m), and the shares of the width at which it needs points."""

    start: float
    end: float
    shares: Float


@dataclass(frozen=True)
class _Edges:
    """The two edges of a strip at N stations, from which its surface points are interpolated.

    Attributes:
        geometry: the road.
        stations: (N,).
        plan, left: (N, 2) points of the centreline, and unit vectors to the left.
        offsets, heights: (N, 2) of the strip's left and right edge.
    """

    geometry: RoadGeometry
    stations: Float
    plan: Float
    left: Float
    offsets: Float
    heights: Float

    def points(self, first_row: int, last_row: int, shares: Float) -> Float:
        """Return surface points (R, C, 3) of a range of rows at shares (C,) of the width, lowered by damage."""
        rows = slice(first_row, last_row + 1)
        offset = self.offsets[rows, :1] * (1.0 - shares) + self.offsets[rows, 1:] * shares
        height = self.heights[rows, :1] * (1.0 - shares) + self.heights[rows, 1:] * shares
        station = np.repeat(self.stations[rows], len(shares))
        for section in self.geometry.sections.values():
            pavement = section.carriageway.pavement
            if pavement.is_shaped:
                height = height - damage_depth(section, station, offset.ravel()).reshape(offset.shape)
        xy = self.plan[rows, None] + offset[..., None] * self.left[rows, None]
        return np.concatenate([xy, height[..., None]], axis=2)


def strip_surfaces(geometry: RoadGeometry, stations: Float, tolerance: float) -> Iterator[StripSurface]:
    """Yield the polygons of every strip from left to right, split by the objects that they belong to.

    Neighbouring strips share their points. Where a strip is damaged it has as many points across as keep it within
    the tolerance.

    Args:
        geometry: the road.
        stations: (N,) stations at which it is sampled.
        tolerance: chord error within damage, m.
    """
    offsets, heights = geometry.boundaries(stations)
    xy, heading, _ = geometry.alignment.frame(stations)
    interval_middles = (stations[:-1] + stations[1:]) / 2.0
    damages, lanes = _damages_by_strip(geometry, tolerance), _lane_numbers(geometry)
    for number, strip in enumerate(geometry.strips):
        edge_columns = slice(number, number + 2)
        edges = _Edges(
            geometry, stations, xy, left_vectors(heading), offsets[:, edge_columns], heights[:, edge_columns]
        )
        width = offsets[:, number] - offsets[:, number + 1]
        owners = geometry.instances(strip, interval_middles)
        is_there = width[:-1] + width[1:] > 1e-9
        openings = geometry.openings(strip.side) if strip.side else geometry.capped
        for start, end in openings if strip.kind in ("verge", "median") else ():
            is_there &= (interval_middles < start) | (interval_middles > end)
        beside = strip.side and (strip.kind == "verge" or strip.kind in TURNOUT_STRIPS)
        for start, end in geometry.joined_steps(strip.side) if beside and strip.side else ():
            is_there &= (interval_middles < start) | (interval_middles > end)
        for owner in np.unique(owners).tolist():
            faces = _strip_faces(edges, damages.get(number, []), is_there & (owners == owner))
            if len(faces):
                yield StripSurface(strip, lanes.get(number), owner, faces)


def _lane_numbers(geometry: RoadGeometry) -> dict[int, int]:
    """Return each lane's number, counted from outside in its carriageway, by the index of its strip."""
    numbers: dict[int, int] = {}
    for side in geometry.sections:
        lanes = [n for n, strip in enumerate(geometry.strips) if strip.side == side and strip.kind == "lane"]
        numbers |= {number: lane for lane, number in enumerate(lanes if side == "left" else lanes[::-1])}
    return numbers


# --- damage -----------------------------------------------------------------------------------------------------


def _damages_by_strip(geometry: RoadGeometry, tolerance: float) -> dict[int, list[_StripDamage]]:
    """Return what shapes the surface of each strip, by the strip's index."""
    damages: dict[int, list[_StripDamage]] = {}
    for side, section in geometry.sections.items():
        strips = [number for number, strip in enumerate(geometry.strips) if strip.side == side]
        strips_outwards = strips[::-1] if side == "left" else strips
        pavement = section.carriageway.pavement
        items: list[SurfaceShape] = [*pavement.ruts, *pavement.potholes]
        items += [*(pavement.settlements or ()), *(pavement.overlays or ())]
        for item in items:
            section_with_item = _with_only(section, item)
            for index in damaged_strips(section_with_item):
                shares = damage_columns(section_with_item, index, tolerance)
                shares = 1.0 - shares[::-1] if side == "left" else shares
                damages.setdefault(strips_outwards[index], []).append(_StripDamage(*_range(item), shares))
    return damages


def _with_only(section: CarriagewaySection, item: SurfaceShape) -> CarriagewaySection:
    """Return a copy of a section with one rut, pothole, settlement or new course as its only damage."""
    other_section, carriageway = copy.copy(section), section.carriageway
    names = {Rut: "ruts", Pothole: "potholes", Settlement: "settlements", Overlay: "overlays"}
    pavement = Pavement().model_copy(update={names[type(item)]: (item,)})
    other_section.carriageway = carriageway.model_copy(update={"pavement": pavement})
    return other_section


def _range(item: SurfaceShape) -> tuple[float, float]:
    """Return the start and end stations (m) of what shapes a pavement's surface."""
    if isinstance(item, Rut | Overlay):
        return item.start_station, item.end_station
    return item.station - item.length / 2.0, item.station + item.length / 2.0


def _row_masks(stations: Float, damages: list[_StripDamage]) -> Mask:
    """Return which damages (N, D) reach the interval before or behind each row, so that its points follow them."""
    starts, ends = np.array([d.start for d in damages]), np.array([d.end for d in damages])
    reaches_interval = (starts < stations[1:, None] - 1e-6) & (ends > stations[:-1, None] + 1e-6)
    reaches_row = np.zeros((len(stations), len(damages)), dtype=bool)
    reaches_row[:-1] |= reaches_interval
    reaches_row[1:] |= reaches_interval
    return reaches_row


def _shares(damages: list[_StripDamage], mask: Mask) -> Float:
    """Return the shares (C,) of the width at which a row needs points, from 0 (left edge) to 1 (right edge)."""
    damage_shares = [damage.shares for damage, is_here in zip(damages, mask.tolist(), strict=True) if is_here]
    return space_shares(np.unique(np.concatenate([[0.0, 1.0], *damage_shares])))


# --- polygons ---------------------------------------------------------------------------------------------------


def _strip_faces(edges: _Edges, damages: list[_StripDamage], interval_mask: Mask) -> Faces:
    """Return a strip's polygons in the chosen intervals (N - 1,) between its rows, in the order of the rows.

    From edge to edge there is one polygon, but where the strip is damaged. Rows with different numbers of points are
    joined by triangles, so that all points are corners on both sides.
    """
    if not interval_mask.any():
        return join_faces([])
    masks = _row_masks(edges.stations, damages) if damages else np.zeros((len(edges.stations), 1), dtype=bool)
    is_regular = np.all(masks[:-1] == masks[1:], axis=1)
    parts = []
    for first_row, last_row in _row_runs(is_regular & interval_mask, interval_mask):
        first_shares, last_shares = (
            _shares(damages, masks[row]) if damages else np.array([0.0, 1.0]) for row in (first_row, last_row)
        )
        if is_regular[first_row]:
            points = edges.points(first_row, last_row, first_shares)
            parts.append(quad_faces(points.reshape(-1, 3), grid_corners(*points.shape[:2])))
        else:
            points = np.concatenate(
                [edges.points(first_row, first_row, first_shares)[0], edges.points(last_row, last_row, last_shares)[0]]
            )
            parts.append(ring_faces(points, triangulate_rows(first_shares, last_shares)))
    return drop_unused_points(join_faces(parts))


def _row_runs(is_regular: Mask, interval_mask: Mask) -> Iterator[tuple[int, int]]:
    """Yield (first, last) rows of chosen intervals: maximal runs with the same damages, or single intervals."""
    intervals = np.flatnonzero(interval_mask)
    starts_run = np.ones(len(intervals), dtype=bool)
    starts_run[1:] = (np.diff(intervals) > 1) | ~is_regular[intervals[1:]] | ~is_regular[intervals[:-1]]
    starts = intervals[starts_run]
    ends = np.append(intervals[:-1][starts_run[1:]], intervals[-1]) + 1
    yield from zip(starts.tolist(), ends.tolist(), strict=True)


def triangulate_rows(rear_shares: Float, front_shares: Float) -> list[list[int]]:
    """Triangulate the band between two rows of points; return triples of point indices.

    Starting at the first points, the band advances on the row whose next point has the smaller share, one triangle per
    step. Each has an edge on one row and its third corner on the other.

    Args:
        rear_shares: (C,) places of the rear row's points along it, increasing; their indices count from 0.
        front_shares: (D,) those of the front row in the same measure; their indices count from C.
    """
    triangles, rear, front, front_start = [], 0, 0, len(rear_shares)
    while rear < len(rear_shares) - 1 or front < len(front_shares) - 1:
        if front == len(front_shares) - 1 or (
            rear < len(rear_shares) - 1 and rear_shares[rear + 1] <= front_shares[front + 1]
        ):
            triangles.append([rear, rear + 1, front_start + front])
            rear += 1
        else:
            triangles.append([front_start + front, rear, front_start + front + 1])
            front += 1
    return triangles
