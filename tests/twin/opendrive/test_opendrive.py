"""Roads as OpenDRIVE: read back after the standard's formulas, and by the programs of others."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthroads_addon.base.errors import InputError
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.guidelines import is_single
from synthroads_addon.road.objects import LineObject, PointObject
from synthroads_addon.road.paint import arrow_outlines, hatching_outlines
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.section import LineMarking, Turnout
from synthroads_addon.road.surroundings import Vehicle
from synthroads_addon.road.things.beacon import ConstructionBeacon
from synthroads_addon.road.things.gantry import Gantry
from synthroads_addon.road.things.overpass import Overpass
from synthroads_addon.road.things.sign import TrafficSign
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from synthroads_addon.twin.opendrive.pieces import chord_stations, fit_cubics, join_cubics
from synthroads_addon.twin.opendrive.writer import geo_reference, write_opendrive
from synthroads_addon.twin.plants import placed_plants
from tests.helpers.files.opendrive_reader import (
    Lane,
    OpenDrive,
    Roads,
    Section,
    corners_local,
    corners_road,
    notes_of,
    number,
)
from tests.helpers.roads.checker_full_road import full
from tests.helpers.roads.sampled_parts import PAIRS, full_road, full_roads, scenario
from tests.helpers.roads.side_roads import roof
from tests.helpers.roads.villages import village_road
from tests.judges import require
from tests.judges.opendrive import quality, quality_faults

ORIGIN = (294_010.123456, 5_628_000.456789, 181.25)
EVERYTHING = {"turnouts": {"exits": 1, "entries": 1, "emergency_bays": 1}, "lane_changes": {"share": 1}}
MILLIMETRE = 1e-3
TOLERANCE = 0.005


def written(road: RoadParameters, folder: Path) -> Roads:
    path = folder / "road.xodr"
    write_opendrive(road, path, TOLERANCE)
    return Roads.read(path)


def changed(road: RoadParameters, **objects: dict) -> RoadParameters:
    """Return a road of which some objects have other values."""
    data = road.to_dict()
    for name, values in objects.items():
        data["objects"][name.replace("__", "-")].update(values)
    return RoadParameters.from_dict(data)


def everything() -> RoadParameters:
    data = full()
    data["transform"] = {"translate": list(ORIGIN)}
    return RoadParameters.from_dict(data)


def curved(road: RoadParameters) -> RoadParameters:
    """Return a road on an egg clothoid, clothoids too flat to be one, and an S."""
    length = road.alignment.length
    bends = [(0.0, 0.0), (0.0, 1e-12), (1 / 900, 1 / 900), (1 / 900, 1 / 400), (1 / 400, 1 / 400 + 1e-11)]
    bends += [(1 / 400, -1 / 500), (-1 / 500, -1 / 500), (-1 / 500, 0.0)]
    kinds = ["line", "clothoid", "arc", "clothoid", "clothoid", "clothoid", "arc", "clothoid"]
    share = length / len(bends)
    elements = [
        {"kind": kind, "length": share, "curvature_start": a, "curvature_end": b}
        for kind, (a, b) in zip(kinds, bends, strict=True)
    ]
    return changed(road, axis={"horizontal": elements, "start_heading_deg": 123.4, "start_x": -7.0, "start_y": 5.5})


def single(road: RoadParameters, side: str) -> RoadParameters:
    """Return a road without one carriageway and what belongs to it."""
    data = road.to_dict()
    gone = [name for name, item in data["objects"].items() if item.get("side") == side] + ["median"]
    turnouts = [n for n, i in data["objects"].items() if i["type"] == "Turnout" and i["carriageway"] in gone]
    data["objects"] = {
        name: item
        for name, item in data["objects"].items()
        if name not in gone
        and item.get("carriageway") not in gone
        and item.get("turnout") not in turnouts
        and name not in turnouts
    }
    return RoadParameters.from_dict(data)


def widening(road: RoadParameters) -> RoadParameters:
    """Return a road whose median opens and closes while the crossfall changes, about its inner edges."""
    points = [{"station": s, "width": w} for s, w in ((200.0, 2.0), (420.0, 4.5), (700.0, 3.0))]
    falls = [{"station": s, "crossfall_percent": q} for s, q in ((150.0, 2.5), (300.0, -2.5), (600.0, 6.0))]
    return changed(
        road,
        right={"inner_offset": points, "crossfall": falls},
        left={"rotation_axis": "inner_edge", "inner_offset": points[:2], "crossfall": falls[1:]},
    )


def country(section: str) -> RoadParameters:
    """Return a road with one carriageway, which is a roof, one plane, and what lies between them."""
    return sample_road(RoadScenario.from_dict({"cross_section": section, "length": 600.0}), 3)


ROADS = {
    "everything": everything,
    "curved": lambda: curved(everything()),
    "right only": lambda: single(everything(), "left"),
    "left only": lambda: single(everything(), "right"),
    "widening": lambda: widening(everything()),
    "sampled": lambda: sample_road(scenario(length=1500.0, **EVERYTHING), 7),
    "narrow": lambda: full_road("EKA1A", "RQ36", 3),
    "wide": lambda: full_road("EKA3", "RQ38.5", 5),
    "village": village_road,
    "short": lambda: sample_road(scenario(length=1.0), 3),
    "country": lambda: country("RQ11"),
    "2+1": lambda: country("RQ15.5"),
    "roof": lambda: roof(country("RQ11.5+")),
    "unmarked": lambda: country("RQ7.5"),
}


MANY = ("left only", "sampled", "wide", "country", "unmarked")
"""Roads that the slow tests alone take: another of their kind is among the quick ones."""


@pytest.fixture(
    params=[pytest.param(name, marks=pytest.mark.slow if name in MANY else ()) for name in ROADS], scope="module"
)
def road(request: pytest.FixtureRequest) -> RoadParameters:
    return ROADS[request.param]()


@pytest.fixture(scope="module")
def read(road: RoadParameters, tmp_path_factory: pytest.TempPathFactory) -> Roads:
    return written(road, tmp_path_factory.mktemp("opendrive"))


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """A function that returns the file of one of the roads, which is written once."""
    folder = tmp_path_factory.mktemp("files")

    def of(name: str) -> Path:
        path = folder / f"{name}.xodr"
        if not path.exists():
            write_opendrive(ROADS[name](), path, TOLERANCE)
        return path

    return of


# --- the road -----------------------------------------------------------------------------------------------------


def stations(length: float, apart: float = 1.0) -> np.ndarray:
    """Return stations so far apart (m), and places that aren't whole metres."""
    return np.unique(np.concatenate([np.arange(0.0, length, apart), np.linspace(0.0, length, 301), [length]]))


