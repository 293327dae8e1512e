"""Ramps as roads of their own, and the junctions at which they leave the main road or come to it.

A ramp's reference line is its axis, which runs away from the main road: traffic of an entry drives on its left lane.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ...base.arrays import Float
from ...road.geometry import RoadGeometry
from ...road.network.network import Joint, Network, network_of
from .pieces import fit_cubics, join_cubics, merge_similar, merged_stations
from .surface import CONNECTOR, RoadFrame
from .xml import PLAN_DIGITS, Element, add_cubic, add_object_data, add_user_data, element

_WARPED, _WARP_STEP, _STEP = 15.0, 1.0, 10.0
"""Length (m) behind the cut over which a ramp's widths and heights are followed closely, and the steps there and
beyond, m."""
_SHORTEST = 1e-4
_AHEAD = 1e-3


def is_exit(geometry: RoadGeometry, joint: Joint) -> bool:
    """Return whether a ramp's traffic runs along its axis, away from the main road."""
    return network_of(geometry).leaves(joint)


def cut_span(joint: Joint) -> tuple[float, float]:
    """Return the stations (m) of the main road's junction at a ramp's cut, the lower one first."""
    ends = joint.cut.station, joint.cut.station + joint.cut.ahead * CONNECTOR
    return min(ends), max(ends)


def ramp_road(
    network: Network, joint: Joint, span: tuple[float, float], number: int, junction: str, name: str
) -> Element:
    """Return the `road` element of a stretch of a ramp, between two stations (m) of its axis or beyond its end.

    Args:
        network: that it belongs to.
        joint: the ramp.
        span: its stations, m.
        number, junction, name: id of the `road`, of the junction that it belongs to or "-1", and its name.
    """
    start, end = span
    ramp, surface = joint.ramp, joint.surface
    road = element(
        None, "road", {"name": name, "id": number, "junction": junction, "length": end - start, "rule": "RHT"}
    )
    kind = element(road, "type", {"s": 0.0, "type": "motorway", "country": "DE"})
    element(kind, "speed", {"max": ramp.design_speed, "unit": "km/h"})
    _plan_view(road, joint, start, end)
    borders = merged_stations([*surface.profile.breakpoints.tolist(), *(p.station for p in ramp.crossfall)], start, end)
    heights = fit_cubics(lambda s: np.asarray(surface.profile.elevation(s))[:, None], borders)
    _cubics(element(road, "elevationProfile"), "elevation", borders=heights.borders, rows=heights.coefficients[:, 0])

    def tilt(station: Float) -> Float:
        return np.arctan(surface.crossfall(station) / np.sqrt(1.0 + surface.profile.grade(station) ** 2))[:, None]

    tilts = fit_cubics(tilt, borders)
    _cubics(element(road, "lateralProfile"), "superelevation", borders=tilts.borders, rows=tilts.coefficients[:, 0])
    _lanes(road, network, joint, start, end)
    add_user_data(road, "instance", ramp.instance)
    add_object_data(road, joint.name, ramp.instance, object_type="ConnectingRamp")
    return road


def _cubics(parent: Element, tag: str, borders: Float, rows: Float) -> None:
    """Add an element for each cubic, counted from the first border."""
    joined = join_cubics(borders, rows)
    for place, coefficients in merge_similar(joined, float(borders[-1])):
        add_cubic(parent, tag, {"s": place - float(borders[0])}, coefficients)


def _plan_view(road: Element, joint: Joint, start: float, end: float) -> None:
    """Add the `planView` of a ramp's axis between two stations (m); beyond its end it goes on straight."""
    axis = joint.surface.axis
    parent = element(road, "planView")
    starts = [min(start, 0.0), *axis.element_starts.tolist(), max(end, axis.length + 1.0)]
    for number, (begin, until) in enumerate(pairwise(starts), -1):
        low, high = max(begin, start), min(until, end)
        if high - low <= (_SHORTEST if number >= 0 else 0.0):
            continue
        position, heading, _ = axis.frame(np.array([low]))
        values = {
            "s": low - start,
            "x": repr(round(float(position[0, 0]), PLAN_DIGITS)),
            "y": repr(round(float(position[0, 1]), PLAN_DIGITS)),
            "hdg": f"{float(np.angle(np.exp(1j * heading[0]))):.13g}",
            "length": high - low,
        }
        kind = element(parent, "geometry", values)
        item = axis.elements[number] if 0 <= number < len(axis.elements) else None
        if item is None or item.kind == "line":
            element(kind, "line")
            continue
        rate = (item.curvature_end - item.curvature_start) / item.length
        ends = [item.curvature_start + rate * (place - begin) for place in (low, high)]
        if item.kind == "arc":
            element(kind, "arc", {"curvature": f"{ends[0]:.15g}"})
        else:
            element(kind, "spiral", {"curvStart": f"{ends[0]:.15g}", "curvEnd": f"{ends[1]:.15g}"})


