"""A small reader of OpenDRIVE files after the standard's formulas: it shares no code with the writer."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from scipy.special import fresnel

Float = np.ndarray
SAME = 1e-9
"""A station so near (m) to a border belongs to what begins there."""


def number(item: ElementTree.Element, name: str, default: float = 0.0) -> float:
    return float(item.get(name, default))


@dataclass
class Cubics:
    """Cubics that begin at stations; each holds until the next."""

    start: Float
    coefficients: Float

    @classmethod
    def of(cls, items: list[ElementTree.Element], where: str = "s", shift: float = 0.0) -> Cubics:
        start = np.array([number(item, where) + shift for item in items])
        rows = [[number(item, name) for name in "abcd"] for item in items]
        assert np.all(np.diff(start) > 0.0)
        return cls(start, np.array(rows).reshape(-1, 4))

    def at(self, s: Float) -> Float:
        if not len(self.start):
            return np.zeros(np.shape(s))
        piece = np.searchsorted(self.start, np.asarray(s) + SAME, side="right") - 1
        assert np.all(piece >= 0)
        a, b, c, d = self.coefficients[piece].T
        u = s - self.start[piece]
        return a + b * u + c * u**2 + d * u**3

    def slope(self, s: Float) -> Float:
        piece = np.searchsorted(self.start, np.asarray(s) + SAME, side="right") - 1
        _, b, c, d = self.coefficients[piece].T
        u = s - self.start[piece]
        return b + 2.0 * c * u + 3.0 * d * u**2


@dataclass
class Lane:
    number: int
    type: str
    width: Cubics
    heights: Float
    notes: dict[str, str]
    links: dict[str, int]
    item: ElementTree.Element

    def height(self, s: Float) -> tuple[Float, Float]:
        """Return the heights of the inner and the outer border above the road, linear between entries."""
        if not len(self.heights):
            return np.zeros(np.shape(s)), np.zeros(np.shape(s))
        at, inner, outer = self.heights.T
        return np.interp(s, at, inner), np.interp(s, at, outer)


@dataclass
class Section:
    start: float
    end: float
    lanes: dict[int, Lane]

    def borders(self, s: Float, offset: Float) -> dict[int, Float]:
        """Return t of every lane's outer border at stations (N,); 0 is the centre lane's."""
        found = {0: offset}
        for sign in (1, -1):
            edge = offset
            for i in sorted(abs(i) for i in self.lanes if i * sign > 0):
                edge = edge + sign * self.lanes[sign * i].width.at(s)
                found[sign * i] = edge
        return found


@dataclass
class Mark:
    """A painted piece of a line."""

    start: float
    end: float
    lane: int
    aside: float
    width: float
    color: str
    instance: int


@dataclass
class OpenDrive:
    root: ElementTree.Element
    road: ElementTree.Element
    length: float
    offset: Float
    sections: list[Section] = field(default_factory=list)

    @classmethod
    def read(cls, path: Path) -> list[OpenDrive]:
        """Return the roads of a file."""
        root = ElementTree.parse(path).getroot()
        return [cls._read(root, road) for road in root.findall("road")]

    @classmethod
    def _read(cls, root: ElementTree.Element, road: ElementTree.Element) -> OpenDrive:
        header, shift = root.find("header"), root.find("header/offset")
        assert header is not None
        assert (header.get("revMajor"), header.get("revMinor")) == ("1", "8")
        assert shift is None or number(shift, "hdg") == 0.0
        offset = np.zeros(3) if shift is None else np.array([number(shift, name) for name in "xyz"])
        found = cls(root, road, number(road, "length"), offset)
        items = road.findall("lanes/laneSection")
        starts = [number(item, "s") for item in items] + [found.length]
        for item, start, end in zip(items, starts[:-1], starts[1:], strict=True):
            assert end > start
            lanes = item.findall("left/lane") + item.findall("right/lane")
            found.sections.append(Section(start, end, {int(i.attrib["id"]): _lane(i, start) for i in lanes}))
        return found

    # --- reference line and surface -----------------------------------------------------------------------------

    def reference(self, s: Float) -> tuple[Float, Float]:
        """Return position (N, 2) and heading (N,) in the file's coordinates."""
        items = self.road.findall("planView/geometry")
        starts = np.array([number(item, "s") for item in items])
        piece = np.clip(np.searchsorted(starts, s + SAME, side="right") - 1, 0, None)
        position, heading = np.empty((len(s), 2)), np.empty(len(s))
        for i, item in enumerate(items):
            own = piece == i
            u = s[own] - starts[i]
            along, across, turn = _geometry(item[0], number(item, "length"), u)
            h = number(item, "hdg")
            position[own, 0] = number(item, "x") + along * np.cos(h) - across * np.sin(h)
            position[own, 1] = number(item, "y") + along * np.sin(h) + across * np.cos(h)
            heading[own] = h + turn
        return position, heading

    @property
    def side(self) -> str:
        return notes_of(self.road)["side"]

    def elevation(self, s: Float) -> Float:
        return Cubics.of(self.road.findall("elevationProfile/elevation")).at(s)

    def superelevation(self, s: Float) -> Float:
        return Cubics.of(self.road.findall("lateralProfile/superelevation")).at(s)

    def lane_offset(self, s: Float) -> Float:
        return Cubics.of(self.road.findall("lanes/laneOffset")).at(s)

    def point(self, s: Float, t: Float, height: Float | float = 0.0) -> Float:
        """Return map points (N, 3) at s, t and h: turned with the grade first, then tilted."""
        position, heading = self.reference(s)
        profile = Cubics.of(self.road.findall("elevationProfile/elevation"))
        climb, roll = np.arctan(profile.slope(s)), self.superelevation(s)
        ahead = np.stack([np.cos(heading), np.sin(heading), np.zeros(len(s))], axis=1)
        left = np.stack([-np.sin(heading), np.cos(heading), np.zeros(len(s))], axis=1)
        up = np.column_stack([-np.sin(climb)[:, None] * ahead[:, :2], np.cos(climb)])
        cosine, sine = np.cos(roll)[:, None], np.sin(roll)[:, None]
        across, above = cosine * left + sine * up, cosine * up - sine * left
        line = np.column_stack([position, self.elevation(s)])
        return line + t[:, None] * across + np.broadcast_to(height, s.shape)[:, None] * above + self.offset

    def section_of(self, s: Float) -> list[tuple[Section, Float]]:
        """Return every section with the stations that lie in it."""
        starts = np.array([section.start for section in self.sections])
        index = np.searchsorted(starts, s + SAME, side="right") - 1
        return [(section, s[index == i]) for i, section in enumerate(self.sections) if np.any(index == i)]

    def border_points(self, s: Float) -> list[tuple[Section, Float, dict[int, Float]]]:
        """Return by section its stations, and map points (N, 3) of every lane's outer border."""
        found = []
        for section, own in self.section_of(s):
            borders = section.borders(own, self.lane_offset(own))
            points = {}
            for i, t in borders.items():
                points[i] = self.point(own, t, section.lanes[i].height(own)[1] if i else 0.0)
            found.append((section, own, points))
        return found

    # --- paint and objects --------------------------------------------------------------------------------------

    def marks(self) -> list[Mark]:
        """Return every painted piece along the lanes' borders."""
        found = []
        items = self.road.findall("lanes/laneSection")
        for section, item in zip(self.sections, items, strict=True):
            for lane in item.iter("lane"):
                roadmarks = lane.findall("roadMark")
                starts = [section.start + number(mark, "sOffset") for mark in roadmarks]
                for mark, start, end in zip(roadmarks, starts, [*starts[1:], section.end], strict=False):
                    assert end > start
                    found += _pieces(mark, int(lane.attrib["id"]), start, end)
        return found

    def objects(self) -> dict[str, ElementTree.Element]:
        items = self.road.findall("objects/object")
        found = {item.attrib["id"]: item for item in items}
        assert len(found) == len(items)
        return found

    def signals(self) -> dict[str, ElementTree.Element]:
        items = self.road.findall("signals/signal")
        found = {item.attrib["id"]: item for item in items}
        assert len(found) == len(items)
        return found

    def place(self, item: ElementTree.Element) -> Float:
        """Return the map point (3,) of an object's or a signal's origin."""
        s, t = np.array([number(item, "s")]), np.array([number(item, "t")])
        return self.point(s, t, number(item, "zOffset"))[0]