def truth(geometry: RoadGeometry, s: np.ndarray, offset: np.ndarray, z: np.ndarray) -> np.ndarray:
    plan, heading, _ = geometry.alignment.frame(s)
    left = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    return np.column_stack([plan + offset[:, None] * left, z]) + geometry.parameters.transform.translate


def away_from_steps(geometry: RoadGeometry, s: np.ndarray) -> np.ndarray:
    """Return the stations without those at which a nose or a ramp's end changes the road within 5 cm."""
    kinks = np.unique([0.0, *(k for section in geometry.sections.values() for k in section.kinks())])
    steps = kinks[:-1][np.diff(kinks) < 0.06]
    return s[np.abs(s[:, None] - steps).min(axis=1, initial=np.inf) > 0.3]


def strips_of(geometry: RoadGeometry, read: OpenDrive, section: Section) -> dict[int, int]:
    """Return the strip of each lane of a section, whose kinds are the same."""
    ends = section.start + 0.3, section.end - 0.01
    offsets = geometry.offsets(np.linspace(min(ends), max(ends), 50))
    there = np.any(offsets[:, :-1] - offsets[:, 1:] > 1e-6, axis=0)
    strips = [
        i
        for i, strip in enumerate(geometry.strips)
        if there[i] and (strip.side in (read.side, None, "") or read.side == "both")
    ]
    if read.side == "left" or len(geometry.sections) == 1:
        strips = [i for i in strips if geometry.strips[i].kind != "median"]
    lanes = sorted(section.lanes, reverse=True)
    assert [section.lanes[n].notes["strip"] for n in lanes] == [geometry.strips[i].kind for i in strips]
    return dict(zip(lanes, strips, strict=True))


def worst_border(road: RoadParameters, read: Roads, apart: float = 1.0) -> float:
    """Return the largest distance (m) of a lane's border from its strip's boundary, beside it or in height.

    A place of a tilted road that climbs lies up to 10 cm farther along it than its s says: where a border runs
    obliquely it may be as much beside its strip's as that makes.
    """
    geometry = RoadGeometry(road)
    where = away_from_steps(geometry, stations(read.length, apart))
    places, boundaries, said = [], [], []
    for part in read.roads:
        for section, own, points in part.border_points(where):
            for lane, strip in strips_of(geometry, part, section).items():
                # From left to right: a lane on the right has its inner border to its left.
                borders = (lane, lane - 1) if lane > 0 else (lane + 1, lane)
                for border, boundary in zip(borders, (strip, strip + 1), strict=True):
                    places.append(points[border])
                    boundaries += len(points[border]) * [boundary]
                    said.append(own)
    return _off(geometry, np.concatenate(places), np.array(boundaries), np.concatenate(said))


def _off(geometry: RoadGeometry, points: np.ndarray, boundaries: np.ndarray, said: np.ndarray) -> float:
    """Return how far points (N, 3), said to be at stations (N,), lie from the strips' boundaries (N,)."""
    local = points - geometry.parameters.transform.translate
    s, t = geometry.alignment.project(local[:, :2])
    inside = (s > 0.1) & (s < geometry.length - 0.1)
    s, t, z, boundaries, said = s[inside], t[inside], local[inside, 2], boundaries[inside], said[inside]
    farther = np.abs(s - said)
    assert farther.max() < 0.1
    each = np.arange(len(s)), boundaries
    beside = np.abs(t - geometry.offsets(s)[each])
    above = np.abs(z - geometry.boundary_elevations(s)[each])
    as_said = np.abs(t - geometry.offsets(said)[each])
    above = above - np.abs(kerb_rise(geometry, s)[each] - kerb_rise(geometry, said)[each])
    level = 0.02 * np.abs(geometry.offsets(s + 0.02)[each] - geometry.offsets(s - 0.02)[each]) / 0.04
    return float(np.maximum(np.minimum(beside, as_said), above - level).max())


def kerb_rise(geometry: RoadGeometry, s: np.ndarray) -> np.ndarray:
    """Return how far (N, M) boundaries at stations (N,) lie above their side's gutter: a file has it where it says."""
    heights, kinds = geometry.boundary_elevations(s), [strip.kind for strip in geometry.strips]
    rise = np.zeros(heights.shape)
    for side in geometry.sections if "gutter" in kinds else ():
        (gutter,) = [i for i, strip in enumerate(geometry.strips) if (strip.kind, strip.side) == ("gutter", side)]
        if side == "left":
            rise[:, :gutter] = heights[:, :gutter] - heights[:, gutter, None]
        else:
            rise[:, gutter + 2 :] = heights[:, gutter + 2 :] - heights[:, gutter + 1, None]
    return rise


