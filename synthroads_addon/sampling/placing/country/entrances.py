"""Entrances to fields and mouths of farm tracks, where barriers, bays and signs leave room, over piped ditches."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from ....base.arrays import Float
from ....base.schema import round_value
from ....road.alignment import Alignment
from ....road.geometry import RoadGeometry, alignment_of
from ....road.guidelines import DELINEATOR_SPACING
from ....road.terrain import surface_elevation
from ....road.things.field_entrance import FieldEntrance
from ....road.things.sign import TrafficSign
from ..draw import draw, pick
from ..layout import SIGNPOST, Layout, PlacementRequest, Roadside
from ..ranges import Range, Reservations, draw_start, free_ranges
from ..signs import country_sign_fields, destination_values

_BESIDE = 2.0
"""Distance along the road that an entrance keeps from barriers and other things, m. Chosen."""
_BESIDE_TURNOUT = 20.0
"""Distance that it keeps from turnouts, m. Chosen."""
_FROM_END = 8.0
"""Distance that it keeps from the road's ends, m. Chosen: its corners lie on the road."""
_APART = 30.0
"""Distance between two entrances of one side, m. Chosen."""
_BESIDE_POSTS = 4.0
"""Distance that an entrance leaves of that between two delineators, m: they stand up to 1.5 m from its corners."""
_STEEPEST = 0.15
"""Steepest grade of a track from the pavement to the ground (m/m). Chosen."""
_CUT = 0.35
"""Height of ground, m, that a track may have to climb above its straight line. Chosen."""
_STEP = 0.1
"""Distance of the places at which the ground beside the road is looked at, m. Chosen."""
_SHALLOWEST = 0.12
"""Depth of a hollow, m, that is a ditch: water stands in it. Chosen."""
_EARTH_ABOVE = 0.15
"""Least earth above a pipe with its wall, m. Chosen."""
_SMALLEST_PIPE = 0.25
"""Smallest pipe, m, that is laid. Chosen."""
_FROM_PIPE = 1.6
"""Length of a track beyond its pipe, m at least. Chosen."""
_PIPE_WALL = 0.06
_SIGNPOST = 1.5
"""From a track's corner to its signposts along the road, m. Chosen."""
_SIGN_HALF, _SIGN_APART = 0.5, 0.9
_TRACK_SURFACES = ("asphalt", "asphalt", "concrete")
"""Surfaces of paved tracks as often as they occur. Chosen."""


class _Ditch(NamedTuple):
    """The hollow beside a road: distance of its deepest place from the pavement, and height of a line above it, m."""

    distance: float
    height_above: float


def field_entrances(
    layout: Layout, roadside: Roadside, stations: Sequence[float]
) -> Iterator[tuple[str, FieldEntrance]]:
    """Yield (id, entrance) of one side, and open its edge there; all numbers are drawn, also where there is no room.

    Args:
        layout: what stands on the road.
        roadside: the side, its barriers placed.
        stations: of what stands along the edge already, m.
    """
    site, limits = layout.site, layout.site.scenario.furniture
    if limits.entrances_per_km.maximum <= 0.0 or not site.limits.field_access:
        return
    rng, number = site.stream("furniture", "entrances", roadside.side), 0
    taken = Reservations(_taken(roadside, stations))
    for _ in range(int(draw(rng, limits.entrances_per_km) * layout.length / 1000.0 + rng.random())):
        width, radius = draw(rng, limits.entrance_width), draw(rng, limits.entrance_radius)
        depth, pipe = draw(rng, limits.entrance_depth), draw(rng, limits.entrance_pipe)
        is_track, surface = rng.random() < limits.tracks, pick(rng, _TRACK_SURFACES)
        paved, has_walls = draw_paved(rng), bool(rng.random() < limits.head_walls)
        values, reach = destination_values(rng, site), width / 2.0 + radius
        ranges = free_ranges(_FROM_END, layout.length - _FROM_END, roadside.near, roadside.far, taken)
        start = draw_start(rng, ranges, 2.0 * (reach + _BESIDE))
        if start is None:
            continue
        station = round_value(start + reach + _BESIDE)
        profile = _ground_beside(layout, roadside, station, reach, depth)
        if profile is None:
            continue
        fields: dict[str, Any] = {"width": width, "radius": radius, "depth": depth, "paved_depth": paved}
        fields |= {"surface": surface, "paved_depth": depth if surface == "asphalt" else paved} if is_track else {}
        fields |= culvert(profile, pipe, depth, has_walls)
        number += 1
        roadside.openings.append((station - reach, station + reach))
        taken.add(station - reach - _APART, station + reach + _APART)
        if is_track and limits.signs and site.scenario.placement == "rules":
            _signposts(layout, roadside, station, reach, values)
        offset = roadside.sign * roadside.edge.largest_paved(station, station)
        yield (
            f"entrance-{roadside.side}-{number}",
            FieldEntrance(
                instance=1,
                station=station,
                offset=round_value(offset),
                rotation_deg=roadside.along_right,
                **edge_bend(alignment_of(site.alignment), roadside.sign, station, offset, reach),
                **fields,
            ),
        )


def draw_paved(rng: np.random.Generator) -> float:
    """Return the drawn length of asphalt before an entrance that has another surface, m; 0 for none."""
    return round_value(2.0 + 3.0 * rng.random()) if rng.random() < _ASPHALT_BEFORE else 0.0


_ASPHALT_BEFORE = 0.6
"""Share of entrances that have asphalt near the road. Chosen."""


