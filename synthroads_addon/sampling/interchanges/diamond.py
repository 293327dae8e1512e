"""An interchange drawn on a motorway: a crossing road above it, and ramps from its exits and to its entries.

Everything is drawn from streams of its own, so that nothing else of a road depends on it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ...base.arrays import Float
from ...base.errors import InputError
from ...base.random_streams import stream
from ...base.schema import round_value
from ...road.alignment import Alignment, Element
from ...road.geometry import RoadGeometry
from ...road.ground.main_surface import highest_pavement
from ...road.guidelines import LIMITS, TURNOUT_LANE_WIDTH, TURNOUT_TAPER
from ...road.network.crossing import Crossing
from ...road.network.network import bridge_span
from ...road.network.ramp import Pose, cut_of, pose_of
from ...road.objects import Side, nominal_width
from ...road.other_roads.axis import HorizontalElement, VerticalPoint
from ...road.other_roads.parts import ConnectingRamp, CrossingRoad
from ...road.section import Carriageway, CrossfallPoint, Ramp, Turnout
from ...road.section_geometry import CarriagewaySection
from ...road.things.overpass import EDGE, Overpass
from ...road.turnout_geometry import NOSE_BEFORE_END, NOSE_WIDTH
from ...scenario.interchange import InterchangeLimits
from ...scenario.road import RoadScenario
from ..placing.draw import draw
from ..section import TURNOUT_EDGE_STRIP

CROSSING_LANE, CROSSING_EDGE_STRIP = 3.5, 0.5
"""Lane and edge strip of the crossing road, m: those of RQ 11."""
ABOVE_DECK = 0.01
"""By how much the crossing road's edges lie above the deck, m; chosen."""
_DRAWN = ("distance", "radius", "lane_width", "corner_radius", "design_speed")
"""Limits that a value of each ramp is drawn from, in order."""
BRIDGE_ID, CROSSING_ID = "interchange-bridge", "crossing-road"
"""Ids of the bridge and the crossing road of an interchange."""
_STRAIGHT = 4.0
"""Straight piece (m) before a mouth's own."""
_GUESS, _ROUNDS, _OFF = 250.0, 8, 1.0
"""Distance (m) of a cut from the crossing road that is tried first, how often it is moved to where its ramp ends at its
mouth, and by how much (m) the straight piece there may still be longer or shorter."""
_LEAST_LINE, _TINY = 2.0, 1e-3
"""Shortest line between a ramp's two curves, and what a piece of no length is given, m."""
PIER_WIDTH = 1.0
"""Width of the bridge's piers, m; less in a narrow median."""
DECK = 1.2
"""Height of the bridge's deck, m."""
_CLOTHOID = 90.0
"""Clothoid parameter A (m) of the ramps beside the main road; chosen."""
_SWAYS, _SWAY = (35.0, 50.0, 70.0, 90.0), 30.0
"""Lengths (m) of the clothoid that takes the turnout's curvature back, the first that fits, and of those beside the
curve; chosen."""
_RAMP_EDGE_STRIP = 0.5
"""Width of a ramp's edge strips, m; chosen."""
_SWAY_SHARE, _LEAST_TURN = 0.45, 0.05
"""Clothoids beside the curve are at most so long as a share of it; least turn (rad) of a curve. Chosen."""
_FIRST_POINT, _LAST_POINT = 30.0, 26.0
"""Distance (m) of a ramp profile's points from its begin and its end; chosen."""
_ROUNDING = 2500.0
"""Radius (m) of the roundings of a ramp's profile where they have room; chosen."""
_MOUTH = 26.0
"""Length of a mouth's straight stretch, m; chosen."""
_MOUTH_GRADE = -2.0
"""Grade (%) of a mouth, away from the crossing road; chosen."""
_STEEPEST, _GENTLER = 0.058, 0.99
"""Steepest grade of a ramp between two points of its profile, and by how much less one that is made longer gets."""
_LONGER, _TRIALS = 1.5, 24
"""How much longer than it is too steep a ramp is made each time, as the main road may fall meanwhile; how often."""
_BESIDE_MOUTH = 60.0
"""Ground built beyond the farthest mouth, m; chosen."""
_CURVE_FALL = 4.0
"""Crossfall of a ramp in its curve, %, inwards; chosen."""


