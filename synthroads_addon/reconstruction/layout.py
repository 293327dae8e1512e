"""Which lines belong together: carriageways, their lanes, and the median, and the axis that all of them agree on."""

from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Literal, Self

import numpy as np
from scipy import ndimage
from scipy.signal import find_peaks

from ..base.arrays import Bool, Float, otsu_threshold
from ..base.errors import InputError
from .branches import find_branch
from .edges import FARTHEST, Pavement
from .lines import STANDARD_DASHES, USUAL, WAVELENGTH, Line
from .path import SPACING
from .profiles import ACROSS, STRETCH, Grid, Profiles
from .smoothing import bisquare, fill_gaps, hidden_std, mean_with_std, robust_scale, smooth

RoadKind = Literal["dual", "single"]

_SEEN = 0.5
"""Share of the road's length on which a line must be seen. Chosen: what is seen on less belongs to a turnout or is a
fault."""
_SEEN_RURAL = 0.3
"""The same of a rural road. Chosen: their lines have gaps, and no turnouts come between."""
_OTHER_EDGE, _OTHER_STRETCHES = 0.75, 5
"""Distance of an edge from the usual place, m, and stretches that it lies there, on another part of the road. Chosen: a
fifth of a lane, for 25 m; what is less or shorter is a fault."""
_FEWEST_USUAL = 0.25
"""Share of the road that the usual part has at least. Chosen: a part that is less isn't the usual one."""
_TOGETHER = 0.2
"""Share of the stretches with both edges in which two lines must be seen together. Chosen: lines that seldom are give
way to the edges."""
_COMMON = 0.35
"""Share of the most common place's count from which on another place may be the usual one. Chosen: turnouts on a short
road may be longer than what lies between them."""
_NARROWEST_BAND, _NARROWEST_MEDIAN, _WIDEST_MEDIAN = 3.0, 0.8, 30.0
"""Widths of pavement and median, m. Chosen: a lane; a concrete barrier on its own; carriageways that are farther apart
are two roads."""
_UNMARKED_CARRIAGEWAY = 7.0
"""Width of pavement that is a carriageway even if its lines aren't seen, m. Chosen: two lanes."""
_IN_THE_MIDDLE = 0.15
"""Share of a carriageway's width that its middle line lies off its middle at most. Chosen: half a metre of a rural
road."""
_NEAR_EDGE = 4.5
"""Distance of an outermost line from the edge, m, at most. Chosen: a hard shoulder's width and its edge strip's."""
_BESIDE = 3.0
"""Distance beyond a strip's usual edge that its edge is looked for, m. Chosen: less than a lane, whose edge is another
part's."""
_BAND_MARGIN = 0.5
"""Distance that an edge line may lie outside of what passes for pavement, m. Chosen: what brightness or bins may miss
of it."""
_NARROWEST_LANE, _WIDEST_LANE, _USUAL_LANE = 2.3, 5.2, 3.6
"""Widths of lanes, m. Chosen: below any lane of RAA and RAL; above it but less than two; the usual one."""
_AROUND_DASHES = (0.4, 1.4)
"""Distances beside a lane line that are pavement for sure, m. Chosen: off the paint, within a lane's half."""
_LIKE = 4.0
"""Times the pavement's own spread of brightness that other ground is off at least. Chosen: Otsu's method parts any
histogram, a pavement's as well."""
_BLUR = (6.0, 1.0)
"""Standard deviations of the brightness' blur, bins along and across. Chosen: some metres along the road, where
pavement changes little, and less than a line across it."""
_PAINT = 9
"""Widest strip of paint, bins. Chosen: double lines fit in 0.9 m."""
_AXIS_WAVELENGTH = 60.0
"""Wavelength of which half of the axis' swings is kept, m. Chosen: shorter ones are noise."""
_ROUNDS = 4
"""Votes, each about the axis of the one before. Chosen: it moves no more after them."""
_COVERED = 0.3
"""Share of the road on which a bin must have points to belong to a strip. Chosen: bins between rows of points are often
empty."""
_CRACK = 0.3
"""Gaps in the pavement that are closed to either side, m. Chosen: seams and bins between rows of points; a median is
wider."""
_LEVEL_BLUR = 10.0
"""Standard deviation of the blur of the pavement's brightness along the road, m. Chosen: single cars and stains vanish
in it."""


