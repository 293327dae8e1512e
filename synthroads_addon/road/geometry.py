"""The analytic road: where every strip's boundaries run and how high they lie, at any station, in float64.

This is the truth that the mesh, the cloud and the twin are measured against. The surface is ruled: along one station it
is a polyline through the boundaries; between stations it follows the alignment, the profile and the crossfall.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Bool, Float, Index, Int, without_repeats
from .alignment import Alignment, Element
from .damage import damage_depth
from .instances import InstanceNumbers
from .objects import Side, width_at
from .other_roads.parts import CrossingRoad
from .parameters import AlignmentObject, RoadParameters
from .profile import IntersectionPoint, Profile
from .section import Carriageway, LineMarking, Median, Turnout
from .section_geometry import CarriagewaySection
from .side_roads.mouth import Mouth
from .side_roads.side_road import SideRoad
from .streets.street_geometry import STREET_STRIPS
from .streets.street_side import StreetSide
from .structures.bridge import Bridge
from .structures.caps import capped_elevation
from .structures.tunnel import Tunnel
from .surroundings import Terrain
from .turnout_geometry import STEP, TURNOUT_STRIPS


@dataclass(frozen=True)
class SurfaceStrip:
    """A lengthwise strip of the road between two neighbouring boundaries.

    Attributes:
        kind: ``median``, or one of `CarriagewaySection.kinds`.
        class_name: semantic class of its surface.
        material: name in the material table; a strip of street sides has theirs (`RoadGeometry.materials`).
        instance: instance number of the object that it belongs to; a strip of turnouts or street sides has theirs
            beside them (`RoadGeometry.instances`).
        side: carriageway that it belongs to; None for the median.
    """

    kind: str
    class_name: str
    material: str
    instance: int
    side: Side | None


_SURFACES = {"verge": ("roadside", "verge"), "island": ("roadside", "verge"), "median": ("roadside", "median")}
_STREET_CLASSES = {"gutter": "road", "parking_bay": "road"}
"""Classes of street sides' strips that vehicles drive on; kerbs and footways lie beside the road."""
_SIDES: tuple[Side, ...] = ("left", "right")


