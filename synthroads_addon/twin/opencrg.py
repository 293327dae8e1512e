"""ASAM OpenCRG 1.1: heights of the pavement on a grid along the centreline, for tyres and vehicle dynamics.

A file is a header of text and big-endian numbers of 32 bits (``KRBI``), a record per cross section: the reference
line's heading before it, then the elevation at each long section from right to left; NaN outside of the pavement.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from ..base.arrays import Bool, Float
from ..base.version import generator
from ..road.geometry import RoadGeometry
from ..road.objects import Side
from ..road.parameters import RoadParameters
from ..road.pavement.surface import PavementSurface
from ..road.section import Turnout
from .trace import Trace

ALONG, ACROSS = 0.1, 0.05
"""Distances between cross sections and between long sections, m."""
_BESIDE = 6.0
"""Pavement of turnouts is in the file to this distance from the main road's edge, m: ramps lead away from it."""
_ROWS = 250
"""Cross sections that are worked out at once."""
_RECORD = 80
"""Binary data fill whole lines of so many bytes."""
_LOST = dict.fromkeys(
    ("RoadObject", "LineMarking", "Hatching", "Arrow", "LengthwiseThing", "dash", "strip", "tree", "shrub"),
    "the file is a grid of the pavement's heights",
)
"""Type of object, or kind of part -> why the file has none."""
_WITHIN = ("rut", "pothole", "patch", "crack", "removed")