def test_lanes_lie_where_the_strips_do(road: RoadParameters, read: Roads) -> None:
    assert worst_border(road, read, 2.0) < 0.2 * MILLIMETRE


def test_reference_line_is_the_centreline(road: RoadParameters, read: Roads) -> None:
    geometry, s = RoadGeometry(road), stations(read.length)
    roads = 1 if is_single(road.design_class) else len(geometry.sections)
    assert [part.length for part in read.roads] == pytest.approx([geometry.length] * roads, abs=1e-9)
    wanted = truth(geometry, s, np.zeros(len(s)), np.zeros(len(s)))
    for part in read.roads:
        section = geometry.sections["right" if part.side == "both" else part.side]
        pivot = section.carriageway.sign * section.pivot(s)
        rise = geometry.crossfall(section.carriageway, s)
        level = geometry.profile.elevation(s) - rise * pivot + geometry.parameters.transform.translate[2]
        found = part.point(s, np.zeros(len(s)))
        assert np.abs(found[:, :2] - wanted[:, :2]).max() < 2e-3 * MILLIMETRE
        assert np.abs(found[:, 2] - level).max() < 2e-3 * MILLIMETRE


def without_damage(road: RoadParameters) -> RoadGeometry:
    data = road.to_dict()
    for item in data["objects"].values():
        if item["type"] == "Carriageway":
            item.get("pavement", {}).pop("ruts", None)
            item.get("pavement", {}).pop("potholes", None)
    return RoadGeometry(RoadParameters.from_dict(data))


def test_surface_between_borders_is_the_analytic_one(road: RoadParameters, read: Roads) -> None:
    geometry = without_damage(road)
    where = away_from_steps(geometry, stations(read.length)[::4])
    places, wide, oblique, steep = [], [], [], []
    for part in read.roads:
        for section, own in part.section_of(where):
            borders = section.borders(own, part.lane_offset(own))
            for i, lane in section.lanes.items():
                inner, outer = borders[i - int(np.sign(i))], borders[i]
                low, high = lane.height(own)
                for share in (0.3, 0.9):
                    places.append(part.point(own, inner + share * (outer - inner), low + share * (high - low)))
                    wide.append(np.abs(outer - inner) > 1e-3)
                    # A kerb's face is measured square to it.
                    face = np.abs(high - low) / np.maximum(np.abs(outer - inner), 1e-9)
                    steep.append(np.hypot(1.0, face) if lane.notes["strip"] == "kerb_face" else np.ones(len(own)))
                    oblique.append(np.abs(np.gradient(outer, own)) if len(own) > 1 else np.zeros(1))
    local = np.concatenate(places) - geometry.parameters.transform.translate
    s, t = geometry.alignment.project(local[:, :2])
    wanted = geometry.elevation(s, t)
    there = np.concatenate(wide) & ~np.isnan(wanted) & (s > 0.05) & (s < read.length - 0.05)
    assert np.count_nonzero(there) > 100
    # A place of a tilted road lies a little farther along it than its s says: see `worst_border`.
    above = np.abs(local[:, 2] - wanted) / np.concatenate(steep) - 0.002 * np.concatenate(oblique)
    assert above[there].max() < MILLIMETRE


def test_clothoids_too_flat_are_arcs_or_lines(file: Callable[[str], Path]) -> None:
    read = Roads.read(file("curved"))
    (kinds,) = {tuple(item[0].tag for item in part.road.findall("planView/geometry")) for part in read.roads}
    # The first clothoid is a line and goes on with the line before it.
    assert kinds == ("line", "arc", "spiral", "arc", "spiral", "arc", "spiral")


def test_lanes_are_linked_both_ways_if_they_go_on(read: Roads) -> None:
    for before, after in (pair for part in read.roads for pair in pairwise(part.sections)):
        border = np.array([after.start])
        kinds = [strip_of(lane) for lane in after.lanes.values()]
        for i, lane in before.lanes.items():
            width = float(lane.width.at(border - 1e-9)[0])
            other = lane.links.get("successor")
            if strip_of(lane) not in kinds:
                assert other is None
                continue
            begun = float(after.lanes[twin(after, lane)].width.at(border)[0])
            assert (other is not None) == (width > 1e-6 and begun > 1e-6)
            if other is not None:
                assert after.lanes[other].links["predecessor"] == i
                assert after.lanes[other].notes["strip"] == lane.notes["strip"]
                assert after.lanes[other].notes.get("lane") == lane.notes.get("lane")
        back = [lane.links["predecessor"] for lane in after.lanes.values() if "predecessor" in lane.links]
        assert sorted(back) == sorted(i for i, lane in before.lanes.items() if "successor" in lane.links)


def twin(section: Section, lane: Lane) -> int:
    """Return the number of the lane of a section that is the same strip as another's."""
    (number,) = [i for i, other in section.lanes.items() if strip_of(other) == strip_of(lane)]
    return number


def strip_of(lane: Lane) -> tuple[bool, str, str | None]:
    """Return whether a lane lies left of the reference line, its strip's kind and its number among driven lanes."""
    return lane.number > 0, lane.notes["strip"], lane.notes.get("lane")


