"""Which lines belong together: carriageways, their lanes, and the median."""

from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Literal, Self

import numpy as np
from scipy import ndimage
from scipy.special import expit

from ..base.arrays import Bool, Float
from ..base.errors import InputError
from .branches import find_branch
from .country.one_sided import OneSided, find_one_sided
from .country.pairs import join_pairs
from .edges import FARTHEST, Pavement, usual_place
from .ground.band import DarkBand, find_band
from .ground.levels import median_level
from .ground.medians import Median, cut_medians, find_medians, is_lane_line
from .ground.paved import lines_on_pavement, paved_by_brightness, paved_spans
from .lines import STANDARD_DASHES, USUAL, WAVELENGTH, Line, is_dashed
from .path import SPACING
from .profiles import STRETCH, Profiles
from .smoothing import smooth

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
_NARROWEST_MEDIAN, _WIDEST_MEDIAN = 0.8, 30.0
"""Widths of medians, m. Chosen: a concrete barrier on its own; carriageways that are farther apart are two roads."""
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
_ON_AND_BESIDE = ((-0.1, 0.1), (-0.8, -0.3), (0.3, 0.8))
"""Distances from a line's middle, m: on it, to the right, to the left. Chosen: beyond its paint, within a verge."""
_BRIGHTER = 0.8
"""Share of the stretches in which paint is brighter than both sides. Chosen: of noise it is a half, of paint nearly
all."""
_ON_BAND = 0.5
"""Distance beside the dark band that a line on it may lie at, m. Chosen: what the band's edge is off by."""
_FALSE_LINES = 1
"""Lines by which a pair of carriageways must exceed another one to be the road. Chosen: an edge of the pavement passes
for a line where it is bright."""
_SAME_LANES, _OTHER_LANES = 0.12, 0.2
"""Differences of lanes' widths, m, up to which carriageways are alike, and from which on they aren't. Chosen: widths of
lanes come in steps of 0.25 m, and are measured to some centimetres."""
_OTHER_PERIOD = 2.0
"""Difference of the periods of two lane lines that have other patterns, m. Chosen: standard ones differ by 3 m."""
_STEADY = 5
"""Stretches over which the number of carriageways is judged. Chosen: 25 m, as no median begins for less."""


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
        """Return the most painted of the lines near the band's middle; None if there is none.

        A pair of lines comes first, then a dashed one.
        """
        middle = 0.5 * (self.low + self.high)
        central_lines = [line for line in self.lines if abs(line.offset - middle) < _IN_THE_MIDDLE * self.width]
        central_lines = [line for line in central_lines if line.pair is not None] or central_lines
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
        has_rival: whether two other neighbouring carriageways have about as many lines, and may be the road as well.
        one_sided: where the pavement of a single carriageway is wider on one side; None if nothing was looked for.
    """

    kind: RoadKind
    bands: tuple[Band, ...]
    pavement: Pavement
    notes: tuple[str, ...]
    parted: Float | None = None
    has_rival: bool = False
    one_sided: OneSided | None = None

    @property
    def shift(self) -> Float:
        """Return how far (K,), m, the pavement's middle lies to the left of a single carriageway's axis.

        It isn't 0 where two lines part the directions and one of these has more lanes than the other, and beside bays.
        """
        beside_bays = np.zeros(self.profiles.stretches) if self.one_sided is None else self.one_sided.shift
        return beside_bays + self._shift_by_lanes()

    @property
    def edges(self) -> tuple[Line, Line]:
        """Return the right and left edge of a single carriageway's pavement, less bays."""
        edges = self.bands[0].edges
        return edges if self.one_sided is None else self.one_sided.straight(edges)

    def _shift_by_lanes(self) -> float:
        """Return how far, m, a single carriageway's pavement has its middle to the left of its axis by its lanes."""
        middle = self.bands[0].middle
        if self.kind == "dual" or middle is None or middle.pair is None:
            return 0.0
        (band,) = self.bands
        axis = band.place(middle)
        places = [*(band.place(line) for line in band.lines), *band.missing]
        sides = [sorted(sign * (place - axis) for place in places if sign * (place - axis) > 0.0) for sign in (-1, 1)]
        half = 0.5 * middle.apart
        are_lanes = all(
            _NARROWEST_LANE <= width <= _WIDEST_LANE for side in sides for width in np.diff([half, *side]).tolist()
        )
        if not are_lanes or not all(sides) or len(sides[0]) == len(sides[1]):
            return 0.0
        return 0.5 * (band.low + band.high) - axis

    @property
    def profiles(self) -> Profiles:
        """Return the cross profiles that show the layout."""
        return self.pavement.profiles


