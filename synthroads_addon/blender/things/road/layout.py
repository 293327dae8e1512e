"""Layout of SR Road, by which its nodes are built; names of its inputs; values of the backbone's attributes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ....road.damage import damage_columns, damage_depth, damaged_strips, deepest_damage
from ....road.geometry import RoadGeometry, halves_meet, sections_of
from ....road.objects import AnyWidth, Side, nominal_width, width_at
from ....road.parameters import RoadParameters
from ....road.section import Carriageway, LineMarking, Turnout
from ....road.section_geometry import CarriagewaySection
from ....road.side_roads.side_road import SideRoad
from ....road.streets.street_geometry import STREET_STRIPS
from ....road.streets.street_side import StreetSide
from ....road.stretches import BEYOND
from ....road.structures.bridge import Bridge
from ....road.structures.tunnel import Tunnel
from ....road.turnout_geometry import TURNOUT_STRIPS

Float = NDArray[np.float64]
Int = NDArray[np.int64]

TURNOUT_NAMES = tuple(kind.replace("_", " ").title() for kind in TURNOUT_STRIPS)
"""Names, in inputs and attributes, of the strips that turnouts add, from the hard shoulder outwards."""


STREET_NAMES = tuple(kind.replace("_", " ").title() for kind in STREET_STRIPS)
"""Names of the strips that street sides add, from the pavement outwards."""


def strips_of(lanes: int, turnouts: bool, streets: bool = False) -> list[str]:
    """Return the names of a carriageway's strips from the median outwards: "Inner Edge Strip", "Lane 2", ..."""
    numbers = [f"Lane {number}" for number in range(lanes, 0, -1)]
    further = [*TURNOUT_NAMES * turnouts, *STREET_NAMES * streets]
    return ["Inner Edge Strip", *numbers, "Outer Edge Strip", "Hard Shoulder", *further, "Verge"]


def width_field(strip: str) -> str:
    """Return the input field name of a strip's width, or of the inner offset: "Lane 1" -> "lane_1_width"."""
    return strip.lower().replace(" ", "_") + ("" if strip == "Inner Offset" else "_width")


def detail_field(strip: str) -> str:
    """Return the input field name of the points that refine a strip: "Lane 1" -> "lane_1_detail"."""
    return f"{strip.lower().replace(' ', '_')}_detail"


def aged_strips(lanes: int) -> list[str]:
    """Return the names of a carriageway's strips whose age may differ from the road's: lanes, hard shoulder."""
    return [*(f"Lane {number}" for number in range(lanes, 0, -1)), "Hard Shoulder"]


def brightness_field(strip: str) -> str:
    """Return the input field name of a strip's brightness by its age: "Lane 1" -> "lane_1_brightness"."""
    return f"{strip.lower().replace(' ', '_')}_brightness"


@dataclass(frozen=True)
class MarkingLayout:
    """Properties of a line marking on which the road's node group depends.

    Attributes:
        name: its name in inputs, without the side: ``Lane Line 1``.
        kind: its kind, see `LineMarking`.
        boundary: number of the boundary of lanes that it lies on, counted from the outer edge of lane 1.
        varies: whether its distance from the axis changes along the road.
        yellow: whether it is temporary, and so yellow.
        between: whether it lies half on the other carriageway, in whose plane that half is.
    """

    name: str
    kind: str
    boundary: int = 0
    varies: bool = False
    yellow: bool = False
    between: bool = False


@dataclass(frozen=True)
class SideLayout:
    """Properties of one carriageway on which the road's node group depends.

    Attributes:
        side: ``Left`` or ``Right``.
        lanes: number of lanes.
        markings: its line markings.
        varying: names of the strips (and ``Inner Offset``) whose widths change along the road.
        turnouts: names of its turnouts in inputs, without the side: ``Exit 1``.
        streets: names of its street sides in inputs, without the side: ``Street Side 1``.
        detailed: names of the strips with damage.
        openings: whether side roads join it, or it lies on bridges or in tunnels, or ramps go on from its turnouts as
            roads of their own.
        caps: whether caps of bridges, or walkways of tunnels, take the place of verges and median.
    """

    side: str
    lanes: int
    markings: tuple[MarkingLayout, ...] = ()
    varying: tuple[str, ...] = ()
    turnouts: tuple[str, ...] = ()
    detailed: tuple[str, ...] = ()
    streets: tuple[str, ...] = ()
    openings: bool = False
    caps: bool = False

    @property
    def left(self) -> bool:
        """Return whether it is the left carriageway."""
        return self.side == "Left"


