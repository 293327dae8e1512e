"""Judgement of a reconstruction: where its axis is not to be trusted, and why.

The axis comes from lines, or from edges found beside them. Here the pavement is looked for once more, without lines and
without classes: as what is about as bright as the ground on the supposed lanes, and ends where the brightness changes
or the ground steps up or down. A single carriageway's axis must lie in the middle of it, a dual one's in the middle of
what lies between two such pavements.
"""

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import ndimage

from ..base.arrays import Bool, Float, otsu_threshold
from .layout import RoadLayout, axis_guides
from .profiles import ACROSS, STRETCH, Grid, Profiles
from .section import MeasuredSection
from .smoothing import difference_figures, fill_gaps, robust_scale

FARTHEST_MIDDLE = 0.75
"""The middle between the pavement's edges may lie so far beside the axis, m."""
FARTHEST_LINES = 0.5
"""The lines that make the axis may lie so far beside it, m."""
_NEAR = 4  # stretches to either side of one whose evidence counts for it
_ROWS = 10  # m along the road to either side of a stretch's middle that its median profile is taken from
_CORE = 1.5  # m to either side of a carriageway's middle that is pavement if anything is
_PAINT = 11  # bins: brighter strips of up to this width are paint
_KERB, _KERB_REACH = 0.05, 3  # m that a kerb rises, and bins to either side of it
_CRACK = 9  # bins: narrower gaps in the pavement, or in the median, are cracks and seams
_FEWEST_ROWS = 3
_BEYOND = 6  # bins beyond an edge, half of which must be known: else the cloud ends there, not the pavement
_LIKE = 4.0  # times the pavement's own spread of brightness, at least, that other ground is off
_SHORTEST = 3  # stretches: a shorter doubt is a fault in the picture


@dataclass(frozen=True)
class Doubt:
    """A stretch of the road where the reconstructed axis isn't to be trusted: stations, m, and reasons."""

    start: float
    end: float
    reasons: tuple[str, ...]


@dataclass(frozen=True)
class Judgement:
    """Assessment of how far a reconstruction's axis is to be trusted, and where it isn't.

    Attributes:
        doubts: the stretches where it isn't, in order.
        trusted: share of the length outside of them.
        lines: (K,) how far to the left of the axis the lines or edges that make it lie, m; NaN where they aren't seen.
        middles: (K,) how far to the left of the axis the middle of the pavement, or of what lies between both, is, m;
            NaN where not both of its edges are seen.
    """

    doubts: list[Doubt]
    trusted: float
    lines: Float
    middles: Float

    def to_dict(self) -> dict[str, Any]:
        """Return the assessment as JSON data; lengths and stations in m."""
        stretches = [{"start": doubt.start, "end": doubt.end, "why": list(doubt.reasons)} for doubt in self.doubts]
        names = ("mean", "rms", "largest")
        return {
            "trusted": round(self.trusted, 4),
            "lines": {"seen": _share_known(self.lines), **difference_figures(self.lines, *names)},
            "middle": {"seen": _share_known(self.middles), **difference_figures(self.middles, *names)},
            "doubtful": stretches,
        }


def judge(profiles: Profiles, layout: RoadLayout, section: MeasuredSection) -> Judgement:
    """Assess where the axis of a reconstruction, offset 0 of its profiles, isn't to be trusted, and why."""
    guides = axis_guides(layout)
    lines = np.mean([guide.measured for guide in guides], axis=0)
    middles = np.mean(pavement_edges(profiles, section), axis=0)
    what, edges = "the pavement's middle", "the pavement's edges aren't seen on both sides"
    unseen = np.isnan(middles)
    if section.kind == "dual":
        what, edges = "the median's middle", "neither the median's edges nor lines on both sides of it are seen"
        painted = np.all([np.isfinite(guide.measured) & (guide.width > 0.0) for guide in guides], axis=0)
        unseen &= ~_is_seen_nearby(painted)
    reasons = {
        "neither lines nor edges are seen": ~_is_seen_nearby(np.isfinite(lines)),
        f"the lines lie more than {FARTHEST_LINES:g} m beside it": np.abs(lines) > FARTHEST_LINES,
        edges: unseen,
        f"{what} lies more than {FARTHEST_MIDDLE:g} m beside it": np.abs(middles) > FARTHEST_MIDDLE,
    }
    masks = {reason: _without_short_runs(mask) for reason, mask in reasons.items()}
    doubtful = ndimage.binary_dilation(np.any(list(masks.values()), axis=0), iterations=_SHORTEST - 1)
    doubts = list(_doubts(profiles, doubtful, masks))
    return Judgement(doubts, float(1.0 - doubtful.mean()), lines, middles)


