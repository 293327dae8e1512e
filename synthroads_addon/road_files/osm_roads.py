"""Roads of a map: chains of ways and pairs of carriageways as lines of points, with what the map says of them."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from ..base.arrays import Float
from .carriageway_pairs import Pair, pairs_of
from .line import LineNames
from .osm_tags import driving_direction, kilometres_per_hour, lanes_each_way, metres
from .points import MappedSection, PointLine
from .way_chains import Chain, OsmWay, chained, on_plane

_COMPASS = ("east", "northeast", "north", "northwest", "west", "southwest", "south", "southeast")
_NARROWEST, _WIDEST = 2.5, 4.0
"""Widths of lanes, m, that a width divided by a number of lanes gives."""
_PAVED = {"asphalt": "asphalt", "paved": None, "concrete": "concrete", "concrete:plates": "concrete"}
_SHOWN = 6
"""Stretches that are named one by one."""
_SAME_WIDTH = 2.0
"""Metres by which the distance of two carriageways may differ along the road without a word."""
_Span = tuple[float, float, Mapping[str, str]]
"""Begin, end (m) and tags of a stretch."""
_Carriageways = Mapping[str, Sequence[_Span]]
"""Stretches of each carriageway, by the direction that it leads to; empty where a road has one alone."""
T = TypeVar("T")


def roads_of_ways(ways: Iterable[OsmWay]) -> list[PointLine]:
    """Return the roads of a map, the longest first.

    Ways of one reference or name are chained (`way_chains.chained`). Two one-way chains of a name that run beside each
    other in opposite directions are the carriageways of a road, whose axis lies midway; it has their name, and each of
    them is there as well, named with the direction that it leads to. Ways without reference and name stand alone.
    """
    groups: dict[str | None, list[Chain]] = defaultdict(list)
    lines: list[tuple[str, PointLine]] = []
    for chain in chained(ways):
        may_pair = chain.directed and chain.label and not chain.link and not chain.roundabout
        groups[chain.label if may_pair else None].append(chain)
    for label, chains in groups.items():
        pairs, reasons = pairs_of(chains) if label is not None else ([], {})
        lines += [(label or "", _of_pair(pair)) for pair in pairs]
        for n, chain in enumerate(chains):
            other, reason = reasons.get(n, (n, ""))
            remark = f"{label} {_heading(chains[other])} isn't paired with it: {reason}" if reason else None
            line = replace(_of_chain(chain, remark), carriageway=any(chain in (p.one, p.other) for p in pairs))
            lines.append(_named(line, chain))
    lines.sort(key=lambda row: -_length(row[1].points))
    names = LineNames()
    return [replace(line, name=names.unique(name, "road")) for name, line in lines]


def _named(line: PointLine, chain: Chain) -> tuple[str, PointLine]:
    """Return a chain's name, with the direction it leads to if it is one-way, and its line."""
    if chain.label is None:
        way = chain.ways[0]
        return f"{way.tags['highway']} {way.number}", line
    return f"{chain.label} {_heading(chain)}" if chain.directed else chain.label, line


def _length(points: Float) -> float:
    """Return the length (m) of a line of longitudes and latitudes (N, 2 or 3), degrees."""
    return float(np.hypot(*np.diff(on_plane(points[:, :2], points[0, :2]), axis=0).T).sum())


def _heading(chain: Chain) -> str:
    """Return the direction of the compass that a chain leads to, as words: ``northeast``."""
    east, north = on_plane(chain.points[-1:], chain.points[0])[0].tolist()
    return _COMPASS[round(math.atan2(north, east) / (math.pi / 4.0)) % 8]


def _with_heights(points: Float) -> Float:
    """Return points (N, 2) with a height of 0: (N, 3)."""
    return np.column_stack([points, np.zeros(len(points))])


def _of_chain(chain: Chain, not_paired: str | None) -> PointLine:
    """Return a chain's line, without a name yet; `not_paired` is a remark on why it is no carriageway of a pair."""
    spans = list(chain.spans())
    section, left_out, remarks = _section_of({"": spans})
    if not_paired:
        remarks = (*remarks, not_paired)
    missing_count = sum(way.missing for way in {way.number: way for way in chain.ways}.values())
    if missing_count:
        left_out = (*left_out, f"nodes that the file lacks: {missing_count}")
    points = _with_heights(chain.points)
    tags = chain.tags
    junction = chain.link or chain.roundabout
    kind = f"OpenStreetMap {tags['highway']}"
    return PointLine("", points, False, kind, section=section, junction=junction, left_out=left_out, remarks=remarks)