def road_layout(
    parameters: RoadParameters, mesh_sections: Mapping[Side, CarriagewaySection] | None = None
) -> tuple[SideLayout, ...]:
    """Return the layout of each carriageway by which the road's node group is built, left side first.

    Args:
        parameters: the road.
        mesh_sections: cross-sections by whose damage strips are finer; the road's own if None.
    """
    sides, sections, words = [], sections_of(parameters), names_in_words(parameters)
    caps = bool(parameters.of_type(Bridge) or parameters.of_type(Tunnel))
    for name, carriageway in sorted(parameters.of_type(Carriageway).items(), key=lambda item: -item[1].sign):
        side_lines = [(key, line) for key, line in parameters.of_type(LineMarking).items() if line.carriageway == name]
        turnouts = tuple(words[key] for key, item in parameters.of_type(Turnout).items() if item.carriageway == name)
        streets = tuple(words[key] for key, item in parameters.of_type(StreetSide).items() if item.carriageway == name)
        section = sections[carriageway.side]
        varying_strips = {key for key, width in strip_widths(carriageway) if isinstance(width, tuple)}
        if turnouts:
            varying_strips.add("Hard Shoulder")
        sides.append(
            SideLayout(
                carriageway.side.title(),
                len(carriageway.lanes),
                tuple(
                    MarkingLayout(
                        words[key],
                        line.kind,
                        line.boundary,
                        isinstance(line.offset, tuple),
                        line.color == "yellow",
                        line.kind == "free" and line.offset == 0.0 and halves_meet(parameters),
                    )
                    for key, line in side_lines
                ),
                tuple(sorted(varying_strips)),
                turnouts,
                tuple(
                    strip_names(section)[strip]
                    for strip in damaged_strips(mesh_sections[carriageway.side] if mesh_sections else section)
                ),
                streets,
                caps
                or any(item.carriageway == name for item in parameters.of_type(SideRoad).values())
                or any(shape.joined for shape in section.turnouts),
                caps,
            )
        )
    return tuple(sides)


_LINES = {
    "outer_edge": "Outer Edge Line",
    "inner_edge": "Inner Edge Line",
    "lane": "Lane Line",
    "block": "Block Line",
    "turnout_edge": "Turnout Edge Line",
    "gore_edge": "Gore Edge Line",
    "free": "Free Line",
}
_TURNOUTS = {"emergency_bay": "Emergency Bay", "bus_bay": "Bus Bay", "layby": "Layby", "exit": "Exit", "entry": "Entry"}


def names_in_words(parameters: RoadParameters) -> dict[str, str]:
    """Return the names in words of lines, turnouts and street sides by id, as inputs have them: "Lane Line 1".

    If a side has several of a kind, they are numbered in their order.
    """
    kinds_by_key = {key: (item.carriageway, _TURNOUTS[item.kind]) for key, item in parameters.of_type(Turnout).items()}
    for key, street in parameters.of_type(StreetSide).items():
        kinds_by_key[key] = (street.carriageway, "Street Side")
    for key, line in parameters.of_type(LineMarking).items():
        prefix = "Temporary " if line.color == "yellow" else ""
        kinds_by_key[key] = (line.carriageway, prefix + _LINES[line.kind])
    keys_by_kind: dict[tuple[str, str], list[str]] = {}
    for key, kind in kinds_by_key.items():
        keys_by_kind.setdefault(kind, []).append(key)
    numbers = {key: number for keys in keys_by_kind.values() if len(keys) > 1 for number, key in enumerate(keys, 1)}
    return {key: f"{kind} {numbers[key]}" if key in numbers else kind for key, (_, kind) in kinds_by_key.items()}


def side_of(parameters: RoadParameters, item: LineMarking | Turnout | StreetSide) -> str:
    """Return the side, "Left" or "Right", of the carriageway that a line, turnout or street side lies on."""
    carriageway = parameters.objects[item.carriageway]
    assert isinstance(carriageway, Carriageway)
    return carriageway.side.title()


