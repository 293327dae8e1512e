"""Which lines belong together: carriageways, their lanes, and the median, and the axis that all of them agree on."""

from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Literal, Self

import numpy as np
from scipy import ndimage
from scipy.signal import find_peaks
from scipy.special import expit

from ..base.arrays import Bool, Float, otsu_threshold
from ..base.errors import InputError
from .branches import find_branch
from .edges import FARTHEST, Pavement
from .ground.band import DarkBand, find_band
from .ground.medians import Median, cut_medians, find_medians, median_level
from .lines import STANDARD_DASHES, USUAL, WAVELENGTH, Line, is_dashed
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
_ON_AND_BESIDE = ((-0.1, 0.1), (-0.8, -0.3), (0.3, 0.8))
"""Distances from a line's middle, m: on it, to the right, to the left. Chosen: beyond its paint, within a verge."""
_BRIGHTER = 0.8
"""Share of the stretches in which paint is brighter than both sides. Chosen: of noise it is a half, of paint nearly
all."""
_ON_BAND = 0.5
"""Distance beside the dark band that a line on it may lie at, m. Chosen: what the band's edge is off by."""
_CRACK = 0.3
"""Gaps in the pavement that are closed to either side, m. Chosen: seams and bins between rows of points; a median is
wider."""
_STEADY = 5
"""Stretches over which the number of carriageways is judged. Chosen: 25 m, as no median begins for less."""
_LEVEL_BLUR = 10.0
"""Standard deviation of the blur of the pavement's brightness along the road, m. Chosen: single cars and stains vanish
in it."""


@dataclass(frozen=True)
class Band:
    """One carriageway's strip of pavement in the profiles, with its lines.

    Attributes:
        low, high: offsets of the pavement's right and left edge, m.
        lines: the carriageway's lines from right to left.
        edges: the pavement's right and left edge in the form of lines, to use where lines are missing.
        missing: offsets of lines that must lie between the seen ones but aren't seen, m.
        usual: (K,) mask of the stretches in which the pavement is as wide as usual; None if in all.
        branch: (K,) distance from the middle line to its other branch, m, positive to the left (`find_branch`);
            None without a branch.
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
        stretch_offsets, offsets = (values + 0.5 * self.branch for values in (middle.measured, middle.offsets))
        return replace(middle, measured=stretch_offsets, offsets=offsets)

    @property
    def width(self) -> float:
        """Return the pavement's width, m."""
        return self.high - self.low

    @property
    def middle(self) -> Line | None:
        """Return the most painted of the lines near the band's middle, a dashed one first; None if there is none."""
        middle = 0.5 * (self.low + self.high)
        central_lines = [line for line in self.lines if abs(line.offset - middle) < _IN_THE_MIDDLE * self.width]
        central_lines = [line for line in central_lines if (line.dash, line.gap) in STANDARD_DASHES] or central_lines
        return max(central_lines, key=lambda line: line.length * line.width, default=None)

    def guide(self, sign: int) -> Line:
        """Return the outermost line to the right (-1) or left (+1), or the pavement's edge if no line is near it."""
        edge = self.edges[0 if sign < 0 else 1]
        line = self.lines[0 if sign < 0 else -1] if self.lines else None
        return line if line is not None and abs(line.offset - edge.offset) < _NEAR_EDGE else edge


@dataclass(frozen=True)
class RoadLayout:
    """Layout of a road in profiles: its carriageways, with their lines, and the pavement.

    Attributes:
        kind: dual or single carriageway.
        bands: carriageways from right to left: two of a dual carriageway, one of a single one.
        pavement: cross profiles with their share of pavement.
        notes: what was left out, in words.
        parted: (K,) probability that the road has two carriageways there, not one; None if nothing was looked for.
    """

    kind: RoadKind
    bands: tuple[Band, ...]
    pavement: Pavement
    notes: tuple[str, ...]
    parted: Float | None = None

    @property
    def profiles(self) -> Profiles:
        """Return the cross profiles that show the layout."""
        return self.pavement.profiles


