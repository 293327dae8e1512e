"""The cross-section in numbers, each with its standard deviation: lanes, strips, shoulders, median."""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal, Self

import numpy as np
from scipy import ndimage
from scipy.signal import find_peaks

from ..base.arrays import Bool, Float
from ..road.guidelines import DUAL_CROSS_SECTIONS, STANDARD_CROSS_SECTIONS, CentreLine, EdgeLine, StandardCrossSection
from .country.standards import Direction, nearest_single, unlined_section
from .edges import FARTHEST, Edge
from .layout import Band, RoadKind, RoadLayout
from .lines import Line, is_dashed
from .smoothing import interval_mean, mean_with_std

Side = Literal["left", "right"]
SIDES: tuple[Side, ...] = ("right", "left")
"""Both sides, in the order of ascending offsets."""
LineKind = Literal["outer_edge", "lane", "inner_edge"]

EDGE_LINE, NARROW_LINE = 0.30, 0.15
"""Widths of outer edge lines and of all others on motorways, m (RMS)."""
BROAD_RURAL_LINE, RURAL_LINE = 0.25, 0.12
"""Widths of broad lines and of all others, those at the edges too, on roads of one carriageway, m (RMS)."""
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
_DOUBLE_LINE = 0.6
"""Distance of two lines, m, up to which they are a double line. Chosen: midway between that and the narrowest strip."""
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
        """Return the robust mean of values (K,), in order along the road, as an estimate with its standard deviation.

        Values that lie midway between rows of points, ``spacing`` (K,), m, apart, are averaged by `interval_mean`,
        which needs the standard deviation ``axis_std``, m, of the axis that they are measured from.
        """
        if spacing is None or not (spacing[np.isfinite(values)] > 0.0).any():
            return cls(*mean_with_std(values))
        return cls(*interval_mean(values, spacing, axis_std))

    def __sub__(self, subtrahend: Self) -> Self:
        """Return the difference of two numbers whose errors are independent: Var(a - b) = Var(a) + Var(b)."""
        return type(self)(self.value - subtrahend.value, float(np.hypot(self.std, subtrahend.std)))

    def widened(self, std: float) -> Self:
        """Return the estimate with one more independent error added, of standard deviation ``std``."""
        return type(self)(self.value, float(np.hypot(self.std, std)))

    def to_dict(self, digits: int = 4) -> dict[str, float | None]:
        """Return value and standard deviation, rounded, as JSON data; null where not finite."""
        return {"value": _finite(self.value, digits), "std": _finite(self.std, digits)}


@dataclass(frozen=True)
class SideSection:
    """Cross-section of one carriageway (or half of a single one), measured outwards from the axis.

    Attributes:
        side: of the axis.
        lines: the carriageway's lines from inside to outside, the middle line of a single carriageway first; None where
            a line must be but wasn't seen.
        inner_edge, outer_edge: the pavement's edges as distances from the axis; NaN where not seen.
        usual: (K,) mask of the stretches where the outer edge is the road's and not a turnout's.
        inner_offset, inner_strip, outer_width, strip, shoulder: widths, m; ``outer_width`` is that of all pavement
            outside of the lanes, which ``strip`` and ``shoulder`` share.
        lanes: widths from inside to outside, m.
        edge_seen: whether the pavement's outer edge was seen.
        closed: whether the outermost line is an edge line: else there may be further lanes outside.
        assumed: name of the standard cross-section that the lanes were taken from, as their lines weren't seen.
        mirrored: whether the edge line was only seen on the other side of a single carriageway.
        axis_std: standard deviation of where the axis lies, m, from which all is measured.
        edge_stds: standard deviations of the inner and the outer edge's error that is the same all along the road, m.
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
            inner_offsets, outer_offsets = (
                np.where(self.usual, edge.offsets, np.nan) for edge in (self.inner_edge, self.outer_edge)
            )
            inner_estimate = Estimate.of(inner_offsets, self.inner_edge.spacing, self.axis_std).widened(
                self.edge_stds[0]
            )
            return (
                Estimate.of(outer_offsets, self.outer_edge.spacing, self.axis_std).widened(self.edge_stds[1])
                - inner_estimate
            )
        parts = [self.inner_strip, *self.lanes, self.outer_width]
        return Estimate(sum(p.value for p in parts), float(np.sqrt(sum(p.std**2 for p in parts))))


@dataclass(frozen=True)
class MeasuredSection:
    """Measured cross-section of the road, with the standard one that is nearest to it.

    Attributes:
        kind: dual or single carriageway.
        sides: measured carriageway, or half of a single one, by side.
        middle: the middle line of a single carriageway; None if unseen or of a dual one.
        nearest: name of the nearest standard cross-section with as many carriageways.
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
        left_offset, right_offset = self.sides["left"].inner_offset, self.sides["right"].inner_offset
        return Estimate(left_offset.value + right_offset.value, float(np.hypot(left_offset.std, right_offset.std)))


