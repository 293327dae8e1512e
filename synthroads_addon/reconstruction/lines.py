"""Line markings: found in cross profiles, followed along the path, and described: offset, width, dashes."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import ndimage
from scipy.signal import find_peaks

from ..base.arrays import Bool, Float
from .path import SPACING
from .profiles import ACROSS, STRETCH, Grid, Profiles, SurfacePoints
from .smoothing import hidden_std, mean_with_std, smooth

WAVELENGTH = 40.0
"""Shorter swings of a line's offset, m, are noise. Chosen: less than a lane change's length, more than a painting
machine's sway."""
USUAL = 0.03
"""Standard deviation of a line's offset in one stretch that is no fault, m. Chosen: a third of a line's width."""
_WINDOW, _STEP = 40, 10
"""Length of the mean profiles in which lines are looked for, and distance from one to the next, m. Chosen: some dashes
in each, and four over each place."""
_HEIGHT, _PROMINENCE = 0.10, 0.07
"""Height and prominence of a line's peak in a mean profile, in a solid line's paint. Chosen: dashes cover a third of a
window or more, worn and blurred ones a tenth."""
_WIDEST = 1.2
"""Width of the broadest peak that is a line, m. Chosen: double lines are narrower."""
_LINK = 0.35
"""Distance that a line may move from one window to the next, m. Chosen: 3.5 % of the way, as in a taper."""
_LOST = 60.0
"""Length that a line may not be seen, m. Chosen: a bridge or a lorry in between."""
_SAME = 0.2
"""Distance beside the last piece's end at which a line that lay hidden goes on, m. Chosen: the distance of two rows of
points."""
_NEAR = 0.35
"""Distance to either side of a line that its paint lies within, m. Chosen: an edge line's width, and what the track is
off."""
_FEWEST = 0.3
"""Share of a row that must be painted to count. Chosen: below it the row is an end of a dash or a fault."""
_AROUND = 41
"""Rows around one, in which there is a dash. Chosen: two periods of the longest pattern."""
_FULL = 0.3
"""Share of a line's usual width that is full paint at least. Chosen: less is no paint."""
_ROW = 0.04
"""Distance across that points of one row wobble over, m. Chosen: a scanner's range noise and sway within a stretch."""
_FEWEST_POINTS = 4
"""Points on a line in a stretch that tell where its edges are. Chosen: fewer may be stray ones."""
_SOLID = 0.65
"""Share of its length on which a solid line is painted. Chosen: dashes cover half at most."""
_Track = list[tuple[float, float]]
STANDARD_DASHES = ((6.0, 12.0), (4.0, 8.0), (3.0, 6.0), (6.0, 6.0), (3.0, 3.0))
"""Usual lengths of dash and gap, m (RMS). The order is by how common they are."""
_DASH_TOLERANCE = 0.6
"""Distance from a usual pattern that passes for it, m. Chosen: a bin at each end of dash and gap."""
_LONGEST_GAP = 16
"""Rows without paint that are no gap between dashes. Chosen: more than the 12 m of the longest pattern; the line isn't
seen there, or isn't there."""


@dataclass(frozen=True, eq=False)
class Line:
    """One line marking (or edge in its place) along the path: offsets by stretch, width, dashes.

    Attributes:
        stations: (K,) middles of the stretches, m; the same for every line.
        measured: (K,) offset of its middle in each stretch, m; NaN where no paint was seen.
        offsets: (K,) the same, smoothed, m; NaN before its begin and behind its end.
        std: (K,) standard deviation of the offsets, m.
        spacing: (K,) distance of the points that each measured offset lies midway between, m; 0 where it is a mean.
        cover: (K,) share of each stretch that is painted; NaN without points.
        start, end: stations between which it was seen, m.
        width: mean width of its paint, m.
        width_std: standard deviation of the width, m.
        painted: share of its length that is painted.
        dash, gap: m; 0 for a solid line.
        first_dash: station at which a dash begins, m.
        hidden: length between its pieces in which it wasn't seen, m.
    """

    stations: Float
    measured: Float
    offsets: Float
    std: Float
    spacing: Float
    cover: Float
    start: float
    end: float
    width: float = 0.0
    width_std: float = 0.0
    painted: float = 0.0
    dash: float = 0.0
    gap: float = 0.0
    first_dash: float = 0.0
    hidden: float = 0.0

    @property
    def solid(self) -> bool:
        """Return whether the line has no dashes."""
        return self.dash == 0.0

    @property
    def offset(self) -> float:
        """Return the line's median offset, m."""
        return float(np.nanmedian(self.offsets))

    @property
    def length(self) -> float:
        """Return the length along which the line was seen, m."""
        return self.end - self.start - self.hidden


