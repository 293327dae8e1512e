"""Lines of vector files of geographic information systems: GeoPackage, shapefile, FlatGeobuf, by pyogrio (GDAL).

GDAL knows some eighty formats, of which some start programs, follow addresses, or call the network. So a file is told
by its content first, opened as one of the three alone, and refused if GDAL took it for another. OGC 12-128r18
(GeoPackage), ESRI's "Shapefile Technical Description", OGC 06-103r4 (well-known binary).
"""

from __future__ import annotations

import re
import struct
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import Float
from ..base.errors import InputError, MissingFileError, MissingPackageError
from ..base.remarks import warn
from .line import LineNames
from .points import PointLine
from .xml_text import check_size, on_one_line

DRIVERS = {"GeoPackage": "GPKG", "shapefile": "ESRI Shapefile", "FlatGeobuf": "FlatGeobuf"}
"""GDAL's name of each format."""
_NAMES = ("name", "ref", "label", "bezeichnung", "road", "strasse", "id")
"""Fields that name a line, in any case, the first that a layer has."""
_LINE, _MULTI_LINE = 2, 5
_ENDING = "non conformant file extension"
"""GDAL's words on content that has no name."""
_JOINED = 1e-3
"""Parts of a line that meet within this, in units of the file, are one."""
_MOST_LINES = 100_000
_LARGEST = 1e9
"""Largest coordinate."""


def vector_format(head: bytes) -> str | None:
    """Return the format, a key of `DRIVERS`, of a file by its first bytes (72 at least); None for another."""
    if head.startswith(b"SQLite format 3\0") and head[68:72] in (b"GPKG", b"GP10", b"GP11"):
        return "GeoPackage"
    if head.startswith(b"fgb\x03fgb"):
        return "FlatGeobuf"
    if len(head) >= 32 and head.startswith(b"\x00\x00\x27\x0a") and head[28:32] == b"\xe8\x03\x00\x00":
        return "shapefile"
    return None


def read_vector(path: Path, kind: str) -> list[PointLine]:
    """Return the lines of a file's layers; a name has its layer before it where there are several.

    Lines of several parts are one where each begins where the one before ends; others have a `fault`. Z is the height
    unless it is 0 everywhere; M is left aside.

    Raises:
        MissingFileError, InputError: the file can't be read, or a coordinate is no number.
        MissingPackageError: pyogrio isn't installed.
    """
    try:
        import pyogrio
    except ModuleNotFoundError:
        raise MissingPackageError(path.name, kind, "pyogrio", "maps") from None
    lines, names = list[PointLine](), LineNames()
    with _errors_on_one_line(path, kind):
        check_size(path)
        # By its content alone: GDAL reads more than a file into names, and would look for others beside it.
        source = path.resolve() if kind == "shapefile" else BytesIO(path.read_bytes())
        _check_parts(path, kind)
        layers = [str(layer) for layer, geometry in pyogrio.list_layers(source).tolist() if _may_hold_lines(geometry)]
        for layer in layers:
            prefix = f"{layer}: " if len(layers) > 1 else ""
            for name, line in _lines_of(path, source, layer, kind):
                lines.append(replace(line, name=names.unique(name and prefix + name, prefix + "line")))
                if len(lines) > _MOST_LINES:
                    raise InputError(
                        path.name,
                        None,
                        f"must have at most {_MOST_LINES:,} lines: save those that you need in a file of their own",
                    )
    return lines