def measure_section(layout: RoadLayout, has_paint_class: bool, axis_std: float = 0.0) -> MeasuredSection:
    """Return the cross-section, with standard deviations, that profiles along the alignment show.

    Args:
        layout: carriageways and lines in profiles along the alignment, where offset 0 is the axis.
        has_paint_class: whether paint is known by class; if not, lines look wider than they are and get the usual
            widths.
        axis_std: standard deviation of where the axis lies, m, from which all is measured.
    """
    bands = zip(SIDES, layout.bands * (2 if layout.kind == "single" else 1), strict=True)
    parts = [_SidePart(layout, band, side, has_paint_class, axis_std) for side, band in bands]
    if layout.kind == "single":
        middle = layout.bands[0].middle
        halves = _without_lines({part.side: _half_section(part) for part in parts}, middle)
        return MeasuredSection("single", halves, middle, *nearest_single(*_directions(halves, middle)))
    sides = {part.side: _carriageway(part) if len(part.band.lines) > 1 else _assumed_section(part) for part in parts}
    return MeasuredSection("dual", sides, None, *nearest_standard(sides))


def carriageway_middles(section: MeasuredSection) -> list[float]:
    """Return the offsets, m, of the carriageways' middles, around which is surely pavement."""
    if section.kind != "dual":
        return [0.0]
    sides = section.sides.values()
    return [side.sign * (side.inner_offset.value + 0.5 * side.paved_width.value) for side in sides]


@dataclass(frozen=True)
class _SidePart:
    """Inputs for measuring one side of the road.

    Attributes:
        layout, marked, axis_std: as in `measure_section`.
        band: the side's carriageway, or the single carriageway that it is a half of.
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

    def outer_edge(self, innermost_line: Float, outermost_line: Float) -> Edge:
        """Return the pavement's outer edge as distances from the axis: beyond the outermost line, else within it.

        Args:
            first, last: (K,) distances of the innermost and the outermost line, m.
        """
        edge = self.edge(outermost_line)
        inside_edge = self.edge(innermost_line, reach=outermost_line - innermost_line + FARTHEST)
        unseen = ~np.isfinite(edge.offsets)
        return Edge(
            np.where(unseen, inside_edge.offsets, edge.offsets), np.where(unseen, inside_edge.spacing, edge.spacing)
        )

    def edge(self, begin: Float, outwards: bool = True, reach: float | Float = FARTHEST) -> Edge:
        """Return the pavement's edge as distances from the axis, m.

        Args:
            begin: (K,) distances from the axis that are surely paved, m.
            outwards: whether the edge away from the axis is looked for, else the one towards it.
            reach: distance from ``begin`` in which it is looked for, m; a number, or (K,).
        """
        sign = self.sign if outwards else -self.sign
        edge = self.layout.pavement.edge(self.sign * begin, sign, reach)
        return Edge(self.sign * edge.offsets, edge.spacing)


def line_width(line: Line | None, kind: LineKind, road: RoadKind, has_paint_class: bool) -> float:
    """Return the width, m, to write for a line: the usual one if the measured one is near it or unreliable."""
    edge_width, narrow_width = (RURAL_LINE, RURAL_LINE) if road == "single" else (EDGE_LINE, NARROW_LINE)
    usual_width = edge_width if kind == "outer_edge" else narrow_width
    if line is None or not has_paint_class:
        return usual_width
    usual_widths = (RURAL_LINE, NARROW_LINE, BROAD_RURAL_LINE, EDGE_LINE)
    nearest_width = min(usual_widths, key=lambda width: abs(width - line.width))
    if abs(usual_width - line.width) <= _LINE_TOLERANCE:
        return usual_width
    return (
        nearest_width
        if abs(nearest_width - line.width) <= _LINE_TOLERANCE
        else float(np.clip(round(line.width, 2), 0.05, 1.0))
    )


def half_width(line: Line | None, kind: LineKind, road: RoadKind, has_paint_class: bool) -> tuple[float, float]:
    """Return half of the width to write for a line, and the standard deviation of that, m; 0 if it wasn't measured."""
    std = 0.5 * line.width_std if line is not None and has_paint_class else 0.0
    return 0.5 * line_width(line, kind, road, has_paint_class), std


