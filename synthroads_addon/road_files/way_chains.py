"""Ways of a map chained to carriageways and roads through the nodes that they share."""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..base.arrays import Float
from .osm_tags import driving_direction

_AXIS, _SQUARE = 6_378_137.0, 6.694379990141e-3
"""Semi-major axis, m, and squared eccentricity of the ellipsoid of WGS 84 (EPSG:7030)."""
_SHARPEST_JOINT = math.radians(60.0)
"""Where ways of one name meet at more than this, rad, the road doesn't go on from one to the other."""


@dataclass(frozen=True, eq=False)
class OsmWay:
    """A way of a map.

    Attributes:
        number: of it in the map.
        tags: its tags.
        nodes: numbers of its nodes.
        points: (N, 2) longitude and latitude of its nodes, degrees.
        missing: nodes that the map lacks.
    """

    number: int
    tags: Mapping[str, str]
    nodes: tuple[int, ...]
    points: Float
    missing: int = 0

    @property
    def reversed(self) -> OsmWay:
        """Return the way run through backwards."""
        return OsmWay(self.number, self.tags, self.nodes[::-1], self.points[::-1], self.missing)


@dataclass(frozen=True, eq=False)
class Chain:
    """Ways that follow each other, each in the chain's direction.

    Attributes:
        label: reference or name that they share; None where they have none.
        ways: in order.
        directed: whether they are driven in this direction alone.
    """

    label: str | None
    ways: tuple[OsmWay, ...]
    directed: bool

    @property
    def tags(self) -> Mapping[str, str]:
        """Return the tags of its longest way."""
        return max(self.ways, key=lambda way: float(steps(way.points).sum())).tags

    @property
    def roundabout(self) -> bool:
        """Return whether the chain is a roundabout."""
        return self.ways[0].tags.get("junction") in ("roundabout", "circular")

    @property
    def link(self) -> bool:
        """Return whether the chain is a ramp (`highway=..._link`)."""
        return self.ways[0].tags.get("highway", "").endswith("_link")

    @cached_property
    def points(self) -> Float:
        """Return longitude and latitude (N, 2) of its nodes, degrees."""
        return np.concatenate([self.ways[0].points, *(way.points[1:] for way in self.ways[1:])])

    @cached_property
    def stations(self) -> Float:
        """Return the distance of each node (N,) from the chain's begin, m."""
        return np.concatenate([[0.0], np.cumsum(steps(self.points))])

    @property
    def length(self) -> float:
        """Return the length, m."""
        return float(self.stations[-1])

    def spans(self) -> Iterator[tuple[float, float, Mapping[str, str]]]:
        """Yield begin and end (m) and the tags of each way."""
        begin_row = 0
        for way in self.ways:
            end_row = begin_row + len(way.points) - 1
            yield float(self.stations[begin_row]), float(self.stations[end_row]), way.tags
            begin_row = end_row


def steps(points: Float) -> Float:
    """Return the distances (N - 1,), m, between neighbours among points (N, 2) of longitude and latitude, degrees."""
    degrees = np.diff(points, axis=0)
    # Across the 180th meridian the shorter way counts.
    degrees[:, 0] -= 360.0 * np.round(degrees[:, 0] / 360.0)
    return np.hypot(*(degrees * _metres_per_degree(0.5 * (points[:-1, 1] + points[1:, 1]))).T)


def on_plane(points: Float, origin: Float) -> Float:
    """Return points (N, 2) of longitude and latitude, degrees, as metres east and north of an origin (2,)."""
    return (points - origin) * _metres_per_degree(origin[1])


def _metres_per_degree(latitude: Float) -> Float:
    """Return metres east and north (..., 2) per degree at latitudes (...): by the ellipsoid's radii of curvature."""
    sine = np.sin(np.radians(latitude))
    # Radii of curvature across the meridian (prime vertical) and along it.
    east_radius = _AXIS / np.sqrt(1.0 - _SQUARE * sine**2)
    north_radius = east_radius * (1.0 - _SQUARE) / (1.0 - _SQUARE * sine**2)
    scale = np.stack([east_radius * np.cos(np.radians(latitude)), north_radius], axis=-1)
    return np.radians(scale)


