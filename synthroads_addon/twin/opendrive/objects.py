"""Objects along a road: barriers, posts, gantries, bridges and painted areas, in their true dimensions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from ...base.arrays import Float
from ...base.schema import compact_json
from ...road.objects import RoadObject
from ...road.pavement.cover import painted_outlines
from ...road.section import Arrow, Hatching, LineMarking
from ...road.structures.bridge import Bridge
from ...road.structures.tunnel import Tunnel
from ...road.things.asset import Asset
from ...road.things.body import Body
from ...road.things.thing import LengthwiseThing, StandingThing, Thing
from ...road.vegetation.species import NEEDLES
from ..plants import PlacedPlant
from ..things import PlacedThing
from .numbers import FreeIds
from .pieces import CLOSE
from .places import Ground, side_at, side_of
from .surface import RoadFrame
from .xml import Element, Value, add_object_data, element


class Objects:
    """Writer of the OpenDRIVE `object` and `tunnel` elements of one carriageway.

    Attributes:
        parent: the element that they are added to.
        ground: what they stand on.
        frame: the carriageway that is the road: it has what stands on its side of the centreline.
        numbers: ids of parts.
        standing: what stands at one place, with its bodies, by id.
    """

    def __init__(
        self,
        parent: Element,
        ground: Ground,
        frame: RoadFrame,
        numbers: FreeIds,
        standing: Mapping[str, PlacedThing],
    ) -> None:
        self.parent = parent
        self.ground = ground
        self.frame = frame
        self.numbers = numbers
        self.standing = standing

    def write(self, loose: Iterable[tuple[str, LineMarking, float, float]]) -> None:
        """Add all things and painted areas of this carriageway, then the line markings that follow no lane."""
        for name, item in self.ground.geometry.parameters.objects.items():
            is_written = isinstance(item, LengthwiseThing | StandingThing | Hatching | Arrow)
            if (
                not is_written
                or isinstance(item, Bridge | Tunnel)
                or side_of(self.ground.geometry, item) not in self.frame.sides
            ):
                continue
            if isinstance(item, LengthwiseThing):
                self.barrier(name, item)
            elif isinstance(item, StandingThing):
                self.upright(name, item)
            elif isinstance(item, Hatching | Arrow):
                self.painted(name, item)
        parts: dict[str, int] = {}
        for name, line, start, end in loose:
            parts[name] = parts.get(name, 0) + 1
            self.loose_line(name, line, (start, end), parts[name])

    # --- things -----------------------------------------------------------------------------------------------------

    def barrier(self, name: str, item: LengthwiseThing) -> None:
        """Add a thing that runs along the road as one object with continuous `repeat` elements, linear in between."""
        right_reach, left_reach = item.reach()
        width, (kind, subtype) = right_reach + left_reach, _types(item)
        rows = self.ground.sample_along(item, self.frame, (left_reach - right_reach) / 2.0)
        if not len(rows):
            return
        attributes: dict[str, Value] = {"type": kind, "subtype": subtype, "hdg": 0.0}
        attributes |= {"length": float(rows[-1, 0] - rows[0, 0]), "width": width}
        attributes["height"] = float(getattr(item, "height", 0.0))
        entry = self._placed(name, item, attributes, rows[0, :3])
        for (s0, t0, z0, h0), (s1, t1, z1, h1) in zip(rows[:-1].tolist(), rows[1:].tolist(), strict=True):
            repeat: dict[str, Value] = {"s": s0, "length": s1 - s0, "distance": 0.0, "tStart": t0, "tEnd": t1}
            repeat |= {"heightStart": h0, "heightEnd": h1, "zOffsetStart": _fine(z0), "zOffsetEnd": _fine(z1)}
            element(entry, "repeat", {**repeat, "widthStart": width, "widthEnd": width})
        _describe(entry, name, item)

    def upright(self, name: str, item: StandingThing) -> None:
        """Add a standing thing as an object whose bodies are outlines; sign faces, which are signals, are left out."""
        kind, subtype = _types(item)
        signals = item.signals()
        bodies = [b for b in self.standing[name].bodies if not b.detail and b.part not in signals]
        attributes: dict[str, Value] = {"type": kind, "subtype": subtype, "hdg": math.remainder(item.turn, math.tau)}
        if bodies:
            corners = np.concatenate([body.sections.reshape(-1, 3) for body in bodies])
            width, length, _ = np.ptp(corners, axis=0).tolist()
            attributes |= {"length": length, "width": width, "height": float(corners[:, 2].max())}
        entry = self._object(name, item, attributes, (item.station, item.offset, self.ground.foot(name)))
        outlines = element(entry, "outlines") if bodies else entry
        for number, body in enumerate(bodies):
            outline = element(outlines, "outline", {"id": number, "outer": True, "closed": True})
            for corner, (u, v, bottoms, tops) in enumerate(_upright_outline(body).tolist()):
                attributes_of_corner: dict[str, Value] = {
                    "id": corner,
                    "u": u,
                    "v": v,
                    "z": _fine(bottoms),
                    "height": _fine(tops - bottoms),
                }
                element(outline, "cornerLocal", attributes_of_corner)
        _describe(entry, name, item)

    def underpasses(self) -> None:
        """Add a `tunnel` for every stretch in one, and one of type underpass, open to the sides, below every bridge."""
        owns_instance_number = next(iter(self.ground.geometry.sections)) in self.frame.sides
        for name, item in self.ground.geometry.parameters.of_type(Thing).items():
            for block in item.footprint() if item.twin().cityjson == "Bridge" else ():
                if block.part != "beam":
                    continue
                start, end = max(block.start, 0.0), min(block.end, self.ground.geometry.length)
                number = item.instance if owns_instance_number else self.numbers.take()
                ids: dict[str, Value] = {"id": number, "name": name, "s": start, "length": end - start}
                entry = element(self.parent, "tunnel", {**ids, "type": "underpass", "daylight": 1.0, "lighting": 0.0})
                add_object_data(entry, name, item.instance)
        for name, tunnel in self.ground.geometry.tunnels.items():
            lighting = 1.0 if tunnel.lamp_spacing else 0.0
            self._stretch("tunnel", name, tunnel, {"type": "standard", "daylight": 0.0, "lighting": lighting})

    def bridges(self) -> None:
        """Add a `bridge` of concrete for every stretch of this road that a bridge carries, with its parameters."""
        for name, item in self.ground.geometry.bridges.items():
            self._stretch("bridge", name, item, {"type": "concrete"})

    def _stretch(self, tag: str, name: str, item: LengthwiseThing, attributes: dict[str, Value]) -> None:
        """Add an element for the stretch of this road that a structure takes; none off the road."""
        geometry = self.ground.geometry
        ends = np.clip([item.start_station, item.end_station], 0.0, geometry.length)
        if ends[1] <= ends[0]:
            return
        owns_instance_number = next(iter(geometry.sections)) in self.frame.sides
        number = item.instance if owns_instance_number else self.numbers.take()
        s, e = self.frame.road_coordinates(ends, np.zeros(2), np.zeros(2)).s.tolist()
        ids: dict[str, Value] = {"id": number, "name": name, "s": s, "length": e - s}
        _describe(element(self.parent, tag, {**ids, **attributes}), name, item)

    # --- plants -----------------------------------------------------------------------------------------------------

    def plants(self, plants: Sequence[PlacedPlant]) -> None:
        """Add the trees and shrubs on this carriageway's side as upright cylinders with the crown's radius."""
        geometry = self.ground.geometry
        plants_on_side = [plant for plant in plants if side_at(geometry, plant.offset) in self.frame.sides]
        if not plants_on_side:
            return
        station, offset = np.array([(plant.station, plant.offset) for plant in plants_on_side]).T
        heights = np.array([plant.foot[2] for plant in plants_on_side]) - geometry.profile.elevation(station)
        place = self.frame.road_coordinates(station, offset, heights)
        for plant, row in zip(plants_on_side, np.column_stack([place.s, place.t, place.h]), strict=True):
            kind: tuple[str, str] = ("vegetation", "bush")
            if plant.vegetation.kind == "tree":
                kind = ("tree", "needle" if plant.vegetation.species in NEEDLES else "leaf")
            attributes: dict[str, Value] = {"type": kind[0], "subtype": kind[1], "hdg": 0.0}
            attributes |= {"radius": round(plant.breadth * plant.shape.crown_radius, 6)}
            attributes["height"] = round(plant.height, 6)
            entry = self._placed(plant.name, plant.vegetation, attributes, row, plant.instance)
            add_object_data(entry, plant.name, plant.instance, species=plant.vegetation.species)

    # --- painted ----------------------------------------------------------------------------------------------------

    def painted(self, name: str, item: Hatching | Arrow) -> None:
        """Add a hatched area or an arrow as a `roadMark` object, its parts as outlines in road coordinates."""
        geometry = self.ground.geometry
        parts = painted_outlines(geometry, item)
        if not parts:
            return
        corners = np.concatenate(parts)
        corners[:, 0] = np.clip(corners[:, 0], 0.0, geometry.length)
        heights = self.ground.height(corners[:, 0], corners[:, 1])
        position = (item.station, item.offset) if isinstance(item, Arrow) else tuple(corners.mean(axis=0).tolist())
        z = float(self.ground.height(np.array(position[:1]), np.array(position[1:]))[0])
        subtype = "hatching" if isinstance(item, Hatching) else f"arrow_{item.kind}"
        turn = item.rotation_deg if isinstance(item, Arrow) else 0.0
        heading = math.radians((turn + 180.0) % 360.0 - 180.0)
        attributes: dict[str, Value] = {"type": "roadMark", "subtype": subtype, "hdg": heading}
        entry = self._object(name, item, {**attributes, "height": item.film_thickness}, (*position, z))
        place = self.frame.road_coordinates(corners[:, 0], corners[:, 1], heights)
        rows = np.column_stack([place.s, place.t, place.h])
        outlines = element(entry, "outlines")
        for number, part in enumerate(np.split(rows, np.cumsum([len(part) for part in parts])[:-1])):
            _road_outline(outlines, number, part, item.film_thickness)
        element(entry, "material", {"surface": "paint", "roadMarkColor": item.color})
        _describe(entry, name, item)

    def loose_line(self, name: str, line: LineMarking, span: tuple[float, float], part: int) -> None:
        """Add part of a line marking that follows no lane as a `roadMark` object along corners."""
        geometry = self.ground.geometry
        corners = self._axis(line, *span)
        attributes: dict[str, Value] = {"type": "roadMark", "subtype": f"line_{line.kind}", "hdg": 0.0}
        attributes |= {"length": span[1] - span[0], "width": line.width, "height": line.film_thickness}
        entry = self._placed(name, line, attributes, corners[0], None if part == 1 else self.numbers.take())
        _road_outline(element(entry, "outlines"), 0, corners, 0.0, is_closed=False)
        marking: dict[str, Value] = {"color": line.color, "width": line.width, "zOffset": line.film_thickness}
        dash = line.dash_length or geometry.length
        period = line.dash_length + line.gap_length
        position_in_period = (span[0] - line.start_station) % period if period else 0.0
        first_gap = period - position_in_period if CLOSE < position_in_period < period - CLOSE else 0.0
        marking |= {"lineLength": dash, "spaceLength": line.gap_length, "startOffset": first_gap, "stopOffset": 0.0}
        item = element(element(entry, "markings"), "marking", marking)
        for number in range(len(corners)):
            element(item, "cornerReference", {"id": number})
        add_object_data(entry, name, line.instance, object_type="LineMarking", kind=line.kind)

    def _axis(self, line: LineMarking, start: float, end: float) -> Float:
        """Return (N, 3) s, t and h of points along a line marking's axis, m, sampled within the chord tolerance."""
        geometry = self.ground.geometry
        largest_curvature = np.abs(geometry.alignment.curvature(np.linspace(start, end, 50))).max()
        # Sagitta of an arc over a chord s: s^2 / (8 R), solved for s. 50 m at most: chosen.
        step = min(math.sqrt(8.0 * self.ground.tolerance / max(float(largest_curvature), 1e-9)), 50.0)
        count = max(2, math.ceil((end - start) / step) + 1)
        # The offset is a number, or points (station, offset) at which the line bends.
        points = getattr(line.offset, "__iter__", None) and [point.station for point in line.offset]  # type: ignore[union-attr]
        inner_stations = [s for s in points or [] if start < s < end]
        stations = np.unique(np.concatenate([np.linspace(start, end, count), inner_stations]))
        left_edge, right_edge = geometry.marking_edges(line, stations)
        middle = (left_edge + right_edge) / 2.0
        place = self.frame.road_coordinates(stations, middle, self.ground.height(stations, middle))
        return np.column_stack([place.s, place.t, place.h])

    def _object(self, name: str, item: RoadObject, attributes: dict[str, Value], place: tuple[float, ...]) -> Element:
        """Add and return an `object` element at a place given as station, offset and height, m."""
        coordinates = self.frame.road_coordinates(*(np.array([value]) for value in place))
        return self._placed(name, item, attributes, np.array([coordinates.s[0], coordinates.t[0], coordinates.h[0]]))

    def _placed(
        self, name: str, item: RoadObject, attributes: dict[str, Value], place: Float, number: int | None = None
    ) -> Element:
        """Add and return an `object` element at s, t and h; its id is `number`, or the instance number if None."""
        s, t, h = place.tolist()
        ids: dict[str, Value] = {"id": item.instance if number is None else number, "name": name}
        attributes_of_place = {**ids, "s": s, "t": t, "zOffset": _fine(h)}
        return element(
            self.parent, "object", {**attributes_of_place, "orientation": "none", "dynamic": "no", **attributes}
        )


