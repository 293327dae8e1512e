"""Ramps between one place of a main road and the crossing road of its interchange."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...base.arrays import Float
from ...base.errors import InputError
from ...base.schema import round_value
from ...road.alignment import Alignment, Element
from ...road.geometry import RoadGeometry
from ...road.guidelines import LIMITS, TURNOUT_LANE_WIDTH, TURNOUT_TAPER
from ...road.network.crossing import Crossing
from ...road.network.ramp import Pose, axis_of, cut_of, pose_of
from ...road.objects import nominal_width
from ...road.other_roads.axis import HorizontalElement, VerticalPoint
from ...road.other_roads.parts import ConnectingRamp, CrossingRoad
from ...road.section import CrossfallPoint, Ramp, Turnout
from ...road.section_geometry import CarriagewaySection
from ...road.turnout_geometry import NOSE_BEFORE_END, NOSE_WIDTH
from ..section import TURNOUT_EDGE_STRIP
from .crossing import CROSSING_ID
from .quadrants import Quadrant

STRAIGHT = 4.0
"""Straight piece (m) before a mouth's own."""
_GUESS, _ROUNDS, _OFF = 250.0, 8, 1.0
"""Distance (m) of a cut from the crossing road that is tried first, how often it is moved to where its ramp ends at its
mouth, and by how much (m) the straight piece there may still be longer or shorter."""
_LEAST_LINE, _TINY = 2.0, 1e-3
"""Shortest line between a ramp's two curves, and what a piece of no length is given, m."""
_CLOTHOID = 90.0
"""Clothoid parameter A (m) of the ramps beside the main road; chosen."""
SWAYS, _SWAY = (35.0, 50.0, 70.0, 90.0), 30.0
"""Lengths (m) of the clothoid that takes the turnout's curvature back, the first that fits, and of those beside the
curve; chosen."""
_SWAY_SHARE, _LEAST_TURN = 0.45, 0.05
"""Clothoids beside the curve are at most so long as a share of it; least turn (rad) of a curve. Chosen."""
_LOOP_SWAY = (30.0, 40.0)
"""Lengths (m) of the clothoids before and behind a loop's curve; chosen."""
_HELD = 4.0
"""Length (m) over which a loop keeps the crossfall of the row at its cut, which lies aslant to it; chosen."""
_AWAY = 0.75
"""Direction (rad) against the main road that a half clover's ramp turns to before it runs around a loop; chosen."""
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
_APART, _APART_STEP, _APART_TRIALS = 2.0, 10.0, 30
"""Ground left between the verges of two ramps, by how much longer a ramp is made to keep away, m, and how often."""
_BETWEEN_MOUTHS = 1.0
"""Distance (m) of the corners of neighbouring mouths at least; chosen."""


@dataclass(frozen=True)
class RampValues:
    """Values drawn for a ramp.

    Attributes:
        distance: of its mouth from the main road's centreline, m; a loop's follows from its radius.
        radius, crossfall: of its curve, m, and inwards, %.
        lane_width, edge_strip_width, corner_radius: m.
        design_speed: km/h.
        priority: line before the mouth.
        turnout_fall: crossfall (%) of its exit or entry, outwards.
        spacing: distance (m) of a neighbouring ramp's mouth; 0 without one.
    """

    distance: float
    radius: float
    crossfall: float
    lane_width: float
    edge_strip_width: float
    corner_radius: float
    design_speed: float
    priority: Literal["give_way", "stop", "none"]
    turnout_fall: float = 2.5
    spacing: float = 0.0

    @property
    def shared_corner(self) -> float:
        """Return the radius (m) of the corner towards a neighbouring mouth, which has half the room between them."""
        if not self.spacing:
            return self.corner_radius
        room = (self.spacing - _BETWEEN_MOUTHS - self.lane_width) / 2.0 - self.edge_strip_width
        return min(self.corner_radius, round_value(room))


