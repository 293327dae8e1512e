"""Surfaces on the road as polygons on its analytic surface: markings, potholes; and where lines need their points."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ..road.alignment import left_vectors
from ..road.geometry import RoadGeometry
from ..road.objects import LineObject
from ..road.paint import arrow_outlines, cut_outline, hatching_outlines
from ..road.pavement.outlines import CRACK_FILM, PATCH_FILM, crack_outlines, patch_outline
from ..road.section import Arrow, Crack, Hatching, LineMarking, Patch, Pothole
from ..road.terrain import known_elevation
from ..road.tessellation import sample_stations
from .faces import FLAT, Faces, Int, compact, grid_corners, join_polygons, quads, twist

Float = NDArray[np.float64]


def road_stations(geometry: RoadGeometry, tolerance: float) -> Float:
    """Return the (N,) stations at which the road's surface is sampled; the ends of dashes don't matter to it."""
    parameters = geometry.parameters
    objects = {name: item for name, item in parameters.objects.items() if not isinstance(item, LineMarking)}
    bare = RoadGeometry(parameters.model_copy(update={"objects": objects}))
    return sample_stations(bare, tolerance)


def on_ground(geometry: RoadGeometry, station: Float, offset: Float) -> Float:
    """Return local points (N, 3) of what lies open to the sky: the road, its batter, or the ground beside it.

    Where an elevation model doesn't reach, the road's edge goes on level.
    """
    return np.column_stack([geometry.alignment.place(station, offset), known_elevation(geometry, station, offset)])


def left_of(geometry: RoadGeometry, station: Float) -> Float:
    """Return the level unit vectors (N, 3) to the left of the road at stations (N,)."""
    return np.column_stack([left_vectors(geometry.alignment.heading(station)), np.zeros(len(station))])


# --- markings ---------------------------------------------------------------------------------------------------


def dash_stations(geometry: RoadGeometry, line: LineMarking, stations: Float) -> tuple[Float, Float, Int]:
    """Return a marking's dashes (D, 2: start and end station), their points' stations (N,) and dashes (N,)."""
    dashes = geometry.dashes(line)
    rows = [_between(stations, start, end) for start, end in dashes.tolist()]
    owner = np.repeat(np.arange(len(rows)), [len(row) for row in rows])
    return dashes, np.concatenate([np.empty(0), *rows]), owner


def dash_surfaces(geometry: RoadGeometry, line: LineMarking, stations: Float) -> tuple[Float, Faces, Int]:
    """Return the dashes (D, 2: start and end station) of a line marking, its polygons, and the dash (F,) of each.

    Args:
        geometry: the road.
        line: the marking; its surface lies on the pavement, as high as its film is thick.
        stations: those at which the road is sampled (`road_stations`).
    """
    dashes, station, owner = dash_stations(geometry, line, stations)
    if not len(dashes):
        return dashes, join_polygons([]), owner
    left, right = geometry.marking_edges(line, station)
    points = on_ground(geometry, np.repeat(station, 2), np.stack([left, right], axis=1).ravel())
    points[:, 2] += line.film_thickness
    same = owner[:-1] == owner[1:]
    corners = grid_corners(len(station), 2)[same]
    faces = quads(points, corners)
    # A quadrilateral's polygons begin with its right rear corner, 2 * row + 1, or contain it.
    first = faces.corners[np.cumsum(faces.sizes) - faces.sizes]
    return dashes, faces, owner[first // 2]


def painted_surface(geometry: RoadGeometry, item: Hatching | Arrow, stations: Float) -> Faces:
    """Return the polygons of a hatched area or an arrow, cut at the stations at which the road is sampled."""
    outlines = hatching_outlines(geometry, item) if isinstance(item, Hatching) else arrow_outlines(item)
    return _laid(geometry, outlines, stations, item.film_thickness)


def damaged_surface(geometry: RoadGeometry, item: Patch | Crack, stations: Float) -> Faces:
    """Return the polygons of a patch or a crack, cut at the stations at which the road is sampled."""
    if isinstance(item, Patch):
        outline = patch_outline(item)
        return _laid(geometry, [outline] if len(outline) > 2 else [], stations, PATCH_FILM)
    return _laid(geometry, crack_outlines(item), stations, CRACK_FILM)


def _laid(geometry: RoadGeometry, outlines: Iterable[Float], stations: Float, film: float) -> Faces:
    """Return convex outlines (K, 2) as polygons that lie a film (m) above the road."""
    parts = [piece for outline in outlines for piece in cut_outline(outline, _inside(stations, outline))]
    if not parts:
        return join_polygons([])
    places = np.concatenate(parts)
    points = on_ground(geometry, places[:, 0], places[:, 1])
    points[:, 2] += film
    sizes = np.array([len(piece) for piece in parts], dtype=np.int64)
    return cut_into_triangles(Faces(points, np.arange(len(points)), sizes))


def cut_into_triangles(faces: Faces) -> Faces:
    """Return polygons of which those that could be twisted (more than three corners) are flat or cut into triangles."""
    starts = np.cumsum(faces.sizes) - faces.sizes
    parts = []
    for start, size in zip(starts.tolist(), faces.sizes.tolist(), strict=True):
        ring = faces.corners[start : start + size]
        if size == 3:
            parts.append(Faces(faces.points, ring, np.array([3])))
            continue
        fans = np.stack([np.full(size - 3, ring[0]), ring[1:-2], ring[2:-1], ring[3:]], axis=1)
        if np.all(_flat_fans(faces.points, fans)):
            parts.append(Faces(faces.points, ring, np.array([size])))
        else:
            triangles = np.stack([np.full(size - 2, ring[0]), ring[1:-1], ring[2:]], axis=1)
            parts.append(Faces(faces.points, triangles.ravel(), np.full(size - 2, 3)))
    corners, sizes = [part.corners for part in parts], [part.sizes for part in parts]
    return Faces(faces.points, np.concatenate(corners), np.concatenate(sizes))


def _flat_fans(points: Float, fans: Int) -> NDArray[np.bool_]:
    return twist(points, fans) <= FLAT / 2.0


def _between(stations: Float, start: float, end: float) -> Float:
    """Return a range's ends and the stations between them, none closer than a millimetre to an end."""
    inside = stations[np.searchsorted(stations, start + 1e-3) : np.searchsorted(stations, end - 1e-3)]
    return np.concatenate([[start], inside, [end]])


