"""The reference line and the surface around it: plan view, elevation profile and lateral shape."""

from __future__ import annotations

import numpy as np

from ...road.geometry import RoadGeometry
from ...road.things.furniture import Side
from .pieces import Float, merged_stations, runs
from .xml import PLAN_DIGITS, Element, Value, cubic, element

SHAPE_TOLERANCE = 1e-4
"""Largest distance (m) of the surface from what is interpolated between two lateral shapes."""
_HALVINGS = 20
SIDES: tuple[Side, ...] = ("right", "left")
"""From right to left, as t grows."""
_LINE_APART = 1e-4  # m, between the end of a line that stands for several and where it should be
_LINE_TURN = 1e-6  # rad, up to which the standard's checker takes two lines for one


def plan_view(road: Element, geometry: RoadGeometry) -> None:
    """Add the plan view: a line, arc or spiral per element; clothoids too flat to be one are arcs or lines.

    Each begins where the alignment, evaluated in float64, has its border, so that nothing adds up along the road.
    """
    alignment = geometry.alignment
    starts = alignment.element_starts
    position, heading, _ = alignment.frame(starts)
    parent = element(road, "planView")
    for first, last in _joined_lines(geometry, position, heading):
        item = alignment.elements[first]
        attributes: dict[str, Value] = {
            "s": float(starts[first]),
            "x": _plan(position[first, 0]),
            "y": _plan(position[first, 1]),
            "hdg": f"{heading[first] + 0.0:.13g}",
            "length": float(starts[last + 1] - starts[first]),
        }
        kind = element(parent, "geometry", attributes)
        if item.kind == "line":
            element(kind, "line")
        elif item.kind == "arc":
            element(kind, "arc", {"curvature": _curvature(item.mean_curvature)})
        else:
            ends = {"curvStart": _curvature(item.curvature_start), "curvEnd": _curvature(item.curvature_end)}
            element(kind, "spiral", ends)


def _plan(value: float) -> str:
    return repr(round(float(value), PLAN_DIGITS) + 0.0)


def _curvature(value: float) -> str:
    return f"{value + 0.0:.15g}"


def _joined_lines(geometry: RoadGeometry, position: Float, heading: Float) -> list[tuple[int, int]]:
    """Return the first and last element of each geometry: lines that go on straight are one."""
    joined: list[tuple[int, int]] = []
    for number, item in enumerate(geometry.alignment.elements):
        if joined and item.kind == "line" and geometry.alignment.elements[joined[-1][0]].kind == "line":
            first = joined[-1][0]
            forth = position[number + 1] - position[first]
            aside = abs(forth[1] * np.cos(heading[first]) - forth[0] * np.sin(heading[first]))
            if abs(heading[number] - heading[first]) < _LINE_TURN and aside < _LINE_APART:
                joined[-1] = (first, number)
                continue
        joined.append((number, number))
    return joined


def elevation_profile(road: Element, geometry: RoadGeometry) -> None:
    """Add the elevation profile: grades and the parabolas between them are cubics as they are."""
    profile, length = geometry.profile, geometry.length
    borders = merged_stations(profile.breakpoints.tolist(), 0.0, length)
    parent = element(road, "elevationProfile")
    middle = (borders[:-1] + borders[1:]) / 2.0
    bend, grade_there = profile.curvature(middle), profile.grade(middle)
    half = np.diff(borders) / 2.0
    start = grade_there - bend * half
    level = profile.elevation(middle) - half * (start + bend * half / 2.0)
    coefficients = np.stack([level, start, bend / 2.0, np.zeros(len(half))], axis=1)
    for begin, parabola in runs(borders, coefficients):
        cubic(parent, "elevation", {"s": begin}, parabola)


