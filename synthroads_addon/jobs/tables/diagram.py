"""Lines and texts of a road's profile and cross-section, in pixels from a view's lower left corner.

From top to bottom: the profile (ground, tangents, gradient line, vertical points), the band of curvature, the band of
both carriageways' crossfall, each over the stations, and the cross-section at one station.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from ...base.arrays import Float
from ...base.errors import InputError
from ...base.text.labels import apart
from ...road.geometry import RoadGeometry
from ...road.objects import width_at
from ...road.section import Carriageway
from ...road.tables.elements import element_rows
from ...road.tables.points import strip_names, strip_width
from ...road.terrain import ground_elevation, surface_elevation

Role = Literal[
    "frame", "grid", "ground", "tangent", "road", "point", "curvature", "left", "right", "station", "text", "faint"
]
"""Kinds of lines and texts, which have a colour each."""
_SAMPLES = 400
"""Stations at which ground and gradient line are drawn; more than a view has columns for is not seen. Chosen."""
_MARGIN_LEFT, _MARGIN, _TEXT_ROW = 64.0, 16.0, 16.0
"""Room for the scale's numbers, at other edges, and for a row of text, pixels at a scale of 1. Chosen."""
_LETTER = 6.5
"""Mean width of a letter, pixels at a scale of 1."""
_SHARES = (0.42, 0.14, 0.14, 0.30)
"""Shares of the height for profile, curvature, crossfall and cross-section. Chosen."""
_ROWS_BELOW = (0, 2)
"""Bands with a row of text below them: the stations, and that of the cross-section."""
_BESIDE = 12.0
"""Ground that is shown beside the verges in the cross-section, m. Chosen."""
_LARGEST_EXAGGERATION = 10.0
"""Heights of a cross-section are drawn at most so many times as large as its widths. Chosen: 2.5 % is then seen."""
_LEAST_HEIGHT = 2.0
"""Height that a profile's scale covers at least, m: a level road isn't a line on the frame."""
SHORTEST_SHOWN = 10.0
"""Least length of road that a view shows, m. Chosen."""
_TICK_SPACING = 90.0
"""Least distance of two numbers of a scale along the road, pixels at a scale of 1. Chosen."""


class DiagramLine(NamedTuple):
    """A polyline.

    Attributes:
        role: what it is.
        points: (N, 2) pixels.
        width: pixels at a scale of 1.
    """

    role: Role
    points: Float
    width: float = 1.0


class DiagramText(NamedTuple):
    """A text on one line.

    Attributes:
        role: what it is.
        x, y: of its baseline at the place that `align` names, pixels.
        text: what is written.
        align: whether it begins, has its middle or ends at x.
    """

    role: Role
    x: float
    y: float
    text: str
    align: Literal["left", "center", "right"] = "left"


@dataclass
class Diagram:
    """Lines and texts that are drawn into a view.

    Attributes:
        lines, texts: from the lowest to the uppermost.
        left, right: of the bands, pixels.
        first, last: stations between which the road is shown, m.
        points: number, from 0, and pixels of each vertical point that is shown.
    """

    left: float
    right: float
    first: float
    last: float
    lines: list[DiagramLine] = field(default_factory=list)
    texts: list[DiagramText] = field(default_factory=list)
    points: list[tuple[int, float, float]] = field(default_factory=list)

    @property
    def length(self) -> float:
        """Return the length of the road that is shown, m."""
        return self.last - self.first

    def station(self, x: float) -> float:
        """Return the station, m, at pixels from the view's left edge, within what is shown."""
        share = (x - self.left) / (self.right - self.left)
        return self.first + self.length * min(max(share, 0.0), 1.0)

    def x(self, station: Float | float) -> Float:
        """Return the pixels of stations, m."""
        return np.asarray(self.left + (self.right - self.left) * (np.asarray(station) - self.first) / self.length)


@dataclass(frozen=True)
class _Band:
    """A part of the view with a scale of its own, from a lower to an upper value.

    Attributes:
        bottom, top: pixels.
        low, high: values there.
    """

    bottom: float
    top: float
    low: float
    high: float

    def y(self, value: Float | float) -> Float:
        """Return the pixels of values."""
        return self.bottom + (self.top - self.bottom) * (np.asarray(value) - self.low) / (self.high - self.low)