def _inside(stations: Float, outline: Float) -> Float:
    return _between(stations, float(outline[:, 0].min()), float(outline[:, 0].max()))


# --- damage -----------------------------------------------------------------------------------------------------

_RIM = 24


def pothole_surface(geometry: RoadGeometry, pothole: Pothole, tolerance: float) -> Faces:
    """Return the bowl of a pothole as triangles whose corners lie on the damaged surface.

    Rings of a paraboloid of the depth d, n of them, leave d / (4 n^2).
    """
    rings = 1 + int(np.ceil(np.sqrt(pothole.depth / (4.0 * tolerance))))
    turn = 2.0 * np.pi * np.arange(_RIM) / _RIM
    radius = np.arange(1, rings + 1) / rings
    along = np.append(0.0, (radius[:, None] * np.cos(turn)).ravel()) * pothole.length / 2.0
    across = np.append(0.0, (radius[:, None] * np.sin(turn)).ravel()) * pothole.width / 2.0
    points = geometry.point(pothole.station + along, pothole.offset + across)
    here, after = 1 + np.arange(_RIM), 1 + np.roll(np.arange(_RIM), -1)
    triangles = [np.stack([np.zeros(_RIM, np.int64), here, after], axis=1)]
    for inner in range(0, (rings - 1) * _RIM, _RIM):
        a, b, c, d = here + inner, here + inner + _RIM, after + inner + _RIM, after + inner
        triangles += [np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]
    corners = np.concatenate(triangles)
    inside = ~np.isnan(points[corners, 2]).any(axis=1)
    return compact(Faces(points, corners[inside].ravel(), np.full(int(inside.sum()), 3)))


# --- along the road ---------------------------------------------------------------------------------------------


def close_stations(start: float, end: float, step: float = 1.0) -> Float:
    """Return stations (N,), closely spaced (m), from a start to an end; at least two."""
    return np.linspace(start, max(end, start + 1e-3), max(2, int(np.ceil((end - start) / step)) + 1))


def line_points(geometry: RoadGeometry, item: LineObject, tolerance: float) -> Float:
    """Return points (N, 3) of the surface below a line object's axis, so many that chords keep the tolerance (m)."""
    station = close_stations(item.start_station, min(item.end_station, geometry.length))
    points = on_ground(geometry, station, item.offset_at(station))
    return points[needed_rows(points, tolerance)]


def needed_rows(points: Float, tolerance: float, kept: NDArray[np.bool_] | None = None) -> NDArray[np.intp]:
    """Return the rows that chords through a line's points (N, 3) need to stay within the tolerance (m) of all.

    Douglas and Peucker's way: the farthest point from a chord is kept until none is too far.

    Args:
        kept: (N,) rows that are kept in any case; the first and the last always are.
    """
    keep = np.zeros(len(points), dtype=bool) if kept is None else kept.copy()
    keep[[0, -1]] = True
    borders = np.flatnonzero(keep)
    stack = list(zip(borders[:-1].tolist(), borders[1:].tolist(), strict=True))
    while stack:
        first, last = stack.pop()
        if last - first < 2:
            continue
        chord = points[last] - points[first]
        beside = points[first + 1 : last] - points[first]
        along = beside @ chord / max(float(chord @ chord), 1e-12)
        away = np.linalg.norm(beside - along[:, None] * chord, axis=1)
        worst = int(np.argmax(away))
        if away[worst] > tolerance:
            keep[first + 1 + worst] = True
            stack += [(first, first + 1 + worst), (first + 1 + worst, last)]
    return np.flatnonzero(keep)