@dataclass(frozen=True)
class _Boundary:
    """A boundary of a lane as distances from the axis, m.

    Attributes:
        smoothed: (K,) smoothed distances; NaN where the boundary isn't there.
        measured: (K,) distances measured in single stretches; NaN where nothing was seen.
        spacing: (K,) distance of the two rows of points that a measured one lies midway between; 0 where it is a mean.
        seen: whether the boundary was seen; if not, it is placed evenly between its neighbours.
        std: standard deviation of the error that is the same all along the road, m.
    """

    smoothed: Float
    measured: Float
    spacing: Float
    seen: bool = True
    std: float = 0.0

    @classmethod
    def of(cls, line: Line, sign: int) -> Self:
        """Return a line's middle as a boundary of the left (1) or right (-1) side."""
        return cls(sign * line.offsets, sign * line.measured, line.spacing)

    def shift(self, distance: float, std: float) -> Self:
        """Return the boundary moved outwards by a distance, m, that has a standard deviation of its own, m."""
        std = float(np.hypot(self.std, std))
        return replace(self, smoothed=self.smoothed + distance, measured=self.measured + distance, std=std)

    def place(self, mask: Bool, axis_std: float) -> Estimate:
        """Return the boundary's mean distance from the axis, m, in some stretches, or in all if it is seen in none.

        Args:
            mask: (K,) stretches that count.
            axis_std: standard deviation of the axis' offset, m.
        """
        values = np.where(mask, self.measured, np.nan)
        estimate = Estimate.of(values if np.isfinite(values).any() else self.measured, self.spacing, axis_std)
        estimate = estimate.widened(self.std)
        return estimate if self.seen else replace(estimate, std=np.inf)


def _carriageway(part: _SidePart) -> SideSection:
    """Return the measured cross-section of one carriageway of a dual one."""
    lines, boundaries = _order_lines(part.band, part.sign)
    boundaries[0] = boundaries[0].shift(*half_width(lines[0], "inner_edge", "dual", part.marked))
    innermost_line, outermost_line = boundaries[0].smoothed, boundaries[-1].smoothed
    outer_edge = part.outer_edge(_fill_with_median(innermost_line), _fill_with_median(outermost_line))
    if not _lacks_outer_lane(lines[-1], outer_edge):
        half_line, std = half_width(lines[-1], "outer_edge", "dual", part.marked)
        boundaries[-1] = boundaries[-1].shift(-half_line, std)
    innermost_line = _fill_with_median(innermost_line)
    return _summarise_side(part, lines, boundaries, part.edge(innermost_line, False, innermost_line), outer_edge)


