"""Judgement of a reconstruction: where its axis is not to be trusted, and why.

The axis comes from lines, or from edges found beside them. Here the pavement is looked for once more, without lines and
without classes: as what is about as bright as the ground on the supposed lanes, and ends where the brightness changes
or the ground steps up or down. A single carriageway's axis must lie in the middle of it, a dual one's in the middle of
what lies between two such pavements.
"""

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import ndimage

from ..base.arrays import Bool, Float
from .layout import Band, RoadLayout
from .lines import Line, is_dashed
from .path import SPACING
from .profiles import ACROSS, STRETCH, Profiles, registration_signal, remove_grade
from .smoothing import difference_figures, robust_scale
from .views.fusion import APART
from .views.pavement import pavement_edges
from .views.vote import axis_from_lines, axis_guides

FARTHEST_MIDDLE = 0.75
"""The middle between the pavement's edges may lie so far beside the axis, m. Chosen: half of what a shoulder on one
side alone adds."""
FARTHEST_LINES = 0.5
"""The lines that make the axis may lie so far beside it, m. Chosen: three widths of a line."""
RAISED = 0.05
"""Paint lies flat: lines that stand so far above the ground on either side are rails, kerbs or gutters' edges, m.
Chosen: half of a kerb, more than paint and range noise."""
ROUGHEST = 0.04
"""Pavements are seen smoother than this by any scanner that shows their edges, m. Chosen: grass and soil have more."""
ASKEW = 0.08
"""Lines run along an axis: where they lie at such an angle to it, m per m, it has left them. Chosen: more than a
taper's, and than the slope at which lines are followed."""
_SLOPES, _WINDOW = np.linspace(-0.5, 0.5, 51), 20
"""Slopes of paint that are tried, m per m, and rows over which it is looked for. Chosen: what a path may be off by at
its ends; as paths are laid beside lines."""
_CLEAR, _ALONG = 0.3, 0.5
"""Share of the energy at any slope that paint stands out by, and share of that which it has along the axis at most
where it runs at an angle to it. Chosen: noise varies by a tenth with slope; lines by more than their own energy."""
_BESIDE_ROAD = 1.0
"""Distance beside the carriageways within which paint counts, m. Chosen: an edge line may lie outside of what passes
for pavement."""
_CORE = 1.5
"""Distance to either side of a carriageway's middle that is pavement if anything is, m. Chosen: a lane."""
_ON_AND_BESIDE = ((-0.05, 0.05), (-0.6, -0.3), (0.3, 0.6))
"""Distances from a line's middle, m: on it, to the right, to the left. Chosen: beyond the widest line, before the
next."""
_FEWEST_STEPS = 50
"""Steps between bins that a roughness is told from. Chosen: its deviation is then known to a tenth."""
_WIDEST_LANE, _UNDIVIDED = 5.2, 7.5
"""Widths of a lane, m, and between the edge lines of a road without a line in its middle. Chosen: above any lane of
RAL, as in `layout`; roads that are wider have such a line."""
_THREE_LANES = 9.5
"""Width of one carriageway's pavement, m, from which on it may have two lanes one way. Chosen: three lanes of 3 m with
their edge strips; two lanes of the RAL with theirs have 8.5 m."""
_CUT, _VERGE = 2, 1.5
"""Stretches around one that hide its edge where they are cut off, and ground beyond a line, m, that shows an edge.
Chosen: the reach of an edge's median profile; an edge strip and some verge."""
_NEAR = 4
"""Stretches to either side of one whose evidence counts for it. Chosen: 20 m, as an axis changes little in them."""
_SURE = 0.95
"""Probability of two carriageways from which on a strip within the median isn't the median. Chosen: as of intervals."""
_SHORTEST_TRUST = 5
"""Stretches between doubts that are trusted at least. Chosen: 25 m, less of a road is of no use."""
_SHORTEST = 3
"""Stretches of the shortest doubt. Chosen: a shorter one is a fault in the picture."""


@dataclass(frozen=True)
class Doubt:
    """A stretch of the road where the reconstruction isn't to be trusted: start and end stations, m, and reasons."""

    start: float
    end: float
    reasons: tuple[str, ...]


