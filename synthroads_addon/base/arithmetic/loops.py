"""Loops over points that a compiled library may do in place of NumPy, to the same bytes; whether they are in use."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple, Protocol

from ..arrays import AnyArray, Bool, Float, Float32, Index, Int, UInt8, UInt16


class PackedPoints(NamedTuple):
    """N points and how LAS records hold them.

    Attributes:
        xyz: (N, 3) m.
        intensity, gps_time: (N,).
        rgb: (N, 3).
        return_number, number_of_returns, class_id: (N,).
        codes: (C,) of the classes.
        scan_angle_deg: (N,).
        strip: (N,) from 0.
        offset: (3,) of the coordinates, m.
        per_metre, per_intensity, per_degree: steps.
    """

    xyz: Float
    intensity: Float
    gps_time: Float
    rgb: UInt16
    return_number: UInt8
    number_of_returns: UInt8
    class_id: UInt8
    codes: UInt8
    scan_angle_deg: Float32
    strip: UInt16
    offset: Float
    per_metre: float
    per_intensity: float
    per_degree: float


class EchoPlaces(NamedTuple):
    """N echoes of M hits of P pulses at F faces of which none moves.

    Attributes:
        pulse, hit: (N,) of each echo.
        range: (N,) measured, m.
        face, cosine, distance: (M,) of the hits: faces, n . d of their normals and the rays, and true ranges, m.
        direction, begin: (3, M) of the hits' rays; no begin: where the pulses do, m.
        time, scan_angle: (P,) s, rad.
        origin, measured_origin, measured_direction: (3, P) m.
        planes: (F, 4) of the faces, see `Faces`.
        class_id, instance_id, material: (F,).
        map_origin, epoch: what is added to measured places, (3,) m, and times, s.
    """

    pulse: Index
    hit: Index
    range: Float
    face: Index
    cosine: Float
    distance: Float
    direction: Float
    begin: Float | None
    time: Float
    scan_angle: Float
    origin: Float
    measured_origin: Float
    measured_direction: Float
    planes: Float
    class_id: AnyArray
    instance_id: AnyArray
    material: AnyArray
    map_origin: Float
    epoch: float


class PlacedPoints(NamedTuple):
    """N points of echoes.

    Attributes:
        xyz: (N, 3) as measured, map coordinates, m.
        gps_time: (N,) s.
        scan_angle_deg: (N,).
        class_id, instance_id, material: (N,).
        position, scanner, normal: (N, 3) where each was seen and from where, local, m, and unit normals there, towards
            the scanner.
        narrow_normal: (N, 3) likewise.
        time: (N,) of the pulses, s.
    """

    xyz: Float
    gps_time: Float
    scan_angle_deg: Float32
    class_id: UInt8
    instance_id: AnyArray
    material: UInt16
    position: Float
    scanner: Float
    normal: Float
    narrow_normal: Float32
    time: Float


class ColumnGrid(NamedTuple):
    """Grid across a direction, in whose cells lie what is seen side by side from there.

    Attributes:
        axes: (2, 3) vectors across the direction, over the width of the cells.
        low: (2,) where the grid begins along these, in cells.
        cells: number of the cells along each.
        margin: by which faces are wider than they are, in cells.
        direction: (3,) unit vector.
        above: how far from a face's plane a place must be to be surely on one of its sides, m.
    """

    axes: Float
    low: Float
    cells: tuple[int, int]
    margin: float
    direction: Float
    above: float


class Faces(NamedTuple):
    """Faces of a mesh.

    Attributes:
        vertices: (V, 3) m.
        triangles: (T, 3) rows of these.
        planes: (T, 4) unit normals n, and c of n . x = c.
    """

    vertices: Float32
    triangles: AnyArray
    planes: Float


class PointLoops(Protocol):
    """Interface of the loops; each gives the bytes of the NumPy code that asks for it: `scanning.kernels.points`."""

    def towards(self, place: Float, seen_from: Float) -> Float32:
        """Return the unit vectors (N, 3) from places (N, 3) to where they are seen from (N, 3)."""
        ...

    def layer(
        self, rows: Index | None, point_values: Float32 | None, material: UInt16, varies: Bool, means: Float32
    ) -> Float32 | None:
        """Return a layer's values (K, ...) at rows (K,) of points; None where it can't.

        Args:
            rows: of the points; None for all of them.
            point_values: (N, C) of the points, for materials that vary; None where none does.
            material: (N,) of the points.
            varies: (M,) whether a material does.
            means: (M, C) or (M,) of the materials.
        """
        ...

    def halves(self, normal: Float32, view: Float32, sun: Float32) -> tuple[Float32, Float32, Float32]:
        """Return cosines (N,) of the view, of the half vector to the normal, both cut, and of it to the view."""
        ...

    def reflected(self, tables: Sequence[AnyArray], limits: Sequence[float], surfaces: Sequence[Float32]) -> Float32:
        """Return what surfaces throw back (N, 3) by tables of albedos, see `scanning.colour.reflection`."""
        ...

    def corner_shares(self, vertices: Float32, triangles: AnyArray, faces: Index, place: Float) -> Float:
        """Return the weights (N, 3) of the corners of faces (N,) at places (N, 3)."""
        ...

    def interpolate(
        self,
        rows: Index,
        use: Index,
        triangle: Index,
        elements: AnyArray,
        mirrored: Bool,
        shares: Float,
        values: Float32,
        result: Float32,
    ) -> bool:
        """Write values between corners into rows (K,) of a result (N, 4); return whether it could.

        Args:
            rows: of the result and of the shares (N, 3).
            use, triangle: (K,) place that the mesh stands at, and triangle of the mesh.
            elements: (T, 3) rows of the values by triangle.
            mirrored: (U,) by place that the mesh stands at.
            shares: of the corners.
            values: (n, 4).
            result: where to.
        """
        ...

    def raised(
        self, height: Float, cosine: Float, normal: Float32, place: Float, distance: Float
    ) -> tuple[Float, Float]:
        """Return places (N, 3) and ranges (N,) shifted along normals (N, 3) by heights (N,), 0 for those that stay."""
        ...

    def approached(
        self,
        rough_rows: Index,
        height: Float,
        cosine: Float,
        material: UInt16,
        reach: Float,
        towards: Float32,
        place: Float,
        distance: Float,
    ) -> tuple[Float, Float]:
        """Return places (N, 3) and ranges (N,) of points, of which rough rows (K,) come nearer along their beams."""
        ...

    def daylight(
        self, sun: Float32, color: Float32, normal: Float32, light_above: Float32, light_below: Float32
    ) -> Float32:
        """Return the light (N, 3), cut to 0 to 1, of the sun (N, 3) and what surfaces throw back of an even sky."""
        ...

    def encoded(self, linear: Float32, power: Float32) -> UInt16:
        """Return 16-bit sRGB (N, 3) of linear values of 0 to 1 and of these to the power of 1 / 2.4."""
        ...

    def spread(self, rows: Index, values: Float32, result: Float32, scale: Float32 | None = None) -> None:
        """Write values (K, C), times a scale (C,) if there is one, into rows (K,) of a result (N, C)."""
        ...

    def inputs(self, rows: Index, source: Float, shift: Float | None, unit: float) -> Float32:
        """Return vectors (K, 3) of rows (K,) of others (N, 3) as (K, 4), the last 0; with a shift (3,), in a unit."""
        ...

    def pack(self, record: AnyArray, points: PackedPoints) -> tuple[Float, Int] | None:
        """Fill in LAS records (N,) of point format 7, without extra bytes; None where a value doesn't fit.

        Returns:
            the least and the largest coordinates (2, 3) as stored, and how many points have each return number (16,).
        """
        ...

    def evaluate_pieces(self, station: Float, pieces: Sequence[Float]) -> Float:
        """Return x, y, heading and curvature (4, N) at stations (N,) on the pieces of an alignment."""
        ...

    def face_columns(self, faces: Faces, grid: ColumnGrid, most_faces: int) -> tuple[AnyArray, AnyArray]:
        """Return the faces of each cell of a grid that they may touch: where they begin (C + 1,), and their numbers.

        Args:
            faces: T of them.
            grid: across a direction.
            most_faces: faces of a cell: where there are more none is listed.
        """
        ...

    def clear_places(
        self, places: Float, faces: Faces, grid: ColumnGrid, column_faces: tuple[AnyArray, AnyArray]
    ) -> Bool:
        """Return a mask (N,) of places (3, N), m, that no face listed in their cell hides from the grid's direction.

        What lies in a cell without faces isn't among them.

        Args:
            places: (3, N).
            faces, grid: as they were for `face_columns`.
            column_faces: what that returned.
        """
        ...

    def placed(self, echoes: EchoPlaces, with_seen: bool) -> PlacedPoints:
        """Return the points of echoes; what is known of the places where they were seen only if asked, else empty."""
        ...

    def facing(self, normal: Float, position: Float, direction: Float, clearance: float) -> tuple[Bool, Float]:
        """Return which normals (N, 3) face a direction (3,), and the places (3, N) so far (m) off positions (N, 3)."""
        ...

    def candidate_nodes(self, places: Sequence[Float], nodes: Sequence[Float], spacing: float) -> tuple[Int, Int]:
        """Return (point, node) index pairs, sorted by point, of nodes that may be next to feet, see `road.alignment`.

        Args:
            places: x and y (N,).
            nodes: x and y (M,), M > 0.
            spacing: between two nodes at most, m.
        """
        ...

    def find_feet(
        self,
        evaluate: Callable[[Float], tuple[Float, ...]],
        places: Sequence[Float],
        brackets: Sequence[Float],
        most_iterations: int,
    ) -> tuple[Float, Float, Float]:
        """Return the feet of points on an alignment, see `road.alignment.Alignment`: stations, rests and offsets (N,).

        Args:
            evaluate: gives x, y, heading and curvature (K,) at stations (K,).
            places: x and y (N,).
            brackets: first guesses of the stations, and the least and largest that they may be, (N,) each.
            most_iterations: iterations.
        """
        ...


_in_use: list[PointLoops] = []
"""Those that are in use, the last ones first."""


@contextmanager
def loops_by(loops: PointLoops | None) -> Iterator[None]:
    """Context in which these loops take NumPy's place in all threads; with None NumPy does all. Results are alike."""
    if loops is not None:
        _in_use.append(loops)
    try:
        yield
    finally:
        if loops is not None:
            _in_use.remove(loops)


def point_loops() -> PointLoops | None:
    """Return the loops that are in use; None where NumPy does all."""
    return next(iter(_in_use[-1:]), None)
