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
        pairs, why = pairs_of(chains) if label is not None else ([], {})
        lines += [(label or "", _of_pair(pair)) for pair in pairs]
        for n, chain in enumerate(chains):
            other, reason = why.get(n, (n, ""))
            lonely = f"{label} {_heading(chains[other])} isn't paired with it: {reason}" if reason else None
            line = replace(_of_chain(chain, lonely), carriageway=any(chain in (p.one, p.other) for p in pairs))
            lines.append(_named(line, chain))
    lines.sort(key=lambda row: -_length(row[1].points))
    names = LineNames()
    return [replace(line, name=names.unique(name, "road")) for name, line in lines]


def _named(line: PointLine, chain: Chain) -> tuple[str, PointLine]:
    """Return a chain's line and its name, with the direction it leads to if it is driven in one."""
    if chain.label is None:
        way = chain.ways[0]
        return f"{way.tags['highway']} {way.number}", line
    return f"{chain.label} {_heading(chain)}" if chain.directed else chain.label, line


def _length(points: Float) -> float:
    return float(np.hypot(*np.diff(on_plane(points[:, :2], points[0, :2]), axis=0).T).sum())


def _heading(chain: Chain) -> str:
    """Return the direction of the compass that a chain leads to, as words: ``northeast``."""
    east, north = on_plane(chain.points[-1:], chain.points[0])[0].tolist()
    return _COMPASS[round(math.atan2(north, east) / (math.pi / 4.0)) % 8]


def _with_heights(points: Float) -> Float:
    return np.column_stack([points, np.zeros(len(points))])


def _of_chain(chain: Chain, not_paired: str | None) -> PointLine:
    spans = list(chain.spans())
    section, left_out, remarks = _told({"": spans})
    if not_paired:
        remarks = (*remarks, not_paired)
    missing = sum(way.missing for way in {way.number: way for way in chain.ways}.values())
    if missing:
        left_out = (*left_out, f"nodes that the file lacks: {missing}")
    points = _with_heights(chain.points)
    tags = chain.tags
    junction = chain.link or chain.roundabout
    kind = f"OpenStreetMap {tags['highway']}"
    return PointLine("", points, False, kind, section=section, junction=junction, left_out=left_out, remarks=remarks)


def _of_pair(pair: Pair) -> PointLine:
    first = _within(pair.one.spans(), lambda s: s - pair.begin, pair.end - pair.begin)
    second = _within(pair.other.spans(), _stations_on(pair), pair.end - pair.begin)
    section, left_out, remarks = _told({_heading(pair.one): first, _heading(pair.other): second})
    low, high = pair.spread_range
    section = replace(section, spread=pair.spread, one_way=False)
    if high - low > _SAME_WIDTH:
        left_out += (f"median: the carriageways are {low:.1f} to {high:.1f} m apart, {pair.spread:.1f} m all along",)
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
    """Return the nodes (N, 2) of a carriageway that the axis of its pair runs beside; all if these are too few."""
    place = np.array([_stations_on(pair)(s) for s in chain.stations.tolist()]) if chain is pair.other else None
    station = chain.stations - pair.begin if place is None else place
    kept = chain.points[(station >= 0.0) & (station <= pair.end - pair.begin)]
    return kept if len(kept) > 1 else chain.points


def _stations_on(pair: Pair) -> Callable[[float], float]:
    """Return the function from stations of a pair's second carriageway to those of its axis, m."""
    from scipy.spatial import cKDTree  # takes a tenth of a second, and few roads are of maps

    origin = pair.points[0]
    axis = on_plane(pair.points, origin)
    run = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(axis, axis=0).T))])
    count = max(2, int(min(np.ceil(run[-1] / 5.0), 100_000)))
    station = np.linspace(0.0, run[-1], count)
    tree = cKDTree(np.column_stack([np.interp(station, run, axis[:, 0]), np.interp(station, run, axis[:, 1])]))
    nodes = on_plane(pair.other.points, origin)

    def there(along: float) -> float:
        at = [np.interp(along, pair.other.stations, nodes[:, axis]) for axis in (0, 1)]
        return float(station[tree.query(at)[1]])

    return there


