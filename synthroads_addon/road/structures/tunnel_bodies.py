"""The solids of a tunnel: tubes, lining, portals, lamps, emergency call points and exits, jet fans.

Faces that coincide have no first hit: parts reach a little into each other. Sizes without a source are chosen.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from ...base.arrays import Float
from ..things.body import Body, Course, boxes, sweep
from .kerbed import INNER, LEFT, NAMES, RIGHT, place_sections, section_rows

if TYPE_CHECKING:
    from .tunnel import Tunnel

WALL_INSIDE = 0.02
"""The walls' faces stand so far inside of the walkways' outer edges, m."""
MIDDLE_WALL, WIDE_MEDIAN = 0.75, 1.5
"""Thickness of the wall between two tubes (B: a built example), and width of a median from which there are two, m."""
SPRING = 0.4
"""Height of a vault's upright walls as a share of its crown's."""
ARC = 16
"""Pieces of a vault's arc."""
FOOT, WALL_FOOT = 0.6, 0.8
"""Depth of the tube's feet below the pavement's edge, and of the portals' walls below the ground, m."""
LINING, LINING_FOOT = 0.03, 0.05
"""Thickness of a lining, and its height above the walkway, m."""
FRONT, PARAPET, WALL_STEP, WIDEST_WALL = 0.6, 0.8, 1.0, 40.0
"""Thickness of a portal's wall, its height above the ground behind it, spacing of its columns, its largest reach, m."""
LAMP, LAMP_DROP, LAMP_SHARE = (0.3, 1.2, 0.12), 0.1, 0.22
"""Size of a lamp (across, along, height), its distance from the ceiling (m), and its rows' distance from the tube's
middle as a share of the tube's width."""
FAN, FAN_LENGTH, FAN_SHARE, FAN_GAP = 0.5, 3.5, 0.11, 0.15
"""Radius and length of a jet fan, its distance from the tube's middle as a share of its width, and its gap above, m."""
FAN_DISTANCE = 15.0
"""Distance of fans, doors and call points from the portals at least, m."""
CABIN, CABIN_SIGN = (0.35, 1.0, 2.1), (0.5, 0.06, 0.5)
"""Size of an emergency call point and of its sign (across, along, height), m."""
DOOR, FRAME, DOOR_SIGN = (0.06, 1.2, 2.1), 0.12, (0.9, 0.06, 0.45)
"""Size of a door, width of its frame, and size of its sign (across, along, height), m."""
SIGN_HEIGHT = 2.5
"""Height of signs above the walkway, m."""
_CONCRETE, _OCTAGON = "bridge_concrete", 8


class Tube:
    """One tube of a tunnel.

    Attributes:
        tunnel, course: as given.
        sides: sides of the road whose walkways lie in it, and at whose walls what is at walls is.
        name: of its parts.
    """

    def __init__(self, tunnel: Tunnel, course: Course, sides: tuple[float, ...], name: str) -> None:
        self.tunnel, self.course, self.sides, self.name = tunnel, course, sides, name

    def walls(self, station: Float) -> tuple[Float, Float]:
        """Return the offsets (N,) of the faces of its left and its right wall at stations (N,), m."""
        edges = self.course.edges(station)
        middle = (edges[:, INNER[LEFT]] + edges[:, INNER[RIGHT]]) / 2.0
        left = edges[:, 0] - WALL_INSIDE if LEFT in self.sides else middle - MIDDLE_WALL / 2.0
        right = edges[:, 5] + WALL_INSIDE if RIGHT in self.sides else middle + MIDDLE_WALL / 2.0
        return left, right

    def crown(self, station: Float) -> Float:
        """Return the elevations (N,) of its ceiling's highest line, m: the tunnel's, over all pavements."""
        return crown_elevation(self.tunnel, self.course, station)

    def outline(self, station: Float, thickness: float = 0.0) -> tuple[Float, Float]:
        """Return offsets and elevations (N, K) of its inner faces, or of faces farther out, from left to right, m."""
        left, right = self.walls(station)
        edges, crown = self.course.edges(station), self.crown(station)
        foot = np.stack([self.course.pavement(station, edges[:, column]) for column in (1, 4)]).min(axis=0) - FOOT
        half, middle = (left - right) / 2.0, (left + right) / 2.0
        outer = {
            side: thickness if side in self.sides else min(thickness, MIDDLE_WALL / 2.0 + 0.005)
            for side in (LEFT, RIGHT)
        }
        if self.tunnel.section == "rectangle":
            across = np.array([1.0, 1.0, -1.0, -1.0])
            rise = np.array([0.0, 1.0, 1.0, 0.0])
            top = (crown + thickness)[:, None]
            height = foot[:, None] + rise * (top - foot[:, None])
        else:
            angle = np.linspace(0.0, np.pi, ARC + 1)
            across = np.concatenate([[1.0], np.cos(angle), [-1.0]])
            rise = np.concatenate([[0.0], np.sin(angle), [0.0]])
            arc_height = (1.0 - SPRING) * self.tunnel.height
            spring = crown - arc_height
            height = spring[:, None] + rise * (arc_height + thickness)
            height[:, [0, -1]] = foot[:, None]
        reach = np.where(across > 0.0, outer[LEFT], outer[RIGHT])
        return middle[:, None] + across * (half[:, None] + reach), height

    def ceiling(self, station: Float, offset: Float) -> Float:
        """Return the elevations (N,) of its ceiling at stations and offsets (N,), m."""
        if self.tunnel.section == "rectangle":
            return self.crown(station)
        left, right = self.walls(station)
        share = np.clip((2.0 * offset - left - right) / (left - right), -1.0, 1.0)
        arc_height = (1.0 - SPRING) * self.tunnel.height
        return self.crown(station) - arc_height * (1.0 - np.sqrt(1.0 - share**2))