def pavement_edges(profiles: Profiles, section: MeasuredSection) -> Float:
    """Return the right and left edge (2, K), m, of the pavement or median at the axis, found without lines or classes.

    They are found by brightness and height alone; NaN where an edge isn't seen.
    """
    stretches, height = range(profiles.stretches), _remove_grade(profiles.height)
    brightness = np.array([_median_profile(profiles.brightness, number) for number in stretches])
    steps = np.array([_is_kerb(_median_profile(height, number)) for number in stretches])
    known, core = np.isfinite(brightness), _core_bins(profiles, section)
    filled = np.array([fill_gaps(row) if np.isfinite(row).any() else row for row in brightness])
    smooth = ndimage.median_filter(filled, (1, _PAINT))
    levels = np.array([np.percentile(row[core], 30) if np.isfinite(row).all() else np.nan for row in smooth])
    apart = np.abs(smooth - levels[:, None])
    alike = known & ~(apart > _brightness_threshold(apart[known], apart[:, core]))
    inside = _close_cracks(alike) & ~steps
    if section.kind == "dual":
        inside = _close_cracks(known & ~inside)
    return np.array([_run_at_axis(profiles, row, seen) for row, seen in zip(inside, known, strict=True)]).T


def _median_profile(values: Grid | Float, stretch: int) -> Float:
    """Return the median profile (U,) of the rows about a stretch's middle; NaN where too few have points."""
    middle = stretch * STRETCH + STRETCH // 2
    rows = values[max(0, middle - _ROWS) : middle + _ROWS + 1].astype(np.float64)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # bins without points
        median = np.nanmedian(rows, axis=0)
    return np.where(np.isfinite(rows).sum(axis=0) >= _FEWEST_ROWS, median, np.nan)


def _remove_grade(height: Grid) -> Float:
    """Return heights (S, U) less their row's median, which removes the road's grade."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # rows without points
        return np.asarray(height - np.nanmedian(height, axis=1)[:, None], dtype=np.float64)


def _is_kerb(height: Float) -> Bool:
    """Return a mask (U,) of a profile's bins at which the ground steps up or down by more than a crossfall would."""
    if not np.isfinite(height).any():
        return np.zeros(len(height), dtype=bool)
    filled = ndimage.median_filter(fill_gaps(height), 3)
    rise = np.roll(filled, -_KERB_REACH) - np.roll(filled, _KERB_REACH)
    rise[:_KERB_REACH], rise[-_KERB_REACH:] = 0.0, 0.0
    return np.asarray(np.abs(rise) > _KERB)


def _core_bins(profiles: Profiles, section: MeasuredSection) -> Bool:
    """Return a mask (U,) of the bins about the carriageways' middles, which are paved for sure."""
    middles = [0.0]
    if section.kind == "dual":
        sides = section.sides.values()
        middles = [side.sign * (side.inner_offset.value + 0.5 * side.paved_width.value) for side in sides]
    return np.any([np.abs(profiles.offsets - middle) < _CORE for middle in middles], axis=0)


def _brightness_threshold(apart: Float, core: Float) -> float:
    """Return the threshold of brightness differences beyond which ground is unpaved; inf if brightness can't tell."""
    apart, core = apart[np.isfinite(apart)], core[np.isfinite(core)]
    if not len(apart) or not len(core):
        return np.inf
    reach = otsu_threshold(apart)
    other = apart[apart > reach]
    clear = len(other) > 0 and float(np.median(other)) > _LIKE * robust_scale(core)
    return reach if clear else np.inf


def _close_cracks(inside: Bool) -> Bool:
    """Return a mask (K, U) with gaps that are narrow across the road closed."""
    across = np.ones((1, _CRACK))
    return ndimage.binary_erosion(ndimage.binary_dilation(inside, across), across, border_value=1)


def _run_at_axis(profiles: Profiles, inside: Bool, known: Bool) -> tuple[float, float]:
    """Return right and left end, m, of the run of bins (U,) nearest to the axis; NaN where the cloud ends it."""
    label, _ = ndimage.label(inside)
    near = label[(np.abs(profiles.offsets) < _CORE) & inside]
    if not len(near):
        return np.nan, np.nan
    run = np.flatnonzero(label == np.bincount(near).argmax())
    first, last = int(run[0]), int(run[-1])
    right, left = profiles.offsets[first] - 0.5 * ACROSS, profiles.offsets[last] + 0.5 * ACROSS
    right_seen = 2 * known[max(0, first - _BEYOND) : first].sum() >= _BEYOND
    left_seen = 2 * known[last + 1 : last + 1 + _BEYOND].sum() >= _BEYOND
    return float(right) if right_seen else np.nan, float(left) if left_seen else np.nan


def _is_seen_nearby(seen: Bool) -> Bool:
    """Return a mask (K,) of the stretches that have something seen within `_NEAR` stretches."""
    return ndimage.binary_dilation(seen, iterations=_NEAR)


def _without_short_runs(mask: Bool) -> Bool:
    """Return a mask (K,) without runs shorter than `_SHORTEST` stretches."""
    return ndimage.binary_opening(mask, np.ones(_SHORTEST))


def _doubts(profiles: Profiles, doubtful: Bool, masks: dict[str, Bool]) -> Iterator[Doubt]:
    """Yield each run of a mask (K,) as a doubt with the reasons whose masks hold anywhere in it."""
    label, _ = ndimage.label(doubtful)
    half, length = 0.5 * STRETCH, float(profiles.stations[-1])
    for (run,) in ndimage.find_objects(label):
        start, end = profiles.middles[run.start] - half, min(profiles.middles[run.stop - 1] + half, length)
        reasons = tuple(reason for reason, mask in masks.items() if mask[run].any())
        yield Doubt(round(float(start), 1), round(float(end), 1), reasons)


def _share_known(values: Float) -> float:
    return round(float(np.isfinite(values).mean()), 4)