@dataclass(frozen=True)
class JoinedRamp:
    """An exit or entry with the ramp that goes on from it.

    Attributes:
        turnout, ramp: the objects.
        distance: of the mouth from the main road's centreline, m.
    """

    turnout: Turnout
    ramp: ConnectingRamp
    distance: float

    @property
    def stations(self) -> tuple[float, float]:
        """Return the stations (m) of the main road between which its turnout lies."""
        return self.turnout.start_station, self.turnout.end_station

    def places(self) -> Float:
        """Return places (N, 2) along its axis, about 2 m apart."""
        axis = axis_of(self.ramp)
        return axis.position(np.linspace(0.0, axis.length, int(axis.length / 2.0) + 2))


def direct_ramp(fitter: RampFitter, loop: JoinedRamp | None = None) -> JoinedRamp:
    """Return a ramp that runs towards the crossing road beside the main one; it keeps clear of a loop.

    Raises:
        InputError: none fits between the limits.
    """
    straight, sways, steepest, is_apart = STRAIGHT, list(SWAYS), 0.0, False
    for _ in range(_TRIALS if loop is None else _TRIALS + _APART_TRIALS):
        fit = fitter.direct(straight, sways[0], 0.0 if loop is None else _AWAY)
        if fit is None:
            # Where the main road curves towards the ramp, it first turns farther away.
            sways.pop(0)
            if not sways:
                break
            continue
        if loop is not None and not is_apart and not _are_apart(fit, loop):
            straight += _APART_STEP
            continue
        is_apart = True
        longer, steepest = _lengthening(fit)
        if longer <= 0.0:
            return fit
        # A longer straight piece before the mouth makes it less steep.
        straight += longer
    raise fitter.refusal(steepest)


def loop_ramp(fitter: RampFitter, reach: float, farthest: float) -> JoinedRamp:
    """Return a loop whose ramp begins beyond the crossing road, at least so far (m) behind it and at most so far (m).

    Raises:
        InputError: none fits between the limits.
    """
    steepest = 0.0
    for _ in range(_TRIALS):
        fit, missing = fitter.loop(reach)
        if missing > 0.0:
            reach += missing
        elif fit is not None:
            longer, steepest = _lengthening(fit)
            if longer <= 0.0:
                return fit
            reach += longer
        if (fit is None and missing <= 0.0) or reach > farthest:
            break
    raise fitter.refusal(steepest)


def _lengthening(fit: JoinedRamp) -> tuple[float, float]:
    """Return by how much (m) a ramp has to be longer to be less steep, 0 if it is right, and its steepest grade."""
    low, high = fit.ramp.vertical[1:3]
    rise, run = abs(high.elevation - low.elevation), high.station - low.station
    if rise <= _STEEPEST * run:
        return 0.0, 0.0
    return _LONGER * max(rise / (_STEEPEST * _GENTLER) - run, 1.0), rise / run


def _are_apart(first: JoinedRamp, second: JoinedRamp) -> bool:
    """Return whether two ramps with their verges keep apart."""
    need = sum(fit.ramp.half_width + fit.ramp.verge_width for fit in (first, second)) + _APART
    places, others = first.places(), second.places()
    return bool(np.linalg.norm(places[:, None] - others[None], axis=2).min() >= need)