def crown_elevation(tunnel: Tunnel, course: Course, station: Float) -> Float:
    """Return the elevations (N,) of a tunnel's ceilings at their highest, at stations (N,), m."""
    edges = course.edges(station)
    return np.stack([course.pavement(station, edges[:, n]) for n in (1, 4)]).max(axis=0) + tunnel.height


def tubes_of(tunnel: Tunnel, course: Course) -> list[Tube]:
    """Return the tubes of a tunnel: one of each carriageway where the median is wide enough, else one of both."""
    station = np.linspace(max(tunnel.start_station, 0.0), min(tunnel.end_station, course.length), 5)
    edges = course.edges(station)
    if float((edges[:, INNER[LEFT]] - edges[:, INNER[RIGHT]]).min()) >= WIDE_MEDIAN:
        return [Tube(tunnel, course, (LEFT,), "tube-left"), Tube(tunnel, course, (RIGHT,), "tube-right")]
    return [Tube(tunnel, course, (LEFT, RIGHT), "tube")]


def tunnel_bodies(tunnel: Tunnel, course: Course) -> list[Body]:
    """Return the closed solids of all parts of a tunnel but its walkways, in local coordinates."""
    start, end = max(tunnel.start_station, 0.0), min(tunnel.end_station, course.length)
    if end - start < 1.0:
        return []
    tubes = tubes_of(tunnel, course)
    bodies = [body for tube in tubes for body in _tube(tube, start, end)]
    bodies += [body for tube in tubes for body in _equipment(tube, start, end)]
    for number, (portal, outwards) in enumerate(((tunnel.start_station, -1.0), (tunnel.end_station, 1.0)), 1):
        if 0.0 < portal < course.length:
            bodies += _portal(tunnel, tubes, f"portal-{number}", portal, outwards)
    return bodies


def _tube(tube: Tube, start: float, end: float) -> Iterator[Body]:
    """Yield the solids of a tube and of the lining of its outer walls, between two stations (m)."""
    tunnel, course = tube.tunnel, tube.course
    station = section_rows(tunnel, course, start + WALL_INSIDE, end - WALL_INSIDE)
    (inner, inner_height), (outer, outer_height) = tube.outline(station), tube.outline(station, tunnel.wall_thickness)
    outer_height[:, [0, -1]] = inner_height[:, [0, -1]]
    offset = np.concatenate([inner, outer[:, ::-1]], axis=1)
    height = np.concatenate([inner_height, outer_height[:, ::-1]], axis=1)
    yield Body(place_sections(course, station, offset, height), _CONCRETE, tube.name, "IfcWall.RETAININGWALL")
    spring = SPRING * tunnel.height if tunnel.section == "vault" else tunnel.height
    top = min(tunnel.lining_height, spring - 0.3)
    if top <= LINING_FOOT:
        return
    for side, face in zip((LEFT, RIGHT), tube.walls(station), strict=True):
        base = _walkway(course, station, face - side * 0.05)
        across = np.stack([face + side * 0.01, face + side * 0.01, face - side * LINING, face - side * LINING], axis=1)
        height = base[:, None] + np.array([LINING_FOOT, top, top, LINING_FOOT])
        shape = place_sections(course, station, across, height)
        yield Body(shape, "plastic_white", f"lining-{tube.name}-{NAMES[side]}", "IfcCovering.CLADDING")


def _walkway(course: Course, station: Float, offset: Float) -> Float:
    """Return the elevations (N,) of the walkway at stations and offsets (N,), m."""
    return course.feet(station, offset)[:, 2]