@dataclass(frozen=True)
class Interchange:
    """The objects of a drawn interchange, all of instance 1.

    Attributes:
        turnouts: exits and entries by id.
        bridge: id and object of the bridge.
        crossing: id and object of the crossing road.
        ramps: connecting ramps by id.
    """

    turnouts: dict[str, Turnout]
    bridge: tuple[str, Overpass]
    crossing: tuple[str, CrossingRoad]
    ramps: dict[str, ConnectingRamp]

    def objects(self) -> dict[str, Any]:
        """Return the bridge, the crossing road and the ramps by id; the turnouts aren't among them."""
        return dict([self.bridge, self.crossing]) | self.ramps


def with_room_for_interchange(scenario: RoadScenario) -> RoadScenario:
    """Return a scenario with room for its interchange, which has the only turnouts and the only bridge; or as it is."""
    if scenario.interchange.kind == "none":
        return scenario
    turnouts = {"exits": 0.0, "entries": 0.0, "emergency_bays": 0.0}
    return scenario.model_copy(
        update={
            "half_width": max(scenario.half_width, scenario.interchange.distance.maximum + _BESIDE_MOUTH),
            "turnouts": scenario.turnouts.model_copy(update=turnouts),
            "lane_changes": scenario.lane_changes.model_copy(update={"share": 0.0}),
            "furniture": scenario.furniture.model_copy(update={"overpass": 0.0}),
        }
    )


@dataclass(frozen=True)
class _Quadrant:
    """One of the places of a ramp: at a carriageway, an exit or an entry."""

    name: str
    side: Side
    kind: str
    ahead: float
    sign: float


def _quadrants(carriageways: Mapping[Side, Carriageway]) -> list[_Quadrant]:
    """Return the four places of a diamond's ramps."""
    result = []
    for side, carriageway in carriageways.items():
        for kind in ("exit", "entry"):
            ahead = float(carriageway.traffic) * (1.0 if kind == "exit" else -1.0)
            result.append(_Quadrant(f"{kind}-{side}", side, kind, ahead, float(carriageway.sign)))
    return result


def sample_interchange(
    limits: InterchangeLimits, seed: int, geometry: RoadGeometry, ramp_fall: float = 2.5
) -> Interchange | None:
    """Return the interchange of a road without turnouts; None where none is wanted.

    Args:
        limits: of the interchange.
        seed: of everything drawn.
        geometry: the main road, with terrain and without turnouts.
        ramp_fall: crossfall (%) of the ramps beside the main road, outwards.

    Raises:
        InputError: the road is too short for it, or a ramp doesn't fit between the limits.
    """
    if limits.kind == "none":
        return None
    rng = stream(seed, "interchange")
    parameters = geometry.parameters
    carriageways = {item.side: item for item in parameters.of_type(Carriageway).values()}
    terrain = parameters.terrain
    assert terrain is not None
    station = round_value(geometry.length / 2.0, 3)
    heading = float(geometry.alignment.heading(np.array([station]))[0])
    ahead = np.array([np.cos(heading), np.sin(heading)])
    left = np.array([-ahead[1], ahead[0]])
    middle = geometry.alignment.position(np.array([station]))[0]
    bridge, level = _bridge(limits, rng, geometry, station)
    start = middle - terrain.half_width * left
    draft = CrossingRoad(
        instance=1,
        station=station,
        bridge=BRIDGE_ID,
        start_x=float(start[0]),
        start_y=float(start[1]),
        start_heading_deg=float(np.rad2deg(heading)) + 90.0,
        horizontal=(HorizontalElement.between(2.0 * terrain.half_width, 0.0, 0.0),),
        vertical=(VerticalPoint(station=terrain.half_width, elevation=level),),
        lane_width=CROSSING_LANE,
        edge_strip_width=CROSSING_EDGE_STRIP,
    )
    crossing = _with_profile(limits, rng, draft, bridge_span(geometry, draft, bridge), level)
    turnouts: dict[str, Turnout] = {}
    ramps: dict[str, ConnectingRamp] = {}
    for place in _quadrants(carriageways):
        turnout, ramp = _joined_ramp(limits, rng, geometry, crossing, place, ramp_fall)
        if turnout.start_station < 1.0 or turnout.end_station > geometry.length - 1.0:
            need = 2.0 * (geometry.length / 2.0 - min(turnout.start_station, geometry.length - turnout.end_station))
            text = f"an interchange needs about {np.ceil((need + 20.0) / 10.0) * 10.0:.0f} m here: make the road longer"
            raise InputError("road.length", round(geometry.length, 1), text)
        turnouts[place.name], ramps[f"ramp-{place.name}"] = turnout, ramp
    return Interchange(turnouts, (draft.bridge, bridge), (CROSSING_ID, crossing), ramps)


