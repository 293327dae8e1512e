"""Current places of a road's things: station, offset, elevation and rotation from the places of their objects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import bpy
import numpy as np
from numpy.typing import NDArray

from ...road.geometry import RoadGeometry
from ...road.lane_lines import LaneLine
from ...road.objects import LineObject, PointObject, RoadObject
from ...road.section import Arrow, Carriageway
from ...road.surroundings import RampVehicle, Vehicle
from ...road.terrain import surface_elevation
from ...road.things.asset import Asset
from ...road.things.building import Building
from ...road.things.bus_shelter import BusShelter
from ...road.things.field_entrance import FieldEntrance
from ...road.things.gantry import Gantry
from ...road.things.guardrail import Guardrail
from ...road.things.overpass import Overpass
from ...road.things.power_line import PowerLine
from ...road.things.traffic_island import TrafficIsland
from ..things.meshes import on_plan
from ..things.model_builder import AHEAD
from ..things.vehicle.vehicle import vehicle_place
from .edits import attribute_of, course_of, is_mirrored, turn_of, vertices_of

Float = NDArray[np.float64]

IN_A_FRAME = (Gantry, Overpass, Building, PowerLine, FieldEntrance, TrafficIsland, BusShelter)
"""Things whose objects are placed and turned by their own matrices; other standing things are a vertex each."""
PLACED = "synthroads_placed"
"""Custom property of what runs along the road, and of vehicles: the place (x, y), m, that its inputs belong to."""
STILL = 2e-4
"""Length of a move, m, below which it counts as none: objects' places are 32-bit floats."""
_TURNED = 1e-5
"""Turn, rad, below which it counts as none: objects' rotations are 32-bit floats."""
_SCALED = 1e-5
"""Relative change of a scale below which it counts as none: objects' matrices are 32-bit floats."""
_OTHER_SIDE = {"left": "right", "right": "left"}
_LANE = 1.9
"""Largest distance from the middle of a lane at which a vehicle still belongs to it, m; chosen."""


class Lost(Exception):
    """Raised for a part at a place that no parameters can express; the text says where it stands."""


@dataclass(frozen=True)
class RoadAxes:
    """A road's geometry before and after edits of its axis.

    Attributes:
        before: geometry of the road as built.
        now: geometry with the edited axis, without other edits.
    """

    before: RoadGeometry
    now: RoadGeometry

    def located(self, point: Float) -> tuple[float, float]:
        """Return station and offset, m, of a local point along the edited axis; raise `Lost` where there is no road."""
        station, offset = (float(value[0]) for value in self.now.alignment.project(point[None, :2]))
        if not -1e-6 <= station <= self.now.length + 1e-6:
            raise Lost("it stands beyond the road's ends")
        if abs(offset) > 100.0:
            raise Lost(f"it stands {abs(offset):.0f} m beside the axis")
        return round(min(max(station, 0.0), self.now.length), 6), round(offset, 6)

    def turned(self, before: float, now: float) -> float:
        """Return the axis' heading at station `before` as built minus that at station `now` as edited, deg."""
        was, being = self.before.alignment.heading(before), self.now.alignment.heading(now)
        return float(np.rad2deg(was - being))


class PointPlace(NamedTuple):
    """Place of a thing that is a vertex of an object.

    Attributes:
        point: (3,) in the road's frame, m.
        course: where the road's course at the thing, turned by its rotation, points to, rad.
    """

    point: Float
    course: float


def point_places(part: bpy.types.Object, place: Float) -> list[PointPlace]:
    """Return the places of an object's vertices, each of which is a thing.

    Their heading is that of the thing's own y axis, a quarter of a turn less than that of its course.

    Args:
        part: the object.
        place: (4, 4) of it in the road's frame; upright.
    """
    headings = attribute_of(part.data, "heading")
    return [
        PointPlace(place[:3, :3] @ vertex + place[:3, 3], course_of(place, float(heading) + np.pi / 2.0))
        for vertex, heading in zip(vertices_of(part.data), headings, strict=True)
    ]


def point_update(axes: RoadAxes, item: PointObject, there: PointPlace) -> dict[str, Any]:
    """Return the changed fields (station, offset, rotation) of a thing whose object is a vertex; empty if unmoved.

    It is on the surface wherever it is in plan: its height in the scene says nothing.

    Args:
        axes: the road's.
        item: the thing.
        there: where its vertex is.
    """
    expected = on_plan(axes.before, [item])[0]
    turn = _wrapped(there.course - _course(axes, item))
    if np.hypot(*(there.point - expected)[:2]) < STILL and abs(turn) < _TURNED:
        return {}
    station, offset = axes.located(there.point)
    return {"station": station, "offset": offset, "rotation_deg": _turned(axes, item, station, turn)}