def strip_widths(carriageway: Carriageway) -> Iterator[tuple[str, AnyWidth]]:
    """Yield (name, width, m or by station) of the inner offset and the strips, from the median outwards."""
    yield "Inner Offset", carriageway.inner_offset
    yield "Inner Edge Strip", carriageway.inner_edge_strip_width
    for number in range(len(carriageway.lanes), 0, -1):
        yield f"Lane {number}", carriageway.lanes[number - 1].width
    yield "Outer Edge Strip", carriageway.outer_edge_strip_width
    yield "Hard Shoulder", carriageway.hard_shoulder_width
    yield "Verge", carriageway.verge_width


def attribute_name(side: str, strip: str) -> str:
    """Return the backbone attribute's name for a strip of varying width: "Left", "Lane 1" -> "left_lane_1"."""
    return f"{side}_{strip}".lower().replace(" ", "_")


def varying_widths(geometry: RoadGeometry, station: Float) -> dict[str, Float]:
    """Return the backbone's attributes (N,) of varying widths at stations (N,), by name: shares of the input, or m.

    A strip of varying width has its width as a share of the input's; the hard shoulder beside turnouts also has
    ``..._main``, its share without turnouts. Strips of turnouts have their widths, the verge the added width
    ``..._extra``, and ramps ``..._ramp_width``, ``..._ramp_lift`` and ``..._ramp_tilt``, see `RampFields`; these are in
    m, the tilt in m/m. Strips of street sides have their widths, ``..._lift`` the heights of their outer boundaries
    above the pavement's plane, and the verge its ``..._extra`` too, in m.
    """
    values: dict[str, Float] = {}
    road, words = geometry.parameters, names_in_words(geometry.parameters)
    lines = {(side_of(road, line), words[key]): line for key, line in road.of_type(LineMarking).items()}
    for layout in road_layout(road):
        section = geometry.sections["left" if layout.side == "Left" else "right"]
        for strip, width in strip_widths(section.carriageway):
            if strip in layout.varying:
                share = width_at(width, station) / (nominal_width(width) or 1e-9)
                values[attribute_name(layout.side, strip)] = share
        for marking in layout.markings:
            line = lines[layout.side, marking.name]
            if marking.varies:
                share = width_at(line.offset, station) / (nominal_width(line.offset) or 1e-9)
                values[attribute_name(layout.side, marking.name)] = share
        if layout.turnouts:
            values |= _turnout_widths(layout.side, section, station)
            ramps = section.ramp_fields(station, geometry.crossfall(section.carriageway, station))
            values |= {attribute_name(layout.side, f"ramp {name}"): value for name, value in vars(ramps).items()}
        if layout.streets:
            values |= _street_fields(layout.side, section, station)
    return values


def _turnout_widths(side: str, section: CarriagewaySection, station: Float) -> dict[str, Float]:
    """Return the backbone's attributes (N,) of a side with turnouts: widths of strips, shares of the hard shoulder."""
    shapes = [shape.widths(station) for shape in section.turnouts]
    values = {
        attribute_name(side, name): sum((shape.strips[kind] for shape in shapes), 0.0 * station)
        for kind, name in zip(TURNOUT_STRIPS, TURNOUT_NAMES, strict=True)
    }
    shoulder_width = section.carriageway.hard_shoulder_width
    nominal_shoulder_width = max(nominal_width(shoulder_width), 1e-9)
    values[attribute_name(side, "Hard Shoulder Main")] = width_at(shoulder_width, station) / nominal_shoulder_width
    shoulder_without_extra = np.minimum.reduce([shape.hard_shoulder for shape in shapes])
    values[attribute_name(side, "Hard Shoulder")] = (
        sum((shape.shoulder_extra for shape in shapes), shoulder_without_extra) / nominal_shoulder_width
    )
    values[attribute_name(side, "Verge Extra")] = sum((shape.verge_extra for shape in shapes), 0.0 * station)
    return values


def _street_fields(side: str, section: CarriagewaySection, station: Float) -> dict[str, Float]:
    """Return the backbone's attributes (N,) of a side with street sides: widths, lifts, the verge's change, m."""
    fields = section.street_fields(station)
    names = dict(zip(STREET_STRIPS, STREET_NAMES, strict=True))
    values = {attribute_name(side, names[kind]): width for kind, width in fields.widths.items()}
    values |= {attribute_name(side, f"{names[kind]} Lift"): lift for kind, lift in fields.lifts.items()}
    return values | {attribute_name(side, "Verge Extra"): fields.verge_extra}