def test_lane_types_and_owners(file: Callable[[str], Path]) -> None:
    road = everything()
    read = Roads.read(file("everything"))
    objects = road.objects
    found = {
        (lane.notes["strip"], lane.type, int(lane.notes["instance"]))
        for part in read.roads
        for s in part.sections
        for lane in s.lanes.values()
    }
    right, left = objects["right"].instance, objects["left"].instance
    assert {(kind, type_) for kind, type_, _ in found} == {
        ("median", "median"),
        ("inner_edge_strip", "border"),
        ("lane", "driving"),
        ("outer_edge_strip", "border"),
        ("hard_shoulder", "stop"),
        ("island", "none"),
        ("gore", "restricted"),
        ("ramp_inner_strip", "border"),
        ("turnout_lane", "exit"),
        ("turnout_lane", "offRamp"),
        ("turnout_lane", "entry"),
        ("turnout_lane", "onRamp"),
        ("turnout_edge_strip", "border"),
        ("bay", "stop"),
        ("verge", "shoulder"),
    }
    owners = {kind: {i for k, _, i in found if k == kind} for kind, _, _ in found}
    assert owners["median"] == {objects["median"].instance}
    assert owners["lane"] == owners["verge"] == {left, right}
    assert owners["turnout_lane"] == {objects["exit"].instance, objects["entry"].instance}
    assert owners["bay"] == {objects["bay"].instance}


# --- as readers read it -------------------------------------------------------------------------------------------


def test_a_line_that_leads_across_the_lanes_is_written(tmp_path: Path) -> None:
    """Its offset is given by points; such lines lead around construction zones."""
    road = everything()
    name = next(n for n, item in road.objects.items() if isinstance(item, LineMarking) and item.kind == "lane")
    across = [{"station": 0.0, "width": 4.0}, {"station": 40.0, "width": 8.0}]
    written(changed(road, **{name: {"kind": "free", "boundary": 0, "offset": across}}), tmp_path)
    assert f'name="{name}' in (tmp_path / "road.xodr").read_text()


def test_ids_are_numbers_and_names_are_the_sets(road: RoadParameters, read: Roads) -> None:
    for tag in ("road", "object", "signal", "tunnel"):
        ids = [item.attrib["id"] for item in read.root.iter(tag)]
        assert all(text.isdigit() for text in ids)
        assert len(set(ids)) == len(ids), tag
    for part in read.roads:
        assert road.objects[part.road.attrib["name"]].instance == int(part.road.attrib["id"])


def test_no_section_is_too_short_for_readers(read: Roads) -> None:
    sections = [section for part in read.roads for section in part.sections[:-1]]
    assert min((section.end - section.start for section in sections), default=1.0) > 0.2


def test_hard_shoulders_are_for_emergencies(read: Roads) -> None:
    for lane in (lane for part in read.roads for section in part.sections for lane in section.lanes.values()):
        found = [(item.get("rule"), item.get("restriction")) for item in lane.item.findall("access")]
        assert found == ([("allow", "emergency")] if lane.type == "stop" else [])


def speeds(part: OpenDrive, s: float) -> set[float]:
    """Return the speeds of a road's driving lanes at a station, km/h."""
    (section,) = [item for item in part.sections if item.start <= s < item.end]
    found = set()
    for lane in (lane for lane in section.lanes.values() if lane.type == "driving"):
        (speed,) = [v for v in lane.item.findall("speed") if section.start + number(v, "sOffset") <= s][-1:]
        assert speed.get("unit") == "km/h"
        found.add(number(speed, "max"))
    return found


def test_speeds_are_those_of_the_signs(tmp_path: Path) -> None:
    data = everything().to_dict()
    objects = data["objects"]
    sign = next(item for item in objects.values() if item["type"] == "TrafficSign")
    for name in [name for name, item in objects.items() if item["type"] == "TrafficSign"]:
        del objects[name]
    for i, (code, station, turn) in enumerate(
        [("274-100", 500.0, 0.0), ("282", 900.0, 0.0), ("274-80", 1200.0, 180.0), ("274-120", 700.0, 180.0)]
    ):
        side = -14.0 if turn == 0.0 else 14.0
        place = {"code": code, "station": station, "rotation_deg": turn, "offset": side, "instance": 5000 + i}
        objects[f"limit-{i}"] = sign | place
    read = written(RoadParameters.from_dict(data), tmp_path)
    for part in read.roads:
        (kind,) = part.road.findall("type/speed")
        assert (kind.get("max"), kind.get("unit")) == ("no limit", "km/h")
        found = [speeds(part, s) for s in (300.0, 600.0, 800.0, 1000.0, 1500.0)]
        right, left = [{130.0}, {100.0}, {100.0}, {130.0}, {130.0}], [{120.0}, {120.0}, {80.0}, {80.0}, {130.0}]
        assert found == (right if part.side == "right" else left)


def test_urban_motorways_have_a_limit(tmp_path: Path) -> None:
    road = sample_road(scenario(design_class="EKA3", cross_section="RQ25", length=100.0), 3)
    bare = {name: item for name, item in road.to_dict()["objects"].items() if item["type"] != "TrafficSign"}
    read = written(RoadParameters.from_dict(road.to_dict() | {"objects": bare}), tmp_path)
    assert {item.get("max") for item in read.root.iter("speed")} == {"100"}


# --- paint --------------------------------------------------------------------------------------------------------


