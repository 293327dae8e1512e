"""A middle line that parts into two, around a turn lane or a traffic island: where its other branch runs.

A branch begins or ends at the line and is painted on the way, unlike the lines that run beside it. It is followed
through the paint, row by row, as the path of most paint (Viterbi 1967).
"""

import numpy as np
from scipy import ndimage

from ..base.arrays import Float, Int
from .lines import Line
from .profiles import ACROSS, STRETCH, Profiles

_FARTHEST = 4.2
"""Distance from one branch to the other at most, m. Chosen: a turn lane with its lines."""
_FIRST = 4
"""Bins from the line to where a branch begins. Chosen: the line's own width and blur."""
_APART = 0.8
"""Distance from the line from which on paint speaks for a branch, m. Chosen: what is nearer may be the line itself."""
_NEAR = -0.1
"""Gain of a row nearer than that, in a row's paint. Chosen: a branch that stays there costs a little."""
_MEAN = (3, 3)
"""Rows and bins whose mean is a place's paint. Chosen: bins between points are empty."""
_SIDE = 0.4
"""Distance beside a line that isn't painted, m. Chosen: beyond the widest line's half."""
_KNOWN = 0.25
"""Share of these bins that must hold points. Chosen: of fewer the mean is chance."""
_PAINTED = 0.3
"""Share of the line's own paint from which on it speaks for a branch. Chosen: below any dashes, above wheel tracks."""
_STEPS = 2
"""Bins across from one row to the next at most. Chosen: 1 in 5, steeper than any taper."""
_TURNING = 0.15
"""Rows' paint that a branch must bring more for each bin across. Chosen: keeps it from zigzagging through noise."""
_ENTRY = 6.0
"""Rows' paint that a branch must bring in all. Chosen: a stop line or an arrow brings less."""
_GAPS = 1.6, 2.5
"""Rows' paint that may be wanting on the way, where branches are less than a lane apart, and beyond. Chosen: near the
line a turn lane has no dashes yet; beyond it has gaps of some metres."""
_LANE = 2.3
"""Least width of a lane, m. Chosen: as in `layout`."""
_OPEN, _LONG = 1.0, 20
"""Distance that branches come apart at least, m, and rows that they do. Chosen: an island for a sign; what is shorter
is no branch."""
_BACK = 8
"""Stretches in which a road that was wider becomes as wide as usual. Chosen: a taper of 40 m."""


def find_branch(profiles: Profiles, line: Line) -> Float:
    """Return the distance (K,), m, from a line to its other branch by stretch, positive to the left; 0 without one.

    NaN where a branch ended beside the line, so that no paint shows how both come together.
    """
    line_offset = np.interp(profiles.stations, line.stations, line.offsets)
    line_rows = (profiles.stations >= line.start) & (profiles.stations <= line.end) & np.isfinite(line_offset)
    branch_offset = np.zeros(len(line_offset))
    if line_rows.sum() >= _LONG:
        branches = [_branch_beside(_gains(profiles, line_offset, sign)[line_rows]) for sign in (-1, 1)]
        branch_offset[line_rows] = np.where(branches[0] > branches[1], -branches[0], branches[1])
    full_rows = np.zeros(profiles.stretches * STRETCH)
    full_rows[: len(branch_offset)] = branch_offset
    return _with_ends(np.median(full_rows.reshape(-1, STRETCH), axis=1))


def _branch_beside(gain: Float) -> Float:
    """Return the distance (R,), m, of the branch that leaves or joins a line, by row; of two the farther one counts.

    Args:
        gain: (R, B) paint by row and bin, see `_gains`. Backwards, a branch that joins is one that leaves.
    """
    return ACROSS * np.maximum(_follow(gain), _follow(gain[::-1])[::-1])


def _with_ends(branch_offset: Float) -> Float:
    """Return a branch's offsets (K,), m, with the stretches behind ends away from the line set to NaN, or held.

    They are held constant if at most `_BACK` stretches remain to the road's end.
    """
    result, last_stretch = branch_offset.copy(), len(branch_offset) - 1
    for (run,) in ndimage.find_objects(ndimage.label(branch_offset)[0]):
        for end, sign in ((run.start, -1), (run.stop - 1, 1)):
            if abs(branch_offset[end]) > _OPEN:
                end_stretches = np.clip(end + sign * np.arange(1, _BACK + 1), 0, last_stretch)
                reaches_road_end = end_stretches[-1] in (0, last_stretch)
                result[end_stretches] = np.where(
                    branch_offset[end_stretches] == 0.0,
                    branch_offset[end] if reaches_road_end else np.nan,
                    branch_offset[end_stretches],
                )
    return result


