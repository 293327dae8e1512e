"""Surfaces on the road as polygons on its analytic surface: markings, potholes; and where lines need their points."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ..road.alignment import left_vectors
from ..road.geometry import RoadGeometry, halves_meet
from ..road.objects import LineObject, Side
from ..road.paint import cut_outline
from ..road.pavement.cover import MarkingFilms, painted_outlines
from ..road.pavement.joints import Joint
from ..road.pavement.outlines import (
    CRACK_FILM,
    PATCH_FILM,
    REMOVED_FILM,
    crack_outlines,
    patch_outline,
    removed_outlines,
)
from ..road.section import Arrow, Crack, Hatching, LineMarking, Patch, Pothole, RemovedMarking
from ..road.terrain import known_elevation
from ..road.tessellation import sample_stations
from .faces import FLAT, Faces, Int, drop_unused_points, grid_corners, join_faces, quad_faces, quad_twist

Float = NDArray[np.float64]


def road_stations(geometry: RoadGeometry, tolerance: float) -> Float:
    """Return the stations (N,) at which the road's surface is sampled to keep a chord error (m), without markings."""
    parameters = geometry.parameters
    objects = {name: item for name, item in parameters.objects.items() if not isinstance(item, LineMarking)}
    unmarked_road = RoadGeometry(parameters.model_copy(update={"objects": objects}))
    return sample_stations(unmarked_road, tolerance)


def surface_points(geometry: RoadGeometry, station: Float, offset: Float) -> Float:
    """Return local surface points (N, 3) at stations and offsets: on the road, its batter or the ground beside it.

    Where an elevation model doesn't reach, the road's edge goes on level.
    """
    return np.column_stack([geometry.alignment.place(station, offset), known_elevation(geometry, station, offset)])


def level_left_vectors(geometry: RoadGeometry, station: Float) -> Float:
    """Return horizontal unit vectors (N, 3) that point to the left of the road at stations (N,)."""
    return np.column_stack([left_vectors(geometry.alignment.heading(station)), np.zeros(len(station))])


# --- markings ---------------------------------------------------------------------------------------------------


def dash_stations(geometry: RoadGeometry, line: LineMarking, stations: Float) -> tuple[Float, Float, Int]:
    """Return a line marking's dashes (D, 2: start and end), and the station and dash index (N,) of its points."""
    dashes = geometry.dashes(line)
    rows = [_stations_between(stations, start, end) for start, end in dashes.tolist()]
    owner = np.repeat(np.arange(len(rows)), [len(row) for row in rows])
    return dashes, np.concatenate([np.empty(0), *rows]), owner