def _bridge(
    limits: InterchangeLimits, rng: np.random.Generator, geometry: RoadGeometry, station: float
) -> tuple[Overpass, float]:
    """Return the bridge at a station, and the height (m) of the crossing road's middle on it."""
    half = CROSSING_LANE + CROSSING_EDGE_STRIP
    width = 2.0 * half / (1.0 - 2.0 * EDGE)
    along = np.linspace(station - width / 2.0, station + width / 2.0, 9)
    edges = {side: float(section.road_edge(along).max()) for side, section in geometry.sections.items()}
    paved = {side: float(section.paved_edge(along).max()) for side, section in geometry.sections.items()}
    inner = {side: float(section.distances(along)[:, 0].min()) for side, section in geometry.sections.items()}
    clearance = draw(rng, limits.clearance)
    faces = {side: edge + 3.5 for side, edge in edges.items()}
    pier = min(PIER_WIDTH, 2.0 * (min(inner.values()) - 0.7))
    places = np.linspace(-paved["right"], paved["left"], 81)
    stations, offsets = (grid.ravel() for grid in np.meshgrid(along, places, indexing="ij"))
    highest = highest_pavement(geometry, stations, offsets)
    assert highest is not None
    bridge = Overpass(
        instance=1,
        station=station,
        offset=0.0,
        width=round_value(width),
        left_abutment=round_value(faces["left"]),
        right_abutment=round_value(-faces["right"]),
        clearance=clearance,
        deck_thickness=DECK,
        pier_offsets=(0.0,) if pier >= 0.5 else (),
        pier_width=round_value(pier) if pier >= 0.5 else PIER_WIDTH,
    )
    return bridge, highest + clearance + DECK + ABOVE_DECK + half * 0.025


def _with_profile(
    limits: InterchangeLimits,
    rng: np.random.Generator,
    road: CrossingRoad,
    span: tuple[float, float],
    level: float,
) -> CrossingRoad:
    """Return a crossing road with its profile: level on the bridge (stations, m), falling beside it."""
    grade, radius = draw(rng, limits.grade) / 100.0, draw(rng, limits.crest_radius)
    tangent = radius * grade / 2.0
    low, high = span[0] - tangent - 1.0, span[1] + tangent + 1.0
    points = [
        VerticalPoint(station=0.0, elevation=level - grade * low),
        VerticalPoint(station=low, elevation=level, radius=radius),
        VerticalPoint(station=high, elevation=level, radius=radius),
        VerticalPoint(station=road.length, elevation=level - grade * (road.length - high)),
    ]
    return road.model_copy(update={"vertical": tuple(points)})