@dataclass(frozen=True)
class Band:
    """One carriageway's strip of pavement in the profiles, with its lines.

    Attributes:
        low, high: offsets of its pavement's edges, m, from right to left.
        lines: its lines from right to left.
        edges: its pavement's right and left edge as if they were lines, for want of lines.
        missing: offsets of lines that must be between its lines but aren't seen, m.
        usual: (K,) the stretches in which it is as wide as usual; all if not given.
        branch: (K,) m beside its middle line, positive to the left, where another branch of that runs (`find_branch`);
            nowhere if not given.
    """

    low: float
    high: float
    lines: list[Line]
    edges: tuple[Line, Line]
    missing: list[float] = field(default_factory=list)
    usual: Bool | None = None
    branch: Float | None = None

    def place(self, line: Line) -> float:
        """Return the median offset, m, of a line where the pavement is as wide as usual."""
        return _place_in(line, self.usual)

    @property
    def axis_line(self) -> Line | None:
        """Return the middle line, midway between both branches where it parts into two; None if there is none."""
        middle = self.middle
        if middle is None or self.branch is None or not np.any(self.branch):
            return middle
        measured, offsets = (values + 0.5 * self.branch for values in (middle.measured, middle.offsets))
        return replace(middle, measured=measured, offsets=offsets)

    @property
    def width(self) -> float:
        """Return the pavement's width, m."""
        return self.high - self.low

    @property
    def middle(self) -> Line | None:
        """Return the most painted of the lines near the band's middle, a dashed one first; None if there is none."""
        middle = 0.5 * (self.low + self.high)
        near = [line for line in self.lines if abs(line.offset - middle) < _IN_THE_MIDDLE * self.width]
        near = [line for line in near if (line.dash, line.gap) in STANDARD_DASHES] or near
        return max(near, key=lambda line: line.length * line.width, default=None)

    def guide(self, sign: int) -> Line:
        """Return the outermost line to the right (-1) or left (+1), or the pavement's edge if no line is near it."""
        edge = self.edges[0 if sign < 0 else 1]
        line = self.lines[0 if sign < 0 else -1] if self.lines else None
        return line if line is not None and abs(line.offset - edge.offset) < _NEAR_EDGE else edge


@dataclass(frozen=True)
class RoadLayout:
    """Layout of a road in profiles: its carriageways, with their lines, and the pavement.

    Attributes:
        kind: dual carriageway, or a single one.
        bands: from right to left: two of a dual carriageway, one of a single one.
        pavement: in the profiles.
        notes: what was left out, in words.
    """

    kind: RoadKind
    bands: tuple[Band, ...]
    pavement: Pavement
    notes: tuple[str, ...]

    @property
    def profiles(self) -> Profiles:
        """Return the profiles that show it."""
        return self.pavement.profiles


def find_layout(profiles: Profiles, lines: list[Line], kind: RoadKind | None = None) -> RoadLayout:
    """Return the layout of carriageways and lanes that lines and pavement of the profiles show.

    Args:
        profiles: along a path parallel to the road.
        lines: all that were found.
        kind: the kind of road, where it is known.

    Raises:
        InputError: no carriageway can be made out.
    """
    share = profiles.paved if profiles.paved is not None else paved_by_brightness(profiles, lines)
    pavement, notes = Pavement(profiles, share), []
    spans = paved_spans(pavement)
    # Rural roads have gaps in their lines, and no turnouts.
    least = _SEEN_RURAL if len(spans) == 1 or kind == "single" else _SEEN
    parts = [_Part.of(pavement, spans, number) for number in range(len(spans))]
    bands = [_band(pavement, part, part.main(lines, least)) for part in parts]
    left_out = sum(all(line not in part.main(lines, least) for part in parts) for line in lines)
    if left_out:
        notes.append(f"{left_out} lines were seen on a small part of the road and left out")
    if not bands:
        raise InputError("road", None, "no carriageway can be made out in the cloud")
    pair = None if kind == "single" else _carriageway_pair(bands)
    if pair is None and kind == "dual":
        raise InputError("--road", "dual", "only one carriageway can be made out in the cloud")
    chosen = pair or (max(bands, key=lambda band: (len(band.lines), band.width)),)
    if len(bands) > len(chosen):
        notes.append(f"{len(bands) - len(chosen)} other strips of pavement were left out")
    return RoadLayout("dual" if pair else "single", chosen, pavement, tuple(notes))