def dash_surfaces(geometry: RoadGeometry, line: LineMarking, stations: Float) -> tuple[Float, Faces, Int]:
    """Return a line marking's dashes (D, 2: start and end station), its polygons, and each polygon's dash (F,).

    Args:
        geometry: the road.
        line: the marking; its surface lies on the pavement, as high as its film is thick.
        stations: those at which the road is sampled (`road_stations`).
    """
    dashes, station, owner = dash_stations(geometry, line, stations)
    if not len(dashes):
        return dashes, join_faces([]), owner
    left_edge, right_edge = geometry.marking_edges(line, station)
    offsets = [left_edge, right_edge]
    if line.kind == "free" and line.offset == 0.0 and halves_meet(geometry.parameters):
        offsets.insert(1, np.zeros(len(station)))  # the ridge between both halves of a roof
    columns = len(offsets)
    points = surface_points(geometry, np.repeat(station, columns), np.stack(offsets, axis=1).ravel())
    points[:, 2] += line.film_thickness
    within_dash = np.repeat(owner[:-1] == owner[1:], columns - 1)
    corners = grid_corners(len(station), columns)[within_dash]
    faces = quad_faces(points, corners)
    # A quadrilateral's polygons begin with one of its rear corners.
    first_corner = faces.corners[np.cumsum(faces.sizes) - faces.sizes]
    return dashes, faces, owner[first_corner // columns]


def painted_surface(geometry: RoadGeometry, item: Hatching | Arrow, stations: Float) -> Faces:
    """Return the polygons of a hatching or an arrow on the road's surface, cut at the sampling stations."""
    return _drape_outlines(geometry, painted_outlines(geometry, item), stations, item.film_thickness)


def damaged_surface(
    geometry: RoadGeometry, item: Patch | Crack | RemovedMarking, side: Side, stations: Float, films: MarkingFilms
) -> Faces:
    """Return the polygons of a patch, crack or removed marking on the road's surface, cut at the sampling stations.

    Args:
        geometry: the road.
        item: the damage.
        side: of its carriageway.
        stations: those at which the road is sampled (`road_stations`).
        films: of the carriageway's markings, on which cracks lie.
    """
    if isinstance(item, RemovedMarking):
        pavement = geometry.sections[side].carriageway.pavement
        return _drape_outlines(geometry, removed_outlines(item, pavement, geometry.length), stations, REMOVED_FILM)
    if isinstance(item, Patch):
        outline = patch_outline(item)
        return _drape_outlines(geometry, [outline] if len(outline) > 2 else [], stations, PATCH_FILM)
    legs = _cut_at(stations, crack_outlines(item))
    return _drape([(piece, film + CRACK_FILM) for piece, film in films.cut(legs)], geometry)


def joint_surface(geometry: RoadGeometry, joint: Joint, stations: Float) -> Faces:
    """Return the polygons of a joint on the road's surface."""
    return _drape_outlines(geometry, joint.outlines, stations, 0.0)


def _drape_outlines(geometry: RoadGeometry, outlines: Iterable[Float], stations: Float, film: float) -> Faces:
    """Return convex outlines (K, 2: station, offset) as flat polygons a film thickness (m) above the road's surface."""
    return _drape([(piece, film) for piece in _cut_at(stations, outlines)], geometry)


def _cut_at(stations: Float, outlines: Iterable[Float]) -> list[Float]:
    """Return the pieces of convex outlines (K, 2) between the sampling stations."""
    return [piece for outline in outlines for piece in cut_outline(outline, _inside(stations, outline))]


def _drape(parts: list[tuple[Float, float]], geometry: RoadGeometry) -> Faces:
    """Return outlines (K, 2), each with its height (m) above the road's surface, as flat polygons."""
    if not parts:
        return join_faces([])
    places = np.concatenate([piece for piece, _ in parts])
    sizes = np.array([len(piece) for piece, _ in parts], dtype=np.int64)
    points = surface_points(geometry, places[:, 0], places[:, 1])
    points[:, 2] += np.repeat([height for _, height in parts], sizes)
    return triangulate_twisted(Faces(points, np.arange(len(points)), sizes))


def triangulate_twisted(faces: Faces) -> Faces:
    """Return polygons with those of more than three corners that aren't planar cut into fans of triangles."""
    starts = np.cumsum(faces.sizes) - faces.sizes
    parts = []
    for start, size in zip(starts.tolist(), faces.sizes.tolist(), strict=True):
        polygon = faces.corners[start : start + size]
        if size == 3:
            parts.append(Faces(faces.points, polygon, np.array([3])))
            continue
        fans = np.stack([np.full(size - 3, polygon[0]), polygon[1:-2], polygon[2:-1], polygon[3:]], axis=1)
        if np.all(_flat_fans(faces.points, fans)):
            parts.append(Faces(faces.points, polygon, np.array([size])))
        else:
            triangles = np.stack([np.full(size - 2, polygon[0]), polygon[1:-1], polygon[2:]], axis=1)
            parts.append(Faces(faces.points, triangles.ravel(), np.full(size - 2, 3)))
    corners, sizes = [part.corners for part in parts], [part.sizes for part in parts]
    return Faces(faces.points, np.concatenate(corners), np.concatenate(sizes))


def _flat_fans(points: Float, fans: Int) -> NDArray[np.bool_]:
    """Return a mask of the fans whose corners lie in a plane, within half of `FLAT`."""
    return quad_twist(points, fans) <= FLAT / 2.0


def _stations_between(stations: Float, start: float, end: float) -> Float:
    """Return a range's ends and the stations between them, leaving out those within a millimetre of an end."""
    inner_stations = stations[np.searchsorted(stations, start + 1e-3) : np.searchsorted(stations, end - 1e-3)]
    return np.concatenate([[start], inner_stations, [end]])


def _inside(stations: Float, outline: Float) -> Float:
    """Return the stations that lie between the ends of an outline."""
    return _stations_between(stations, float(outline[:, 0].min()), float(outline[:, 0].max()))


# --- damage -----------------------------------------------------------------------------------------------------

_RIM = 24


def pothole_surface(geometry: RoadGeometry, pothole: Pothole, tolerance: float) -> Faces:
    """Return a pothole's bowl as triangles whose corners lie on the damaged surface, within a tolerance (m).

    Rings of a paraboloid of the depth d, n of them, leave d / (4 n^2).
    """
    rings = 1 + int(np.ceil(np.sqrt(pothole.depth / (4.0 * tolerance))))
    azimuths = 2.0 * np.pi * np.arange(_RIM) / _RIM
    radii = np.arange(1, rings + 1) / rings
    station_offsets = np.append(0.0, (radii[:, None] * np.cos(azimuths)).ravel()) * pothole.length / 2.0
    lateral_offsets = np.append(0.0, (radii[:, None] * np.sin(azimuths)).ravel()) * pothole.width / 2.0
    points = geometry.point(pothole.station + station_offsets, pothole.offset + lateral_offsets)
    rim_corner, next_corner = 1 + np.arange(_RIM), 1 + np.roll(np.arange(_RIM), -1)
    triangles = [np.stack([np.zeros(_RIM, np.int64), rim_corner, next_corner], axis=1)]
    for ring_start in range(0, (rings - 1) * _RIM, _RIM):
        a, b, c, d = (
            rim_corner + ring_start,
            rim_corner + ring_start + _RIM,
            next_corner + ring_start + _RIM,
            next_corner + ring_start,
        )
        triangles += [np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]
    corners = np.concatenate(triangles)
    is_on_road = ~np.isnan(points[corners, 2]).any(axis=1)
    return drop_unused_points(Faces(points, corners[is_on_road].ravel(), np.full(int(is_on_road.sum()), 3)))


# --- along the road ---------------------------------------------------------------------------------------------


def even_stations(start: float, end: float, step: float = 1.0) -> Float:
    """Return evenly spaced stations (N,) from a start to an end, both included, at most a step (m) apart."""
    return np.linspace(start, max(end, start + 1e-3), max(2, int(np.ceil((end - start) / step)) + 1))


def line_points(geometry: RoadGeometry, item: LineObject, tolerance: float) -> Float:
    """Return surface points (N, 3) below a line object's axis, simplified within a chord tolerance (m)."""
    station = even_stations(item.start_station, min(item.end_station, geometry.length))
    points = surface_points(geometry, station, item.offset_at(station))
    return points[simplify_polyline(points, tolerance)]


def simplify_polyline(points: Float, tolerance: float, required: NDArray[np.bool_] | None = None) -> NDArray[np.intp]:
    """Return the indices of a polyline's points (N, 3) that Douglas-Peucker simplification keeps at a tolerance (m).

    The point farthest from a chord is kept and divides the chord, until no point is farther away than the tolerance.

    Args:
        required: (N,) rows that are kept in any case; the first and the last always are.
    """
    keep_mask = np.zeros(len(points), dtype=bool) if required is None else required.copy()
    keep_mask[[0, -1]] = True
    borders = np.flatnonzero(keep_mask)
    stack = list(zip(borders[:-1].tolist(), borders[1:].tolist(), strict=True))
    while stack:
        first_point, last_point = stack.pop()
        if last_point - first_point < 2:
            continue
        chord = points[last_point] - points[first_point]
        vectors = points[first_point + 1 : last_point] - points[first_point]
        projections = vectors @ chord / max(float(chord @ chord), 1e-12)
        distances = np.linalg.norm(vectors - projections[:, None] * chord, axis=1)
        farthest = int(np.argmax(distances))
        if distances[farthest] > tolerance:
            keep_mask[first_point + 1 + farthest] = True
            stack += [(first_point, first_point + 1 + farthest), (first_point + 1 + farthest, last_point)]
    return np.flatnonzero(keep_mask)
