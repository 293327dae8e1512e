"""The cross-section in numbers, each with its standard deviation: lanes, strips, shoulders, median."""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal, Self

import numpy as np
from scipy import ndimage
from scipy.signal import find_peaks

from ..base.arrays import Bool, Float
from ..road.guidelines import STANDARD_CROSS_SECTIONS, StandardCrossSection
from .edges import FARTHEST, Edge
from .layout import Band, RoadKind, RoadLayout
from .lines import Line
from .smoothing import interval_mean, mean_with_std

Side = Literal["left", "right"]
SIDES: tuple[Side, ...] = ("right", "left")
"""Both sides, in the order of ascending offsets."""
LineKind = Literal["outer_edge", "lane", "inner_edge"]

EDGE_LINE, NARROW_LINE = 0.30, 0.15
"""Widths of outer edge lines and of all others on motorways, m (RMS)."""
_RURAL_EDGE_LINE, _RURAL_LINE = 0.25, 0.12
"""The same on other roads, m (RMS)."""
_LINE_TOLERANCE = 0.05
"""Distance of a measured width from a usual one that passes for it, m. Chosen: a third of the narrowest line's
width."""
_WIDEST_STRIP = 1.25
"""Width of an edge strip at most, m: pavement outside of the lanes that is wider has a hard shoulder. Chosen: the
standard cross-sections have strips of 0.75 m at most, and shoulders of 2 m at least."""
_STRIP_LIMIT = 2.0
"""Width of an edge strip at most in a parameter set, m."""
_USUAL_STRIP = 0.5
"""Width of a strip that isn't seen, m. Chosen: that of most standard cross-sections."""
_PAINT_STD, _EDGE_STD = 0.04, 0.08
"""Deviation of lines and edges found by brightness that they share all along a road, m. Chosen: a quarter of a line's
width, and a tuft of grass."""
_FEWEST_EDGES = 0.2
"""Share of the stretches that must show an edge for it to be seen. Chosen: what shows on fewer is a fault."""
_AROUND, _SOLID = 7, 0.8
"""Stretches around one, and their share of paint along a solid line. Chosen: 35 m hold whole periods; along a dashed
line the share is less."""
_FEWEST_STRETCHES = 6
"""Stretches that a width is the mean of at least. Chosen: fewer are no usual part."""
_COMMON = 0.35
"""Share of the most common width's count from which on another one may be the usual one. Chosen: turnouts may be
longer."""
_MODE = 0.4
"""Distance about the most common width that is the same one, m. Chosen: less than strips and shoulders differ by."""
_NARROWEST, _WIDEST_LANE, _WIDEST_HALF = 2.3, 5.2, 8.0
"""Distances from a single carriageway's axis to lines and edges, m. Chosen: the narrowest and the widest lane; a lane
with a paved shoulder."""
_WIDEST = 6.0
"""Width of a strip or shoulder at most, m. Chosen: a hard shoulder and an emergency bay."""
STANDARD_TOLERANCE = 0.15
"""A cross-section all of whose widths are this near (m; half of it per lane) to a standard one's passes for it. Chosen:
standard ones of as many lanes differ by more."""


@dataclass(frozen=True)
class Estimate:
    """A measured number with its standard deviation, in the same unit."""

    value: float
    std: float

    @classmethod
    def of(cls, values: Float, spacing: Float | None = None, axis_std: float = 0.0) -> Self:
        """Return the robust mean of values (K,), in order along the road, with its standard deviation.

        Of values midway between rows of points, ``spacing`` (K,) from each other, m, it is that of `interval_mean`,
        which asks for the deviation of the axis that they are measured from, m.
        """
        if spacing is None or not (spacing[np.isfinite(values)] > 0.0).any():
            return cls(*mean_with_std(values))
        return cls(*interval_mean(values, spacing, axis_std))

    def __sub__(self, other: Self) -> Self:
        """Return the difference of two numbers whose errors are independent: Var(a - b) = Var(a) + Var(b)."""
        return type(self)(self.value - other.value, float(np.hypot(self.std, other.std)))

    def widened(self, std: float) -> Self:
        """Return the number with one more independent error of a standard deviation."""
        return type(self)(self.value, float(np.hypot(self.std, std)))

    def to_dict(self, digits: int = 4) -> dict[str, float | None]:
        """Return value and standard deviation, rounded, as JSON data; null where not finite."""
        return {"value": _finite(self.value, digits), "std": _finite(self.std, digits)}


