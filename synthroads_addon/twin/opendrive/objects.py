"""Objects along a road: barriers, posts, gantries, bridges and painted areas, in their true dimensions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from ...road.objects import LineObject, PointObject, RoadObject
from ...road.paint import arrow_outlines, hatching_outlines
from ...road.section import Arrow, Hatching, LineMarking
from ...road.things import delineator as sizes
from ...road.things.asset import Asset
from ...road.things.beacon import ConstructionBeacon
from ...road.things.cabinet import Cabinet
from ...road.things.concrete_barrier import ConcreteBarrier
from ...road.things.delineator import Delineator
from ...road.things.gantry import Gantry
from ...road.things.guardrail import Guardrail
from ...road.things.kilometre_board import KilometreBoard
from ...road.things.noise_barrier import NoiseBarrier
from ...road.things.overpass import Overpass
from ...road.things.pole import Pole
from ...road.things.sign import TrafficSign
from ...road.things.temporary_barrier import TemporaryBarrier
from ...road.things.traffic_light import TrafficLight
from .numbers import Numbers
from .pieces import CLOSE, Float
from .places import Ground, side_of
from .surface import RoadFrame
from .xml import Element, Value, element, notes

LIGHT_POST, BOARD_POST = 0.12, 0.06
"""Diameters of a traffic light's and a kilometre board's post, m."""
BEAM_REACH, POST_REACH, BEACON_REACH = 0.2, 0.05, 0.1
_ABUTMENT = 1.0  # m, thickness of the walls that an overpass ends at

Corners = Iterable[tuple[float, float]]


class Objects:
    """Writes the objects of a road.

    Attributes:
        parent: the element that they are added to.
        ground: what they stand on.
        frame: the carriageway that is the road: it has what stands on its side of the centreline.
        numbers: ids of parts.
    """

    def __init__(self, parent: Element, ground: Ground, frame: RoadFrame, numbers: Numbers) -> None:
        self.parent = parent
        self.ground = ground
        self.frame = frame
        self.numbers = numbers

    def write(self, loose: Iterable[tuple[str, LineMarking, float, float]]) -> None:
        """Add its objects in the order of the parameter set, then the lines that follow no lane."""
        for name, item in self.ground.geometry.parameters.objects.items():
            make = _MAKERS.get(type(item))
            if make and side_of(self.ground.geometry, item) == self.frame.side:
                make(self, name, item)
        parts: dict[str, int] = {}
        for name, line, start, end in loose:
            parts[name] = parts.get(name, 0) + 1
            self.loose_line(name, line, (start, end), parts[name])

    # --- along the road ---------------------------------------------------------------------------------------------

    def barrier(self, name: str, item: LineObject) -> None:
        """Add what runs along the road: repeats with distance 0, linear from one to the next."""
        subtype, width, beside = _cross_section(item)
        rows = self.ground.along(item, self.frame, beside)
        if not len(rows):
            return
        attributes: dict[str, Value] = {"type": "barrier", "subtype": subtype, "hdg": 0.0}
        attributes |= {"length": float(rows[-1, 0] - rows[0, 0]), "width": width, "height": _tall(item)}
        made = self._placed(name, item, attributes, rows[0, :3])
        for (s0, t0, z0, h0), (s1, t1, z1, h1) in zip(rows[:-1].tolist(), rows[1:].tolist(), strict=True):
            repeat: dict[str, Value] = {"s": s0, "length": s1 - s0, "distance": 0.0, "tStart": t0, "tEnd": t1}
            repeat |= {"heightStart": h0, "heightEnd": h1, "zOffsetStart": _fine(z0), "zOffsetEnd": _fine(z1)}
            element(made, "repeat", {**repeat, "widthStart": width, "widthEnd": width})
        details = {"offset": item.offset}
        for code in ("faces", "post_spacing", "segment_length", "panel", "profile", "terminal_length"):
            if (value := getattr(item, code, None)) is not None:
                details[code] = value
        notes(made, name, item.instance, object_type=type(item).__name__, **details)

    # --- at one place -----------------------------------------------------------------------------------------------

    def upright(self, name: str, item: Any) -> None:
        """Add what stands at one place as a box or a cylinder."""
        kind, subtype, size = _SIZES[type(item)](item)
        made = self._object(name, item, {"type": kind, "subtype": subtype, "hdg": _turn(item), **size})
        arm = getattr(item, "arm_length", 0.0)
        details = {code: getattr(item, code) for code in ("class_name", "library", "scale") if hasattr(item, code)}
        if arm > 0.0:
            details["arm_length"] = arm
        notes(made, name, item.instance, object_type=type(item).__name__, **details)
        if arm > 0.0:
            line = element(element(made, "skeleton"), "polyline", {"id": 1})
            for number, (v, z) in enumerate(((0.0, 0.0), (0.0, item.height), (arm, item.height)), 1):
                element(line, "vertexLocal", {"id": number, "u": 0.0, "v": v, "z": z})

    def posts(self, name: str, item: TrafficSign | KilometreBoard | TrafficLight) -> None:
        """Add the posts of a signal as one object."""
        count = item.posts if isinstance(item, TrafficSign) else 1
        light = isinstance(item, TrafficLight)
        diameter = item.post_diameter if isinstance(item, TrafficSign) else LIGHT_POST if light else BOARD_POST
        top = item.height if isinstance(item, TrafficLight) else item.lower_edge + item.height
        size: dict[str, Value] = {"height": top, "radius": diameter / 2.0}
        if count > 1:
            size = {"height": top, "length": diameter, "width": item.width}  # type: ignore[union-attr]
        attributes: dict[str, Value] = {"type": "pole", "subtype": "signalPost", "hdg": _turn(item), **size}
        made = self._object(name, item, attributes)
        if count > 1:
            places = [((i + 0.5) / count - 0.5) * item.width for i in range(count)]  # type: ignore[union-attr]
            half = diameter / 2.0
            outlines = [_rectangle((-half, half), (v - half, v + half)) for v in places]
            _local_outlines(made, [(outline, 0.0, top) for outline in outlines])
        notes(made, name, item.instance, object_type=type(item).__name__)

    def gantry(self, name: str, item: Gantry) -> None:
        """Add a gantry: its beam and its posts as outlines around its place."""
        foot = self.ground.foot(name)
        _, bottom = gantry_levels(self.ground, item)
        left, right = item.left_offset - item.offset, item.right_offset - item.offset
        deep, half = item.beam_depth / 2.0, item.post_width / 2.0
        bodies = [(_rectangle((-deep, deep), (right, left)), bottom - foot, item.beam_height)]
        ends = {"left": [left], "right": [right]}[item.post_side]
        middle = -item.offset if item.kind == "two_sided" else None
        if item.kind != "cantilever":
            ends = [left, right] + ([] if middle is None else [middle])
        ground = self.ground.height(np.full(len(ends), item.station), np.array(ends) + item.offset)
        for v, base in zip(ends, (ground + item.elevation - foot).tolist(), strict=True):
            top = bottom - foot + (0.0 if v == middle else item.beam_height)
            bodies.append((_rectangle((-deep, deep), (v - half, v + half)), base, max(top - base, 0.0)))
        size: dict[str, Value] = {
            "length": item.beam_depth,
            "width": left - right,
            "height": bottom + item.beam_height - foot,
        }
        made = self._object(name, item, {"type": "gantry", "subtype": item.kind, "hdg": _turn(item), **size})
        _local_outlines(made, bodies)
        notes(made, name, item.instance, object_type="Gantry", beam=item.beam, clearance=item.clearance)

    def overpass(self, name: str, item: Overpass) -> None:
        """Add a bridge over the road: deck, piers and abutments as outlines; the road below is an underpass."""
        shear = math.tan(math.radians(item.rotation_deg))
        half, foot = item.width / 2.0, self.ground.foot(name)
        s0, s1 = item.station - half, item.station + half
        below = self.ground.pavement_below((s0, s1), (item.right_abutment, item.left_abutment), -shear)
        low = below + item.clearance - foot
        left, right = item.left_abutment - item.offset, item.right_abutment - item.offset
        bodies = [(_leaning((-half, half), (right, left), shear), low, item.deck_thickness)]
        for offset in item.pier_offsets:
            v, wide = offset - item.offset, item.pier_width / 2.0
            base = self._base(item, offset) - foot
            along = _rectangle((-v * shear - half * 0.8, -v * shear + half * 0.8), (v - wide, v + wide))
            bodies.append((along, base, max(low - base, 0.0)))
        for face, outwards in ((left, _ABUTMENT), (right, -_ABUTMENT)):
            base = self._base(item, face + item.offset) - foot
            wall = _leaning((-half, half), (min(face, face + outwards), max(face, face + outwards)), shear)
            bodies.append((wall, base, max(low - base, 0.0)))
        size: dict[str, Value] = {"length": item.width, "width": left - right, "height": low + item.deck_thickness}
        made = self._object(name, item, {"type": "building", "subtype": "overpass", "hdg": 0.0, **size})
        _local_outlines(made, bodies)
        details = {"clearance": item.clearance, "parapet_height": item.parapet_height}
        notes(made, name, item.instance, object_type="Overpass", **details)

    def underpasses(self) -> None:
        """Add the stretches below bridges as tunnels open to the sides, of each road; they follow all objects."""
        first = self.frame.side == next(iter(self.ground.geometry.sections))
        for name, item in self.ground.geometry.parameters.of_type(Overpass).items():
            start = max(item.station - item.width / 2.0, 0.0)
            end = min(item.station + item.width / 2.0, self.ground.geometry.length)
            attributes: dict[str, Value] = {
                "id": item.instance if first else self.numbers.next(),
                "name": name,
                "s": start,
                "length": end - start,
            }
            made = element(self.parent, "tunnel", {**attributes, "type": "underpass", "daylight": 1.0, "lighting": 0.0})
            notes(made, name, item.instance)

    def _base(self, item: Overpass, offset: float) -> float:
        return float(self.ground.height(np.array([item.station]), np.array([offset]))[0])

    # --- painted ----------------------------------------------------------------------------------------------------

    def painted(self, name: str, item: Hatching | Arrow) -> None:
        """Add a hatched area or an arrow: its parts as outlines in road coordinates."""
        geometry = self.ground.geometry
        parts = hatching_outlines(geometry, item) if isinstance(item, Hatching) else arrow_outlines(item)
        if not parts:
            return
        corners = np.concatenate(parts)
        corners[:, 0] = np.clip(corners[:, 0], 0.0, geometry.length)
        heights = self.ground.height(corners[:, 0], corners[:, 1])
        at = (item.station, item.offset) if isinstance(item, Arrow) else tuple(corners.mean(axis=0).tolist())
        z = float(self.ground.height(np.array(at[:1]), np.array(at[1:]))[0])
        subtype = "hatching" if isinstance(item, Hatching) else f"arrow_{item.kind}"
        attributes: dict[str, Value] = {"type": "roadMark", "subtype": subtype, "hdg": _turn(item)}
        made = self._object(name, item, {**attributes, "height": item.film_thickness}, (*at, z))
        place = self.frame.place(corners[:, 0], corners[:, 1], heights)
        rows = np.column_stack([place.s, place.t, place.h])
        outlines = element(made, "outlines")
        for number, part in enumerate(np.split(rows, np.cumsum([len(part) for part in parts])[:-1])):
            _road_outline(outlines, number, part, item.film_thickness)
        element(made, "material", {"surface": "paint", "roadMarkColor": item.color})
        notes(made, name, item.instance, object_type=type(item).__name__)

    def loose_line(self, name: str, line: LineMarking, span: tuple[float, float], part: int) -> None:
        """Add a line that follows no lane as a marking along corners in road coordinates."""
        geometry = self.ground.geometry
        corners = self._axis(line, *span)
        attributes: dict[str, Value] = {"type": "roadMark", "subtype": f"line_{line.kind}", "hdg": 0.0}
        attributes |= {"length": span[1] - span[0], "width": line.width, "height": line.film_thickness}
        made = self._placed(name, line, attributes, corners[0], None if part == 1 else self.numbers.next())
        _road_outline(element(made, "outlines"), 0, corners, 0.0, closed=False)
        marking: dict[str, Value] = {"color": line.color, "width": line.width, "zOffset": line.film_thickness}
        dash = line.dash_length or geometry.length
        period = line.dash_length + line.gap_length
        within = (span[0] - line.start_station) % period if period else 0.0
        first = period - within if CLOSE < within < period - CLOSE else 0.0
        marking |= {"lineLength": dash, "spaceLength": line.gap_length, "startOffset": first, "stopOffset": 0.0}
        item = element(element(made, "markings"), "marking", marking)
        for number in range(len(corners)):
            element(item, "cornerReference", {"id": number})
        notes(made, name, line.instance, object_type="LineMarking", kind=line.kind)

    def _axis(self, line: LineMarking, start: float, end: float) -> Float:
        """Return (N, 3) s, t and h of points along a line's axis, as close as the tolerance asks."""
        geometry = self.ground.geometry
        bend = np.abs(geometry.alignment.curvature(np.linspace(start, end, 50))).max()
        step = min(math.sqrt(8.0 * self.ground.tolerance / max(float(bend), 1e-9)), 50.0)
        count = max(2, math.ceil((end - start) / step) + 1)
        points = getattr(line.offset, "__iter__", None) and [point.station for point in line.offset]  # type: ignore[union-attr]
        inside = [s for s in points or [] if start < s < end]
        stations = np.unique(np.concatenate([np.linspace(start, end, count), inside]))
        left, right = geometry.marking_edges(line, stations)
        middle = (left + right) / 2.0
        place = self.frame.place(stations, middle, self.ground.height(stations, middle))
        return np.column_stack([place.s, place.t, place.h])

    def _object(
        self,
        name: str,
        item: RoadObject,
        attributes: dict[str, Value],
        place: tuple[float, ...] | None = None,
    ) -> Element:
        """Add an object; without a place (station, offset, height) it stands on its foot."""
        if place is None:
            assert isinstance(item, PointObject)
            place = (item.station, item.offset, self.ground.foot(name))
        found = self.frame.place(*(np.array([value]) for value in place))
        return self._placed(name, item, attributes, np.array([found.s[0], found.t[0], found.h[0]]))

    def _placed(
        self, name: str, item: RoadObject, attributes: dict[str, Value], place: Float, number: int | None = None
    ) -> Element:
        """Add an object at s, t and h, with a number of its own or its instance number."""
        s, t, h = place.tolist()
        ids: dict[str, Value] = {"id": item.instance if number is None else number, "name": name}
        about = {**ids, "s": s, "t": t, "zOffset": _fine(h)}
        return element(self.parent, "object", {**about, "orientation": "none", "dynamic": "no", **attributes})