def _taken(roadside: Roadside, stations: Sequence[float]) -> Iterator[Range]:
    """Yield the stretches (m) in which no entrance fits: beside barriers, turnouts, and what stands at stations."""
    yield from ((piece.start - _BESIDE, piece.end + _BESIDE) for piece in roadside.pieces)
    yield from ((start - _BESIDE_TURNOUT, end + _BESIDE_TURNOUT) for start, end in roadside.turnouts.stretches)
    yield from roadside.villages.stretches
    yield from ((station - 0.5, station + 0.5) for station in stations)


def edge_bend(alignment: Alignment, sign: int, station: float, offset: float, reach: float) -> dict[str, float]:
    """Return the curvature of the paved edge along an entrance, and its change, as its fields.

    Args:
        alignment: of the road.
        sign: of offsets on its side.
        station, offset: of the entrance, m.
        reach: of the entrance to either side along the road, m.
    """
    ends = np.clip(station + reach * np.array([-1.0, 1.0]), 0.0, alignment.length)
    curvature = alignment.curvature(np.append(ends, station))
    first, last, middle = (curvature / (1.0 - curvature * offset)).tolist()
    change = (last - first) / float(ends[1] - ends[0])
    return {"curvature": round_value(-sign * middle, 9), "curvature_change": round_value(change, 9)}


def _ground_beside(
    layout: Layout, roadside: Roadside, station: float, reach: float, depth: float
) -> tuple[Float, Float] | None:
    """Return distances (N,) from the pavement and heights (N,) above its edge, m; None where no track can run."""
    site = layout.site
    ends = np.array([station - reach, station, station + reach])
    curvature = np.abs(alignment_of(site.alignment).curvature(ends))
    radii, spacings = zip(*DELINEATOR_SPACING, strict=True)
    if np.interp(1.0 / max(float(curvature.max()), 1e-9), radii, spacings) < 2.0 * reach + _BESIDE_POSTS:
        return None
    edges = [roadside.edge.largest_paved(end, end) for end in ends.tolist()]
    if max(edges) - min(edges) > 1e-6:
        return None
    if site.terrain.elevation_model is not None:
        distance = np.arange(0.0, depth + _STEP / 2.0, _STEP)
        return distance, np.zeros(distance.shape)
    distance, height = ground_profile(site.geometry, roadside.sign, station, edges[0], depth)
    line = height[-1] * distance / depth
    if abs(float(height[-1])) > _STEEPEST * depth or float(np.max(height - line)) > _CUT:
        return None
    return distance, height


def ground_profile(geometry: RoadGeometry, sign: int, station: float, edge: float, depth: float) -> tuple[Float, Float]:
    """Return distances (N,) from the pavement and heights (N,) of the ground above its edge, m, without entrances.

    Args:
        geometry: of the road.
        sign: of offsets on the side.
        station: m.
        edge: distance of the pavement's edge from the centreline, m.
        depth: how far from the pavement, m.
    """
    distance = np.arange(0.0, depth + _STEP / 2.0, _STEP)
    height = surface_elevation(geometry, np.full(distance.shape, station), sign * (edge + distance))
    return distance, height - height[0]


def culvert(profile: tuple[Float, Float], pipe: float, depth: float, has_walls: bool) -> dict[str, Any]:
    """Return the fields of an entrance's culvert: in the ditch, as large as fits below the track; 0 without a ditch."""
    ditch = _deepest(*profile)
    if ditch is None or ditch.distance > depth - _FROM_PIPE:
        return {"pipe_diameter": 0.0}
    largest = ditch.height_above - _EARTH_ABOVE - 2.0 * _PIPE_WALL
    if largest < _SMALLEST_PIPE:
        return {"pipe_diameter": 0.0}
    return {
        "pipe_diameter": round_value(min(pipe, largest), 2),
        "pipe_distance": round_value(ditch.distance),
        "head_walls": has_walls,
    }


def _deepest(distance: Float, height: Float) -> _Ditch | None:
    """Return the deepest hollow beside a road, of distances (N,) and heights (N,) from its edge, m; None without."""
    higher_before = np.maximum.accumulate(height)
    higher_behind = np.maximum.accumulate(height[::-1])[::-1]
    hollow = np.minimum(higher_before, higher_behind) - height
    index = int(np.argmax(hollow))
    if hollow[index] < _SHALLOWEST:
        return None
    line = height[-1] * distance[index] / distance[-1]
    return _Ditch(float(distance[index]), float(line - height[index]))


def _signposts(layout: Layout, roadside: Roadside, station: float, reach: float, values: dict[str, str]) -> None:
    """Put two signposts behind a track's mouth, for the traffic of either direction, where there is room."""
    place, roles = roadside.ahead(station, reach + _SIGNPOST), layout.site.guideline.sign_roles
    for facing, along in ((roadside.facing, 0.0), (180.0 - roadside.facing, _SIGN_APART)):
        at = roadside.ahead(place, along)
        # Who sees it goes along the side that it stands on, or comes from the other way.
        code = roles.get("signpost_right" if facing == roadside.along_right else "signpost_left")
        if (
            code is None
            or not roadside.near.is_free(at - _SIGN_HALF, at + _SIGN_HALF)
            or not 0.0 <= at <= roadside.length
        ):
            continue
        fields = country_sign_fields(code, values) | {"rotation_deg": facing}
        roadside.put(PlacementRequest(SIGNPOST, TrafficSign, at, _SIGN_HALF - 0.1, fields["width"], fields))