def zoomed(shown: tuple[float, float], length: float, station: float, factor: float) -> tuple[float, float]:
    """Return the stations (m) between which a road of a length (m) is shown after zooming about a station.

    Args:
        shown: the stations so far.
        length: of the road.
        station: that keeps its place in the view.
        factor: of the shown length: below 1 zooms in. At least `SHORTEST_SHOWN` and at most the road are shown.

    Example:
        >>> zoomed((0.0, 1000.0), 1000.0, 250.0, 0.5)
        (125.0, 625.0)
        >>> zoomed((125.0, 625.0), 1000.0, 250.0, 4.0)
        (0.0, 1000.0)
    """
    before = shown[1] - shown[0]
    now = min(max(before * factor, min(SHORTEST_SHOWN, length)), length)
    first = station - (station - shown[0]) * now / before
    first = min(max(first, 0.0), length - now)
    return first, first + now


def picked_point(diagram: Diagram, x: float, y: float, reach: float) -> int | None:
    """Return the number, from 0, of the vertical point nearest to pixels of a view; None if none is near."""
    near = [(abs(px - x) + abs(py - y), number) for number, px, py in diagram.points]
    near = [pair for pair in near if pair[0] <= 2.0 * reach]
    return min(near)[1] if near else None


def road_diagram(
    geometry: RoadGeometry,
    station: float,
    width: float,
    height: float,
    scale: float = 1.0,
    shown: tuple[float, float] | None = None,
) -> Diagram:
    """Return a road's profile, bands and cross-section for a view.

    Args:
        geometry: of the road.
        station: of the cross-section, m; the nearest one on the road counts.
        width, height: of the view, pixels.
        scale: of texts and margins, as the screen's resolution has it.
        shown: stations (m) between which the road is shown; all of it if None.
    """
    first, last = shown or (0.0, geometry.length)
    station = float(np.clip(station, 0.0, geometry.length))
    diagram = Diagram(_MARGIN_LEFT * scale, max(width - _MARGIN * scale, _MARGIN_LEFT * scale + 1.0), first, last)
    row = _TEXT_ROW * scale
    rooms = _rooms(height, row, scale)
    metres = diagram.length / (diagram.right - diagram.left)  # per pixel
    ticks = list(_ticks(first, last, _TICK_SPACING * scale * metres))
    _profile(diagram, geometry, rooms[0], ticks, scale)
    _curvature(diagram, geometry, rooms[1], scale)
    _crossfalls(diagram, geometry, rooms[2], scale)
    at = float(diagram.x(station))
    if first <= station <= last:
        diagram.lines.append(DiagramLine("station", np.array([[at, rooms[2][0]], [at, rooms[0][1]]]), 1.5))
        text = f"Station {station:,.2f} m"
        diagram.texts.append(DiagramText("station", at, rooms[2][0] - row, text, _inner_align(diagram, at)))
    _cross_section(diagram, geometry, station, rooms[3], scale)
    return diagram


def _rooms(height: float, row: float, scale: float) -> list[tuple[float, float]]:
    """Return the lower and upper edges, pixels, of profile, curvature, crossfall and cross-section.

    Above each is a row of text, and one below the profile and the crossfall; they share what is left.

    Args:
        height: of the view, pixels.
        row: height of a row of text, pixels.
        scale: of margins.
    """
    left = max(height - 2.0 * _MARGIN * scale - 1.3 * row * (len(_SHARES) + len(_ROWS_BELOW)), 1.0)
    rooms, top = [], height - _MARGIN * scale
    for number, share in enumerate(_SHARES):
        top -= 1.3 * row
        rooms.append((top - share * left, top))
        top -= share * left + (1.3 * row if number in _ROWS_BELOW else 0.0)
    return rooms


def _inner_align(diagram: Diagram, x: float) -> Literal["left", "center", "right"]:
    """Return the alignment of a text at a place which keeps it within the view."""
    share = (x - diagram.left) / (diagram.right - diagram.left)
    return "left" if share < 0.1 else "right" if share > 0.9 else "center"


def _ticks(low: float, high: float, spacing: float) -> Iterator[float]:
    """Yield the round numbers from `low` to `high` that are a 1, 2 or 5 times a power of ten apart, over `spacing`."""
    power = 10.0 ** math.floor(math.log10(max(spacing, 1e-9)))
    step = next(power * factor for factor in (1.0, 2.0, 5.0, 10.0) if power * factor >= spacing * (1.0 - 1e-9))
    for number in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1):
        yield number * step