def find_layout(
    profiles: Profiles,
    lines: list[Line],
    kind: RoadKind | None = None,
    asked: bool = True,
    learned: Float | None = None,
) -> RoadLayout:
    """Return the layout of carriageways and lanes that lines and pavement of the profiles show.

    Args:
        profiles: along a path parallel to the road.
        lines: all line markings found in the profiles.
        kind: dual or single carriageway; None if the profiles must tell.
        asked: whether the user gave the kind; else it was found along another path.
        learned: (K,) offsets of the axis by a network, m, which are one more evidence of a median; None without one.

    Raises:
        InputError: no carriageway can be made out.
    """
    # Classes are one kind of evidence of a median, beside lines and ground: a model takes bright medians for road.
    share, band = profiles.paved, None
    if share is None:
        lines = lines_on_pavement(profiles, lines)
        band = None if kind == "dual" else _unpainted_band(profiles, lines)
        share = band.share(profiles) if band else paved_by_brightness(profiles, lines)
    medians = find_medians(profiles, lines, learned) if band is None and kind != "single" else []
    share = cut_medians(share, profiles, medians)
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
    pair, has_rival = (None, False) if kind == "single" else _carriageway_pair(bands)
    if pair is None and kind == "dual":
        raise _one_carriageway(asked)
    carriageways = pair or (max(bands, key=lambda band: (len(band.lines), band.width)),)
    if pair is None and parts:
        part = parts[bands.index(carriageways[0])]
        carriageways = (_band(pavement, part, join_pairs(part.main(lines, seen_share), *part.span)),)
    if len(bands) > len(carriageways):
        notes.append(f"{len(bands) - len(carriageways)} other strips of pavement were left out")
    parted = _parted(pavement, pair, medians)
    kind_seen: RoadKind = "dual" if pair else "single"
    # By brightness edges wander too much: kerbs and footways of streets would pass for bays.
    by_class = profiles.paved is not None and pair is None and parts
    one_sided = find_one_sided(pavement, carriageways[0].low, carriageways[0].high) if by_class else None
    return RoadLayout(kind_seen, carriageways, pavement, tuple(notes), parted, has_rival, one_sided)


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
    if layout.kind == "dual" or band.middle is None or band.middle.pair is not None:
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


def _carriageway_pair(bands: list[Band]) -> tuple[tuple[Band, Band] | None, bool]:
    """Return the two neighbouring bands between which a median may lie, and whether another pair may be the road.

    Those with most lines are the road. Where two pairs have about as many, as both directions' carriageways and those
    of one direction may have, the road is the pair whose lanes are alike on both sides of its median; if both are, or
    neither, it isn't told. None without any pair.
    """
    pairs = sorted(_carriageway_pairs(bands), key=_line_count, reverse=True)
    if not pairs:
        return None, False
    rivals = [pair for pair in pairs if _line_count(pair) >= _line_count(pairs[0]) - _FALSE_LINES]
    unlikeness = [_unlikeness(pair) for pair in rivals]
    alike = [pair for pair, value in zip(rivals, unlikeness, strict=True) if value < _SAME_LANES]
    if len(alike) == 1 and all(value > _OTHER_LANES for value in unlikeness if value >= _SAME_LANES):
        return alike[0], False
    return pairs[0], len(rivals) > 1


def _unlikeness(pair: tuple[Band, Band]) -> float:
    """Return by how much the lanes of two bands differ at most, m, from the median outwards as far as both have lines.

    The outermost lane has no say if it isn't the only one: a pavement's edge may pass for its line. Infinity where
    fewer than two lines on either side are seen, and where the lane lines have other periods: both directions of a road
    are painted by the same rules.
    """
    periods = [
        [line.dash + line.gap for line in sorted(band.lines, key=lambda line: -line.length) if is_lane_line(line)][:1]
        for band in pair
    ]
    if all(periods) and abs(periods[0][0] - periods[1][0]) > _OTHER_PERIOD:
        return np.inf
    places = [sorted(sign * band.place(line) for line in band.lines) for band, sign in zip(pair, (-1, 1), strict=True)]
    count = min(len(side) for side in places)
    if count < 2:
        return np.inf
    right, left = (np.diff(side[:count])[: max(1, count - 2)] for side in places)
    return float(np.abs(right - left).max())


def _line_count(pair: tuple[Band, Band]) -> int:
    """Return the number of lines of two bands."""
    return len(pair[0].lines) + len(pair[1].lines)


def _carriageway_pairs(bands: list[Band]) -> list[tuple[Band, Band]]:
    """Return the neighbouring bands between which a median may lie, from right to left."""
    return [
        (right_band, left_band)
        for right_band, left_band in pairwise(bands)
        if _NARROWEST_MEDIAN <= left_band.low - right_band.high <= _WIDEST_MEDIAN
        and _is_whole(right_band)
        and _is_whole(left_band)
    ]


def _is_whole(band: Band) -> bool:
    """Return whether a band may be one direction's carriageway, by its lines or its width."""
    return len(band.lines) >= 2 or band.width >= _UNMARKED_CARRIAGEWAY
