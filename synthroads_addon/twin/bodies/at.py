"""Bodies of what stands at one place, in true dimensions (posts, faces, boxes, without fittings), and of overpasses."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...road.geometry import RoadGeometry
from ...road.objects import PointObject
from ...road.terrain import highest_pavement
from ...road.things.beacon import BEACON_BLADE, BEACON_BLADE_BOTTOM, BEACON_FOOT, ConstructionBeacon
from ...road.things.cabinet import Cabinet
from ...road.things.delineator import DELINEATOR, Delineator
from ...road.things.gantry import GANTRY_HANGER, Gantry, GantrySign
from ...road.things.kilometre_board import KILOMETRE_POST, KilometreBoard
from ...road.things.overpass import (
    BRIDGE_ABUTMENT,
    BRIDGE_BEARING,
    BRIDGE_BURIED,
    BRIDGE_DECK,
    BRIDGE_PIER_LENGTH,
    BRIDGE_SEAT,
    Overpass,
)
from ...road.things.pole import Pole
from ...road.things.sign import SIGN_OUTLINES, SIGN_RAIL, TrafficSign
from ...road.things.traffic_light import TRAFFIC_LIGHT_POST, TrafficLight
from ..faces import Faces, Float, loft
from ..surfaces import on_ground

ROUND = 12
"""Corners of a round post; they lie on its circle."""
_ROUND_FACE = 32
_PLATE = 0.003
"""Thickness of a sign's plate, m."""
_POST_TOPS = {"round": 0.9, "triangle": 0.6, "rectangle": 0.97, "octagon": 0.93, "arrow": 0.9}
"""How far a sign's posts reach up behind its face, as a share of its height."""
_ARM = 0.06
_LUMINAIRE = (0.6, 0.26, 0.09)
_SHORTEST_ARM = 0.05
_ACROSS = 0.05
"""Distance (m) of the points across the road at which the pavement is looked at: 3.5 mm at 7 % crossfall."""


@dataclass(frozen=True)
class Place:
    """The frame of something at one place: x to the right of traffic with the stations, y along it, z up.

    Attributes:
        geometry: the road.
        origin: (3,) local coordinates of its foot.
        right, along: (2,) unit vectors in plan.
    """

    geometry: RoadGeometry
    origin: Float
    right: Float
    along: Float

    def local(self, points: Any) -> Float:
        """Return local coordinates (..., 3) of points (..., 3) of the frame."""
        points = np.asarray(points, dtype=np.float64)
        plan = points[..., :1] * self.right + points[..., 1:2] * self.along
        return self.origin + np.concatenate([plan, points[..., 2:]], axis=-1)

    def ground(self, x: Any, y: Any) -> Float:
        """Return z (N,) in the frame of the ground at points (N,) of the frame."""
        x, y = np.broadcast_arrays(np.atleast_1d(np.asarray(x, float)), np.atleast_1d(np.asarray(y, float)))
        plan = self.origin[:2] + x[:, None] * self.right + y[:, None] * self.along
        station, offset = self.geometry.alignment.project(plan)
        return on_ground(self.geometry, station, offset)[:, 2] - self.origin[2]

    def prism(self, outline: Iterable[tuple[float, float]], low: float, high: float) -> Faces:
        """Return the body between two heights over an outline (x, y)."""
        flat = np.array(list(outline))
        ends = [np.column_stack([flat, np.full(len(flat), z)]) for z in (low, high)]
        return loft(self.local(np.stack(ends)))

    def box(self, size: tuple[float, float, float], middle: tuple[float, float, float]) -> Faces:
        """Return a box of a size (x, y, z) around a point."""
        corners = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
        outline = [(middle[0] + x * size[0], middle[1] + y * size[1]) for x, y in corners]
        return self.prism(outline, middle[2] - size[2] / 2.0, middle[2] + size[2] / 2.0)

    def post(self, diameter: float, low: float, high: float, x: float = 0.0, y: float = 0.0) -> Faces:
        """Return a round post."""
        return self.prism([(x + diameter / 2 * u, y + diameter / 2 * v) for u, v in _circle(ROUND)], low, high)

    def plate(self, outline: Iterable[tuple[float, float]], front: float, back: float) -> Faces:
        """Return the upright plate between two y over an outline (x, z)."""
        flat = np.array(list(outline))
        ends = [np.column_stack([flat[:, 0], np.full(len(flat), y), flat[:, 1]]) for y in (front, back)]
        return loft(self.local(np.stack(ends)))


def places_of(geometry: RoadGeometry, items: Sequence[PointObject]) -> list[Place]:
    """Return the frames of objects on the surface below them, turned by their rotations; of a bridge's, by nothing."""
    station, offset, above = (
        np.array([getattr(item, name) for item in items]) for name in ("station", "offset", "elevation")
    )
    origins = on_ground(geometry, station, offset)
    origins[:, 2] += above
    turns = [0.0 if isinstance(item, Overpass) else item.rotation_deg for item in items]
    heading = geometry.alignment.heading(station) + np.deg2rad(np.array(turns))
    along = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    right = np.stack([along[:, 1], -along[:, 0]], axis=1)
    return [Place(geometry, *frame) for frame in zip(origins, right, along, strict=True)]