def find_layout(profiles: Profiles, lines: list[Line], kind: RoadKind | None = None, asked: bool = True) -> RoadLayout:
    """Return the layout of carriageways and lanes that lines and pavement of the profiles show.

    Args:
        profiles: along a path parallel to the road.
        lines: all line markings found in the profiles.
        kind: dual or single carriageway; None if the profiles must tell.
        asked: whether the user gave the kind; else it was found along another path.

    Raises:
        InputError: no carriageway can be made out.
    """
    # Classes tell a median from pavement; without them lines and ground do.
    medians: list[Median] = []
    share, band = profiles.paved, None
    if share is None:
        band = None if kind == "dual" else _unpainted_band(profiles, lines)
        medians = find_medians(profiles, lines) if band is None and kind != "single" else []
        share = band.share(profiles) if band else cut_medians(paved_by_brightness(profiles, lines), profiles, medians)
    pavement, notes = Pavement(profiles, share), []
    spans = paved_spans(pavement)
    # Rural roads have gaps in their lines, and no turnouts.
    seen_share = _SEEN_RURAL if len(spans) == 1 or kind == "single" else _SEEN
    parts = [_Part.of(pavement, spans, number) for number in range(len(spans))]
    bands = [_band(pavement, part, part.main(lines, seen_share)) for part in parts]
    if not bands and band is not None:  # along a path that isn't parallel to it no offset is paved throughout
        bands = [_sloping_band(profiles, band)]
    left_out = sum(all(line not in part.main(lines, seen_share) for part in parts) for line in lines)
    if left_out:
        notes.append(f"{left_out} lines were seen on a small part of the road and left out")
    if not bands:
        raise InputError("road", None, "no carriageway can be made out in the cloud")
    pair = None if kind == "single" else _carriageway_pair(bands)
    if pair is None and kind == "dual":
        raise _one_carriageway(asked)
    carriageways = pair or (max(bands, key=lambda band: (len(band.lines), band.width)),)
    if len(bands) > len(carriageways):
        notes.append(f"{len(bands) - len(carriageways)} other strips of pavement were left out")
    parted = _parted(pavement, pair, medians)
    return RoadLayout("dual" if pair else "single", carriageways, pavement, tuple(notes), parted)


def _unpainted_band(profiles: Profiles, lines: list[Line]) -> DarkBand | None:
    """Return the dark band of a road without paint; None where paint is seen, or no band."""
    band = find_band(profiles)
    if band.seen < _SEEN:
        return None
    for line in lines:
        on_band = (line.offsets > band.right - _ON_BAND) & (line.offsets < band.left + _ON_BAND)
        is_on_band = float(on_band.mean()) > 0.5 * line.length / profiles.covered_length
        # Grass passes for dashes as long as their gaps, paint of that kind lies on the band.
        is_dashed_paint = (line.dash, line.gap) in STANDARD_DASHES and (is_on_band or line.gap > 1.5 * line.dash)
        least = (_SEEN_RURAL if is_on_band else _SEEN) * profiles.covered_length
        if line.length >= least and (is_dashed_paint or (not is_dashed(line) and _is_strip(profiles, line))):
            return None
    return band


def _is_strip(profiles: Profiles, line: Line) -> bool:
    """Return whether a line is brighter than the ground on either side, as paint is; kerbs part two grounds."""
    places = [(line.offsets + start, line.offsets + end) for start, end in _ON_AND_BESIDE]
    on_line, right, left = (median_level(profiles, profiles.brightness, *place) for place in places)
    is_seen = np.isfinite(on_line) & np.isfinite(right) & np.isfinite(left)
    return bool(is_seen.any()) and float((on_line > np.maximum(right, left))[is_seen].mean()) >= _BRIGHTER


def _one_carriageway(asked: bool) -> InputError:
    """Return the error that two carriageways can't be made out, in terms of what the user gave."""
    if asked:
        return InputError("--road", "dual", "only one carriageway can be made out in the cloud")
    problem = "two carriageways can be made out along the road at first, but only one along the axis that was found; "
    return InputError("road", None, problem + "--road single or --road dual says how many it has")


