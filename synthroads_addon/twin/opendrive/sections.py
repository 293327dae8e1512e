"""Which lanes a road has along it: the strips of its carriageways, in sections within which none begins or ends."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...road.objects import Side
from ...road.section import Median
from ...road.section_geometry import CarriagewaySection
from ...road.streets.street_geometry import STREET_STRIPS
from ...road.turnout_geometry import STEP, TURNOUT_STRIPS, TurnoutShape
from .pieces import CLOSE, Cubics, Float, fit_cubics
from .surface import RoadFrame

SIDES: tuple[Side, ...] = ("left", "right")
RULES = {"right": "RHT", "left": "LHT"}
"""Side that traffic keeps to, and the name that OpenDRIVE has for it."""
_OTHER: dict[Side, Side] = {"left": "right", "right": "left"}
SHORTEST_SECTION = 0.25
"""Shortest lane section, m: SUMO drops those of 10 cm and less."""

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
    "gutter": "border",
    "parking_bay": "parking",
    "kerb_face": "curb",
    "kerb": "curb",
    "footway": "sidewalk",
    "verge": "shoulder",
}
"""Kind of a strip -> type of the lane that it is; that of a turnout's lane depends on where it is."""
_BESIDE = {"exit": "exit", "entry": "entry"}
_RAMP = {"exit": "offRamp", "entry": "onRamp"}


def _changing_columns(columns_before: set[int], columns_after: set[int], count: int) -> list[list[int]]:
    """Return runs of adjacent columns that exist on one side of a border only, before or after it."""
    runs: list[list[int]] = [[]]
    for column in range(count):
        if column in columns_before and column in columns_after:
            runs.append([])
        elif column in columns_before or column in columns_after:
            runs[-1].append(column)
    return [run for run in runs if run]


@dataclass(frozen=True)
class LaneStrip:
    """A strip of the road as a lane of one lane section.

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
    """A lane section: a range of stations in which no lane begins or ends.

    Attributes:
        start, end: stations, m.
        pieces: first and last piece of the plan's widths, the last excluded.
        lanes: each side's lanes, from the inside out; lane numbers count them from 1.
    """

    start: float
    end: float
    pieces: tuple[int, int]
    lanes: dict[Side, tuple[LaneStrip, ...]]

    def lane_number(self, side: Side, index: int) -> int:
        """Return the unsigned lane number whose outer border is that of a strip's index; 0 is the centre lane."""
        return sum(lane.index <= index for lane in self.lanes[side])

    def find(self, side: Side, column: int) -> int | None:
        """Return the unsigned lane number of a width column in this section, or None if it has no lane here."""
        numbers = [n for n, lane in enumerate(self.lanes[side], 1) if lane.column == column]
        return numbers[0] if numbers else None