def test_road_marks_are_the_lines(road: RoadParameters, read: Roads) -> None:
    geometry = RoadGeometry(road)
    pieces: dict[int, list[tuple[float, float]]] = {}
    lines = {line.instance: line for line in road.of_type(LineMarking).values()}
    for part, mark in read.marks():
        line = lines[mark.instance]
        assert (mark.width, mark.color) == (line.width, line.color)
        s = np.linspace(mark.start, mark.end, 9)[1:-1]
        section = next(item for item in part.sections if item.start <= s[0] <= item.end)
        t = section.borders(s, part.lane_offset(s))[mark.lane] + mark.aside
        left, right = geometry.marking_edges(line, s)
        # In plan; the width of the line itself is tilted as well, and a ramp lies above or below the road's plane.
        above = section.lanes[mark.lane].height(s)[1] if mark.lane else 0.0
        plan = t * np.cos(part.superelevation(s)) - above * np.sin(part.superelevation(s))
        assert np.abs(plan - (left + right) / 2.0)[away_from(geometry, s)].max(initial=0.0) < 0.3 * MILLIMETRE
        pieces.setdefault(mark.instance, []).append((mark.start, mark.end))
    for line in lines.values():
        if line.kind != "free":
            assert joined(pieces.get(line.instance, [])) == pytest.approx(
                joined(geometry.dashes(line).tolist()), abs=1e-6
            )


def away_from(geometry: RoadGeometry, s: np.ndarray) -> np.ndarray:
    """Return which of some stations `away_from_steps` leaves."""
    return np.isin(s, away_from_steps(geometry, s))


def joined(pieces: list[tuple[float, float]]) -> np.ndarray:
    """Return (N, 2) pieces of which those that touch are one."""
    found: list[list[float]] = []
    for start, end in sorted(map(tuple, pieces)):
        if end - start <= 2e-6:
            continue
        if found and start - found[-1][1] < 2e-6:
            found[-1][1] = max(found[-1][1], end)
        else:
            found.append([start, end])
    return np.array(found).reshape(-1, 2)


def on_road(geometry: RoadGeometry, points: np.ndarray) -> np.ndarray:
    """Return station, offset and height above the profile (N, 3) of map points (N, 3)."""
    local = points - geometry.parameters.transform.translate
    s, t = geometry.alignment.project(local[:, :2])
    return np.column_stack([s, t, local[:, 2] - geometry.profile.elevation(s)])


def drawn_corners(geometry: RoadGeometry, read: Roads, item: ElementTree.Element) -> list[np.ndarray]:
    """Return station, offset, height above the profile, and thickness (N, 4) of an object's outlines."""
    part = read.road_of(item)
    return [
        np.column_stack([on_road(geometry, part.point(*corners[:, :3].T)), corners[:, 3]])
        for corners in corners_road(item)
    ]


def test_free_lines_are_markings_along_corners(file: Callable[[str], Path]) -> None:
    road = curved(everything())
    read = Roads.read(file("curved"))
    geometry, line = RoadGeometry(road), road.objects["left-yellow"]
    item = read.objects()[str(line.instance)]
    (corners,) = drawn_corners(geometry, read, item)
    left, right = geometry.marking_edges(line, corners[:, 0])
    assert np.abs(corners[:, 1] - (left + right) / 2.0).max() < 1e-4
    ends = corners[[0, -1], 0]
    assert ends == pytest.approx([line.start_station, line.end_station], abs=1e-4)
    (marking,) = item.findall("markings/marking")
    assert (marking.get("color"), number(marking, "width")) == ("yellow", 0.2)
    assert len(marking.findall("cornerReference")) == len(corners)
    # The chords between corners stay within a millimetre of the line.
    (corners,) = corners_road(item)
    middle, part = (corners[1:] + corners[:-1]) / 2.0, read.road_of(item)
    points, along = part.point(*corners[:, :3].T), part.point(*middle[:, :3].T)
    assert np.linalg.norm((points[1:] + points[:-1]) / 2.0 - along, axis=1).max() < MILLIMETRE


def test_a_second_line_on_a_border_becomes_an_object(tmp_path: Path) -> None:
    data = everything().to_dict()
    line = dict(data["objects"]["right-2"], instance=99_999, color="yellow", start_station=310.0, end_station=900.0)
    data["objects"]["again"] = line
    road = RoadParameters.from_dict(data)
    read = written(road, tmp_path)
    assert all(mark.instance != 99_999 for _, mark in read.marks())
    (corners,) = drawn_corners(RoadGeometry(road), read, read.objects()["99999"])
    assert corners[[0, -1], 0] == pytest.approx([310.0, 900.0], abs=1e-4)


def test_painted_areas_keep_their_outlines(file: Callable[[str], Path]) -> None:
    road = everything()
    read, geometry = Roads.read(file("everything")), RoadGeometry(road)
    for name, outlines in (
        ("exit-hatching", lambda item: hatching_outlines(geometry, item)),
        ("arrow", arrow_outlines),
    ):
        item = road.objects[name]
        found, wanted = drawn_corners(geometry, read, read.objects()[str(item.instance)]), outlines(item)
        assert len(found) == len(wanted) > 2
        for corners, outline in zip(found, wanted, strict=True):
            assert np.abs(corners[:, :2] - outline).max() < 1e-4
            z = corners[:, 2] + geometry.profile.elevation(outline[:, 0])
            assert np.abs(z - geometry.elevation(*outline.T)).max() < 1e-4
            assert np.all(corners[:, 3] == item.film_thickness)


# --- objects ------------------------------------------------------------------------------------------------------


def all_instances(read: Roads) -> dict[int, set[str]]:
    """Return every instance number that the file names, with the ids that stand beside it."""
    found: dict[int, set[str]] = {}
    for item in read.root.iter():
        notes = notes_of(item)
        if "instance" in notes:
            found.setdefault(int(notes["instance"]), set()).add(notes.get("id", ""))
    for item in read.root.iter("parameterObject"):
        found.setdefault(int(item.get("instance")), set()).add(item.get("id"))
    return found