@dataclass(frozen=True)
class SideSection:
    """Cross-section of one carriageway (or half of a single one), measured outwards from the axis.

    Attributes:
        side: of the axis.
        lines: its lines from inside to outside; those of a single carriageway without the middle one. None where a
            line must be but wasn't seen.
        inner_edge, outer_edge: of the pavement, as distances from the axis; NaN where not seen.
        usual: (K,) where the outer edge is that of the road and not of a turnout.
        inner_offset, inner_strip, outer_width, strip, shoulder: widths, m; ``outer_width`` is that of all pavement
            outside of the lanes, which ``strip`` and ``shoulder`` share.
        lanes: widths from inside to outside, m.
        edge_seen: whether the pavement's outer edge was seen.
        closed: whether the outermost line is an edge line: else there may be further lanes outside.
        assumed: name of the standard cross-section that the lanes were taken from, as their lines weren't seen.
        mirrored: whether the edge line was only seen on the other side of a single carriageway.
        axis_std: standard deviation of where the axis lies, m, from which all is measured.
        edge_stds: of the inner and the outer edge, m, what they share all along the road.
    """

    side: Side
    lines: list[Line | None]
    inner_edge: Edge
    outer_edge: Edge
    usual: Bool
    inner_offset: Estimate
    inner_strip: Estimate
    lanes: list[Estimate]
    outer_width: Estimate
    strip: Estimate
    shoulder: Estimate
    edge_seen: bool
    closed: bool
    assumed: str | None = None
    mirrored: bool = False
    axis_std: float = 0.0
    edge_stds: tuple[float, float] = (0.0, 0.0)

    @property
    def sign(self) -> int:
        """Return the sign of the side's offsets: 1 to the left, -1 to the right."""
        return 1 if self.side == "left" else -1

    @property
    def paved_width(self) -> Estimate:
        """Return the width of the pavement from edge to edge, m; from its parts where an edge isn't seen."""
        width = np.where(self.usual, self.outer_edge.offsets - self.inner_edge.offsets, np.nan)
        if self.edge_seen and np.isfinite(width).any():
            inner, outer = (np.where(self.usual, edge.offsets, np.nan) for edge in (self.inner_edge, self.outer_edge))
            low = Estimate.of(inner, self.inner_edge.spacing, self.axis_std).widened(self.edge_stds[0])
            return Estimate.of(outer, self.outer_edge.spacing, self.axis_std).widened(self.edge_stds[1]) - low
        parts = [self.inner_strip, *self.lanes, self.outer_width]
        return Estimate(sum(p.value for p in parts), float(np.sqrt(sum(p.std**2 for p in parts))))


@dataclass(frozen=True)
class MeasuredSection:
    """Measured cross-section of the road, with the standard one that is nearest to it.

    Attributes:
        kind: dual or single carriageway.
        sides: by name.
        middle: the middle line of a single carriageway.
        nearest: name of the nearest standard cross-section; empty for a single carriageway.
        distance: largest difference from it, m.
    """

    kind: RoadKind
    sides: dict[Side, SideSection]
    middle: Line | None = None
    nearest: str = ""
    distance: float = np.inf

    @property
    def standard(self) -> str | None:
        """Return the name of the standard cross-section within `STANDARD_TOLERANCE` of it; None if there is none."""
        return self.nearest if self.distance <= STANDARD_TOLERANCE else None

    @property
    def median(self) -> Estimate | None:
        """Return the width between the carriageways' inner edges, m; None for a single carriageway."""
        if self.kind == "single":
            return None
        left, right = self.sides["left"].inner_offset, self.sides["right"].inner_offset
        return Estimate(left.value + right.value, float(np.hypot(left.std, right.std)))