def _parted(pavement: Pavement, pair: tuple[Band, Band] | None, medians: list[Median]) -> Float:
    """Return the probability (K,) that the road has two carriageways in each stretch.

    Between two carriageways it is as probable as the share of the ground that is unpaved there; what the lines and the
    ground of a median say counts where it is more.

    Args:
        pavement: cross profiles with their share of pavement.
        pair: the two carriageways; None if only one is made out.
        medians: strips that may part them.
    """
    stretches, offsets = pavement.profiles.stretches, pavement.profiles.offsets
    probability = np.zeros(stretches)
    if pair is None:
        medians_between = medians
    else:
        right_edge, left_edge = pair[0].high, pair[1].low
        medians_between = [m for m in medians if m.right.offset < 0.5 * (right_edge + left_edge) < m.left.offset]
        gap = pavement.share[:, (offsets > right_edge) & (offsets < left_edge)]
        rows = np.full((stretches * STRETCH, gap.shape[1]), np.nan)
        rows[: len(gap)] = gap
        bins = rows.reshape(stretches, -1)
        seen_count = np.isfinite(bins).sum(axis=1)
        unpaved = np.where(np.isfinite(bins), 1.0 - bins, 0.0).sum(axis=1) / np.maximum(seen_count, 1)
        # Unseen ground says nothing.
        if not medians_between:
            probability = np.where(seen_count > 0, unpaved, 0.5)
    for median in medians_between:
        probability = np.maximum(probability, expit(median.odds))
    return np.asarray(ndimage.median_filter(probability, _STEADY, mode="nearest"))


def with_branch(layout: RoadLayout) -> RoadLayout:
    """Return a layout that tells where the middle line of a single carriageway parts into two.

    Args:
        layout: shown by profiles along the middle line; along an axis that lies midway between two branches neither is
            followed well.
    """
    band = layout.bands[0]
    if layout.kind == "dual" or band.middle is None:
        return layout
    return replace(layout, bands=(replace(band, branch=find_branch(layout.profiles, band.middle)),))


@dataclass(frozen=True)
class _Part:
    """The part of the road on which a strip of pavement is as wide as usual.

    Attributes:
        span: offsets of the strip's right and left edge on the part, m.
        usual: (K,) mask of the stretches of the part.
        seen: share of the road's length that the part has.
        length: length of the road that the cloud shows, m.
    """

    span: tuple[float, float]
    usual: Bool
    seen: float
    length: float

    @classmethod
    def of(cls, pavement: Pavement, spans: list[tuple[float, float]], number: int) -> Self:
        """Return the usual part of a strip of pavement: less stretches whose edge lies elsewhere for a while.

        Lanes that begin or end and turnouts move an edge; a part that would be too short gives way to the whole road.

        Args:
            pavement: cross profiles with their share of pavement.
            spans: right and left edge of all strips, m, from right to left.
            number: index of the strip.
        """
        profiles, (right_edge, left_edge) = pavement.profiles, spans[number]
        middle_offsets = np.full(profiles.stretches, 0.5 * (right_edge + left_edge))
        usual_mask, span = np.ones(profiles.stretches, dtype=bool), [right_edge, left_edge]
        for side, sign in enumerate((-1, 1)):
            neighbour = number + sign
            room = abs(spans[neighbour][1 - side] - span[side]) if 0 <= neighbour < len(spans) else 2.0 * FARTHEST
            edge = pavement.edge(
                middle_offsets, sign, 0.5 * (left_edge - right_edge) + min(FARTHEST, 0.5 * room)
            ).offsets
            usual_distance = usual_place(sign * edge)
            if usual_distance is None:
                continue
            elsewhere = np.isfinite(edge) & (np.abs(sign * edge - usual_distance) > _OTHER_EDGE)
            bridged_mask = ndimage.binary_closing(np.pad(elsewhere, 3, mode="edge"), np.ones(3))[3:-3]
            elsewhere = ndimage.binary_opening(bridged_mask, np.ones(_OTHER_STRETCHES))
            if elsewhere.any():
                usual_mask &= ~elsewhere
                span[side] = sign * usual_distance
        if usual_mask.sum() < _FEWEST_USUAL * len(usual_mask):
            return cls((right_edge, left_edge), np.ones(len(usual_mask), dtype=bool), 1.0, profiles.covered_length)
        return cls((span[0], span[1]), usual_mask, float(usual_mask.mean()), profiles.covered_length)

    def main(self, lines: list[Line], seen_share: float) -> list[Line]:
        """Return the lines that are seen along at least a share ``seen_share`` of the part."""
        return [line for line in lines if self._along(line) >= seen_share * self.seen * self.length]

    def _along(self, line: Line) -> float:
        """Return the length of a line within the part, m: at most the line's own."""
        usual_part = self.usual & (line.stations > line.start) & (line.stations < line.end)
        return min(line.length, STRETCH * SPACING * float(usual_part.sum()))