def test_every_object_is_there_by_id_and_instance(road: RoadParameters, read: Roads) -> None:
    found = all_instances(read)
    plants = {plant.instance: plant.name for plant in placed_plants(RoadGeometry(road))}
    assert set(found) == {*(item.instance for item in road.objects.values()), *plants}
    assert all(name in found[number] for number, name in plants.items())
    for name, item in road.objects.items():
        if item.type != "Alignment":
            assert name in found[item.instance]
    for name, item in road.objects.items():
        if isinstance(item, PointObject) and not isinstance(item, TrafficSign):
            known = read.objects() | read.signals()
            assert known[str(item.instance)].get("name") == name


def test_objects_stand_where_the_set_has_them(road: RoadParameters, read: Roads) -> None:
    geometry = RoadGeometry(road)
    known = {**read.objects(), **read.signals()}
    for item in road.objects.values():
        if not isinstance(item, PointObject):
            continue
        found = read.place(known[str(item.instance)])
        s, t = np.array([item.station]), np.array([item.offset])
        z = geometry.elevation(s, t) + item.elevation + (item.lower_edge if hasattr(item, "lower_edge") else 0.0)
        wanted = truth(geometry, s, t, z)[0]
        # Where the line kinks a place above it has two roots, or none.
        assert np.abs(found - wanted)[:2].max() < 3.0 * MILLIMETRE
        if not np.isnan(wanted[2]) and item.type != "TrafficLight":
            assert abs(found[2] - wanted[2]) < MILLIMETRE


def test_barriers_follow_the_ground(road: RoadParameters, read: Roads) -> None:
    from synthroads_addon.road.terrain import surface_elevation

    geometry, known = RoadGeometry(road), read.objects()
    for item in road.objects.values():
        if not isinstance(item, LineObject):
            continue
        part = read.road_of(known[str(item.instance)])
        repeats = known[str(item.instance)].findall("repeat")
        starts = np.array([number(repeat, "s") for repeat in repeats])
        ends = starts + [number(repeat, "length") for repeat in repeats]
        assert np.abs(starts[1:] - ends[:-1]).max(initial=0.0) < 1e-6
        whole = item.start_station, min(item.end_station, read.length)
        s = np.linspace(starts[0], ends[-1], 400)
        piece = np.clip(np.searchsorted(starts, s, side="right") - 1, 0, None)
        share = (s - starts[piece]) / np.maximum(ends[piece] - starts[piece], 1e-9)

        def linear(name: str, repeats=repeats, piece=piece, share=share) -> np.ndarray:
            first = np.array([number(repeat, f"{name}Start") for repeat in repeats])[piece]
            return first + share * (np.array([number(repeat, f"{name}End") for repeat in repeats])[piece] - first)

        s, t, z = on_road(geometry, part.point(s, linear("t"), linear("zOffset"))).T
        # At the road's ends it can't reach farther than the road does.
        assert (s[0], s[-1]) == pytest.approx(whole, abs=0.005 if s[0] > 1.0 and s[-1] < read.length - 1.0 else 0.1)
        s = np.clip(s, 0.0, read.length)
        right, left = item.reach()
        aside = (left - right) / 2.0
        last = getattr(item, "end_offset", item.offset)
        axis = np.interp(s, [item.start_station, item.end_station], [item.offset, last])
        inside = (s > 0.02) & (s < read.length - 0.02)
        # Where a country road's tilt changes, chords have more of the millimetre that they may be off.
        limit = MILLIMETRE if is_single(road.design_class) else 0.2 * MILLIMETRE
        assert np.abs(t - aside - axis)[inside].max(initial=0.0) < limit
        wanted = surface_elevation(geometry, s, axis) - geometry.profile.elevation(s)
        assert np.abs(z - wanted)[inside].max(initial=0.0) < 1.5 * MILLIMETRE
        assert linear("height").max() == pytest.approx(item.height, rel=0.02)


def test_dimensions_and_headings(file: Callable[[str], Path]) -> None:
    road = everything()
    read = Roads.read(file("everything"))
    known, seen = read.objects(), read.signals()
    sign = road.objects["sign-274"]
    item = seen[str(sign.instance)]
    assert (item.get("type"), item.get("subtype"), item.get("value"), item.get("unit")) == ("274", "120", "120", "km/h")
    assert (number(item, "width"), number(item, "height"), item.get("orientation")) == (sign.width, sign.height, "-")
    assert number(item, "hOffset") == 0.0
    posts = known[item.find("reference").get("elementId")]
    assert notes_of(posts)["instance"] == str(sign.instance)
    gantry = road.objects["gantry"]
    assert isinstance(gantry, Gantry)
    (hung,) = [item for item in seen.values() if item.get("name") == "gantry-1"]
    offset = on_road(RoadGeometry(road), read.place(hung)[None])[0, 1]
    assert (offset, hung.get("orientation")) == (pytest.approx(gantry.signs[0].offset, abs=1e-4), "+")
    beam, *posts = corners_local(known[str(gantry.instance)])
    assert np.ptp(beam[:, 1]) == pytest.approx(gantry.left_offset - gantry.right_offset)
    assert sum(post[0, 3] > 4.0 for post in posts) == 2
    beacon = next(iter(road.of_type(ConstructionBeacon).values()))
    widths = [np.ptp(outline[:, 1]) for outline in corners_local(known[str(beacon.instance)])]
    assert widths[0] == pytest.approx(beacon.width)
    assert number(known[str(beacon.instance)], "width") == max(widths)