@dataclass(frozen=True)
class Judgement:
    """Assessment of how far a reconstruction's axis is to be trusted, and where it isn't.

    Attributes:
        doubts: stretches where the axis isn't to be trusted, in order of stations.
        trusted: share of the road's length outside of these stretches.
        lines: (K,) offset of the lines or edges that make the axis from it, m, left positive; NaN where unseen.
        middles: (K,) offset from the axis of the pavement's middle, or of the median's, m, left positive, less what
            more lanes one way than the other move it by; NaN where not both edges are seen.
        sections: stretches where the pavement is wider or narrower than the reconstructed cross-section.
    """

    doubts: list[Doubt]
    trusted: float
    lines: Float
    middles: Float
    sections: tuple[Doubt, ...] = ()

    @property
    def is_doubtful(self) -> bool:
        """Return whether any stretch of the axis or of the cross-section isn't to be trusted."""
        return bool(self.doubts or self.sections)

    def to_dict(self) -> dict[str, Any]:
        """Return the assessment as JSON data; lengths and stations in m."""
        stretches, sections = (
            [{"start": doubt.start, "end": doubt.end, "why": list(doubt.reasons)} for doubt in doubts]
            for doubts in (self.doubts, self.sections)
        )
        names = ("mean", "rms", "largest")
        return {
            "trusted": round(self.trusted, 4),
            "lines": {"seen": _share_known(self.lines), **difference_figures(self.lines, *names)},
            "middle": {"seen": _share_known(self.middles), **difference_figures(self.middles, *names)},
            "doubtful": stretches,
            "other_sections": sections,
        }


def judge(
    layout: RoadLayout,
    cores: Sequence[float],
    rivals: Bool | None = None,
    parted: Float | None = None,
    confirmed: Bool | None = None,
) -> Judgement:
    """Return the judgement of an axis, offset 0 of the layout's profiles: where it isn't to be trusted, and why.

    Args:
        layout: carriageways and lines that profiles along the axis show.
        cores: offsets of the carriageways' middles, m, around which is surely pavement.
        rivals: (K,) mask of the stretches where views of the axis disagree; None if nowhere.
        parted: (K,) offsets of the line midway between both branches of a middle line that parts, m
            (`FoundRoad.parted_line`); None if it parts nowhere.
        confirmed: (K,) mask of the stretches where a view that needs neither lines nor edges agrees with the lines;
            None if nowhere.
    """
    profiles, guides = layout.profiles, axis_guides(layout)
    lines = np.mean([guide.measured for guide in guides], axis=0) if parted is None else parted
    if parted is None and np.isfinite(lines).any():  # without any guide's offset the other lines' distances are unknown
        lines = np.where(np.isfinite(lines), lines, _axis_by_votes(layout))
    middles = np.mean(pavement_edges(profiles, cores, layout.kind == "dual"), axis=0)
    if profiles.paved is not None:  # classes tell the edges that neither brightness nor height shows
        middles = np.where(np.isfinite(middles), middles, _middles_by_class(layout))
    middles = _less_bays(layout, middles)
    if layout.kind == "dual":
        middles = np.where(_is_part_of_median(layout, cores), np.nan, middles)
    middle_name, edges_reason = "the pavement's middle", "the pavement's edges aren't seen on both sides"
    unseen = np.isnan(middles)
    if layout.kind == "dual":
        middle_name = "the median's middle"
        edges_reason = "neither the median's edges nor lines on both sides of it are seen"
        both_painted = np.all(
            [_is_painted(band, guide) for band, guide in zip(layout.bands, guides, strict=True)], axis=0
        )
        unseen &= ~_widen_mask(both_painted)
    else:  # edges that the cloud doesn't hold say nothing against lines
        unseen &= ~_framed_by_lines(layout)
    if confirmed is not None:
        unseen &= ~(confirmed & _widen_mask(np.isfinite(lines)))
    reasons = {
        "neither lines nor edges are seen": ~_widen_mask(np.isfinite(lines)),
        f"the lines lie more than {FARTHEST_LINES:g} m beside it": np.abs(lines) > FARTHEST_LINES,
        edges_reason: unseen,
        f"{middle_name} lies more than {FARTHEST_MIDDLE:g} m beside it": np.abs(middles) > FARTHEST_MIDDLE,
        "the ground on its lanes is too rough for a pavement": lane_roughness(profiles, cores) > ROUGHEST,
    }
    reasons["its lines stand above the ground, as rails do and no paint"] = raised_lines(layout) > RAISED
    reasons[f"paint runs at more than {ASKEW:g} m per m to it"] = np.abs(paint_slope(layout)) > ASKEW
    reasons |= _single_reasons(layout)
    if layout.parted is not None:
        is_other = layout.parted < 0.5 if layout.kind == "dual" else layout.parted > 0.5
        reasons["whether the road has one carriageway or two isn't clear"] = is_other
    if layout.has_rival:
        reasons["two pairs of carriageways have about as many lines, and either may be the road"] = np.ones_like(unseen)
    if rivals is not None:
        reasons[f"views of it disagree by more than {APART:g} m"] = rivals
    masks = {reason: _without_short_runs(mask) for reason, mask in reasons.items()}
    doubtful = ndimage.binary_dilation(np.any(list(masks.values()), axis=0), iterations=_SHORTEST - 1)
    if doubtful.any():  # between doubts, or between a doubt and the road's end, only long stretches are trusted
        doubtful = ~ndimage.binary_opening(~doubtful, np.ones(_SHORTEST_TRUST))
    doubts = list(_doubts(profiles, doubtful, masks))
    return Judgement(doubts, float(1.0 - doubtful.mean()), lines, middles)


