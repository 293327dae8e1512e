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
    """Return how far beside a line (K,), m, positive to the left, another branch of it runs; 0 where there is none.

    NaN where a branch has ended beside the line and its paint says no more how both come together.
    """
    place = np.interp(profiles.stations, line.stations, line.offsets)
    shown = (profiles.stations >= line.start) & (profiles.stations <= line.end) & np.isfinite(place)
    beside = np.zeros(len(place))
    if shown.sum() >= _LONG:
        branches = [_branch_beside(_gains(profiles, place, sign)[shown]) for sign in (-1, 1)]
        beside[shown] = np.where(branches[0] > branches[1], -branches[0], branches[1])
    padded = np.zeros(profiles.stretches * STRETCH)
    padded[: len(beside)] = beside
    return _with_ends(np.median(padded.reshape(-1, STRETCH), axis=1))


def _branch_beside(gain: Float) -> Float:
    """Return the distance (R,), m, of the branch that leaves a line or comes to it, the farther one of two."""
    return ACROSS * np.maximum(_follow(gain), _follow(gain[::-1])[::-1])


def _with_ends(beside: Float) -> Float:
    """Return a branch (K,), m, with NaN behind its ends beside the line, or held to the road's end if that is near."""
    result, last = beside.copy(), len(beside) - 1
    for (run,) in ndimage.find_objects(ndimage.label(beside)[0]):
        for end, sign in ((run.start, -1), (run.stop - 1, 1)):
            if abs(beside[end]) > _OPEN:
                beyond = np.clip(end + sign * np.arange(1, _BACK + 1), 0, last)
                near = beyond[-1] in (0, last)
                result[beyond] = np.where(beside[beyond] == 0.0, beside[end] if near else np.nan, beside[beyond])
    return result


def _gains(profiles: Profiles, place: Float, sign: int) -> Float:
    """Return how much more paint than must be is at bins to one side of a line (S, B), in the line's own paint.

    Args:
        profiles: S rows.
        place: (S,) of the line, m.
        sign: 1 for bins to its left, -1 to its right.
    """
    reach, side = round(_FARTHEST / ACROSS), round(_SIDE / ACROSS)
    begin = np.rint((np.nan_to_num(place) - profiles.offsets[0]) / ACROSS).astype(np.int64)
    columns = begin[:, None] + sign * np.arange(reach + 1 + side)
    inside = (columns >= 0) & (columns < len(profiles.offsets))
    paint = np.take_along_axis(profiles.paint, np.clip(columns, 0, len(profiles.offsets) - 1), axis=1)
    known = inside & np.isfinite(paint)
    # Mean of the known bins: the mean of all, unknown ones being 0, over the share of known ones.
    share = ndimage.uniform_filter(known.astype(np.float64), _MEAN)
    total = ndimage.uniform_filter(np.where(known, np.clip(paint, 0.0, 1.0), 0.0).astype(np.float64), _MEAN)
    mean = np.where(share > _KNOWN, total / np.maximum(share, 1e-9), np.nan)
    above = mean[:, :-side] - mean[:, side:]  # an island may be as bright as its line, a lane isn't
    contrast = above[np.isfinite(above[:, 0]), 0]
    painted = (
        contrast[contrast > 0.5 * np.percentile(contrast, 80)] if len(contrast) else contrast
    )  # a line may be dashed
    level = float(np.median(painted)) if len(painted) else 0.0
    if level <= 0.0:
        return np.full(above.shape, -1.0)
    gain = np.where(np.isfinite(above), np.clip(above / level, 0.0, 1.0), 0.0) - _PAINTED
    near = np.arange(gain.shape[1]) * ACROSS < _APART
    return np.where(near, _NEAR, gain)


def _follow(gain: Float) -> Float:
    """Return by row how many bins (R,) off the line a branch is that leaves it in an earlier row; 0 without one.

    Args:
        gain: (R, B) by row and bin.
    """
    rows, bins = gain.shape
    score = np.full(bins, -np.inf)
    score[0] = 0.0  # on the line
    peak = score.copy()
    before = np.zeros((rows, bins), dtype=np.int64)  # each place's bin in the row before
    steps = np.arange(-_STEPS, _STEPS + 1)
    gaps = np.where(np.arange(bins) * ACROSS < _LANE, *_GAPS)
    for row in range(rows):
        # Go on from a bin nearby, whichever is best ...
        beside = np.pad(np.where(np.arange(bins) < _FIRST, -np.inf, score), _STEPS, constant_values=-np.inf)
        reached = np.lib.stride_tricks.sliding_window_view(beside, len(steps)) - _TURNING * np.abs(steps)
        step = reached.argmax(axis=1)
        before[row] = np.clip(np.arange(bins) + steps[step], 0, bins - 1)
        ahead, top = reached[np.arange(bins), step], peak[before[row]]
        # ... or leave the line here, which must pay off ...
        enters = np.zeros(bins, dtype=bool)
        enters[_FIRST : _FIRST + _STEPS] = ahead[_FIRST : _FIRST + _STEPS] < score[0] - _ENTRY
        before[row, enters] = 0
        ahead = np.where(enters, score[0] - _ENTRY, ahead) + gain[row]
        top = np.maximum(np.where(enters, score[0] - _ENTRY, top), ahead)
        # ... or be on the line, to which a branch may return or beside which it may end anywhere.
        before[row, 0] = int(score.argmax())
        ahead[0], top[0] = score.max(), score.max()
        ahead[1:_FIRST] = -np.inf
        kept = ahead >= top - gaps  # too little paint for too long
        score, peak = np.where(kept, ahead, -np.inf), np.where(kept, top, -np.inf)
    return _traced(before, int(score.argmax()))


def _traced(before: Int, last: int) -> Float:
    """Return the bins (R,) of the path that ends in a bin, less what isn't open or long enough for a branch."""
    bins = np.zeros(len(before))
    for row in range(len(before) - 1, -1, -1):
        bins[row] = last
        last = int(before[row, last])
    runs, _ = ndimage.label(bins > 0)
    for number, (run,) in enumerate(ndimage.find_objects(runs), start=1):
        if ACROSS * bins[run].max() < _OPEN or run.stop - run.start < _LONG:
            bins[runs == number] = 0
    return bins