@dataclass(frozen=True)
class DetailPoints:
    """Arrays of a damaged strip's grid points, (columns * rows,): row by row within a column, columns from the left.

    Attributes:
        share: position across the strip as a share of its width, 1 at its left edge.
        depth: depth below the undamaged surface, m.
        instance: instance number of the damage in the cell after the point in both directions; 0 for none.
    """

    share: Float
    depth: Float
    instance: Int


def detail_points(geometry: RoadGeometry, station: Float, tolerance: float) -> dict[str, DetailPoints]:
    """Return the grid points of all damaged strips, by strip ("Right Lane 1"), with a row at each station."""
    points = {}
    ids = {id(item): name for name, item in geometry.parameters.objects.items()}
    mesh_sections = geometry.mesh_sections
    for side, section in geometry.sections.items():
        carriageway, mesh_section = section.carriageway, mesh_sections[side]
        names, distances = strip_names(section), section.distances(station)
        for strip in damaged_strips(mesh_section):
            # Only damage near the stretch: columns for all of a long road's damage would make slivers of the cells.
            station_range = float(station[0]) - BEYOND, float(station[-1]) + BEYOND
            # Position of each column across the strip, (C, 1), from 0 at its inner edge; arrays below are (C, N), by
            # column and station.
            outward_share = damage_columns(mesh_section, strip, tolerance, *station_range)[:, None]
            distance = distances[:, strip] * (1.0 - outward_share) + distances[:, strip + 1] * outward_share
            offset = float(carriageway.sign) * distance
            depth = damage_depth(section, np.tile(station, len(outward_share)), offset.ravel()).reshape(offset.shape)
            # On the left carriageway outwards is to the left.
            share = np.tile(outward_share if carriageway.sign > 0 else 1.0 - outward_share, len(station))
            # Where the edges jump, faces are so skew that rounding would flip narrow ones: inner columns are merged.
            steps = _steps(station, distances[:, strip : strip + 2])
            share[1:-1, steps], depth[:, steps] = 0.0, 0.0
            # From the left column to the right one.
            order = slice(None, None, -carriageway.sign)
            damage = _damage_of_cells(section, station, offset[order])
            parts = geometry.numbers.parts.get(ids[id(carriageway)])
            # The last number is that of no damage, -1.
            numbers = np.append(parts.all_numbers() if parts else np.empty(0, np.int64), 0)[damage]
            points[f"{carriageway.side.title()} {names[strip]}"] = DetailPoints(
                share[order].ravel(), depth[order].ravel(), np.where(damage < 0, 0, numbers).ravel()
            )
    return points


def _damage_of_cells(section: CarriagewaySection, station: Float, offset: Float) -> Int:
    """Return the index (C, N) of the damage in each grid cell, stored at its first corner; -1 for none.

    A cell belongs to the damage that is deepest in its middle.
    """
    cell_station = (station[1:] + station[:-1]) / 2.0
    cell_offset = (offset[1:, 1:] + offset[1:, :-1] + offset[:-1, 1:] + offset[:-1, :-1]) / 4.0
    result = np.full(offset.shape, -1, dtype=np.int64)
    result[:-1, :-1] = deepest_damage(section, np.tile(cell_station, len(cell_offset)), cell_offset.ravel()).reshape(
        cell_offset.shape
    )
    return result


def _steps(station: Float, edges: Float) -> NDArray[np.bool_]:
    """Return a mask (N,) of the stations at which a strip's edges (N, 2) jump sideways, steeper than 45 degrees."""
    is_skew = np.abs(np.diff(edges, axis=0)).max(axis=1) > np.diff(station)
    return np.append(is_skew, False) | np.insert(is_skew, 0, False)


def strip_names(section: CarriagewaySection) -> list[str]:
    """Return the names of a section's strips as inputs and attributes use them, innermost first."""
    names, lane = [], len(section.carriageway.lanes)
    for kind in section.kinds:
        names.append(f"Lane {lane}" if kind == "lane" else kind.replace("_", " ").title())
        lane -= kind == "lane"
    return names