def _is_part_of_median(layout: RoadLayout, cores: Sequence[float]) -> Bool:
    """Return a mask (K,) of the stretches in which what looks like the median lies between the lines beside it.

    Where solid lines and the ground between them show the median for sure, a kerb, a rail or a stripe of another ground
    within it isn't its middle, and says nothing against it. Ground beyond these lines does.
    """
    right, left = axis_guides(layout)
    if layout.parted is None or right.width == 0.0 or left.width == 0.0 or is_dashed(right) or is_dashed(left):
        return np.zeros(layout.profiles.stretches, dtype=bool)
    right_edge, left_edge = pavement_edges(layout.profiles, cores, True)
    within = (right_edge > right.offset - ACROSS) & (left_edge < left.offset + ACROSS)  # False where unseen
    return np.asarray(within & (layout.parted > _SURE))


def _less_bays(layout: RoadLayout, middles: Float) -> Float:
    """Return the pavement's middles (K,), m, less what bays and lanes shift them by.

    A bay of other stone than the road isn't part of what looks like it: where a line shows the axis, a middle that lies
    as near to it without the shift isn't shifted.
    """
    shifted = middles - layout.shift
    if not all(guide.width > 0.0 for guide in axis_guides(layout)):
        return shifted
    bays = np.zeros(len(middles)) if layout.one_sided is None else layout.one_sided.shift
    return np.where(np.abs(shifted + bays) < np.abs(shifted), shifted + bays, shifted)


def _single_reasons(layout: RoadLayout) -> dict[str, Bool]:
    """Return by reason the masks (K,) of the stretches in which a single carriageway's axis can't be known."""
    everywhere = np.ones(layout.profiles.stretches, dtype=bool)
    by_edges = layout.one_sided is not None and not any(guide.width > 0.0 for guide in axis_guides(layout))
    is_open = layout.one_sided.is_open if layout.one_sided is not None and by_edges else ~everywhere
    return {
        "the pavement is wider, and which of its sides keeps its course isn't clear": is_open,
        "no line parts the directions on pavement as wide as three lanes": everywhere & _may_have_three_lanes(layout),
    }


def _may_have_three_lanes(layout: RoadLayout) -> bool:
    """Return whether one of the directions of a single carriageway may have two lanes, and no line shows which.

    A line beside the pavement's middle, where it isn't one of two, may as well part two lanes of one direction.
    """
    band, middle = layout.bands[0], layout.bands[0].middle
    if layout.kind == "dual" or band.width <= _THREE_LANES or (middle is not None and middle.pair is not None):
        return False
    return middle is None or abs(band.place(middle) - 0.5 * (band.low + band.high)) > FARTHEST_LINES


def _middles_by_class(layout: RoadLayout) -> Float:
    """Return the middle (K,), m, of the pavement by class, or of the median of a dual carriageway; NaN if unseen."""
    (right_band, left_band) = (layout.bands[0], layout.bands[-1])
    if layout.kind == "dual":
        return 0.5 * (right_band.edges[1].measured + left_band.edges[0].measured)
    return 0.5 * (right_band.edges[0].measured + right_band.edges[1].measured)


def _axis_by_votes(layout: RoadLayout) -> Float:
    """Return the axis' offset (K,), m, by the votes of all lines of a layout; a single NaN if it has no lines."""
    return axis_from_lines(layout).raw if any(band.lines for band in layout.bands) else np.array(np.nan)