def _gains(profiles: Profiles, line_offset: Float, sign: int) -> Float:
    """Return the gain (S, B) of a branch that runs through each bin beside a line, in units of the line's own paint.

    It is the bin's paint over that of the line, less the share `_PAINTED` below which paint speaks against a branch.

    Args:
        profiles: S rows.
        line_offset: (S,) of the line, m.
        sign: 1 for bins to its left, -1 to its right.
    """
    reach, side = round(_FARTHEST / ACROSS), round(_SIDE / ACROSS)
    begin = np.rint((np.nan_to_num(line_offset) - profiles.offsets[0]) / ACROSS).astype(np.int64)
    columns = begin[:, None] + sign * np.arange(reach + 1 + side)
    in_grid = (columns >= 0) & (columns < len(profiles.offsets))
    paint = np.take_along_axis(profiles.paint, np.clip(columns, 0, len(profiles.offsets) - 1), axis=1)
    has_paint = in_grid & np.isfinite(paint)
    # Mean of the known bins: the mean of all, unknown ones being 0, over the share of known ones.
    share = ndimage.uniform_filter(has_paint.astype(np.float64), _MEAN)
    total = ndimage.uniform_filter(np.where(has_paint, np.clip(paint, 0.0, 1.0), 0.0).astype(np.float64), _MEAN)
    mean = np.where(share > _KNOWN, total / np.maximum(share, 1e-9), np.nan)
    excess = mean[:, :-side] - mean[:, side:]  # an island may be as bright as its line, a lane isn't
    contrast = excess[np.isfinite(excess[:, 0]), 0]
    # A line may be dashed.
    painted_contrast = contrast[contrast > 0.5 * np.percentile(contrast, 80)] if len(contrast) else contrast
    line_paint = float(np.median(painted_contrast)) if len(painted_contrast) else 0.0
    if line_paint <= 0.0:
        return np.full(excess.shape, -1.0)
    gain = np.where(np.isfinite(excess), np.clip(excess / line_paint, 0.0, 1.0), 0.0) - _PAINTED
    too_close = np.arange(gain.shape[1]) * ACROSS < _APART
    return np.where(too_close, _NEAR, gain)


def _follow(gain: Float) -> Float:
    """Return by row the distance (R,), bins, of the best branch that left the line in an earlier row; 0 without one.

    Dynamic programming over the rows (Viterbi 1967): the path of most gain, with a price per bin moved across.

    Args:
        gain: (R, B) by row and bin beside the line, see `_gains`.
    """
    rows, bins = gain.shape
    score = np.full(bins, -np.inf)
    score[0] = 0.0  # on the line
    peak = score.copy()
    previous_bin = np.zeros((rows, bins), dtype=np.int64)  # each place's bin in the row before
    steps = np.arange(-_STEPS, _STEPS + 1)
    gaps = np.where(np.arange(bins) * ACROSS < _LANE, *_GAPS)
    for row in range(rows):
        # Go on from a bin nearby, whichever is best ...
        reachable_scores = np.pad(np.where(np.arange(bins) < _FIRST, -np.inf, score), _STEPS, constant_values=-np.inf)
        step_scores = np.lib.stride_tricks.sliding_window_view(reachable_scores, len(steps)) - _TURNING * np.abs(steps)
        step = step_scores.argmax(axis=1)
        previous_bin[row] = np.clip(np.arange(bins) + steps[step], 0, bins - 1)
        next_score, next_peak = step_scores[np.arange(bins), step], peak[previous_bin[row]]
        # ... or leave the line here, which must pay off ...
        enters = np.zeros(bins, dtype=bool)
        enters[_FIRST : _FIRST + _STEPS] = next_score[_FIRST : _FIRST + _STEPS] < score[0] - _ENTRY
        previous_bin[row, enters] = 0
        next_score = np.where(enters, score[0] - _ENTRY, next_score) + gain[row]
        next_peak = np.maximum(np.where(enters, score[0] - _ENTRY, next_peak), next_score)
        # ... or be on the line, to which a branch may return or beside which it may end anywhere.
        previous_bin[row, 0] = int(score.argmax())
        next_score[0], next_peak[0] = score.max(), score.max()
        next_score[1:_FIRST] = -np.inf
        survives = next_score >= next_peak - gaps  # too little paint for too long
        score, peak = np.where(survives, next_score, -np.inf), np.where(survives, next_peak, -np.inf)
    return _traced(previous_bin, int(score.argmax()))


def _traced(previous_bin: Int, end_bin: int) -> Float:
    """Return the bins (R,) of the path that ends in ``end_bin``, 0 where its branch is too near the line or too short.

    Args:
        previous_bin: (R, B) bin in the row before from which each place is reached.
        end_bin: bin of the last row at which the path ends.
    """
    bins = np.zeros(len(previous_bin))
    for row in range(len(previous_bin) - 1, -1, -1):
        bins[row] = end_bin
        end_bin = int(previous_bin[row, end_bin])
    runs, _ = ndimage.label(bins > 0)
    for number, (run,) in enumerate(ndimage.find_objects(runs), start=1):
        if ACROSS * bins[run].max() < _OPEN or run.stop - run.start < _LONG:
            bins[runs == number] = 0
    return bins