@dataclass
class Roads:
    """All roads of a file."""

    roads: list[OpenDrive]

    @classmethod
    def read(cls, path: Path) -> Roads:
        return cls(OpenDrive.read(path))

    @property
    def root(self) -> ElementTree.Element:
        return self.roads[0].root

    @property
    def offset(self) -> Float:
        return self.roads[0].offset

    @property
    def length(self) -> float:
        return self.roads[0].length

    def marks(self) -> list[tuple[OpenDrive, Mark]]:
        return [(road, mark) for road in self.roads for mark in road.marks()]

    def objects(self) -> dict[str, ElementTree.Element]:
        return self._all([road.objects() for road in self.roads])

    def signals(self) -> dict[str, ElementTree.Element]:
        return self._all([road.signals() for road in self.roads])

    def _all(self, parts: list[dict[str, ElementTree.Element]]) -> dict[str, ElementTree.Element]:
        assert sum(map(len, parts)) == len({key for part in parts for key in part})
        return {key: item for part in parts for key, item in part.items()}

    def road_of(self, item: ElementTree.Element) -> OpenDrive:
        """Return the road that an object or a signal belongs to."""
        (road,) = [road for road in self.roads if any(other is item for other in road.road.iter())]
        return road

    def place(self, item: ElementTree.Element) -> Float:
        """Return the map point (3,) of an object's or a signal's origin."""
        return self.road_of(item).place(item)