def write_opencrg(parameters: RoadParameters, path: Path, tolerance: float) -> Trace:
    """Write the elevations of a road's pavement, with all its waves and damage, as OpenCRG; return what is where.

    Args:
        parameters: the road.
        path: the file.
        tolerance: largest chord error of curves, m; cross sections are close enough for any.
    """
    geometry = RoadGeometry(parameters)
    grid, trace = _Grid(geometry), Trace(geometry, "heights on a grid", _WITHIN, _LOST)
    comments: list[str] = []
    for instance, place in _places(geometry, grid):
        trace.record_entity(instance, comment=len(comments))
        comments.append(f"instance {instance}: {place}")
    with path.open("wb") as file:
        file.write("\n".join([*grid.header(comments), ""]).encode("ascii"))
        written = 0
        for records in grid.records():
            file.write(records.astype(">f4").tobytes())
            written += records.size * 4
        file.write(np.full(-written % _RECORD // 4, np.nan, ">f4").tobytes())
    for name, item in parameters.of_type(Turnout).items():
        if item.ramp is not None:
            trace.record_loss(name, f"without its ramp beyond {_BESIDE:g} m from the main road")
    return trace


def _places(geometry: RoadGeometry, grid: _Grid) -> Iterator[tuple[int, str]]:
    """Yield the instance numbers of what the file has, and where in the grid it is."""
    right_count, total_count = int(np.searchsorted(grid.offsets, 0.0)), len(grid.offsets)
    sections = {
        "right": f"long sections 1 to {right_count}",
        "left": f"long sections {right_count + 1} to {total_count}",
    }
    yield geometry.parameters.alignment.instance, "the reference line"
    for side, section in geometry.sections.items():
        yield section.carriageway.instance, sections[side]
        for shape in section.turnouts:
            start_station, end_station = shape.range()
            yield shape.turnout.instance, f"u {start_station:.1f} to {end_station:.1f} of {sections[side]}"


class _Grid:
    """Grid of a road: cross sections from its start to its end, long sections from right to left."""

    def __init__(self, geometry: RoadGeometry) -> None:
        self._geometry, self._surface = geometry, PavementSurface(geometry)
        self.count = max(2, round(geometry.length / ALONG) + 1)
        self.step = geometry.length / (self.count - 1)
        edges = {side: self._edge(side) for side in geometry.sections}
        right_count, left_count = (np.ceil(edges.get(side, 0.0) / ACROSS) for side in ("right", "left"))
        self.offsets = np.arange(-right_count, left_count + 1) * ACROSS
        self._base = float(np.floor(geometry.profile.elevation(np.zeros(1))[0]))

    def _edge(self, side: Side) -> float:
        """Return the largest distance (m) of a carriageway's pavement from the centreline that the grid has."""
        section = self._geometry.sections[side]
        station = np.linspace(0.0, self._geometry.length, max(2, int(self._geometry.length)))
        edge = np.minimum(section.paved_edge(station), section.main_edge(station) + _BESIDE)
        return float(edge.max())

    def header(self, comments: Iterable[str]) -> list[str]:
        """Return the lines of the header, with further comments."""
        start_point, end_point = self._line(np.array([0.0, self._geometry.length]))
        east, north, height = self._geometry.parameters.transform.translate
        metadata = self._geometry.parameters.metadata
        values = {
            "REFERENCE_LINE_START_U": 0.0,
            "REFERENCE_LINE_END_U": self._geometry.length,
            "REFERENCE_LINE_INCREMENT": self.step,
            "REFERENCE_LINE_START_X": start_point[0] + east,
            "REFERENCE_LINE_START_Y": start_point[1] + north,
            "REFERENCE_LINE_END_X": end_point[0] + east,
            "REFERENCE_LINE_END_Y": end_point[1] + north,
            "REFERENCE_LINE_START_Z": self._base + height,
            "REFERENCE_LINE_END_Z": self._base + height,
            "LONG_SECTION_V_RIGHT": self.offsets[0],
            "LONG_SECTION_V_LEFT": self.offsets[-1],
            "LONG_SECTION_V_INCREMENT": ACROSS,
        }
        return [
            "$CT",
            f"Pavement of {metadata.identifier}"[:72],
            f"by {generator()}"[:72],
            f"in {metadata.referenceSystem}"[:72],
            *([f"heights in {metadata.heightReferenceSystem}"[:72]] if metadata.heightReferenceSystem else []),
            *comments,
            "$",
            "$ROAD_CRG",
            *(f"{name:<24} = {float(value)!r}" for name, value in values.items()),
            "$",
            # Without this block readers would move the line to the origin.
            "$ROAD_CRG_MODS",
            "$",
            "$KD_DEFINITION",
            "#:KRBI",
            f"U:reference line u,m,0,{self.step!r}",
            "D:reference line phi,rad",
            *(f"D:long section {number},m" for number in range(1, len(self.offsets) + 1)),
            "$",
            "$" * 72,
        ]

    def records(self) -> Iterator[Float]:
        """Yield cross sections (R, 1 + V), those of the whole road one after the other."""
        for first_row in range(0, self.count, _ROWS):
            row_numbers = np.arange(first_row, min(first_row + _ROWS, self.count))
            station = np.minimum(row_numbers * self.step, self._geometry.length)
            legs = np.diff(self._line(np.append(max(station[0] - self.step, 0.0), station)), axis=0)
            if first_row == 0:  # the line's first point has no leg before it
                legs[0] = legs[1]
            heading = np.arctan2(legs[:, 1], legs[:, 0])
            yield np.column_stack([heading, self._elevations(station)])

    def _line(self, station: Float) -> Float:
        """Return the local plan coordinates (R, 2) of the reference line at stations (R,), m."""
        return self._geometry.alignment.position(station)

    def _elevations(self, station: Float) -> Float:
        """Return the elevations (R, V) above the base at stations (R,)."""
        stations, offsets = (values.ravel() for values in np.meshgrid(station, self.offsets, indexing="ij"))
        is_inside = self._is_inside(stations, offsets)
        stations, offsets = stations[is_inside], offsets[is_inside]
        result = np.full(is_inside.shape, np.nan)
        result[is_inside] = (
            self._geometry.elevation(stations, offsets) + self._surface.height(stations, offsets) - self._base
        )
        return result.reshape(len(station), -1)

    def _is_inside(self, station: Float, offset: Float) -> Bool:
        """Return which places (N,) lie between the outermost edges of pavement: many readers allow no gaps between."""
        bounds = []
        for side, section in self._geometry.sections.items():
            distances = section.distances(station)
            inner = np.zeros(len(station)) if len(self._geometry.sections) > 1 else distances[:, 0]
            distance = offset if side == "left" else -offset
            bounds.append((distance >= inner) & (distance <= distances[:, -2]))
        return np.asarray(np.any(bounds, axis=0))
