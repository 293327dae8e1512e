"""Which lanes a road has along it: the strips of its carriageways, in sections within which none begins or ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...road.geometry import RoadGeometry
from ...road.parameters import Median
from ...road.things.furniture import Side
from ...road.turnout_geometry import TURNOUT_STRIPS, TurnoutShape
from .pieces import CLOSE, Cubics, Float, cubics, merged_stations

SIDES: tuple[Side, ...] = ("left", "right")

TYPES = {
    "median": "median",
    "inner_edge_strip": "border",
    "lane": "driving",
    "outer_edge_strip": "border",
    "hard_shoulder": "stop",
    "island": "none",
    "gore": "restricted",
    "ramp_inner_strip": "border",
    "turnout_edge_strip": "border",
    "turnout_shoulder": "stop",
    "bay": "stop",
    "verge": "shoulder",
}
"""Kind of a strip -> type of the lane that it is; that of a turnout's lane depends on where it is."""
_BESIDE = {"exit": "exit", "entry": "entry"}
_RAMP = {"exit": "offRamp", "entry": "onRamp"}


@dataclass(frozen=True)
class LaneStrip:
    """A strip as a lane of one section.

    Attributes:
        column: its column in the widths of the plan.
        index: among its side's strips, from the inside out; -1 is the side's half of the median.
        kind: of the strip.
        type: of the lane.
        instance: instance number of the object that it belongs to.
    """

    column: int
    index: int
    kind: str
    type: str
    instance: int


@dataclass(frozen=True)
class LaneSection:
    """A lane section.

    Attributes:
        start, end: stations, m.
        pieces: first and last piece of the plan's widths, the last excluded.
        lanes: each side's lanes, from the inside out; lane numbers count them from 1.
    """

    start: float
    end: float
    pieces: tuple[int, int]
    lanes: dict[Side, tuple[LaneStrip, ...]]

    def number(self, side: Side, index: int) -> int:
        """Return the number (without sign) of the lane whose outer border lies outside of a strip; 0 is the centre."""
        return sum(lane.index <= index for lane in self.lanes[side])

    def find(self, side: Side, column: int) -> int | None:
        """Return the number (without sign) of the lane that a column of widths is here, or None."""
        numbers = [n for n, lane in enumerate(self.lanes[side], 1) if lane.column == column]
        return numbers[0] if numbers else None


class LanePlan:
    """A road's strips as lanes.

    Attributes:
        geometry: the road.
        widths: of all strips of both sides, a column each.
        sections: the lane sections in order.
        divided: whether both sides have a carriageway, so that the centre lane lies in the median.
    """

    def __init__(self, geometry: RoadGeometry) -> None:
        self.geometry = geometry
        self.divided = len(geometry.sections) == 2
        self._columns: list[tuple[Side, int, str]] = []
        for side in SIDES:
            if side in geometry.sections:
                if self.divided:
                    self._columns.append((side, -1, "median"))
                self._columns += [(side, i, kind) for i, kind in enumerate(geometry.sections[side].kinds)]
        kinks = [s for section in geometry.sections.values() for s in section.kinks()]
        borders = merged_stations(kinks, 0.0, geometry.length)
        self.widths: Cubics = cubics(self._widths, borders)
        self.sections = tuple(self._sections())

    def _widths(self, station: Float) -> Float:
        parts = []
        for side in SIDES:
            if section := self.geometry.sections.get(side):
                distances = section.distances(station)
                parts.append(np.diff(distances, axis=1, prepend=0.0) if self.divided else np.diff(distances, axis=1))
        return np.hstack(parts)

    def width_at_start(self, piece: int) -> Float:
        """Return all widths (F,) at the beginning of a piece."""
        return np.asarray(self.widths.coefficients[piece, :, 0])

    def _sections(self) -> list[LaneSection]:
        """Return the sections: a new one where a strip begins, ends, becomes something else or has no width."""
        borders = self.widths.borders
        rows = [self._lanes(piece) for piece in range(len(borders) - 1)]
        sections: list[LaneSection] = []
        first = 0
        for piece in range(1, len(rows) + 1):
            if piece < len(rows) and rows[piece] == rows[piece - 1] and not self._pinched(piece, rows[piece]):
                continue
            sections.append(LaneSection(float(borders[first]), float(borders[piece]), (first, piece), rows[first]))
            first = piece
        return sections

    def _pinched(self, piece: int, lanes: dict[Side, tuple[LaneStrip, ...]]) -> bool:
        widths = self.width_at_start(piece)
        return any(widths[lane.column] < CLOSE for side in lanes.values() for lane in side)

    def _lanes(self, piece: int) -> dict[Side, tuple[LaneStrip, ...]]:
        borders = self.widths.borders
        samples = np.linspace(borders[piece], borders[piece + 1], 5)
        there = self._widths(samples).max(axis=0) > CLOSE
        middle = float(samples[2])
        lanes: dict[Side, list[LaneStrip]] = {side: [] for side in SIDES}
        for column, (side, *_) in enumerate(self._columns):
            if there[column]:
                lanes[side].append(self._lane(column, middle))
        return {side: tuple(strips) for side, strips in lanes.items()}

    def _lane(self, column: int, station: float) -> LaneStrip:
        side, index, kind = self._columns[column]
        section = self.geometry.sections[side]
        instance = section.carriageway.instance
        if kind == "median":
            medians = self.geometry.parameters.of_type(Median).values()
            instance = next((item.instance for item in medians), self._left_instance())
        shape = self._turnout(side, station) if kind in TURNOUT_STRIPS else None
        if shape is None:
            return LaneStrip(column, index, kind, TYPES[kind], instance)
        if kind != "turnout_lane":
            return LaneStrip(column, index, kind, TYPES[kind], shape.turnout.instance)
        tip, nose = shape.gore_tip(), shape.nose_station()
        on_ramp = (station - tip) * (nose - tip) > 0.0
        types = _RAMP if on_ramp else _BESIDE
        return LaneStrip(column, index, kind, types[shape.turnout.kind], shape.turnout.instance)

    def _left_instance(self) -> int:
        return self.geometry.sections["left"].carriageway.instance

    def _turnout(self, side: Side, station: float) -> TurnoutShape | None:
        """Return the turnout that makes a side's strips at a station; the last, as `RoadGeometry.instances` has it."""
        last = None
        for shape in self.geometry.sections[side].turnouts:
            low, high = shape.range()
            if low <= station <= high:
                last = shape
        return last

    def linked(self, section: int, other: int, side: Side, column: int) -> int | None:
        """Return the number (without sign) of the lane that one of a section goes on as in its neighbour, or None.

        A lane without width at the border begins or ends there.
        """
        if not 0 <= other < len(self.sections):
            return None
        border = self.sections[max(section, other)].pieces[0]
        if self.width_at_start(border)[column] < CLOSE or self.widths.at_end(border - 1)[column] < CLOSE:
            return None
        return self.sections[other].find(side, column)

    def column_kinks(self) -> NDArray[np.float64]:
        """Return the stations between which all widths are single cubics, m."""
        return self.widths.borders
