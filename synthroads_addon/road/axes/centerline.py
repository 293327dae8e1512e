"""Centrelines in files: a road's as GeoJSON in map coordinates, and a measured axis from CSV or GeoJSON.

Every fault of a file that is read is one line that names the file, the line and the value.
"""

import csv
import json
import math
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np

from ...base.arrays import Float
from ...base.errors import InputError
from ...base.files import read_text
from ...base.maps.crs import MapSystem, UnknownSystemError
from ...base.maps.places import Placement, bring, geojson_system
from ..geometry import RoadGeometry

FARTHEST = 1e8
"""Largest coordinate of a map, m: the reach of `RoadScenario.map_origin`."""
_LONGEST_STEP = 20_000.0
_LONG_STEP, _SHARPEST = 500.0, -0.5
"""Points (m) so far apart don't lie in a bend, least of all one by more than 120 degrees (its cosine)."""
_MOST_DIGITS = 10
_NAMED = re.compile(r"#\s*(?:(?:crs|srs)\s*[:=]\s*)?((?:EPSG|ESRI|OGC|urn:ogc:def:crs)[:,]\S+)", re.IGNORECASE)
"""A line of CSV that names the coordinate system."""
_TWO = "at least two distinct points are needed"


def read_axis(path: str | os.PathLike[str], place: Placement | None = None) -> Float:
    """Read the points (N, 3) of an axis, m, from a CSV or GeoJSON file, in the file's order.

    CSV (comma, semicolon, tab or spaces): with a header that names at least x and y (z optional, other columns
    ignored, any order, any case), or without one as x, y and, optionally, z. Empty lines and lines that begin with #
    are skipped. GeoJSON: a LineString, alone, as a Feature, or as the only feature of a collection. Without z the
    elevation is 0. The system is that of GeoJSON's member ``crs``, of a line ``# crs: EPSG:25832`` in CSV, or of a
    .prj file beside it; see `base.maps.places.bring` for files that name none.

    Args:
        path: the file.
        place: the system that the points are wanted in: they are moved into it. Without one they stay where they are,
            and must be metres of a projected system.

    Raises:
        MissingFileError: the file doesn't exist or cannot be read.
        InputError: anything in it is not as above, there are fewer than two distinct points, a height is none, or the
            points lie outside of the system's area of use.

    Example:
        >>> from pathlib import Path
        >>> _ = Path("axis.csv").write_text("x;y;z\\n0;0;100\\n50;0;100.5\\n", encoding="utf-8")
        >>> read_axis("axis.csv").tolist()
        [[0.0, 0.0, 100.0], [50.0, 0.0, 100.5]]
    """
    return AxisContent.read(path).placed(place or Placement())


def check_axis_file(path: str | os.PathLike[str]) -> None:
    """Raise an error if a file is no axis, wherever its points lie; see `read_axis`."""
    AxisContent.read(path)


def read_declared_axis(path: str | os.PathLike[str], place: Placement | None = None) -> tuple[Float, MapSystem | None]:
    """Read the points (N, 3) of an axis, m, as `read_axis` does; return them, and the system that the file names."""
    content = AxisContent.read(path)
    return content.placed(place or Placement()), content.system


@dataclass(frozen=True)
class AxisContent:
    """Points of an axis as they stand in a file, wherever they lie.

    Attributes:
        name: of the file.
        points: (N, 3), in the file's order.
        system: that the file names; None without.
        geojson: whether it is GeoJSON.
    """

    name: str
    points: Float
    system: MapSystem | None
    geojson: bool

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Self:
        """Read an axis from a CSV or GeoJSON file; see `read_axis`.

        Raises:
            MissingFileError, InputError: it is none, or has fewer than two distinct points.
        """
        name, kind = os.fspath(path), "this is no text: CSV with columns x, y, z or GeoJSON is needed"
        text = read_text(name, kind, "must be a readable axis file", encoding="utf-8-sig")
        is_geojson = text.lstrip().startswith(("{", "["))
        rows, system = _read_json(name, text) if is_geojson else (_read_csv(name, text), csv_system(name, text))
        points = np.array(rows, dtype=np.float64).reshape(-1, 3)
        if len(np.unique(points[:, :2], axis=0)) < 2:
            raise InputError(name, None, f"{_TWO}, the file has {len(points)} points in all")
        return cls(name, points, system, is_geojson)

    def placed(self, place: Placement) -> Float:
        """Return the points (N, 3), m, moved into the map's coordinate system; see `read_axis`.

        Raises:
            InputError: they lie outside of the system's area of use, or one is implausibly far from the next.
        """
        points = bring(self.name, self.points, self.system, place, self.geojson)
        _check_spacing(self.name, points)
        return points