def measure_section(layout: RoadLayout, marked: bool, axis_std: float = 0.0) -> MeasuredSection:
    """Return the cross-section, with standard deviations, that profiles along the alignment show.

    Args:
        layout: of profiles along the alignment, so that offset 0 is the axis.
        marked: whether paint is known by class; if not, lines look wider than they are and get the usual widths.
        axis_std: standard deviation of where the axis lies, m, from which all is measured.
    """
    bands = zip(SIDES, layout.bands * (2 if layout.kind == "single" else 1), strict=True)
    parts = [_SidePart(layout, band, side, marked, axis_std) for side, band in bands]
    if layout.kind == "single":
        return MeasuredSection("single", {part.side: _half_section(part) for part in parts}, layout.bands[0].middle)
    sides = {part.side: _carriageway(part) if len(part.band.lines) > 1 else _assumed_section(part) for part in parts}
    return MeasuredSection("dual", sides, None, *nearest_standard(sides))


def carriageway_middles(section: MeasuredSection) -> list[float]:
    """Return the offsets, m, of the carriageways' middles, about which is pavement for sure."""
    if section.kind != "dual":
        return [0.0]
    sides = section.sides.values()
    return [side.sign * (side.inner_offset.value + 0.5 * side.paved_width.value) for side in sides]


@dataclass(frozen=True)
class _SidePart:
    """Inputs for measuring one side of the road.

    Attributes:
        layout, marked, axis_std: as in `measure_section`.
        band: the pavement that is its own, or that it has a half of.
        side: of the axis.
    """

    layout: RoadLayout
    band: Band
    side: Side
    marked: bool
    axis_std: float

    @property
    def sign(self) -> int:
        """Return the sign of the side's offsets: 1 to the left, -1 to the right."""
        return 1 if self.side == "left" else -1

    def everywhere(self, value: float) -> Float:
        """Return an array (K,) with the same value for each stretch."""
        return np.full(self.layout.profiles.stretches, value)

    def outer_edge(self, first: Float, last: Float) -> Edge:
        """Return the pavement's outer edge, m from the axis, beyond a last line, or before it where it is narrower.

        Args:
            first, last: (K,) distances of the innermost and the outermost line, m.
        """
        edge = self.edge(last)
        nearer = self.edge(first, reach=last - first + FARTHEST)
        unseen = ~np.isfinite(edge.offsets)
        return Edge(np.where(unseen, nearer.offsets, edge.offsets), np.where(unseen, nearer.spacing, edge.spacing))

    def edge(self, begin: Float, outwards: bool = True, reach: float | Float = FARTHEST) -> Edge:
        """Return the pavement's edge beyond distances (K,), m, from the axis, as distances from the axis."""
        sign = self.sign if outwards else -self.sign
        edge = self.layout.pavement.edge(self.sign * begin, sign, reach)
        return Edge(self.sign * edge.offsets, edge.spacing)


def line_width(line: Line | None, kind: LineKind, road: RoadKind, marked: bool) -> float:
    """Return the width, m, to write for a line: the usual one if the measured one is near it or unreliable."""
    edge, narrow = (_RURAL_EDGE_LINE, _RURAL_LINE) if road == "single" else (EDGE_LINE, NARROW_LINE)
    usual = edge if kind == "outer_edge" else narrow
    if line is None or not marked:
        return usual
    known = (_RURAL_LINE, NARROW_LINE, _RURAL_EDGE_LINE, EDGE_LINE)
    near = min(known, key=lambda width: abs(width - line.width))
    if abs(usual - line.width) <= _LINE_TOLERANCE:
        return usual
    return near if abs(near - line.width) <= _LINE_TOLERANCE else float(np.clip(round(line.width, 2), 0.05, 1.0))