def test_clearance_of_what_spans_the_road(file: Callable[[str], Path]) -> None:
    road = curved(everything())
    read, geometry = Roads.read(file("curved")), RoadGeometry(road)
    bridge = next(iter(road.of_type(Overpass).values()))
    item = read.objects()[str(bridge.instance)]
    deck = corners_local(item)[:3]
    bottom = read.place(item)[2] + min(part[0, 2] for part in deck) - ORIGIN[2]
    s, t = np.meshgrid(np.linspace(bridge.station - 5.0, bridge.station + 5.0, 41), np.linspace(-18.0, 18.0, 721))
    strips = geometry.strip_index(s.ravel(), t.ravel())
    paved = np.array([strip.class_name == "road" for strip in geometry.strips])[strips] & (strips >= 0)
    highest = geometry.elevation(s.ravel()[paved], t.ravel()[paved]).max()
    assert bottom - highest == pytest.approx(bridge.clearance, abs=0.02)
    tunnels = [tunnel for part in read.roads for tunnel in part.road.findall("objects/tunnel")]
    about = [(tunnel.get("type"), number(tunnel, "s")) for tunnel in tunnels]
    assert about == 2 * [("underpass", bridge.station - bridge.width / 2.0)]


def test_traffic_is_named_but_not_drawn(file: Callable[[str], Path]) -> None:
    road = everything()
    read = Roads.read(file("everything"))
    for vehicle in road.of_type(Vehicle).values():
        assert str(vehicle.instance) not in read.objects()
        assert vehicle.instance in all_instances(read)


# --- the file -----------------------------------------------------------------------------------------------------


def test_same_road_same_bytes_and_no_date(tmp_path: Path) -> None:
    road = sample_road(scenario(length=500.0), 7)
    for name in ("a", "b"):
        write_opendrive(RoadParameters.from_dict(road.to_dict()), tmp_path / name, TOLERANCE)
    text = (tmp_path / "a").read_bytes()
    assert text == (tmp_path / "b").read_bytes()
    assert b"\r" not in text
    header = re.search(rb"<header[^>]*>", text)
    assert header
    assert b"date" not in header[0]


def test_header_tells_where_on_earth(file: Callable[[str], Path]) -> None:
    read = Roads.read(file("everything"))
    assert read.offset.tolist() == list(ORIGIN)
    text = file("everything").read_text()
    assert re.search(r"<geoReference><!\[CDATA\[\+proj=tmerc [^<]*\]\]></geoReference>", text)
    local = read.roads[0].point(np.array([0.0, 1000.0]), np.zeros(2)) - read.offset
    header = read.root.find("header")
    assert number(header, "west") <= local[:, 0].min() <= local[:, 0].max() <= number(header, "east")


@pytest.mark.parametrize("epsg", [25832, 32633, 31467, 2056, 5555])
def test_coordinate_systems_place_points_alike(epsg: int) -> None:
    require("pyproj")
    import pyproj

    other = pyproj.CRS.from_user_input(geo_reference(epsg))
    own = pyproj.CRS.from_epsg(epsg)
    for crs in (own, other):
        assert crs.is_projected or crs.is_compound
    plane = own.sub_crs_list[0] if own.is_compound else own
    other = other.sub_crs_list[0] if other.is_compound else other
    geodetic = pyproj.Proj(plane)(9.5, 50.5)
    assert pyproj.Proj(other)(9.5, 50.5) == pytest.approx(geodetic, abs=1e-6)


def test_odd_texts_stay_xml(tmp_path: Path) -> None:
    data = everything().to_dict()
    data["metadata"]["title"] = 'A "road" <of> & \x0b\x00 ]]> \U0001f69b verbatim:x'
    data["objects"]["sign-448"]["text"] = ["<A 4>", "Köln & Bonn"]
    read = written(RoadParameters.from_dict(data), tmp_path)
    assert notes_of(read.root.find("header"))["title"] == 'A "road" <of> &  ]]> \U0001f69b verbatim:x'
    assert read.signals()[str(data["objects"]["sign-448"]["instance"])].get("text") == "<A 4>\nKöln & Bonn"


def test_what_stands_beyond_the_end_is_refused(tmp_path: Path) -> None:
    road = changed(everything(), pole={"station": 2000.5})
    with pytest.raises(InputError, match=r"objects\.pole\.station is 2000\.5.*2000 m"):
        write_opendrive(road, tmp_path / "road.xodr", TOLERANCE)


# --- pieces -------------------------------------------------------------------------------------------------------


@given(
    kinks=st.lists(st.floats(1.0, 99.0), min_size=1, max_size=5, unique=True),
    values=st.lists(st.floats(-5.0, 5.0), min_size=12, max_size=12),
)
@settings(max_examples=50, deadline=None)
def test_cubics_are_what_they_stand_for(kinks: list[float], values: list[float]) -> None:
    borders = np.array([0.0, *sorted(kinks), 100.0])

    def function(s: np.ndarray) -> np.ndarray:
        line = np.interp(s, borders, values[: len(borders)])
        return np.column_stack([line, np.minimum(line, values[7]) + values[8] * (s / 100.0) ** 3])

    found = fit_cubics(function, borders)
    s = np.linspace(0.0, 100.0, 777)
    steepest = 10.0 / max(np.diff(borders).min(), 1e-3)
    for f in range(2):
        starts, coefficients = zip(*join_cubics(found.borders, found.coefficients[:, f]), strict=True)
        piece = np.searchsorted(starts, s, side="right") - 1
        a, b, c, d = np.array(coefficients)[piece].T
        u = s - np.array(starts)[piece]
        assert np.abs(a + u * (b + u * (c + u * d)) - function(s)[:, f]).max() < 1e-6 + 1e-4 * steepest


