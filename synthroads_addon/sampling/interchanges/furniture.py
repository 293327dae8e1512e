"""Furniture of an interchange's ramps and crossing road: guardrails by need, delineators, signs and light at mouths.

What stands at a place has a station and an offset of the main road, as everything beside it; guardrails run along
their own road.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.arrays import Float
from ...base.schema import round_value
from ...road.alignment import Alignment
from ...road.ground.main_surface import main_surface_elevation
from ...road.guidelines import (
    EMBANKMENT_HEIGHT,
    EMBANKMENT_RUN,
    GUIDELINE_OF_CLASS,
    SHORTEST_BARRIER,
    SIGN_DISTANCE,
    SignRole,
)
from ...road.network.crossing import DESIGN_CLASS, NARROWING, Crossing
from ...road.network.network import Joint, network_of
from ...road.objects import LineObject, PointObject, RoadObject
from ...road.other_roads.axis import HorizontalElement
from ...road.other_roads.guardrail import RampGuardrail
from ...road.side_roads.mouth import Mouth
from ...road.things.delineator import Delineator
from ...road.things.pole import Pole
from ...road.things.sign import TrafficSign
from ...road.things.thing import StandingThing
from ..placing.barriers import SHORT_TERMINAL, TERMINAL
from ..placing.delineators import DELINEATOR_BEHIND_BARRIER, DELINEATOR_DISTANCE, delineator_stations
from ..placing.draw import draw
from ..placing.layout import BARRIER_AXIS
from ..placing.ranges import Range, merge_ranges
from ..placing.signs import country_sign_fields, destination_values
from ..placing.site import PlacementSite

_MARGIN = 0.05
"""How much farther than it must be a thing stands from the pavement, m; chosen."""
_FROM_CUT, _FROM_MOUTH, _FROM_BRIDGE = 4.0, 1.0, 1.0
"""Length (m) kept free behind a ramp's cut, beside a mouth's corners, before a bridge's narrowing verges; chosen."""
_STEP = 2.0
"""Distance of the stations at which an embankment is looked at, m."""
_OUT = (3.0, 6.0, 9.0)
"""Distances beyond a verge (m) at which the ground below an embankment is looked at; chosen."""
_JOIN = 24.0
"""Guardrails nearer than this become one, and each begins half of it before its need, m; chosen."""
_SHORTEST = 24.0
"""Shortest guardrail where there is no room for `SHORTEST_BARRIER`, m; chosen."""
_APART = 1.5
"""Least distance (m) of two things that stand at a place; chosen."""
_BESIDE_RAIL = 0.6
"""Least distance (m) of what stands at a place from what runs along the main road; chosen."""
_ON_CORNER = 0.75
"""Where the sign for giving way stands along the corner, as a share of its turn; chosen, as at side roads."""
_BEHIND_CORNER, _BEFORE_MOUTH = 3.0, 10.0
"""How far behind the corners' ends signs against driving in the wrong way stand, and the signpost before them, m."""
_BEHIND_MOUTH = 20.0
"""From a mouth to the sign of the priority road behind it, m; chosen."""
_POLE, _ARM, _POLE_HEIGHT, _POLE_OUT = 0.16, 1.5, 8.0, 0.4
"""Diameter, arm and height of the poles that light mouths, and how far behind the verge they stand, m; chosen."""
_BESIDE_FOOT = 0.5
"""Distance (m) from the feet of other things; chosen."""
_POLE_BESIDE = 6.0
"""From a mouth's corners to the poles that light it, m; chosen."""
_ROLES: dict[str, SignRole] = {"give_way": "give_way", "stop": "stop"}


@dataclass(frozen=True)
class _Roadside:
    """One side of a ramp or crossing road.

    Attributes:
        name: id of the road.
        axis: of the road.
        sign: 1 for the left side, -1 for the right one.
        half_width, verge_width: of its pavement, and of its verge, m.
        spans: own stations (m) between which things may stand.
        longest: own station (m) up to which guardrails may reach.
    """

    name: str
    axis: Alignment
    sign: float
    half_width: float
    verge_width: float
    spans: tuple[Range, ...]
    longest: float

    @property
    def side(self) -> str:
        """Return the name of the side."""
        return "left" if self.sign > 0.0 else "right"