def _turned(axes: RoadAxes, item: PointObject, station: float, turn: float) -> float:
    """Return a thing's rotation, -180 to 180 deg, after a turn (rad) and a move to a station of the edited axis."""
    rotation = item.rotation_deg + float(np.rad2deg(turn)) + axes.turned(item.station, station)
    return round((rotation + 180.0) % 360.0 - 180.0, 9)


def _course(axes: RoadAxes, item: PointObject, turned: bool = True) -> float:
    """Return the course of the road at a thing as it was built, turned by the thing's rotation if `turned`, rad."""
    rotation = np.deg2rad(item.rotation_deg) if turned else 0.0
    return float(axes.before.alignment.heading(item.station)) + float(rotation)


def standing_update(axes: RoadAxes, item: PointObject, part: bpy.types.Object, place: Float) -> dict[str, Any]:
    """Return the changed fields of a thing of `IN_A_FRAME` by its object's place (4, 4); empty if unmoved.

    What is mirrored has its right end where its left one was.
    """
    expected = on_plan(axes.before, [item])[0]
    course = course_of(place, 0.0 if AHEAD in part else np.pi / 2.0)
    turn = _wrapped(course - _course(axes, item, not isinstance(item, Overpass)))
    mirror = -1.0 if is_mirrored(place) else 1.0
    if np.hypot(*(place[:3, 3] - expected)[:2]) < STILL and abs(turn) < _TURNED and mirror > 0.0:
        return {}
    side = mirror
    if isinstance(item, Overpass) and abs(turn) > np.pi / 2.0:  # it crosses as before, with its ends swapped
        turn, side = _wrapped(turn + np.pi), -mirror
    station, offset = axes.located(place[:3, 3])

    def carried(value: float) -> float:
        """Return an offset that is placed relative to the thing."""
        return round(offset + side * (value - item.offset), 6)

    update: dict[str, Any] = {"station": station, "offset": offset}
    update["rotation_deg"] = _turned(axes, item, station, turn)
    if isinstance(item, Gantry):
        ends = ("left_offset", "right_offset")
        signs = [sign.model_copy(update={"offset": carried(sign.offset)}) for sign in item.signs]
        update["signs"] = tuple(signs)
        if side < 0.0:
            update["post_side"] = _OTHER_SIDE[item.post_side]
    elif not isinstance(item, Overpass):
        return update
    else:
        ends = ("left_abutment", "right_abutment")
        update["pier_offsets"] = tuple(sorted(carried(pier) for pier in item.pier_offsets))
        rotation = mirror * item.rotation_deg + float(np.rad2deg(turn)) + axes.turned(item.station, station)
        update["rotation_deg"] = round(rotation, 9)
    places = [carried(getattr(item, name)) for name in ends]
    return update | dict(zip(ends, places[:: int(side)], strict=True))


def asset_update(axes: RoadAxes, item: Asset, place: Float) -> dict[str, Any]:
    """Return the changed fields of an asset: station, offset, elevation and rotation if it was moved, scale if scaled.

    Args:
        axes: the road's axis as built and as edited.
        item: the asset as built.
        place: (4, 4) of its object now in the road's frame, m.
    """
    built_foot = on_plan(axes.before, [item])[0]
    built_foot[2] = _surface(axes.before, item.station, item.offset) + item.elevation
    # An object that isn't turned looks along +y, a quarter of a turn from the heading 0 along +x.
    built_turn = float(axes.before.alignment.heading(item.station)) - np.pi / 2.0 + np.deg2rad(item.rotation_deg)
    turn = _wrapped(turn_of(place) - built_turn)
    # The determinant of a rotation scaled evenly by s is s^3.
    scale = float(np.cbrt(abs(np.linalg.det(place[:3, :3]))))
    update: dict[str, Any] = {}
    if abs(scale / item.scale - 1.0) > _SCALED:
        update["scale"] = round(scale, 6)
    if np.linalg.norm(place[:3, 3] - built_foot) >= STILL or abs(turn) >= _TURNED:
        station, offset = axes.located(place[:3, 3])
        elevation = float(place[2, 3]) - _surface(axes.now, station, offset)
        update |= {"station": station, "offset": offset, "elevation": round(elevation, 6)}
        update["rotation_deg"] = _turned(axes, item, station, turn)
    return update