class RampFitter:
    """Ramps between one place of the main road and the crossing road.

    Attributes:
        geometry, crossing, place, values: the roads, the place and what is drawn.
        section: of the carriageway.
        turnout: exit or entry, wherever it lies.
    """

    def __init__(self, geometry: RoadGeometry, crossing: CrossingRoad, place: Quadrant, values: RampValues) -> None:
        self.geometry, self.crossing, self.place, self.values = geometry, crossing, place, values
        self.section = geometry.sections[place.side]
        self.turnout = turnout_of(geometry, place, values)
        # At the right carriageway a ramp that leaves with the stations turns right first, and back to the left.
        self._outwards = place.ahead * place.sign

    def refusal(self, steepest: float) -> InputError:
        """Return the error that no ramp fits; with the grade that it would have, if it is that."""
        if steepest:
            text = (
                "a ramp to its mouth would be as steep as this, at most 6 % is allowed: make distance or grade larger"
            )
            return InputError("road.interchange.grade", f"{100.0 * steepest:.1f} %", text)
        field, value = ("loop_radius", self.values.radius) if self.place.is_loop else ("distance", self.values.distance)
        text = "no ramp fits between the motorway and its mouth: widen distance, or make radius smaller"
        if self.place.is_loop:
            text = "no loop fits between the motorway and its mouth: widen loop_radius, or make the motorway straighter"
        return InputError(f"road.interchange.{field}", value, text)

    def direct(self, straight: float, sway: float, away: float) -> JoinedRamp | None:
        """Return a ramp with a straight piece (m) before the mouth and a first piece (m); None if unfit.

        Args:
            straight, sway: lengths of these pieces, m.
            away: direction (rad) against the main road that it turns to, if that is more than `sway` alone gives.
        """
        ahead, cut_station = self.place.ahead, self.crossing.station - self.place.ahead * _GUESS
        for _ in range(_ROUNDS):
            pose = self._placed(cut_station)[1]
            cut_station += ahead * (self._solved(pose, self._first(pose, sway, away))[2] - straight)
            if abs(cut_station - self.crossing.station) > self.geometry.length:
                return None
        item, pose = self._at(cut_station)
        first = self._first(pose, sway, away)
        line, turn, last = self._solved(pose, first)
        if line < _LEAST_LINE or turn <= _LEAST_TURN or abs(last - straight) > _OFF:
            return None
        parts = self._elements(first, line, turn, last)
        return self._joined(item, pose, parts, self.values.distance, len(first) + 2)

    def loop(self, reach: float) -> tuple[JoinedRamp | None, float]:
        """Return a loop that begins a distance (m) behind the crossing road, and how much (m) more it would need.

        It is None where it needs more, or can't turn.
        """
        place = self.place
        item, pose = self._at(self.crossing.station + place.ahead * reach)
        sign, curvature = self._outwards, self._outwards / self.values.radius
        goal = self._direction(-place.ahead)
        turn = float((sign * (goal - pose.heading)) % (2.0 * np.pi))
        first, last = _LOOP_SWAY
        arc = (turn - sign * (pose.curvature + curvature) / 2.0 * first) * self.values.radius - last / 2.0
        if arc <= _LEAST_TURN * self.values.radius:
            return None, 0.0
        parts = [
            Element(first, pose.curvature, curvature),
            Element(arc, curvature, curvature),
            Element(last, curvature, 0.0),
        ]
        axis = Alignment(parts, pose.x, pose.y, pose.heading)
        # From the crossing road's axis and the main road's to the curve's end.
        along, across = self._directions()
        middle = self.geometry.alignment.position(np.array([self.crossing.station]))[0]
        vector = axis.position(axis.length) - middle
        straight = place.ahead * float(vector @ along) - self.crossing.half_width - _MOUTH
        if straight < STRAIGHT:
            return None, STRAIGHT - straight + _TINY
        parts.append(Element(straight, 0.0, 0.0))
        distance = place.sign * float(vector @ across)
        return self._joined(item, pose, parts, distance, 1), 0.0

    def _joined(self, item: Turnout, pose: Pose, parts: list[Element], distance: float, arc: int) -> JoinedRamp:
        """Return turnout and ramp by its elements, and which of them is the arc of its curve."""
        ramp = self._ramp(pose, parts, distance)
        return JoinedRamp(item, _with_heights(self, ramp, pose, parts, arc), distance)

    def _at(self, cut_station: float) -> tuple[Turnout, Pose]:
        """Return the turnout whose cut is about at a station (m), begun at a rounded one, and its ramp there."""
        start = round_value(self._placed(cut_station)[0].start_station, 3)
        item, pose = self._placed(start + (self.turnout.length if self.place.ahead > 0.0 else 0.0))
        return item.model_copy(update={"start_station": start}), pose

    def _placed(self, cut_station: float) -> tuple[Turnout, Pose]:
        """Return the turnout whose cut is at a station (m), and how its ramp runs there."""
        lowest = cut_station - self.turnout.length if self.place.ahead > 0.0 else cut_station
        item = self.turnout.model_copy(update={"start_station": lowest})
        joined = CarriagewaySection(self.section.carriageway, [item], (), {item.instance})
        cut = cut_of(self.geometry, joined, joined.turnouts[0])
        return item, pose_of(self.geometry, joined, joined.turnouts[0], cut)

    def _directions(self) -> tuple[Float, Float]:
        """Return the directions (2,) of the main road at the crossing road, and of the crossing road, to the left."""
        heading = np.deg2rad(self.crossing.start_heading_deg)
        across = np.array([np.cos(heading), np.sin(heading)])
        return np.array([across[1], -across[0]]), across

    def _direction(self, ahead: float) -> float:
        """Return the direction (rad) of a ramp that runs to the crossing road with the stations (1) or against them."""
        along = self._directions()[0] * ahead
        return float(np.arctan2(along[1], along[0]))

    @property
    def _goal(self) -> Float:
        """The place (2,), local, m, at which a direct ramp's mouth begins."""
        along, across = self._directions()
        middle = self.geometry.alignment.position(np.array([self.crossing.station]))[0]
        back = (self.crossing.half_width + _MOUTH) * self.place.ahead
        goal: Float = middle + self.place.sign * self.values.distance * across - back * along
        return goal

    def _first(self, pose: Pose, sway: float, away: float) -> list[Element]:
        """Return the elements in which a direct ramp turns away from the main road, up to a straight line."""
        first = [Element(sway, pose.curvature, 0.0)]
        direction = self._direction(self.place.ahead)
        turned = self._outwards * float(np.angle(np.exp(1j * (pose.heading - direction))))
        bent = self._outwards * pose.curvature
        missing = away - turned - bent * sway / 2.0
        if missing > 0.0 and bent > 0.0:
            first.insert(0, Element(missing / bent, pose.curvature, pose.curvature))
        return first

    def _elements(self, first: list[Element], line: float, turn: float, last: float) -> list[Element]:
        """Return a direct ramp's elements by its first ones, lengths of its line and last piece, m, and its turn."""
        radius, back = self.values.radius, -self._outwards / self.values.radius
        beside = min(_SWAY, _SWAY_SHARE * abs(turn) * radius)
        return [
            *first,
            Element(max(line, _TINY), 0.0, 0.0),
            Element(beside, 0.0, back),
            Element(max(turn * radius - beside, _TINY), back, back),
            Element(beside, back, 0.0),
            Element(max(last, _TINY), 0.0, 0.0),
        ]

    def _solved(self, pose: Pose, first: list[Element]) -> tuple[float, float, float]:
        """Return the length of the line, m, the curve's turn, rad, and the last piece, m, that lead to the goal."""
        end = self._direction(self.place.ahead)
        middle = pose.heading + sum(element.turn for element in first)
        turn = -self._outwards * float(np.angle(np.exp(1j * (end - middle))))
        if turn <= _LEAST_TURN:
            return 0.0, turn, 0.0
        axis = Alignment(self._elements(first, 0.0, turn, 0.0), pose.x, pose.y, pose.heading)
        directions = np.array([[np.cos(middle), np.cos(end)], [np.sin(middle), np.sin(end)]])
        line, last = np.linalg.solve(directions, self._goal - axis.position(axis.length))
        return float(line) + _TINY, turn, float(last) + _TINY

    def _ramp(self, pose: Pose, parts: list[Element], distance: float) -> ConnectingRamp:
        """Return the ramp with its axis, and with heights and crossfall at its begin only."""
        carriageway, place, values = self.section.carriageway, self.place, self.values
        outer, inner = values.corner_radius, values.shared_corner
        # The neighbour of a loop's mouth lies farther from the main road, that of the other ramp nearer to it.
        is_far_shared = (place.sign > 0.0) == place.is_loop
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
            lane_width=values.lane_width,
            edge_strip_width=values.edge_strip_width,
            verge_width=nominal_width(carriageway.verge_width),
            verge_slope_percent=carriageway.verge_slope_percent,
            mouth_station=self.crossing.length / 2.0 + place.sign * distance,
            mouth_side="right" if place.beside > 0.0 else "left",
            mouth_length=_MOUTH,
            mouth_grade_percent=_MOUTH_GRADE,
            near_radius=outer if is_far_shared else inner,
            far_radius=inner if is_far_shared else outer,
            design_speed=values.design_speed,
            priority=values.priority,
        )


