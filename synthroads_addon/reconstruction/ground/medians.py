"""Medians between carriageways, each stretch by its own evidence: the lines around, and how the ground differs.

A median has a solid line on either side and lanes beyond both. The ground between the lines may be brighter or darker
than these lanes, higher or rougher, each by little: what counts is how it compares with the difference from lane to
lane. A narrow median that is paved like the lanes is told by the lines alone, and less surely.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy import ndimage

from ...base.arrays import Float
from ..lines import STANDARD_DASHES, Line, is_dashed
from ..path import SPACING
from ..profiles import STRETCH, Grid, Profiles
from ..smoothing import fill_gaps, robust_scale
from .levels import median_level

_NARROWEST, _WIDEST = 1.2, 30.0
"""Distances of the lines beside a median, m. Chosen: a double line is laid in 1 m at most; carriageways that are
farther apart are two roads."""
_LANE = (2.3, 5.2)
"""Widths of lanes, m. Chosen: as in `layout`."""
_LIKE_A_LANE = (2.6, 4.1)
"""Distances of two solid lines, m, that a lane between them has as well. Chosen: a standard lane with its tolerance."""
_BESIDE_PAINT = 0.3
"""Distance from a line's middle from which on its paint doesn't reach, m. Chosen: a wide line and a bin."""
_EDGE_STRIP = 0.5
"""Width of the pavement between a median and the line beside it, m: edge strip by RAA 2008."""
_STRIP = 1.3
"""Width of the ground beside lines that a median is compared with, m. Chosen: less than half of a lane."""
_SEEN = 0.3
"""Share of the length on which the cloud holds a line that it must be seen on to frame a median. Chosen: as `layout`
takes lines of rural roads."""
_SHORTEST = 40.0
"""Length of such a line, m, at least. Chosen: the window in which lines are looked for; shorter ones are faults."""
_HELD = 0.3
"""Distance to either side of a line within which the cloud holds points where it holds the line, m. Chosen: as far as
rows of points lie apart."""
_DASHES = (1.0, 2.0)
"""Differences of a lane line's period, and of its dashes, from a standard pattern's, m. Chosen: a bin of the road, and
what wear leaves of both ends of a dash."""
_NEAR = 4
"""Stretches to either side whose evidence counts. Chosen: 20 m; no median ends sooner."""
_BRIGHTNESS = (0.04, 0.6)
"""Deviation of the logarithm of brightness from lane to lane at least, and of another ground's. Chosen: wear; 2.5
dB."""
_HEIGHT = (0.01, 0.1)
"""The same of heights, m. Chosen: rutting; a kerb."""
_ROUGHNESS = (0.2, 0.8)
"""The same of the logarithm of roughness. Chosen: of some fifty heights; grass has twice to three times asphalt's."""
_PAVED = (0.05, 0.5)
"""The same of the share that classes call pavement. Chosen: a model's faults from lane to lane; half of the points."""
_AGAINST, _FOR = -0.7, 5.0
"""Limits of one kind of evidence, log-odds. Chosen: ground may be paved alike, so that likeness says little."""
_AGAINST_BY_CLASS = -2.5
"""Limit of evidence by class, log-odds. Chosen: beyond what lines alone say for a median."""
_OTHER_PERIOD, _OTHER_PHASE, _SAME_PHASE = 1.0, 0.5, -0.5
"""Log-odds where the dashes nearest to both sides have other periods, the same one but begin elsewhere, or the same
course. Chosen: each direction is painted on its own, lines of one carriageway mostly together."""
_PERIOD, _PHASE = 1.5, 1.0
"""Differences of periods and of dashes' beginnings, m, from which on they aren't the same. Chosen: bins of a metre."""
_MIRRORED, _UNLIKE, _MIRROR = 0.5, -0.5, 0.35
"""Log-odds where each line beyond one side has its mirror image beyond the other, or none has, and how exact that is,
m. Chosen: most motorways are alike in both directions, and so are many roads about a lane."""
_AXIS_ERROR, _AXIS_RANGE = 0.5, 16.0
"""Deviation of a network's axis from the middle of a median, m, and width of the road on which it lies anywhere if the
axis isn't there, m. Chosen: half of a narrow median; two carriageways."""
_BY_NETWORK = (-0.7, 1.5)
"""Limits of the evidence by a network's axis, log-odds. Chosen: one view of several; a road with three carriageways has
two medians, of which it sees one."""
_PRIOR = -1.0
"""Log-odds of a median between two solid lines with lanes beyond both. Chosen: other roads have such lines as well."""
_FRAMED, _NO_LANE = 4.0, 1.0
"""Log-odds that dashed lines beyond both sides add, and a distance that no lane has. Chosen: a lane between two solid
lines amid lanes is seldom; of another width more so."""


