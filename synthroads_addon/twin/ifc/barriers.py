"""Barriers along the road in IFC 4.3: guardrails and concrete barriers (IfcRailing), noise barriers (IfcWall).

Each is placed along the alignment at its beginning; its body is swept along the road on the surface below it.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...road.objects import LineObject
from ...road.things import concrete_barrier as concrete_barrier_sizes
from ...road.things import guardrail as sizes
from ...road.things import temporary_barrier as temporary_barrier_sizes
from ...road.things.concrete_barrier import ConcreteBarrier
from ...road.things.guardrail import Guardrail
from ...road.things.noise_barrier import NoiseBarrier
from ...road.things.temporary_barrier import TemporaryBarrier
from ...road.things.thing import SHORTEST_ELEMENT
from ..surfaces import height_share, left_of, ramp_length
from .entities import Entity, Float
from .scene import Scene, grid_triangles

_Mesh = tuple[Float, NDArray[np.intp]]

_WALL_BURIED = 0.4
"""Depth of a noise barrier's posts and plinth below the surface, m."""
_CONCRETE_BURIED, _POST_BURIED = 0.1, 0.35
"""Depth of a concrete barrier and of a guardrail's posts below the surface, m."""
_POST_REACH = sizes.POST[0] / 2.0
_SHEET = 0.003
"""Thickness of a guardrail's beam, m."""
_SPACER_HALF = (0.05, 0.11)
"""Half of a spacer along the road and in height, m."""
_BEAM_MIDDLE = 0.155
_SHORTEST = 1e-3  # m
_PANELS = {"aluminium": "noise_aluminium", "concrete": "noise_concrete", "wood": "noise_wood", "glass": "acrylic_glass"}


def write_barriers(scene: Scene) -> None:
    """Add all barriers."""
    for name, item in scene.geometry.parameters.objects.items():
        if isinstance(item, Guardrail):
            _railing(scene, name, item, _guardrail(scene, item), "galvanised_steel")
        elif isinstance(item, ConcreteBarrier):
            _railing(scene, name, item, _concrete(scene, item), "barrier_concrete")
        elif isinstance(item, TemporaryBarrier):
            _railing(scene, name, item, _temporary(scene, item), "galvanised_steel")
        elif isinstance(item, NoiseBarrier):
            _wall(scene, name, item)


def _railing(scene: Scene, name: str, item: Any, meshes: list[_Mesh], material: str) -> None:
    """Add a vehicle restraint system."""
    railing = _element(scene, "IfcRailing", name, item, meshes, "GUARDRAIL")
    scene.ifc.made_of(railing, material)
    common = {
        "Status": ["TEMPORARY" if isinstance(item, TemporaryBarrier) else "EXISTING"],
        "Height": scene.ifc.add("IfcPositiveLengthMeasure", item.height),
        "IsExternal": scene.ifc.value(True),
    }
    scene.ifc.properties(railing, "Pset_RailingCommon", common)


def _wall(scene: Scene, name: str, item: NoiseBarrier) -> None:
    """Add a noise barrier: IFC has a wall for it, but no type of wall."""
    wall = _element(scene, "IfcWall", name, item, _noise_barrier(scene, item), "USERDEFINED")
    scene.ifc.made_of(wall, _PANELS[item.panel])
    scene.ifc.properties(wall, "Pset_WallCommon", {"Status": ["EXISTING"], "IsExternal": scene.ifc.value(True)})


def _element(scene: Scene, entity: str, name: str, item: Any, meshes: list[_Mesh], kind: str) -> Entity:
    """Add an element that is placed at its beginning."""
    ifc, geometry = scene.ifc, scene.geometry
    start = min(max(item.start_station, 0.0), geometry.length)
    place = scene.place(start, item.offset)
    solids = [ifc.mesh(place.inside(points), triangles, True) for points, triangles in meshes]
    shape = ifc.shape(solids, "Tessellation")
    made = ifc.product(entity, name, kind, item.type, place.placement, Representation=shape)
    scene.describe(made, item)
    scene.stand(made, scene.container(start, item.offset))
    return made


# --- bodies ---------------------------------------------------------------------------------------------------------