def usual_place(distance: Float) -> float | None:
    """Return the usual distance, m, of an edge by its distances (K,) along the road: the innermost common one.

    Turnouts and lanes that begin make the pavement wider, and on a short road may be longer than what lies between
    them. None if the edge is seen nowhere.
    """
    distances = distance[np.isfinite(distance)]
    if not len(distances):
        return None
    # Bins of 0.1 m that reach beyond both ends; the chosen 0.4 m to both sides of a peak hold an edge's own spread.
    edges = np.arange(distances.min() - 0.25, distances.max() + 0.36, 0.1)
    count = ndimage.uniform_filter1d(np.histogram(distances, edges)[0].astype(np.float64), 3)
    peak = int(find_peaks(np.pad(count, 1), height=_COMMON * count.max())[0][0]) - 1
    peak_distances = distances[np.abs(distances - edges[peak] - 0.05) < 0.4]
    return float(np.median(peak_distances))


def paved_spans(pavement: Pavement) -> list[tuple[float, float]]:
    """Return the right and left edge, m, of each strip that is paved along most of the road and as wide as a lane."""
    profiles, has_points = pavement.profiles, np.isfinite(pavement.share)
    rows = has_points.sum(axis=0)
    share = np.where(has_points, pavement.share, 0.0).sum(axis=0) / np.maximum(rows, 1)
    strip = (share > 0.5) & (rows > _COVERED * profiles.covered_length)
    strip = ndimage.binary_closing(strip, iterations=round(_CRACK / ACROSS))
    columns = [part[0] for part in ndimage.find_objects(ndimage.label(strip)[0])]
    spans = [(profiles.offsets[c.start] - ACROSS / 2, profiles.offsets[c.stop - 1] + ACROSS / 2) for c in columns]
    return [
        (float(right_edge), float(left_edge))
        for right_edge, left_edge in spans
        if left_edge - right_edge >= _NARROWEST_BAND
    ]


def paved_by_brightness(profiles: Profiles, lines: list[Line]) -> Grid:
    """Return a mask of pavement (S, U), 1 or 0, by brightness alike that near the lane lines; NaN without points.

    Pavement is what is about as bright as the strips on both sides of the lane lines, after a blur of some metres:
    grass, soil and gravel are mostly brighter. Without a dashed line it is as bright as the smoother of two kinds of
    ground. Otsu's threshold parts the differences from that brightness, if there are two kinds of them; if not, all is
    pavement.
    """
    brightness = _blur(profiles.brightness)
    has_points = np.isfinite(brightness)
    everywhere = np.where(has_points, 1.0, np.nan).astype(np.float32)
    if any(is_dashed(line) for line in lines):
        reference = _bins_beside(profiles, _lane_lines(lines)) & has_points
    else:
        reference = _smoother_ground(profiles, brightness.astype(np.float64))
    if not reference.any():
        return everywhere
    difference = np.abs(brightness - _level_along(brightness, reference)[:, None])
    threshold = otsu_threshold(np.asarray(difference[has_points], dtype=np.float64))
    pavement = float(np.median(difference[has_points & (difference <= threshold)]))
    other_ground = float(np.median(difference[has_points & (difference > threshold)]))
    # Otsu's method splits any histogram: the parts are two kinds of ground only if they lie clearly apart.
    if other_ground - pavement < _LIKE * robust_scale(difference[reference]):
        return everywhere
    # Paint is brighter than the threshold, but lies on pavement: narrow gaps across are closed.
    mask = ndimage.grey_closing(np.where(has_points, difference <= threshold, 0.0), size=(1, _PAINT))
    return np.where(has_points, mask, np.nan).astype(np.float32)