@contextmanager
def _errors_on_one_line(path: Path, kind: str) -> Iterator[None]:
    """Context that turns GDAL's warnings on a file into remarks, and its errors into ours, each on one line."""
    # With the library itself, which is an extra.
    from pyogrio.errors import DataLayerError, DataSourceError, FeatureError, FieldError, GeometryError

    try:
        with warnings.catch_warnings(record=True) as records:
            warnings.simplefilter("always")
            yield
        for text in sorted({_one_line(warning.message) for warning in records}):
            if _ENDING not in text:
                warn("%s: %s", path.name, text)
    except OSError as error:
        raise MissingFileError(str(path), None, f"cannot be read ({error.strerror})") from None
    except (DataLayerError, DataSourceError, FeatureError, FieldError, GeometryError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(path.name, None, f"must be a valid {kind} ({_one_line(error)})") from None


def _one_line(message: object) -> str:
    """Return a message of GDAL on one line, without the name that GDAL gives to content in memory."""
    return on_one_line(re.sub(r"/vsimem/\S*", "the file", str(message)))[:200]


def _check_parts(path: Path, kind: str) -> None:
    """Raise an error where a shapefile's name doesn't end in .shp, or a file that belongs to it is missing."""
    if kind != "shapefile":
        return
    if path.suffix.lower() != ".shp":
        raise InputError(
            path.name, path.suffix, "a shapefile's name must end in .shp, as its other parts have its name"
        )
    for ending in (".shx", ".dbf"):
        if not any(path.with_suffix(form).is_file() for form in (ending, ending.upper())):
            raise InputError(path.name, ending, "is missing: this part of the shapefile must be in the same folder")


def _may_hold_lines(geometry: object) -> bool:
    """Return whether a layer of a geometry type (a text of GDAL, None without any) may hold lines."""
    return geometry is not None and any(word in str(geometry) for word in ("Line", "Unknown", "Geometry"))


def _lines_of(path: Path, source: Any, layer: str, kind: str) -> Iterator[tuple[str | None, PointLine]]:
    """Yield the name and the line of each feature of a layer that is a line."""
    import pyogrio  # an extra

    info = pyogrio.read_info(source, layer=layer)
    if info["driver"] != DRIVERS[kind]:
        raise InputError(path.name, info["driver"], f"must be {DRIVERS[kind]}")
    by_case = {str(field).lower(): str(field) for field in info["fields"]}
    field = next((by_case[name] for name in _NAMES if name in by_case), None)
    metadata, feature_ids, geometries, values = pyogrio.raw.read(
        source, layer=layer, columns=[field] if field else [], return_fids=True, max_features=_MOST_LINES + 1
    )
    system = metadata["crs"]
    for row, geometry in enumerate([] if geometries is None else geometries):
        field_value = None if not field else values[0][row]
        feature_id = row + 1 if feature_ids is None else int(feature_ids[row])
        has_name = field_value is not None and str(field_value).strip() not in ("", "nan")
        name = on_one_line(str(field_value)) if has_name else f"line {feature_id}"
        for coordinates, fault in _line_of(f"{path.name}: {name}", geometry):
            is_flat = not (coordinates.shape[1] > 2 and coordinates[:, 2].any())
            points = np.column_stack([coordinates[:, :2], np.zeros(len(coordinates)) if is_flat else coordinates[:, 2]])
            yield name, PointLine("", points, not is_flat, f"{kind} line", system=system, fault=fault)


def _line_of(place: str, shape: bytes | None) -> Iterator[tuple[Float, InputError | None]]:
    """Yield the points (N, 2 or 3) of a line in well-known binary and its fault; nothing for another geometry."""
    if shape is None:
        return
    parts = [part for part in _parts(place, bytes(shape)) if len(part) > 1]
    if not parts:
        return
    joined_parts = [parts[0]]
    for part in parts[1:]:
        if np.abs(part[0, :2] - joined_parts[-1][-1, :2]).max() > _JOINED:
            fault = InputError("parts", len(parts), "must be one line, or parts that begin where another part ends")
            yield parts[0], fault
            return
        joined_parts.append(part[1:])
    yield np.concatenate(joined_parts), None


def _parts(place: str, data: bytes) -> list[Float]:
    """Return the parts (N, 2 or 3) of a line in well-known binary; an empty list for another geometry."""
    try:
        kind, has_z, has_m, offset, order = _head(data, 0)
        if kind == _LINE:
            return [_points(place, data, offset, order, has_z, has_m)[0]]
        if kind != _MULTI_LINE:
            return []
        (count,) = struct.unpack_from(order + "I", data, offset)
        offset, parts = offset + 4, []
        for _ in range(count):
            _, has_z, has_m, offset, order = _head(data, offset)
            points, offset = _points(place, data, offset, order, has_z, has_m)
            parts.append(points)
        return parts
    except (struct.error, ValueError, IndexError):
        raise InputError(place, None, "must be a line in well-known binary") from None


class _Head(NamedTuple):
    """A geometry's kind, whether it has Z and M, the offset of its content, and its byte order as in `struct`."""

    kind: int
    has_z: bool
    has_m: bool
    offset: int
    order: str


def _head(data: bytes, offset: int) -> _Head:
    """Return the head of the geometry in well-known binary at an offset of the data."""
    order = "<" if data[offset] == 1 else ">"
    (code,) = struct.unpack_from(order + "I", data, offset + 1)
    if code & 0xE0000000:  # extended well-known binary, as PostGIS has it: flags for Z and M
        return _Head(code & 0xFF, bool(code & 0x80000000), bool(code & 0x40000000), offset + 5, order)
    return _Head(code % 1000, code // 1000 in (1, 3), code // 1000 in (2, 3), offset + 5, order)


def _points(place: str, data: bytes, begin: int, order: str, has_z: bool, has_m: bool) -> tuple[Float, int]:
    """Return the points (N, 2 or 3) of a part at an offset of the data, and the offset of its end."""
    (count,) = struct.unpack_from(order + "I", data, begin)
    column_count = 2 + has_z + has_m
    numbers = np.frombuffer(data, dtype=order + "f8", count=count * column_count, offset=begin + 4)
    points: Float = numbers.reshape(count, column_count)[:, : 2 + has_z].astype(np.float64)
    if not (np.abs(points) <= _LARGEST).all():
        row = int((~(np.abs(points) <= _LARGEST)).any(axis=1).argmax())
        raise InputError(
            f"{place}: point {row + 1}", points[row].tolist(), f"must be finite numbers up to {_LARGEST:g}"
        )
    return points, begin + 4 + 8 * count * column_count