@dataclass(frozen=True)
class Median:
    """A strip between two solid lines that may be a median.

    Attributes:
        right, left: the lines beside it.
        low, high: (K,) offsets, m, of its edges in each stretch.
        odds: (K,) logarithm of the odds that it parts two carriageways there.
    """

    right: Line
    left: Line
    low: Float
    high: Float
    odds: Float

    @property
    def total(self) -> float:
        """Return the mean log-odds over the part of the road on which both lines are seen, or over all of it."""
        both_seen = np.isfinite(self.right.offsets) & np.isfinite(self.left.offsets)
        return float(np.mean(self.odds[both_seen] if both_seen.any() else self.odds))


def find_medians(profiles: Profiles, lines: Sequence[Line], learned: Float | None = None) -> list[Median]:
    """Return the strips that are medians rather than lanes on most of their length, from right to left.

    Of strips that overlap the likelier one is returned. A strip counts by the stretches in which the cloud holds it: a
    carriageway beside the road may begin, end, or be cut off.

    Args:
        profiles: along a path parallel to the road.
        lines: all line markings on pavement.
        learned: (K,) offsets of the axis by a network, m, NaN where it sees none; None without a network.
    """
    usual_lines = [line for line in lines if line.length >= max(_SHORTEST, _SEEN * _held_length(profiles, line))]
    strips = []
    for right, left in combinations([line for line in usual_lines if not is_dashed(line)], 2):
        gap = left.offset - right.offset
        between = [line for line in usual_lines if right.offset < line.offset < left.offset]
        if not _NARROWEST <= gap <= _WIDEST or any(_parts_lanes(line, right, left) for line in between):
            continue
        strip = _median_between(profiles, right, left, usual_lines)
        strips.append(replace(strip, odds=strip.odds + _network_odds(strip, learned)))
    chosen: list[Median] = []
    for strip in sorted((strip for strip in strips if strip.total > 0.0), key=lambda strip: -strip.total):
        if all(strip.left.offset <= one.right.offset or strip.right.offset >= one.left.offset for one in chosen):
            chosen.append(strip)
    return sorted(chosen, key=lambda strip: strip.right.offset)


def cut_medians(share: Grid, profiles: Profiles, medians: Sequence[Median]) -> Grid:
    """Return shares of pavement (S, U) that are 0 in the medians, in the stretches in which they are likely.

    Medians that the shares show by themselves stay as they are: their edges are seen.
    """
    result = share.copy()
    for median in medians:
        between = (profiles.offsets > np.median(median.low)) & (profiles.offsets < np.median(median.high))
        shown = share[:, between]
        if np.isfinite(shown).any() and float(np.nanmean(shown)) < 0.5:
            continue
        for number in np.flatnonzero(median.odds > 0.0):
            rows = slice(number * STRETCH, (number + 1) * STRETCH)
            inside = (profiles.offsets > median.low[number]) & (profiles.offsets < median.high[number])
            block = result[rows]
            block[:, inside] = np.where(np.isfinite(block[:, inside]), 0.0, block[:, inside])
    return result