def find_lines(profiles: Profiles) -> list[Line]:
    """Return the line markings in profiles, from right to left."""
    lines = [_measure_line(profiles, *track) for track in _tracks(profiles)]
    return sorted((line for line in lines if line is not None), key=lambda line: line.offset)


def _tracks(profiles: Profiles) -> list[tuple[Float, Float]]:
    """Return rough (stations, offsets) of each line, m: peaks of mean profiles, linked from window to window."""
    rows = len(profiles.stations)
    closed: list[_Track] = []
    running: list[_Track] = []
    for row in range(0, max(1, rows - _WINDOW // 2), _STEP):
        station = float(profiles.stations[row : row + _WINDOW].mean())
        peaks = _peaks(profiles, profiles.paint[row : row + _WINDOW])
        running, ended = _link_peaks(running, peaks, station)
        closed += ended
    long = [track for track in closed + running if len(track) >= 2]
    tracks = [np.array(track) for track in _joined(profiles, long)]
    return [(track[:, 0], track[:, 1]) for track in tracks]


def _joined(profiles: Profiles, tracks: list[_Track]) -> list[_Track]:
    """Return the tracks with those made one that go on where another ended, if the line may lie hidden in between.

    A line that is narrower than the distance of two rows of points may lie between them for long. A piece goes on with
    the one that ended nearest beside it. Where points lie anywhere a line that isn't seen isn't there.
    """
    result: list[_Track] = []
    for track in sorted(tracks, key=lambda item: item[0][0]):
        station, place = track[0]
        before = [other for other in result if other[-1][0] < station and abs(other[-1][1] - place) <= _SAME]
        nearest = min(before, key=lambda other: abs(other[-1][1] - place), default=None)
        if nearest is not None and _in_rows(profiles, nearest[-1][0], station, place):
            nearest.extend(track)
        else:
            result.append(list(track))
    return result


def _in_rows(profiles: Profiles, first: float, last: float, offset: float) -> bool:
    """Return whether points lie in rows about an offset along most of the way between two stations, m."""
    between = (profiles.middles >= first) & (profiles.middles <= last)
    gaps = profiles.row_gaps(np.where(between, offset, np.nan))
    return 2 * int((gaps > 0.0).sum()) > int(between.sum())


def _peaks(profiles: Profiles, paint: Grid) -> list[float]:
    """Return the offsets, m, of the narrow peaks in the mean of some rows of paint."""
    known = np.isfinite(paint)
    # Points may lie in rows along the road with empty bins between them: these must not thin out a line's peak.
    count = ndimage.gaussian_filter1d(known.sum(axis=0).astype(np.float64), 1.0)
    total = ndimage.gaussian_filter1d(np.where(known, paint, 0.0).sum(axis=0).astype(np.float64), 1.0)
    mean = np.where(count > 0.05 * len(paint), total / np.maximum(count, 1e-9), 0.0)
    peaks = find_peaks(mean, height=_HEIGHT, prominence=_PROMINENCE, width=(None, _WIDEST / ACROSS))[0]
    return [_vertex(mean, at, profiles.offsets) for at in peaks]


def _vertex(values: Float, at: int, places: Float) -> float:
    """Return the offset, m, of the vertex of the parabola through a peak and its two neighbours."""
    before, here, after = values[at - 1 : at + 2]
    bend = before - 2.0 * here + after
    return float(places[at] + (0.5 * ACROSS * (before - after) / bend if bend < 0.0 else 0.0))


def _link_peaks(running: list[_Track], peaks: list[float], station: float) -> tuple[list[_Track], list[_Track]]:
    """Extend the tracks, in place, by peaks near to where they lead; return those that go on, and those that ended."""
    pairs = sorted(
        (abs(peak - _expected_place(track, station)), i, j)
        for i, track in enumerate(running)
        for j, peak in enumerate(peaks)
    )
    taken: set[int] = set()
    continued: set[int] = set()
    for distance, i, j in pairs:
        if distance <= _LINK and i not in continued and j not in taken:
            running[i].append((station, peaks[j]))
            continued.add(i)
            taken.add(j)
    ended = [track for track in running if station - track[-1][0] > _LOST]
    going = [track for track in running if station - track[-1][0] <= _LOST]
    going += [[(station, peak)] for j, peak in enumerate(peaks) if j not in taken]
    return going, ended


def _expected_place(track: _Track, station: float) -> float:
    """Return the offset, m, at which a track is expected at a station: straight on from its last 40 m."""
    if len(track) < 3:
        return track[-1][1]
    (s0, u0), (s1, u1) = track[max(-5, -len(track))], track[-1]
    # A track goes on straight for 20 m at most: beyond that a bend is as likely.
    slope = float(np.clip((u1 - u0) / (s1 - s0), -0.06, 0.06))
    return u1 + slope * min(station - s1, 20.0)


def _measure_line(profiles: Profiles, stations: Float, offsets: Float) -> Line | None:
    """Return the measured line along a rough track; None where too little paint lies there."""
    half = _WINDOW / 2.0
    start = max(profiles.stations[0], stations[0] - half)
    end = min(profiles.stations[-1], stations[-1] + half)
    middle, cover = _paint_by_row(profiles, stations, offsets)
    inside = _shown(profiles.stations, stations, half)
    # The width where it is painted: a high percentile, as dashes leave most rows bare.
    usual = float(np.nanpercentile(cover[inside], 90)) if np.isfinite(cover[inside]).any() else 0.0
    if usual < 0.03:
        return None
    share = _painted_share(cover, usual)
    grid = profiles.middles
    measured, weights = _offsets_by_stretch(profiles, middle, np.where(inside, share, 0.0))
    if (weights > 0.0).sum() < 4:
        return None
    width, width_std = mean_with_std(cover[inside][np.nan_to_num(share[inside]) > 0.5])
    spacing = profiles.row_gaps(measured)
    if profiles.points is not None:
        on = np.where(inside & np.isfinite(share), share, 0.0) > 0.5
        measured, widths, spacing = _between_points(profiles, profiles.points, measured, on)
        weights = np.where(np.isfinite(measured), weights, 0.0)
        width, width_std = mean_with_std(widths)
        width_std = float(np.hypot(width_std, hidden_std(2.0 * spacing, width_std)))  # both edges lie between rows
    if (weights > 0.0).sum() < 4:
        return None
    smoothed = smooth(measured, weights, STRETCH * SPACING, WAVELENGTH, usual=USUAL)
    seen = grid[weights > 0.0]
    start, end = float(seen[0] - STRETCH / 2.0), float(seen[-1] + STRETCH / 2.0)
    within = (grid >= start) & (grid <= end)
    painted, dash, gap, first = _dashes(profiles.stations[inside], share[inside])
    return Line(
        stations=grid,
        measured=measured,
        offsets=np.where(within, smoothed.values, np.nan),
        std=np.where(within, np.hypot(smoothed.std, hidden_std(spacing, smoothed.scatter)), np.nan),
        spacing=spacing,
        cover=_cover_by_stretch(share),
        start=start,
        end=end,
        width=width,
        width_std=width_std,
        painted=painted,
        dash=dash,
        gap=gap,
        first_dash=first,
        hidden=SPACING * float((~inside & (profiles.stations >= start) & (profiles.stations <= end)).sum()),
    )


def _shown(rows: Float, stations: Float, half: float) -> Bool:
    """Return a mask of the rows (S,), m, along a track's stations (m), less where it was lost for longer than usual."""
    inside = (rows >= stations[0] - half) & (rows <= stations[-1] + half)
    for before, behind in pairwise(stations):
        if behind - before > _LOST:
            inside &= (rows <= before + half) | (rows >= behind - half)
    return np.asarray(inside)


def _paint_by_row(profiles: Profiles, stations: Float, offsets: Float) -> tuple[Float, Float]:
    """Return, per row of the profiles (S,), the paint's mean offset near a track and its width (m); NaN without points.

    The mean is found twice, the second time around the smoothed first one, so that a track's own error doesn't pull.
    """
    place = np.interp(profiles.stations, stations, offsets)
    # Twice: the first mean is pulled by how far the track is off, the second lies about the line itself.
    middle, _ = _paint_near(profiles, place)
    local = ndimage.median_filter(np.where(np.isfinite(middle), middle, place), size=21, mode="nearest")
    return _paint_near(profiles, local)


def _paint_near(profiles: Profiles, place: Float) -> tuple[Float, Float]:
    reach = round(_NEAR / ACROSS)
    first = np.rint((place - profiles.offsets[0]) / ACROSS).astype(np.int64)
    columns = first[:, None] + np.arange(-reach, reach + 1)
    valid = (columns >= 0) & (columns < len(profiles.offsets))
    columns = np.clip(columns, 0, len(profiles.offsets) - 1)
    paint = np.take_along_axis(profiles.paint, columns, axis=1).astype(np.float64)
    paint[~valid] = np.nan
    known = np.isfinite(paint)
    clipped = np.clip(np.where(known, paint, 0.0), 0.0, 1.0)
    total = clipped.sum(axis=1)
    # Bins that no point fell into are taken to be like the rest of their row.
    share = known.mean(axis=1)
    cover = np.where(share > 0.3, total / np.maximum(share, 1e-9) * ACROSS, np.nan)
    with np.errstate(invalid="ignore", divide="ignore"):
        # Centre of gravity of the paint.
        mean = (clipped * profiles.offsets[columns]).sum(axis=1) / total
    return np.where(total > 0.15, mean, np.nan), cover


def _painted_share(cover: Float, usual: float) -> Float:
    """Return the share (S,), 0 to 1, of each row that is painted, from the paint's width (S,), m; NaN if unknown.

    What counts as full is the width around a place: where points lie in rows along the road, a line may have two rows
    of them here and one there.
    """
    known = np.isfinite(cover)
    around = ndimage.percentile_filter(np.where(known, cover, 0.0), 80, size=_AROUND, mode="nearest")
    full = np.maximum(around, _FULL * usual)
    return np.where(known, np.clip(np.nan_to_num(cover) / full, 0.0, 1.0), np.nan)


def _offsets_by_stretch(profiles: Profiles, middle: Float, share: Float) -> tuple[Float, Float]:
    """Return the paint's weighted mean offset (K,), m, in each stretch, NaN without paint, and its weight."""
    count = profiles.stretches
    index = np.arange(len(middle)) // STRETCH
    weight = np.where(np.isfinite(middle) & np.isfinite(share), np.nan_to_num(share), 0.0)
    weight[weight < _FEWEST] = 0.0
    total = np.bincount(index, weight, count)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.bincount(index, weight * np.nan_to_num(middle), count) / total
    weights = np.where(total > 0.15 * STRETCH, np.minimum(total / STRETCH, 1.0), 0.0)
    return np.where(weights > 0.0, mean, np.nan), weights


def _between_points(profiles: Profiles, points: SurfacePoints, measured: Float, on: Bool) -> tuple[Float, Float, Float]:
    """Return a line's middle and width, and the gap of the points at its edges (K,), m, refined by the points.

    A scanner that follows the road samples it in rows along it: within a bin all points may lie at one offset. A
    line's edge is between the outermost point on it and the next one that isn't.

    Args:
        profiles: S rows.
        points: of the profiles.
        measured: (K,) offset of the line by bins; NaN without paint.
        on: (S,) whether there is paint in each row.
    """
    middle, width = np.full(len(measured), np.nan), np.full(len(measured), np.nan)
    spacing = np.zeros(len(measured))
    first = profiles.stations[0] - 0.5 * SPACING
    for number in np.flatnonzero(np.isfinite(measured)):
        near = points.near(int(number), measured[number] - _NEAR - 0.1, measured[number] + _NEAR + 0.1)
        row = np.clip(((points.station[near] - first) / SPACING).astype(np.int64), 0, len(on) - 1)
        painted = on[row]
        offset, marked = points.offset[near][painted].astype(np.float64), points.marked[near][painted]
        if marked.sum() < _FEWEST_POINTS or len(offset) < 2 * _FEWEST_POINTS:
            continue
        low, high = _best_span(marked)
        if low == 0 or high == len(offset):
            continue
        right, left = 0.5 * (offset[low - 1] + offset[low]), 0.5 * (offset[high - 1] + offset[high])
        middle[number], width[number] = 0.5 * (left + right), left - right
        gaps = offset[low] - offset[low - 1], offset[high] - offset[high - 1]
        spacing[number] = 0.5 * float(np.hypot(*gaps))
        if offset[high - 1] - offset[low] < _ROW and min(gaps) < _ROW:
            middle[number], spacing[number] = _on_a_row(offset, low, high)
    return middle, width, spacing


def _on_a_row(offset: Float, low: int, high: int) -> tuple[float, float]:
    """Return middle and gap, m, of a line of which one row of points (``low`` to ``high``) is partly on it.

    One of its edges runs along the row, but which of both no order of points tells that lie within a row's wobble.
    """
    row = float(offset[low:high].mean())
    before, beyond = offset[offset < row - _ROW], offset[offset > row + _ROW]
    if not len(before) or not len(beyond):
        return row, 2.0 * _NEAR
    return row, 0.5 * float(beyond[0] - before[-1])


def _best_span(marked: Bool) -> tuple[int, int]:
    """Return the span (first, behind the last) of points with most marked ones inside and unmarked ones outside."""
    total = np.append(0, np.cumsum(np.where(marked, 1, -1)))
    # The span with the largest sum of +1 and -1 (Kadane): the largest rise of the running sum from a place before it.
    lowest = np.minimum.accumulate(total)
    high = int((total - lowest).argmax())
    return int(total[: high + 1].argmin()), high


def _cover_by_stretch(share: Float) -> Float:
    """Return the share (K,) of the rows of each stretch that are painted; NaN for stretches without points."""
    count = -(-len(share) // STRETCH)
    index = np.arange(len(share)) // STRETCH
    known = np.isfinite(share)
    total = np.bincount(index, known, count)
    on = np.bincount(index, known & (np.nan_to_num(share) > 0.5), count)
    return np.where(total > 0.0, on / np.maximum(total, 1.0), np.nan)


def _dashes(stations: Float, cover: Float) -> tuple[float, float, float, float]:
    """Return painted share, dash and gap (m; 0 if solid) and the station of a dash, from rows' painted shares (R,).

    What isn't painted for longer than any gap doesn't count: there the line lies hidden between rows of points.
    The period is the one whose wave the paint follows best; a common pattern is taken where it is that, within 0.6 m.
    """
    known = np.isfinite(cover)
    if known.sum() < 30:
        return 1.0, 0.0, 0.0, float(stations[0])
    filled = np.interp(stations, stations[known], cover[known])
    on = ndimage.median_filter(filled, size=3, mode="nearest") > 0.5
    known &= on | ~ndimage.binary_opening(~on, np.ones(_LONGEST_GAP))
    if not known.any():
        return 0.0, 0.0, 0.0, float(stations[0])
    share = float(on[known].mean())
    if share > _SOLID:
        return share, 0.0, 0.0, float(stations[0])
    wave = filled[known]
    periods = np.arange(4.0, 40.0, 0.05)
    # Schuster 1898: strength of the wave at each period, |mean of x exp(-2 pi i s / T)|.
    phasor = np.exp(-2j * np.pi * stations[known][None, :] / periods[:, None])
    strength = np.abs((phasor * (wave - wave.mean())).mean(axis=1))
    best = int(strength.argmax())
    period, dash = float(periods[best]), share * float(periods[best])
    for standard, gap in STANDARD_DASHES:
        if abs(standard + gap - period) < 0.5 * _DASH_TOLERANCE and abs(standard - dash) < 2.0 * _DASH_TOLERANCE:
            dash, period = standard, standard + gap
    # The phase of the wave is the place of a dash's middle: s = angle T / (2 pi).
    angle = float(np.angle((np.exp(2j * np.pi * stations[known] / period) * (wave - wave.mean())).mean()))
    first = angle / (2.0 * np.pi) * period - 0.5 * dash  # half a dash before the middle of one
    first += period * np.ceil((stations[0] - first) / period)
    return share, round(dash, 2), round(period - dash, 2), float(first)