def half_width(line: Line | None, kind: LineKind, road: RoadKind, marked: bool) -> tuple[float, float]:
    """Return half of the width, m, to write for a line, and its standard deviation as far as the line was measured."""
    std = 0.5 * line.width_std if line is not None and marked else 0.0
    return 0.5 * line_width(line, kind, road, marked), std


@dataclass(frozen=True)
class _Boundary:
    """A boundary of a lane as distances from the axis, m.

    Attributes:
        smoothed: (K,) along the road; NaN where it isn't there.
        measured: (K,) in single stretches; NaN where nothing was seen.
        spacing: (K,) distance of the rows of points that each lies midway between, 0 where it is a mean.
        seen: whether it was: else it is put evenly between its neighbours.
        std: of what all places share, m.
    """

    smoothed: Float
    measured: Float
    spacing: Float
    seen: bool = True
    std: float = 0.0

    @classmethod
    def of(cls, line: Line, sign: int) -> Self:
        """Return a line's middle as a boundary on the side of a sign."""
        return cls(sign * line.offsets, sign * line.measured, line.spacing)

    def shift(self, by: float, std: float) -> Self:
        """Return the boundary so much (m) farther outside, known no better than by a standard deviation, m."""
        std = float(np.hypot(self.std, std))
        return replace(self, smoothed=self.smoothed + by, measured=self.measured + by, std=std)

    def place(self, where: Bool, axis_std: float) -> Estimate:
        """Return the mean distance from the axis, of a standard deviation (m), in the stretches of a mask (K,), m."""
        values = np.where(where, self.measured, np.nan)
        estimate = Estimate.of(values if np.isfinite(values).any() else self.measured, self.spacing, axis_std)
        estimate = estimate.widened(self.std)
        return estimate if self.seen else replace(estimate, std=np.inf)


def _carriageway(part: _SidePart) -> SideSection:
    """Return the measured cross-section of one carriageway of a dual one."""
    lines, boundaries = _order_lines(part.band, part.sign)
    boundaries[0] = boundaries[0].shift(*half_width(lines[0], "inner_edge", "dual", part.marked))
    first, last = boundaries[0].smoothed, boundaries[-1].smoothed
    outer = part.outer_edge(_fill_with_median(first), _fill_with_median(last))
    if not _lacks_outer_lane(lines[-1], outer):
        half, std = half_width(lines[-1], "outer_edge", "dual", part.marked)
        boundaries[-1] = boundaries[-1].shift(-half, std)
    first = _fill_with_median(first)
    return _summarise_side(part, lines, boundaries, part.edge(first, False, first), outer)


def _half_section(part: _SidePart) -> SideSection:
    """Return the measured cross-section of one direction of a single carriageway, from the axis outwards."""
    nowhere = part.everywhere(0.0)
    beside = {s: _half_lines(part.band, s, part.marked) for s in (1, -1)}
    lines: list[Line | None] = [part.band.middle, *beside[part.sign]]
    columns = [_Boundary(nowhere, nowhere, nowhere), *(_Boundary.of(line, part.sign) for line in beside[part.sign])]
    outer = part.edge(part.everywhere(_NARROWEST), reach=_WIDEST_HALF)
    mirrored = len(lines) == 1 and bool(beside[-part.sign])
    if len(lines) > 1:
        half_line, std = half_width(lines[-1], "outer_edge", "single", part.marked)
        columns[-1] = columns[-1].shift(-half_line, std)
    elif mirrored:
        other = min(abs(line.offset) for line in beside[-part.sign])
        place = part.everywhere(other - 0.5 * line_width(None, "outer_edge", "single", part.marked))
        columns.append(_Boundary(place, place, nowhere, False))
    else:  # no edge line at all: the lane reaches to the pavement's edge
        visible = bool(np.isfinite(outer.offsets).any())
        place = outer.offsets if visible else part.everywhere(0.5 * part.band.width)
        columns.append(_Boundary(place, place, outer.spacing, visible))
    lines += [None] * (len(columns) - len(lines))
    inner = Edge(nowhere, nowhere)
    half = _summarise_side(part, lines, columns, inner, outer)
    nothing = Estimate(0.0, 0.0)
    return replace(half, inner_offset=nothing, inner_strip=nothing, mirrored=mirrored)


