"""The whole road of an OpenDRIVE file as parts of a parameter set."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element  # nosec B405 (its type alone)

import numpy as np

from ...base.arrays import Float
from ...base.remarks import assume
from ...road.given_road import GivenRoad
from ...road.guidelines import STANDARD_CROSS_SECTIONS
from ...scenario.road import RoadScenario
from ..heights import HeightPiece
from ..line import LineNames, PlanPiece, RoadLine, exact_axis
from ..opendrive import read_opendrive
from ..read import choose_line
from ..xml_text import child, children, number, read_xml
from .carriageways import Pavements, Verge, pavements
from .loss import Loss
from .marks import line_markings
from .objects import things
from .places import Places
from .records import FileRoad, read_road
from .shape import SideShape
from .speeds import speed_limit
from .strips import driven_sides, foreign_turnouts, side_layouts
from .surface import FileSurface

_SAME_PLAN = 1e-6
"""Difference below which values of two plans (m, rad and 1/m) are the same."""
_SHOWN = 5


@dataclass(frozen=True)
class WholeRoad:
    """A road of an OpenDRIVE file.

    Attributes:
        line: the road's line in the file.
        given: the road's parts for a parameter set.
        heights: cubics of the profile, stations along the axis; None where the axis has those of the file.
        pavements: what its carriageways are made of.
        loss: what became of what the file says.
        exact: stations of the parameter set at the plan's (file, set), (2, K), m.
        speed: limit of most of its length, km/h; None without any.
    """

    line: RoadLine
    given: GivenRoad
    heights: tuple[HeightPiece, ...] | None
    pavements: Pavements
    loss: Loss
    exact: Float
    speed: float | None

    def stations(self, station: Float) -> Float:
        """Return the stations of the set at those of the file, m."""
        return np.interp(station, *self.exact)


def whole_road(
    path: Path, scenario: RoadScenario, name: str | None = None, round_kinks: float | None = None
) -> WholeRoad:
    """Return all that an OpenDRIVE file says of a road, or of two roads that are its two carriageways.

    Args:
        path: the file.
        scenario: what it doesn't say.
        name: of the road; None: the longest that belongs to no junction.
        round_kinks: distance (m) from kinks of its line that roundings may keep; None refuses kinks.

    Raises:
        MissingFileError, InputError: the file can't be read, or a parameter set can't hold it.
    """
    lines = read_opendrive(path)
    line = choose_line(lines, name, path.name)
    root = read_xml(path)
    elements = _elements(root)
    loss = Loss()
    z_offset = _z_offset(root)
    road = read_road(elements[line.name], line.name, line.length, z_offset)
    roads = [road, *_partner(lines, line, elements, road, z_offset)]
    if len(roads) > 1:
        assume("%s: road %r runs along the same line: both are one road", path.name, roads[1].name)
    axis = exact_axis(line, round_kinks)
    # Stations of the file, and those along the axis: curves may be longer than the file says.
    station_table = np.array(
        [
            [*(piece.station for piece in line.pieces), line.pieces[-1].station + line.pieces[-1].length],
            [*axis.starts, axis.alignment.length],
        ]
    )
    shapes: list[SideShape] = []
    for part in roads:
        surface = FileSurface(part)
        layouts = side_layouts(surface, with_median=len(roads) > 1)
        shapes += [SideShape(surface, layout, part.breaks()) for layout in layouts.values()]
        for layout in layouts.values():
            for _, _, reason in layout.lost:
                loss.leave_out("lanes", reason, surface=True)
            for first_station, last_station in foreign_turnouts(layout, part.sections):
                stretch = (
                    float(np.interp(first_station, *station_table)),
                    float(np.interp(last_station, *station_table)),
                )
                loss.leave_out("turnouts", "their lanes are lanes of the carriageway, without a ramp", stretch=stretch)
        loss.read["lane sections"] += len(part.sections)
    _note_junctions(root, elements, roads, loss)
    pavement_parts = pavements(shapes, _verge(scenario), lambda s: np.interp(s, *station_table), loss)
    heights = None
    if pavement_parts.heights is not None:
        heights = tuple(pavement_parts.heights)
    markings = line_markings(pavement_parts, lambda s: np.interp(s, *station_table), scenario, loss)
    places = [Places(FileSurface(part), axis.alignment, lambda s: np.interp(s, *station_table)) for part in roads]
    given_road = GivenRoad(pavement_parts.carriageways, pavement_parts.turnouts, markings, things(places, loss))
    return WholeRoad(line, given_road, heights, pavement_parts, loss, station_table, speed_limit(roads, loss))


def _elements(root: Element) -> dict[str, Element]:
    """Return the road elements of a file by the names that `read_opendrive` gives its lines."""
    names, elements = LineNames(), dict[str, Element]()
    for number_of, road in enumerate(children(root, "road")):
        elements[names.unique(road.get("name"), f"road {road.get('id', number_of)}")] = road
    return elements


def _note_junctions(root: Element, elements: dict[str, Element], roads: list[FileRoad], loss: Loss) -> None:
    """Note as left out the roads that a junction joins to these roads, as each is a road of its own."""
    ids = {road.element.get("id") for road in roads}
    names = {element.get("id"): name for name, element in elements.items()}
    joined_names: list[str] = []
    for connection in (one for junction in children(root, "junction") for one in children(junction, "connection")):
        if connection.get("incomingRoad") in ids:
            other_id = connection.get("connectingRoad", connection.get("linkedRoad"))
            joined_names += [names[other_id]] if other_id in names and names[other_id] not in joined_names else []
    if joined_names:
        shown_names = ", ".join(joined_names[:_SHOWN]) + (", ..." if len(joined_names) > _SHOWN else "")
        loss.leave_out("roads of junctions", f"--axis-name takes one: {shown_names}", len(joined_names))


def _z_offset(root: Element) -> float:
    """Return the height, m, that the header's offset adds to all heights; 0 without an offset."""
    header = child(root, "header")
    offset = None if header is None else child(header, "offset")
    return 0.0 if offset is None else number(offset, "z", 0.0)