def ramp_length(section: CarriagewaySection) -> float:
    """Return the length (m) of a turnout's own ramp: where the ground beside it is as wide as two verges."""
    carriageway = section.carriageway
    shoulder, verge = nominal_width(carriageway.hard_shoulder_width), nominal_width(carriageway.verge_width)
    nose, length = ((6.0 * _CLOTHOID**2 * (shoulder + width)) ** (1.0 / 3.0) for width in (NOSE_WIDTH, 2.0 * verge))
    return round_value(max(length, nose + NOSE_BEFORE_END + _OFF), 3)


def turnout_of(geometry: RoadGeometry, place: Quadrant, values: RampValues) -> Turnout:
    """Return an exit or entry with a lane as the guideline asks for, and its ramp up to the cut; at station 0."""
    is_exit = place.kind == "exit"
    return Turnout(
        instance=1,
        carriageway=f"carriageway-{place.side}",
        kind=place.kind,
        start_station=0.0,
        taper_in_length=TURNOUT_TAPER if is_exit else 0.0,
        lane_length=LIMITS[geometry.parameters.design_class].turnout_lane_length,
        taper_out_length=0.0 if is_exit else TURNOUT_TAPER,
        lane_width=TURNOUT_LANE_WIDTH,
        edge_strip_width=TURNOUT_EDGE_STRIP,
        shoulder_width=0.0,
        ramp=Ramp(
            length=ramp_length(geometry.sections[place.side]),
            clothoid_parameter=_CLOTHOID,
            lane_width=values.lane_width,
            edge_strip_width=values.edge_strip_width,
            crossfall_percent=-place.sign * values.turnout_fall,
            run_off_length=20.0,
        ),
    )