def _equipment(tube: Tube, start: float, end: float) -> Iterator[Body]:
    """Yield lamps, jet fans, emergency call points and exits of a tube, between two stations (m)."""
    tunnel = tube.tunnel
    width = tube.walls(np.array([(start + end) / 2.0]))
    half = float((width[0] - width[1])[0])
    if tunnel.lamp_spacing:
        station = _spread(start + 2.0, end - 2.0, tunnel.lamp_spacing)
        for share in (-LAMP_SHARE, LAMP_SHARE):
            for shape in _hung(tube, station, share, LAMP, LAMP_DROP):
                yield Body(shape, "lamp_glass", f"lamps-{tube.name}", "IfcLightFixture.DIRECTIONSOURCE")
    inner_start, inner_end = start + FAN_DISTANCE, end - FAN_DISTANCE
    if tunnel.fan_spacing and inner_end > inner_start and half > 6.0 * FAN:
        for station in _spread(inner_start, inner_end, tunnel.fan_spacing).tolist():
            for share in (-FAN_SHARE, FAN_SHARE):
                yield from _fan(tube, station, share)
    for side in tube.sides:
        if tunnel.phone_spacing and inner_end > inner_start:
            station = _spread(inner_start, inner_end, tunnel.phone_spacing)
            yield from _call_points(tube, station, side)
        if tunnel.exit_spacing and end - start > tunnel.exit_spacing:
            station = _spread(inner_start, inner_end, tunnel.exit_spacing)
            yield from _exits(tube, station + 6.0, side)


def _spread(start: float, end: float, spacing: float) -> Float:
    """Return stations (N,) in the middle of equal stretches, as many as keep the spacing (m), at least one."""
    count = max(1, math.ceil((end - start) / spacing - 1e-9))
    return start + (np.arange(count) + 0.5) * (end - start) / count


def _hung(tube: Tube, station: Float, share: float, size: tuple[float, float, float], drop: float) -> list[Float]:
    """Return boxes (2, 4, 3) below the ceiling at stations (N,), a share of the tube's width beside its middle."""
    left, right = tube.walls(station)
    offset = (left + right) / 2.0 + share * (left - right)
    feet = tube.course.feet(station, offset)
    below = tube.ceiling(station, offset) - feet[:, 2] - drop - size[2]
    return boxes(feet, tube.course.left(station), size, below)


def _fan(tube: Tube, station: float, share: float) -> Iterator[Body]:
    """Yield a jet fan and its two hangers at a station, a share of the tube's width beside its middle."""
    course = tube.course
    rows = station + np.array([-0.5, -0.25, 0.25, 0.5]) * FAN_LENGTH
    left, right = tube.walls(rows)
    offset = (left + right) / 2.0 + share * (left - right)
    axis = course.feet(rows, offset)
    axis[:, 2] = float(tube.ceiling(rows, offset).min()) - FAN_GAP - FAN
    angle = 2.0 * np.pi * (np.arange(_OCTAGON) + 0.5) / _OCTAGON
    name = f"fans-{tube.name}"
    shape = sweep(axis, course.left(rows), FAN * np.cos(angle), FAN * np.sin(angle))
    yield Body(shape, "galvanised_steel", name, "IfcFan.PROPELLORAXIAL")
    hangers = rows[1:3]
    gap = tube.ceiling(hangers, offset[1:3]) - axis[1:3, 2] - FAN * 0.9
    for shape in boxes(axis[1:3], course.left(hangers), (FAN, 0.08, gap + 0.02), FAN * 0.9):
        yield Body(shape, "galvanised_steel", name, "IfcFan.PROPELLORAXIAL")


def _at_wall(
    tube: Tube, station: Float, side: float, size: tuple[float, float, float], bottom: float, off_wall: float = 0.0
) -> list[Float]:
    """Return boxes (2, 4, 3) at the wall of a side at stations (N,), a centimetre deep in it, or so far (m) off it."""
    face = tube.walls(station)[0 if side > 0.0 else 1]
    offset = face - side * (off_wall + size[0] / 2.0 - 0.01)
    feet = tube.course.feet(station, offset)
    feet[:, 2] = _walkway(tube.course, station, face - side * 0.05)
    return boxes(feet, tube.course.left(station), size, bottom)


def _call_points(tube: Tube, station: Float, side: float) -> Iterator[Body]:
    """Yield emergency call points at the wall of a side, each with its sign across the tube."""
    name = f"call-points-{NAMES[side]}"
    for shape in _at_wall(tube, station, side, CABIN, -0.02):
        yield Body(shape, "plastic_orange", name, "IfcCommunicationsAppliance.NOTDEFINED")
    for shape in _at_wall(tube, station, side, CABIN_SIGN, SIGN_HEIGHT):
        yield Body(shape, "sheeting_white", f"call-signs-{NAMES[side]}", "IfcSign.PICTORAL")