def _median_between(profiles: Profiles, right: Line, left: Line, lines: Sequence[Line]) -> Median:
    """Return the strip between two lines with its odds."""
    right_offsets, left_offsets = (_course(line) for line in (right, left))
    sides = ((right, -1), (left, 1))
    lane_lines = [
        [other for other in lines if _LANE[0] <= sign * (other.offset - line.offset) <= _LANE[1]]
        for line, sign in sides
    ]
    has_lanes = [
        bool(others) or _is_cut_off(profiles, line, sign)
        for others, (line, sign) in zip(lane_lines, sides, strict=True)
    ]
    odds = _ground_odds(profiles, right_offsets, left_offsets)
    gap = left.offset - right.offset
    # Kerbs and edges pass for solid lines: where the cloud hides one lane's other line the other lane must be sure.
    is_sure = all(lane_lines) or any(is_lane_line(other) for others in lane_lines for other in others)
    prior = _PRIOR if all(has_lanes) and is_sure else -np.inf
    dashes = [[other for other in others if is_lane_line(other)] for others in lane_lines]
    if all(dashes):
        prior += _FRAMED + (0.0 if _LIKE_A_LANE[0] <= gap <= _LIKE_A_LANE[1] else _NO_LANE)
    prior += _pattern_odds(*dashes) + _symmetry_odds(right, left, lines)
    strip = min(_EDGE_STRIP, 0.25 * gap)
    return Median(right, left, right_offsets + strip, left_offsets - strip, prior + odds)


def _network_odds(strip: Median, learned: Float | None) -> Float:
    """Return the log-odds (K,) by where a network sees the road's axis (K,), m; 0 where it sees none."""
    if learned is None:
        return np.zeros(len(strip.odds))
    distance = learned - 0.5 * (strip.low + strip.high)
    # ln of N(d; 0, error) times the range, over which it is as likely anywhere.
    odds = np.log(_AXIS_RANGE / (_AXIS_ERROR * np.sqrt(2.0 * np.pi))) - 0.5 * (distance / _AXIS_ERROR) ** 2
    return np.where(np.isfinite(distance), np.clip(odds, *_BY_NETWORK), 0.0)


def is_lane_line(line: Line) -> bool:
    """Return whether a line's dashes are about a standard pattern's: those of faults, grass and rails mostly aren't."""
    period, dash = _DASHES
    return is_dashed(line) and any(
        abs(line.dash + line.gap - standard - gap) <= period and abs(line.dash - standard) <= dash
        for standard, gap in STANDARD_DASHES
    )


def _parts_lanes(line: Line, right: Line, left: Line) -> bool:
    """Return whether a dashed line parts two lanes between two others: where a lane has no room beside it none is."""
    return is_dashed(line) and min(line.offset - right.offset, left.offset - line.offset) >= _LANE[0]


def _held_length(profiles: Profiles, line: Line) -> float:
    """Return the length of the road, m, on which the cloud holds the ground that a line lies on."""
    near = np.abs(profiles.offsets - line.offset) <= _HELD
    return SPACING * float((profiles.count[:, near] > 0).any(axis=1).sum())


def _pattern_odds(right: Sequence[Line], left: Sequence[Line]) -> float:
    """Return the log-odds that dashed lines to the right and to the left of a strip were painted apart; 0 if unseen."""
    if not right or not left:
        return 0.0
    right_line, left_line = (max(lines, key=lambda line: line.length) for lines in (right, left))
    period, other_period = (line.dash + line.gap for line in (right_line, left_line))
    if abs(period - other_period) > _PERIOD:
        return _OTHER_PERIOD
    shift = (right_line.first_dash - left_line.first_dash + 0.5 * period) % period - 0.5 * period
    return _OTHER_PHASE if abs(shift) > _PHASE else _SAME_PHASE


def _symmetry_odds(right: Line, left: Line, lines: Sequence[Line]) -> float:
    """Return the log-odds by how many lines beyond both sides are each other's mirror images; 0 if unseen."""
    beyond = [
        np.array([sign * (other.offset - line.offset) for other in lines if sign * (other.offset - line.offset) > 0.0])
        for line, sign in ((right, -1), (left, 1))
    ]
    if not all(len(distances) for distances in beyond):
        return 0.0
    # Beyond the outermost line of the narrower side the cloud may be cut off.
    reach = min(float(distances.max()) for distances in beyond) + _MIRROR
    near = [distances[distances <= reach] for distances in beyond]
    if not all(len(distances) for distances in near):
        return 0.0
    apart = np.abs(near[0][:, None] - near[1][None])
    share = float(np.mean(np.concatenate([apart.min(axis=0), apart.min(axis=1)]) <= _MIRROR))
    return _UNLIKE + share * (_MIRRORED - _UNLIKE)


def _is_cut_off(profiles: Profiles, line: Line, sign: int) -> bool:
    """Return whether the cloud ends within a lane beyond a line, so that the lane's other line can't be seen."""
    distance = sign * (profiles.offsets - line.offset)
    beyond = (distance > 0.0) & (distance < _LANE[0])
    return not beyond.any() or float((profiles.count[:, beyond] > 0).mean()) < 0.5


