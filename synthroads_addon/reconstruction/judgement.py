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
from .layout import Band, RoadLayout, axis_from_lines, axis_guides
from .lines import Line
from .profiles import STRETCH, Profiles
from .smoothing import difference_figures, robust_scale
from .views.fusion import APART
from .views.pavement import pavement_edges, remove_grade

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
_CORE = 1.5
"""Distance to either side of a carriageway's middle that is pavement if anything is, m. Chosen: a lane."""
_ON_AND_BESIDE = ((-0.05, 0.05), (-0.6, -0.3), (0.3, 0.6))
"""Distances from a line's middle, m: on it, to the right, to the left. Chosen: beyond the widest line, before the
next."""
_FEWEST_STEPS = 50
"""Steps between bins that a roughness is told from. Chosen: its deviation is then known to a tenth."""
_NEAR = 4
"""Stretches to either side of one whose evidence counts for it. Chosen: 20 m, as an axis changes little in them."""
_SHORTEST_TRUST = 5
"""Stretches between doubts that are trusted at least. Chosen: 25 m, less of a road is of no use."""
_SHORTEST = 3
"""Stretches of the shortest doubt. Chosen: a shorter one is a fault in the picture."""


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
        sections: the stretches where the pavement isn't as wide as the reconstructed cross-section, whatever the axis.
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
) -> Judgement:
    """Assess where an axis, offset 0 of its profiles, isn't to be trusted, and why.

    Args:
        layout: that profiles along the axis show.
        cores: offsets of the carriageways' middles, m, about which is pavement for sure.
        rivals: (K,) where views of the axis disagree; nowhere if not given.
        parted: (K,) m, the middle between both branches of the middle line, where that parts (`FoundRoad.parted_line`).
    """
    profiles, guides = layout.profiles, axis_guides(layout)
    lines = np.mean([guide.measured for guide in guides], axis=0) if parted is None else parted
    if parted is None and np.isfinite(lines).any():  # else nothing tells how far the others are from the axis
        lines = np.where(np.isfinite(lines), lines, _carried(layout))
    middles = np.mean(pavement_edges(profiles, cores, layout.kind == "dual"), axis=0)
    if profiles.paved is not None:  # where neither brightness nor height tells the edge the classes do
        middles = np.where(np.isfinite(middles), middles, _middles_by_class(layout))
    what, edges = "the pavement's middle", "the pavement's edges aren't seen on both sides"
    unseen = np.isnan(middles)
    if layout.kind == "dual":
        what, edges = "the median's middle", "neither the median's edges nor lines on both sides of it are seen"
        painted = np.all([_is_painted(band, guide) for band, guide in zip(layout.bands, guides, strict=True)], axis=0)
        unseen &= ~_is_seen_nearby(painted)
    reasons = {
        "neither lines nor edges are seen": ~_is_seen_nearby(np.isfinite(lines)),
        f"the lines lie more than {FARTHEST_LINES:g} m beside it": np.abs(lines) > FARTHEST_LINES,
        edges: unseen,
        f"{what} lies more than {FARTHEST_MIDDLE:g} m beside it": np.abs(middles) > FARTHEST_MIDDLE,
        "the ground on its lanes is too rough for a pavement": lane_roughness(profiles, cores) > ROUGHEST,
    }
    reasons["its lines stand above the ground, as rails do and no paint"] = raised_lines(layout) > RAISED
    if rivals is not None:
        reasons[f"views of it disagree by more than {APART:g} m"] = rivals
    masks = {reason: _without_short_runs(mask) for reason, mask in reasons.items()}
    doubtful = ndimage.binary_dilation(np.any(list(masks.values()), axis=0), iterations=_SHORTEST - 1)
    if doubtful.any():  # what lies between doubts, or beside one at an end, is trusted only if it is long enough
        doubtful = ~ndimage.binary_opening(~doubtful, np.ones(_SHORTEST_TRUST))
    doubts = list(_doubts(profiles, doubtful, masks))
    return Judgement(doubts, float(1.0 - doubtful.mean()), lines, middles)


def _middles_by_class(layout: RoadLayout) -> Float:
    """Return the middle (K,), m, of what the classes call the pavement, or of what lies between two; NaN if unseen."""
    (right, left) = (layout.bands[0], layout.bands[-1])
    if layout.kind == "dual":
        return 0.5 * (right.edges[1].measured + left.edges[0].measured)
    return 0.5 * (right.edges[0].measured + right.edges[1].measured)


def _carried(layout: RoadLayout) -> Float:
    """Return how far to the left of the axis (K,), m, all lines together say that it is; NaN where there are none."""
    return axis_from_lines(layout).raw if any(band.lines for band in layout.bands) else np.array(np.nan)


def _is_painted(band: Band, guide: Line) -> Bool:
    """Return in which stretches (K,) a carriageway's paint is seen: the line beside the median, or one parallel to it.

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
        known = rows[np.isfinite(rows)]
        if len(known) >= _FEWEST_STEPS:
            # A difference of two heights has sqrt(2) of their deviation.
            result[number] = robust_scale(known) / np.sqrt(2.0)
    return result


def raised_lines(layout: RoadLayout) -> Float:
    """Return how far (K,), m, the painted lines stand above the ground to both sides of them; NaN where not seen.

    The middle one of all lines counts: one may lie on a seam, or beside a gutter.
    """
    painted = [line for band in layout.bands for line in band.lines if line.width > 0.0]
    profiles, height = layout.profiles, remove_grade(layout.profiles.height)
    result = np.full((max(len(painted), 1), profiles.stretches), np.nan)
    for row, line in enumerate(painted):
        for number in np.flatnonzero(np.isfinite(line.measured)):
            rows = height[max(0, (number - _NEAR) * STRETCH) : (number + _NEAR + 1) * STRETCH]
            on, *beside = (
                _mean_height(profiles, rows, float(line.measured[number]), *reach) for reach in _ON_AND_BESIDE
            )
            result[row, number] = on - np.maximum(beside[0], beside[1])  # unseen where either side is
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # stretches without lines
        return np.asarray(np.nanmedian(result, axis=0))


def _mean_height(profiles: Profiles, rows: Float, offset: float, low: float, high: float) -> float:
    """Return the median height, m, of some rows' bins between two distances (m) from an offset; NaN without any."""
    # A median: a car beside the line doesn't raise the ground.
    bins = rows[:, profiles.column(offset + low) : profiles.column(offset + high) + 1]
    known = bins[np.isfinite(bins)]
    return float(np.median(known)) if len(known) else np.nan


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