def _framed_by_lines(layout: RoadLayout) -> Bool:
    """Return a mask (K,) of the stretches that are cut off within the pavement, but whose lines hold the axis.

    The road's painted lines must lie the same to both sides of the axis; then any two of them tell in a stretch where
    it runs. Where the cloud doesn't end the edges could be seen: that they aren't speaks against the axis.
    """
    lines = [line for band in layout.bands for line in band.lines if line.width > 0.0]
    places = np.array([layout.bands[0].place(line) for line in lines])
    right, left = places[places < -FARTHEST_LINES], places[places > FARTHEST_LINES]
    stretches = layout.profiles.stretches
    if not len(right) or not len(left) or abs(right[-1] + left[0]) > FARTHEST_LINES:
        return np.zeros(stretches, dtype=bool)
    frame = [line for line, place in zip(lines, places, strict=True) if right[-1] <= place <= left[0]]
    # Rows of parking bays have lines on both sides as well, but none that is dashed and a lane away.
    is_road = (
        left[0] - right[-1] <= 2.0 * _WIDEST_LANE and is_dashed(frame[1])
        if len(frame) == 3
        else left[0] - right[-1] <= _UNDIVIDED
    )
    if not is_road:
        return np.zeros(stretches, dtype=bool)
    in_place = [
        np.abs(line.measured - layout.bands[0].place(line)) < FARTHEST_LINES for line in frame
    ]  # False where unseen
    is_held = np.sum([_widen_mask(mask) for mask in in_place], axis=0) >= 2
    return np.asarray(is_held & _is_cut_off(layout.profiles, float(right[-1]), float(left[0])))


def _is_cut_off(profiles: Profiles, right: float, left: float) -> Bool:
    """Return a mask (K,) of the stretches in which the cloud ends, on either side, just beyond one of two lines (m)."""
    occupied = np.zeros((profiles.stretches * STRETCH, len(profiles.offsets)))
    occupied[: len(profiles.stations)] = profiles.count > 0
    by_stretch, offsets = occupied.reshape(profiles.stretches, STRETCH, -1).mean(axis=1), profiles.offsets
    outside = [(offsets > right - _VERGE) & (offsets < right), (offsets > left) & (offsets < left + _VERGE)]
    beyond = np.min([by_stretch[:, bins].sum(axis=1) / max(bins.sum(), 1) for bins in outside], axis=0)
    # An edge is looked for in some rows around a stretch: it is hidden where any of them is cut off.
    beyond = ndimage.minimum_filter1d(beyond, 2 * _CUT + 1, mode="nearest")
    within = by_stretch[:, (offsets > right) & (offsets < left)].mean(axis=1)
    # Chosen: half as full as between the lines, as where a side is cut within the verge.
    return np.asarray(beyond < 0.5 * np.median(within))


def _is_painted(band: Band, guide: Line) -> Bool:
    """Return a mask (K,) of stretches in which paint of a carriageway is seen: a painted line, if its guide is painted.

    A line narrower than the distance of two rows of points may lie between them for long.
    """
    parallel = [line for line in band.lines if line.width > 0.0] if guide.width > 0.0 else []
    return np.any([np.isfinite(line.measured) for line in [*parallel]] or [np.zeros(len(guide.measured), bool)], axis=0)


def lane_roughness(profiles: Profiles, cores: Sequence[float]) -> Float:
    """Return the roughness (K,), m, of the ground about the carriageways' middles; NaN where too little is seen.

    It is the standard deviation of heights as far as neighbouring bins across the road differ: slopes and waves along
    the road don't count. Of asphalt it is the scanner's noise, grass and soil have some centimetres more.
    """
    core = np.any([np.abs(profiles.offsets - middle) < _CORE for middle in cores], axis=0)
    step = np.abs(np.diff(profiles.height, axis=1, append=np.nan))[:, core]
    result = np.full(profiles.stretches, np.nan)
    for number in range(profiles.stretches):
        rows = step[max(0, (number - _NEAR) * STRETCH) : (number + _NEAR + 1) * STRETCH]
        steps = rows[np.isfinite(rows)]
        if len(steps) >= _FEWEST_STEPS:
            # A difference of two heights has sqrt(2) of their deviation.
            result[number] = robust_scale(steps) / np.sqrt(2.0)
    return result