def _joined_ramp(
    limits: InterchangeLimits,
    rng: np.random.Generator,
    geometry: RoadGeometry,
    crossing: CrossingRoad,
    place: _Quadrant,
    ramp_fall: float,
) -> tuple[Turnout, ConnectingRamp]:
    """Return a turnout at the place from which its ramp reaches the crossing road, and that ramp."""
    values = {name: draw(rng, getattr(limits, name)) for name in _DRAWN}
    is_stop = rng.random() < limits.stop_lines
    priority: Literal["none", "stop", "give_way"] = (
        "none" if place.kind == "entry" else "stop" if is_stop else "give_way"
    )
    fitter = _RampFitter(geometry, crossing, place, values, priority, ramp_fall)
    straight, sways, steepest = _STRAIGHT, list(_SWAYS), 0.0
    for _ in range(_TRIALS):
        fit = fitter.fitted(straight, sways[0])
        if fit is None:
            # Where the main road curves towards the ramp, it first turns farther away.
            sways.pop(0)
            if not sways:
                break
            continue
        low, high = fit[1].vertical[1:3]
        rise, run = abs(high.elevation - low.elevation), high.station - low.station
        if rise <= _STEEPEST * run:
            return fit
        # A longer straight piece before the mouth makes it less steep.
        steepest = rise / run
        straight += _LONGER * max(rise / (_STEEPEST * _GENTLER) - run, 1.0)
    if steepest:
        text = "a ramp to its mouth would be as steep as this, at most 6 % is allowed: make distance or grade larger"
        raise InputError("road.interchange.grade", f"{100.0 * steepest:.1f} %", text)
    text = "no ramp fits between the motorway and a mouth at this distance: widen distance, or make radius smaller"
    raise InputError("road.interchange.distance", values["distance"], text)