def with_branch(layout: RoadLayout) -> RoadLayout:
    """Return a layout that tells where the middle line of a single carriageway parts into two.

    Args:
        layout: that profiles along the middle line show; along an axis that lies midway between two branches neither is
            easily followed.
    """
    band = layout.bands[0]
    if layout.kind == "dual" or band.middle is None:
        return layout
    return replace(layout, bands=(replace(band, branch=find_branch(layout.profiles, band.middle)),))


@dataclass(frozen=True)
class _Part:
    """The part of the road on which a strip of pavement is as wide as usual.

    Attributes:
        span: offsets of its edges there, m.
        usual: (K,) the stretches of the part.
        seen: its share of the road's length.
        length: of the road that the cloud shows, m.
    """

    span: tuple[float, float]
    usual: Bool
    seen: float
    length: float

    @classmethod
    def of(cls, pavement: Pavement, spans: list[tuple[float, float]], number: int) -> Self:
        """Return the part of one of the strips: where lanes begin or end, or beside a turnout, another one begins."""
        profiles, (low, high) = pavement.profiles, spans[number]
        begin = np.full(profiles.stretches, 0.5 * (low + high))
        usual, span = np.ones(profiles.stretches, dtype=bool), [low, high]
        for side, sign in enumerate((-1, 1)):
            next_to = number + sign
            room = abs(spans[next_to][1 - side] - span[side]) if 0 <= next_to < len(spans) else 2.0 * FARTHEST
            edge = pavement.edge(begin, sign, 0.5 * (high - low) + min(FARTHEST, 0.5 * room)).offsets
            place = usual_place(sign * edge)
            if place is None:
                continue
            other = np.isfinite(edge) & (np.abs(sign * edge - place) > _OTHER_EDGE)
            closed = ndimage.binary_closing(np.pad(other, 3, mode="edge"), np.ones(3))[3:-3]
            other = ndimage.binary_opening(closed, np.ones(_OTHER_STRETCHES))
            if other.any():
                usual &= ~other
                span[side] = sign * place
        if usual.sum() < _FEWEST_USUAL * len(usual):
            return cls((low, high), np.ones(len(usual), dtype=bool), 1.0, profiles.covered_length)
        return cls((span[0], span[1]), usual, float(usual.mean()), profiles.covered_length)

    def main(self, lines: list[Line], least: float) -> list[Line]:
        """Return the lines that are seen along at least a share of the part."""
        return [line for line in lines if self._along(line) >= least * self.seen * self.length]

    def _along(self, line: Line) -> float:
        inside = self.usual & (line.stations > line.start) & (line.stations < line.end)
        return min(line.length, STRETCH * SPACING * float(inside.sum()))


def usual_place(distance: Float) -> float | None:
    """Return where an edge lies usually, m, of its distances (K,) along the road: the innermost of common places.

    Turnouts and lanes that begin make the pavement wider, and on a short road may be longer than what lies between
    them. None where it isn't seen.
    """
    known = distance[np.isfinite(distance)]
    if not len(known):
        return None
    edges = np.arange(known.min() - 0.25, known.max() + 0.36, 0.1)
    count = ndimage.uniform_filter1d(np.histogram(known, edges)[0].astype(np.float64), 3)
    peak = int(find_peaks(np.pad(count, 1), height=_COMMON * count.max())[0][0]) - 1
    near = known[np.abs(known - edges[peak] - 0.05) < 0.4]
    return float(np.median(near))


def paved_spans(pavement: Pavement) -> list[tuple[float, float]]:
    """Return the (low, high) offsets, m, of the strips that are paved along most of the road, wide ones only."""
    profiles, known = pavement.profiles, np.isfinite(pavement.share)
    rows = known.sum(axis=0)
    share = np.where(known, pavement.share, 0.0).sum(axis=0) / np.maximum(rows, 1)
    strip = (share > 0.5) & (rows > _COVERED * profiles.covered_length)
    strip = ndimage.binary_closing(strip, iterations=round(_CRACK / ACROSS))
    columns = [part[0] for part in ndimage.find_objects(ndimage.label(strip)[0])]
    spans = [(profiles.offsets[c.start] - ACROSS / 2, profiles.offsets[c.stop - 1] + ACROSS / 2) for c in columns]
    return [(float(low), float(high)) for low, high in spans if high - low >= _NARROWEST_BAND]