def _of_pair(pair: Pair) -> PointLine:
    """Return the axis of a pair of carriageways as a line without a name, with what the tags of both say."""
    one_spans = _within(pair.one.spans(), lambda s: s - pair.begin, pair.end - pair.begin)
    other_spans = _within(pair.other.spans(), _stations_on(pair), pair.end - pair.begin)
    section, left_out, remarks = _section_of({_heading(pair.one): one_spans, _heading(pair.other): other_spans})
    least, largest = pair.spread_range
    section = replace(section, spread=pair.spread, one_way=False)
    if largest - least > _SAME_WIDTH:
        left_out += (
            f"median: the carriageways are {least:.1f} to {largest:.1f} m apart, {pair.spread:.1f} m all along",
        )
    names = f"{_heading(pair.one)} and {_heading(pair.other)}"
    remarks += (
        f"its axis lies midway between its carriageways, {names}, which are {pair.spread:.1f} m apart",
        *(() if pair.keeps_right else ("its traffic keeps left, that of the parameter set right",)),
    )
    tags = pair.one.tags
    outlines = tuple(_with_heights(_cut(chain, pair)) for chain in (pair.one, pair.other))
    line = PointLine("", _with_heights(pair.points), False, f"OpenStreetMap {tags['highway']}", section=section)
    return replace(line, left_out=left_out, remarks=remarks, outlines=outlines)


def _cut(chain: Chain, pair: Pair) -> Float:
    """Return the nodes (N, 2) of a carriageway beside its pair's axis; all nodes where fewer than two are."""
    if chain is pair.other:
        axis_station = _stations_on(pair)
        station = np.array([axis_station(s) for s in chain.stations.tolist()])
    else:
        station = chain.stations - pair.begin
    nodes = chain.points[(station >= 0.0) & (station <= pair.end - pair.begin)]
    return nodes if len(nodes) > 1 else chain.points


def _stations_on(pair: Pair) -> Callable[[float], float]:
    """Return the function from stations of a pair's second carriageway to those of its axis, m."""
    from scipy.spatial import cKDTree  # takes a tenth of a second, and few roads are of maps

    origin = pair.points[0]
    axis = on_plane(pair.points, origin)
    axis_run = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(axis, axis=0).T))])
    # Places of the axis some 5 m apart (chosen), of which the nearest one is looked for.
    count = max(2, int(min(np.ceil(axis_run[-1] / 5.0), 100_000)))
    station = np.linspace(0.0, axis_run[-1], count)
    tree = cKDTree(
        np.column_stack([np.interp(station, axis_run, axis[:, 0]), np.interp(station, axis_run, axis[:, 1])])
    )
    nodes = on_plane(pair.other.points, origin)

    def axis_station(other_station: float) -> float:
        """Return the station of the axis' place nearest to a station of the second carriageway, m."""
        place = [np.interp(other_station, pair.other.stations, nodes[:, axis]) for axis in (0, 1)]
        return float(station[tree.query(place)[1]])

    return axis_station


def _within(spans: Iterable[_Span], station: Callable[[float], float], length: float) -> list[_Span]:
    """Return spans (begin, end, tags), m, cut to an axis' length; `station` turns stations into the axis' ones."""
    rows = []
    for begin, end, tags in spans:
        axis_begin, axis_end = sorted((station(begin), station(end)))
        if min(axis_end, length) - max(axis_begin, 0.0) > 1e-6:
            rows.append((max(axis_begin, 0.0), min(axis_end, length), tags))
    return rows