def bodies_at(place: Place, item: PointObject) -> list[Faces]:
    """Return the closed bodies of an object in its frame."""
    return _MAKERS[type(item)](place, item)


def pavement_below(place: Place, x: tuple[float, float], y: tuple[float, float], shear: float = 0.0) -> float:
    """Return the height of the pavement's highest point below a rectangle of a frame, in the local frame, m.

    Args:
        place: the frame.
        x, y: the rectangle's limits in it, m.
        shear: y grows by this per x.

    Where nothing below is paved it is the frame's origin.
    """
    across = np.linspace(*x, max(2, int(np.ceil((x[1] - x[0]) / _ACROSS)) + 1))
    beside, forth = (grid.ravel() for grid in np.meshgrid(across, np.linspace(*y, 7)))
    plan = place.origin[:2] + beside[:, None] * place.right + (forth + shear * beside)[:, None] * place.along
    station, offset = place.geometry.alignment.project(plan)
    highest = highest_pavement(place.geometry, station, offset)
    return float(place.origin[2]) if highest is None else highest


def _circle(count: int) -> list[tuple[float, float]]:
    turns = 2.0 * np.pi * np.arange(count) / count
    return list(zip(np.cos(turns).tolist(), np.sin(turns).tolist(), strict=True))


def _delineator(place: Place, item: Delineator) -> list[Faces]:
    return [place.prism(DELINEATOR, 0.0, item.height)]


def _sign(place: Place, item: TrafficSign) -> list[Faces]:
    corners = SIGN_OUTLINES.get(item.shape) or [(u / 2, v / 2) for u, v in _circle(_ROUND_FACE)]
    middle = item.lower_edge + item.height / 2.0
    face = [(u * item.width, middle + v * item.height) for u, v in corners]
    front = -(item.post_diameter / 2.0 + SIGN_RAIL)
    top = item.lower_edge + item.height * _POST_TOPS[item.shape]
    beside = [((i + 0.5) / item.posts - 0.5) * item.width for i in range(item.posts)]
    feet = place.ground(beside, 0.0) if item.posts > 1 else [-item.elevation]
    posts = [place.post(item.post_diameter, float(z), top, x) for x, z in zip(beside, feet, strict=True)]
    return [place.plate(face, front - _PLATE, front), *posts]


def _kilometre_board(place: Place, item: KilometreBoard) -> list[Faces]:
    middle = item.lower_edge + item.height / 2.0
    board = place.box((item.width, 2.0 * _PLATE, item.height), (0.0, 0.0, middle))
    return [board, place.post(KILOMETRE_POST, -item.elevation, item.lower_edge)]


def _pole(place: Place, item: Pole) -> list[Faces]:
    bodies = [place.post(item.diameter, -item.elevation, item.height)]
    if item.arm_length <= _SHORTEST_ARM:
        return bodies
    high = item.height - _ARM / 2.0
    bodies.append(place.box((item.arm_length, _ARM, _ARM), (-item.arm_length / 2.0, 0.0, high)))
    if item.kind == "lighting":
        long, wide, thick = _LUMINAIRE
        bodies.append(place.box((long, wide, thick), (-item.arm_length - long / 2.0, 0.0, item.height - thick / 2.0)))
    return bodies


def _traffic_light(place: Place, item: TrafficLight) -> list[Faces]:
    wide, deep, tall = 1.3 * item.light_diameter, 0.7 * item.light_diameter, 1.25 * item.light_diameter * item.lights
    head = place.box((wide, deep, tall), (0.0, -(TRAFFIC_LIGHT_POST + deep) / 2.0, item.height - tall / 2.0))
    return [place.post(TRAFFIC_LIGHT_POST, -item.elevation, item.height), head]


def _cabinet(place: Place, item: Cabinet) -> list[Faces]:
    low = -item.elevation
    return [place.box((item.width, item.depth, item.height - low), (0.0, 0.0, (item.height + low) / 2.0))]


def _beacon(place: Place, item: ConstructionBeacon) -> list[Faces]:
    foot, bottom = BEACON_FOOT, BEACON_BLADE_BOTTOM
    blade = place.box((item.width, BEACON_BLADE, item.height), (0.0, 0.0, bottom + item.height / 2.0))
    return [place.box(foot, (0.0, 0.0, foot[2] / 2.0)), blade]


def _gantry(place: Place, item: Gantry) -> list[Faces]:
    left, right = item.offset - item.left_offset, item.offset - item.right_offset
    pavement = pavement_below(place, (left, right), (-item.reach(1.0), item.reach(-1.0)))
    low = pavement + item.clearance - float(place.origin[2])
    bottom = item.beam_bottom(low)
    beam = place.box(
        (right - left, item.beam_depth, item.beam_height), ((left + right) / 2.0, 0.0, bottom + item.beam_height / 2.0)
    )
    boards = [_board(place, item, sign, low) for sign in item.signs]
    return [beam, *_gantry_posts(place, item, (left, right), bottom), *boards]