def paved_by_brightness(profiles: Profiles, lines: list[Line]) -> Grid:
    """Return a mask of pavement (S, U), 1 or 0, told by brightness near the lane lines; NaN without points.

    Pavement is what is about as bright as the strips on both sides of the lane lines, after a blur of some metres:
    grass, soil and gravel are mostly brighter. Without a dashed line it is as bright as the smoother of two kinds of
    ground. Otsu's threshold parts the differences from that brightness, if there are two kinds of them; if not, all is
    pavement.
    """
    brightness = _blur(profiles.brightness)
    known = np.isfinite(brightness)
    everywhere = np.where(known, 1.0, np.nan).astype(np.float32)
    if any(is_dashed(line) for line in lines):
        reference = _bins_beside(profiles, _lane_lines(lines)) & known
    else:
        reference = _smoother_ground(profiles, brightness.astype(np.float64))
    if not reference.any():
        return everywhere
    difference = np.abs(brightness - _level_along(brightness, reference)[:, None])
    threshold = otsu_threshold(np.asarray(difference[known], dtype=np.float64))
    pavement = float(np.median(difference[known & (difference <= threshold)]))
    other_ground = float(np.median(difference[known & (difference > threshold)]))
    # Otsu's method splits any histogram: the parts are two kinds of ground only if they lie clearly apart.
    if other_ground - pavement < _LIKE * robust_scale(difference[reference]):
        return everywhere
    # Paint is brighter than the threshold, but lies on pavement: narrow gaps across are closed.
    mask = ndimage.grey_closing(np.where(known, difference <= threshold, 0.0), size=(1, _PAINT))
    return np.where(known, mask, np.nan).astype(np.float32)


def _bins_beside(profiles: Profiles, lines: list[Line]) -> Bool:
    """Return a mask (S, U) of the bins to both sides of lines, as far off as `_AROUND_DASHES` says."""
    mask = np.zeros(profiles.brightness.shape, dtype=bool)
    rows = np.arange(len(profiles.stations))
    for line in lines:
        offset = np.interp(profiles.stations, line.stations, line.offsets, left=np.nan, right=np.nan)
        for low, high in ((-_AROUND_DASHES[1], -_AROUND_DASHES[0]), _AROUND_DASHES):
            for shift in np.arange(low, high + 1e-9, ACROSS):
                column = np.rint((offset + shift - profiles.offsets[0]) / ACROSS)
                inside = np.isfinite(column) & (column >= 0) & (column < len(profiles.offsets))
                mask[rows[inside], column[inside].astype(np.int64)] = True
    return mask


def _level_along(brightness: Grid, reference: Bool) -> Float:
    """Return the mean brightness (S,) of reference bins (S, U), smoothed along the road, and bridged where none is."""
    count = np.maximum(reference.sum(axis=1), 1)
    level = np.where(reference, brightness, 0.0).sum(axis=1) / count
    known = reference.any(axis=1)
    rows = np.arange(len(level))
    level = np.interp(rows, rows[known], level[known])
    return np.asarray(ndimage.gaussian_filter1d(level, _LEVEL_BLUR, mode="nearest"))


def is_dashed(line: Line) -> bool:
    """Return whether a line has dashes as lane lines have."""
    return not line.solid and line.dash < 10.0


def _smoother_ground(profiles: Profiles, brightness: Float) -> Bool:
    """Return a mask (S, U) of the smoother of dark and bright ground; of all that is known if that is little."""
    known = np.isfinite(brightness)
    if known.sum() < 2:
        return known
    dark = known & (brightness <= otsu_threshold(np.asarray(brightness[known], dtype=np.float64)))
    bright = known & ~dark
    step = np.abs(np.diff(profiles.height, axis=1, append=np.nan))
    rough = [
        float(np.median(of_kind)) if len(of_kind := step[kind & np.isfinite(step)]) else np.inf
        for kind in (dark, bright)
    ]
    return dark if rough[0] <= rough[1] else bright


def _lane_lines(lines: list[Line]) -> list[Line]:
    """Return the long dashed lines, or just the longest line if none is dashed."""
    dashed = [line for line in lines if is_dashed(line)]
    longest = max((line.length for line in dashed), default=0.0)
    return [line for line in dashed if line.length > 0.5 * longest] or sorted(lines, key=lambda item: -item.length)[:1]