def _types(item: Thing) -> tuple[str, str]:
    """Return a thing's OpenDRIVE object type and subtype."""
    kind, _, subtype = item.twin().opendrive.partition(".")
    return kind, subtype


_SAID = ("instance", "type", "station", "rotation_deg", "start_station", "end_station")
"""Fields that an object's own attributes say."""
_SAME_TURN = 1e-9  # rad


def _describe(entry: Element, name: str, item: RoadObject) -> None:
    """Add an object's parameters as user data, lists as JSON, without those that its element's attributes say."""
    values = {key: value for key, value in item.to_dict().items() if key not in _SAID and value is not None}
    if not values.get("elevation"):
        values.pop("elevation", None)
    if isinstance(item, StandingThing) and abs(item.turn - math.radians(item.rotation_deg)) > _SAME_TURN:
        values["rotation_deg"] = item.rotation_deg  # it turns something else than the object
    if isinstance(item, Asset):
        values["asset"] = values.pop("name")
    texts = {
        key: value if isinstance(value, str | int | float) else compact_json(value) for key, value in values.items()
    }
    add_object_data(entry, name, item.instance, object_type=type(item).__name__, **texts)


def _upright_outline(body: Body) -> Float:
    """Return a body's outline in plan (K, 4): u ahead, v to the left, lowest and highest z at each corner, m."""
    first_section, last_section = body.sections[0], body.sections[-1]
    if len(body.sections) > 2 or np.abs(first_section[:, :2] - last_section[:, :2]).max() > CLOSE:
        (x0, y0, z0), (x1, y1, z1) = body.sections.min(axis=(0, 1)), body.sections.max(axis=(0, 1))
        corners = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
        return np.column_stack([corners[:, 1], -corners[:, 0], np.full(4, z0), np.full(4, z1)])
    lowest, highest = np.sort(np.stack([first_section[:, 2], last_section[:, 2]]), axis=0)
    return np.column_stack([first_section[:, 1], -first_section[:, 0], lowest, highest])


def _fine(value: float) -> float:
    """Return a height (m) rounded to 6 decimals, so that bits that differ between machines don't show."""
    return round(value, 6)


def _road_outline(parent: Element, number: int, corners: Float, height: float, is_closed: bool = True) -> None:
    """Add an outline with corners (N, 3: s, t, height above the reference line) in road coordinates."""
    attributes: dict[str, Value] = {"id": number, "outer": True, "closed": is_closed}
    outline = element(parent, "outline", {**attributes, "fillType": "paint" if is_closed else None})
    for corner, (s, t, z) in enumerate(corners.tolist()):
        element(outline, "cornerRoad", {"id": corner, "s": s, "t": t, "dz": _fine(z), "height": height})