def _half_section(part: _SidePart) -> SideSection:
    """Return the measured cross-section of one direction of a single carriageway, from the axis outwards."""
    zeros, middle = part.everywhere(0.0), part.band.middle
    outer_edge = part.edge(part.everywhere(_NARROWEST), reach=_WIDEST_HALF)
    half_pair = 0.0 if middle is None else 0.5 * middle.apart
    side_lines = {s: _half_lines(part, s, outer_edge if s == part.sign else None) for s in (1, -1)}
    lines: list[Line | None] = [middle, *side_lines[part.sign]]
    columns = [_Boundary(zeros, zeros, zeros), *(_Boundary.of(line, part.sign) for line in side_lines[part.sign])]
    inner_strip = Estimate(0.0, 0.0)
    if middle is not None and middle.pair is not None:  # the lanes begin beyond the pair's lines
        own_line = middle.pair[0 if part.side == "right" else 1]
        half_line, std = half_width(own_line, "inner_edge", "single", part.marked)
        inner_strip = Estimate(half_pair + half_line, float(np.hypot(std, 0.0 if part.marked else _PAINT_STD)))
        lines[0] = own_line
        columns[0] = columns[0].shift(inner_strip.value, std)
    is_mirrored = len(lines) == 1 and bool(side_lines[-part.sign])
    if len(lines) > 1:
        half_line, std = half_width(lines[-1], "outer_edge", "single", part.marked)
        columns[-1] = columns[-1].shift(-half_line, std)
    elif is_mirrored:
        opposite_distance = min(abs(line.offset) for line in side_lines[-part.sign])
        lane_edge = part.everywhere(opposite_distance - 0.5 * line_width(None, "outer_edge", "single", part.marked))
        columns.append(_Boundary(lane_edge, lane_edge, zeros, False))
    else:  # no edge line at all: the lane reaches to the pavement's edge
        edge_visible = bool(np.isfinite(outer_edge.offsets).any())
        lane_edge = outer_edge.offsets if edge_visible else part.everywhere(0.5 * part.band.width)
        columns.append(_Boundary(lane_edge, lane_edge, outer_edge.spacing, edge_visible))
    lines += [None] * (len(columns) - len(lines))
    half_section = _summarise_side(part, lines, columns, Edge(zeros, zeros), outer_edge)
    return replace(half_section, inner_offset=Estimate(0.0, 0.0), inner_strip=inner_strip, mirrored=is_mirrored)


def _half_lines(part: _SidePart, sign: int, outer_edge: Edge | None) -> list[Line]:
    """Return the lines on one half of a single carriageway, outwards; without a class of paint the best one of each.

    Where brightness tells paint, seams and verges pass for lines too: only the best in a lane's distance counts, and
    another one only beyond a lane line, as far as there is pavement for one more lane.

    Args:
        part: of either side.
        sign: of the half whose lines are returned.
        outer_edge: the pavement's edge on that half; None if it is the other half.
    """
    lines = sorted(
        (line for line in part.band.lines if sign * line.offset > _NARROWEST), key=lambda line: sign * line.offset
    )
    if part.marked:
        return lines
    chosen: list[Line] = []
    edge = part.band.high if sign > 0 else -part.band.low
    if outer_edge is not None and _is_visible(outer_edge):
        edge = float(np.nanmedian(outer_edge.offsets))
    begin, end = _NARROWEST, _WIDEST_LANE
    while candidates := [line for line in lines if begin <= sign * line.offset < end]:
        best = max(candidates, key=lambda line: line.length * line.width)
        chosen.append(best)
        begin, end = sign * best.offset + _NARROWEST, sign * best.offset + _WIDEST_LANE
        if not is_dashed(best) or edge < begin:
            break
    return chosen


def _without_lines(halves: dict[Side, SideSection], middle: Line | None) -> dict[Side, SideSection]:
    """Return the halves of a single carriageway, without any line with the lanes of the section that has none.

    Nothing on such a road parts lanes from edge strips: they are those of a standard section as wide, if there is one.
    """
    if middle is not None or any(line is not None for half in halves.values() for line in half.lines):
        return halves
    if not all(half.edge_seen for half in halves.values()):
        return halves
    row = unlined_section([half.paved_width.value for half in halves.values()], STANDARD_TOLERANCE)
    if row is None:
        return halves
    name = next(name for name, section in STANDARD_CROSS_SECTIONS.items() if section is row)
    result: dict[Side, SideSection] = {}
    for side, half in halves.items():
        strip = half.paved_width.value - sum(row.lanes)
        outer = Estimate(strip, half.paved_width.std)
        lanes = [Estimate(lane, np.inf) for lane in reversed(row.lanes)]
        result[side] = replace(half, lanes=lanes, outer_width=outer, strip=outer, assumed=name)
    return result