class RoadGeometry:
    """A parameter set's geometry, evaluated analytically in local coordinates.

    Attributes:
        alignment: the horizontal alignment in the local frame.
        profile: the vertical profile in local elevation.
        sections: the carriageways' cross-sections by side.
        strips: the M strips from left to right.
        epochs: other epochs of the road, whose rows and columns a mesh of this one has as well: what doesn't change
            is then the same mesh in all of them.

    Example:
        >>> from synthroads_addon import sample_road
        >>> from synthroads_addon.scenario.road import RoadScenario
        >>> geometry = RoadGeometry(sample_road(RoadScenario(length=200.0), seed=2))
        >>> inner, outer = geometry.elevation([100.0, 100.0], [-5.0, -9.0])  # of the right carriageway
        >>> round(100.0 * float(inner - outer) / 4.0, 1)  # crossfall, percent
        2.5
    """

    def __init__(self, parameters: RoadParameters) -> None:
        self.parameters = parameters
        self.epochs: tuple[RoadGeometry, ...] = ()
        self.alignment = alignment_of(parameters.alignment)
        self.profile = profile_of(parameters.alignment)
        self.sections = sections_of(parameters)
        strips = {side: _strips(section) for side, section in self.sections.items()}
        median: list[SurfaceStrip] = []
        if len(strips) == 2:
            owner = next(iter(parameters.of_type(Median).values()), self.sections["left"].carriageway)
            median = [SurfaceStrip("median", *_SURFACES["median"], owner.instance, None)]
        self.strips = (*reversed(strips.get("left", [])), *median, *strips.get("right", []))

    @property
    def length(self) -> float:
        """Return the length of the centreline, m."""
        return self.alignment.length

    @property
    def mesh_sections(self) -> dict[Side, CarriagewaySection]:
        """Return the carriageways' cross-sections by side, with what shapes the surface in any of the road's epochs.

        A mesh has its rows and columns where these need them; its depths are those of `sections`.
        """
        result = self.sections
        for epoch in self.epochs:
            result = {
                side: with_shapes(section, epoch.sections[side]) if side in epoch.sections else section
                for side, section in result.items()
            }
        return result

    @cached_property
    def terrain(self) -> Terrain | None:
        """The terrain, or None if the road has none; looked for once."""
        return self.parameters.terrain

    @cached_property
    def mouths(self) -> dict[str, Mouth]:
        """The mouths of the side roads by id, made once."""
        return {
            name: Mouth(item, self.alignment, self.profile, self.sections[self.parameters.carriageway_of(item).side])
            for name, item in self.parameters.of_type(SideRoad).items()
        }

    @cached_property
    def crossing_roads(self) -> dict[str, CrossingRoad]:
        """The roads that cross above or below and are joined by ramps, by id, looked for once."""
        return self.parameters.of_type(CrossingRoad)

    @cached_property
    def bridges(self) -> dict[str, Bridge]:
        """The bridges that carry the road by id, looked for once."""
        return self.parameters.of_type(Bridge)

    @cached_property
    def tunnels(self) -> dict[str, Tunnel]:
        """The tunnels that the road leads through by id, looked for once."""
        return self.parameters.of_type(Tunnel)

    @cached_property
    def structures(self) -> dict[str, Bridge | Tunnel]:
        """The bridges and tunnels by id."""
        return {**self.bridges, **self.tunnels}

    @cached_property
    def reliefs(self) -> dict[str, Bridge | Tunnel]:
        """The structures by id for which generated ground has a valley or a hill: not above a crossing road."""
        crossed = {road.bridge for road in self.crossing_roads.values()}
        return {name: item for name, item in self.structures.items() if name not in crossed}

    def is_carried(self, station: Float, offset: Float) -> Bool:
        """Return whether stations and offsets (N,), m, lie on a bridge of the road, between the ends of its caps."""
        result = np.zeros(station.shape, dtype=bool)
        for bridge in self.bridges.values():
            there = np.flatnonzero((station > bridge.cap_start) & (station < bridge.cap_end))
            boundaries = self.offsets(station[there])
            result[there] |= (offset[there] <= boundaries[:, 0]) & (offset[there] >= boundaries[:, -1])
        return result

    @property
    def capped(self) -> list[tuple[float, float]]:
        """Return the stations (m) between which caps of bridges, or walkways, take the place of verges and median."""
        return [(structure.cap_start, structure.cap_end) for structure in self.structures.values()]

    def openings(self, side: Side) -> list[tuple[float, float]]:
        """Return the stations (m) between which a carriageway has no verge: side roads' mouths, and caps."""
        mouths = (mouth for mouth in self.mouths.values() if mouth.section.carriageway.side == side)
        return [*((mouth.low.start_station, mouth.high.start_station) for mouth in mouths), *self.capped]

    def joined_steps(self, side: Side) -> list[tuple[float, float]]:
        """Return the stations (m) of the steps at which ramps go on as roads: beside the road is their surface."""
        return [
            tuple(sorted((end, end + (STEP if shape.leaves_forward() else -STEP))))  # type: ignore[misc]
            for shape in self.sections[side].turnouts
            if shape.joined
            for end in [shape.ramp_end()]
        ]

    @cached_property
    def numbers(self) -> InstanceNumbers:
        """The instance numbers of all objects and of their parts, made once."""
        return InstanceNumbers(self.parameters)

    def crossfall(self, carriageway: Carriageway, station: ArrayLike) -> Float:
        """Return a carriageway's crossfall (m/m, positive where it falls to the right) at stations, same shape."""
        stations, percent = zip(*((p.station, p.crossfall_percent) for p in carriageway.crossfall), strict=True)
        return np.interp(np.asarray(station, dtype=np.float64), stations, percent) / 100.0

    def offsets(self, station: ArrayLike) -> Float:
        """Return the (N, M + 1) offsets of the strips' boundaries at N stations, from left (largest) to right, m."""
        return self._across({side: section.distances(station) for side, section in self.sections.items()}, True)

    def boundary_elevations(self, station: ArrayLike) -> Float:
        """Return the (N, M + 1) local elevations of the strips' boundaries at N stations, m, without damage."""
        return self.boundaries(station)[1]

    def boundaries(self, station: ArrayLike) -> tuple[Float, Float]:
        """Return `offsets` and `boundary_elevations` at N stations, which together take little longer than one."""
        station = np.atleast_1d(np.asarray(station, dtype=np.float64))
        distinct_stations, index = without_repeats(station)
        distances = {side: section.distances(distinct_stations) for side, section in self.sections.items()}
        heights_above_profile = {
            side: section.elevations(
                distinct_stations, self.crossfall(section.carriageway, distinct_stations), distances[side]
            )
            for side, section in self.sections.items()
        }
        offsets = self._across(distances, True)
        heights = self.profile.elevation(distinct_stations)[:, None] + self._across(heights_above_profile, False)
        return (offsets, heights) if len(distinct_stations) == len(station) else (offsets[index], heights[index])

    def elevation(self, station: ArrayLike, offset: ArrayLike, boundaries: tuple[Float, Float] | None = None) -> Float:
        """Return the surface's local elevation (N,), m, damage included; NaN outside the outermost boundaries.

        Side roads belong to the surface.

        Args:
            station, offset: (N,), m.
            boundaries: `boundaries` there, if they are known.
        """
        station, offset = _flat_arrays(station, offset)
        result = self.main_elevation(station, offset, boundaries)
        for mouth in self.mouths.values():
            height = mouth.height_at(station, offset)
            result = np.where(np.isnan(height), result, height)
        return result

    def main_elevation(self, station: Float, offset: Float, boundaries: tuple[Float, Float] | None = None) -> Float:
        """Return `elevation` (N,) of the main road alone, which has its verge where a side road joins it.

        Caps of bridges and walkways of tunnels belong to it.
        """
        result = self.uncapped_elevation(station, offset, boundaries)
        if self.structures:
            section = boundaries or self.boundaries(station)
            median = next((number for number, strip in enumerate(self.strips) if strip.side is None), None)
            for structure in self.structures.values():
                result = capped_elevation(structure, result, (station, offset), section, median)
        return result

    def uncapped_elevation(self, station: Float, offset: Float, boundaries: tuple[Float, Float] | None = None) -> Float:
        """Return `main_elevation` (N,) without caps and walkways: verges and median go on as before and behind them."""
        offsets, heights = boundaries or self.boundaries(station)
        strip = self._strip_between(offsets, offset)
        on_road = np.flatnonzero(strip >= 0)
        result = np.full(offset.shape, np.nan)
        index = strip[on_road]
        left_offset, right_offset = offsets[on_road, index], offsets[on_road, index + 1]
        share = (left_offset - offset[on_road]) / np.maximum(left_offset - right_offset, 1e-300)
        result[on_road] = heights[on_road, index] * (1.0 - share) + heights[on_road, index + 1] * share
        for section in self.sections.values():
            if section.carriageway.pavement.is_shaped:
                result -= damage_depth(section, station, offset)
        return result

    def strip_index(self, station: ArrayLike, offset: ArrayLike) -> Index:
        """Return the index (N,) into `strips` of the strip at stations and offsets (N,), m; -1 outside the road."""
        station, offset = _flat_arrays(station, offset)
        return self._strip_between(self.offsets(station), offset)

    def _strip_between(self, boundaries: Float, offset: Float) -> Index:
        """Return the index (N,) of the strip at offsets (N,) between the boundaries' offsets (N, M + 1)."""
        # Boundaries are sorted from left (largest offset) to right: the strip is the one behind the last boundary that
        # isn't to the right of the place.
        index = np.count_nonzero(boundaries >= offset[:, None], axis=1) - 1
        last_strip = len(self.strips) - 1
        # The right-most boundary belongs to the right-most strip that has a width.
        at_end = np.flatnonzero(offset == boundaries[:, -1])
        index[at_end] = last_strip - np.argmax(np.diff(boundaries[at_end], axis=1)[:, ::-1] < 0.0, axis=1)
        return np.where((index < 0) | (index > last_strip), -1, index)

    def instances(self, strip: SurfaceStrip, station: ArrayLike) -> Int:
        """Return the instance numbers (N,) that a strip's surface has at stations (N,)."""
        station = np.atleast_1d(np.asarray(station, dtype=np.float64))
        result = np.full(station.shape, strip.instance, dtype=np.int64)
        if strip.side and strip.kind in TURNOUT_STRIPS:
            for shape in self.sections[strip.side].turnouts:
                start_station, end_station = shape.range()
                result[(station >= start_station) & (station <= end_station)] = shape.turnout.instance
        if strip.side and strip.kind in STREET_STRIPS:
            for street in self.sections[strip.side].streets:
                side = street.side
                result[(station >= side.start_station) & (station <= side.end_station)] = side.instance
        return result

    def material(self, strip: SurfaceStrip, instance: int) -> str:
        """Return the name of a strip's material where its surface has an instance number (`instances`)."""
        streets = self.sections[strip.side].streets if strip.side and strip.kind in STREET_STRIPS else ()
        return next((s.materials[strip.kind] for s in streets if s.side.instance == instance), strip.material)

    def point(self, station: ArrayLike, offset: ArrayLike) -> Float:
        """Return the surface's local points (N, 3) at stations and offsets (N,), m; z is NaN outside the road."""
        station, offset = _flat_arrays(station, offset)
        return np.column_stack([self.alignment.place(station, offset), self.elevation(station, offset)])

    def marking_edges(self, line: LineMarking, station: ArrayLike) -> tuple[Float, Float]:
        """Return the left and the right edge's offsets (N,) of a line marking at stations (N,), m.

        A line between lanes is centred on the boundary; an edge line lies on the edge strip, so that the lane keeps
        its full width (RMS).
        """
        carriageway = self.parameters.carriageway_of(line)
        section = self.sections[carriageway.side]
        shift_of_kind = {"outer_edge": 0.5, "block": 0.5, "turnout_edge": 0.5, "inner_edge": -0.5, "gore_edge": -0.5}
        if line.kind == "free":
            line_distance = width_at(line.offset, np.atleast_1d(station))
        elif line.kind in ("turnout_edge", "gore_edge"):
            inner, outer = section.boundaries_of("turnout_lane", station)
            line_distance = outer if line.kind == "turnout_edge" else inner
        else:
            line_distance = section.lane_boundaries(station)[:, line.boundary]
        centre = carriageway.sign * (line_distance + shift_of_kind.get(line.kind, 0.0) * line.width)
        return centre + line.width / 2, centre - line.width / 2

    def dashes(self, line: LineMarking) -> Float:
        """Return the (D, 2) start and end stations of a marking's dashes, clipped to the road and to its own range."""
        start, end = line.start_station, min(line.end_station, self.length)
        if line.dash_length == 0:
            return np.array([[start, end]]) if end > start else np.empty((0, 2))
        period = line.dash_length + line.gap_length
        dash_starts = start + period * np.arange(max(0, int(np.ceil((end - start) / period))))
        return np.column_stack([dash_starts, np.minimum(dash_starts + line.dash_length, end)])

    def _across(self, by_side: dict[Side, Float], has_sign: bool) -> Float:
        """Return values (N, B) of both sides, innermost first, joined to one row from left to right, (N, M + 1).

        With `has_sign` the values are distances from the centreline, which become offsets: negative on the right.
        """
        parts = []
        for side in _SIDES:
            if side in by_side:
                values = by_side[side] * (self.sections[side].carriageway.sign if has_sign else 1.0)
                parts.append(values[:, ::-1] if side == "left" else values)
        return np.hstack(parts)