def gantry_levels(ground: Ground, item: Gantry) -> tuple[float, float]:
    """Return the heights of a gantry's lowest part and of its beam's lower edge above the reference line, m."""
    span = (item.station - item.reach(1.0), item.station + item.reach(-1.0))
    low = ground.pavement_below(span, (item.right_offset, item.left_offset)) + item.clearance
    return low, item.beam_bottom(low)


def _fine(value: float) -> float:
    """Return a height rounded so that the last bits of the terrain's sines don't show."""
    return round(value, 6)


def _turn(item: RoadObject) -> float:
    degrees = getattr(item, "rotation_deg", 0.0)
    return math.radians((degrees + 180.0) % 360.0 - 180.0)


def _tall(item: LineObject) -> float:
    return float(getattr(item, "height", 0.0))


def _cross_section(item: LineObject) -> tuple[str, float, float]:
    """Return a barrier's subtype, its width, and how far its middle lies to the left of its axis, m."""
    if isinstance(item, Guardrail):
        if item.faces == "both":
            return "guardRail", 2.0 * BEAM_REACH, 0.0
        beside = (BEAM_REACH - POST_REACH) / 2.0
        return "guardRail", BEAM_REACH + POST_REACH, beside if item.faces == "left" else -beside
    if isinstance(item, NoiseBarrier):
        return "noiseBarrier", max(item.thickness, item.post_width), 0.0
    subtype = "concreteBarrier" if isinstance(item, ConcreteBarrier) else "temporaryBarrier"
    return subtype, float(getattr(item, "base_width", 0.0)), 0.0