def _gantry_posts(place: Place, item: Gantry, ends: tuple[float, float], bottom: float) -> list[Faces]:
    posts = {"left": ends[0], "right": ends[1], "middle": item.offset}
    if item.kind == "cantilever":
        posts = {item.post_side: posts[item.post_side]}
    elif item.kind == "one_sided":
        del posts["middle"]
    feet = place.ground(list(posts.values()), 0.0) + item.elevation
    bodies = []
    for (side, x), foot in zip(posts.items(), feet.tolist(), strict=True):
        top = bottom if side == "middle" else bottom + item.beam_height
        size = (item.post_width, item.beam_depth, top - foot)
        bodies.append(place.box(size, (x, 0.0, (top + foot) / 2.0)))
    return bodies


def _board(place: Place, item: Gantry, sign: GantrySign, low: float) -> Faces:
    """Return a board's body, in front of the beam as the traffic below it sees it."""
    before_beam = item.beam_bottom(low) + item.beam_height / 2.0
    z = before_beam if item.ends_in_beam(sign, low) else low + sign.height / 2.0
    y = -sign.facing * (item.beam_depth / 2.0 + GANTRY_HANGER + sign.depth / 2.0)
    return place.box((sign.width, sign.depth, sign.height), (item.offset - sign.offset, y, z))


_MAKERS: dict[type[PointObject], Callable[[Place, Any], list[Faces]]] = {
    Delineator: _delineator,
    TrafficSign: _sign,
    KilometreBoard: _kilometre_board,
    Pole: _pole,
    TrafficLight: _traffic_light,
    Cabinet: _cabinet,
    ConstructionBeacon: _beacon,
    Gantry: _gantry,
}


_PARAPET = 0.25
"""Thickness of the parapets' bodies, m."""


def bridge_bodies(place: Place, bridge: Overpass) -> dict[str, Faces]:
    """Return the closed bodies of an overpass by name.

    The deck is level, its underside `clearance` above the pavement's highest point below it. A skewed bridge is
    sheared: its faces stay parallel to the road, as its piers do.
    """
    shear = float(np.tan(np.deg2rad(bridge.rotation_deg)))
    left, right = bridge.offset - bridge.left_abutment, bridge.offset - bridge.right_abutment
    half = bridge.width / 2.0
    low = pavement_below(place, (left, right), (-half, half), shear) + bridge.clearance - float(place.origin[2])
    high = low + bridge.deck_thickness
    bodies = {"deck": _deck(place, bridge, (left - BRIDGE_SEAT, right + BRIDGE_SEAT), low, shear)}
    if bridge.parapet_height > 0.0:
        for name, side in (("parapet-1", -1.0), ("parapet-2", 1.0)):
            y = (half - _PARAPET, half) if side > 0.0 else (-half, _PARAPET - half)
            ends = (left - BRIDGE_SEAT, right + BRIDGE_SEAT)
            bodies[name] = _block(place, ends, y, (high, high + bridge.parapet_height), shear)
    top = low - BRIDGE_BEARING
    for number, offset in enumerate(bridge.pier_offsets, 1):
        bodies[f"pier-{number}"] = _pier(place, bridge, bridge.offset - offset, top, shear)
    for name, face, side in (("abutment-1", left, -1.0), ("abutment-2", right, 1.0)):
        foot = float(place.ground(face, np.array([half, -half]) + face * shear).min()) - BRIDGE_BURIED
        back = face + side * BRIDGE_ABUTMENT
        bodies[name] = _block(place, (min(face, back), max(face, back)), (-half, half), (foot, top), shear)
    return bodies


def _pier(place: Place, bridge: Overpass, x: float, top: float, shear: float) -> Faces:
    foot = float(place.ground(x, x * shear)[0]) - BRIDGE_BURIED
    long = max(bridge.width * BRIDGE_PIER_LENGTH, bridge.pier_width * 1.02)
    return place.box((bridge.pier_width, long, top - foot), (x, x * shear, (top + foot) / 2.0))


def _deck(place: Place, bridge: Overpass, ends: tuple[float, float], low: float, shear: float) -> Faces:
    half = np.array(BRIDGE_DECK) * (bridge.width / 2.0, bridge.deck_thickness)
    outline = np.concatenate([half, half[::-1] * (-1.0, 1.0)])
    sections = [
        np.column_stack([np.full(len(outline), x), outline[:, 0] + x * shear, outline[:, 1] + low]) for x in ends
    ]
    return loft(place.local(np.stack(sections)))


def _block(place: Place, x: tuple[float, float], y: tuple[float, float], z: tuple[float, float], shear: float) -> Faces:
    """Return the body between two x, two y and two z, sheared along y."""
    outline = [(u, v + u * shear) for u, v in ((x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1]))]
    return place.prism(outline, *z)
