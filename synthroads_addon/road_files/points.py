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
from ..base.maps.crs import LONGITUDE_LATITUDE
from .line import LineNames
from .xml_text import child, children, finite, local_name, read_xml


@dataclass(frozen=True)
class MappedSection:
    """A road's cross-section and traffic, as far as a map says them.

    Attributes:
        lanes: of one direction; None where it doesn't say.
        lane_width: m; None where it doesn't say.
        spread: distance (m) of the middles of both carriageways' lanes; None where it has one line for both.
        one_way: whether the line is one carriageway alone.
        speed: largest that is allowed, km/h; None without a limit, or where it doesn't say.
        pavement: ``asphalt`` or ``concrete``; None where it says neither.
    """

    lanes: int | None = None
    lane_width: float | None = None
    spread: float | None = None
    one_way: bool = False
    speed: float | None = None
    pavement: str | None = None

    @property
    def side_by_side(self) -> bool:
        """Return whether both directions lie side by side, without a median."""
        return self.spread is None and not self.one_way


@dataclass(frozen=True)
class PointLine:
    """A line of points.

    Attributes:
        name: as the file has it, unique in the file.
        points: (N, 3) in a coordinate system; heights are 0 where the file has none.
        has_heights: whether a height other than 0 is there.
        source: format and kind, e.g. ``GPX track``.
        system: name or WKT of the system: longitude and latitude (degrees) and height (m); None where the file names
            none.
        section: what a map says of the road; None for other files.
        driven: whether it is the path of a vehicle.
        junction: whether it is a part of a junction, taken by its name alone.
        carriageway: whether it is one of the carriageways of another line, taken by its name alone as well.
        left_out: what the file says of it and isn't taken over, as text with numbers.
        remarks: what is to be told of how it was made.
        fault: why it can't be used, where it can't.
        outlines: lines (N, 3) that it was made of, of the same system: how far apart their points are counts; empty
            where that is the line itself.
    """

    name: str
    points: Float
    has_heights: bool
    source: str = "line"
    system: str | None = LONGITUDE_LATITUDE
    section: MappedSection | None = None
    driven: bool = False
    junction: bool = False
    carriageway: bool = False
    left_out: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    fault: InputError | None = None
    outlines: tuple[Float, ...] = ()


def read_point_lines(path: Path) -> list[PointLine]:
    """Return the lines of two points or more of a KML or GPX file.

    Raises:
        MissingFileError, InputError: the file can't be read, or a coordinate is no number.
    """
    root = read_xml(path)
    names, lines = LineNames(), list[PointLine]()
    for name, coordinates in _gpx(root) if local_name(root) == "gpx" else _kml(root, ""):
        points = np.array(coordinates, dtype=np.float64).reshape(-1, 3)
        if len(points) < 2:
            continue
        if np.abs(points[:, 0]).max() > 360.0 or np.abs(points[:, 1]).max() > 90.0:
            row = int(np.argmax(np.maximum(np.abs(points[:, 0]) / 360.0, np.abs(points[:, 1]) / 90.0)))
            need = "must be a longitude and a latitude in degrees"
            raise InputError(f"{path.name}: {name}: point {row + 1}", points[row, :2].tolist(), need)
        source = "GPX line" if local_name(root) == "gpx" else "KML line"
        lines.append(PointLine(names.unique(name, "line"), points, bool(points[:, 2].any()), source))
    return lines


def _text(element: Element | None) -> str:
    """Return the text below an element with single spaces, at most 200 characters; "" without an element."""
    return "" if element is None else " ".join("".join(element.itertext()).split())[:200]


def _kml(element: Element, name: str) -> Iterator[tuple[str, list[tuple[float, ...]]]]:
    """Yield name and points (longitude, latitude, height) of each line below an element, named by its placemark."""
    kind = local_name(element)
    if kind == "Placemark":
        name = _text(child(element, "name")) or "line"
    if kind == "LineString":
        yield name or "line", [_kml_point(word) for word in (_text_of(child(element, "coordinates"))).split()]
    elif kind == "Track":
        yield name or "track", [_track_point(row) for row in children(element, "coord")]
    else:
        for child_element in element:
            yield from _kml(child_element, name)


def _text_of(element: Element | None) -> str:
    """Return the text directly in an element; "" without an element."""
    return "" if element is None else (element.text or "")


def _kml_point(word: str) -> tuple[float, ...]:
    """Return longitude, latitude (degrees) and height (m) of a word of KML's `coordinates`."""
    numbers = word.split(",")
    if len(numbers) not in (2, 3):
        raise InputError("coordinates", word[:80], "must be longitude,latitude,height, separated by commas")
    return _point("coordinates", numbers)


def _track_point(row: Element) -> tuple[float, ...]:
    """Return longitude, latitude (degrees) and height (m) of a `gx:coord` element of a track."""
    numbers = _text_of(row).split()
    if len(numbers) not in (2, 3):
        raise InputError("coord", _text_of(row)[:80], "must be a longitude, a latitude and a height")
    return _point("coord", numbers)


def _point(place: str, numbers: list[str]) -> tuple[float, ...]:
    """Return the numbers of a point with a height of 0 where it has none; errors name the place."""
    values = [finite(place, number) for number in numbers]
    return (*values, 0.0)[:3]


def _gpx(root: Element) -> Iterator[tuple[str, list[tuple[float, ...]]]]:
    """Yield name and points of each route, and of each segment of a track: between segments the receiver was off."""
    for line in children(root, "trk", "rte"):
        name = _text(child(line, "name")) or ("track" if local_name(line) == "trk" else "route")
        for part in [line] if local_name(line) == "rte" else children(line, "trkseg"):
            rows: list[tuple[float, ...]] = []
            for row in children(part, "rtept", "trkpt"):
                elevation = child(row, "ele")
                height = 0.0 if elevation is None else finite("ele", _text_of(elevation))
                rows.append((finite("lon", row.get("lon")), finite("lat", row.get("lat")), height))
            yield name, rows