class _RampFitter:
    """Ramps between one place of the main road and its mouth at the crossing road.

    Attributes:
        geometry, crossing, place: the roads, and the place.
        values: drawn values by the names of their limits.
        priority: line before the mouth.
        section: of the carriageway.
        turnout: exit or entry, wherever it lies.
        goal, goal_heading: where the mouth's straight stretch begins (2,), m, and in which direction, rad.
        back: curvature of the ramp's curve, 1/m.
    """

    def __init__(
        self,
        geometry: RoadGeometry,
        crossing: CrossingRoad,
        place: _Quadrant,
        values: dict[str, float],
        priority: Literal["none", "stop", "give_way"],
        ramp_fall: float,
    ) -> None:
        self.geometry, self.crossing, self.place = geometry, crossing, place
        self.values, self.priority = values, priority
        self.section = geometry.sections[place.side]
        self.turnout = _turnout(geometry, self.section, place, values["lane_width"], ramp_fall)
        self.goal, self.goal_heading = _goal(geometry, crossing, place, values["distance"])
        # At the right carriageway a ramp that leaves with the stations turns right first, and back to the left.
        self.back = -place.ahead * place.sign / values["radius"]

    def fitted(self, straight: float, sway: float) -> tuple[Turnout, ConnectingRamp] | None:
        """Return turnout and ramp with a straight piece (m) before the mouth and a first piece (m); None if unfit."""
        ahead, cut_station = self.place.ahead, self.crossing.station - self.place.ahead * _GUESS
        for _ in range(_ROUNDS):
            cut_station += ahead * (self._solved(self._placed(cut_station)[1], sway)[2] - straight)
            if not 0.0 < cut_station < self.geometry.length:
                return None
        start = round_value(self._placed(cut_station)[0].start_station, 3)
        item, pose = self._placed(start + (self.turnout.length if ahead > 0.0 else 0.0))
        item = item.model_copy(update={"start_station": start})
        line, turn, last = self._solved(pose, sway)
        if line < _LEAST_LINE or turn <= _LEAST_TURN or abs(last - straight) > _OFF:
            return None
        parts = self._elements(pose, sway, line, turn, last)
        return item, _with_heights(self.geometry, self.crossing, self._ramp(pose, parts), pose, parts, self.back)

    def _placed(self, cut_station: float) -> tuple[Turnout, Pose]:
        """Return the turnout whose cut is at a station (m), and how its ramp runs there."""
        lowest = cut_station - self.turnout.length if self.place.ahead > 0.0 else cut_station
        item = self.turnout.model_copy(update={"start_station": lowest})
        joined = CarriagewaySection(self.section.carriageway, [item], (), {item.instance})
        cut = cut_of(self.geometry, joined, joined.turnouts[0])
        return item, pose_of(self.geometry, joined, joined.turnouts[0], cut)

    def _elements(self, pose: Pose, sway: float, line: float, turn: float, last: float) -> list[Element]:
        """Return a ramp's elements by the lengths of its first piece, its line and its last piece, m, and its turn."""
        radius = self.values["radius"]
        beside = min(_SWAY, _SWAY_SHARE * abs(turn) * radius)
        return [
            Element(sway, pose.curvature, 0.0),
            Element(max(line, _TINY), 0.0, 0.0),
            Element(beside, 0.0, self.back),
            Element(max(turn * radius - beside, _TINY), self.back, self.back),
            Element(beside, self.back, 0.0),
            Element(max(last, _TINY), 0.0, 0.0),
        ]

    def _solved(self, pose: Pose, sway: float) -> tuple[float, float, float]:
        """Return the length of the line, m, the curve's turn, rad, and the last piece, m, that lead to the goal."""
        change = float(np.angle(np.exp(1j * (self.goal_heading - pose.heading))))
        turn = float(np.sign(self.back)) * (change - pose.curvature * sway / 2.0)
        if turn <= _LEAST_TURN:
            return 0.0, turn, 0.0
        axis = Alignment(self._elements(pose, sway, 0.0, turn, 0.0), pose.x, pose.y, pose.heading)
        middle, end = pose.heading + pose.curvature * sway / 2.0, self.goal_heading
        directions = np.array([[np.cos(middle), np.cos(end)], [np.sin(middle), np.sin(end)]])
        line, last = np.linalg.solve(directions, self.goal - axis.position(axis.length))
        return float(line) + _TINY, turn, float(last) + _TINY

    def _ramp(self, pose: Pose, parts: list[Element]) -> ConnectingRamp:
        """Return the ramp with its axis, and with heights and crossfall at its begin only."""
        carriageway, place, values = self.section.carriageway, self.place, self.values
        return ConnectingRamp(
            instance=1,
            turnout=place.name,
            crossing_road=CROSSING_ID,
            start_x=pose.x,
            start_y=pose.y,
            start_heading_deg=float(np.rad2deg(pose.heading)),
            horizontal=tuple(HorizontalElement.between(e.length, e.curvature_start, e.curvature_end) for e in parts),
            vertical=(VerticalPoint(station=0.0, elevation=pose.height),),
            crossfall=(CrossfallPoint(station=0.0, crossfall_percent=100.0 * pose.crossfall),),
            lane_width=values["lane_width"],
            edge_strip_width=_RAMP_EDGE_STRIP,
            verge_width=nominal_width(carriageway.verge_width),
            verge_slope_percent=carriageway.verge_slope_percent,
            mouth_station=self.crossing.length / 2.0 + place.sign * values["distance"],
            mouth_side="left" if place.ahead > 0.0 else "right",
            mouth_length=_MOUTH,
            mouth_grade_percent=_MOUTH_GRADE,
            near_radius=values["corner_radius"],
            far_radius=values["corner_radius"],
            design_speed=values["design_speed"],
            priority=self.priority,
        )