def _blur(values: Grid) -> Grid:
    known = np.isfinite(values)
    weight = ndimage.gaussian_filter(known.astype(np.float32), _BLUR)
    mean = ndimage.gaussian_filter(np.where(known, values, 0.0).astype(np.float32), _BLUR)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(weight > 0.05, mean / weight, np.nan)


def _place_in(line: Line, usual: Bool | None) -> float:
    """Return a line's median offset, m, in the stretches of a mask (K,), or in all where it is seen in none of them."""
    inside = line.offsets[usual] if usual is not None else line.offsets
    return float(np.nanmedian(inside)) if np.isfinite(inside).any() else line.offset


def _band(pavement: Pavement, part: _Part, lines: list[Line]) -> Band:
    """Return a strip of pavement with its lines; of two nearer than a lane the longer, more painted one is kept."""
    low, high = part.span
    place = {id(line): _place_in(line, part.usual) for line in lines}
    inside = [line for line in lines if low - _BAND_MARGIN < place[id(line)] < high + _BAND_MARGIN]
    kept: list[Line] = []
    for line in sorted(inside, key=lambda item: -item.length * (0.2 + item.width)):
        if all(abs(place[id(line)] - place[id(other)]) >= _NARROWEST_LANE for other in kept):
            kept.append(line)
    kept.sort(key=lambda line: place[id(line)])
    missing = []
    for right, left in pairwise(place[id(line)] for line in kept):
        if left - right > _WIDEST_LANE:
            count = round((left - right) / _USUAL_LANE)
            missing += [right + (left - right) * (i + 1) / count for i in range(count - 1)]
    edges = _edge_line(pavement, part.span, -1), _edge_line(pavement, part.span, 1)
    return Band(low, high, kept, edges, missing, part.usual)


def _edge_line(pavement: Pavement, span: tuple[float, float], sign: int) -> Line:
    """Return one edge of a strip of pavement, smoothed, in the form of a line without paint."""
    low, high = span
    stations = pavement.profiles.middles
    begin = np.full(len(stations), 0.5 * (low + high))
    edge = pavement.edge(begin, sign, 0.5 * (high - low) + _BESIDE)
    weights = np.isfinite(edge.offsets).astype(np.float64)
    smoothed = smooth(edge.offsets, weights, STRETCH * SPACING, WAVELENGTH, usual=USUAL)
    return Line(
        stations=stations,
        measured=edge.offsets,
        offsets=smoothed.values if weights.any() else np.full(len(stations), high if sign > 0 else low),
        std=smoothed.std,
        spacing=edge.spacing,
        cover=np.zeros(len(stations)),
        start=float(stations[0]),
        end=float(stations[-1]),
    )


def _carriageway_pair(bands: list[Band]) -> tuple[Band, Band] | None:
    """Return the neighbouring bands with the most lines that a median may lie between; None if there are none."""
    pairs = [
        (right, left)
        for right, left in pairwise(bands)
        if _NARROWEST_MEDIAN <= left.low - right.high <= _WIDEST_MEDIAN and _is_whole(right) and _is_whole(left)
    ]
    return max(pairs, key=lambda pair: len(pair[0].lines) + len(pair[1].lines)) if pairs else None


def _is_whole(band: Band) -> bool:
    """Return whether a band may be one direction's carriageway, by its lines or its width."""
    return len(band.lines) >= 2 or band.width >= _UNMARKED_CARRIAGEWAY


@dataclass(frozen=True)
class FoundAxis:
    """Offsets of the road's axis from the path in each of K stretches, with standard deviations.

    Attributes:
        stations: (K,) m along the path.
        offsets: (K,) of the axis, m; smoothed.
        std: (K,) standard deviation, m.
        raw: (K,) before smoothing; NaN where no line was seen.
    """

    stations: Float
    offsets: Float
    std: Float
    raw: Float