def notes_of(item: ElementTree.Element) -> dict[str, str]:
    return {note.attrib["code"]: note.attrib["value"] for note in item.findall("userData")}


def corners_local(item: ElementTree.Element) -> list[Float]:
    """Return an object's outlines, each (N, 4): u, v, z, height."""
    names = ("u", "v", "z", "height")
    return [
        np.array([[number(corner, name) for name in names] for corner in outline.findall("cornerLocal")])
        for outline in item.findall("outlines/outline")
    ]


def corners_road(item: ElementTree.Element) -> list[Float]:
    """Return an object's outlines, each (N, 4): s, t, dz, height."""
    names = ("s", "t", "dz", "height")
    return [
        np.array([[number(corner, name) for name in names] for corner in outline.findall("cornerRoad")])
        for outline in item.findall("outlines/outline")
    ]


def _lane(item: ElementTree.Element, start: float) -> Lane:
    names = ("sOffset", "inner", "outer")
    heights = np.array([[number(height, name) for name in names] for height in item.findall("height")]).reshape(-1, 3)
    heights[:, 0] += start
    links = {link.tag: int(link.attrib["id"]) for link in item.findall("link/*")}
    width = Cubics.of(item.findall("width"), "sOffset", start)
    return Lane(int(item.attrib["id"]), item.attrib["type"], width, heights, notes_of(item), links, item)


def _geometry(item: ElementTree.Element, length: float, u: Float) -> tuple[Float, Float, Float]:
    """Return distances along and across the start's tangent and the turn, at distances u."""
    if item.tag == "line":
        return u, np.zeros(len(u)), np.zeros(len(u))
    if item.tag == "arc":
        k = number(item, "curvature")
        return np.sin(k * u) / k, (1.0 - np.cos(k * u)) / k, k * u
    assert item.tag == "spiral"
    k0, k1 = number(item, "curvStart"), number(item, "curvEnd")
    rate = (k1 - k0) / length
    # The turn k0 u + rate u^2 / 2 is rate / 2 (u + k0 / rate)^2 - k0^2 / (2 rate): Fresnel's integrals, shifted.
    scale = np.sqrt(np.pi / abs(rate))
    sign = np.sign(rate)
    begin, there = k0 / rate / scale, (u + k0 / rate) / scale
    sin0, cos0 = fresnel(begin)
    sin1, cos1 = fresnel(there)
    real, imaginary = scale * (cos1 - cos0), sign * scale * (sin1 - sin0)
    back = -(k0**2) / (2.0 * rate)
    along = real * np.cos(back) - imaginary * np.sin(back)
    across = real * np.sin(back) + imaginary * np.cos(back)
    return along, across, k0 * u + rate * u**2 / 2.0


def _pieces(mark: ElementTree.Element, lane: int, start: float, end: float) -> list[Mark]:
    if mark.get("type") == "none":
        return []
    (line,) = mark.findall("type/line")
    dash, gap = number(line, "length"), number(line, "space")
    first = start + number(line, "sOffset")
    instance = int(notes_of(mark)["instance"])
    found = []
    count = int(np.ceil((end - first) / (dash + gap) - 1e-9)) if gap else 1
    for i in range(count):
        begin = first + i * (dash + gap)
        stop = min(begin + dash, end)
        aside = number(line, "tOffset")
        if stop - begin > 1e-6:
            found.append(Mark(begin, stop, lane, aside, number(line, "width"), line.attrib["color"], instance))
    return found