def _section_of(carriageways: _Carriageways) -> tuple[MappedSection, tuple[str, ...], tuple[str, ...]]:
    """Return the cross-section that a road's tags describe, the texts of what is left out of them, and remarks."""
    spans = [span for rows in carriageways.values() for span in rows]
    left_out, remarks = list[str](), list[str]()
    lanes, one_way = _most(spans, lambda tags: lanes_each_way(tags)[0]), driving_direction(spans[0][2]) != 0
    if len(_values(spans, lambda tags: lanes_each_way(tags)[0])) > 1:
        rows = _stretches(carriageways, lambda tags: lanes_each_way(tags)[0], "{} lanes")
        left_out.append(f"lanes that begin or end: {rows}; {lanes} each way all along")
    remarks += sorted(_values(spans, lambda tags: lanes_each_way(tags)[1]))
    lane_width, fault = _lane_width(spans, lanes, one_way)
    left_out += [fault] if fault else []
    speed = _most(spans, lambda tags: kilometres_per_hour(tags.get("maxspeed"))[0])
    remarks += sorted(_values(spans, lambda tags: kilometres_per_hour(tags.get("maxspeed"))[1]))
    if len(_values(spans, lambda tags: tags.get("maxspeed"))) > 1:
        rows = _stretches(carriageways, lambda tags: tags.get("maxspeed"), "maxspeed={}")
        left_out.append(f"limits of speed: {rows}")
    for rows in (
        _stretches(carriageways, lambda tags: _there(tags.get("bridge")), "bridge={}", "layer"),
        _stretches(carriageways, lambda tags: _there(tags.get("tunnel")), "tunnel={}", "layer"),
    ):
        left_out += [f"structures: {rows}"] if rows else []
    surface = _most(spans, lambda tags: tags.get("surface"))
    surfaces = _values(spans, lambda tags: tags.get("surface"))
    if len(surfaces) > 1 or any(word not in _PAVED for word in surfaces):
        left_out.append(f"surfaces: {_stretches(carriageways, lambda tags: tags.get('surface'), 'surface={}')}")
    section = MappedSection(lanes, lane_width, None, one_way, speed, _PAVED.get(surface or ""))
    return section, tuple(left_out), tuple(remarks)


def _values(spans: Sequence[_Span], value: Callable[[Mapping[str, str]], T | None]) -> set[T]:
    """Return the set of values, other than None, that a function of a span's tags takes."""
    return {tag_value for _, _, tags in spans if (tag_value := value(tags)) is not None}


def _there(value: str | None) -> str | None:
    """Return the value of a tag such as ``bridge``; None where it is missing or ``no``."""
    return None if value in (None, "no") else value


def _lane_width(spans: Sequence[_Span], lanes: int | None, one_way: bool) -> tuple[float | None, str | None]:
    """Return a lane's width (m) by the tag ``width`` of the carriageway, and a text on it where that gives none."""
    text = _most(spans, lambda tags: tags.get("width"))
    if text is None:
        return None, None
    width = metres(text)
    if width is None or lanes is None:
        return None, f"width={text[:40]!r}: " + (
            "it is no length" if width is None else "the number of lanes is missing"
        )
    lane_width = width / (lanes if one_way else 2 * lanes)
    if not _NARROWEST <= lane_width <= _WIDEST:
        return (
            None,
            f"width={text[:40]!r}: lanes would be {lane_width:.2f} m wide, {_NARROWEST:g} to {_WIDEST:g} are allowed",
        )
    return round(lane_width, 3), None


def _most(spans: Sequence[_Span], value: Callable[[Mapping[str, str]], T | None]) -> T | None:
    """Return the value, other than None, that the spans have over the greatest length; None where none has any."""
    lengths: dict[T, float] = defaultdict(float)
    for begin, end, tags in spans:
        tag_value = value(tags)
        if tag_value is not None:
            lengths[tag_value] += end - begin
    return max(lengths, key=lambda key: lengths[key]) if lengths else None


def _stretches(
    carriageways: _Carriageways, value: Callable[[Mapping[str, str]], object], text: str, extra_key: str | None = None
) -> str:
    """Return as text from where to where a value holds on each carriageway; neighbours of one value are joined.

    `text` is the format of a value; the tag `extra_key` follows it where a span has that.
    """
    texts = list[str]()
    for name, spans in carriageways.items():
        rows: list[tuple[str, float, float]] = []
        for begin, end, tags in sorted(spans, key=lambda span: span[:2]):
            tag_value = value(tags)
            if tag_value is None:
                continue
            label = text.format(str(tag_value)[:40])
            if extra_key and extra_key in tags:
                label += f" {extra_key}={tags[extra_key][:10]}"
            if rows and rows[-1][0] == label and begin <= rows[-1][2] + 1.0:
                rows[-1] = (label, rows[-1][1], max(rows[-1][2], end))
            else:
                rows.append((label, begin, end))
        phrases = [f"{label} from {begin:.0f} m to {end:.0f} m" for label, begin, end in rows[:_SHOWN]]
        more = f" and {len(rows) - _SHOWN} more" if len(rows) > _SHOWN else ""
        texts += [(f"{name}: " if name else "") + ", ".join(phrases) + more] if rows else []
    return "; ".join(texts)