def _with_heights(
    fitter: RampFitter, ramp: ConnectingRamp, pose: Pose, parts: list[Element], arc: int
) -> ConnectingRamp:
    """Return a ramp with its profile and its crossfall: from the cut's to the mouth's."""
    mouth = Crossing(fitter.geometry.parameters, fitter.crossing, {"ramp": ramp}, None).mouths["ramp"]
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
    fall = -mouth.side_road.crossfall_percent * float(np.sign(left @ mouth.across))
    # Where the axis turns to the left the surface falls to the left.
    inwards = -float(np.sign(parts[arc].curvature_start)) * fitter.values.crossfall
    begin_fall = 100.0 * pose.crossfall
    borders = [0.0, *np.cumsum([part.length for part in parts]).tolist()]
    places = [(0.0, begin_fall)]
    if arc > 1:
        # Up to the line before the curve it falls as at the cut, where that is inwards or it can stay.
        held = begin_fall if np.sign(inwards) == np.sign(begin_fall) else 0.0
        places += [(borders[number], begin_fall) for number in range(1, arc - 2)]
        places.append((borders[arc - 1], held))
    else:
        places.append((_HELD, begin_fall))
    places += [(borders[arc], inwards), (borders[arc + 1], inwards), (length - 1.0, fall), (length, fall)]
    points = tuple(CrossfallPoint(station=s, crossfall_percent=percent) for s, percent in places)
    return ramp.model_copy(update={"vertical": vertical, "crossfall": points})
