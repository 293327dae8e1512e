"""Bodies of what runs along the road: sections swept along an offset line, posts, panels and elements."""

from __future__ import annotations

import numpy as np

from ...road.geometry import RoadGeometry
from ...road.objects import LineObject
from ...road.things.concrete_barrier import CONCRETE_FLANKS, CONCRETE_TIP, ConcreteBarrier
from ...road.things.guardrail import (
    GUARDRAIL_BEAM,
    GUARDRAIL_LOWEST_POST,
    GUARDRAIL_POST,
    GUARDRAIL_POST_TOP,
    GUARDRAIL_SPACER,
    GUARDRAIL_TIP,
    Guardrail,
)
from ...road.things.noise_barrier import NoiseBarrier
from ...road.things.temporary_barrier import LONGEST_PLASTIC, TEMPORARY_FLANKS, TEMPORARY_GAP, TemporaryBarrier
from ...road.things.thing import SHORTEST_ELEMENT
from ..faces import Faces, Float, loft
from ..surfaces import height_share, left_of, line_stations, needed_rows, on_ground, ramp_length

_PLAY = 0.005  # m, between a noise barrier's panel and its posts


def bodies_along(geometry: RoadGeometry, item: LineObject, tolerance: float) -> list[Faces]:
    """Return the closed bodies of an object along the road, clipped to it.

    Args:
        geometry: the road.
        item: a guardrail, concrete, noise or temporary barrier.
        tolerance: largest chord error of swept sections, m.
    """
    if min(item.end_station, geometry.length) - item.start_station < 0.01:
        return []
    if isinstance(item, Guardrail):
        return _guardrail(geometry, item, tolerance)
    if isinstance(item, ConcreteBarrier):
        return [_concrete(geometry, item, tolerance)]
    if isinstance(item, NoiseBarrier):
        return _noise_barrier(geometry, item)
    assert isinstance(item, TemporaryBarrier)
    return _elements(geometry, item)


def _feet(geometry: RoadGeometry, item: LineObject, station: Float) -> tuple[Float, Float]:
    """Return the points (N, 3) on the surface below an object's axis, and the unit vectors (N, 3) to the left."""
    return on_ground(geometry, station, item.offset_at(station)), left_of(geometry, station)


def _swept_rows(geometry: RoadGeometry, item: Guardrail | ConcreteBarrier, tolerance: float) -> tuple[Float, float]:
    """Return the stations (N,) that a swept section needs, and the end station on the road."""
    end = min(item.end_station, geometry.length)
    ramp = ramp_length(item, end)
    kinks = [item.start_station + ramp, end - ramp]
    station = np.unique(np.concatenate([line_stations(geometry, item), kinks]))
    feet, _ = _feet(geometry, item, station)
    return station[needed_rows(feet, tolerance, np.isin(station, kinks))], end


def _guardrail(geometry: RoadGeometry, rail: Guardrail, tolerance: float) -> list[Faces]:
    station, end = _swept_rows(geometry, rail, tolerance)
    feet, left = _feet(geometry, rail, station)
    share = height_share(rail, end, station)
    top = rail.height * share + GUARDRAIL_TIP * (1.0 - share)
    profile = np.array(GUARDRAIL_BEAM)
    back = GUARDRAIL_POST[0] / 2.0 + GUARDRAIL_SPACER[rail.faces]
    low, near, far = profile[:, 1].min(), back, back + profile[:, 0].max()
    bodies = []
    for name, side in (("left", 1.0), ("right", -1.0)):
        if rail.faces in (name, "both"):
            outline = [(near * side, 0.0), (far * side, 0.0), (far * side, low), (near * side, low)]
            bodies.append(_swept(feet, left, np.array(outline), top))
    return bodies + _posts(geometry, rail, end)


def _swept(feet: Float, left: Float, outline: Float, top: Float) -> Faces:
    """Return an outline (K, 2: to the left, up from the top edge) swept along feet (N, 3)."""
    sections = feet[:, None] + outline[None, :, :1] * left[:, None]
    sections[..., 2] += top[:, None] + outline[None, :, 1]
    return loft(sections)


def _posts(geometry: RoadGeometry, rail: Guardrail, end: float) -> list[Faces]:
    count = int((rail.end_station - rail.start_station) / rail.post_spacing + 1e-4) + 1
    station = rail.start_station + np.arange(count) * rail.post_spacing
    station = station[station <= end + 1e-9]
    share = height_share(rail, end, station)
    tall = rail.height * share + GUARDRAIL_TIP * (1.0 - share)
    station, tall = station[tall >= GUARDRAIL_LOWEST_POST], tall[tall >= GUARDRAIL_LOWEST_POST]
    feet, left = _feet(geometry, rail, station)
    sizes = np.tile(GUARDRAIL_POST, (len(feet), 1))
    return _boxes(feet, left, sizes, tall - GUARDRAIL_POST_TOP)


