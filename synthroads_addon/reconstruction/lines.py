"""Line markings: found in cross profiles, followed along the path, and described: offset, width, dashes."""

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple, Self

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
_NEAREST = 0.15
"""The same of a line that has another one beside it, m, at least. Chosen: a narrow line's width, and a bin's."""
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
"""A line's rough course: (station, offset), m, of its peak in each window that shows it."""
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
        start, end: stations between which the line was seen, m.
        width: mean width of its paint, m.
        width_std: standard deviation of the width, m.
        painted: share of its length that is painted.
        dash, gap: m; 0 for a solid line.
        first_dash: station at which a dash begins, m.
        hidden: length between its pieces in which it wasn't seen, m.
        pair: the two lines, from right to left, that it lies midway between; None if it is a line itself.
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
    pair: tuple[Self, Self] | None = None

    @property
    def solid(self) -> bool:
        """Return whether the line has no dashes."""
        return self.dash == 0.0

    @property
    def offset(self) -> float:
        """Return the line's median offset, m."""
        return float(np.nanmedian(self.offsets))

    @property
    def apart(self) -> float:
        """Return the distance, m, of the two lines that it lies midway between; 0 if it is a line itself."""
        return 0.0 if self.pair is None else self.pair[1].offset - self.pair[0].offset

    @property
    def length(self) -> float:
        """Return the length along which the line was seen, m."""
        return self.end - self.start - self.hidden


def is_dashed(line: Line) -> bool:
    """Return whether a line has dashes as lane lines have: below 10 m (chosen: the longest standard dash has 6 m)."""
    return not line.solid and line.dash < 10.0


def find_lines(profiles: Profiles) -> list[Line]:
    """Return the line markings in profiles, from right to left."""
    tracks = _tracks(profiles)
    lines = [_measure_line(profiles, *track, _reach(number, tracks)) for number, track in enumerate(tracks)]
    return sorted((line for line in lines if line is not None), key=lambda line: line.offset)


def _reach(number: int, tracks: list[tuple[Float, Float]]) -> float:
    """Return the distance, m, to either side of a track that its paint lies within, so that no other line's does.

    Args:
        number: index of the track.
        tracks: stations and offsets of all tracks, m.
    """
    station, offset = tracks[number]
    reach = _NEAR
    for other_number, (other_station, other_offset) in enumerate(tracks):
        beside = (station >= other_station[0]) & (station <= other_station[-1])
        if other_number != number and 2 * beside.sum() > len(station):
            distance = np.abs(offset - np.interp(station, other_station, other_offset))[beside]
            reach = min(reach, 0.5 * float(np.median(distance)))
    return max(reach, _NEAREST)