def chained(ways: Iterable[OsmWay]) -> list[Chain]:
    """Return ways as chains: those of one reference or name joined where they share an end node.

    One-way roads are joined in their direction alone; ramps and roundabouts by themselves. Where several ways of a name
    leave a node those that go on straightest belong together.
    """
    # By label (a number of its own for a way without), and whether one-way, a ramp, a roundabout.
    groups: dict[tuple[str | int, bool, bool, bool], list[OsmWay]] = defaultdict(list)
    for number, way in enumerate(ways):
        direction = driving_direction(way.tags)
        label = label_of(way.tags)
        key = (
            number if label is None else label,
            direction != 0,
            way.tags["highway"].endswith("_link"),
            way.tags.get("junction") in ("roundabout", "circular"),
        )
        groups[key].append(way.reversed if direction < 0 else way)
    return [
        Chain(label_of(chain[0].tags), tuple(chain), directed)
        for (_, directed, _, _), group in groups.items()
        for chain in _joined(group, directed)
    ]


def label_of(tags: Mapping[str, str]) -> str | None:
    """Return the reference of a way, else its name; None without either."""
    return tags.get("ref", "").strip() or tags.get("name", "").strip() or None


_End = tuple[int, int]
"""A way of a group, and which of its ends: 0 the first node, 1 the last one."""


def _joined(ways: Sequence[OsmWay], directed: bool) -> Iterator[list[OsmWay]]:
    """Yield the chains of a group of ways, each as its ways in order, turned so that they follow each other.

    `directed` says that traffic runs only in the order of the nodes, so that no way may be turned.
    """
    partners = _partners(ways, directed)
    used_ways: set[int] = set()
    begins = [(n, end) for n in range(len(ways)) for end in (0, 1) if (n, end) not in partners]
    if directed:
        begins = [begin for begin in begins if begin[1] == 0]
    for begin in itertools.chain(
        begins, ((n, 0) for n in range(len(ways)))
    ):  # ways that no begin reaches form rings, which may start anywhere
        if begin[0] in used_ways:
            continue
        chain, way_end = list[OsmWay](), begin
        while way_end[0] not in used_ways:
            used_ways.add(way_end[0])
            chain.append(ways[way_end[0]] if way_end[1] == 0 else ways[way_end[0]].reversed)
            end_of_way = (way_end[0], 1 - way_end[1])
            if end_of_way not in partners:
                break
            way_end = partners[end_of_way]
        yield chain if directed or _mostly_ahead(chain, ways) else [way.reversed for way in reversed(chain)]


def _mostly_ahead(chain: Sequence[OsmWay], ways: Sequence[OsmWay]) -> bool:
    """Return whether most of a chain's length runs in the order in which the map has its ways' nodes."""
    ids = {id(way) for way in ways}
    return math.fsum(float(steps(way.points).sum()) * (1 if id(way) in ids else -1) for way in chain) >= 0.0


def _partners(ways: Sequence[OsmWay], directed: bool) -> dict[_End, _End]:
    """Return the end that each end of a way is joined to; those that aren't joined are left out."""
    ends_by_node: dict[int, list[_End]] = defaultdict(list)
    for number, way in enumerate(ways):
        ends_by_node[way.nodes[0]].append((number, 0))
        ends_by_node[way.nodes[-1]].append((number, 1))
    candidates = []
    for ends in ends_by_node.values():
        # At most 20 ways of a node are looked at (chosen): that bounds the pairs of a damaged file.
        for end, other_end in itertools.combinations(ends[:20], 2):
            if end[0] != other_end[0] and not (directed and end[1] == other_end[1]):
                turn = _turn(ways, end, other_end)
                if turn <= _SHARPEST_JOINT:
                    candidates.append((turn, end, other_end))
    partners: dict[_End, _End] = {}
    # The straightest joints come first; each end has one partner.
    for _, end, other_end in sorted(candidates):
        if end not in partners and other_end not in partners:
            partners[end], partners[other_end] = other_end, end
    return partners


def _turn(ways: Sequence[OsmWay], end: _End, other_end: _End) -> float:
    """Return the change of direction (rad, 0 to pi) where the way of one end goes on in the way of the other end."""
    arrival, departure = _towards(ways[end[0]], end[1]), _towards(ways[other_end[0]], other_end[1])
    return math.pi - abs(math.remainder(arrival - departure, 2.0 * math.pi))


def _towards(way: OsmWay, end: int) -> float:
    """Return the direction (rad, counter-clockwise from east) in which a way leaves one of its ends."""
    nodes = way.points if end == 0 else way.points[::-1]
    east, north = on_plane(nodes[1:2], nodes[0])[0].tolist()
    return math.atan2(north, east)