def _half_lines(band: Band, sign: int, marked: bool) -> list[Line]:
    """Return the lines on one half of a single carriageway, outwards; if not ``marked`` just the most painted one.

    Where brightness tells paint, seams and verges pass for lines too: only the best in a lane's distance counts.
    """
    lines = sorted(
        (line for line in band.lines if sign * line.offset > _NARROWEST), key=lambda line: sign * line.offset
    )
    if marked:
        return lines
    near = [line for line in lines if sign * line.offset < _WIDEST_LANE]
    return [max(near, key=lambda line: line.length * line.width)] if near else []


def _assumed_section(part: _SidePart) -> SideSection:
    """Return a carriageway whose lines aren't seen, with the lanes of the standard section nearest in width."""
    middle = part.everywhere(part.sign * 0.5 * (part.band.low + part.band.high))
    outer = part.edge(middle, reach=0.5 * part.band.width + _WIDEST)
    inner = part.edge(middle, False, np.abs(middle))
    width = mean_with_std(outer.offsets - inner.offsets)[0]
    width = width if np.isfinite(width) else part.band.width
    name = min(STANDARD_CROSS_SECTIONS, key=lambda key: abs(STANDARD_CROSS_SECTIONS[key].paved_width - width))
    row = STANDARD_CROSS_SECTIONS[name]
    first = inner.offsets + row.inner_edge_strip
    places = [first + sum(row.lanes[::-1][:i]) for i in range(len(row.lanes) + 1)]
    columns = [_Boundary(place, place, inner.spacing, False) for place in places]
    lines: list[Line | None] = [None] * len(columns)
    measured_side = _summarise_side(part, lines, columns, inner, outer)
    lanes = [Estimate(lane, np.inf) for lane in reversed(row.lanes)]
    return replace(measured_side, lanes=lanes, inner_strip=Estimate(row.inner_edge_strip, np.inf), assumed=name)


def _lacks_outer_lane(line: Line | None, outer: Edge) -> bool:
    """Return whether the outermost line is dashed with no edge seen, so that the cloud lacks the outer lane."""
    return line is not None and not line.solid and not _is_visible(outer)


def _is_visible(edge: Edge) -> bool:
    return bool(np.isfinite(edge.offsets).mean() > _FEWEST_EDGES)


def _fill_with_median(distance: Float) -> Float:
    """Return distances (K,) with unknown ones replaced by the median."""
    return np.where(np.isfinite(distance), distance, np.nanmedian(distance))