def _turnout(
    geometry: RoadGeometry, section: CarriagewaySection, place: _Quadrant, lane: float, ramp_fall: float
) -> Turnout:
    """Return an exit or entry whose ramp ends where the ground beside it is as wide as two verges."""
    carriageway = section.carriageway
    limits = LIMITS[geometry.parameters.design_class]
    shoulder, verge = nominal_width(carriageway.hard_shoulder_width), nominal_width(carriageway.verge_width)
    nose, length = ((6.0 * _CLOTHOID**2 * (shoulder + width)) ** (1.0 / 3.0) for width in (NOSE_WIDTH, 2.0 * verge))
    length = max(length, nose + NOSE_BEFORE_END + _OFF)
    is_exit = place.kind == "exit"
    fall = -place.sign * ramp_fall
    return Turnout(
        instance=1,
        carriageway=f"carriageway-{place.side}",
        kind="exit" if is_exit else "entry",
        start_station=0.0,
        taper_in_length=TURNOUT_TAPER if is_exit else 0.0,
        lane_length=limits.turnout_lane_length,
        taper_out_length=0.0 if is_exit else TURNOUT_TAPER,
        lane_width=TURNOUT_LANE_WIDTH,
        edge_strip_width=TURNOUT_EDGE_STRIP,
        shoulder_width=0.0,
        ramp=Ramp(
            length=round_value(length, 3),
            clothoid_parameter=_CLOTHOID,
            lane_width=lane,
            edge_strip_width=_RAMP_EDGE_STRIP,
            crossfall_percent=fall,
            run_off_length=20.0,
        ),
    )


def _goal(geometry: RoadGeometry, crossing: CrossingRoad, place: _Quadrant, distance: float) -> tuple[Float, float]:
    """Return the place (2,) at which a ramp's mouth begins, local, m, and the direction (rad) in which it runs."""
    heading = np.deg2rad(crossing.start_heading_deg)
    along = np.array([np.cos(heading), np.sin(heading)])
    ahead = np.array([along[1], -along[0]]) * place.ahead
    middle = geometry.alignment.position(np.array([crossing.station]))[0]
    back = crossing.half_width + _MOUTH
    goal = middle + place.sign * distance * along - back * ahead
    return goal, float(np.arctan2(ahead[1], ahead[0]))


def _with_heights(
    geometry: RoadGeometry,
    crossing: CrossingRoad,
    ramp: ConnectingRamp,
    pose: Pose,
    parts: list[Element],
    back: float,
) -> ConnectingRamp:
    """Return a ramp with its profile and its crossfall: from the cut's to the mouth's."""
    span = (crossing.length / 2.0 - 2.0, crossing.length / 2.0 + 2.0)
    mouth = Crossing(geometry.parameters, crossing, {"ramp": ramp}, span).mouths["ramp"]
    end = float(mouth.own_surface(np.array([ramp.mouth_length]), np.zeros(1))[0])
    length, end_grade = ramp.length, -ramp.mouth_grade_percent / 100.0
    first, last = _FIRST_POINT, length - _LAST_POINT
    first_height, last_height = pose.height + pose.grade * first, end - end_grade * (length - last)
    grade = (last_height - first_height) / (last - first)
    radii = [
        min(_ROUNDING, 2.0 * (room - 1.0) / max(abs(change), 1e-6))
        for room, change in ((first, grade - pose.grade), (length - last, end_grade - grade))
    ]
    vertical = (
        VerticalPoint(station=0.0, elevation=pose.height),
        VerticalPoint(station=first, elevation=first_height, radius=radii[0]),
        VerticalPoint(station=last, elevation=last_height, radius=radii[1]),
        VerticalPoint(station=length, elevation=end),
    )
    heading = pose.heading + sum(part.turn for part in parts)
    left = np.array([-np.sin(heading), np.cos(heading)])
    fall = -100.0 * mouth.side_road.crossfall_percent / 100.0 * float(np.sign(left @ mouth.across))
    # Where the axis turns to the left the surface falls to the left.
    curve = -float(np.sign(back)) * _CURVE_FALL
    borders = np.cumsum([part.length for part in parts])
    places = (
        (0.0, 100.0 * pose.crossfall),
        (float(borders[1]), 100.0 * pose.crossfall if np.sign(curve) == np.sign(pose.crossfall) else 0.0),
        (float(borders[2]), curve),
        (float(borders[3]), curve),
        (float(length - 1.0), fall),
        (float(length), fall),
    )
    points = tuple(CrossfallPoint(station=s, crossfall_percent=percent) for s, percent in places)
    return ramp.model_copy(update={"vertical": vertical, "crossfall": points})
