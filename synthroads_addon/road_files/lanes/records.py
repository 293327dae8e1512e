"""Records of an OpenDRIVE road beside its line: cubics by station, lane sections, lateral profile.

ASAM OpenDRIVE 1.8.1, chapters 10.5 (elevation and lateral profiles) and 11 (lanes). Records that it no longer has are
read as 1.4 defines them: crossfall, and borders in place of widths.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element  # nosec B405 (its type alone)

import numpy as np

from ...base.arrays import Float
from ...base.errors import InputError
from ..xml_text import child, children, number

SHORTEST = 1e-6
"""Stretches shorter than this, m, are none."""
SIDES = (1, -1)
"""Signs of t on both sides of the reference line, and of the ids of the lanes there: left, right."""


@dataclass(frozen=True)
class Cubics:
    """Cubics by station, each from its own start to that of the next.

    Attributes:
        starts: (K,) increasing stations, m.
        rows: (K, 4) a, b, c, d.
        begins: whether the first cubic holds before its start as well; else the value there is 0.
    """

    starts: Float
    rows: Float
    begins: bool = True

    @classmethod
    def read(cls, items: Sequence[Element], place: str = "s", shift: float = 0.0, begins: bool = True) -> Cubics:
        """Return the cubics of elements, whose stations are counted from `shift` (m); of equal ones the last."""
        cubics = {number(item, place, 0.0) + shift: [number(item, name, 0.0) for name in "abcd"] for item in items}
        starts = sorted(cubics)
        return cls(np.array(starts), np.array([cubics[s] for s in starts]).reshape(-1, 4), begins)

    def __bool__(self) -> bool:
        return len(self.starts) > 0

    def at(self, station: Float, record_station: Float | None = None, slope: bool = False) -> Float:
        """Return values (N,), or their change per metre, at stations (N,), m.

        Args:
            station: where.
            record_station: (N,) stations that say which cubic holds, so that an end of a stretch is that of its cubic.
            slope: whether the change per metre is returned.
        """
        station = np.asarray(station, dtype=np.float64)
        if not len(self.starts):
            return np.zeros(station.shape)
        deciding_station = station if record_station is None else record_station
        row = np.searchsorted(self.starts, deciding_station, side="right") - 1
        is_before = row < 0
        row = np.maximum(row, 0)
        a, b, c, d = self.rows[row].T
        # a + b u + c u^2 + d u^3, u the distance from the cubic's start.
        u = station - self.starts[row]
        values = b + u * (2.0 * c + 3.0 * d * u) if slope else a + u * (b + u * (c + u * d))
        return np.where(is_before, 0.0, values) if not self.begins else values


@dataclass(frozen=True)
class FileLane:
    """A lane of a lane section.

    Attributes:
        number: its id.
        type: as the file calls it.
        level: whether it stays level where the road is tilted.
        widths, borders: by station; one of the two has records, or neither.
        heights: (K, 3) station, height of the inner and of the outer border above the road's surface, m.
        notes: codes and values of its user data.
        element: where its road marks are.
    """

    number: int
    type: str
    level: bool
    widths: Cubics
    borders: Cubics
    heights: Float
    notes: dict[str, str]
    element: Element


@dataclass(frozen=True)
class FileSection:
    """A lane section.

    Attributes:
        start, end: stations, m.
        lanes: by the sign of their ids, from the inside out.
        centre: the centre lane's element, None without one.
    """

    start: float
    end: float
    lanes: dict[int, tuple[FileLane, ...]]
    centre: Element | None

    def borders(self, station: Float, record_station: Float, offset: Float) -> dict[int, list[Float]]:
        """Return t (N,) of the borders on either side, from the centre lane out, at stations (N,), m.

        Borders hold from the reference line, which no lane offset moves. On the right some programs write them as
        positive distances: where they would be wider to the other side so, they are turned over.
        """
        borders: dict[int, list[Float]] = {}
        for sign, lanes in self.lanes.items():
            edges = self._edges(lanes, sign, (station, record_station, offset), 1.0)
            if any(lane.borders for lane in lanes) and sign * float((edges[-1] - edges[0]).mean()) < 0.0:
                edges = self._edges(lanes, sign, (station, record_station, offset), -1.0)
            borders[sign] = edges
        return borders

    @staticmethod
    def _edges(
        lanes: Sequence[FileLane], sign: int, stations_and_offset: tuple[Float, Float, Float], border_sign: float
    ) -> list[Float]:
        """Return t (N,), m, of the borders of one side's lanes, from the inside out, the line's lane offset first.

        `border_sign` is -1 for files that write borders on the right as positive distances.
        """
        station, record_station, offset = stations_and_offset
        edges = [offset]
        for lane in lanes:
            if lane.widths:
                edges.append(edges[-1] + sign * lane.widths.at(station, record_station))
            else:
                edges.append(border_sign * lane.borders.at(station, record_station) if lane.borders else edges[-1])
        return edges


@dataclass(frozen=True)
class ShapeProfile:
    """Heights across the road at one station: cubics of t."""

    station: float
    cubics: Cubics


@dataclass(frozen=True)
class FileRoad:
    """An OpenDRIVE road beside its plan.

    Attributes:
        element: the road.
        name: unique in the file.
        length: m.
        left_hand: whether traffic keeps to the left.
        elevation, superelevation, offset: by station: m, rad, m.
        crossfall: by sign of the side, rad, positive where it falls outwards.
        shapes: by station.
        sections: in order.
    """

    element: Element
    name: str
    length: float
    left_hand: bool
    elevation: Cubics
    superelevation: Cubics
    offset: Cubics
    crossfall: dict[int, Cubics]
    shapes: tuple[ShapeProfile, ...]
    sections: tuple[FileSection, ...]

    def breaks(self) -> Float:
        """Return the stations (B,) from 0 to the length at which any record begins, m."""
        marks = [np.array([0.0, self.length]), self.elevation.starts, self.superelevation.starts, self.offset.starts]
        marks += [cubics.starts for cubics in self.crossfall.values()]
        marks += [np.array([shape.station for shape in self.shapes])]
        for section in self.sections:
            marks.append(np.array([section.start]))
            for lane in (*section.lanes[1], *section.lanes[-1]):
                marks += [lane.widths.starts, lane.borders.starts, lane.heights[:, 0]]
        return merged(np.concatenate(marks), self.length)


def merged(stations: Float, length: float) -> Float:
    """Return the stations from 0 to a length (m) in order, those nearer than `SHORTEST` to the one before left out."""
    in_range = np.unique(np.clip(stations, 0.0, length))
    distinct = in_range[np.concatenate([[True], np.diff(in_range) > SHORTEST])]
    distinct[-1] = length
    return distinct


def read_road(road: Element, name: str, length: float, z_offset: float = 0.0) -> FileRoad:
    """Return the lanes, elevation and lateral profiles of a road.

    Args:
        road: its element.
        name: for messages.
        length: of its plan, m.
        z_offset: height that the header adds, m.

    Raises:
        InputError: a value that must be a number isn't one, or the road has no lanes.
    """
    lanes = child(road, "lanes")
    sections = [] if lanes is None else children(lanes, "laneSection")
    if not sections or lanes is None:
        raise InputError(
            f"road {name!r}: lanes", None, "has no lane section; --only-axis reads only the line of the road"
        )
    profile, lateral = child(road, "elevationProfile"), child(road, "lateralProfile")
    rows = {} if lateral is None else {tag: children(lateral, tag) for tag in ("superelevation", "crossfall", "shape")}
    elevation = Cubics.read([] if profile is None else children(profile, "elevation"))
    elevation.rows[:, 0] += z_offset
    return FileRoad(
        element=road,
        name=name,
        length=length,
        left_hand=road.get("rule", "RHT").strip().upper() == "LHT",
        elevation=elevation,
        superelevation=Cubics.read(rows.get("superelevation", []), begins=False),
        offset=Cubics.read(children(lanes, "laneOffset"), begins=False),
        crossfall={
            sign: Cubics.read(
                [row for row in rows.get("crossfall", []) if row.get("side", "both") in (side, "both")], begins=False
            )
            for sign, side in zip(SIDES, ("left", "right"), strict=True)
        },
        shapes=_shapes(rows.get("shape", [])),
        sections=_sections(sections, length),
    )


def _shapes(rows: Sequence[Element]) -> tuple[ShapeProfile, ...]:
    """Return the lateral profiles in order of their stations, each with the cubics of t of all rows at its station."""
    by_station: dict[float, list[Element]] = {}
    for row in rows:
        by_station.setdefault(number(row, "s"), []).append(row)
    return tuple(ShapeProfile(s, Cubics.read(by_station[s], "t")) for s in sorted(by_station))


def _sections(items: Sequence[Element], length: float) -> tuple[FileSection, ...]:
    """Return the lane sections in order, without those that end where they begin.

    A section with `singleSide` gives the lanes of one side only: those of the other side stay as in the section before.
    """
    rows = sorted(((number(item, "s"), n) for n, item in enumerate(items)))
    sections: list[FileSection] = []
    ends = [*(s for s, _ in rows[1:]), length]
    for (start, n), end in zip(rows, ends, strict=True):
        item = items[n]
        sides = {sign: child(item, name) for sign, name in zip(SIDES, ("left", "right"), strict=True)}
        is_single_sided = item.get("singleSide", "false").strip().lower() in ("true", "1")
        lanes = {sign: _lanes(side, sign, start) for sign, side in sides.items()}
        if is_single_sided and sections:
            lanes = {s: lanes[s] if sides[s] is not None else sections[-1].lanes[s] for s in SIDES}
        if min(end, length) - start <= SHORTEST:
            continue
        centre = child(item, "center")
        sections.append(FileSection(start, min(end, length), lanes, None if centre is None else child(centre, "lane")))
    if not sections:
        raise InputError("laneSection", None, "must begin before the road's end")
    first_section = sections[0]
    if first_section.start > 0.0:  # its lanes hold from the road's begin on
        sections[0] = FileSection(0.0, first_section.end, first_section.lanes, first_section.centre)
    return tuple(sections)


def _lanes(side: Element | None, sign: int, start: float) -> tuple[FileLane, ...]:
    """Return the lanes of one side of a section, from the inside out; `start` is the section's station, m."""
    lanes = [] if side is None else [_lane(item, start) for item in children(side, "lane")]
    return tuple(sorted((lane for lane in lanes if lane.number * sign > 0), key=lambda lane: abs(lane.number)))


def _lane(item: Element, start: float) -> FileLane:
    """Return a lane; its records count stations from the section's start, m."""
    heights = sorted([number(row, "sOffset") + start, number(row, "inner"), number(row, "outer")]
                     for row in children(item, "height"))  # fmt: skip
    return FileLane(
        number=int(number(item, "id")),
        type=item.get("type", "none").strip(),
        level=item.get("level", "false").strip().lower() in ("true", "1"),
        widths=Cubics.read(children(item, "width"), "sOffset", start),
        borders=Cubics.read(children(item, "border"), "sOffset", start),
        heights=np.array(heights).reshape(-1, 3),
        notes={row.get("code", ""): row.get("value", "") for row in children(item, "userData")},
        element=item,
    )