def _summarise_side(
    part: _SidePart, lines: list[Line | None], boundaries: list[_Boundary], inner: Edge, outer: Edge
) -> SideSection:
    """Return a side's widths, with standard deviations, from lines and edges measured in each stretch."""
    edge_seen = _is_visible(outer)
    outer_width = outer.offsets - _fill_with_median(boundaries[-1].smoothed)
    if part.band.usual is not None:
        outer_width = np.where(part.band.usual, outer_width, np.nan)
    usual = _usual_stretches(outer_width, lines[-1])
    mask = usual if usual.sum() >= _FEWEST_STRETCHES else np.ones(len(usual), dtype=bool)
    paint_std = 0.0 if part.marked else _PAINT_STD
    offsets = [boundary.place(mask, part.axis_std).widened(paint_std) for boundary in boundaries]
    edge_std = 0.0 if part.layout.profiles.paved is not None else _EDGE_STD
    if part.layout.kind == "single":  # its lanes begin at the axis
        offsets[0] = replace(offsets[0], std=part.axis_std)
    outside = Estimate(_USUAL_STRIP, np.inf)
    if edge_seen:
        # Over the same stretches as the lines, so that what all of them share goes out of the difference.
        edge = Estimate.of(np.where(mask, outer.offsets, np.nan), outer.spacing, part.axis_std)
        outside = edge.widened(edge_std) - offsets[-1]
    outside = Estimate(float(np.clip(outside.value, 0.0, 2.0 + _WIDEST)), outside.std)
    strip, shoulder = _share_pavement(outside)
    inner_offset, inner_strip = _inner_widths(offsets[0], inner, mask, edge_std, part.axis_std)
    # The axis' own error is in no difference of two lines, but in the distance from it.
    inner_offset = inner_offset.widened(part.axis_std)
    return SideSection(
        side=part.side,
        lines=lines,
        inner_edge=inner,
        outer_edge=outer,
        usual=usual,
        inner_offset=inner_offset,
        inner_strip=inner_strip,
        lanes=[after - before for before, after in pairwise(offsets)],
        outer_width=outside,
        strip=strip,
        shoulder=shoulder,
        edge_seen=edge_seen,
        closed=not _lacks_outer_lane(lines[-1], outer),
        axis_std=part.axis_std,
        edge_stds=(edge_std if part.layout.kind == "dual" else part.axis_std, edge_std),
    )


def _inner_widths(
    lane_boundary: Estimate, inner: Edge, mask: Bool, edge_std: float, axis_std: float
) -> tuple[Estimate, Estimate]:
    """Return the distance of the pavement's inner edge from the axis, and the inner edge strip's width, m.

    Args:
        lane_boundary: distance of the innermost lane's inner boundary from the axis.
        inner: the pavement's inner edge.
        mask: (K,) the stretches that count.
        edge_std, axis_std: standard deviations of any edge and of the axis, m.
    """
    if _is_visible(inner):
        edge = Estimate.of(np.where(mask, inner.offsets, np.nan), inner.spacing, axis_std).widened(edge_std)
        strip = lane_boundary - edge
    else:
        # Assumed, not measured: an infinite standard deviation says so.
        edge = Estimate(lane_boundary.value - _USUAL_STRIP, np.inf)
        strip = Estimate(_USUAL_STRIP, np.inf)
    width = float(np.clip(strip.value, 0.0, _STRIP_LIMIT))
    return Estimate(max(0.0, edge.value), edge.std), Estimate(width, strip.std)


def _usual_stretches(width: Float, line: Line | None) -> Bool:
    """Return a mask (K,) of the stretches where the pavement outside of the lanes is the road's own, not a turnout's.

    Beside exits and entries the edge line is a dashed one; beside an emergency bay the pavement is wider.
    """
    usual = np.isfinite(width)
    if line is not None and line.solid:
        cover = np.where(np.isfinite(line.cover), line.cover, 0.0)
        solid = ndimage.uniform_filter1d(cover, _AROUND, mode="nearest") > _SOLID
        usual &= solid if (solid & usual).sum() >= _FEWEST_STRETCHES else usual
    if not usual.any():
        return usual
    count, edges = np.histogram(width[usual], np.arange(-1.0, 10.0, 0.1))
    density = ndimage.uniform_filter1d(count.astype(np.float64), 3)
    # Turnouts make the pavement wider, and on a short road may be longer than what lies between them: of the common
    # widths the smallest is the road's own.
    peak = int(find_peaks(np.pad(density, 1), height=_COMMON * density.max())[0][0]) - 1
    return usual & (np.abs(width - edges[peak] - 0.05) < _MODE)