def _boxes(feet: Float, left: Float, size: Float, tall: Float) -> list[Faces]:
    """Return upright boxes on feet (N, 3): their sizes (N, 2) across and along, and heights (N,)."""
    along = np.stack([left[:, 1], -left[:, 0], left[:, 2]], axis=1)
    corners = np.array([(-0.5, -0.5), (-0.5, 0.5), (0.5, 0.5), (0.5, -0.5)])
    shares = corners * size[:, None]
    low = feet[:, None] + shares[..., :1] * left[:, None] + shares[..., 1:] * along[:, None]
    high = low + tall[:, None, None] * np.array([0.0, 0.0, 1.0])
    return [loft(pair) for pair in np.stack([low, high], axis=1)]


def _concrete(geometry: RoadGeometry, barrier: ConcreteBarrier, tolerance: float) -> Faces:
    station, end = _swept_rows(geometry, barrier, tolerance)
    feet, left = _feet(geometry, barrier, station)
    tall = np.maximum(barrier.height * height_share(barrier, end, station), CONCRETE_TIP)
    return loft(_symmetric_sections(feet, left, CONCRETE_FLANKS[barrier.profile], barrier.base_width, tall))


def _symmetric_sections(
    feet: Float, left: Float, flank: tuple[tuple[float, float], ...], width: float, tall: Float
) -> Float:
    """Return the sections (N, K, 3) of a body symmetric about its axis, given by one flank's shares."""
    outline = np.array([*flank, *((-x, z) for x, z in reversed(flank))])
    sections = feet[:, None] + outline[None, :, :1] * (width / 2.0) * left[:, None]
    sections[..., 2] += outline[None, :, 1] * tall[:, None]
    return sections


def _noise_barrier(geometry: RoadGeometry, wall: NoiseBarrier) -> list[Faces]:
    """Return posts, and between them panels down to the ground, level at the lower one of their posts."""
    end = min(wall.end_station, geometry.length)
    count = max(1, int(np.ceil((end - wall.start_station) / wall.post_spacing - SHORTEST_ELEMENT)))
    station = np.append(wall.start_station + np.arange(count) * wall.post_spacing, end)
    feet, left = _feet(geometry, wall, station)
    posts = _boxes(feet, left, np.full((count + 1, 2), wall.post_width), np.full(count + 1, wall.height))
    low = np.minimum(feet[:-1, 2], feet[1:, 2])
    along = feet[1:] - feet[:-1]
    along[:, 2] = 0.0
    length = np.linalg.norm(along, axis=1)
    along /= length[:, None]
    middle = (feet[:-1] + feet[1:]) / 2.0
    middle[:, 2] = low
    size = np.stack([np.full(count, wall.thickness), length - wall.post_width - 2.0 * _PLAY], axis=1)
    beside = np.stack([-along[:, 1], along[:, 0], along[:, 2]], axis=1)
    return posts + _boxes(middle, beside, size, np.full(count, wall.height))


def _elements(geometry: RoadGeometry, barrier: TemporaryBarrier) -> list[Faces]:
    """Return the elements of a movable barrier, each straight from foot to foot."""
    span, end = barrier.end_station - barrier.start_station, min(barrier.end_station, geometry.length)
    count = max(1, int(np.ceil(span / barrier.segment_length - SHORTEST_ELEMENT)))
    start = barrier.start_station + np.arange(count) * barrier.segment_length
    stop = np.append(start[1:], barrier.end_station)
    gap = TEMPORARY_GAP / 2.0
    ends = np.stack([start + gap, np.minimum(stop - gap, end)], axis=1)
    ends = ends[ends[:, 1] - ends[:, 0] > 0.05]
    feet = _feet(geometry, barrier, ends.ravel())[0].reshape(-1, 2, 3)
    along = feet[:, 1] - feet[:, 0]
    left = np.stack([-along[:, 1], along[:, 0], np.zeros(len(along))], axis=1)
    left /= np.linalg.norm(left, axis=1)[:, None]
    flank = TEMPORARY_FLANKS["plastic" if barrier.segment_length <= LONGEST_PLASTIC else "steel"]
    tall = np.full(2, barrier.height)
    return [
        loft(_symmetric_sections(pair, np.stack([side, side]), flank, barrier.base_width, tall))
        for pair, side in zip(feet, left, strict=True)
    ]