def _bins_beside(profiles: Profiles, lines: list[Line]) -> Bool:
    """Return a mask (S, U) of the bins to both sides of lines, within the distances of `_AROUND_DASHES`."""
    mask = np.zeros(profiles.brightness.shape, dtype=bool)
    rows = np.arange(len(profiles.stations))
    for line in lines:
        offset = np.interp(profiles.stations, line.stations, line.offsets, left=np.nan, right=np.nan)
        for start, end in ((-_AROUND_DASHES[1], -_AROUND_DASHES[0]), _AROUND_DASHES):
            for shift in np.arange(start, end + 1e-9, ACROSS):
                column = np.rint((offset + shift - profiles.offsets[0]) / ACROSS)
                in_grid = np.isfinite(column) & (column >= 0) & (column < len(profiles.offsets))
                mask[rows[in_grid], column[in_grid].astype(np.int64)] = True
    return mask


def _level_along(brightness: Grid, reference: Bool) -> Float:
    """Return the mean brightness (S,) of a row's reference bins (mask (S, U)), smoothed and bridged along the road."""
    count = np.maximum(reference.sum(axis=1), 1)
    mean_brightness = np.where(reference, brightness, 0.0).sum(axis=1) / count
    has_reference = reference.any(axis=1)
    rows = np.arange(len(mean_brightness))
    mean_brightness = np.interp(rows, rows[has_reference], mean_brightness[has_reference])
    return np.asarray(ndimage.gaussian_filter1d(mean_brightness, _LEVEL_BLUR, mode="nearest"))


def _smoother_ground(profiles: Profiles, brightness: Float) -> Bool:
    """Return a mask (S, U) of the smoother one of dark and bright ground; of all bins with points if these are few."""
    has_points = np.isfinite(brightness)
    if has_points.sum() < 2:
        return has_points
    dark_ground = has_points & (brightness <= otsu_threshold(np.asarray(brightness[has_points], dtype=np.float64)))
    bright_ground = has_points & ~dark_ground
    step = np.abs(np.diff(profiles.height, axis=1, append=np.nan))
    roughness = [
        float(np.median(of_kind)) if len(of_kind := step[kind & np.isfinite(step)]) else np.inf
        for kind in (dark_ground, bright_ground)
    ]
    return dark_ground if roughness[0] <= roughness[1] else bright_ground


def _lane_lines(lines: list[Line]) -> list[Line]:
    """Return the long dashed lines, or just the longest line if none is dashed."""
    dashed = [line for line in lines if is_dashed(line)]
    longest = max((line.length for line in dashed), default=0.0)
    return [line for line in dashed if line.length > 0.5 * longest] or sorted(lines, key=lambda item: -item.length)[:1]


def _blur(values: Grid) -> Grid:
    """Return values (S, U) blurred by a Gaussian over bins with points; NaN where there are hardly any around."""
    has_points = np.isfinite(values)
    weight = ndimage.gaussian_filter(has_points.astype(np.float32), _BLUR)
    mean = ndimage.gaussian_filter(np.where(has_points, values, 0.0).astype(np.float32), _BLUR)
    with np.errstate(invalid="ignore", divide="ignore"):
        # Chosen: points in 5 % of the blur's reach tell its value.
        return np.where(weight > 0.05, mean / weight, np.nan)


def _place_in(line: Line, usual_mask: Bool | None) -> float:
    """Return a line's median offset, m, in the stretches of a mask (K,), or in all where it is seen in none of them."""
    usual_offsets = line.offsets[usual_mask] if usual_mask is not None else line.offsets
    return float(np.nanmedian(usual_offsets)) if np.isfinite(usual_offsets).any() else line.offset


def _band(pavement: Pavement, part: _Part, lines: list[Line]) -> Band:
    """Return a strip of pavement as a band with its lines; of two nearer than a lane the more painted one stays."""
    right_edge, left_edge = part.span
    line_offset = {id(line): _place_in(line, part.usual) for line in lines}
    band_lines = [
        line for line in lines if right_edge - _BAND_MARGIN < line_offset[id(line)] < left_edge + _BAND_MARGIN
    ]
    chosen_lines: list[Line] = []
    # Painted area, with 0.2 m on the width (chosen): of lines as long the wider one, of others mostly the longer one.
    for line in sorted(band_lines, key=lambda item: -item.length * (0.2 + item.width)):
        if all(
            abs(line_offset[id(line)] - line_offset[id(chosen_line)]) >= _NARROWEST_LANE for chosen_line in chosen_lines
        ):
            chosen_lines.append(line)
    chosen_lines.sort(key=lambda line: line_offset[id(line)])
    missing_offsets = []
    for right_line, left_line in pairwise(line_offset[id(line)] for line in chosen_lines):
        if left_line - right_line > _WIDEST_LANE:
            count = round((left_line - right_line) / _USUAL_LANE)
            missing_offsets += [right_line + (left_line - right_line) * (i + 1) / count for i in range(count - 1)]
    edges = _edge_line(pavement, part.span, -1), _edge_line(pavement, part.span, 1)
    return Band(right_edge, left_edge, chosen_lines, edges, missing_offsets, part.usual)