def _within(spans: Iterable[_Span], station: Callable[[float], float], length: float) -> list[_Span]:
    """Return spans with stations of an axis (m), cut to its length; those beside it are left out."""
    rows = []
    for begin, end, tags in spans:
        low, high = sorted((station(begin), station(end)))
        if min(high, length) - max(low, 0.0) > 1e-6:
            rows.append((max(low, 0.0), min(high, length), tags))
    return rows


def _told(carriageways: _Carriageways) -> tuple[MappedSection, tuple[str, ...], tuple[str, ...]]:
    """Return what the tags of a road say of its section, what is left out of them, and remarks."""
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
    known = _values(spans, lambda tags: tags.get("surface"))
    if len(known) > 1 or any(word not in _PAVED for word in known):
        left_out.append(f"surfaces: {_stretches(carriageways, lambda tags: tags.get('surface'), 'surface={}')}")
    section = MappedSection(lanes, lane_width, None, one_way, speed, _PAVED.get(surface or ""))
    return section, tuple(left_out), tuple(remarks)


def _values(spans: Sequence[_Span], value: Callable[[Mapping[str, str]], T | None]) -> set[T]:
    return {tag_value for _, _, tags in spans if (tag_value := value(tags)) is not None}


def _there(value: str | None) -> str | None:
    return None if value in (None, "no") else value


def _lane_width(spans: Sequence[_Span], lanes: int | None, one_way: bool) -> tuple[float | None, str | None]:
    """Return the width of a lane (m) by the width of the carriageway, and what is to be said where it gives none."""
    text = _most(spans, lambda tags: tags.get("width"))
    if text is None:
        return None, None
    width = metres(text)
    if width is None or lanes is None:
        return None, f"width={text[:40]!r}: " + (
            "it is no length" if width is None else "the number of lanes is missing"
        )
    lane = width / (lanes if one_way else 2 * lanes)
    if not _NARROWEST <= lane <= _WIDEST:
        return None, f"width={text[:40]!r}: lanes would be {lane:.2f} m wide, {_NARROWEST:g} to {_WIDEST:g} are allowed"
    return round(lane, 3), None


def _most(spans: Sequence[_Span], value: Callable[[Mapping[str, str]], T | None]) -> T | None:
    """Return the value that most of the length has, None where none has any."""
    lengths: dict[T, float] = defaultdict(float)
    for begin, end, tags in spans:
        tag_value = value(tags)
        if tag_value is not None:
            lengths[tag_value] += end - begin
    return max(lengths, key=lambda key: lengths[key]) if lengths else None


def _stretches(
    carriageways: _Carriageways, value: Callable[[Mapping[str, str]], object], text: str, also: str | None = None
) -> str:
    """Return where a value holds on each carriageway, as text; stretches of one value in a row are one."""
    texts = list[str]()
    for name, spans in carriageways.items():
        rows: list[tuple[str, float, float]] = []
        for begin, end, tags in sorted(spans, key=lambda span: span[:2]):
            tag_value = value(tags)
            if tag_value is None:
                continue
            shown = text.format(str(tag_value)[:40])
            if also and also in tags:
                shown += f" {also}={tags[also][:10]}"
            if rows and rows[-1][0] == shown and begin <= rows[-1][2] + 1.0:
                rows[-1] = (shown, rows[-1][1], max(rows[-1][2], end))
            else:
                rows.append((shown, begin, end))
        shown_rows = [f"{shown} from {begin:.0f} m to {end:.0f} m" for shown, begin, end in rows[:_SHOWN]]
        more = f" and {len(rows) - _SHOWN} more" if len(rows) > _SHOWN else ""
        texts += [(f"{name}: " if name else "") + ", ".join(shown_rows) + more] if rows else []
    return "; ".join(texts)
