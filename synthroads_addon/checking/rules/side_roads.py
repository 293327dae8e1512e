"""Rules for side roads that join a country road: where there may be one, its line, and room for it."""

from collections.abc import Iterator
from itertools import pairwise, product

import numpy as np

from ...road.objects import PointObject
from ...road.section import Turnout
from ...road.side_roads.side_road import SideRoad
from ...road.things.sign import TrafficSign
from .rule import TOLERANCE, Finding, Road, Rule, at_least, at_most

_TURNED = 45.0
"""Signs may be turned away from those who come by this angle, degrees. Chosen."""
_BESIDE = 6.0
"""From the pavement of a side road to a sign that is its own, m at most. Chosen."""
_GRADE_SEPARATED = ("EKL1",)
"""Classes whose junctions are grade-separated: BASt on the RAL, 2013; textbook, draft of 2008, page 58."""


def _at_grade(road: Road) -> Iterator[Finding]:
    """Yield a finding for each side road of a class whose junctions are grade-separated."""
    if road.design_class in _GRADE_SEPARATED:
        for name, side_road in road.of(SideRoad).items():
            text = f"A side road joins at grade; junctions of {road.guideline} are grade-separated (confirmed)."
            yield Finding(name, side_road.station, 1.0, 0.0, text)


def _narrow_line(road: Road) -> Iterator[Finding]:
    """Yield a finding for each line between lanes of a side road that are too narrow for one."""
    least_width = road.limits.narrowest_centre_line_lane
    for name, side_road in road.of(SideRoad).items():
        if side_road.centre_line and side_road.lanes > 1 and least_width:
            text = (
                f"The side road's lanes are {side_road.lane_width:.2f} m wide; a line between them needs "
                f"{least_width:.2f} m ({road.cite('narrowest_centre_line_lane')})."
            )
            yield from at_least(name, side_road.station, side_road.lane_width, least_width, text)


def mouth_spans(road: Road, carriageway: str) -> list[tuple[float, float]]:
    """Return the stations (m) of the mouths of a carriageway's side roads."""
    return [_span(item) for item in road.of(SideRoad).values() if item.carriageway == carriageway]


def _span(side_road: SideRoad) -> tuple[float, float]:
    """Return the stations (m) between which a side road's corners leave the edge of a straight road."""
    angle = np.deg2rad(side_road.angle_deg)
    sine, cosine = float(np.sin(angle)), float(np.cos(angle))
    low = (side_road.near_radius * cosine - side_road.half_width - side_road.near_radius) / sine
    high = (side_road.far_radius * cosine + side_road.half_width + side_road.far_radius) / sine
    return side_road.station + low, side_road.station + high


def _room(road: Road) -> Iterator[Finding]:
    """Yield a finding for each mouth that reaches beyond the road's ends or into a bay or mouth on its side."""
    for carriageway in road.sides:
        items = [(*_span(item), name) for name, item in road.of(SideRoad).items() if item.carriageway == carriageway]
        spans = sorted(items)
        for start, end, name in spans:
            if start < -TOLERANCE:
                text = f"The side road's mouth reaches {-start:.1f} m beyond the road's beginning."
                yield Finding(name, 0.0, -start, 0.0, text)
            over = end - road.length
            if over > TOLERANCE:
                text = f"The side road's mouth reaches {over:.1f} m beyond the road's end."
                yield Finding(name, road.length, over, 0.0, text)
        for (_, end, first), (start, _, second) in pairwise(spans):
            if start < end - TOLERANCE:
                text = f"The mouths of {first} and {second} overlap by {end - start:.1f} m."
                yield Finding(second, start, end - start, 0.0, text)
        bays = [(key, item) for key, item in road.of(Turnout).items() if item.carriageway == carriageway]
        for (start, end, name), (key, bay) in product(spans, bays):
            overlap = min(end, bay.end_station) - max(start, bay.start_station)
            if overlap > TOLERANCE:
                text = f"The side road's mouth overlaps {key} by {overlap:.1f} m."
                yield Finding(name, max(start, bay.start_station), overlap, 0.0, text)