def _order_lines(band: Band, sign: int) -> tuple[list[Line | None], list[_Boundary]]:
    """Return lines outwards (None: unseen), and where they lie; unseen ones evenly between their neighbours."""
    pairs: list[tuple[float, Line | None]] = [(sign * band.place(line), line) for line in band.lines]
    pairs += [(sign * offset, None) for offset in band.missing]
    pairs.sort(key=lambda pair: pair[0])
    lines = [line for _, line in pairs]
    measured = {number: _Boundary.of(line, sign) for number, line in enumerate(lines) if line is not None}
    boundaries = []
    for number in range(len(lines)):
        if number in measured:
            boundaries.append(measured[number])
            continue
        # Missing lines lie between measured ones only (`layout`), so that there is one on either side.
        before, after = max(i for i in measured if i < number), min(i for i in measured if i > number)
        share = (number - before) / (after - before)
        offset = (1.0 - share) * measured[before].smoothed + share * measured[after].smoothed
        boundaries.append(_Boundary(offset, offset, measured[before].spacing, False))
    return lines, boundaries


def _share_pavement(outside: Estimate) -> tuple[Estimate, Estimate]:
    """Return the widths, m, of edge strip and hard shoulder that share the pavement outside of the lanes.

    Nothing on the road parts them: the strip is as wide as that of the standard cross-section which fits best.
    """
    if outside.value <= _WIDEST_STRIP:
        return outside, Estimate(0.0, 0.0)
    rows = STANDARD_CROSS_SECTIONS.values()
    best = min(rows, key=lambda row: abs(row.hard_shoulder + row.outer_edge_strip - outside.value))
    strip = best.outer_edge_strip
    return Estimate(strip, 0.0), Estimate(min(outside.value - strip, _WIDEST), outside.std)


def nearest_standard(sides: dict[Side, SideSection]) -> tuple[str, float]:
    """Return the name of the standard cross-section nearest to both carriageways, and the largest difference (m)."""
    distances = {
        name: max(_misfit(side, row) for side in sides.values()) for name, row in STANDARD_CROSS_SECTIONS.items()
    }
    best = min(distances, key=lambda name: distances[name])
    return best, distances[best]


def _misfit(side: SideSection, row: StandardCrossSection) -> float:
    """Return the largest difference of a width, m, a lane's counting twice; inf if the numbers of lanes differ."""
    if len(side.lanes) != len(row.lanes):
        return float("inf")
    differences = [2.0 * abs(lane.value - width) for lane, width in zip(side.lanes, reversed(row.lanes), strict=True)]
    differences.append(abs(side.inner_offset.value - row.median / 2.0))
    differences.append(abs(side.inner_strip.value - row.inner_edge_strip))
    if side.edge_seen:
        differences.append(abs(side.outer_width.value - row.hard_shoulder - row.outer_edge_strip))
    return max(differences)


def snap_to_standard(section: MeasuredSection) -> MeasuredSection:
    """Return the cross-section with the widths of the standard one it passes for; unchanged if it passes for none."""
    if section.standard is None:
        return section
    row = STANDARD_CROSS_SECTIONS[section.standard]
    widths = {
        "inner_offset": row.median / 2.0,
        "inner_strip": row.inner_edge_strip,
        "outer_width": row.hard_shoulder + row.outer_edge_strip,
        "strip": row.outer_edge_strip,
        "shoulder": row.hard_shoulder,
    }
    sides: dict[Side, SideSection] = {}
    for name, side in section.sides.items():
        lanes = [replace(lane, value=width) for width, lane in zip(reversed(row.lanes), side.lanes, strict=True)]
        exact = {field: replace(getattr(side, field), value=width) for field, width in widths.items()}
        sides[name] = replace(side, lanes=lanes, **exact)
    return replace(section, sides=sides)


def standard_section(section: MeasuredSection) -> dict[str, Any] | None:
    """Return name and distance (m) of the nearest standard cross-section as JSON; None for a single carriageway."""
    if section.kind == "single":
        return None
    distance = _finite(section.distance, 3)
    return {"name": section.nearest, "largest_difference": distance, "within_tolerance": section.standard is not None}


def _finite(value: float, digits: int) -> float | None:
    return round(float(value), digits) if np.isfinite(value) else None