def _tracks(profiles: Profiles) -> list[tuple[Float, Float]]:
    """Return rough stations and offsets of each line, m: peaks of mean profiles, linked from window to window."""
    rows = len(profiles.stations)
    ended_tracks: list[_Track] = []
    open_tracks: list[_Track] = []
    for row in range(0, max(1, rows - _WINDOW // 2), _STEP):
        station = float(profiles.stations[row : row + _WINDOW].mean())
        peaks = _peaks(profiles, profiles.paint[row : row + _WINDOW])
        open_tracks, newly_ended = _link_peaks(open_tracks, peaks, station)
        ended_tracks += newly_ended
    long_tracks = [track for track in ended_tracks + open_tracks if len(track) >= 2]
    tracks = [np.array(track) for track in _joined(profiles, long_tracks)]
    return [(track[:, 0], track[:, 1]) for track in tracks]


def _joined(profiles: Profiles, tracks: list[_Track]) -> list[_Track]:
    """Return the tracks with those made one that go on where another ended, if the line may lie hidden in between.

    A line that is narrower than the distance of two rows of points may lie between them for long. A piece goes on with
    the one that ended nearest beside it. Where points lie anywhere a line that isn't seen isn't there.
    """
    result: list[_Track] = []
    for track in sorted(tracks, key=lambda item: item[0][0]):
        station, offset = track[0]
        candidates = [
            earlier_track
            for earlier_track in result
            if earlier_track[-1][0] < station and abs(earlier_track[-1][1] - offset) <= _SAME
        ]
        predecessor = min(candidates, key=lambda other: abs(other[-1][1] - offset), default=None)
        if predecessor is not None and _in_rows(profiles, predecessor[-1][0], station, offset):
            predecessor.extend(track)
        else:
            result.append(list(track))
    return result


def _in_rows(profiles: Profiles, start: float, end: float, offset: float) -> bool:
    """Return whether points around an offset lie in rows with gaps between, on most of the way from start to end."""
    in_between = (profiles.middles >= start) & (profiles.middles <= end)
    gaps = profiles.row_gaps(np.where(in_between, offset, np.nan))
    return 2 * int((gaps > 0.0).sum()) > int(in_between.sum())


def _peaks(profiles: Profiles, paint: Grid) -> list[float]:
    """Return the offsets, m, of the narrow peaks in the mean profile of some rows of paint (R, U)."""
    has_points = np.isfinite(paint)
    # Points may lie in rows along the road with empty bins between them: these must not thin out a line's peak.
    count = ndimage.gaussian_filter1d(has_points.sum(axis=0).astype(np.float64), 1.0)
    total = ndimage.gaussian_filter1d(np.where(has_points, paint, 0.0).sum(axis=0).astype(np.float64), 1.0)
    mean = np.where(count > 0.05 * len(paint), total / np.maximum(count, 1e-9), 0.0)
    peaks = find_peaks(mean, height=_HEIGHT, prominence=_PROMINENCE, width=(None, _WIDEST / ACROSS))[0]
    return [_vertex(mean, peak, profiles.offsets) for peak in peaks]


def _vertex(values: Float, peak: int, bin_offsets: Float) -> float:
    """Return the offset, m, of the vertex of the parabola through a peak and its two neighbours."""
    left_value, peak_value, right_value = values[peak - 1 : peak + 2]
    second_difference = left_value - 2.0 * peak_value + right_value
    return float(
        bin_offsets[peak]
        + (0.5 * ACROSS * (left_value - right_value) / second_difference if second_difference < 0.0 else 0.0)
    )


def _link_peaks(open_tracks: list[_Track], peaks: list[float], station: float) -> tuple[list[_Track], list[_Track]]:
    """Extend open tracks, in place, by peaks near their expected offsets; return open and ended tracks.

    Pairs of track and peak are linked in order of distance; a peak without a track begins one.
    """
    pairs = sorted(
        (abs(peak - _expected_place(track, station)), i, j)
        for i, track in enumerate(open_tracks)
        for j, peak in enumerate(peaks)
    )
    used_peaks: set[int] = set()
    continued: set[int] = set()
    for distance, i, j in pairs:
        if distance <= _LINK and i not in continued and j not in used_peaks:
            open_tracks[i].append((station, peaks[j]))
            continued.add(i)
            used_peaks.add(j)
    ended_tracks = [track for track in open_tracks if station - track[-1][0] > _LOST]
    open_after = [track for track in open_tracks if station - track[-1][0] <= _LOST]
    open_after += [[(station, peak)] for j, peak in enumerate(peaks) if j not in used_peaks]
    return open_after, ended_tracks


def _expected_place(track: _Track, station: float) -> float:
    """Return the offset, m, at which a track is expected at a station: straight on from its last five points, 40 m."""
    if len(track) < 3:
        return track[-1][1]
    (s0, u0), (s1, u1) = track[max(-5, -len(track))], track[-1]
    # A track goes on straight for 20 m at most: beyond that a bend is as likely.
    slope = float(np.clip((u1 - u0) / (s1 - s0), -0.06, 0.06))
    return u1 + slope * min(station - s1, 20.0)


def _measure_line(profiles: Profiles, stations: Float, offsets: Float, near: float = _NEAR) -> Line | None:
    """Return the line measured along a rough track; None if too little paint lies there.

    Args:
        profiles: S rows along a path, in K stretches.
        stations: (T,) of the track, m.
        offsets: (T,) of the track, m.
        near: distance to either side of it that its paint lies within, m.
    """
    half_window = _WINDOW / 2.0
    middle, cover = _paint_by_row(profiles, stations, offsets, near)
    track_rows = _shown(profiles.stations, stations, half_window)
    # The width where it is painted: a high percentile, as dashes leave most rows bare.
    usual_width = float(np.nanpercentile(cover[track_rows], 90)) if np.isfinite(cover[track_rows]).any() else 0.0
    # Chosen: no marking is narrower than 3 cm.
    if usual_width < 0.03:
        return None
    share = _painted_share(cover, usual_width)
    grid = profiles.middles
    stretch_offsets, weights = _offsets_by_stretch(profiles, middle, np.where(track_rows, share, 0.0))
    # Chosen: fewer than four stretches (20 m) with paint are no line.
    if (weights > 0.0).sum() < 4:
        return None
    # Width and offsets by bins; by the points themselves where these are known.
    width, width_std = mean_with_std(cover[track_rows][np.nan_to_num(share[track_rows]) > 0.5])
    spacing = profiles.row_gaps(stretch_offsets)
    if profiles.points is not None:
        painted_rows = np.where(track_rows & np.isfinite(share), share, 0.0) > 0.5
        stretch_offsets, widths, spacing = _between_points(
            profiles, profiles.points, stretch_offsets, painted_rows, near
        )
        weights = np.where(np.isfinite(stretch_offsets), weights, 0.0)
        width, width_std = mean_with_std(widths)
        # Both edges lie somewhere between two rows of points.
        width_std = float(np.hypot(width_std, hidden_std(2.0 * spacing, width_std)))
    if (weights > 0.0).sum() < 4:
        return None
    # The line reaches from the first to the last stretch that shows paint.
    smooth_offsets = smooth(stretch_offsets, weights, STRETCH * SPACING, WAVELENGTH, usual_std=USUAL)
    seen_stations = grid[weights > 0.0]
    start, end = float(seen_stations[0] - STRETCH / 2.0), float(seen_stations[-1] + STRETCH / 2.0)
    in_line = (grid >= start) & (grid <= end)
    pattern = _dash_pattern(profiles.stations[track_rows], share[track_rows])
    return Line(
        stations=grid,
        measured=stretch_offsets,
        offsets=np.where(in_line, smooth_offsets.values, np.nan),
        std=np.where(in_line, np.hypot(smooth_offsets.std, hidden_std(spacing, smooth_offsets.scatter)), np.nan),
        spacing=spacing,
        cover=_cover_by_stretch(share),
        start=start,
        end=end,
        width=width,
        width_std=width_std,
        painted=pattern.painted_share,
        dash=pattern.dash,
        gap=pattern.gap,
        first_dash=pattern.first_dash,
        hidden=SPACING * float((~track_rows & (profiles.stations >= start) & (profiles.stations <= end)).sum()),
    )


def _shown(rows: Float, stations: Float, half_window: float) -> Bool:
    """Return a mask (S,) of the rows along a track, less those where it was lost for more than `_LOST`.

    Args:
        rows: (S,) stations of the rows, m.
        stations: (T,) of the track, m.
        half_window: distance before and behind a station of the track that counts as seen, m.
    """
    shown_rows = (rows >= stations[0] - half_window) & (rows <= stations[-1] + half_window)
    for gap_start, gap_end in pairwise(stations):
        if gap_end - gap_start > _LOST:
            shown_rows &= (rows <= gap_start + half_window) | (rows >= gap_end - half_window)
    return np.asarray(shown_rows)


def _paint_by_row(profiles: Profiles, stations: Float, offsets: Float, near: float) -> tuple[Float, Float]:
    """Return the paint's mean offset near a track and its width in each row (S,), m; NaN without points.

    The mean is found twice, the second time around the smoothed first one, so that a track's own error doesn't pull.
    """
    track_offset = np.interp(profiles.stations, stations, offsets)
    # Twice: the first mean is pulled by how far the track is off, the second lies about the line itself.
    middle, _ = _paint_near(profiles, track_offset, near)
    # Chosen: the median over 21 rows removes single rows' errors and follows every bend.
    local = ndimage.median_filter(np.where(np.isfinite(middle), middle, track_offset), size=21, mode="nearest")
    return _paint_near(profiles, local, near)


def _paint_near(profiles: Profiles, line_offset: Float, near: float) -> tuple[Float, Float]:
    """Return mean offset and width (S,), m, of each row's paint within a distance of a place (S,), m, or NaN."""
    reach = round(near / ACROSS)
    middle_column = np.rint((line_offset - profiles.offsets[0]) / ACROSS).astype(np.int64)
    columns = middle_column[:, None] + np.arange(-reach, reach + 1)
    in_grid = (columns >= 0) & (columns < len(profiles.offsets))
    columns = np.clip(columns, 0, len(profiles.offsets) - 1)
    paint = np.take_along_axis(profiles.paint, columns, axis=1).astype(np.float64)
    paint[~in_grid] = np.nan
    has_points = np.isfinite(paint)
    paint_amount = np.clip(np.where(has_points, paint, 0.0), 0.0, 1.0)
    total = paint_amount.sum(axis=1)
    # Bins that no point fell into are taken to be like the rest of their row.
    share = has_points.mean(axis=1)
    # Chosen: points in 30 % of the bins tell a row's paint, and 0.15 of a bin's paint its middle.
    cover = np.where(share > 0.3, total / np.maximum(share, 1e-9) * ACROSS, np.nan)
    with np.errstate(invalid="ignore", divide="ignore"):
        # Centre of gravity of the paint.
        mean = (paint_amount * profiles.offsets[columns]).sum(axis=1) / total
    return np.where(total > 0.15, mean, np.nan), cover


def _painted_share(cover: Float, usual_width: float) -> Float:
    """Return the share (S,), 0 to 1, of each row that is painted, from the paint's width (S,), m; NaN if unknown.

    The full width is that of the rows around: where points lie in rows along the road, a line may have two rows
    of them here and one there.
    """
    has_points = np.isfinite(cover)
    around = ndimage.percentile_filter(np.where(has_points, cover, 0.0), 80, size=_AROUND, mode="nearest")
    full_width = np.maximum(around, _FULL * usual_width)
    return np.where(has_points, np.clip(np.nan_to_num(cover) / full_width, 0.0, 1.0), np.nan)


def _offsets_by_stretch(profiles: Profiles, middle: Float, share: Float) -> tuple[Float, Float]:
    """Return the paint's weighted mean offset, m, and its weight, 0 to 1, by stretch, (K,) each; NaN without paint.

    Args:
        profiles: S rows in K stretches.
        middle: (S,) offset of the line's middle by row, m; NaN without paint.
        share: (S,) share of paint by row, 0 to 1.
    """
    count = profiles.stretches
    index = np.arange(len(middle)) // STRETCH
    weight = np.where(np.isfinite(middle) & np.isfinite(share), np.nan_to_num(share), 0.0)
    weight[weight < _FEWEST] = 0.0
    total = np.bincount(index, weight, count)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.bincount(index, weight * np.nan_to_num(middle), count) / total
    # Chosen: paint in 15 % of a stretch's rows tells its offset.
    weights = np.where(total > 0.15 * STRETCH, np.minimum(total / STRETCH, 1.0), 0.0)
    return np.where(weights > 0.0, mean, np.nan), weights


def _between_points(
    profiles: Profiles, points: SurfacePoints, bin_offsets: Float, painted_rows: Bool, near: float
) -> tuple[Float, Float, Float]:
    """Return a line's middle, its width, and the spacing of the points at its edges, (K,) each, m, refined by points.

    A scanner that follows the road samples it in rows along it: within a bin all points may lie at one offset. A
    line's edge is between the outermost point on it and the next one that isn't.

    Args:
        profiles: S rows in K stretches.
        points: surface points of the profiles, with their classes.
        bin_offsets: (K,) offset of the line by bins, m; NaN without paint.
        painted_rows: (S,) mask of the rows in which the line is painted.
        near: distance to either side of the line that its paint lies within, m.
    """
    middle, width = np.full(len(bin_offsets), np.nan), np.full(len(bin_offsets), np.nan)
    spacing = np.zeros(len(bin_offsets))
    first_border = profiles.stations[0] - 0.5 * SPACING
    for number in np.flatnonzero(np.isfinite(bin_offsets)):
        point_slice = points.near(int(number), bin_offsets[number] - near - 0.1, bin_offsets[number] + near + 0.1)
        row = np.clip(
            ((points.station[point_slice] - first_border) / SPACING).astype(np.int64), 0, len(painted_rows) - 1
        )
        on_painted_row = painted_rows[row]
        offset = points.offset[point_slice][on_painted_row].astype(np.float64)
        is_paint = points.marked[point_slice][on_painted_row]
        if is_paint.sum() < _FEWEST_POINTS or len(offset) < 2 * _FEWEST_POINTS:
            continue
        begin, end = _best_span(is_paint)
        if begin == 0 or end == len(offset):
            continue
        right_edge, left_edge = 0.5 * (offset[begin - 1] + offset[begin]), 0.5 * (offset[end - 1] + offset[end])
        middle[number], width[number] = 0.5 * (left_edge + right_edge), left_edge - right_edge
        gaps = offset[begin] - offset[begin - 1], offset[end] - offset[end - 1]
        spacing[number] = 0.5 * float(np.hypot(*gaps))
        if offset[end - 1] - offset[begin] < _ROW and min(gaps) < _ROW:
            middle[number], spacing[number] = _on_a_row(offset, begin, end)
    return middle, width, spacing


def _on_a_row(offset: Float, begin: int, end: int) -> tuple[float, float]:
    """Return middle and spacing, m, of a line that only one row of points (``begin`` to ``end``) lies partly on.

    One of the line's edges runs along the row; which one can't be told from points that wobble about the row.
    """
    row = float(offset[begin:end].mean())
    right_offsets, left_offsets = offset[offset < row - _ROW], offset[offset > row + _ROW]
    if not len(right_offsets) or not len(left_offsets):
        return row, 2.0 * _NEAR
    return row, 0.5 * float(left_offsets[0] - right_offsets[-1])


def _best_span(is_paint: Bool) -> tuple[int, int]:
    """Return begin and end (exclusive) of the span with most points of paint (N,) inside and others outside."""
    total = np.append(0, np.cumsum(np.where(is_paint, 1, -1)))
    # The span with the largest sum of +1 and -1 (Kadane): the largest rise of the running sum from a place before it.
    lowest = np.minimum.accumulate(total)
    end = int((total - lowest).argmax())
    return int(total[: end + 1].argmin()), end


def _cover_by_stretch(share: Float) -> Float:
    """Return the share (K,) of the rows of each stretch that are painted; NaN for stretches without points."""
    count = -(-len(share) // STRETCH)
    index = np.arange(len(share)) // STRETCH
    has_points = np.isfinite(share)
    total = np.bincount(index, has_points, count)
    painted_count = np.bincount(index, has_points & (np.nan_to_num(share) > 0.5), count)
    return np.where(total > 0.0, painted_count / np.maximum(total, 1.0), np.nan)


class _DashPattern(NamedTuple):
    """Dashes of a line: painted share of its length, dash and gap (m; 0 if solid), station of its first dash (m)."""

    painted_share: float
    dash: float
    gap: float
    first_dash: float


def _dash_pattern(stations: Float, cover: Float) -> _DashPattern:
    """Return the pattern of a line's dashes.

    Rows unpainted for longer than any gap don't count: there the line lies hidden between rows of points. The period
    is that of the strongest wave in the paint; a standard pattern within `_DASH_TOLERANCE` takes its place.

    Args:
        stations: (R,) of the rows, m.
        cover: (R,) painted share of each row, NaN if unknown.
    """
    row_mask = np.isfinite(cover)
    # Chosen: fewer than 30 rows show no pattern.
    if row_mask.sum() < 30:
        return _DashPattern(1.0, 0.0, 0.0, float(stations[0]))
    filled_cover = np.interp(stations, stations[row_mask], cover[row_mask])
    is_painted = ndimage.median_filter(filled_cover, size=3, mode="nearest") > 0.5
    row_mask &= is_painted | ~ndimage.binary_opening(~is_painted, np.ones(_LONGEST_GAP))
    if not row_mask.any():
        return _DashPattern(0.0, 0.0, 0.0, float(stations[0]))
    share = float(is_painted[row_mask].mean())
    if share > _SOLID:
        return _DashPattern(share, 0.0, 0.0, float(stations[0]))
    wave = filled_cover[row_mask]
    periods = np.arange(4.0, 40.0, 0.05)  # m; chosen: from below the shortest standard period to twice the longest
    # Schuster 1898: strength of the wave at each period, |mean of x exp(-2 pi i s / T)|.
    phasor = np.exp(-2j * np.pi * stations[row_mask][None, :] / periods[:, None])
    strength = np.abs((phasor * (wave - wave.mean())).mean(axis=1))
    best_period = int(strength.argmax())
    period, dash = float(periods[best_period]), share * float(periods[best_period])
    for standard, gap in STANDARD_DASHES:
        if abs(standard + gap - period) < 0.5 * _DASH_TOLERANCE and abs(standard - dash) < 2.0 * _DASH_TOLERANCE:
            dash, period = standard, standard + gap
    # The phase of the wave is the place of a dash's middle: s = angle T / (2 pi).
    angle = float(np.angle((np.exp(2j * np.pi * stations[row_mask] / period) * (wave - wave.mean())).mean()))
    dash_start = angle / (2.0 * np.pi) * period - 0.5 * dash  # half a dash before the middle of one
    dash_start += period * np.ceil((stations[0] - dash_start) / period)
    return _DashPattern(share, round(dash, 2), round(period - dash, 2), float(dash_start))
