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
    """Echoes and their pulses; as `Echoes` in points.c."""

    _fields_ = (
        *((name, _POINTER) for name in ("pulse", "hit", "range", "face", "along", "distance", "direction", "begin")),
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
        """Return a grid for C."""
        axes, low, direction = (np.ravel(one).tolist() for one in (grid.axes, grid.low, grid.direction))
        return cls(
            *((ctypes.c_double * 6)(*axes), (ctypes.c_double * 2)(*low), (_INT64 * 2)(*grid.cells), grid.margin),
            *((ctypes.c_double * 3)(*direction), grid.above),
        )


def _as(kind: Any, shape: tuple[int, ...], **arrays: AnyArray) -> list[AnyArray]:
    """Return arrays of this shape, C-contiguous and of this type; raise ValueError for another shape."""
    for name, array in arrays.items():
        if array.shape != shape:
            raise ValueError(f"{name} {array.shape}: must be {shape}")
    return [np.ascontiguousarray(array, kind) for array in arrays.values()]


def _faces(faces: Faces) -> tuple[AnyArray, ...]:
    """Return vertices, triangles and planes for C."""
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
        self, rows: Index | None, own: Float32 | None, material: UInt16, varies: Bool, means: Float32
    ) -> Float32 | None:
        """Return a layer's values (K, ...) at rows (K,) of points; None where rows or materials aren't there.

        Args:
            rows: of the points; None for all of them.
            own: (N, C) of the points, for materials that vary; None where none does.
            material: (N,) of the points.
            varies: (M,) whether a material does.
            means: (M, C) or (M,) of the materials.
        """
        kinds, width = len(means), means.size // max(1, len(means))
        chosen = len(material) if rows is None else len(rows)
        if not chosen:
            return np.empty((0, *means.shape[1:]), np.float32)
        if int(material.max()) >= kinds or not (rows is None or (rows.min() >= 0 and rows.max() < len(material))):
            return None
        (varies,), (material,) = _as(np.bool_, (kinds,), varies=varies), _as(np.uint16, material.shape, all=material)
        rows = None if rows is None else np.ascontiguousarray(rows, np.int64)
        means = np.ascontiguousarray(means, np.float32)
        values = None if own is None else _as(np.float32, (len(material), width), own=own)[0]
        result = np.empty((chosen, *means.shape[1:]), np.float32)
        rows_at, values_at = (None if array is None else array.ctypes.data for array in (rows, values))
        self._functions["layer"](
            *(chosen, rows_at, width, values_at),
            *(array.ctypes.data for array in (material, varies, means, result)),
        )
        return result

    def halves(self, normal: Float32, view: Float32, sun: Float32) -> tuple[Float32, Float32, Float32]:
        """Return cosines (N,) of the view, of the half vector to the normal, both cut, and of it to the view."""
        count = len(normal)
        normal, view = _as(np.float32, (count, 3), normal=normal, view=view)
        (sun,) = _as(np.float32, (3,), sun=sun)
        seen, across, between = np.empty((3, count), np.float32)
        arrays = (normal, view, sun, seen, across, between)
        self._functions["halves"](count, *(array.ctypes.data for array in arrays))
        return seen, across, between

    def reflected(self, tables: Sequence[AnyArray], limits: Sequence[float], surfaces: Sequence[Float32]) -> Float32:
        """Return what surfaces throw back (N, 3).

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
        first, scale = ((ctypes.c_float * 3)(*limits[part:6:2]) for part in (0, 1))
        count = len(surfaces[0])
        (color,) = _as(np.float32, (count, 3), color=surfaces[0])
        rest = [_as(np.float32, (count,), surfaces=array)[0] for array in surfaces[1:]]
        told = _Tables(
            *(table.ctypes.data for table in (once, albedo, average)), *albedo.shape, first, scale, *limits[6:]
        )
        if once.shape != albedo.shape[:2] or average.shape != once.shape[:1] or len(rest) != 9:
            raise ValueError(f"tables {once.shape}, {albedo.shape}, {average.shape}, {len(rest)} values")
        result = np.empty((count, 3), np.float32)
        addresses = (_POINTER * 10)(*(array.ctypes.data for array in (color, *rest)))
        if self._functions["reflected"](count, ctypes.byref(told), addresses, result.ctypes.data):
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
        """Write values between corners into rows (K,) of a result (N, 4); return False where the types are others.

        The rows, the uses and the triangles must be there: only the types are looked at.
        """
        kinds = (np.int64, np.int64, np.int64, np.int32, np.bool_, np.float64, np.float32, np.float32)
        arrays: tuple[AnyArray, ...] = (rows, use, triangle, elements, mirrored, shares, values, result)
        if any(one.dtype != kind or not one.flags.c_contiguous for one, kind in zip(arrays, kinds, strict=True)):
            return False
        self._functions["interpolate"](len(rows), *(array.ctypes.data for array in arrays))
        return True

    def raised(
        self, height: Float, cosine: Float, normal: Float32, place: Float, distance: Float
    ) -> tuple[Float, Float]:
        """Return places (N, 3) and ranges (N,) shifted along normals (N, 3) by heights (N,), 0 for those that stay."""
        count = len(height)
        height, cosine, distance = _as(np.float64, (count,), height=height, cosine=cosine, distance=distance)
        (normal,), (place,) = _as(np.float32, (count, 3), normal=normal), _as(np.float64, (count, 3), place=place)
        moved, after = np.empty((count, 3)), np.empty(count)
        arrays = (height, cosine, normal, place, distance, moved, after)
        self._functions["raise"](count, *(array.ctypes.data for array in arrays))
        return moved, after

    def approached(
        self,
        rough: Index,
        height: Float,
        cosine: Float,
        material: UInt16,
        reach: Float,
        towards: Float32,
        place: Float,
        distance: Float,
    ) -> tuple[Float, Float]:
        """Return places (N, 3) and ranges (N,) of which rows ``rough`` (K,) are nearer along their beams by heights.

        Args:
            rough: (K,) ascending.
            height, cosine: (K,) heights of the relief, m, and cosines of the incidence angles.
            material: (N,) indices; of rough ones there is a reach.
            reach: (M,) by material, within which a beam that grazes the relief meets some peak, m.
            towards: (N, 3) unit vectors to the scanner.
            place, distance: (N, 3), (N,) m.
        """
        chosen, count = len(rough), len(distance)
        height, cosine = _as(np.float64, (chosen,), height=height, cosine=cosine)
        (rough,), (reach,) = _as(np.int64, (chosen,), rough=rough), _as(np.float64, (len(reach),), reach=reach)
        (material,), (distance,) = (
            _as(np.uint16, (count,), material=material),
            _as(np.float64, (count,), range=distance),
        )
        (towards,), (place,) = _as(np.float32, (count, 3), towards=towards), _as(np.float64, (count, 3), place=place)
        moved, after = np.empty((count, 3)), np.empty(count)
        arrays = (rough, height, cosine, material, reach, towards, place, distance, moved, after)
        self._functions["approach"](count, chosen, *(array.ctypes.data for array in arrays))
        return moved, after

    def daylight(self, sun: Float32, color: Float32, normal: Float32, above: Float32, below: Float32) -> Float32:
        """Return the light (N, 3), cut to 0 to 1, of the sun (N, 3) and what surfaces throw back of an even sky.

        Args:
            sun: thrown back of it.
            color, normal: (N, 3) of the surfaces.
            above, below: (3,) light on a surface that faces straight up, and down.
        """
        sun, color, normal = _as(np.float32, (len(sun), 3), sun=sun, color=color, normal=normal)
        above, below = _as(np.float32, (3,), above=above, below=below)
        result = np.empty(sun.shape, np.float32)
        arrays = (sun, color, normal, above, below, result)
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
        """Return vectors (K, 3) of rows (K,) of others (N, 3) as (K, 4), the last 0; with a shift (3,), in a unit.

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

    def placed(self, echoes: EchoPlaces, seen: bool) -> PlacedPoints:
        """Return the points of echoes; what is known of the places where they were seen only if asked, else empty.

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
            *_as(np.float64, (hits,), along=e.along, distance=e.distance),
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
        told = _Echoes(
            *(None if one is None else one.ctypes.data for one in of_hits),
            *(hits, *(one.ctypes.data for one in of_pulses)),
            *(pulses, planes.ctypes.data, faces, *(one.ctypes.data for one in of_faces)),
            (ctypes.c_double * 3)(*e.map_origin),
            e.epoch,
        )
        known = count if seen else 0
        placed = PlacedPoints(
            *(np.empty((count, 3)), np.empty(count), np.empty(count, np.float32)),
            *(np.empty(count, np.uint8), np.empty(count, np.uint32), np.empty(count, np.uint16)),
            *(np.empty((known, 3)), np.empty((known, 3)), np.empty((known, 3))),
            *(np.empty((known, 3), np.float32), np.empty(known)),
        )
        addresses = [one.ctypes.data if len(one) else None for one in placed]
        if not self._functions["place"](count, ctypes.byref(told), ctypes.byref(_Placed(*addresses))):
            raise IndexError(f"a pulse of {pulses}, a hit of {hits} or a face of {faces} isn't there")
        return placed

    def facing(self, normal: Float, position: Float, direction: Float, off: float) -> tuple[Bool, Float]:
        """Return which normals (N, 3) face a direction (3,), and the places (3, N) so far (m) off positions (N, 3)."""
        count = len(normal)
        normal, position = _as(np.float64, (count, 3), normal=normal, position=position)
        (direction,) = _as(np.float64, (3,), direction=direction)
        facing, begin = np.empty(count, np.bool_), np.empty((3, count))
        arrays = (normal, position, direction)
        self._functions["face_sun"](
            count, *(one.ctypes.data for one in arrays), off, facing.ctypes.data, begin.ctypes.data
        )
        return facing, begin

    def candidate_nodes(self, places: Sequence[Float], nodes: Sequence[Float], spacing: float) -> tuple[Int, Int]:
        """Return (point, node) index pairs, sorted by point, see `road.alignment`.

        Args:
            places: x and y (N,).
            nodes: x and y (M,), M > 0.
            spacing: between two nodes at most, m.
        """
        x, y = _as(np.float64, (len(places[0]),), x=places[0], y=places[1])
        node_x, node_y = _as(np.float64, (len(nodes[0]),), node_x=nodes[0], node_y=nodes[1])
        middle, square = np.array([node_x.mean(), node_y.mean()]), np.empty(len(node_x))
        owner, column = np.empty((2, len(x) * ((len(node_x) + 1) // 2)), np.int64)
        addresses = [one.ctypes.data for one in (x, y, node_x, node_y, middle, square, owner, column)]
        count = self._functions["candidates"](
            *(len(x), *addresses[:2], len(node_x), *addresses[2:5], spacing, *addresses[5:])
        )
        return owner[:count], column[:count]

    def find_feet(
        self,
        evaluate: Callable[[Float], tuple[Float, ...]],
        places: Sequence[Float],
        brackets: Sequence[Float],
        most: int,
    ) -> tuple[Float, Float, Float]:
        """Return the feet of points on an alignment, see `road.alignment.Alignment`: stations, rests and offsets (N,).

        Args:
            evaluate: gives x, y, heading and curvature (K,) at stations (K,).
            places: x and y (N,).
            brackets: first guesses of the stations, and the least and largest that they may be, (N,) each.
            most: iterations.
        """
        count = len(places[0])
        x, y = _as(np.float64, (count,), x=places[0], y=places[1])
        station, low, high = (np.array(one, np.float64) for one in brackets)
        _as(np.float64, (count,), station=station, low=low, high=high)
        along, offset, active, left = np.empty(count), np.empty(count), np.arange(count), count
        for _ in range(most):
            px, py, heading, bend = (np.ascontiguousarray(one) for one in evaluate(station[active[:left]]))
            cosine, sine, turn, lever = np.cos(heading), np.sin(heading), np.empty(left), np.empty(left)
            arrays = (x, y, station, low, high, along, offset, active, px, py, cosine, sine, bend, turn, lever)
            told = _Feet(*(one.ctypes.data for one in arrays))
            self._functions["measure"](left, ctypes.byref(told))
            angle = np.arctan2(turn, lever)
            left = self._functions["step"](left, ctypes.byref(told), angle.ctypes.data)
            if not left:
                break
        return station, along, offset

    def face_columns(self, faces: Faces, grid: ColumnGrid, most: int) -> tuple[AnyArray, AnyArray]:
        """Return the faces of each cell of a grid that they may touch: where they begin (C + 1,), and their numbers.

        Args:
            faces: T of them.
            grid: across a direction.
            most: faces of a cell, 255 at most: where there are more none is listed.
        """
        vertices, triangles, _ = _faces(faces)
        if most > np.iinfo(np.uint8).max:
            raise ValueError(f"most {most}: must be 255 or less")
        told, cells = _Columns.of(grid), grid.cells[0] * grid.cells[1]
        head = (ctypes.byref(told), len(triangles), vertices.ctypes.data, triangles.ctypes.data)
        starts = np.zeros(cells + 1, np.uint32)
        counts = starts[1:]
        self._functions["sort_faces"](*head, counts.ctypes.data, None, None, None)
        counts[counts > most] = 0
        np.cumsum(counts, out=counts)
        numbers, filled = np.empty(int(starts[-1]), np.int32), np.zeros(cells, np.uint8)
        self._functions["sort_faces"](*head, None, *(one.ctypes.data for one in (starts, filled, numbers)))
        return starts, numbers

    def clear_places(self, places: Float, faces: Faces, grid: ColumnGrid, listed: tuple[AnyArray, AnyArray]) -> Bool:
        """Return a mask (N,) of places (3, N), m, that no face listed in their cell hides from the grid's direction.

        Args:
            places: (3, N).
            faces, grid: as they were for `face_columns`.
            listed: what that returned.
        """
        count = places.shape[1]
        (places,) = _as(np.float64, (3, count), places=places)
        (starts,) = _as(np.uint32, (grid.cells[0] * grid.cells[1] + 1,), starts=listed[0])
        (numbers,) = _as(np.int32, (int(starts[-1]),), numbers=listed[1])
        told, result = _Columns.of(grid), np.empty(count, np.bool_)
        arrays = (places, *_faces(faces), starts, numbers, result)
        self._functions["clear"](ctypes.byref(told), count, *(one.ctypes.data for one in arrays))
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
            one.dtype != kind or one.shape != shape or not one.flags.c_contiguous
            for one, kind, shape in zip(arrays, kinds, shapes, strict=True)
        ):
            return None
        if not record.flags.c_contiguous or record.itemsize < _RECORD:
            raise ValueError(f"records of {record.itemsize} bytes")
        told = _Records(
            *(one.ctypes.data for one in arrays),
            (ctypes.c_double * 3)(*points.offset),
            *(points.per_metre, points.per_intensity, points.per_degree, len(points.codes)),
        )
        extremes, by_return = np.array([[np.inf] * 3, [-np.inf] * 3]), np.zeros(16, np.int64)
        filled = (record.ctypes.data, extremes.ctypes.data, by_return.ctypes.data)
        fits = self._functions["pack"](count, ctypes.byref(told), record.itemsize, *filled)
        return (extremes, by_return) if fits else None

    def evaluate_pieces(self, station: Float, pieces: Sequence[Float]) -> Float:
        """Return x, y, heading and curvature (4, N) at stations (N,) on P pieces of an alignment.

        Args:
            station: m.
            pieces: their borders (P - 1,), ascending; middles, half lengths, bends, slopes and headings (P,); and
                the series (T + 1, P) of x and y.
        """
        kept = [np.ascontiguousarray(array, np.float64) for array in (station, *pieces)]
        station, borders, *columns, series_x, series_y = kept
        terms, count = len(series_x) - 1, len(columns[0])
        if len(borders) != count - 1 or any(one.shape != (count,) for one in columns) or len(columns) != 5:
            raise ValueError(f"pieces {[one.shape for one in kept[1:]]}")
        if series_x.shape != (terms + 1, count) or series_y.shape != series_x.shape:
            raise ValueError(f"series {series_x.shape}, {series_y.shape}: ({terms + 1}, {count})")
        told = _Pieces(*(array.ctypes.data for array in kept[1:]), count, terms)
        result = np.empty((4, len(station)))
        self._functions["evaluate"](len(station), station.ctypes.data, ctypes.byref(told), result.ctypes.data)
        return result


@cache
def usable_points() -> CompiledPoints | NoKernelError:
    """Return the compiled loops, or why this machine has none; found out once."""
    try:
        return CompiledPoints()
    except NoKernelError as error:
        return error