def _directions(halves: dict[Side, SideSection], middle: Line | None) -> tuple[list[Direction], CentreLine]:
    """Return both directions of a single carriageway, and what lines part them, as `nearest_single` asks for."""
    if middle is None:
        centre_line: CentreLine = "none"
    elif middle.pair is None:
        centre_line = "single"
    else:
        centre_line = "strip" if middle.apart > _DOUBLE_LINE else "double"
    directions = [
        Direction(
            tuple(lane.value for lane in half.lanes),
            half.inner_strip.value,
            half.outer_width.value if half.edge_seen else None,
            _edge_line(half.lines[-1] if len(half.lines) > 1 else None),
        )
        for half in halves.values()
    ]
    return directions, centre_line


def _edge_line(line: Line | None) -> EdgeLine:
    """Return how an edge line is."""
    if line is None:
        return "none"
    return "dashed" if is_dashed(line) else "solid"


def _assumed_section(part: _SidePart) -> SideSection:
    """Return a carriageway whose lines aren't seen, with the lanes of the standard section nearest in width."""
    middle = part.everywhere(part.sign * 0.5 * (part.band.low + part.band.high))
    outer_edge = part.edge(middle, reach=0.5 * part.band.width + _WIDEST)
    inner_edge = part.edge(middle, False, np.abs(middle))
    width = mean_with_std(outer_edge.offsets - inner_edge.offsets)[0]
    width = width if np.isfinite(width) else part.band.width
    name = min(DUAL_CROSS_SECTIONS, key=lambda key: abs(DUAL_CROSS_SECTIONS[key].paved_width - width))
    row = DUAL_CROSS_SECTIONS[name]
    innermost_line = inner_edge.offsets + row.inner_edge_strip
    lane_edges = [innermost_line + sum(row.lanes[::-1][:i]) for i in range(len(row.lanes) + 1)]
    columns = [_Boundary(lane_edge, lane_edge, inner_edge.spacing, False) for lane_edge in lane_edges]
    lines: list[Line | None] = [None] * len(columns)
    measured_side = _summarise_side(part, lines, columns, inner_edge, outer_edge)
    lanes = [Estimate(lane, np.inf) for lane in reversed(row.lanes)]
    return replace(measured_side, lanes=lanes, inner_strip=Estimate(row.inner_edge_strip, np.inf), assumed=name)


def _lacks_outer_lane(line: Line | None, outer_edge: Edge) -> bool:
    """Return whether the outermost line is dashed and no edge is seen beyond: the cloud then lacks the outer lane."""
    return line is not None and not line.solid and not _is_visible(outer_edge)


def _is_visible(edge: Edge) -> bool:
    """Return whether an edge is seen in more than `_FEWEST_EDGES` of the stretches."""
    return bool(np.isfinite(edge.offsets).mean() > _FEWEST_EDGES)


def _fill_with_median(distance: Float) -> Float:
    """Return distances (K,) with unknown ones replaced by the median."""
    return np.where(np.isfinite(distance), distance, np.nanmedian(distance))