class _Columns:
    """Offsets and heights of a ramp's borders between lanes, by the station of its axis."""

    def __init__(self, joint: Joint, begin: tuple[float, float]) -> None:
        """Prepare them; the ramp begins at a station and an offset of its axis, m, see `begin_of_ramp`."""
        self._begin = begin
        grid, surface = joint.surface.grid, joint.surface
        # Verge's edge, pavement's edge, lane's edge on either side.
        self._columns = [0, 1, 3, -4, -2, -1]
        self._grid, self._surface = grid, surface
        self._own = surface.columns

    def at(self, station: float) -> tuple[Float, Float]:
        """Return the offsets (6,), from left to right, m, and how far (6,) they lie above the axis's tilted plane."""
        surface = self._surface
        offset, height = np.empty(6), np.empty(6)
        if station <= self._begin[0] + _AHEAD / 2.0:
            # It begins with the row at the cut, which lies aslant to its axis.
            axis, height = surface.axis, self._grid.points[0, self._columns, 2]
            left = np.array([-np.sin(axis.start_heading), np.cos(axis.start_heading)])
            offset = (self._grid.points[0, self._columns, :2] - (axis.x, axis.y)) @ left
            plane = surface.profile.elevation(self._grid.station[0, self._columns])
            return offset + self._begin[1], height - plane - surface.crossfall(np.zeros(1)) * offset
        for number, column in enumerate(self._columns):
            along = self._grid.station[:, column]
            if station <= along[-1]:
                offset[number] = np.interp(station, along, self._grid.offset[:, column])
                height[number] = np.interp(station, along, self._grid.points[:, column, 2])
            else:
                offset[number] = self._own[column]
                height[number] = surface.own_height(np.array([station]), offset[number : number + 1])[0]
        places = np.array([station])
        plane = surface.profile.elevation(places) + surface.crossfall(places) * offset
        return offset, height - plane


def _lanes(road: Element, network: Network, joint: Joint, start: float, end: float) -> None:
    """Add the `lanes` of a ramp: one that is driven on, edge strips and verges."""
    forward = is_exit(network.geometry, joint)
    columns = _Columns(joint, begin_of_ramp(network, joint))
    close = np.arange(start, min(end, _WARPED), _WARP_STEP) if start < _WARPED else np.empty(0)
    far = np.arange(max(start, _WARPED), end, _STEP)
    places = np.unique(np.concatenate([close, far, [start, end]]))
    places = places[np.append(np.diff(places) > _AHEAD, True)]
    offsets, heights = (np.array(values) for values in zip(*(columns.at(s) for s in places.tolist()), strict=True))
    tilt = np.arctan(joint.surface.crossfall(places))[:, None]
    t = offsets / np.cos(tilt) + heights * np.sin(tilt)
    lanes = element(road, "lanes")
    centre = t[:, 2] if forward else t[:, 3]
    _linear(lanes, "laneOffset", "s", places - start, centre)
    section = element(lanes, "laneSection", {"s": 0.0})
    left = [(1, 2, "border", "outer_edge_strip"), (0, 1, "shoulder", "verge")]
    right = [(3, 4, "border", "outer_edge_strip"), (4, 5, "shoulder", "verge")]
    driven = (2, 3, "driving", "lane")
    groups = (("left", 1, left if forward else [driven, *left]), ("right", -1, [driven, *right] if forward else right))
    for tag, sign, strips in groups:
        group = element(None, tag)
        items = []
        for number, (a, b, lane_type, kind) in enumerate(strips, 1):
            lane = element(None, "lane", {"id": sign * number, "type": lane_type, "level": False})
            _linear(lane, "width", "sOffset", places - start, t[:, a] - t[:, b])
            inner, outer = (b, a) if sign > 0 else (a, b)
            if lane_type == "driving":
                mark = "solid"
                element(lane, "speed", {"sOffset": 0.0, "max": joint.ramp.design_speed, "unit": "km/h"})
                element(
                    lane,
                    "roadMark",
                    {
                        "sOffset": 0.0,
                        "type": mark,
                        "weight": "standard",
                        "color": "standard",
                        "width": joint.surface.line,
                    },
                )
            else:
                for place, low, high in zip(places.tolist(), heights[:, inner], heights[:, outer], strict=True):
                    edges = {"inner": round(float(low), 6) + 0.0, "outer": round(float(high), 6) + 0.0}
                    element(lane, "height", {"sOffset": place - start, **edges})
            add_user_data(lane, "instance", joint.ramp.instance)
            add_user_data(lane, "strip", kind)
            items.append(_in_order(lane))
        group.extend(items[::-1] if sign > 0 else items)
        section.append(group)
        if tag == "left":
            element(element(section, "center"), "lane", {"id": 0, "type": "none", "level": False})


_ORDER = {"link": 0, "width": 1, "border": 1, "roadMark": 2, "material": 3, "speed": 4, "access": 5, "height": 6}


def _in_order(lane: Element) -> Element:
    """Return a lane with its elements in the order of the standard's schema."""
    lane[:] = sorted(lane, key=lambda item: _ORDER.get(item.tag, 9))
    return lane


def _linear(parent: Element, tag: str, name: str, place: Float, values: Float) -> None:
    """Add a function that is linear between places (N,), m, counted from the first."""
    slopes = np.diff(values) / np.diff(place)
    rows = [
        (s, [value, slope, 0.0, 0.0])
        for s, value, slope in zip(place[:-1].tolist(), values[:-1].tolist(), slopes.tolist(), strict=True)
    ]
    for s, coefficients in merge_similar(rows, float(place[-1])):
        add_cubic(parent, tag, {name: s}, coefficients)


def begin_of_ramp(network: Network, joint: Joint) -> tuple[float, float]:
    """Return the station and the offset (m) of a ramp's axis at which readers see the lane that it goes on from.

    Where the main road climbs, its places lie some millimetres farther along it than their stations say.
    """
    geometry, axis = network.geometry, joint.surface.axis
    frame = RoadFrame(geometry, joint.side)
    shift = frame.ahead_of_station(joint.cut.station, float(joint.surface.profile.elevation(0.0)))
    turn = float(geometry.alignment.heading(np.array([joint.cut.station]))[0]) - axis.start_heading
    return shift * float(np.cos(turn)), shift * float(np.sin(turn))


def ramp_end(joint: Joint, begin_u: float) -> float:
    """Return the station (m) of a ramp's axis carried on at which its mouth's junction begins."""
    return joint.surface.axis.length + joint.ramp.mouth_length - begin_u