def _partner(
    lines: list[RoadLine], line: RoadLine, elements: dict[str, Element], road: FileRoad, z_offset: float
) -> list[FileRoad]:
    """Return, as a list, the road of the same plan with traffic only on the other side; an empty list without one."""
    signs = driven_sides(road.sections)
    if len(signs) != 1:
        return []
    for other_line in lines:
        if (
            other_line is line
            or other_line.fault
            or other_line.junction != line.junction
            or not _same_plan(other_line, line)
        ):
            continue
        partner = read_road(elements[other_line.name], other_line.name, other_line.length, z_offset)
        if driven_sides(partner.sections) == [-signs[0]]:
            return [partner]
    return []


def _same_plan(one_line: RoadLine, other_line: RoadLine) -> bool:
    """Return whether two lines have the same pieces in plan: start, length, heading and curvatures at the ends.

    A piece that is no clothoid has no such curvatures: of it the start, the length and the heading are compared.
    """
    if len(one_line.pieces) != len(other_line.pieces):
        return False

    def table(line: RoadLine) -> Float:
        return np.array([(p.station, p.length, p.x, p.y, p.heading, *_end_curvatures(p)) for p in line.pieces])

    return bool(np.abs(table(one_line) - table(other_line)).max() < _SAME_PLAN)


def _end_curvatures(piece: PlanPiece) -> tuple[float, float]:
    """Return the curvatures at a piece's ends, 1/m; zeros for one that is no clothoid."""
    return piece.shape if isinstance(piece.shape, tuple) else (0.0, 0.0)


def _verge(scenario: RoadScenario) -> Verge:
    """Return the verge of a scenario's cross-section."""
    section = scenario.cross_section
    return Verge(STANDARD_CROSS_SECTIONS[section].verge if isinstance(section, str) else section.verge)


def with_heights(line: RoadLine, heights: tuple[HeightPiece, ...], round_kinks: float | None = None) -> Any:
    """Return a line's heights from cubics in its file's stations, as intersections along its axis."""
    return exact_axis(replace(line, heights=heights), round_kinks).heights