def _guardrail(scene: Scene, item: Guardrail) -> list[_Mesh]:
    """Return beams, posts and spacers."""
    station = _rows(scene, item)
    spacer, sides = (
        sizes.SPACER[item.faces],
        {"left": [1.0], "right": [-1.0], "both": [1.0, -1.0]}[item.faces],
    )
    front = np.array(sizes.BEAM)
    rear = front - (_SHEET, 0.0)
    meshes = []
    for side in sides:
        # Seen along the road a ring runs against the clock: up on its right, down on its left.
        up, down = (rear, front) if side > 0.0 else (front, rear)
        ring = np.concatenate([up[::-1], down])
        across = side * (ring[:, 0] + spacer + _POST_REACH)
        height = _ramped_height(item, station, sizes.TIP)[:, None] + ring[:, 1]
        meshes.append(_swept(scene, item, station, across, height))
    return [*meshes, *_posts(scene, item, sides, spacer)]


def _posts(scene: Scene, item: Guardrail, sides: list[float], spacer: float) -> list[_Mesh]:
    """Return a guardrail's posts, and the spacers between them and the beams."""
    low, high = ((station - item.start_station) / item.post_spacing for station in _span(scene, item))
    numbers = np.arange(np.ceil(low - 1e-4), np.floor(high + 1e-4) + 1.0)
    station = item.start_station + item.post_spacing * numbers
    top = _ramped_height(item, station, sizes.TIP)
    station, top = station[top >= sizes.LOWEST_POST], top[top >= sizes.LOWEST_POST]
    if not len(station):
        return []
    offset, half = np.full(station.shape, item.offset), (_POST_REACH, sizes.POST[1] / 2.0)
    meshes = [_boxes(scene, station, offset, half, (np.full(station.shape, -_POST_BURIED), top - sizes.POST_TOP))]
    along, tall = _SPACER_HALF
    levels = (top - _BEAM_MIDDLE - tall, top - _BEAM_MIDDLE + tall)
    for side in sides:
        beside = offset + side * (_POST_REACH + spacer / 2.0)
        meshes.append(_boxes(scene, station, beside, (spacer / 2.0, along), levels, offset))
    return meshes


def _concrete(scene: Scene, item: ConcreteBarrier) -> list[_Mesh]:
    station = _rows(scene, item)
    tall = np.maximum(_ramped_height(item, station, 0.0), concrete_barrier_sizes.TIP)
    flank = np.array(concrete_barrier_sizes.FLANKS[item.profile])
    across, height = _both_flanks(flank, item.base_width / 2.0, tall, _CONCRETE_BURIED)
    return [_swept(scene, item, station, across, height)]


def _temporary(scene: Scene, item: TemporaryBarrier) -> list[_Mesh]:
    """Return the elements of a movable barrier, each straight between its ends."""
    flank = np.array(
        temporary_barrier_sizes.FLANKS[
            "plastic" if item.segment_length <= temporary_barrier_sizes.LONGEST_PLASTIC else "steel"
        ]
    )
    meshes = []
    for start, end in _bays(scene, item, item.segment_length):
        station = np.clip(
            [start + temporary_barrier_sizes.GAP / 2.0, end - temporary_barrier_sizes.GAP / 2.0], *_span(scene, item)
        )
        if station[1] - station[0] < _SHORTEST:
            continue
        across, height = _both_flanks(flank, item.base_width / 2.0, np.full(2, item.height), 0.0)
        meshes.append(_swept(scene, item, station, across, height))
    return meshes


def _noise_barrier(scene: Scene, item: NoiseBarrier) -> list[_Mesh]:
    """Return the wall of panels, and its posts."""
    station = _rows(scene, item)
    across = np.array([-1.0, -1.0, 1.0, 1.0]) * item.thickness / 2.0
    height = np.broadcast_to([-_WALL_BURIED, item.height, item.height, -_WALL_BURIED], (len(station), 4))
    panels = _swept(scene, item, station, across, height)
    low, high = _span(scene, item)
    post = np.array([item.start_station, *(end for _, end in _bays(scene, item, item.post_spacing))])
    post = post[(post >= low) & (post <= high)]
    if not len(post):
        return [panels]
    half, one = item.post_width / 2.0, np.ones(post.shape)
    levels = (-_WALL_BURIED * one, item.height * one)
    return [panels, _boxes(scene, post, item.offset * one, (half, half), levels)]


# --- sweeping -------------------------------------------------------------------------------------------------------


def _span(scene: Scene, item: Any) -> tuple[float, float]:
    """Return the stations (m) between which something is, within the road."""
    return max(item.start_station, 0.0), min(item.end_station, scene.geometry.length)


