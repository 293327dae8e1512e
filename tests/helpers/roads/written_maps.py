"""Small maps of OpenStreetMap, vector files and paths of vehicles, made along a line that is known exactly."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray
from pyproj import Transformer

from tests.helpers.roads.written_lines import Walk, linear

Points = NDArray[np.float64]
PLACE = 500_000.0, 5_600_000.0
"""Of a line's begin in UTM, zone 32, m."""
BEND = [
    (300.0, 0.0, 0.0),
    (80.0, 0.0, 1 / 800.0),
    (700.0, 1 / 800.0, 1 / 800.0),
    (80.0, 1 / 800.0, 0.0),
    (300.0, 0.0, 0.0),
]
"""Length and curvatures of a motorway's bend of 800 m radius between two straights."""


def bend() -> Walk:
    return Walk([(length, linear(length, a, b)) for length, a, b in BEND], *PLACE, 0.3)


def beside(walk: Walk, stations: Sequence[float], offset: float = 0.0) -> Points:
    """Return places (N, 2) to the left of a line at stations, m."""
    poses = np.array([walk.at(station) for station in stations])
    return poses[:, :2] + offset * np.column_stack([-np.sin(poses[:, 2]), np.cos(poses[:, 2])])


def degrees(points: Points, epsg: int = 32632) -> Points:
    """Return places (N, 2) of a map as longitudes and latitudes."""
    return np.column_stack(Transformer.from_crs(epsg, 4326, always_xy=True).transform(*points[:, :2].T))


@dataclass
class Map:
    """Nodes and ways of OpenStreetMap; places are those of UTM, zone 32."""

    nodes: dict[int, tuple[float, float]] = field(default_factory=dict)
    ways: list[tuple[int, list[int], dict[str, str]]] = field(default_factory=list)

    def line(self, points: Points) -> list[int]:
        """Add nodes; return their numbers."""
        first = len(self.nodes) + 1
        for number, (x, y) in enumerate(degrees(points).tolist(), first):
            self.nodes[number] = round(x, 7), round(y, 7)  # as OpenStreetMap keeps them
        return list(range(first, first + len(points)))

    def way(self, nodes: Sequence[int], tags: Mapping[str, str], number: int | None = None) -> None:
        self.ways.append((number or 1000 + len(self.ways), list(nodes), {"highway": "motorway", **tags}))

    def xml(self, path: Path, head: str = "") -> Path:
        rows = [f'<node id="{n}" lon="{x!r}" lat="{y!r}"/>' for n, (x, y) in self.nodes.items()]
        for number, nodes, tags in self.ways:
            inner = "".join(f'<nd ref="{n}"/>' for n in nodes)
            inner += "".join(f"<tag k={quoteattr(k)} v={quoteattr(v)}/>" for k, v in tags.items())
            rows.append(f'<way id="{number}">{inner}</way>')
        path.write_text(f'<?xml version="1.0"?>\n{head}<osm version="0.6">\n' + "\n".join(rows) + "\n</osm>\n")
        return path

    def pbf(self, path: Path) -> Path:
        import osmium

        writer = osmium.SimpleWriter(str(path), overwrite=True)
        for number, place in self.nodes.items():
            writer.add_node(osmium.osm.mutable.Node(id=number, location=place))
        for number, nodes, tags in self.ways:
            writer.add_way(osmium.osm.mutable.Way(id=number, nodes=nodes, tags=tags))
        writer.close()
        return path


def motorway(
    offset: float = 6.5, steps: tuple[float, float] = (60.0, 75.0), length: float = 0.0, **tags: str
) -> tuple[Map, Walk]:
    """Return a map of a motorway's two carriageways, of two ways each, and its axis.

    Args:
        offset: of a carriageway's middle from the axis, m.
        steps: distance of the nodes of the carriageway along the axis and of that against it, m.
        length: of the line's beginning that is mapped, m; 0 for all of it.
        tags: of all of its ways.
    """
    walk, found = bend(), Map()
    end = length or walk.starts[-1]
    for side, step in zip((-1.0, 1.0), steps, strict=True):
        station = np.linspace(0.0, end, round(end / step) + 1)
        nodes = found.line(beside(walk, station.tolist(), side * offset))
        nodes = nodes if side < 0 else nodes[::-1]
        half = len(nodes) // 2
        for part in (nodes[half:], nodes[: half + 1]):
            found.way(part, {"ref": "A 9", "lanes": "2", **tags})
    return found, walk


def well_known_binary(points: Points) -> bytes:
    """Return a line (N, 2 or 3), or one of several parts, as well-known binary (OGC 06-103r4)."""
    code = 2 + (1000 if points.shape[1] == 3 else 0)
    return struct.pack("<BII", 1, code, len(points)) + points.astype("<f8").tobytes()


def several_parts(parts: Sequence[Points]) -> bytes:
    code = 5 + (1000 if parts[0].shape[1] == 3 else 0)
    return struct.pack("<BII", 1, code, len(parts)) + b"".join(well_known_binary(part) for part in parts)


def vector_file(
    path: Path, driver: str, lines: Mapping[str, bytes], kind: str = "LineString Z", crs: str = "EPSG:25832"
) -> Path:
    """Write lines in well-known binary by pyogrio, with their names in a field ``name``."""
    import pyogrio

    geometry = np.array(list(lines.values()), dtype=object)
    names = np.array(list(lines), dtype=object)
    pyogrio.raw.write(path, geometry, [names], ["name"], driver=driver, geometry_type=kind, crs=crs)
    return path


def sbet(path: Path, points: Points, epsg: int = 32632, speed: float = 25.0) -> Path:
    """Write places (N, 3) of a map as SBET, 1 / 100 s apart."""
    records = np.zeros((len(points), 17))
    records[:, 0] = 1000.0 + 0.01 * np.arange(len(points))
    places = np.radians(degrees(points, epsg))
    records[:, 1], records[:, 2], records[:, 3], records[:, 4] = places[:, 1], places[:, 0], points[:, 2], speed
    path.write_bytes(records.astype("<f8").tobytes())
    return path