def _frame(diagram: Diagram, band: _Band, title: str, scale: float) -> None:
    """Add a band's frame and title."""
    corners = [(diagram.left, band.bottom), (diagram.right, band.bottom)]
    corners += [(diagram.right, band.top), (diagram.left, band.top), (diagram.left, band.bottom)]
    diagram.lines.append(DiagramLine("frame", np.array(corners)))
    diagram.texts.append(DiagramText("text", diagram.left, band.top + 0.3 * _TEXT_ROW * scale, title))


def _scale_numbers(diagram: Diagram, band: _Band, unit: str, scale: float) -> None:
    """Add the numbers of a band's scale and their lines."""
    spacing = 2.0 * _TEXT_ROW * scale * (band.high - band.low) / max(band.top - band.bottom, 1.0)
    for value in _ticks(band.low, band.high, spacing):
        y = float(band.y(value))
        diagram.lines.append(DiagramLine("grid", np.array([[diagram.left, y], [diagram.right, y]])))
        text = f"{value:g}{unit}".replace("-0" if value == 0.0 else "\0", "0")
        diagram.texts.append(
            DiagramText("faint", diagram.left - 6.0 * scale, y - 0.25 * _TEXT_ROW * scale, text, "right")
        )


def _profile(
    diagram: Diagram, geometry: RoadGeometry, room: tuple[float, float], ticks: list[float], scale: float
) -> None:
    """Add the profile: ground along the axis, tangents, gradient line, vertical points with their radii."""
    axis = geometry.parameters.alignment
    first, last = diagram.first, diagram.last
    on_road = [s for s in geometry.profile.breakpoints if first < s < last]
    station = np.union1d(np.linspace(first, last, _SAMPLES), on_road)
    elevation = geometry.profile.elevation(station)
    ground = _ground(geometry, station)
    points = [(p.station, p.elevation, p.radius) for p in axis.vertical if first <= p.station <= last]
    values = np.concatenate([elevation, ground[np.isfinite(ground)], [point[1] for point in points]])
    low, high = float(values.min()), float(values.max())
    spare = 0.08 * max(high - low, _LEAST_HEIGHT) + 0.5 * max(0.0, _LEAST_HEIGHT - (high - low))
    band = _Band(*room, low - spare, high + spare)
    ratio = ((band.top - band.bottom) / (band.high - band.low)) / ((diagram.right - diagram.left) / diagram.length)
    _frame(diagram, band, f"Profile, heights x {ratio:.3g}", scale)
    _scale_numbers(diagram, band, " m", scale)
    for tick in ticks:
        x = float(diagram.x(tick))
        diagram.lines.append(DiagramLine("grid", np.array([[x, band.bottom], [x, band.top]])))
        text = DiagramText("faint", x, band.bottom - _TEXT_ROW * scale, f"{tick:,.0f} m", _inner_align(diagram, x))
        diagram.texts.append(text)
    is_known = np.isfinite(ground)
    if is_known.any():
        diagram.lines.append(
            DiagramLine("ground", np.column_stack([diagram.x(station[is_known]), band.y(ground[is_known])]), 1.5)
        )
    tangents = geometry.profile.grades
    kinks = np.array([first, *(point[0] for point in points if first < point[0] < last), last])
    if len(tangents):
        diagram.lines.append(
            DiagramLine("tangent", np.column_stack([diagram.x(kinks), band.y(_tangents(geometry, kinks))]))
        )
    diagram.lines.append(DiagramLine("road", np.column_stack([diagram.x(station), band.y(elevation)]), 2.5))
    size = 4.0 * scale
    names: list[DiagramText] = []
    for number, point in enumerate(axis.vertical, 1):
        if not first <= point.station <= last:
            continue
        x, y = float(diagram.x(point.station)), float(band.y(point.elevation))
        diagram.points.append((number - 1, x, y))
        diamond = np.array([(x - size, y), (x, y + size), (x + size, y), (x, y - size), (x - size, y)])
        diagram.lines.append(DiagramLine("point", diamond, 1.5))
        radius = f", H {point.radius:,.0f} m" if point.radius else ""
        align = _inner_align(diagram, x)
        beside = {"left": 2.0, "center": 0.0, "right": -2.0}[align] * size
        names.append(DiagramText("point", x + beside, y + 1.8 * size, f"{number}{radius}", align))
    diagram.texts += _apart(names, scale)