def _surface(geometry: RoadGeometry, station: float, offset: float) -> float:
    """Return the elevation, m, of the surface at a station and offset."""
    return float(surface_elevation(geometry, np.array([station]), np.array([offset]))[0])


def line_update(axes: RoadAxes, item: LineObject, part: bpy.types.Object, place: Float) -> dict[str, Any]:
    """Return the changed stations and offsets of a line-like thing by its middle's move, m; empty if unmoved.

    Its shape follows the road whatever its object's place is. A move over an end of the road stops there. A mirrored
    guardrail has its beam on the other side.

    Args:
        axes: the road's.
        item: the thing, with its inputs.
        part: its object.
        place: (4, 4) of that in the road's frame; upright.
    """
    shift = place[:2, 3] - np.array(part.get(PLACED, (0.0, 0.0)))
    faces: dict[str, Any] = {}
    if is_mirrored(place) and isinstance(item, Guardrail):
        faces["faces"] = _OTHER_SIDE.get(item.faces, item.faces)
    if np.hypot(*shift) < STILL:
        return faces
    end = min(item.end_station, axes.now.length)
    middle, offset = (item.start_station + end) / 2.0, item.offset
    there = axes.now.alignment.place(np.array([middle]), np.array([offset]))[0]
    projection = axes.now.alignment.project((there + shift)[None])
    along, across = float(projection[0][0]) - middle, float(projection[1][0]) - offset
    if abs(offset + across) > 100.0:
        raise Lost(f"it stands {abs(offset + across):.0f} m beside the axis")
    along = float(np.clip(along, -item.start_station, max(axes.now.length - end, 0.0)))
    moved = {"start_station": item.start_station + along, "end_station": end + along, "offset": offset + across}
    if hasattr(item, "end_offset"):
        moved["end_offset"] = item.end_offset + across
    return {name: round(value, 6) for name, value in moved.items()} | faces


def vehicle_update(axes: RoadAxes, item: Vehicle, part: bpy.types.Object, place: Float) -> dict[str, Any]:
    """Return the changed station, carriageway and lane of a vehicle, snapped to the nearest lane; empty if unmoved.

    Those on ramps and crossing roads are changed by their parameters alone.
    """
    if isinstance(item, RampVehicle):
        return {}
    before = axes.before.parameters
    line = LaneLine(axes.before, before.carriageway_of(item), item.lane)
    built = vehicle_place(line, item)
    expected = on_plan(axes.before, [built])[0]
    there = point_places(part, place)[0]
    turn = _wrapped(there.course - _course(axes, built))
    if np.hypot(*(there.point - expected)[:2]) < STILL and abs(turn) < _TURNED:
        return {}
    station, offset = axes.located(there.point)
    lanes = [
        (abs(offset - float(LaneLine(axes.now, carriageway, lane).offset(np.array(station)))), name, lane)
        for name, carriageway in axes.now.parameters.of_type(Carriageway).items()
        for lane in range(len(carriageway.lanes))
    ]
    beside, name, lane = min(lanes)
    if beside > _LANE:
        raise Lost(f"it stands {beside:.1f} m beside the next lane's middle")
    return {"station": station, "carriageway": name, "lane": lane}


def part_update(
    item: RoadObject, before: RoadObject, part: bpy.types.Object, place: Float, axes: RoadAxes
) -> tuple[dict[str, Any], bool]:
    """Return an object's changed fields by its part's place, and whether showing them needs a rebuild."""
    if isinstance(before, Asset):
        return asset_update(axes, before, place), False
    if isinstance(before, IN_A_FRAME):
        return standing_update(axes, before, part, place), True
    if isinstance(before, LineObject) and isinstance(item, LineObject):
        return line_update(axes, item, part, place), True
    if isinstance(before, Vehicle):
        return vehicle_update(axes, before, part, place), True
    if isinstance(before, PointObject) and not isinstance(before, Arrow):
        return point_update(axes, before, point_places(part, place)[0]), False
    return {}, False


def _wrapped(angle: float) -> float:
    """Return an angle, rad, wrapped into -pi to pi."""
    return float((angle + np.pi) % (2.0 * np.pi) - np.pi)