def alignment_of(axis: AlignmentObject) -> Alignment:
    """Return the horizontal alignment of a parameter set's axis, in the local frame."""
    elements = [Element(e.length, e.curvature_start, e.curvature_end) for e in axis.horizontal]
    return Alignment(elements, axis.start_x, axis.start_y, np.deg2rad(axis.start_heading_deg))


def profile_of(axis: AlignmentObject) -> Profile:
    """Return the vertical profile of a parameter set's axis, in local elevation."""
    return Profile([IntersectionPoint(p.station, p.elevation, p.radius) for p in axis.vertical])


def sections_of(parameters: RoadParameters) -> dict[Side, CarriagewaySection]:
    """Return the cross-section of every carriageway by side, its turnouts and street sides included."""
    turnouts, streets = parameters.of_type(Turnout).values(), parameters.of_type(StreetSide).values()
    joined = parameters.joined_turnouts
    return {
        item.side: CarriagewaySection(
            item,
            [turnout for turnout in turnouts if turnout.carriageway == name],
            [street for street in streets if street.carriageway == name],
            joined,
        )
        for name, item in parameters.of_type(Carriageway).items()
    }


def with_shapes(section: CarriagewaySection, other: CarriagewaySection) -> CarriagewaySection:
    """Return a copy of a section with what shapes the surface of another epoch's as well."""
    pavement, further = section.carriageway.pavement, other.carriageway.pavement
    update = {}
    for name in ("ruts", "potholes", "settlements", "overlays"):
        items = getattr(pavement, name) or ()
        more = [item for item in getattr(further, name) or () if item not in items]
        if more:
            update[name] = (*items, *more)
    return section.with_pavement(pavement.model_copy(update=update)) if update else section


def halves_meet(parameters: RoadParameters) -> bool:
    """Return whether both directions share a carriageway whose halves turn about the centreline, where they meet."""
    halves = list(parameters.of_type(Carriageway).values())
    return len(halves) == len(_SIDES) and all(
        half.inner_offset == 0.0 and half.rotation_axis == "centreline" for half in halves
    )


def _strips(section: CarriagewaySection) -> list[SurfaceStrip]:
    """Return the strips of one carriageway's surface, innermost first."""
    pavement_surface = ("road", section.carriageway.pavement.kind)
    instance, side = section.carriageway.instance, section.carriageway.side
    surfaces = {kind: _SURFACES.get(kind, pavement_surface) for kind in section.kinds}
    for shape in section.streets[:1]:
        surfaces |= {kind: (_STREET_CLASSES.get(kind, "roadside"), name) for kind, name in shape.materials.items()}
    return [SurfaceStrip(kind, *surfaces[kind], instance, side) for kind in section.kinds]


def _flat_arrays(*values: ArrayLike) -> list[Float]:
    """Return values flattened and broadcast to arrays (N,) of one length."""
    return np.broadcast_arrays(*(np.asarray(value, dtype=np.float64).ravel() for value in values))