_Size = tuple[str, str, dict[str, Value]]
_SIZES: dict[type[RoadObject], Callable[[Any], _Size]] = {
    Delineator: lambda item: (
        "pole",
        "delineator",
        {"length": 2.0 * sizes.REACH, "width": 2.0 * sizes.REACH, "height": item.height},
    ),
    Pole: lambda item: ("pole", item.kind, {"radius": item.diameter / 2.0, "height": item.height}),
    Cabinet: lambda item: (
        "obstacle",
        item.kind,
        {"length": item.depth, "width": item.width, "height": item.height},
    ),
    ConstructionBeacon: lambda item: (
        "obstacle",
        "constructionBeacon",
        {"length": 2.0 * BEACON_REACH, "width": item.width, "height": item.height},
    ),
    Asset: lambda item: ("none", item.name, {}),
}
"""Class -> type, subtype and size of its object: length along its heading, width across."""


def _rectangle(u: tuple[float, float], v: tuple[float, float]) -> list[tuple[float, float]]:
    return [(u[0], v[0]), (u[1], v[0]), (u[1], v[1]), (u[0], v[1])]


def _leaning(u: tuple[float, float], v: tuple[float, float], shear: float) -> list[tuple[float, float]]:
    """Return a rectangle of which u falls by `shear` per v."""
    return [(x - y * shear, y) for x, y in _rectangle(u, v)]