class LanePlan:
    """Lanes and lane sections of an OpenDRIVE road, with their widths as cubics.

    The centre lane lies at the carriageway's inner edge, all its strips to one side; the median, if it belongs to the
    road, is the one lane to the other. With both directions on one carriageway it lies between them.

    Attributes:
        frame: the carriageway as a road.
        geometry: the road that it is a carriageway of.
        side: which one; with both directions the one along the stations.
        widths: of its strips and the median, in its plane, a column each.
        sections: the lane sections in order.
    """

    def __init__(self, frame: RoadFrame) -> None:
        self.frame, self.geometry, self.side = frame, frame.geometry, frame.side
        self._columns: list[tuple[Side, int, str]] = []
        for side in frame.sides:
            self._columns += [(side, i, kind) for i, kind in enumerate(self.section(side).kinds)]
        if frame.has_median:
            self._columns.append((_OTHER[self.side], -1, "median"))
        self._cuts = np.array([station for span in frame.cuts for station in span])
        self.widths: Cubics = fit_cubics(self._widths, frame.borders)
        self.sections = tuple(self._merge_short(self._sections()))

    def section(self, side: Side) -> CarriagewaySection:
        """Return the cross-section of the carriageway on a side."""
        return self.geometry.sections[side]

    def offsets(self, station: Float, side: Side) -> Float:
        """Return t (N, M) of a carriageway's strip borders, from the inside out, at stations (N,), m."""
        section, settled = self.section(side), self._settled(station, side)
        distances, falls = section.carriageway.sign * section.distances(settled), self.falls(station, side)
        columns = range(distances.shape[1])
        return np.stack([self.frame.t_coordinate(station, distances[:, i], falls[:, i]) for i in columns], axis=1)

    def falls(self, station: Float, side: Side) -> Float:
        """Return how far (N, M) a carriageway's strip borders, from the inside out, lie below the road's plane, m.

        Those of the main road lie in it, unless both sides of a roof are one road; the verge's outer edge doesn't, nor
        do ramps with a plane of their own.
        """
        settled = self._settled(station, side)
        return self.frame.fall(side, settled, self.section(side).distances(settled))

    def _is_cut(self, station: float, side: Side) -> bool:
        """Return whether a ramp goes on as a road of its own from a station, m, where the verge begins anew."""
        shapes = (shape for shape in self.section(side).turnouts if shape.joined)
        return any(abs(shape.ramp_end() - station) < CLOSE for shape in shapes)

    def _settled(self, station: Float, side: Side) -> Float:
        """Return stations (N,) with those within the step at a joined ramp's end moved to behind it, m.

        There the ramp ends at once, as it goes on as a road of its own.
        """
        for shape in self.section(side).turnouts:
            if shape.joined:
                borders = self.frame.borders
                end = float(borders[np.abs(borders - shape.ramp_end()).argmin()])
                if shape.leaves_forward():
                    station = np.where((station >= end) & (station < end + STEP), end + STEP, station)
                else:
                    station = np.where((station >= end - STEP) & (station < end), end - STEP, station)
        return station

    def median_fall(self, station: Float) -> Float:
        """Return how far (N,) the other carriageway's inner edge lies below this one's plane, m."""
        other = RoadFrame.elevation_of_plane(self.geometry, _OTHER[self.side], station, self._far_edge(station))
        return np.asarray(self.frame.plane_elevation(station, self._far_edge(station)) - other)

    def _far_edge(self, station: Float) -> Float:
        """Return the offsets (N,) of the other carriageway's inner edge, m."""
        other = self.geometry.sections[_OTHER[self.side]]
        return np.asarray(other.carriageway.sign * other.distances(station)[:, 0])

    def _widths(self, station: Float) -> Float:
        """Return the widths (N, F) of the columns in the carriageway's plane at stations (N,), m; the median's last."""
        columns = []
        offsets = {side: self.offsets(station, side) for side in self.frame.sides}
        for side in self.frame.sides:
            sign = self.section(side).carriageway.sign
            widths = sign * (offsets[side][:, 1:] - offsets[side][:, :-1])
            for start, end in self.geometry.openings(side):
                widths[(station >= start) & (station < end), -1] = 0.0
            columns.append(widths)
        widths = np.hstack(columns)
        if self.frame.has_median:
            far_edge = self.frame.t_coordinate(station, self._far_edge(station), self.median_fall(station))
            sign = self.section(self.side).carriageway.sign
            widths = np.column_stack([widths, sign * (offsets[self.side][:, 0] - far_edge)])
        return np.asarray(widths, dtype=np.float64)

    def width_at_start(self, piece: int) -> Float:
        """Return the widths (F,) of all columns at the beginning of a piece, m."""
        return np.asarray(self.widths.coefficients[piece, :, 0])

    def _sections(self) -> list[LaneSection]:
        """Return the lane sections, divided where a strip begins, ends, changes its type or has no width."""
        borders = self.widths.borders
        rows = [self._lanes(piece) for piece in range(len(borders) - 1)]
        sections: list[LaneSection] = []
        first_piece = 0
        for piece in range(1, len(rows) + 1):
            is_cut = piece < len(rows) and bool(np.abs(self._cuts - borders[piece]).min(initial=np.inf) < CLOSE)
            if (
                piece < len(rows)
                and rows[piece] == rows[piece - 1]
                and not self._pinched(piece, rows[piece])
                and not is_cut
            ):
                continue
            sections.append(
                LaneSection(float(borders[first_piece]), float(borders[piece]), (first_piece, piece), rows[first_piece])
            )
            first_piece = piece
        return sections

    def _merge_short(self, sections: list[LaneSection]) -> list[LaneSection]:
        """Return the lane sections with those shorter than `SHORTEST_SECTION` merged into the next one.

        A short one is part of the next (or the last), in which what it has begins at once, with its width there.
        """
        sections_kept: list[LaneSection] = []
        short_section: LaneSection | None = None
        for section in sections:
            if section.end - section.start < SHORTEST_SECTION and section is not sections[-1]:
                short_section = short_section or section
                continue
            sections_kept.append(section if short_section is None else self._begin_earlier(section, short_section))
            short_section = None
        return sections_kept

    def _begin_earlier(self, section: LaneSection, short_section: LaneSection) -> LaneSection:
        """Return a section extended back over a short one before it; adjusts the plan's widths there, in place."""
        first_piece, end_piece = short_section.pieces[0], section.pieces[0]
        columns_before = self._columns_of(self._lanes(first_piece - 1) if first_piece > 0 else section.lanes)
        columns_after = self._columns_of(section.lanes)
        for run in _changing_columns(columns_before, columns_after, len(self._columns)):
            self._hand_over_width(run, [column for column in run if column in columns_after], (first_piece, end_piece))
        return replace(section, start=short_section.start, pieces=(first_piece, section.pieces[1]))

    @staticmethod
    def _columns_of(lanes: Mapping[Side, Iterable[LaneStrip]]) -> set[int]:
        """Return the columns of the lanes of both sides."""
        return {lane.column for strips in lanes.values() for lane in strips}

    def _hand_over_width(self, columns: list[int], new_columns: list[int], pieces: tuple[int, int]) -> None:
        """Give the width of adjacent columns, on a range of pieces, to those among them that are new, in place.

        All new columns but the last get the constant width that they have right behind the range; the last one gets
        what is left, so that the sum of the widths stays the same.
        """
        if not new_columns:
            return
        first_piece, end_piece = pieces
        coefficients = self.widths.coefficients
        total_width = coefficients[first_piece:end_piece, columns].sum(axis=1)
        for column in new_columns[:-1]:
            coefficients[first_piece:end_piece, column] = (coefficients[end_piece, column, 0], 0.0, 0.0, 0.0)
        coefficients[first_piece:end_piece, new_columns[-1]] = total_width - coefficients[
            first_piece:end_piece, new_columns[:-1]
        ].sum(axis=1)

    def _pinched(self, piece: int, lanes: dict[Side, tuple[LaneStrip, ...]]) -> bool:
        """Return whether any of the lanes has no width at the start of a piece."""
        widths = self.width_at_start(piece)
        return any(widths[lane.column] < CLOSE for side in lanes.values() for lane in side)

    def _lanes(self, piece: int) -> dict[Side, tuple[LaneStrip, ...]]:
        """Return each side's lanes on a piece, from the inside out: the columns that have a width anywhere on it."""
        borders = self.widths.borders
        # Where a side road's opening ends the verge begins with the next piece.
        end = np.nextafter(borders[piece + 1], borders[piece]) if len(self._cuts) else borders[piece + 1]
        samples = np.linspace(borders[piece], end, 5)
        has_width = self._widths(samples).max(axis=0) > CLOSE
        middle = float(samples[2])
        lanes: dict[Side, list[LaneStrip]] = {side: [] for side in SIDES}
        for column, (side, *_) in enumerate(self._columns):
            if has_width[column]:
                lanes[side].append(self._lane(column, middle))
        return {side: tuple(strips) for side, strips in lanes.items()}

    def _lane(self, column: int, station: float) -> LaneStrip:
        """Return a column as a lane with the type and the owner's instance number that it has at a station (m)."""
        side, index, kind = self._columns[column]
        if kind == "median":
            medians = self.geometry.parameters.of_type(Median).values()
            instance = next((item.instance for item in medians), self._left_instance())
        else:
            instance = self.section(side).carriageway.instance
        if kind in STREET_STRIPS:
            streets = (shape.side for shape in self.section(side).streets)
            instance = next((s.instance for s in streets if s.start_station <= station <= s.end_station), instance)
        shape = self._turnout(side, station) if kind in TURNOUT_STRIPS else None
        if shape is None:
            is_between = kind == "inner_edge_strip" and len(self.frame.sides) > 1
            return LaneStrip(column, index, kind, "median" if is_between else TYPES[kind], instance)
        if kind != "turnout_lane":
            return LaneStrip(column, index, kind, TYPES[kind], shape.turnout.instance)
        tip, nose = shape.gore_tip(), shape.nose_station()
        on_ramp = (station - tip) * (nose - tip) > 0.0
        types = _RAMP if on_ramp else _BESIDE
        return LaneStrip(column, index, kind, types[shape.turnout.kind], shape.turnout.instance)

    def _left_instance(self) -> int:
        """Return the left carriageway's instance number, which a median without an object of its own has."""
        return self.geometry.sections["left"].carriageway.instance

    def _turnout(self, side: Side, station: float) -> TurnoutShape | None:
        """Return the turnout at a station on a side, or None; of several the last, as in `RoadGeometry.instances`."""
        turnout_here = None
        for shape in self.geometry.sections[side].turnouts:
            start_station, end_station = shape.range()
            if start_station <= station <= end_station:
                turnout_here = shape
        return turnout_here

    def continuing_lane(self, section: int, neighbour: int, side: Side, column: int) -> int | None:
        """Return the unsigned number of the lane that continues a column in a neighbouring section, or None.

        A lane without width at the border begins or ends there.
        """
        if not 0 <= neighbour < len(self.sections):
            return None
        border = self.sections[max(section, neighbour)].pieces[0]
        if self._columns[column][2] == "verge" and self._is_cut(float(self.widths.borders[border]), side):
            return None
        if self.width_at_start(border)[column] < CLOSE or self.widths.at_end(border - 1)[column] < CLOSE:
            return None
        return self.sections[neighbour].find(side, column)