class LateralShape:
    """The road's surface across, relative to the profile: a plane for each carriageway and the median between them.

    The planes go on beyond the pavement; verges fall away from them as lanes with a height.
    """

    def __init__(self, geometry: RoadGeometry) -> None:
        self.geometry = geometry
        stations = self._kinks()
        self.reach = float(np.ceil(np.abs(geometry.offsets(stations)).max())) + 1.0
        """Distance (m) from the reference line up to which the shape is given."""

    def plane(self, side: Side, station: Float, offset: Float) -> Float:
        """Return the height (N,) of a carriageway's plane above the profile at stations and offsets (N,)."""
        section = self.geometry.sections[side]
        sign = section.carriageway.sign
        crossfall = self.geometry.crossfall(section.carriageway, station)
        return np.asarray(sign * crossfall * (sign * offset - section.pivot(station)))

    def corners(self, station: Float) -> tuple[Float, Float]:
        """Return t and the height (N, C) of the polyline across at stations (N,), from right to left."""
        offsets, heights = [], []
        for side in SIDES:
            section = self.geometry.sections.get(side)
            if section is None:
                continue
            inner = section.carriageway.sign * section.distances(station)[:, 0]
            edges = [np.full(station.shape, section.carriageway.sign * self.reach), inner]
            for offset in edges if side == "right" else edges[::-1]:
                offsets.append(offset)
                heights.append(self.plane(side, station, offset))
        return np.stack(offsets, axis=1), np.stack(heights, axis=1)

    def stations(self) -> list[float]:
        """Return the stations between which the shape may be interpolated at any offset, as few as will do."""
        borders = self._kinks().tolist()
        stations = borders[:1]
        for end in borders[1:]:
            stations += self._split(stations[-1], end, _HALVINGS)
        kept = stations[:1]
        for i in range(1, len(stations) - 1):
            if self._off(kept[-1], stations[i + 1], [stations[i]]) > SHAPE_TOLERANCE / 100.0:
                kept.append(stations[i])
        return [*kept, stations[-1]]

    def _split(self, start: float, end: float, halvings: int) -> list[float]:
        """Return the stations after a start up to an end that are needed."""
        samples = [start + share * (end - start) for share in (0.25, 0.5, 0.75)]
        if halvings == 0 or self._off(start, end, samples) <= SHAPE_TOLERANCE:
            return [end]
        return self._split(start, samples[1], halvings - 1) + self._split(samples[1], end, halvings - 1)

    def _off(self, start: float, end: float, samples: list[float]) -> float:
        """Return how far (m) the surface is off at samples if the shape is interpolated from start to end.

        It is looked at where it bends across, at either end and at the samples: in between it is straight.
        """
        t, z = self.corners(np.array([start, end, *samples]))
        worst = 0.0
        for row, station in enumerate(samples, 2):
            share = (station - start) / (end - start)
            offset = np.concatenate([t[0], t[1], t[row]])
            first, last, exact = (np.interp(offset, t[i], z[i]) for i in (0, 1, row))
            within = (offset >= t[:, 0].max()) & (offset <= t[:, -1].min())
            worst = max(worst, float(np.abs(first + share * (last - first) - exact)[within].max()))
        return worst

    def _kinks(self) -> Float:
        stations = [s for section in self.geometry.sections.values() for s in section.kinks()]
        for section in self.geometry.sections.values():
            stations += [point.station for point in section.carriageway.crossfall]
        return merged_stations(stations, 0.0, self.geometry.length)


def lateral_profile(road: Element, shape: LateralShape) -> None:
    """Add the lateral profile: at each of its stations a straight line per carriageway, and one over the median."""
    parent = element(road, "lateralProfile")
    stations = shape.stations()
    offsets, heights = shape.corners(np.array(stations))
    for row, station in enumerate(stations):
        t, z = offsets[row], heights[row]
        for i in range(len(t) - 1):
            width = t[i + 1] - t[i]
            if width > 1e-9:
                slope = (z[i + 1] - z[i]) / width
                cubic(parent, "shape", {"s": station, "t": float(t[i])}, (z[i], slope, 0.0, 0.0))


def bounds(geometry: RoadGeometry) -> dict[str, float]:
    """Return the largest and smallest x and y of the road, to the metre, as the header has them."""
    stations = np.linspace(0.0, geometry.length, max(2, int(geometry.length / 10.0) + 2))
    edges = geometry.offsets(stations)
    points = np.concatenate([geometry.alignment.place(stations, edges[:, i]) for i in (0, -1)])
    low, high = np.floor(points.min(axis=0)) - 1.0, np.ceil(points.max(axis=0)) + 1.0
    return {"north": float(high[1]), "south": float(low[1]), "east": float(high[0]), "west": float(low[0])}