def _check_spacing(name: str, points: Float) -> None:
    """Raise InputError for a point (of N, 3) implausibly far from its neighbours, as if it lacked a digit."""
    steps = np.diff(points[:, :2], axis=0)
    step_lengths = np.hypot(*steps.T)
    if step_lengths.max() > _LONGEST_STEP:
        point_index = int(step_lengths.argmax())
        kilometres = step_lengths[point_index] / 1000.0
        allowed = f"is {kilometres:.0f} km from the point before, at most {_LONGEST_STEP / 1000.0:g} km"
        raise InputError(f"{name}: point {point_index + 2}", points[point_index + 1].tolist(), allowed)
    moving_steps = np.flatnonzero(step_lengths > 0.0)
    step_before, step_after = steps[moving_steps[:-1]], steps[moving_steps[1:]]
    cosine = (step_before * step_after).sum(axis=1) / (step_lengths[moving_steps[:-1]] * step_lengths[moving_steps[1:]])
    turns_back = (cosine < _SHARPEST) & (
        np.maximum(step_lengths[moving_steps[:-1]], step_lengths[moving_steps[1:]]) > _LONG_STEP
    )
    if turns_back.any():
        point_index = int(moving_steps[1:][turns_back.argmax()])
        allowed = f"the axis turns back after a step of more than {_LONG_STEP:g} m: is a digit of a point missing?"
        raise InputError(f"{name}: point {point_index + 1}", points[point_index].tolist(), allowed)


def _read_csv(name: str, text: str) -> list[tuple[float, float, float]]:
    """Return the points x, y, z of CSV text, with or without a header; InputError for what isn't such a table."""
    lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    lines = [(number, line) for number, line in lines if not line.lstrip().startswith("#")]
    if not lines:
        raise InputError(name, None, f"the file is empty: {_TWO}")
    separator = next((mark for mark in (";", ",", "\t") if mark in lines[0][1]), " ")
    first_line_entries = fields_of(lines[0][1], separator, f"{name}:{lines[0][0]}")
    columns, data_lines = [0, 1, 2], lines
    if len(first_line_entries) > 2 and all(_is_number(entry) for entry in first_line_entries):
        _refuse_counting(name, [fields_of(line, separator, name) for _, line in lines])
    if not all(_is_number(entry) for entry in first_line_entries):
        columns, data_lines = _columns(f"{name}:{lines[0][0]}", first_line_entries), lines[1:]
    elif len(first_line_entries) < 2:
        raise InputError(f"{name}:{lines[0][0]}", lines[0][1], "x, y and, optionally, z are needed")
    elif len(first_line_entries) == 2:
        columns = [0, 1]
    places = ((f"{name}:{number}", line) for number, line in data_lines)
    return [_row(place, fields_of(line, separator, place), columns) for place, line in places]


def _refuse_counting(name: str, rows: list[list[str]]) -> None:
    """Raise InputError where the first column of a file without a header counts its lines, and isn't x.

    It counts if it rises by exactly 1 and something else looks like coordinates: fractions, or a fourth column.
    """
    first_column = [row[0] if row else "" for row in rows]
    has_whole_numbers = len(rows) > 2 and all(entry.isdecimal() and len(entry) < _MOST_DIGITS for entry in first_column)
    has_fractions = any("." in entry for row in rows for entry in row[1:3])
    if (
        has_whole_numbers
        and (has_fractions or len(rows[0]) > 3)
        and set(np.diff([int(entry) for entry in first_column]).tolist()) == {1}
    ):
        allowed = "the first column counts the lines: a header that names x and y (z) is needed above them"
        raise InputError(
            f"{name}: first column", f"{first_column[0]}, {first_column[1]}, {first_column[2]} ...", allowed
        )


def csv_system(name: str, text: str | None = None) -> MapSystem | None:
    """Return the system that a line of comment names (``# crs: EPSG:25832``), or a .prj file beside; None without."""
    text = read_text(name, "CSV is needed", encoding="utf-8-sig") if text is None else text
    comments = (line.strip() for line in text.splitlines() if line.lstrip().startswith("#"))
    system_text = next((match[1] for line in comments if (match := _NAMED.fullmatch(line))), None)
    prj_path = Path(name).with_suffix(".prj")
    if system_text is None and prj_path != Path(name) and prj_path.is_file():
        name, system_text = str(prj_path), read_text(str(prj_path), "WKT is needed", encoding="utf-8-sig")
    if system_text is None:
        return None
    try:
        return MapSystem.read(system_text)
    except UnknownSystemError as problem:
        raise InputError(f"{name} crs", system_text[:80], problem.allowed) from None


def fields_of(line: str, separator: str, place: str) -> list[str]:
    """Return the entries of one line of CSV as stripped text.

    Args:
        line: the line; a record of several lines isn't known here.
        separator: between entries; a space stands for any number of them.
        place: file and number of the line, for messages.

    Raises:
        InputError: an entry is longer than any number or name.
    """
    if separator == " ":
        return line.split()
    try:
        return [entry.strip() for entry in next(csv.reader([line], delimiter=separator))]
    except csv.Error as error:
        raise InputError(place, line, f"a line of CSV is needed ({error})") from None