def _summarise_side(
    part: _SidePart, lines: list[Line | None], boundaries: list[_Boundary], inner_edge: Edge, outer_edge: Edge
) -> SideSection:
    """Return a side's widths, with standard deviations, from lines and edges measured in each stretch."""
    # Widths count in the usual stretches only, in all where these are few.
    edge_seen = _is_visible(outer_edge)
    outer_width = outer_edge.offsets - _fill_with_median(boundaries[-1].smoothed)
    if part.band.usual is not None:
        outer_width = np.where(part.band.usual, outer_width, np.nan)
    usual_mask = _usual_stretches(outer_width, lines[-1])
    mask = usual_mask if usual_mask.sum() >= _FEWEST_STRETCHES else np.ones(len(usual_mask), dtype=bool)
    # The lanes' boundaries, in the order of their distance from the axis.
    paint_std = 0.0 if part.marked else _PAINT_STD
    offsets = [boundary.place(mask, part.axis_std).widened(paint_std) for boundary in boundaries]
    edge_std = 0.0 if part.layout.profiles.paved is not None else _EDGE_STD
    if part.layout.kind == "single":  # its lanes begin at the axis
        offsets[0] = replace(offsets[0], std=part.axis_std)
    # The pavement outside of the lanes: edge strip and shoulder.
    outer_estimate = Estimate(_USUAL_STRIP, np.inf)
    if edge_seen:
        # Over the same stretches as the lines, so that errors that edge and lines share cancel in the difference.
        edge = Estimate.of(np.where(mask, outer_edge.offsets, np.nan), outer_edge.spacing, part.axis_std)
        outer_estimate = edge.widened(edge_std) - offsets[-1]
    outer_estimate = Estimate(float(np.clip(outer_estimate.value, 0.0, 2.0 + _WIDEST)), outer_estimate.std)
    strip, shoulder = _share_pavement(outer_estimate)
    inner_offset, inner_strip = _inner_widths(offsets[0], inner_edge, mask, edge_std, part.axis_std)
    # The axis' error cancels in differences of two lines, but not in the distance from the axis.
    inner_offset = inner_offset.widened(part.axis_std)
    return SideSection(
        side=part.side,
        lines=lines,
        inner_edge=inner_edge,
        outer_edge=outer_edge,
        usual=usual_mask,
        inner_offset=inner_offset,
        inner_strip=inner_strip,
        lanes=[outer_boundary - inner_boundary for inner_boundary, outer_boundary in pairwise(offsets)],
        outer_width=outer_estimate,
        strip=strip,
        shoulder=shoulder,
        edge_seen=edge_seen,
        closed=not _lacks_outer_lane(lines[-1], outer_edge),
        axis_std=part.axis_std,
        edge_stds=(edge_std if part.layout.kind == "dual" else part.axis_std, edge_std),
    )


def _inner_widths(
    lane_boundary: Estimate, inner_edge: Edge, mask: Bool, edge_std: float, axis_std: float
) -> tuple[Estimate, Estimate]:
    """Return the distance of the pavement's inner edge from the axis, and the inner edge strip's width, m.

    Args:
        lane_boundary: distance of the innermost lane's inner boundary from the axis.
        inner_edge: the pavement's inner edge.
        mask: (K,) the stretches that count.
        edge_std, axis_std: standard deviations of any edge and of the axis, m.
    """
    if _is_visible(inner_edge):
        edge = Estimate.of(np.where(mask, inner_edge.offsets, np.nan), inner_edge.spacing, axis_std).widened(edge_std)
        strip = lane_boundary - edge
    else:
        # Assumed, not measured: an infinite standard deviation says so.
        edge = Estimate(lane_boundary.value - _USUAL_STRIP, np.inf)
        strip = Estimate(_USUAL_STRIP, np.inf)
    width = float(np.clip(strip.value, 0.0, _STRIP_LIMIT))
    return Estimate(max(0.0, edge.value), edge.std), Estimate(width, strip.std)


def _usual_stretches(width: Float, line: Line | None) -> Bool:
    """Return a mask (K,) of the stretches in which the pavement outside of the lanes is the road's, not a turnout's.

    Beside exits and entries the edge line is a dashed one; beside an emergency bay the pavement is wider.
    """
    usual_mask = np.isfinite(width)
    if line is not None and line.solid:
        cover = np.where(np.isfinite(line.cover), line.cover, 0.0)
        solid_mask = ndimage.uniform_filter1d(cover, _AROUND, mode="nearest") > _SOLID
        usual_mask &= solid_mask if (solid_mask & usual_mask).sum() >= _FEWEST_STRETCHES else usual_mask
    if not usual_mask.any():
        return usual_mask
    # Chosen: bins of 0.1 m up to 10 m; from -1 m on, as a measured edge may lie within the lane's line.
    count, edges = np.histogram(width[usual_mask], np.arange(-1.0, 10.0, 0.1))
    density = ndimage.uniform_filter1d(count.astype(np.float64), 3)
    # Turnouts make the pavement wider, and on a short road may be longer than what lies between them: of the common
    # widths the smallest is the road's own.
    peak = int(find_peaks(np.pad(density, 1), height=_COMMON * density.max())[0][0]) - 1
    return usual_mask & (np.abs(width - edges[peak] - 0.05) < _MODE)