class _Furniture:
    """Furniture of one interchange.

    Attributes:
        site: the main road.
        network: its roads.
        stands: places (2,) of what stands already, local, m.
        feet: boxes of their feet, as pylons have several.
        lines: what runs along the main road.
    """

    def __init__(self, site: PlacementSite, objects: Mapping[str, Any]) -> None:
        self.site, self.network = site, network_of(site.geometry)
        points = [item for item in objects.values() if isinstance(item, PointObject)]
        self.lines = [item for item in objects.values() if isinstance(item, LineObject)]
        stations, offsets = (np.array([getattr(p, name) for p in points]) for name in ("station", "offset"))
        standing = (item for item in objects.values() if isinstance(item, StandingThing))
        self.feet = [block for item in standing for block in item.footprint() if block.part == "foot"]
        self.stands: list[Float] = list(site.geometry.alignment.place(stations, offsets)) if points else []
        self.rng = site.stream("interchange", "furniture")

    def all(self) -> Iterator[tuple[str, RoadObject]]:
        """Yield (id, object) of all furniture; every object has the instance number 1."""
        scenario = self.site.scenario
        rail_height = draw(self.rng, scenario.barriers.guardrail_height)
        is_lit = self.rng.random() < scenario.interchange.lighting
        values = destination_values(self.rng, self.site)
        if scenario.furniture.signs:
            yield from self._signs(values)
        if is_lit:
            yield from self._lights()
        for roadside in self._roadsides():
            rails = list(self._rails(roadside, rail_height)) if scenario.barriers.roadside else []
            yield from rails
            if scenario.furniture.delineators:
                yield from self._delineators(roadside, [rail for _, rail in rails])

    # --- places ---------------------------------------------------------------------------------------------------

    def _put(self, kind: type[Any], place: Float, heading: float, **fields: Any) -> Any | None:
        """Return a thing at a place (2,) that faces traffic in a direction (rad); None where it has no room."""
        if self.stands and np.linalg.norm(np.array(self.stands) - place, axis=1).min() < _APART:
            return None
        geometry = self.site.geometry
        station, offset = (values.round(9) for values in geometry.alignment.project(place[None]))
        s, d = float(station[0]), float(offset[0])
        # Beside the road's end there is nothing to stand on.
        if not 0.0 < s < self.site.length or abs(d) > self.site.terrain.half_width - 1.0:
            return None
        if any(
            foot.start - _BESIDE_FOOT <= s <= foot.end + _BESIDE_FOOT
            and foot.low - _BESIDE_FOOT <= d <= foot.high + _BESIDE_FOOT
            for foot in self.feet
        ):
            return None
        beside = (item for item in self.lines if item.start_station <= s <= item.end_station)
        if any(abs(float(item.offset_at(station)[0]) - d) < _BESIDE_RAIL for item in beside):
            return None
        boundaries = geometry.offsets(station)[0]
        if boundaries[-1] <= d <= boundaries[0] or self.network.paves(place[None], SIGN_DISTANCE)[0]:
            return None
        self.stands.append(place)
        turn = heading - float(geometry.alignment.heading(station)[0])
        rotation = round_value(float(np.rad2deg(np.angle(np.exp(1j * turn)))))
        return kind(instance=1, station=round_value(s), offset=round_value(d), rotation_deg=rotation, **fields)

    def _roadsides(self) -> Iterator[_Roadside]:
        """Yield both sides of every ramp and crossing road."""
        for sign in (1.0, -1.0):
            for name, joint in self.network.joints.items():
                ramp, axis = joint.ramp, joint.surface.axis
                end = axis.length + ramp.mouth_length - max(c.end_u for c in _corners(joint.surface.mouth))
                spans = ((_FROM_CUT, end - _FROM_MOUTH),)
                yield _Roadside(name, axis, sign, ramp.half_width, ramp.verge_width, spans, axis.length)
            for name, crossing in self.network.crossings.items():
                road = crossing.road
                yield _Roadside(
                    name,
                    crossing.geometry.alignment,
                    sign,
                    road.half_width,
                    road.verge_width,
                    tuple(self._free_spans(crossing, sign)),
                    road.length,
                )

    def _free_spans(self, crossing: Crossing, side: float) -> Iterator[Range]:
        """Yield the own stations (m) between which things may stand on one side of a crossing road."""
        openings = crossing.geometry.openings("left" if side > 0.0 else "right")
        begin = _FROM_MOUTH
        for start, end in sorted([*openings, self._at_bridge(crossing)]):
            if start - _FROM_MOUTH / 2.0 > begin:
                yield begin, start - _FROM_MOUTH / 2.0
            begin = max(begin, end + _FROM_MOUTH / 2.0)
        if begin < crossing.road.length - _FROM_MOUTH:
            yield begin, crossing.road.length - _FROM_MOUTH

    def _at_bridge(self, crossing: Crossing) -> Range:
        """Return the own stations (m) between which a crossing road is on its bridge or below the main road's."""
        if crossing.bridge:
            start, end = crossing.bridge
            return start - NARROWING - _FROM_BRIDGE, end + NARROWING + _FROM_BRIDGE
        edges = self.site.geometry.offsets(np.array([crossing.road.station]))[0]
        middle, reach = crossing.road.length / 2.0, float(np.abs(edges).max()) + _FROM_BRIDGE
        return middle - reach, middle + reach

    # --- guardrails and delineators ---------------------------------------------------------------------------------

    def _rails(self, roadside: _Roadside, height: float) -> Iterator[tuple[str, RampGuardrail]]:
        """Yield (id, guardrail) of one side, where its embankment is high and steep."""
        if self.site.terrain.batter_slope >= EMBANKMENT_RUN:
            return
        number = 0
        for span in roadside.spans:
            low, high = span[0], min(span[1], roadside.longest)
            for start, end in self._high_stretches(roadside, (low, high)):
                missing = max(SHORTEST_BARRIER - (end - start), 0.0)
                begin = max(low, start - missing / 2.0)
                finish = min(high, begin + max(SHORTEST_BARRIER, end - begin))
                begin = max(low, min(begin, finish - SHORTEST_BARRIER))
                if finish - begin < _SHORTEST:
                    continue
                number += 1
                is_free = begin > low and finish < high
                yield (
                    f"guardrail-{roadside.name}-{roadside.side}-{number}",
                    RampGuardrail(
                        instance=1,
                        road=roadside.name,
                        start_station=round_value(begin),
                        end_station=round_value(finish),
                        offset=round_value(roadside.sign * (roadside.half_width + BARRIER_AXIS)),
                        faces="right" if roadside.sign > 0.0 else "left",
                        height=height,
                        terminal_length=TERMINAL if is_free else SHORT_TERMINAL,
                    ),
                )

    def _high_stretches(self, roadside: _Roadside, span: Range) -> list[Range]:
        """Return the stretches (m) of a span in which the road lies so high above the ground beside it."""
        station = np.arange(span[0], span[1], _STEP)
        if not len(station):
            return []
        edge = roadside.half_width + roadside.verge_width
        geometry = self.site.geometry
        ground = []
        for out in _OUT:
            places = roadside.axis.place(station, np.full(len(station), roadside.sign * (edge + out)))
            s, d = geometry.alignment.project(places)
            ground.append(main_surface_elevation(geometry, np.clip(s, 0.0, geometry.length), d))
        drop = self._elevation(roadside.name, station) - np.min(ground, axis=0)
        high = station[drop > EMBANKMENT_HEIGHT].tolist()
        stretches = merge_ranges([(s, s + _STEP) for s in high], _JOIN)
        return [(max(span[0], a - _JOIN / 2.0), min(span[1], b + _JOIN / 2.0)) for a, b in stretches]

    def _elevation(self, name: str, station: Float) -> Float:
        """Return the elevations (N,) of a road's profile at own stations (N,), m."""
        if name in self.network.joints:
            return self.network.joints[name].surface.profile.elevation(station)
        return self.network.crossings[name].geometry.profile.elevation(station)

    def _delineators(self, roadside: _Roadside, rails: list[RampGuardrail]) -> Iterator[tuple[str, Delineator]]:
        """Yield (id, delineator) of one side, behind its guardrails."""
        elements = self._elements(roadside.name)
        number = 0
        for station in delineator_stations(elements).tolist():
            if not any(start <= station <= end for start, end in roadside.spans):
                continue
            is_behind = any(rail.start_station - 1.0 < station < rail.end_station + 1.0 for rail in rails)
            distance = DELINEATOR_BEHIND_BARRIER if is_behind else DELINEATOR_DISTANCE + _MARGIN
            at = np.array([station])
            place = roadside.axis.place(at, np.array([roadside.sign * (roadside.half_width + distance)]))[0]
            heading = float(roadside.axis.heading(at)[0]) + (np.pi if roadside.sign > 0.0 else 0.0)
            post = self._put(Delineator, place, heading)
            if post is not None:
                number += 1
                yield f"delineator-{roadside.name}-{roadside.side}-{number:03d}", post

    def _elements(self, name: str) -> tuple[HorizontalElement, ...]:
        """Return the elements of a road's axis."""
        joints, crossings = self.network.joints, self.network.crossings
        return joints[name].ramp.horizontal if name in joints else crossings[name].road.horizontal

    # --- signs and light --------------------------------------------------------------------------------------------

    def _code(self, role: SignRole) -> str | None:
        """Return the code of the country's sign for a purpose on its country roads; None where it has none."""
        own, rural = self.site.guideline, GUIDELINE_OF_CLASS[DESIGN_CLASS]
        roles = own.sign_roles | (rural.sign_roles if rural.country == own.country else {})
        return roles.get(role)

    def _signs(self, values: dict[str, str]) -> Iterator[tuple[str, TrafficSign]]:
        """Yield (id, sign) of all signs at mouths and along crossing roads."""
        for name, joint in self.network.joints.items():
            is_exit = self.network.leaves(joint)
            parts = self._exit_mouth(joint, values) if is_exit else self._entry_mouth(joint, values)
            for number, sign in enumerate(parts, 1):
                yield f"sign-{name}-{number}", sign
        for name, crossing in self.network.crossings.items():
            for number, sign in enumerate(self._priority(crossing), 1):
                yield f"sign-{name}-{number}", sign

    def _exit_mouth(self, joint: Joint, values: dict[str, str]) -> Iterator[TrafficSign]:
        """Yield the signs at an exit's mouth: for giving way, against the wrong way, and signposts."""
        mouth, ramp = joint.surface.mouth, joint.ramp
        towards = float(np.arctan2(-mouth.ahead[1], -mouth.ahead[0]))
        if (role := _ROLES.get(ramp.priority)) is not None and (code := self._code(role)) is not None:
            fields = country_sign_fields(code, {})
            corner = mouth.corner(mouth.incoming)
            beside = SIGN_DISTANCE + 2.0 * _MARGIN + fields["width"] / 2.0
            place = corner.arc(np.array([_ON_CORNER]), corner.radius - beside)[0]
            yield from self._sign(place, towards, fields)
        end = max(corner.end_u for corner in _corners(mouth))
        for sign in (1.0, -1.0):
            yield from self._beside_mouth(mouth, ramp.half_width, sign, end + _BEHIND_CORNER, "wrong_way", {}, True)
        posts: tuple[tuple[SignRole, float], ...] = (("signpost_left", -1.0), ("signpost_right", 1.0))
        for post, side in posts:
            yield from self._beside_mouth(
                mouth, ramp.half_width, side * mouth.incoming, end + _BEFORE_MOUTH, post, values, False
            )

    def _entry_mouth(self, joint: Joint, values: dict[str, str]) -> Iterator[TrafficSign]:
        """Yield the signposts to the motorway at an entry's mouth, one for either direction of the crossing road."""
        mouth, crossing = joint.surface.mouth, self.network.crossings[joint.ramp.crossing_road]
        openings = crossing.mouths[next(n for n, m in crossing.mouths.items() if m is mouth)]
        side = openings.sign
        for low in (True, False):
            # Behind the mouth for those who drive towards it: at higher stations for those who drive with them.
            start, end = openings.low.start_station, openings.high.start_station
            station = start - _FROM_MOUTH if low else end + _FROM_MOUTH
            forward = not low
            is_right = (side < 0.0) == forward
            role: SignRole = "motorway_right" if is_right else "motorway_left"
            yield from self._along(crossing, side, station, forward, role, values)

    def _priority(self, crossing: Crossing) -> Iterator[TrafficSign]:
        """Yield the signs of the priority road behind the mouths of a crossing road, for either direction."""
        for forward in (True, False):
            side = -1.0 if forward else 1.0
            mouths = crossing.mouths.values()
            ends = sorted((m.high if forward else m.low).start_station for m in mouths)
            for end in ends[1::2] if forward else ends[::2]:
                station = end + (_BEHIND_MOUTH if forward else -_BEHIND_MOUTH)
                yield from self._along(crossing, side, station, forward, "priority_road", {})

    def _along(
        self, crossing: Crossing, side: float, station: float, forward: bool, role: SignRole, values: dict[str, str]
    ) -> Iterator[TrafficSign]:
        """Yield the sign of a purpose beside a crossing road, for those who drive with its stations or against them."""
        code = self._code(role)
        if code is None or not any(a <= station <= b for a, b in self._free_spans(crossing, side)):
            return
        fields = country_sign_fields(code, values)
        axis, at = crossing.geometry.alignment, np.array([station])
        distance = crossing.road.half_width + SIGN_DISTANCE + 2.0 * _MARGIN + fields["width"] / 2.0
        heading = float(axis.heading(at)[0]) + (0.0 if forward else np.pi)
        yield from self._sign(axis.place(at, np.array([side * distance]))[0], heading, fields)

    def _beside_mouth(
        self,
        mouth: Mouth,
        half_width: float,
        side: float,
        distance: float,
        role: SignRole,
        values: dict[str, str],
        leaves: bool,
    ) -> Iterator[TrafficSign]:
        """Yield the sign of a purpose beside a ramp, at a distance (m) from the crossing road.

        Args:
            mouth: of the ramp.
            half_width: of its pavement, m.
            side: 1 or -1, as ``v`` of the mouth.
            distance: from the crossing road's edge, m.
            role: what the sign is for.
            values: what is filled into its text.
            leaves: whether it faces those who drive away from the crossing road.
        """
        code = self._code(role)
        if code is None:
            return
        fields = country_sign_fields(code, values)
        v = side * (half_width + SIGN_DISTANCE + 2.0 * _MARGIN + fields["width"] / 2.0)
        heading = float(np.arctan2(mouth.ahead[1], mouth.ahead[0])) + (0.0 if leaves else np.pi)
        yield from self._sign(mouth.place(np.array([distance]), np.array([v]))[0], heading, fields)

    def _sign(self, place: Float, heading: float, fields: dict[str, Any]) -> Iterator[TrafficSign]:
        """Yield a sign at a place (2,) that faces traffic in a direction (rad), where it has room."""
        sign = self._put(TrafficSign, place, heading, **fields)
        if sign is not None:
            yield sign

    def _lights(self) -> Iterator[tuple[str, Pole]]:
        """Yield (id, pole) of the lights beside both corners of every mouth."""
        for crossing in self.network.crossings.values():
            axis = crossing.geometry.alignment
            for name, mouth in crossing.mouths.items():
                for word, station in _beside_corners(mouth):
                    out = crossing.road.half_width + crossing.road.verge_width + _POLE_OUT
                    at = np.array([station])
                    place = axis.place(at, np.array([mouth.sign * out]))[0]
                    heading = float(axis.heading(at)[0]) + (np.pi if mouth.sign > 0.0 else 0.0)
                    pole = self._put(Pole, place, heading, height=_POLE_HEIGHT, diameter=_POLE, arm_length=_ARM)
                    if pole is not None:
                        yield f"pole-{name}-{word}", pole


def _beside_corners(mouth: Mouth) -> tuple[tuple[str, float], tuple[str, float]]:
    """Return the names of a mouth's corners with the crossing road's stations (m) of the poles beside them."""
    return ("low", mouth.low.start_station - _POLE_BESIDE), ("high", mouth.high.start_station + _POLE_BESIDE)


def _corners(mouth: Mouth) -> tuple[Any, Any]:
    """Return the two corners of a mouth."""
    return mouth.low, mouth.high


def interchange_furniture(site: PlacementSite, objects: Mapping[str, Any]) -> Iterator[tuple[str, RoadObject]]:
    """Yield (id, object) of the furniture of an interchange's ramps and crossing road.

    Args:
        site: the road.
        objects: what stands already, by id.
    """
    if site.scenario.placement == "rules":
        yield from _Furniture(site, objects).all()