def paint_slope(layout: RoadLayout) -> Float:
    """Return the slope (K,), m per m, of the paint on a road against its axis; 0 where no slope is clearly the best.

    The rows about a stretch are sheared by each slope; lines that run along it then lie over each other, and the
    energy (mean square) of the mean profile is the largest.
    """
    profiles = layout.profiles
    near = (profiles.offsets > layout.bands[0].low - _BESIDE_ROAD) & (
        profiles.offsets < layout.bands[-1].high + _BESIDE_ROAD
    )
    signal = np.pad(registration_signal(profiles)[:, near], ((_WINDOW, _WINDOW), (0, 0)))
    first_rows = np.arange(profiles.stretches) * STRETCH + STRETCH // 2 + _WINDOW - _WINDOW // 2
    first_rows = np.clip(first_rows, _WINDOW, max(_WINDOW, len(profiles.stations)))
    along = np.arange(_WINDOW) - 0.5 * (_WINDOW - 1)
    energy = np.zeros((len(_SLOPES), profiles.stretches))
    for number, slope in enumerate(_SLOPES):
        mean = np.zeros((profiles.stretches, signal.shape[1]))
        for row, distance in enumerate(along):
            mean += np.roll(signal[first_rows + row], -round(slope * distance * SPACING / ACROSS), axis=1) / _WINDOW
        energy[number] = (mean**2).sum(axis=1)
    noise = np.median(energy, axis=0)
    clear = energy.max(axis=0) - noise
    along_axis = energy[np.abs(_SLOPES) <= ASKEW].max(axis=0) - noise
    is_askew = (clear > _CLEAR * noise) & (along_axis < _ALONG * clear)
    return np.where(is_askew, _SLOPES[energy.argmax(axis=0)], 0.0)


def raised_lines(layout: RoadLayout) -> Float:
    """Return the height (K,), m, of the painted lines above the higher ground beside them; NaN where not seen.

    It is the median over all lines: a single one may lie on a seam, or beside a gutter.
    """
    painted_lines = [line for band in layout.bands for line in band.lines if line.width > 0.0]
    profiles, height = layout.profiles, remove_grade(layout.profiles.height)
    result = np.full((max(len(painted_lines), 1), profiles.stretches), np.nan)
    for row, line in enumerate(painted_lines):
        for number in np.flatnonzero(np.isfinite(line.measured)):
            rows = height[max(0, (number - _NEAR) * STRETCH) : (number + _NEAR + 1) * STRETCH]
            line_height, *side_heights = (
                _mean_height(profiles, rows, float(line.measured[number]), *reach) for reach in _ON_AND_BESIDE
            )
            # Unseen where either side is.
            result[row, number] = line_height - np.maximum(side_heights[0], side_heights[1])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # stretches without lines
        return np.asarray(np.nanmedian(result, axis=0))


def _mean_height(profiles: Profiles, rows: Float, offset: float, start: float, end: float) -> float:
    """Return the median height, m, of bins (R, U) between two distances (m) to the left of an offset; NaN if empty."""
    # A median: a car beside the line doesn't raise the ground.
    bins = rows[:, profiles.column(offset + start) : profiles.column(offset + end) + 1]
    heights = bins[np.isfinite(bins)]
    return float(np.median(heights)) if len(heights) else np.nan


def _widen_mask(seen_mask: Bool) -> Bool:
    """Return the mask (K,) widened by `_NEAR` stretches to either side."""
    return ndimage.binary_dilation(seen_mask, iterations=_NEAR)


def _without_short_runs(mask: Bool) -> Bool:
    """Return a mask (K,) without runs shorter than `_SHORTEST` stretches."""
    return ndimage.binary_opening(mask, np.ones(_SHORTEST))


def _doubts(profiles: Profiles, doubtful: Bool, masks: dict[str, Bool]) -> Iterator[Doubt]:
    """Yield each run of a mask (K,) as a doubt with the reasons whose masks hold anywhere in it."""
    label, _ = ndimage.label(doubtful)
    half_stretch, length = 0.5 * STRETCH, float(profiles.stations[-1])
    for (run,) in ndimage.find_objects(label):
        start = profiles.middles[run.start] - half_stretch
        end = min(profiles.middles[run.stop - 1] + half_stretch, length)
        reasons = tuple(reason for reason, mask in masks.items() if mask[run].any())
        yield Doubt(round(float(start), 1), round(float(end), 1), reasons)


def _share_known(values: Float) -> float:
    """Return the share of values that are finite, rounded."""
    return round(float(np.isfinite(values).mean()), 4)
