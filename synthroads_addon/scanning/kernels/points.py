"""Loops over points that are compiled, beside `points.c`: byte for byte what NumPy makes."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np

from ...base.arithmetic.loops import ColumnGrid, EchoPlaces, Faces, PackedPoints, PlacedPoints
from ...base.arrays import AnyArray, Bool, Float, Float32, Index, Int, UInt16
from .library import NoKernelError, load_kernel

_POINTER, _INT64, _INT32 = ctypes.c_void_p, ctypes.c_int64, ctypes.c_int32
_FUNCTIONS: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "towards": (None, (_INT64, *[_POINTER] * 3)),
    "halves": (None, (_INT64, *[_POINTER] * 6)),
    "reflected": (_INT32, (_INT64, *[_POINTER] * 3)),
    "layer": (None, (_INT64, _POINTER, _INT64, *[_POINTER] * 5)),
    "shares": (None, (_INT64, *[_POINTER] * 5)),
    "interpolate": (None, (_INT64, *[_POINTER] * 8)),
    "raise": (None, (_INT64, *[_POINTER] * 7)),
    "approach": (None, (_INT64, _INT64, *[_POINTER] * 10)),
    "daylight": (None, (_INT64, *[_POINTER] * 6)),
    "encode": (None, (_INT64, *[_POINTER] * 3)),
    "pack": (_INT32, (_INT64, _POINTER, _INT64, *[_POINTER] * 3)),
    "spread": (None, (_INT64, _INT64, *[_POINTER] * 4)),
    "inputs": (None, (_INT64, *[_POINTER] * 3, ctypes.c_double, _POINTER)),
    "measure": (None, (_INT64, _POINTER)),
    "step": (_INT64, (_INT64, _POINTER, _POINTER)),
    "evaluate": (None, (_INT64, *[_POINTER] * 3)),
    "candidates": (_INT64, (_INT64, _POINTER, _POINTER, _INT64, *[_POINTER] * 3, ctypes.c_double, *[_POINTER] * 3)),
    "place": (_INT32, (_INT64, _POINTER, _POINTER)),
    "face_sun": (None, (_INT64, *[_POINTER] * 3, ctypes.c_double, *[_POINTER] * 2)),
    "sort_faces": (None, (_POINTER, _INT64, *[_POINTER] * 6)),
    "clear": (None, (_POINTER, _INT64, *[_POINTER] * 7)),
}
"""Results and arguments of the functions of points.c, by name."""
_RECORD = 36
"""Bytes of a LAS record of point format 7."""


class _Tables(ctypes.Structure):
    """Tables of albedos; as `Tables` in points.c."""

    _fields_ = (
        *((name, _POINTER) for name in ("once", "albedo", "average")),
        *((name, _INT64) for name in ("roughs", "views", "levels")),
        ("first", ctypes.c_float * 3),
        ("scale", ctypes.c_float * 3),
        ("matt", ctypes.c_float),
        ("brightest", ctypes.c_float),
    )


class _Records(ctypes.Structure):
    """Points and how they are stored; as `Points` in points.c."""

    _fields_ = (
        *((name, _POINTER) for name in ("place", "intensity", "time", "rgb", "number", "of", "class_id", "codes")),
        *((name, _POINTER) for name in ("angle", "strip")),
        ("offset", ctypes.c_double * 3),
        ("per_step", ctypes.c_double),
        ("brightness", ctypes.c_double),
        ("per_angle", ctypes.c_float),
        ("classes", _INT32),
    )


class _Feet(ctypes.Structure):
    """Feet on an alignment that are sought; as `Feet` in points.c."""

    _fields_ = tuple(
        (name, _POINTER)
        for name in ("x", "y", "station", "low", "high", "along", "offset", "active")
        + ("px", "py", "cosine", "sine", "bend", "turn", "lever")
    )


class _Pieces(ctypes.Structure):
    """Pieces of an alignment; as `Pieces` in points.c."""

    _fields_ = (
        *((name, _POINTER) for name in ("borders", "middles", "halves", "bends", "slopes", "headings")),
        *((name, _POINTER) for name in ("series_x", "series_y")),
        ("pieces", _INT64),
        ("terms", _INT64),
    )


class _Echoes(ctypes.Structure):
    """Echoes and their pulses; as `Echoes` in points.c, where the cosine is named `along`."""

    _fields_ = (
        *((name, _POINTER) for name in ("pulse", "hit", "range", "face", "cosine", "distance", "direction", "begin")),
        ("hits", _INT64),
        *((name, _POINTER) for name in ("time", "scan_angle", "origin", "measured_origin", "measured_direction")),
        ("pulses", _INT64),
        ("planes", _POINTER),
        ("faces", _INT64),
        *((name, _POINTER) for name in ("class_id", "instance_id", "material")),
        ("map_origin", ctypes.c_double * 3),
        ("epoch", ctypes.c_double),
    )


class _Placed(ctypes.Structure):
    """Points; as `Placed` in points.c."""

    _fields_ = tuple((name, _POINTER) for name in PlacedPoints._fields)


class _Columns(ctypes.Structure):
    """Columns side by side; as `Columns` in points.c."""

    _fields_ = (
        ("axes", ctypes.c_double * 6),
        ("low", ctypes.c_double * 2),
        ("columns", _INT64 * 2),
        ("margin", ctypes.c_double),
        ("direction", ctypes.c_double * 3),
        ("above", ctypes.c_double),
    )

    @classmethod
    def of(cls, grid: ColumnGrid) -> _Columns:
        """Return a grid in the structure that points.c takes."""
        axes, corner, direction = (np.ravel(array).tolist() for array in (grid.axes, grid.low, grid.direction))
        return cls(
            *((ctypes.c_double * 6)(*axes), (ctypes.c_double * 2)(*corner), (_INT64 * 2)(*grid.cells), grid.margin),
            *((ctypes.c_double * 3)(*direction), grid.above),
        )


def _as(kind: Any, shape: tuple[int, ...], **arrays: AnyArray) -> list[AnyArray]:
    """Return arrays as C-contiguous ones of a type; raise ValueError if one has another shape than ``shape``."""
    for name, array in arrays.items():
        if array.shape != shape:
            raise ValueError(f"{name} {array.shape}: must be {shape}")
    return [np.ascontiguousarray(array, kind) for array in arrays.values()]


def _faces(faces: Faces) -> tuple[AnyArray, ...]:
    """Return vertices (V, 3), triangles (T, 3) and planes (T, 4) of faces in the types that points.c takes."""
    (vertices,) = _as(np.float32, (len(faces.vertices), 3), vertices=faces.vertices)
    (triangles,) = _as(np.int32, (len(faces.triangles), 3), triangles=faces.triangles)
    (planes,) = _as(np.float64, (len(triangles), 4), planes=faces.planes)
    return vertices, triangles, planes


class CompiledPoints:
    """The loops of `base.arithmetic.loops.PointLoops`, compiled; any threads may use it side by side.

    Args:
        suffix: of the functions: ``_narrow`` for those that any processor has.

    Raises:
        NoKernelError: this machine has none.
    """

    def __init__(self, suffix: str = "") -> None:
        library = load_kernel("points")
        self._functions: dict[str, Any] = {}
        for name, (result, arguments) in _FUNCTIONS.items():
            function = getattr(library, f"synthroads_{name}{suffix}")
            function.restype, function.argtypes = result, list(arguments)
            self._functions[name] = function

    def towards(self, place: Float, seen_from: Float) -> Float32:
        """Return the unit vectors (N, 3) from places (N, 3) to where they are seen from (N, 3)."""
        place, seen_from = _as(np.float64, (len(place), 3), place=place, seen_from=seen_from)
        result = np.empty(place.shape, np.float32)
        self._functions["towards"](len(place), place.ctypes.data, seen_from.ctypes.data, result.ctypes.data)
        return result

    def layer(
        self, rows: Index | None, point_values: Float32 | None, material: UInt16, varies: Bool, means: Float32
    ) -> Float32 | None:
        """Return a layer's values (K, ...) at rows (K,) of points; None where a row or a material isn't there.

        Args:
            rows: of the points; None for all of them.
            point_values: (N, C) the points' own, for materials that vary; None where none does.
            material: (N,) of the points.
            varies: (M,) whether a material does.
            means: (M, C) or (M,) of the materials, for the others.
        """
        material_count, width = len(means), means.size // max(1, len(means))
        row_count = len(material) if rows is None else len(rows)
        if not row_count:
            return np.empty((0, *means.shape[1:]), np.float32)
        if int(material.max()) >= material_count or not (
            rows is None or (rows.min() >= 0 and rows.max() < len(material))
        ):
            return None
        (varies,), (material,) = (
            _as(np.bool_, (material_count,), varies=varies),
            _as(np.uint16, material.shape, all=material),
        )
        rows = None if rows is None else np.ascontiguousarray(rows, np.int64)
        means = np.ascontiguousarray(means, np.float32)
        values = None if point_values is None else _as(np.float32, (len(material), width), point_values=point_values)[0]
        result = np.empty((row_count, *means.shape[1:]), np.float32)
        rows_at, values_at = (None if array is None else array.ctypes.data for array in (rows, values))
        self._functions["layer"](
            *(row_count, rows_at, width, values_at),
            *(array.ctypes.data for array in (material, varies, means, result)),
        )
        return result

    def halves(self, normal: Float32, view: Float32, sun: Float32) -> tuple[Float32, Float32, Float32]:
        """Return three cosines (N,): of normal and view, of normal and half vector, and of half vector and view.

        The half vector is the unit vector midway between sun and view. The first two are cut to 0 and more.

        Args:
            normal, view: (N, 3) unit vectors, of surfaces and towards the eye.
            sun: (3,) unit vector towards the sun.
        """
        count = len(normal)
        normal, view = _as(np.float32, (count, 3), normal=normal, view=view)
        (sun,) = _as(np.float32, (3,), sun=sun)
        view_cosine, normal_cosine, half_view_cosine = np.empty((3, count), np.float32)
        arrays = (normal, view, sun, view_cosine, normal_cosine, half_view_cosine)
        self._functions["halves"](count, *(array.ctypes.data for array in arrays))
        return view_cosine, normal_cosine, half_view_cosine

    def reflected(self, tables: Sequence[AnyArray], limits: Sequence[float], surfaces: Sequence[Float32]) -> Float32:
        """Return the light (N, 3) of the sun that surfaces reflect.

        Args:
            tables: the albedo after one bounce (R, V), that of dielectrics (R, V, L), and the former's mean (R,).
            limits: first value and scale of roughness, cosine of the view and root of the reflectance; the
                reflectance of a specular of 1, and the largest.
            surfaces: colours (N, 3) and, (N,) each: roughness, its fourth power, metallic, specular; cosines of the
                sun, of the view, of the half vector to normal and view; fifth powers for metals.

        Raises:
            IndexError: a roughness or a cosine is no number.
        """
        once, albedo = (np.ascontiguousarray(table, np.float32) for table in tables[:2])
        average = np.ascontiguousarray(tables[2], np.float64)
        first_values, scale = ((ctypes.c_float * 3)(*limits[part:6:2]) for part in (0, 1))
        count = len(surfaces[0])
        (color,) = _as(np.float32, (count, 3), color=surfaces[0])
        other_columns = [_as(np.float32, (count,), surfaces=array)[0] for array in surfaces[1:]]
        native_tables = _Tables(
            *(table.ctypes.data for table in (once, albedo, average)), *albedo.shape, first_values, scale, *limits[6:]
        )
        if once.shape != albedo.shape[:2] or average.shape != once.shape[:1] or len(other_columns) != 9:
            raise ValueError(f"tables {once.shape}, {albedo.shape}, {average.shape}, {len(other_columns)} values")
        result = np.empty((count, 3), np.float32)
        addresses = (_POINTER * 10)(*(array.ctypes.data for array in (color, *other_columns)))
        if self._functions["reflected"](count, ctypes.byref(native_tables), addresses, result.ctypes.data):
            raise IndexError("a roughness or a cosine is no number")
        return result

    def corner_shares(self, vertices: Float32, triangles: AnyArray, faces: Index, place: Float) -> Float:
        """Return the weights (N, 3) of the corners of faces (N,) at places (N, 3).

        Raises:
            IndexError: a face isn't there.
        """
        count = len(faces)
        if count and not (faces.min() >= 0 and faces.max() < len(triangles)):
            raise IndexError(f"faces {faces.min()} to {faces.max()} of {len(triangles)}")
        (faces,), (place,) = _as(np.int64, (count,), faces=faces), _as(np.float64, (count, 3), place=place)
        (vertices,) = _as(np.float32, (len(vertices), 3), vertices=vertices)
        (triangles,) = _as(np.int32, (len(triangles), 3), triangles=triangles)
        result = np.empty((count, 3))
        arrays = (vertices, triangles, faces, place, result)
        self._functions["shares"](count, *(array.ctypes.data for array in arrays))
        return result

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
        """Write values, interpolated between the corners of triangles, into rows (K,) of a result (N, 4).

        The arguments are those of `scene.surface_values`. Rows, uses and triangles must be there: that isn't checked.

        Returns:
            False, with nothing written, where an array has another type than the loop takes.
        """
        kinds = (np.int64, np.int64, np.int64, np.int32, np.bool_, np.float64, np.float32, np.float32)
        arrays: tuple[AnyArray, ...] = (rows, use, triangle, elements, mirrored, shares, values, result)
        if any(item.dtype != kind or not item.flags.c_contiguous for item, kind in zip(arrays, kinds, strict=True)):
            return False
        self._functions["interpolate"](len(rows), *(array.ctypes.data for array in arrays))
        return True

    def raised(
        self, height: Float, cosine: Float, normal: Float32, place: Float, distance: Float
    ) -> tuple[Float, Float]:
        """Return places (N, 3) and ranges (N,) of points that are shifted along their normals by heights.

        Args:
            height: (N,) m; 0 for points that stay.
            cosine: (N,) of the incidence angles.
            normal: (N, 3) unit vectors.
            place, distance: (N, 3), (N,) m.
        """
        count = len(height)
        height, cosine, distance = _as(np.float64, (count,), height=height, cosine=cosine, distance=distance)
        (normal,), (place,) = _as(np.float32, (count, 3), normal=normal), _as(np.float64, (count, 3), place=place)
        shifted_place, shifted_distance = np.empty((count, 3)), np.empty(count)
        arrays = (height, cosine, normal, place, distance, shifted_place, shifted_distance)
        self._functions["raise"](count, *(array.ctypes.data for array in arrays))
        return shifted_place, shifted_distance

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
        """Return places (N, 3) and ranges (N,) of points, some of which a relief brings nearer along their beams.

        Args:
            rough_rows: (K,) rows of these points, ascending.
            height, cosine: (K,) heights of the relief, m, and cosines of the incidence angles.
            material: (N,) indices; of rough ones there is a reach.
            reach: (M,) by material, within which a beam that grazes the relief meets some peak, m.
            towards: (N, 3) unit vectors to the scanner.
            place, distance: (N, 3), (N,) m.
        """
        rough_count, count = len(rough_rows), len(distance)
        height, cosine = _as(np.float64, (rough_count,), height=height, cosine=cosine)
        (rough_rows,), (reach,) = (
            _as(np.int64, (rough_count,), rough=rough_rows),
            _as(np.float64, (len(reach),), reach=reach),
        )
        (material,), (distance,) = (
            _as(np.uint16, (count,), material=material),
            _as(np.float64, (count,), range=distance),
        )
        (towards,), (place,) = _as(np.float32, (count, 3), towards=towards), _as(np.float64, (count, 3), place=place)
        shifted_place, shifted_distance = np.empty((count, 3)), np.empty(count)
        arrays = (
            rough_rows,
            height,
            cosine,
            material,
            reach,
            towards,
            place,
            distance,
            shifted_place,
            shifted_distance,
        )
        self._functions["approach"](count, rough_count, *(array.ctypes.data for array in arrays))
        return shifted_place, shifted_distance

    def daylight(
        self, sun: Float32, color: Float32, normal: Float32, light_above: Float32, light_below: Float32
    ) -> Float32:
        """Return the light (N, 3), cut to 0 to 1, that surfaces reflect of the sun and of an even sky.

        Args:
            sun: (N, 3) reflected light of the sun.
            color, normal: (N, 3) of the surfaces.
            light_above, light_below: (3,) light of the sky on a surface that faces straight up, and down.
        """
        sun, color, normal = _as(np.float32, (len(sun), 3), sun=sun, color=color, normal=normal)
        light_above, light_below = _as(np.float32, (3,), above=light_above, below=light_below)
        result = np.empty(sun.shape, np.float32)
        arrays = (sun, color, normal, light_above, light_below, result)
        self._functions["daylight"](len(sun), *(array.ctypes.data for array in arrays))
        return result

    def encoded(self, linear: Float32, power: Float32) -> UInt16:
        """Return 16-bit sRGB (N, 3) of linear values of 0 to 1 and of these to the power of 1 / 2.4."""
        linear, power = _as(np.float32, linear.shape, linear=linear, power=power)
        result = np.empty(linear.shape, np.uint16)
        self._functions["encode"](linear.size, linear.ctypes.data, power.ctypes.data, result.ctypes.data)
        return result

    def spread(self, rows: Index, values: Float32, result: Float32, scale: Float32 | None = None) -> None:
        """Write values (K, C), each component times its scale (C,) if there is one, into rows (K,) of a result (N, C).

        Raises:
            IndexError: a row isn't there.
        """
        count, width = values.shape
        if not count:
            return
        if not (rows.min() >= 0 and rows.max() < len(result)):
            raise IndexError(f"rows {rows.min()} to {rows.max()} of {len(result)}")
        if result.dtype != np.float32 or not result.flags.c_contiguous or result.shape[1:] != (width,):
            raise ValueError(f"result {result.dtype} {result.shape}: must be float32 ({len(result)}, {width})")
        (rows,), (values,) = _as(np.int64, (count,), rows=rows), _as(np.float32, (count, width), values=values)
        if scale is not None:
            (scale,) = _as(np.float32, (width,), scale=scale)
        at = None if scale is None else scale.ctypes.data
        self._functions["spread"](count, width, rows.ctypes.data, values.ctypes.data, at, result.ctypes.data)

    def inputs(self, rows: Index, source: Float, shift: Float | None, unit: float) -> Float32:
        """Return vectors (K, 4) whose first three components are rows of other vectors, the last 0.

        Args:
            rows: (K,).
            source: (N, 3) m.
            shift: (3,) added to each, m, before it is divided by ``unit``; None: they are taken as they are.
            unit: m.

        Raises:
            IndexError: a row isn't there.
        """
        if len(rows) and not (rows.min() >= 0 and rows.max() < len(source)):
            raise IndexError(f"rows {rows.min()} to {rows.max()} of {len(source)}")
        (rows,), (source,) = _as(np.int64, rows.shape, rows=rows), _as(np.float64, (len(source), 3), source=source)
        if shift is not None:
            (shift,) = _as(np.float64, (3,), shift=shift)
        result, at = np.empty((len(rows), 4), np.float32), None if shift is None else shift.ctypes.data
        self._functions["inputs"](len(rows), rows.ctypes.data, source.ctypes.data, at, unit, result.ctypes.data)
        return result

    def placed(self, echoes: EchoPlaces, with_seen: bool) -> PlacedPoints:
        """Return the points of echoes.

        Args:
            echoes: of a block.
            with_seen: whether the arrays that tell where each point was seen are filled in; else they are empty.

        Raises:
            IndexError: a pulse, a hit or a face isn't there.
        """
        e, count = echoes, len(echoes.pulse)
        hits, pulses, faces = len(e.face), len(e.time), len(e.planes)
        begin = e.begin if e.begin is None else _as(np.float64, (3, hits), begin=e.begin)[0]
        of_hits: list[AnyArray | None] = [
            *_as(np.int64, (count,), pulse=e.pulse, hit=e.hit),
            *_as(np.float64, (count,), range=e.range),
            *_as(np.int64, (hits,), face=e.face),
            *_as(np.float64, (hits,), cosine=e.cosine, distance=e.distance),
            *_as(np.float64, (3, hits), direction=e.direction),
            begin,
        ]
        vectors = {name: getattr(e, name) for name in ("origin", "measured_origin", "measured_direction")}
        of_pulses = [
            *_as(np.float64, (pulses,), time=e.time, scan_angle=e.scan_angle),
            *_as(np.float64, (3, pulses), **vectors),
        ]
        (planes,) = _as(np.float64, (faces, 4), planes=e.planes)
        of_faces = [
            *_as(np.uint8, e.class_id.shape, class_id=e.class_id),
            *_as(np.uint32, e.class_id.shape, instance_id=e.instance_id),
            *_as(np.uint16, e.class_id.shape, material=e.material),
        ]
        if len(e.class_id) < faces:
            raise ValueError(f"class_id {e.class_id.shape}: must be of {faces} faces")
        native_echoes = _Echoes(
            *(None if array is None else array.ctypes.data for array in of_hits),
            *(hits, *(array.ctypes.data for array in of_pulses)),
            *(pulses, planes.ctypes.data, faces, *(array.ctypes.data for array in of_faces)),
            (ctypes.c_double * 3)(*e.map_origin),
            e.epoch,
        )
        seen_count = count if with_seen else 0
        points = PlacedPoints(
            *(np.empty((count, 3)), np.empty(count), np.empty(count, np.float32)),
            *(np.empty(count, np.uint8), np.empty(count, np.uint32), np.empty(count, np.uint16)),
            *(np.empty((seen_count, 3)), np.empty((seen_count, 3)), np.empty((seen_count, 3))),
            *(np.empty((seen_count, 3), np.float32), np.empty(seen_count)),
        )
        addresses = [array.ctypes.data if len(array) else None for array in points]
        if not self._functions["place"](count, ctypes.byref(native_echoes), ctypes.byref(_Placed(*addresses))):
            raise IndexError(f"a pulse of {pulses}, a hit of {hits} or a face of {faces} isn't there")
        return points

    def facing(self, normal: Float, position: Float, direction: Float, clearance: float) -> tuple[Bool, Float]:
        """Return a mask (N,) of the normals that face a direction, and places (3, N) a little off the surfaces.

        Args:
            normal: (N, 3) unit vectors.
            position: (N, 3) on the surfaces, m.
            direction: (3,) unit vector.
            clearance: how far off, along the normals, the places are, m.
        """
        count = len(normal)
        normal, position = _as(np.float64, (count, 3), normal=normal, position=position)
        (direction,) = _as(np.float64, (3,), direction=direction)
        facing, begin = np.empty(count, np.bool_), np.empty((3, count))
        arrays = (normal, position, direction)
        self._functions["face_sun"](
            count, *(array.ctypes.data for array in arrays), clearance, facing.ctypes.data, begin.ctypes.data
        )
        return facing, begin

    def candidate_nodes(self, places: Sequence[Float], nodes: Sequence[Float], spacing: float) -> tuple[Int, Int]:
        """Return the points and nodes (C,) of pairs, sorted by point, of which one is next to the point's foot.

        See `road.alignment`.

        Args:
            places: x and y (N,) of the points.
            nodes: x and y (M,), M > 0.
            spacing: between two nodes at most, m.
        """
        x, y = _as(np.float64, (len(places[0]),), x=places[0], y=places[1])
        node_x, node_y = _as(np.float64, (len(nodes[0]),), node_x=nodes[0], node_y=nodes[1])
        middle, square = np.array([node_x.mean(), node_y.mean()]), np.empty(len(node_x))
        owner, column = np.empty((2, len(x) * ((len(node_x) + 1) // 2)), np.int64)
        addresses = [array.ctypes.data for array in (x, y, node_x, node_y, middle, square, owner, column)]
        count = self._functions["candidates"](
            *(len(x), *addresses[:2], len(node_x), *addresses[2:5], spacing, *addresses[5:])
        )
        return owner[:count], column[:count]

    def find_feet(
        self,
        evaluate: Callable[[Float], tuple[Float, ...]],
        places: Sequence[Float],
        brackets: Sequence[Float],
        most_iterations: int,
    ) -> tuple[Float, Float, Float]:
        """Return the feet of points on an alignment: stations (N,), what remains along it (N,), and offsets (N,), m.

        See `road.alignment.Alignment`.

        Args:
            evaluate: gives x, y, heading and curvature (K,) at stations (K,).
            places: x and y (N,).
            brackets: first guesses of the stations, and the least and largest that they may be, (N,) each.
            most_iterations: steps of the iteration at most.
        """
        count = len(places[0])
        x, y = _as(np.float64, (count,), x=places[0], y=places[1])
        station, least_station, largest_station = (np.array(array, np.float64) for array in brackets)
        _as(np.float64, (count,), station=station, low=least_station, high=largest_station)
        remainder, offset, active, active_count = np.empty(count), np.empty(count), np.arange(count), count
        for _ in range(most_iterations):
            px, py, heading, bend = (np.ascontiguousarray(array) for array in evaluate(station[active[:active_count]]))
            cosine, sine, turn, lever = np.cos(heading), np.sin(heading), np.empty(active_count), np.empty(active_count)
            arrays = (
                x,
                y,
                station,
                least_station,
                largest_station,
                remainder,
                offset,
                active,
                px,
                py,
                cosine,
                sine,
                bend,
                turn,
                lever,
            )
            native_feet = _Feet(*(array.ctypes.data for array in arrays))
            self._functions["measure"](active_count, ctypes.byref(native_feet))
            angle = np.arctan2(turn, lever)
            active_count = self._functions["step"](active_count, ctypes.byref(native_feet), angle.ctypes.data)
            if not active_count:
                break
        return station, remainder, offset

    def face_columns(self, faces: Faces, grid: ColumnGrid, most_faces: int) -> tuple[AnyArray, AnyArray]:
        """Return the faces that may touch each cell of a grid: indices (C + 1,) into a list of faces, and this list.

        The faces of cell i are ``numbers[starts[i]:starts[i + 1]]``.

        Args:
            faces: T of them.
            grid: across a direction.
            most_faces: of a cell, 255 at most: where there are more none is listed.
        """
        vertices, triangles, _ = _faces(faces)
        if most_faces > np.iinfo(np.uint8).max:
            raise ValueError(f"most {most_faces}: must be 255 or less")
        native_grid, cells = _Columns.of(grid), grid.cells[0] * grid.cells[1]
        head = (ctypes.byref(native_grid), len(triangles), vertices.ctypes.data, triangles.ctypes.data)
        starts = np.zeros(cells + 1, np.uint32)
        counts = starts[1:]
        self._functions["sort_faces"](*head, counts.ctypes.data, None, None, None)
        counts[counts > most_faces] = 0
        np.cumsum(counts, out=counts)
        numbers, fill_counts = np.empty(int(starts[-1]), np.int32), np.zeros(cells, np.uint8)
        self._functions["sort_faces"](*head, None, *(array.ctypes.data for array in (starts, fill_counts, numbers)))
        return starts, numbers

    def clear_places(
        self, places: Float, faces: Faces, grid: ColumnGrid, column_faces: tuple[AnyArray, AnyArray]
    ) -> Bool:
        """Return a mask (N,) of places (3, N), m, that no face listed in their cell hides from the grid's direction.

        Args:
            places: (3, N).
            faces, grid: as they were for `face_columns`.
            column_faces: what that returned.
        """
        count = places.shape[1]
        (places,) = _as(np.float64, (3, count), places=places)
        (starts,) = _as(np.uint32, (grid.cells[0] * grid.cells[1] + 1,), starts=column_faces[0])
        (numbers,) = _as(np.int32, (int(starts[-1]),), numbers=column_faces[1])
        native_grid, result = _Columns.of(grid), np.empty(count, np.bool_)
        arrays = (places, *_faces(faces), starts, numbers, result)
        self._functions["clear"](ctypes.byref(native_grid), count, *(array.ctypes.data for array in arrays))
        return result

    def pack(self, record: AnyArray, points: PackedPoints) -> tuple[Float, Int] | None:
        """Fill in LAS records (N,) of point format 7, without extra bytes; None where a value or a type doesn't fit.

        Args:
            record: C-contiguous; the first 36 bytes of each are filled in.
            points: what is stored.

        Returns:
            the least and the largest coordinates (2, 3) as stored, and how many points have each return number (16,).
        """
        count = len(record)
        arrays: list[AnyArray] = [points.xyz, points.intensity, points.gps_time, points.rgb, points.return_number]
        arrays += [points.number_of_returns, points.class_id, points.codes, points.scan_angle_deg, points.strip]
        shapes = ((count, 3), (count,), (count,), (count, 3), *[(count,)] * 3, points.codes.shape, (count,), (count,))
        kinds = [*[np.float64] * 3, np.uint16, *[np.uint8] * 4, np.float32, np.uint16]
        if any(
            array.dtype != kind or array.shape != shape or not array.flags.c_contiguous
            for array, kind, shape in zip(arrays, kinds, shapes, strict=True)
        ):
            return None
        if not record.flags.c_contiguous or record.itemsize < _RECORD:
            raise ValueError(f"records of {record.itemsize} bytes")
        native_points = _Records(
            *(array.ctypes.data for array in arrays),
            (ctypes.c_double * 3)(*points.offset),
            *(points.per_metre, points.per_intensity, points.per_degree, len(points.codes)),
        )
        extremes, by_return = np.array([[np.inf] * 3, [-np.inf] * 3]), np.zeros(16, np.int64)
        output_addresses = (record.ctypes.data, extremes.ctypes.data, by_return.ctypes.data)
        fits = self._functions["pack"](count, ctypes.byref(native_points), record.itemsize, *output_addresses)
        return (extremes, by_return) if fits else None

    def evaluate_pieces(self, station: Float, pieces: Sequence[Float]) -> Float:
        """Return x, y, heading and curvature (4, N) at stations (N,) on the P pieces of an alignment.

        Args:
            station: m.
            pieces: their borders (P - 1,), ascending; middles, half lengths, bends, slopes and headings (P,); and
                the series (T + 1, P) of x and y.
        """
        arrays = [np.ascontiguousarray(item, np.float64) for item in (station, *pieces)]
        station, borders, *columns, series_x, series_y = arrays
        terms, count = len(series_x) - 1, len(columns[0])
        if len(borders) != count - 1 or any(item.shape != (count,) for item in columns) or len(columns) != 5:
            raise ValueError(f"pieces {[item.shape for item in arrays[1:]]}")
        if series_x.shape != (terms + 1, count) or series_y.shape != series_x.shape:
            raise ValueError(f"series {series_x.shape}, {series_y.shape}: ({terms + 1}, {count})")
        native_pieces = _Pieces(*(item.ctypes.data for item in arrays[1:]), count, terms)
        result = np.empty((4, len(station)))
        self._functions["evaluate"](len(station), station.ctypes.data, ctypes.byref(native_pieces), result.ctypes.data)
        return result


@cache
def usable_points() -> CompiledPoints | NoKernelError:
    """Return the compiled loops, or why this machine has none; found out once."""
    try:
        return CompiledPoints()
    except NoKernelError as error:
        return error