def _course(line: Line) -> Float:
    """Return a line's offsets (K,), m, also where it isn't seen."""
    return fill_gaps(line.offsets)


def _ground_odds(profiles: Profiles, right: Float, left: Float) -> Float:
    """Return the log-odds (K,) by brightness, height and roughness that the ground between two lines is no lane."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # rows without points
        height = np.asarray(profiles.height - np.nanmedian(profiles.height, axis=1)[:, None], dtype=np.float64)
    step = np.abs(np.diff(height, axis=1, append=np.nan))
    floor = 1e-3 * float(np.nanmax(profiles.brightness)) + 1e-12 if np.isfinite(profiles.brightness).any() else 1.0
    middle, half = 0.5 * (right + left), 0.5 * (left - right)
    # The ground within the edge strips is pavement; of a narrow strip at least three bins count.
    core = np.maximum(half - _BESIDE_PAINT - _EDGE_STRIP, 0.15)
    places = {
        "inside": (middle - core, middle + core),
        "right": (right - _BESIDE_PAINT - _STRIP, right - _BESIDE_PAINT),
        "left": (left + _BESIDE_PAINT, left + _BESIDE_PAINT + _STRIP),
    }
    level, rise, rough = (
        {name: median_level(profiles, values, *place) for name, place in places.items()}
        for values in (profiles.brightness.astype(np.float64), height, step)
    )
    logarithm, rough_logarithm = (
        {name: np.log(np.maximum(values, least)) for name, values in table.items()}
        for table, least in ((level, floor), (rough, 1e-3))
    )
    odds = _odds_of(logarithm, *_BRIGHTNESS) + _odds_of(rise, *_HEIGHT) + _odds_of(rough_logarithm, *_ROUGHNESS)
    if profiles.paved is not None:
        paved = {name: median_level(profiles, profiles.paved, *place) for name, place in places.items()}
        # A median is less paved than both sides: what is more so is a lane beside a verge.
        right_share, left_share = paved["right"], paved["left"]
        one_sided = np.fmin(right_share, left_share)
        both_sides = np.where(np.isfinite(right_share + left_share), 0.5 * (right_share + left_share), one_sided)
        paved["inside"] = np.where(paved["inside"] >= one_sided, both_sides, paved["inside"])
        odds = odds + _odds_of(paved, *_PAVED, against=_AGAINST_BY_CLASS)
    return np.asarray(odds)


def _odds_of(levels: dict[str, Float], same_std: float, other_std: float, against: float = _AGAINST) -> Float:
    """Return the log-odds (K,), at least ``against``, that a strip is other ground than both sides, by its levels.

    Both sides are lanes: how they differ along the road says by how much pavement does.
    """
    difference = levels["inside"] - 0.5 * (levels["right"] + levels["left"])
    one_sided = np.where(np.isfinite(levels["right"]), levels["right"], levels["left"])
    difference = np.where(np.isfinite(difference), difference, levels["inside"] - one_sided)
    between_lanes = levels["right"] - levels["left"]
    lanes = between_lanes[np.isfinite(between_lanes)]
    # Of a mean of two lanes and a strip the deviation is sqrt(3 / 2) of one's, that between two lanes sqrt(2).
    scatter = (
        np.sqrt(0.75) * max(robust_scale(lanes - np.median(lanes)), abs(float(np.median(lanes)))) if len(lanes) else 0.0
    )
    same_std = float(np.hypot(same_std, scatter))
    other_std = max(other_std, 2.0 * same_std)
    seen = np.isfinite(difference)
    total = ndimage.uniform_filter1d(np.where(seen, difference, 0.0), 2 * _NEAR + 1, mode="nearest")
    share = ndimage.uniform_filter1d(seen.astype(np.float64), 2 * _NEAR + 1, mode="nearest")
    mean = np.where(share > 0.0, total / np.maximum(share, 1e-9), 0.0)
    # ln of N(d; 0, other) / N(d; 0, same).
    odds = np.log(same_std / other_std) + 0.5 * mean**2 * (same_std**-2 - other_std**-2)
    return np.where(share > 0.2, np.clip(odds, against, _FOR), 0.0)