def _apart(texts: list[DiagramText], scale: float) -> list[DiagramText]:
    """Return texts, each moved up where it would cover one before it."""
    widths = [_LETTER * scale * len(text.text) for text in texts]
    shares = [{"left": 0.0, "center": 0.5, "right": 1.0}[text.align] for text in texts]
    places = [(text.x - share * width, text.y) for text, share, width in zip(texts, shares, widths, strict=True)]
    moved = apart(places, [(width, 0.8 * _TEXT_ROW * scale) for width in widths])
    return [text._replace(y=place[1]) for text, place in zip(texts, moved, strict=True)]


def _tangents(geometry: RoadGeometry, station: Float) -> Float:
    """Return the heights, m, of the tangents through the vertical points at stations (N,)."""
    points = geometry.parameters.alignment.vertical
    known = np.array([point.station for point in points])
    heights = np.array([point.elevation for point in points])
    inner = np.interp(station, known, heights)
    grades = geometry.profile.grades
    before = heights[0] + grades[0] * (station - known[0])
    after = heights[-1] + grades[-1] * (station - known[-1])
    return np.where(station < known[0], before, np.where(station > known[-1], after, inner))


def _ground(geometry: RoadGeometry, station: Float) -> Float:
    """Return the ground's heights (N,), m, along the axis; NaN where they aren't known."""
    if geometry.terrain is None:
        return np.full(station.shape, np.nan)
    try:
        return ground_elevation(geometry, geometry.terrain, station, np.zeros(station.shape))
    except InputError:
        return np.full(station.shape, np.nan)


def _curvature(diagram: Diagram, geometry: RoadGeometry, room: tuple[float, float], scale: float) -> None:
    """Add the band of curvature, left curves upwards, with the radii and A that fit."""
    elements = geometry.parameters.alignment.horizontal
    largest = max(abs(k) for e in elements for k in (e.curvature_start, e.curvature_end))
    band = _Band(*room, -1.15 * (largest or 1.0), 1.15 * (largest or 1.0))
    _frame(diagram, band, "Curvature: left curves upwards", scale)
    middle = float(band.y(0.0))
    diagram.lines.append(DiagramLine("grid", np.array([[diagram.left, middle], [diagram.right, middle]])))
    corners: list[tuple[float, float]] = []
    for row, element in zip(element_rows(elements), elements, strict=True):
        span = max(row.station, diagram.first), min(row.station + element.length, diagram.last)
        if span[0] >= span[1]:
            continue
        begin, end = (float(diagram.x(station)) for station in span)
        change = (element.curvature_end - element.curvature_start) / element.length
        curvatures = [element.curvature_start + change * (station - row.station) for station in span]
        corners += [(begin, float(band.y(curvatures[0]))), (end, float(band.y(curvatures[1])))]
        text = {"line": "straight", "arc": f"R {abs(row.radius):,.0f}", "clothoid": f"A {row.parameter:,.0f}"}[row.kind]
        if end - begin > _LETTER * scale * (len(text) + 1):
            is_below = element.curvature_start + element.curvature_end >= 0.0
            y = middle + (-1.0 if is_below else 0.35) * _TEXT_ROW * scale
            diagram.texts.append(DiagramText("text", 0.5 * (begin + end), y, text, "center"))
    diagram.lines.append(DiagramLine("curvature", np.array(corners), 2.0))


def _crossfalls(diagram: Diagram, geometry: RoadGeometry, room: tuple[float, float], scale: float) -> None:
    """Add the band of both carriageways' crossfall, %, positive where the surface falls to the right."""
    carriageways = geometry.parameters.of_type(Carriageway).values()
    largest = max(abs(p.crossfall_percent) for item in carriageways for p in item.crossfall)
    band = _Band(*room, -1.2 * max(largest, 2.5), 1.2 * max(largest, 2.5))
    _frame(diagram, band, "Crossfall in %: falling to the right upwards", scale)
    _scale_numbers(diagram, band, " %", scale)
    for item in carriageways:
        known = [p.station for p in item.crossfall]
        station = np.array([diagram.first, *(s for s in known if diagram.first < s < diagram.last), diagram.last])
        percent = np.interp(station, known, [p.crossfall_percent for p in item.crossfall])
        diagram.lines.append(DiagramLine(item.side, np.column_stack([diagram.x(station), band.y(percent)]), 2.0))


