"""The road that crosses above or below the main one: a country road of its own, with the mouths of its ramps."""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from ...base.arrays import Bool, Float
from ..geometry import RoadGeometry
from ..guidelines import LIMITS
from ..objects import WidthPoint
from ..other_roads.parts import ConnectingRamp, CrossingRoad
from ..parameters import AlignmentObject, RoadParameters
from ..section import Carriageway, CrossfallPoint, Lane
from ..side_roads.mouth import Mouth
from ..side_roads.side_road import SideRoad
from .grid import FILM, SurfaceGrid, dashes, spans_mask
from .patches import SurfacePatch, side_road_paint_points, side_road_patches

DESIGN_CLASS = "EKL3"
"""Design class of crossing roads (RAL): its lines are theirs."""
NARROWING = 1.0
"""Length before a bridge over which the verges end, m; chosen."""
_ROW = 2.0
"""Largest distance of rows, m: on a crest of 1500 m the chord is 0.3 mm off."""
_LEAST_VERGE = 0.01
"""Width of a verge from which it has faces, m."""
_MOUTH_DASH = 3.0
"""Dashes and gaps of the edge line across a mouth, m: as at a side road's."""
_SAME_ROW = 1e-4


class Crossing:
    """A crossing road: its geometry as a road of its own, its surface and the mouths of its ramps.

    Attributes:
        road: what the set says of it.
        instance: its instance number.
        ramps: those that join it, by id.
        bridge: own stations (m) between which its bridge is, wing walls included; None where it passes below.
    """

    def __init__(
        self,
        parameters: RoadParameters,
        road: CrossingRoad,
        ramps: dict[str, ConnectingRamp],
        bridge: tuple[float, float] | None,
    ) -> None:
        self.road, self.instance, self.ramps, self.bridge = road, road.instance, ramps, bridge
        self._main = parameters

    @cached_property
    def geometry(self) -> RoadGeometry:
        """Its geometry: a country road of two carriageways, whose side roads are the ramps' mouths."""
        road = self.road
        axis = AlignmentObject(
            instance=1,
            start_x=road.start_x,
            start_y=road.start_y,
            start_heading_deg=(road.start_heading_deg + 180.0) % 360.0 - 180.0,
            horizontal=road.horizontal,
            vertical=road.vertical,
        )
        verge: float | tuple[WidthPoint, ...] = road.verge_width
        if self.bridge:
            widths = zip(self._narrowings, (road.verge_width, 0.0, 0.0, road.verge_width), strict=True)
            verge = tuple(WidthPoint(station=s, width=w) for s, w in widths)
        objects: dict[str, Any] = {"alignment": axis}
        for number, (side, sign) in enumerate((("left", 1.0), ("right", -1.0)), 2):
            objects[f"carriageway-{side}"] = Carriageway(
                instance=number,
                side=side,
                inner_offset=0.0,
                hard_shoulder_width=0.0,
                outer_edge_strip_width=road.edge_strip_width,
                lanes=(Lane(width=road.lane_width),),
                inner_edge_strip_width=0.0,
                verge_width=verge,
                verge_slope_percent=road.verge_slope_percent,
                crossfall=(CrossfallPoint(station=0.0, crossfall_percent=-sign * road.crossfall_percent),),
                rotation_axis="centreline",
            )
        for number, (name, ramp) in enumerate(self.ramps.items(), 4):
            objects[name] = SideRoad(
                instance=number,
                carriageway=f"carriageway-{ramp.mouth_side}",
                station=ramp.mouth_station,
                lanes=1,
                lane_width=ramp.lane_width,
                edge_strip_width=ramp.edge_strip_width,
                length=ramp.mouth_length,
                near_radius=ramp.near_radius,
                far_radius=ramp.far_radius,
                grade_percent=ramp.mouth_grade_percent,
                blend_length=min(12.0, ramp.mouth_length - 5.0),
                priority=ramp.priority,
                centre_line=False,
            )
        return RoadGeometry(
            RoadParameters(
                metadata=self._main.metadata,
                transform=self._main.transform,
                design_class=DESIGN_CLASS,
                objects=objects,
            )
        )

    @property
    def _narrowings(self) -> list[float]:
        """Return the stations (m) between which its verges end before its bridge and begin behind it; none without."""
        if self.bridge is None:
            return []
        start, end = self.bridge
        return [start - NARROWING, start, end, end + NARROWING]

    def is_carried(self, station: Float) -> Bool:
        """Return whether its bridge carries it at own stations (N,), m."""
        start, end = self.bridge or (0.0, 0.0)
        return (station > start) & (station < end)

    @property
    def mouths(self) -> dict[str, Mouth]:
        """Return the mouths of its ramps by id."""
        return self.geometry.mouths

    def patches(self, name: str) -> list[SurfacePatch]:
        """Return the pavement and the verges of a ramp's mouth."""
        return side_road_patches(self.geometry, self.mouths[name], None)

    def mouth_paint(self, name: str) -> Float:
        """Return the corners (P, 4, 3) of the markings of a ramp's mouth."""
        return side_road_paint_points(self.geometry, self.mouths[name])

    @cached_property
    def rows(self) -> Float:
        """The stations (R,) of its rows, m."""
        road, limits = self.road, LIMITS[DESIGN_CLASS]
        length = road.length
        marks = [0.0, length, *self._narrowings]
        marks += [s for s in self.geometry.profile.breakpoints.tolist() if 0.0 < s < length]
        marks += [s for span in self._centre_spans(limits.lane_dash, limits.lane_gap) for s in span]
        marks += [s for side in ("left", "right") for span in self._edge_spans(side) for s in span]
        marks = [s for s in marks if 0.0 <= s <= length]
        exact = [m.stations[(m.stations >= 0.0) & (m.stations <= length)] for m in self.mouths.values()]
        fixed = np.unique(np.concatenate([np.array(marks), *exact]))
        keep = np.append(np.diff(fixed) > _SAME_ROW, True)
        fixed = fixed[keep]
        pieces = [np.linspace(a, b, max(1, int(np.ceil((b - a) / _ROW))) + 1)[:-1] for a, b in pairwise(fixed.tolist())]
        return np.append(np.concatenate(pieces), fixed[-1])

    def _mouth_spans(self, side: str) -> list[tuple[float, float]]:
        """Return the stations (m) between which mouths join one side."""
        return sorted(self.geometry.openings(side))  # type: ignore[arg-type]

    def _edge_spans(self, side: str) -> list[tuple[float, float]]:
        """Return the stations (m) between which the edge line of a side is painted: dashed across mouths."""
        spans: list[tuple[float, float]] = []
        begin = 0.0
        for start, end in self._mouth_spans(side):
            spans.append((begin, start))
            spans += list(dashes(start + _MOUTH_DASH, end, _MOUTH_DASH, _MOUTH_DASH))
            begin = end
        return [*spans, (begin, self.road.length)]

    def _centre_spans(self, dash: float, gap: float) -> list[tuple[float, float]]:
        """Return the stations (m) between which the line between its lanes is painted."""
        return list(dashes(0.0, self.road.length, dash, gap))

    @cached_property
    def grid(self) -> SurfaceGrid:
        """Its pavement and verges; where a ramp joins there is no verge, and none on the bridge."""
        road, limits, station = self.road, LIMITS[DESIGN_CLASS], self.rows
        line = limits.narrow_line
        edge, half = road.lane_width, road.half_width
        inner = [edge, min(edge + line, half - 0.01), line / 2.0]
        columns = np.array([half, inner[1], edge, line / 2.0, 0.0, -line / 2.0, -edge, -inner[1], -half])
        verge = self.geometry.sections["left"].road_edge(station) - half
        offset = np.column_stack([half + verge, np.repeat(columns[None], len(station), 0), -half - verge])
        height = self.geometry.profile.elevation(station)[:, None] - road.crossfall_percent / 100.0 * np.abs(
            np.clip(offset, -half, half)
        )
        height[:, [0, -1]] -= (verge * road.verge_slope_percent / 100.0)[:, None]
        stations = np.repeat(station[:, None], offset.shape[1], 1)
        plan = self.geometry.alignment.place(stations.ravel(), offset.ravel()).reshape(*offset.shape, 2)
        kinds = ("verge", *["pavement"] * (len(columns) - 1), "verge")
        cells = (len(station) - 1, len(kinds))
        built, paint = np.ones(cells, dtype=bool), np.zeros(cells, dtype=bool)
        has_verge = np.maximum(verge[1:], verge[:-1]) > _LEAST_VERGE
        for column, side in ((0, "left"), (-1, "right")):
            built[:, column] = has_verge & ~spans_mask(station, self._mouth_spans(side))
        paint[:, 2] = spans_mask(station, self._edge_spans("left"))
        paint[:, -3] = spans_mask(station, self._edge_spans("right"))
        centre = spans_mask(station, self._centre_spans(limits.lane_dash, limits.lane_gap))
        paint[:, 4] = paint[:, 5] = centre
        return SurfaceGrid(np.dstack([plan, height]), stations, offset, kinds, built, paint)

    def outline(self) -> Float:
        """Return the points (N, 3) around its pavement and verges, anticlockwise: along the mouths the pavement's edge.

        On the bridge it is the pavement's edge, too.
        """
        grid, station = self.grid, self.rows
        sides = []
        for column, inner, side in ((0, 1, "left"), (-1, -2, "right")):
            points: list[Float] = []
            spans = self._mouth_spans(side)
            for row, s in enumerate(station.tolist()):
                begins = any(abs(s - start) < _SAME_ROW for start, _ in spans)
                ends = any(abs(s - end) < _SAME_ROW for _, end in spans)
                inside = any(start < s < end for start, end in spans)
                if begins:
                    points += [grid.points[row, column], grid.points[row, inner]]
                elif ends:
                    points += [grid.points[row, inner], grid.points[row, column]]
                else:
                    points.append(grid.points[row, inner if inside else column])
            sides.append(np.array(points))
        left, right = sides
        return np.concatenate([right, grid.points[-1, 1:-1][::-1], left[::-1], grid.points[0, 1:-1]])


def film(points: Float) -> Float:
    """Return points (..., 3) of a surface raised by the thickness of markings."""
    return points + np.array([0.0, 0.0, FILM])