def _rows(scene: Scene, item: LineObject) -> Float:
    """Return the stations (N,) of rows along something, one of them at the end of either ramp."""
    start, end = _span(scene, item)
    if end - start < _SHORTEST:
        return np.array([start])
    ramp = ramp_length(item, item.end_station)
    return scene.rows(start, end, item.start_station + ramp, item.end_station - ramp)


def _bays(scene: Scene, item: Any, length: float) -> list[tuple[float, float]]:
    """Return the stations (m) of elements, or between posts, on the road: the last one of all takes the rest."""
    whole = (item.end_station - item.start_station) / length - SHORTEST_ELEMENT
    count = max(1.0, np.ceil(whole))
    low, high = ((station - item.start_station) / length for station in _span(scene, item))
    numbers = np.arange(max(np.floor(low), 0.0), min(np.ceil(high) + 1.0, count))
    starts = (item.start_station + length * numbers).tolist()
    last = item.end_station if high >= count - 1.0 else item.start_station + length * (numbers.max(initial=0.0) + 1.0)
    return list(pairwise([*starts, float(last)]))


def _ramped_height(item: Any, station: Float, tip: float) -> Float:
    """Return the height (N,) of what is ramped down at both ends, m."""
    return tip + (item.height - tip) * height_share(item, item.end_station, station)


def _both_flanks(flank: Float, half: float, tall: Float, buried: float) -> tuple[Float, Float]:
    """Return the offsets (P,) and heights (N, P) of a symmetric cross-section from one flank in shares."""
    shares = np.concatenate([[[1.0, np.nan]], flank]) if buried else flank
    ring = np.concatenate([shares * (-1.0, 1.0), shares[::-1]])
    height = tall[:, None] * ring[:, 1]
    return half * ring[:, 0], np.where(np.isnan(height), -buried, height)


def _swept(scene: Scene, item: LineObject, station: Float, across: Float, height: Float) -> _Mesh:
    """Return a closed cross-section swept along the axis of something that runs along the road.

    Args:
        station: (N,) where, m.
        across: (P,) offsets of the section's points from the axis, m: seen along the road they run against the clock,
            and the second half mirrors the first point by point.
        height: (N, P) above the surface under the axis, m.
    """
    if len(station) < 2:
        return np.empty((0, 3)), np.empty((0, 3), dtype=np.intp)
    rows, count = len(station), len(across)
    left = left_of(scene.geometry, station)[:, None, :]
    points = scene.points(station, item.offset_at(station))[:, None, :] + across[:, None] * left
    points[:, :, 2] += height
    caps = [(i, i + 1, count - 1 - i) for i in range(count // 2 - 1)]
    caps += [(i + 1, count - 2 - i, count - 1 - i) for i in range(count // 2 - 1)]
    cap = np.array(caps, dtype=np.intp)
    triangles = np.concatenate([grid_triangles(rows, count, closed=True), cap, cap[:, ::-1] + (rows - 1) * count])
    return points.reshape(-1, 3), triangles


def _boxes(
    scene: Scene,
    station: Float,
    offset: Float,
    half: tuple[float, float],
    levels: tuple[Float, Float],
    foot: Float | None = None,
) -> _Mesh:
    """Return upright boxes at stations and offsets (N,).

    Args:
        half: half their size across and along the road, m.
        levels: (N,) heights of bottom and top above the surface, m.
        foot: (N,) offsets where the surface is looked up, m; their own if None.
    """
    middle = scene.points(station, offset if foot is None else foot)
    left = left_of(scene.geometry, station)
    middle = middle + (0.0 if foot is None else (offset - foot)[:, None] * left)
    ahead = np.column_stack([left[:, 1], -left[:, 0], np.zeros(len(station))])
    corners = [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)]
    points = np.empty((len(station), 8, 3))
    for level, z in enumerate(levels):
        for corner, (along, across) in enumerate(corners):
            place = middle + along * half[1] * ahead - across * half[0] * left
            points[:, 4 * level + corner] = place + np.column_stack([np.zeros((len(station), 2)), z])
    first = 8 * np.arange(len(station))[:, None, None]
    return points.reshape(-1, 3), (_BOX[None] + first).reshape(-1, 3)


# Corners 0 to 3 are the bottom's, 4 to 7 the top's, both against the clock from above.
_BOX = np.array(
    [(0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), (0, 1, 5), (0, 5, 4), (1, 2, 6), (1, 6, 5),
     (2, 3, 7), (2, 7, 6), (3, 0, 4), (3, 4, 7)]
)  # fmt: skip