def _edge_line(pavement: Pavement, span: tuple[float, float], sign: int) -> Line:
    """Return the right (-1) or left (+1) edge of a strip of pavement, smoothed, in the form of a line without paint."""
    right_edge, left_edge = span
    stations = pavement.profiles.middles
    begin = np.full(len(stations), 0.5 * (right_edge + left_edge))
    edge = pavement.edge(begin, sign, 0.5 * (left_edge - right_edge) + _BESIDE)
    return _line_without_paint(stations, edge.offsets, edge.spacing, left_edge if sign > 0 else right_edge)


def _sloping_band(profiles: Profiles, dark_band: DarkBand) -> Band:
    """Return a dark band as a carriageway without lines, its edges wherever they lie in each stretch."""
    edges = dark_band.right, dark_band.left
    low, high = (float(np.nanmedian(edge)) for edge in edges)
    right, left = (
        _line_without_paint(profiles.middles, edge, np.zeros(len(edge)), place)
        for edge, place in zip(edges, (low, high), strict=True)
    )
    return Band(low, high, [], (right, left))


def _line_without_paint(stations: Float, measured: Float, spacing: Float, usual: float) -> Line:
    """Return an edge measured at stations (K,) as a line without paint, smoothed; at a usual offset, m, if unseen."""
    weights = np.isfinite(measured).astype(np.float64)
    smooth_edge = smooth(measured, weights, STRETCH * SPACING, WAVELENGTH, usual_std=USUAL)
    return Line(
        stations=stations,
        measured=measured,
        offsets=smooth_edge.values if weights.any() else np.full(len(stations), usual),
        std=smooth_edge.std,
        spacing=spacing,
        cover=np.zeros(len(stations)),
        start=float(stations[0]),
        end=float(stations[-1]),
    )