def _local_outlines(parent: Element, bodies: Iterable[tuple[Corners, float, float]]) -> None:
    """Add outlines around the object's place, each with its bottom and its height (m)."""
    outlines = element(parent, "outlines")
    for number, (corners, bottom, height) in enumerate(bodies):
        outline = element(outlines, "outline", {"id": number, "outer": True, "closed": True})
        for corner, (u, v) in enumerate(corners):
            where: dict[str, Value] = {"id": corner, "u": u, "v": v, "z": _fine(bottom), "height": _fine(height)}
            element(outline, "cornerLocal", where)


def _road_outline(parent: Element, number: int, corners: Float, height: float, closed: bool = True) -> None:
    """Add an outline of corners (N, 3: station, offset, height above the reference line)."""
    attributes: dict[str, Value] = {"id": number, "outer": True, "closed": closed}
    outline = element(parent, "outline", {**attributes, "fillType": "paint" if closed else None})
    for corner, (s, t, z) in enumerate(corners.tolist()):
        element(outline, "cornerRoad", {"id": corner, "s": s, "t": t, "dz": _fine(z), "height": height})


_MAKERS: dict[type, Callable[[Objects, str, Any], None]] = {
    **dict.fromkeys((Guardrail, ConcreteBarrier, NoiseBarrier, TemporaryBarrier), Objects.barrier),
    **dict.fromkeys(_SIZES, Objects.upright),
    **dict.fromkeys((TrafficSign, KilometreBoard, TrafficLight), Objects.posts),
    **dict.fromkeys((Hatching, Arrow), Objects.painted),
    Gantry: Objects.gantry,
    Overpass: Objects.overpass,
}