def _exits(tube: Tube, station: Float, side: float) -> Iterator[Body]:
    """Yield doors of emergency exits in the wall of a side, with frames, and their signs across the tube."""
    name = f"exits-{NAMES[side]}"
    frame = (DOOR[0] / 2.0, DOOR[1] + 2.0 * FRAME, DOOR[2] + FRAME)
    for shape in _at_wall(tube, station, side, frame, -0.02, LINING):
        yield Body(shape, "sheeting_green", name, "IfcDoor.DOOR")
    for shape in _at_wall(tube, station, side, DOOR, -0.02, LINING):
        yield Body(shape, "cabinet_grey", name, "IfcDoor.DOOR")
    for shape in _at_wall(tube, station, side, DOOR_SIGN, SIGN_HEIGHT):
        yield Body(shape, "sheeting_green", f"exit-signs-{NAMES[side]}", "IfcSign.PICTORAL")


def _portal(tunnel: Tunnel, tubes: list[Tube], name: str, station: float, outwards: float) -> Iterator[Body]:
    """Yield the solids of a portal's wall: left and right of the tubes, and above them.

    Its top is `PARAPET` above the ground behind it; sideways it reaches as far as that is higher than the ground in
    front of it.

    Args:
        tunnel, tubes: what it is the portal of.
        name: of its part.
        station: of its front, m.
        outwards: 1 or -1, along the road away from the tunnel.
    """
    course = tubes[0].course
    rows = np.sort([station, station - outwards * FRONT])
    behind, before = station - outwards * 0.3, station + outwards * 0.01
    at = np.array([station])
    left, right = float(tubes[0].walls(at)[0][0]), float(tubes[-1].walls(at)[1][0])
    roof = float(crown_elevation(tunnel, course, at)[0]) + tunnel.wall_thickness

    def tops(offset: Float) -> Float:
        """Return the elevations (N,) of the wall's top at offsets (N,), m."""
        ground = course.ground(np.full(len(offset), behind), offset)
        return np.maximum(ground, course.ground(np.full(len(offset), before), offset)) + PARAPET

    middle = np.unique(np.concatenate([np.linspace(right, left, math.ceil((left - right) / WALL_STEP) + 1),
                                       *(tube.outline(at)[0][0, 1:-1] for tube in tubes)]))  # fmt: skip
    bottom = np.full(len(middle), -np.inf)
    for tube in tubes:
        low, high = tube.walls(at)[1][0] - 1e-6, tube.walls(at)[0][0] + 1e-6
        inside = (middle >= low) & (middle <= high)
        ceiling = tube.ceiling(np.full(int(inside.sum()), station), middle[inside])
        bottom[inside] = np.maximum(bottom[inside], ceiling)
    bottom[~np.isfinite(bottom)] = roof - tunnel.wall_thickness - (1.0 - SPRING) * tunnel.height
    # The ground above the tubes has the height of its sides there, where the road's own surface is below it.
    side_top = tops(np.array([right - 0.1, left + 0.1]))
    top = np.maximum(np.interp(middle, [right, left], side_top), roof + PARAPET)
    yield Body(_wall(course, rows, middle, bottom, top), _CONCRETE, name, "IfcWall.RETAININGWALL")
    for side, edge in ((LEFT, left), (RIGHT, right)):
        distance = np.arange(0.0, WIDEST_WALL, WALL_STEP)
        offset = edge + side * np.maximum(distance, 0.1)
        front = course.ground(np.full(len(offset), before), offset)
        rear = course.ground(np.full(len(offset), behind), offset)
        higher = np.flatnonzero(rear - front > 0.15)
        last = min(int(higher[-1]) + 2 if len(higher) else 2, len(offset) - 1)
        columns = np.append(edge, offset[1 : last + 1])
        base = np.append(front[:1], front[1 : last + 1]) - WALL_FOOT
        upper = np.append(max(float(tops(offset[:1])[0]), roof + PARAPET), tops(offset[1 : last + 1]))
        shape = _wall(course, rows, columns, np.minimum(base, upper - 0.1), upper)
        yield Body(shape, _CONCRETE, name, "IfcWall.RETAININGWALL")


def _wall(course: Course, rows: Float, offset: Float, bottom: Float, top: Float) -> Float:
    """Return the sections (C, 4, 3) of a wall across the road between two stations (2,), by its columns (C,)."""
    sections = []
    for row, level in ((0, bottom), (0, top), (1, top), (1, bottom)):
        points = course.feet(np.full(len(offset), rows[row]), offset)
        points[:, 2] = level
        sections.append(points)
    return np.stack(sections, axis=1)