def test_a_short_piece_goes_on_as_the_long_one_does() -> None:
    borders = np.array([0.0, 0.05, 100.0, 100.1])
    found = fit_cubics(lambda s: ((s / 37.0) ** 3 + 0.1 * s)[:, None], borders)
    ((start, coefficients),) = join_cubics(found.borders, found.coefficients[:, 0])
    assert start == 0.0
    assert coefficients == pytest.approx([0.0, 0.1, 0.0, 37.0**-3], abs=1e-9)


@given(st.floats(3.0, 30.0), st.floats(1e-4, 1e-2))
@settings(max_examples=30, deadline=None)
def test_chords_stay_within_the_tolerance(wavelength: float, tolerance: float) -> None:
    def function(s: np.ndarray) -> np.ndarray:
        return np.sin(s[:, None] / wavelength)

    found = chord_stations(function, np.array([0.0, 50.0, 100.0]), tolerance)
    s = np.linspace(0.0, 100.0, 5001)
    assert np.abs(np.interp(s, found, function(found)[:, 0]) - function(s)[:, 0]).max() < 1.5 * tolerance


# --- faults that the reader sees ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("path", "name", "by"),
    [
        ("planView/geometry", "x", 0.002),
        ("planView/geometry/spiral", "curvEnd", 1e-6),
        ("elevationProfile/elevation", "c", 1e-7),
        ("lateralProfile/superelevation", "a", 1e-3),
        ("lanes/laneSection/right/lane/width", "a", 0.002),
        ("lanes/laneSection/left/lane/width", "b", 1e-3),
        ("lanes/laneSection/right/lane/height", "outer", 0.002),
    ],
)
def test_planted_faults_show(tmp_path: Path, file: Callable[[str], Path], path: str, name: str, by: float) -> None:
    read = Roads.read(file("curved"))
    (item, *_) = [found for part in read.roads if (found := part.road.find(path)) is not None]
    item.set(name, repr(number(item, name) + by))
    (tmp_path / "bad.xodr").write_text(ElementTree.tostring(read.root, "unicode"))
    assert worst_border(curved(everything()), Roads.read(tmp_path / "bad.xodr"), 5.0) > MILLIMETRE / 2.0


# --- ASAM's checker; `tests/judges/test_judges.py` has other readers ------------------------------------------------


@pytest.mark.first_python
def test_quality_checker_finds_nothing(file: Callable[[str], Path]) -> None:
    require("asam-qc-opendrive")
    assert quality_faults(file("widening")) == []


@pytest.mark.slow
@pytest.mark.first_python
def test_quality_checker_finds_nothing_in_fifty_roads(tmp_path: Path) -> None:
    require("asam-qc-opendrive")
    roads = [ROADS[name]() for name in ("everything", "curved", "right only", "left only", "widening")]
    for i, (design_class, section) in enumerate(PAIRS):
        for seed, more in enumerate(
            ({}, {"turnouts": EVERYTHING["turnouts"]}, {"furniture": {"construction_zone": 1}})
        ):
            asked = scenario(design_class=design_class, cross_section=section, length=700.0 + 300.0 * seed, **more)
            roads.append(sample_road(asked, 100 * i + seed))
    roads += full_roads(range(10, 13))
    assert len(roads) == 50
    assert sum(bool(road.of_type(Turnout)) for road in roads) >= 20
    assert sum(bool(road.of_type(ConstructionBeacon)) for road in roads) >= 10
    for i, road in enumerate(roads):
        path = tmp_path / f"{i}.xodr"
        write_opendrive(road, path, TOLERANCE)
        assert worst_border(road, Roads.read(path)) < MILLIMETRE
        assert quality_faults(path) == []


@pytest.mark.first_python
def test_quality_checker_sees_planted_faults(tmp_path: Path) -> None:
    require("asam-qc-opendrive")
    write_opendrive(sample_road(scenario(length=400.0), 7), tmp_path / "good.xodr", TOLERANCE)
    text = (tmp_path / "good.xodr").read_text()
    faults = {
        "xml_valid_schema": (r'type="driving"', 'type="drivable"'),
        "no_horizontal_gaps": (r'curvEnd="[^"]*"', 'curvEnd="0.004"'),
        "lanes_across_lane_sections": (r'<successor id="-4" ?/>', ""),
        "zero_width_at_start": (
            r'(<lane id="(-\d+)"[^>]*>\s*<link>)(\s*<successor[^>]*>\s*</link>\s*<width sOffset="0" a="0")',
            r'\1<predecessor id="\2" />\3',
        ),
        "avoid_redundant_info": (
            r'(<width sOffset=")0(" a="[^"]*" b="0" c="0" d="0" />)',
            r"\g<1>0\2\g<1>0.01\2",
        ),
    }
    # With a file against the schema the checker looks no farther.
    for names in ({"xml_valid_schema"}, faults.keys() - {"xml_valid_schema"}):
        bad = text
        for name in sorted(names):
            bad, count = re.subn(*faults[name], bad, count=1)
            assert count == 1, name
        (tmp_path / "bad.xodr").write_text(bad)
        found = quality(tmp_path / "bad.xodr")
        for name in names:
            assert [check for check, (_, issues) in found.items() if issues and name in check], name


# --- cost ---------------------------------------------------------------------------------------------------------


def test_long_road_has_a_small_file(tmp_path: Path) -> None:
    """Apart from the plants, each of which is an object."""
    data = sample_road(scenario(length=5000.0), 1).to_dict()
    data["objects"] = {name: item for name, item in data["objects"].items() if item["type"] != "Vegetation"}
    road = RoadParameters.from_dict(data)
    read = written(road, tmp_path)
    assert math.isclose(read.length, road.alignment.length)
    assert (tmp_path / "road.xodr").stat().st_size < 1_200_000  # some 150 shafts are among its objects
