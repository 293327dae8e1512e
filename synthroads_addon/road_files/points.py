"""Lines of points with longitudes and latitudes in XML: placemarks of KML, tracks and routes of GPX.

OGC KML 2.3 (12-007r2), `LineString`, `LinearRing` left out, and Google's `gx:Track`; GPX 1.1 of TopoGrafix. Both are in
WGS 84; heights are above the sea.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element  # nosec B405 (its type alone)

import numpy as np

from ..base.arrays import Float
from ..base.errors import InputError
from .line import LineNames
from .xml_text import child, children, finite, local_name, read_xml


@dataclass(frozen=True)
class PointLine:
    """A line of points in WGS 84.

    Attributes:
        name: as the file has it, unique in the file.
        points: (N, 3) longitude, latitude (degrees) and height (m; 0 where the file has none).
        has_heights: whether a height other than 0 is there.
    """

    name: str
    points: Float
    has_heights: bool


def read_point_lines(path: Path) -> list[PointLine]:
    """Return the lines of two points or more of a KML or GPX file.

    Raises:
        MissingFileError, InputError: it can't be read, or a coordinate is none.
    """
    root = read_xml(path)
    names, lines = LineNames(), list[PointLine]()
    for name, rows in _gpx(root) if local_name(root) == "gpx" else _kml(root, ""):
        points = np.array(rows, dtype=np.float64).reshape(-1, 3)
        if len(points) < 2:
            continue
        if np.abs(points[:, 0]).max() > 360.0 or np.abs(points[:, 1]).max() > 90.0:
            at = int(np.argmax(np.maximum(np.abs(points[:, 0]) / 360.0, np.abs(points[:, 1]) / 90.0)))
            wanted = "a longitude and a latitude in degrees are needed"
            raise InputError(f"{path.name}: {name}: point {at + 1}", points[at, :2].tolist(), wanted)
        lines.append(PointLine(names.unique(name, "line"), points, bool(points[:, 2].any())))
    return lines


def _text(element: Element | None) -> str:
    return "" if element is None else " ".join("".join(element.itertext()).split())[:200]


def _kml(element: Element, name: str) -> Iterator[tuple[str, list[tuple[float, ...]]]]:
    """Yield name and points of each line below an element, named by the placemark around it."""
    kind = local_name(element)
    if kind == "Placemark":
        name = _text(child(element, "name")) or "line"
    if kind == "LineString":
        yield name or "line", [_kml_point(word) for word in (_text_of(child(element, "coordinates"))).split()]
    elif kind == "Track":
        yield name or "track", [_track_point(row) for row in children(element, "coord")]
    else:
        for inner in element:
            yield from _kml(inner, name)


def _text_of(element: Element | None) -> str:
    return "" if element is None else (element.text or "")


def _kml_point(word: str) -> tuple[float, ...]:
    numbers = word.split(",")
    if len(numbers) not in (2, 3):
        raise InputError("coordinates", word[:80], "longitude,latitude,height are needed, joined by commas")
    return _point("coordinates", numbers)


def _track_point(row: Element) -> tuple[float, ...]:
    numbers = _text_of(row).split()
    if len(numbers) not in (2, 3):
        raise InputError("coord", _text_of(row)[:80], "longitude, latitude and height are needed")
    return _point("coord", numbers)


def _point(place: str, numbers: list[str]) -> tuple[float, ...]:
    values = [finite(place, number) for number in numbers]
    return (*values, 0.0)[:3]


def _gpx(root: Element) -> Iterator[tuple[str, list[tuple[float, ...]]]]:
    """Yield name and points of each route, and of each segment of a track: between segments the receiver was off."""
    for line in children(root, "trk", "rte"):
        name = _text(child(line, "name")) or ("track" if local_name(line) == "trk" else "route")
        for part in [line] if local_name(line) == "rte" else children(line, "trkseg"):
            rows: list[tuple[float, ...]] = []
            for row in children(part, "rtept", "trkpt"):
                up = child(row, "ele")
                height = 0.0 if up is None else finite("ele", _text_of(up))
                rows.append((finite("lon", row.get("lon")), finite("lat", row.get("lat")), height))
            yield name, rows
