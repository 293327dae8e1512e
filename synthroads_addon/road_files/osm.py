"""Roads of OpenStreetMap: its XML (``.osm``) by the standard library, its binary form (``.pbf``) by pyosmium.

OpenStreetMap wiki, "OSM XML" and "PBF Format": nodes have longitude and latitude in WGS 84, ways name their nodes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..base.arrays import Float
from ..base.errors import InputError, MissingFileError, MissingPackageError
from .osm_roads import roads_of_ways
from .osm_tags import DRIVEN
from .points import PointLine
from .way_chains import OsmWay
from .xml_text import check_size, finite, on_one_line, parse_xml, refuse_doctype

PBF_MARK = b"\x0a\x09OSMHeader"
"""Begin of the first block of a binary file, behind its length of four bytes."""
_LARGEST_ID = 1 << 62


def read_osm(path: Path) -> list[PointLine]:
    """Return the roads of a file of OpenStreetMap in XML: ways chained by reference or name, see `roads_of_ways`.

    Raises:
        MissingFileError, InputError: the file can't be read, or holds a value that no map has.
    """
    data: _Data = parse_xml(path, _Target(path.name))
    return roads_of_ways(_placed(data))


def read_pbf(path: Path) -> list[PointLine]:
    """Return the roads of a binary file of OpenStreetMap, as `read_osm` does.

    Raises:
        MissingFileError, InputError: the file can't be read.
        MissingPackageError: pyosmium isn't installed.
    """
    try:
        import osmium
    except ModuleNotFoundError:
        raise MissingPackageError(path.name, "OpenStreetMap PBF", "osmium", "maps") from None
    data = _Data()
    try:
        check_size(path)
        source = osmium.io.File(str(path.resolve()), "pbf")  # no other format, whatever its name ends in
        way: Any  # osmium's types don't know that one kind alone is read
        for way in osmium.FileProcessor(source, osmium.osm.WAY).with_filter(osmium.filter.KeyFilter("highway")):
            data.take(way.id, {tag.k: tag.v for tag in way.tags}, [node.ref for node in way.nodes])
        source = osmium.io.File(str(path.resolve()), "pbf")
        node_ids = data.node_ids
        node: Any
        for node in osmium.FileProcessor(source, osmium.osm.NODE):
            if node.id in node_ids and node.location.valid():
                data.nodes[node.id] = (node.location.lon, node.location.lat)
    except OSError as error:
        raise MissingFileError(str(path), None, f"cannot be read ({error.strerror})") from None
    except (RuntimeError, ValueError, MemoryError) as error:
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise InputError(path.name, None, f"must be a valid PBF file of OpenStreetMap ({reason})") from None
    return roads_of_ways(_placed(data))


@dataclass
class _Data:
    """Nodes and roads of a file while it is read."""

    nodes: dict[int, tuple[float, float]] = field(default_factory=dict)
    ways: dict[int, tuple[dict[str, str], list[int]]] = field(default_factory=dict)

    def take(self, number: int, tags: Mapping[str, str], nodes: list[int]) -> None:
        """Keep a way if it is a road that is driven on."""
        if tags.get("highway") in DRIVEN and tags.get("area") != "yes":
            self.ways[number] = {key: on_one_line(value) for key, value in tags.items()}, nodes

    @property
    def node_ids(self) -> set[int]:
        """Return the numbers of the nodes of its roads."""
        return {node for _, nodes in self.ways.values() for node in nodes}


def _placed(data: _Data) -> Iterable[OsmWay]:
    """Yield the roads in order of their numbers, with longitude and latitude (N, 2) of those nodes that the file has.

    A way whose nodes are partly outside of the file, as at the edge of an extract, becomes several.
    """
    for number, (tags, nodes) in sorted(data.ways.items()):
        runs: list[list[int]] = [[]]
        missing_count = 0
        for node in nodes:
            if node in data.nodes:
                if not runs[-1] or runs[-1][-1] != node:
                    runs[-1].append(node)
            else:
                missing_count += 1
                runs.append([])
        for run in runs:
            if len(run) > 1:
                place: Float = np.array([data.nodes[node] for node in run], dtype=np.float64)
                yield OsmWay(number, tags, tuple(run), place, missing_count)


class _Target:
    """Target of the XML parser that keeps nodes and roads, and nothing else."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._data = _Data()
        self._way: tuple[int, dict[str, str], list[int]] | None = None
        self._root = False

    def start(self, tag: str, attributes: Mapping[str, str]) -> None:
        """Take a node, begin a way, or add a node's number or a tag to the way that was begun."""
        if not self._root and tag != "osm":
            allowed = "must have osm as its root element: this file is no map of OpenStreetMap"
            raise InputError(self._name, tag[:80], allowed)
        self._root = True
        if tag == "node":
            self._node(attributes)
        elif tag == "way":
            is_current = attributes.get("visible") != "false" and attributes.get("action") != "delete"
            # Editors mark what is deleted; such a way isn't on the map any more.
            self._way = (self._number(attributes, "way id", "id"), {}, []) if is_current else None
        elif self._way is not None and tag == "nd":
            self._way[2].append(self._number(attributes, "nd ref", "ref"))
        elif self._way is not None and tag == "tag":
            self._way[1][attributes.get("k", "")[:255]] = attributes.get("v", "")[:255]

    def end(self, tag: str) -> None:
        """Keep a way at its end tag, if it is a road."""
        if tag == "way" and self._way is not None:
            number, tags, nodes = self._way
            self._data.take(number, tags, nodes)
            self._way = None

    def doctype(self, name: str, _: Any, __: Any) -> None:
        """Refuse a document type."""
        refuse_doctype(name)

    def close(self) -> _Data:
        """Return the nodes and roads of the file."""
        return self._data

    def _node(self, attributes: Mapping[str, str]) -> None:
        """Keep longitude and latitude (degrees) of a node that isn't deleted, by its number."""
        if attributes.get("visible") == "false" or attributes.get("action") == "delete":
            return
        number = self._number(attributes, "node id", "id")
        place = f"{self._name}: node {number}"
        longitude, latitude = (finite(f"{place} {key}", attributes.get(key)) for key in ("lon", "lat"))
        if abs(longitude) > 180.0 or abs(latitude) > 90.0:
            raise InputError(place, [longitude, latitude], "must be a longitude and a latitude in degrees")
        self._data.nodes[number] = longitude, latitude

    def _number(self, attributes: Mapping[str, str], field: str, key: str) -> int:
        """Return the whole number in an element's attribute `key`; an error calls it by `field`."""
        text = attributes.get(key, "")
        digits = text.removeprefix("-")  # editors give what is new negative numbers
        if not (digits.isascii() and digits.isdecimal() and len(digits) < 20 and int(digits) < _LARGEST_ID):
            raise InputError(f"{self._name}: {field}", text[:80] or None, "must be a whole number")
        return int(text)