def axis_from_lines(layout: RoadLayout) -> FoundAxis:
    """Return the axis of a layout, on whose movement along the road all lines vote.

    Of a dual carriageway it is the middle between its two innermost lines, of a single one the line in its middle, or
    what lies midway between both branches of that; for want of lines the pavement's edges take their place. All lines
    vote for how it moves along the road: each tells the axis from its own mean distance to it, and counts by how steady
    that is. Where the lines in the middle are missing the others carry on.

    Raises:
        InputError: no line and no edge was seen anywhere.
    """
    guides = axis_guides(layout)
    guide_lines = (
        [band.middle for band in layout.bands] if layout.kind == "single" and len(guides) == 1 else list(guides)
    )
    lines = list(guides) + [line for band in layout.bands for line in band.lines if line not in guide_lines]
    stations = lines[0].stations
    centre = np.mean([line.measured for line in guides], axis=0)  # where the axis is by its own lines
    raw, start = centre, centre
    if not any(np.isfinite(line.measured).any() for line in lines):
        raise InputError("road", None, "neither lines nor edges of a carriageway can be made out in the cloud")
    if not np.isfinite(centre).any():
        measured = np.array([line.measured for line in lines])
        known = np.isfinite(measured).sum(axis=0)
        start = np.where(known > 0, np.nansum(measured, axis=0) / np.maximum(known, 1), np.nan)
    axis = fill_gaps(start)
    for _ in range(_ROUNDS):
        raw = _vote_axis(lines, axis)
        # The votes fix the movement; where the axis lies, its own lines say.
        raw = raw + _level(centre - raw)
        axis = fill_gaps(raw)
    smoothed = smooth(raw, np.where(np.isfinite(raw), 1.0, 0.0), STRETCH * SPACING, _AXIS_WAVELENGTH, usual=USUAL)
    level_std = mean_with_std(centre - raw)[1]
    level_std = float(np.hypot(level_std if np.isfinite(level_std) else 0.0, _shared_error(guides, smoothed.scatter)))
    known = np.isfinite(raw)
    held = np.interp(stations, stations[known], smoothed.values[known])  # no curve is guessed where nothing was seen
    return FoundAxis(stations, held, np.hypot(smoothed.std, level_std), raw)


def axis_guides(layout: RoadLayout) -> tuple[Line, ...]:
    """Return the lines, or edges in their place, whose mean offset is the axis: one or two."""
    if layout.kind == "dual":
        right, left = layout.bands
        return right.guide(1), left.guide(-1)
    (band,) = layout.bands
    if band.axis_line is not None:
        return (band.axis_line,)
    guides = band.guide(-1), band.guide(1)
    # A line on one side and the pavement's edge on the other have nothing between them that is the middle of both.
    alike = (guides[0].width > 0.0) == (guides[1].width > 0.0)
    return guides if alike and _seen_together(guides) >= _TOGETHER * _seen_together(band.edges) else band.edges


def _seen_together(pair: tuple[Line, Line]) -> int:
    """Return in how many stretches both of two lines are seen."""
    return int((np.isfinite(pair[0].measured) & np.isfinite(pair[1].measured)).sum())


def _vote_axis(lines: list[Line], axis: Float) -> Float:
    """Return the axis offsets (K,), m, by a weighted vote of all lines, each less its mean distance from ``axis``."""
    offsets = np.array([line.measured for line in lines])
    std = np.array([line.std for line in lines])
    distance = offsets - axis
    mean = np.array([mean_with_std(row)[0] for row in distance])
    scatter = np.array([_robust_spread(row - value) for row, value in zip(distance, mean, strict=True)])
    known = np.isfinite(offsets) & np.isfinite(std)
    # Inverse variances: of how steady a line is, and of each of its offsets; 1 mm^2 keeps them finite.
    weight = np.where(known, 1.0 / (scatter[:, None] ** 2 + np.where(known, std, 1.0) ** 2 + 1e-6), 0.0)
    # A line whose distance changes, where a lane begins or ends, has no vote there.
    residual = np.where(known, distance - mean[:, None], 0.0)
    weight *= np.array([bisquare(row, max(sigma, USUAL)) for row, sigma in zip(residual, scatter, strict=True)])
    votes = np.where(known, offsets - mean[:, None], 0.0)
    total = weight.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(total > 0.0, (weight * votes).sum(axis=0) / total, np.nan)


def _shared_error(guides: tuple[Line, ...], scatter: float) -> float:
    """Return the standard deviation, m, of the error that all offsets of the axis share, see `hidden_std`."""
    return float(np.sqrt(sum(hidden_std(line.spacing, scatter) ** 2 for line in guides))) / len(guides)


def _robust_spread(values: Float) -> float:
    known = values[np.isfinite(values)]
    return max(robust_scale(known), 0.003) if len(known) else np.inf


def _level(difference: Float) -> float:
    value = mean_with_std(difference)[0]
    return value if np.isfinite(value) else 0.0