def _is_number(entry: str) -> bool:
    """Return whether Python reads a text as a float."""
    try:
        float(entry)
    except ValueError:
        return False
    return True


def _columns(place: str, header_entries: list[str]) -> list[int]:
    """Return the column indices of x, y and, if present, z in a header; InputError if x or y is missing or doubled."""
    names = [entry.lower() for entry in header_entries]
    for axis in ("x", "y"):
        if axis not in names:
            raise InputError(
                place, ", ".join(header_entries), f"a header with columns x, y (z optional): {axis} is missing"
            )
    for axis in ("x", "y", "z"):
        if names.count(axis) > 1:
            raise InputError(
                place, ", ".join(header_entries), f"each column once: {axis} is there {names.count(axis)} times"
            )
    return [names.index(axis) for axis in ("x", "y", "z") if axis in names]


def _row(place: str, entries: list[str], columns: list[int]) -> tuple[float, float, float]:
    """Return x, y, z from the named columns of one line; InputError if the line has fewer columns."""
    if len(entries) <= max(columns):
        allowed = f"at least {max(columns) + 1} columns are needed, this line has {len(entries)}"
        raise InputError(place, " ".join(entries), allowed)
    return _point(place, [entries[column] for column in columns])


def _point(place: str, entries: list[object]) -> tuple[float, float, float]:
    """Return x, y, z from two or three entries, z 0 without; InputError for one that isn't a finite coordinate."""
    values = []
    for axis, entry in zip("xyz", entries, strict=False):
        try:
            value = math.nan if isinstance(entry, bool) else float(entry)  # type: ignore[arg-type]
        except (TypeError, ValueError, OverflowError):
            value = math.nan
        if not abs(value) <= FARTHEST:
            raise InputError(f"{place} {axis}", entry, f"a finite number of at most {FARTHEST:g} m is needed")
        values.append(value)
    return values[0], values[1], values[2] if len(values) > 2 else 0.0


def _read_json(name: str, text: str) -> tuple[list[tuple[float, float, float]], MapSystem | None]:
    """Return the points of a GeoJSON document's one LineString, and the system that it names, None without."""
    try:
        document = json.loads(text)
    except json.JSONDecodeError as error:
        raise InputError(f"{name}:{error.lineno}", None, f"valid JSON is needed ({error.msg})") from None
    except (ValueError, RecursionError) as error:  # numbers of thousands of digits, brackets within brackets
        raise InputError(name, None, f"valid JSON is needed ({error})") from None
    lines = list(_line_strings(name, document))
    if len(lines) != 1:
        raise InputError(name, len(lines), "exactly one LineString is needed")
    coordinates = lines[0].get("coordinates")
    if not isinstance(coordinates, list):
        raise InputError(f"{name} coordinates", coordinates, "a list of positions is needed")
    rows = []
    for number, position in enumerate(coordinates):
        place = f"{name} coordinates[{number}]"
        if not isinstance(position, list) or len(position) < 2:
            raise InputError(place, position, "a list of two or three numbers is needed")
        rows.append(_point(place, position))
    return rows, geojson_system(name, document)


def _line_strings(name: str, node: object) -> Iterator[dict[str, Any]]:
    """Yield every LineString of a GeoJSON document; InputError for lines of several parts and what is no GeoJSON."""
    member = node if isinstance(node, dict) else {}
    kind = member.get("type")
    if kind == "FeatureCollection" and isinstance(member.get("features"), list):
        for feature in member["features"]:
            yield from _line_strings(name, feature)
    elif kind == "Feature":
        if member.get("geometry") is not None:
            yield from _line_strings(name, member["geometry"])
    elif kind == "LineString":
        yield member
    elif kind == "MultiLineString":
        raise InputError(f"{name} type", kind, "one LineString is needed, in one part")
    elif kind not in ("Point", "MultiPoint", "Polygon", "MultiPolygon"):
        raise InputError(f"{name} type", kind, "GeoJSON with a LineString is needed")


def centerline_geojson(geometry: RoadGeometry, stations: Float) -> dict[str, Any]:
    """Return a GeoJSON FeatureCollection with the centreline through stations (N,), m, elevations included.

    Coordinates are those of the parameter set's reference system, named by the member ``crs`` (GeoJSON 2008); 0.1 mm.
    """
    metadata = geometry.parameters.metadata
    xy = geometry.alignment.position(stations)
    local_points = np.column_stack([xy, geometry.profile.elevation(stations)])
    points = np.round(local_points + np.array(geometry.parameters.transform.translate), 4)
    properties = {
        "id": "alignment",
        "instance": geometry.parameters.alignment.instance,
        "length": round(geometry.length, 6),
        "stations": np.round(stations, 4).tolist(),
    }
    line = {"type": "LineString", "coordinates": points.tolist()}
    return {
        "type": "FeatureCollection",
        "name": metadata.identifier,
        "crs": {"type": "name", "properties": {"name": metadata.urn}},
        "features": [{"type": "Feature", "properties": properties, "geometry": line}],
    }