def _cross_section(
    diagram: Diagram, geometry: RoadGeometry, station: float, room: tuple[float, float], scale: float
) -> None:
    """Add the cross-section at a station: the surface from left to right, widths of strips, crossfalls."""
    at = np.array([station])
    edges = geometry.offsets(at)[0]
    reach = _BESIDE if geometry.terrain is not None else 0.0
    left, right = float(edges[0]) + reach, float(edges[-1]) - reach
    offset = np.unique(np.concatenate([edges, np.linspace(right, left, _SAMPLES // 2)]))[::-1]
    try:
        height = surface_elevation(geometry, np.full(offset.shape, station), offset)
    except InputError:
        height = np.full(offset.shape, np.nan)
    is_known = np.isfinite(height)
    offset, height = offset[is_known], height[is_known]
    if len(offset) < 2:
        return
    width_px = diagram.right - diagram.left
    pixels = width_px / (left - right)
    low, high = float(height.min()), float(height.max())
    room_px = max(room[1] - room[0] - 3.0 * _TEXT_ROW * scale, 0.3 * (room[1] - room[0]))
    exaggeration = min(_LARGEST_EXAGGERATION, room_px / (pixels * max(high - low, 0.1)))
    middle = 0.5 * (room[0] + room[1]) - 0.5 * _TEXT_ROW * scale

    def place(offsets: Float, heights: Float) -> Float:
        x = diagram.left + (left - offsets) * pixels
        return np.column_stack([x, middle + (heights - 0.5 * (low + high)) * pixels * exaggeration])

    band = _Band(*room, 0.0, 1.0)
    _frame(diagram, band, f"Cross-section at {station:,.2f} m, heights x {exaggeration:.3g}", scale)
    on_road = (offset <= edges[0]) & (offset >= edges[-1])
    diagram.lines.append(DiagramLine("ground", place(offset, height), 1.5))
    diagram.lines.append(DiagramLine("road", place(offset[on_road], height[on_road]), 2.5))
    axis_x = float(place(np.zeros(1), np.zeros(1))[0, 0])
    diagram.lines.append(DiagramLine("station", np.array([[axis_x, room[0]], [axis_x, room[1]]]), 1.0))
    for item in geometry.parameters.of_type(Carriageway).values():
        _widths(diagram, item, station, room, lambda offset: diagram.left + (left - offset) * pixels, scale)


def _widths(
    diagram: Diagram,
    carriageway: Carriageway,
    station: float,
    room: tuple[float, float],
    to_x: Callable[[float], float],
    scale: float,
) -> None:
    """Add the widths of a carriageway's strips below the cross-section, and its crossfall above it.

    Args:
        diagram: that gets them.
        carriageway: of the road.
        station: of the cross-section, m.
        room: lower and upper edge of the cross-section, pixels.
        to_x: function from an offset (m) to pixels.
        scale: of texts.
    """
    row, sign = _TEXT_ROW * scale, carriageway.sign
    text_y = room[0] + 0.4 * row
    first = inner = float(width_at(carriageway.inner_offset, station))
    for strip in strip_names(carriageway)[1:]:
        strip_m = float(width_at(strip_width(carriageway, strip), station))
        ends = to_x(sign * inner), to_x(sign * (inner + strip_m))
        for x in ends:
            diagram.lines.append(DiagramLine("grid", np.array([[x, text_y + row], [x, text_y + 1.4 * row]])))
        text = f"{strip_m:.2f}"
        if abs(ends[1] - ends[0]) > _LETTER * scale * len(text):
            diagram.texts.append(DiagramText("faint", 0.5 * sum(ends), text_y, text, "center"))
        inner += strip_m
    known = [point.station for point in carriageway.crossfall]
    percent = float(np.interp(station, known, [point.crossfall_percent for point in carriageway.crossfall]))
    middle = to_x(sign * 0.5 * (first + inner))
    diagram.texts.append(DiagramText(carriageway.side, middle, room[1] - 1.2 * row, f"{percent:+.2f} %", "center"))