def _order_lines(band: Band, sign: int) -> tuple[list[Line | None], list[_Boundary]]:
    """Return a band's lines from inside to outside (None: unseen), and each as a boundary of a lane.

    Unseen lines are placed evenly between their neighbours.
    """
    pairs: list[tuple[float, Line | None]] = [(sign * band.place(line), line) for line in band.lines]
    pairs += [(sign * offset, None) for offset in band.missing]
    pairs.sort(key=lambda pair: pair[0])
    lines = [line for _, line in pairs]
    seen_boundaries = {number: _Boundary.of(line, sign) for number, line in enumerate(lines) if line is not None}
    boundaries = []
    for number in range(len(lines)):
        if number in seen_boundaries:
            boundaries.append(seen_boundaries[number])
            continue
        # Missing lines lie between measured ones only (`layout`), so that there is one on either side.
        inner_number = max(i for i in seen_boundaries if i < number)
        outer_number = min(i for i in seen_boundaries if i > number)
        share = (number - inner_number) / (outer_number - inner_number)
        offset = (1.0 - share) * seen_boundaries[inner_number].smoothed + share * seen_boundaries[outer_number].smoothed
        boundaries.append(_Boundary(offset, offset, seen_boundaries[inner_number].spacing, False))
    return lines, boundaries


def _share_pavement(outer_width: Estimate) -> tuple[Estimate, Estimate]:
    """Return the widths, m, of edge strip and hard shoulder that share the pavement outside of the lanes.

    Nothing on the road separates both: the strip gets the width that it has in the nearest standard cross-section.
    """
    if outer_width.value <= _WIDEST_STRIP:
        return outer_width, Estimate(0.0, 0.0)
    rows = DUAL_CROSS_SECTIONS.values()
    best_section = min(rows, key=lambda row: abs(row.hard_shoulder + row.outer_edge_strip - outer_width.value))
    strip = best_section.outer_edge_strip
    return Estimate(strip, 0.0), Estimate(min(outer_width.value - strip, _WIDEST), outer_width.std)


def nearest_standard(sides: dict[Side, SideSection]) -> tuple[str, float]:
    """Return the name of the standard cross-section nearest to both carriageways, and the largest difference (m)."""
    distances = {name: max(_misfit(side, row) for side in sides.values()) for name, row in DUAL_CROSS_SECTIONS.items()}
    nearest_name = min(distances, key=lambda name: distances[name])
    return nearest_name, distances[nearest_name]


def _misfit(side: SideSection, row: StandardCrossSection) -> float:
    """Return the largest difference, m, of a side's widths from a standard one's; inf if the numbers of lanes differ.

    Differences of lanes count twice.
    """
    if len(side.lanes) != len(row.lanes):
        return float("inf")
    differences = [2.0 * abs(lane.value - width) for lane, width in zip(side.lanes, reversed(row.lanes), strict=True)]
    differences.append(abs(side.inner_offset.value - row.median / 2.0))
    differences.append(abs(side.inner_strip.value - row.inner_edge_strip))
    if side.edge_seen:
        differences.append(abs(side.outer_width.value - row.hard_shoulder - row.outer_edge_strip))
    return max(differences)


def snap_to_standard(section: MeasuredSection) -> MeasuredSection:
    """Return the cross-section with the widths of the standard one within tolerance; unchanged if there is none."""
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
        # Of a single carriageway either direction may run with the stations.
        standard_lanes = min(
            (lanes for lanes in (row.lanes, row.of_side("left").lanes) if len(lanes) == len(side.lanes)),
            key=lambda lanes: abs(sum(lanes) - sum(lane.value for lane in side.lanes)),
        )
        lanes = [replace(lane, value=width) for width, lane in zip(reversed(standard_lanes), side.lanes, strict=True)]
        snapped_widths = {field: replace(getattr(side, field), value=width) for field, width in widths.items()}
        sides[name] = replace(side, lanes=lanes, **snapped_widths)
    return replace(section, sides=sides)


def standard_section(section: MeasuredSection) -> dict[str, Any] | None:
    """Return name and distance (m) of the nearest standard cross-section as JSON; None if there is none."""
    if not section.nearest:
        return None
    distance = _finite(section.distance, 3)
    return {"name": section.nearest, "largest_difference": distance, "within_tolerance": section.standard is not None}


def _finite(value: float, digits: int) -> float | None:
    """Return a number rounded to some digits; None if it isn't finite."""
    return round(float(value), digits) if np.isfinite(value) else None