def _objects(road: Road) -> Iterator[Finding]:
    """Yield a finding for each thing that stands on a side road's pavement."""
    for name, side_road in road.of(SideRoad).items():
        edges = road.sides[side_road.carriageway]
        edge = float(edges.at(np.array([side_road.station])).outer[0])
        angle = np.deg2rad(side_road.angle_deg)
        for thing_name, thing in road.each(PointObject):
            depth = edges.sign * thing.offset - edge
            if depth <= 0.0:
                continue
            # On curves what lies farther out is longer or shorter than the centreline.
            stretch = 1.0 - _curvature(road, side_road.station) * thing.offset
            along = (thing.station - side_road.station) * stretch
            u = along * np.cos(angle) + depth * np.sin(angle)
            v = float(along * np.sin(angle) - depth * np.cos(angle))
            if u <= side_road.length and abs(v) < side_road.half_width * (1.0 - TOLERANCE):
                text = f"{thing_name} stands {abs(v):.2f} m from the axis of {name}, on its pavement."
                yield Finding(thing_name, thing.station, abs(v), side_road.half_width, text)


def _mouth_signs(road: Road) -> Iterator[Finding]:
    """Yield a finding for each mouth without the sign that tells those who come to give way, or to stop."""
    limit = road.limits.mouth_sign_distance
    for name, side_road in road.of(SideRoad).items():
        code = road.sign_of(side_road.priority) if side_road.priority != "none" else None
        if code is None or not limit:
            continue
        signs = [sign for sign in road.of(TrafficSign).values() if sign.code == code]
        distances = [place[0] for sign in signs if (place := _before_mouth(road, side_road, sign)) is not None]
        distance = min(distances, default=road.length)
        text = (
            f"No sign {code} faces those who come to the road within {limit:g} m of its edge "
            f"({road.cite('mouth_sign_distance')})."
        )
        yield from at_most(name, side_road.station, distance, limit, text)


def is_at_mouth(road: Road, sign: TrafficSign) -> bool:
    """Return whether a sign stands at the mouth of a side road and faces those who come from there."""
    roles = {road.sign_of("give_way"), road.sign_of("stop")}
    if sign.code not in roles:
        return False
    return any(_before_mouth(road, side_road, sign) is not None for side_road in road.of(SideRoad).values())


def _before_mouth(road: Road, side_road: SideRoad, sign: TrafficSign) -> tuple[float, float] | None:
    """Return u and v (m) of a sign along a side road and across, or None if it isn't for those who come from there."""
    edges = road.sides[side_road.carriageway]
    depth = edges.sign * sign.offset - float(edges.at(np.array([side_road.station])).outer[0])
    # On curves what lies farther out is longer or shorter than the centreline.
    curvature = _curvature(road, side_road.station)
    along = (sign.station - side_road.station) * (1.0 - curvature * sign.offset)
    angle = np.deg2rad(side_road.angle_deg)
    u = float(along * np.cos(angle) + depth * np.sin(angle))
    v = float(along * np.sin(angle) - depth * np.cos(angle))
    # Those who come drive against its axis, on the side of v that their traffic keeps to.
    turned = np.rad2deg(curvature * (sign.station - side_road.station))
    wanted_rotation = edges.sign * side_road.angle_deg + 180.0 - turned
    away = abs((sign.rotation_deg - wanted_rotation + 180.0) % 360.0 - 180.0)
    is_their_side = v * edges.traffic > side_road.half_width * (1.0 - TOLERANCE)
    is_near = 0.0 <= u <= side_road.length and abs(v) <= side_road.half_width + _BESIDE
    return (u, v) if is_their_side and is_near and away <= _TURNED else None


def _curvature(road: Road, station: float) -> float:
    """Return the centreline's curvature at a station (m), 1/m."""
    index = int(np.clip(np.searchsorted(road.starts, station, side="right") - 1, 0, len(road.lengths) - 1))
    share = (station - road.starts[index]) / max(road.lengths[index], 1e-9)
    return float(road.k0[index] + share * (road.k1[index] - road.k0[index]))


RULES = (
    Rule("side-road-grade", "No side road at grade", "1", "RAL", "confirmed", _at_grade),
    Rule("side-road-line-narrow", "Narrowest side road lanes with a line", "m", "RMS", "confirmed", _narrow_line),
    Rule("side-road-room", "Side roads' mouths have room", "m", "", "definition", _room),
    Rule("mouth-sign", "Signs for giving way at mouths", "m", "VwV-StVO", "confirmed", _mouth_signs),
    Rule("object-on-side-road", "Nothing stands on a side road", "m", "", "definition", _objects),
)