def _carriageway_pair(bands: list[Band]) -> tuple[Band, Band] | None:
    """Return the two neighbouring bands between which a median may lie, those with most lines; None without any."""
    pairs = [
        (right_band, left_band)
        for right_band, left_band in pairwise(bands)
        if _NARROWEST_MEDIAN <= left_band.low - right_band.high <= _WIDEST_MEDIAN
        and _is_whole(right_band)
        and _is_whole(left_band)
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
        raw: (K,) offsets before smoothing, m; NaN where no line was seen.
    """

    stations: Float
    offsets: Float
    std: Float
    raw: Float


def axis_from_lines(layout: RoadLayout) -> FoundAxis:
    """Return the axis of a layout, from its middle or innermost lines, by a vote of all lines on its course.

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
    centre = np.mean([line.measured for line in guides], axis=0)  # the axis by its guides alone
    voted_offsets, start = centre, centre
    if not any(np.isfinite(line.measured).any() for line in lines):
        raise InputError("road", None, "neither lines nor edges of a carriageway can be made out in the cloud")
    if not np.isfinite(centre).any():
        # Without guides begin with the mean of all lines.
        line_offsets = np.array([line.measured for line in lines])
        has_votes = np.isfinite(line_offsets).sum(axis=0)
        start = np.where(has_votes > 0, np.nansum(line_offsets, axis=0) / np.maximum(has_votes, 1), np.nan)
    # Repeated, as a line's mean distance is from the axis of the round before.
    axis = fill_gaps(start)
    for _ in range(_ROUNDS):
        voted_offsets = _vote_axis(lines, axis)
        # The votes give the axis up to a constant, which its guides fix.
        voted_offsets = voted_offsets + _mean_difference(centre - voted_offsets)
        axis = fill_gaps(voted_offsets)
    smooth_axis = smooth(
        voted_offsets,
        np.where(np.isfinite(voted_offsets), 1.0, 0.0),
        STRETCH * SPACING,
        _AXIS_WAVELENGTH,
        usual_std=USUAL,
    )
    # The deviation of the constant, which smoothing along the road doesn't lessen.
    level_std = mean_with_std(centre - voted_offsets)[1]
    level_std = float(
        np.hypot(level_std if np.isfinite(level_std) else 0.0, _shared_error(guides, smooth_axis.scatter))
    )
    has_votes = np.isfinite(voted_offsets)
    # No curve is guessed where nothing was seen.
    axis_offsets = np.interp(stations, stations[has_votes], smooth_axis.values[has_votes])
    return FoundAxis(stations, axis_offsets, np.hypot(smooth_axis.std, level_std), voted_offsets)


def axis_guides(layout: RoadLayout) -> tuple[Line, ...]:
    """Return the lines, or edges in their place, whose mean offset is the axis: one or two."""
    if layout.kind == "dual":
        right_band, left_band = layout.bands
        return right_band.guide(1), left_band.guide(-1)
    (band,) = layout.bands
    if band.axis_line is not None:
        return (band.axis_line,)
    guides = band.guide(-1), band.guide(1)
    # A line on one side and the pavement's edge on the other have nothing between them that is the middle of both.
    same_kind = (guides[0].width > 0.0) == (guides[1].width > 0.0)
    return guides if same_kind and _seen_together(guides) >= _TOGETHER * _seen_together(band.edges) else band.edges


def _seen_together(pair: tuple[Line, Line]) -> int:
    """Return the number of stretches in which both of two lines are seen."""
    return int((np.isfinite(pair[0].measured) & np.isfinite(pair[1].measured)).sum())


def _vote_axis(lines: list[Line], axis: Float) -> Float:
    """Return the axis on which all lines agree best: its offset (K,), m, in each stretch; NaN where none has a vote.

    Each line votes for the place at its mean distance beside it; the result is the weighted mean of the votes.

    Args:
        lines: L lines.
        axis: (K,) offsets, m, of the axis from which the lines' mean distances are measured.
    """
    # All arrays below are (L, K) but `mean` and `scatter` (L,) and `total` (K,); NaN where a line isn't seen.
    offsets = np.array([line.measured for line in lines])
    std = np.array([line.std for line in lines])
    distance = offsets - axis
    mean = np.array([mean_with_std(row)[0] for row in distance])
    scatter = np.array([_robust_spread(row - value) for row, value in zip(distance, mean, strict=True)])
    is_measured = np.isfinite(offsets) & np.isfinite(std)
    # Inverse variances: the scatter of a line's distance and the error of each offset add up; 1 mm^2 keeps them finite.
    weight = np.where(is_measured, 1.0 / (scatter[:, None] ** 2 + np.where(is_measured, std, 1.0) ** 2 + 1e-6), 0.0)
    # A line whose distance changes, where a lane begins or ends, has no vote there: Tukey's bisquare is 0 far from the
    # mean, by the line's own scatter, or what is usual.
    residual = np.where(is_measured, distance - mean[:, None], 0.0)
    weight *= np.array([bisquare(row, max(sigma, USUAL)) for row, sigma in zip(residual, scatter, strict=True)])
    votes = np.where(is_measured, offsets - mean[:, None], 0.0)
    total = weight.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(total > 0.0, (weight * votes).sum(axis=0) / total, np.nan)


def _shared_error(guides: tuple[Line, ...], scatter: float) -> float:
    """Return the standard deviation, m, of the error that all offsets of the axis share, see `hidden_std`."""
    return float(np.sqrt(sum(hidden_std(line.spacing, scatter) ** 2 for line in guides))) / len(guides)


def _robust_spread(values: Float) -> float:
    """Return the robust deviation of values, m, at least 3 mm (chosen: paint isn't laid better); inf without any."""
    finite_values = values[np.isfinite(values)]
    return max(robust_scale(finite_values), 0.003) if len(finite_values) else np.inf


def _mean_difference(difference: Float) -> float:
    """Return the robust mean of differences, m; 0 without any."""
    value = mean_with_std(difference)[0]
    return value if np.isfinite(value) else 0.0
