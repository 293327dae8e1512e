"""Cross profiles: what lies how far beside a path, each metre along it; and the path that they are parallel to.

To make a path parallel to the road, each stretch is laid over those before it so that lines and edges coincide.
"""

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from ..base.arrays import Bool, Float, Index, Int
from .cloud import PointKind, RoadCloud
from .path import SPACING, CloudPath
from .smoothing import robust_scale, smooth

Grid = NDArray[np.float32]

ACROSS = 0.1
"""Width of a bin across the path, m. Chosen: a line's width."""
STRETCH = 5
"""Metres along the path that one offset of a line or an edge is measured on. Chosen: enough points for a mean, short
beside any dash and gap."""
_BACKGROUND = (11, 25)
"""Bins along and across whose median is a surface without paint. Chosen: 11 m by 2.5 m, of which a line fills
little."""
_PAINT_PERCENTILE = 99.0
"""Percentile of the brightness above the pavement's that is full paint. Chosen: paint is more than a hundredth of a
road."""
_ENOUGH = 1_500_000
"""Points by which the road is laid straight at most. Chosen: bounds the work; more don't move it."""
_BLUR = 0.8
"""Standard deviation of the nearest blur by which empty bins are filled, bins. Chosen: their neighbours' mean."""
STEP, WINDOW = 10, 20
"""Metres from one stretch to the next, and in a stretch. Chosen: half of a stretch overlaps the next."""
_SHEARS = np.linspace(-0.06, 0.06, 25)
"""Slopes of a stretch against the path that are tried, m/m. Chosen: what the first path is off by, in steps of 0.1 m
over a stretch."""
_REACH = 0.8
"""Distance that a stretch may lie beside where the ones before it lead, m. Chosen: less than from one line to
another."""
_LOOSE = 0.15
"""Distance that a stretch without lines adds to that, m. Chosen: a path may leave its course by 1.5 % there."""
_MEMORY = 0.85
"""Share of the template that stays from one stretch to the next. Chosen: it forgets over some 60 m, as markings
change."""
_PRIOR = 0.15
"""Share of the best score that is lost `_REACH` beside what was expected. Chosen: decides between lines that are
alike."""
_WAVELENGTH = 60.0
"""Wavelength of which half of the shifts' swings is kept, m. Chosen: shorter ones are noise."""
_EDGE = 0.3
"""Weight of the pavement's edges beside paint. Chosen: edges are rougher than lines, and there where no line is."""
_DENSE = 1.5
"""Bins between points that are no gap. Chosen: a point's place within its bin is worth one bin."""
_COARSE = 5
"""Bins along and across of which a median is the ground's height. Chosen: 5 m by 0.5 m hold points of any scanner."""

ROWS = 10
"""Distance along the road to either side of a stretch's middle that its median profile is taken from, m. Chosen: cars
and stains are shorter."""
_FEWEST_ROWS = 3
"""Rows with points of a median. Chosen: of fewer it is a single car's or stain's."""


@dataclass(frozen=True)
class SurfacePoints:
    """Points of the surface, grouped by stretch and sorted from right to left within each.

    Attributes:
        begins: (K + 1,) index of each stretch's first point.
        station, offset: (N,) m.
        paved, marked: (N,) masks of points on pavement (with its paint) and on paint, by class.
    """

    begins: Index
    station: Grid
    offset: Grid
    paved: Bool
    marked: Bool

    def near(self, stretch: int, right_limit: float, left_limit: float) -> slice:
        """Return the slice of a stretch's points between two offsets, m."""
        begin, end = self.begins[stretch], self.begins[stretch + 1]
        first_index, end_index = np.searchsorted(self.offset[begin:end], [right_limit, left_limit])
        return slice(int(begin + first_index), int(begin + end_index))


@dataclass(frozen=True)
class Profiles:
    """Cross profiles of a cloud: values in S rows of a metre along a path and U bins across; NaN without points.

    Attributes:
        path: path along which the profiles are measured.
        stations: (S,) middles along the path, m.
        offsets: (U,) middles across, m, ascending (from right to left).
        count: (S, U) points of the surface.
        paint: (S, U) 0 where there is no paint, 1 where there is; in between where a bin is part of both.
        paved: (S, U) share of pavement (with its paint) among the surface's points; None if classes don't tell.
        height: (S, U) mean height of the surface's points, m.
        brightness: (S, U) mean intensity of the surface's points, in the file's unit.
        points: the surface's points themselves; None if classes don't tell, or nobody asked for them.
    """

    path: CloudPath
    stations: Float
    offsets: Float
    count: Grid
    paint: Grid
    paved: Grid | None
    height: Grid
    brightness: Grid
    points: SurfacePoints | None = None

    @property
    def stretches(self) -> int:
        """Return the number K of stretches that the rows are grouped into, 5 m each."""
        return -(-len(self.stations) // STRETCH)

    @property
    def middles(self) -> Float:
        """Return the stations (K,) of the middles of the stretches, m."""
        first_border = self.stations[0] - 0.5 * SPACING
        return first_border + STRETCH * SPACING * (np.arange(self.stretches) + 0.5)

    def column(self, offset: float) -> int:
        """Return the index of the bin at an offset, the nearest one if it lies outside."""
        return int(np.clip(round((offset - self.offsets[0]) / ACROSS), 0, len(self.offsets) - 1))

    @property
    def covered_length(self) -> float:
        """Return the length, m, of the path along which there are points."""
        return SPACING * float((self.count.sum(axis=1) > 0).sum())

    def row_gaps(self, offsets: Float) -> Float:
        """Return half the distance (K,), m, of the two rows of points beside an offset (K,); 0 where points are dense.

        A scanner that follows the road leaves bins empty between rows of points: offsets there are known no better.
        """
        gaps = np.zeros(self.stretches)
        for number in np.flatnonzero(np.isfinite(offsets)):
            rows = slice(number * STRETCH, (number + 1) * STRETCH)
            occupied = np.flatnonzero((self.count[rows] > 0).any(axis=0))
            column = self.column(float(offsets[number]))
            right_bins, left_bins = occupied[occupied < column], occupied[occupied > column]
            if len(right_bins) and len(left_bins):
                # Half the way between the bins on either side of it, as it lies in the middle between two rows.
                gaps[number] = 0.5 * ACROSS * float(left_bins[0] - right_bins[-1])
        return np.where(gaps > _DENSE * ACROSS, gaps, 0.0)

    def surface_height(self, station: Float, offset: Float) -> Float:
        """Return the surface's height (N,), m, at stations and offsets (N,): medians of 5 m by 0.5 m, interpolated."""
        rows, columns = self.height.shape
        cell_rows, cell_columns = -(-rows // _COARSE), -(-columns // _COARSE)
        padded_heights = np.full((cell_rows * _COARSE, cell_columns * _COARSE), np.nan)
        padded_heights[:rows, :columns] = self.height
        cells = (
            padded_heights.reshape(cell_rows, _COARSE, cell_columns, _COARSE)
            .swapaxes(1, 2)
            .reshape(cell_rows, cell_columns, -1)
        )
        has_points = np.isfinite(cells).any(axis=2)
        cell_heights = np.full((cell_rows, cell_columns), np.nan)
        cell_heights[has_points] = np.nanmedian(cells[has_points], axis=1)
        nearest_cells = ndimage.distance_transform_edt(~has_points, return_distances=False, return_indices=True)
        filled_heights = cell_heights[tuple(nearest_cells)]
        # Of n bins each, the middle of coarse cell i is at the bins' middle n i + (n - 1) / 2.
        row = (station - self.stations[0]) / _COARSE + 0.5 / _COARSE - 0.5
        column = (offset - self.offsets[0]) / (ACROSS * _COARSE) + 0.5 / _COARSE - 0.5
        return np.asarray(ndimage.map_coordinates(filled_heights, np.stack([row, column]), order=1, mode="nearest"))


def make_profiles(cloud: RoadCloud, path: CloudPath, half_width: float, keep_points: bool = False) -> Profiles:
    """Return the cross profiles of a cloud's surface along a path, up to ``half_width`` (m) to either side.

    Args:
        cloud: cloud whose surface points are binned.
        path: path along which.
        half_width: reach to either side of the path, m.
        keep_points: whether all points are used, and kept if classes tell paint, to find lines more exactly than bins.
    """
    surface = cloud.surface if keep_points else cloud.surface[:: max(1, len(cloud.surface) // _ENOUGH)]
    station, offset = path.project(cloud.xyz[surface, :2])
    rows, columns = len(path.points) - 1, 2 * int(np.ceil(half_width / ACROSS))
    row = np.floor((station - path.start) / SPACING).astype(np.int64)
    column = np.floor(offset / ACROSS).astype(np.int64) + columns // 2
    in_grid = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    cell = row[in_grid] * columns + column[in_grid]
    kind = cloud.kind[surface][in_grid]

    def total(values: NDArray[np.generic] | None) -> Grid:
        """Return the sums by bin (S, U) of points' values; of None the number of points."""
        return np.bincount(cell, values, rows * columns).reshape(rows, columns).astype(np.float32)

    count = total(None)
    with np.errstate(invalid="ignore", divide="ignore"):
        height = total(cloud.xyz[surface, 2][in_grid]) / count
        brightness = total(cloud.intensity[surface][in_grid]) / count
        pavement_share = (
            total(np.isin(kind, (PointKind.PAVEMENT, PointKind.MARKING))) / count if cloud.labelled else None
        )
        marking_share = total(kind == PointKind.MARKING) / count if cloud.marked else None
    paint = paint_share(brightness, pavement_share) if marking_share is None else marking_share
    stations = path.start + SPACING * (np.arange(rows) + 0.5)
    offsets = ACROSS * (np.arange(columns) - columns // 2 + 0.5)
    points = None
    if keep_points and cloud.marked:
        points = _by_stretch(row[in_grid], station[in_grid], offset[in_grid], kind, rows)
    return Profiles(path, stations, offsets, count, paint, pavement_share, height, brightness, points)


def _by_stretch(row: Int, station: Float, offset: Float, kind: NDArray[np.uint8], rows: int) -> SurfacePoints:
    """Return N points grouped by stretch and sorted by offset, from their rows, stations, offsets (m) and kinds."""
    stretch = row // STRETCH
    order = np.argsort(stretch * 1000.0 + offset)  # offsets are less than 100 m
    begins = np.searchsorted(stretch[order], np.arange(-(-rows // STRETCH) + 1))
    return SurfacePoints(
        begins=begins,
        station=station[order].astype(np.float32),
        offset=offset[order].astype(np.float32),
        paved=np.isin(kind[order], (PointKind.PAVEMENT, PointKind.MARKING)),
        marked=kind[order] == PointKind.MARKING,
    )


def paint_share(brightness: Grid, paved: Grid | None) -> Grid:
    """Return each bin's share of paint (S, U), by its brightness between pavement (0) and paint (1); NaN where unknown.

    The pavement around is the median of 11 m by 2.5 m: lines are narrower than that, and verges wider. Where classes
    tell pavement from verge, only pavement counts.
    """
    is_pavement = np.isfinite(brightness)
    if paved is not None:
        is_pavement &= np.nan_to_num(paved) > 0.5
    if not is_pavement.any():
        return np.full(brightness.shape, np.nan, dtype=np.float32)
    filled_brightness = _fill_bins(brightness, is_pavement)
    # The median of a window is the pavement as long as paint fills less than half of it.
    excess = np.where(is_pavement, filled_brightness - ndimage.median_filter(filled_brightness, size=_BACKGROUND), 0.0)
    spread = robust_scale(excess[is_pavement] - np.median(excess[is_pavement]))
    # Without any paint the percentile is noise: four deviations of it are full paint at least, so that nothing passes
    # for a line.
    full_paint = max(float(np.percentile(excess[is_pavement], _PAINT_PERCENTILE)), 4.0 * spread, 1e-12)
    return np.where(is_pavement, np.clip(excess / full_paint, -0.5, 1.5), np.nan).astype(np.float32)


def _fill_bins(values: Grid, known_mask: Bool) -> Grid:
    """Return values (S, U) whose unknown bins hold the Gaussian-weighted mean of known ones around."""
    result = np.where(known_mask, values, 0.0).astype(np.float32)
    filled_mask = known_mask.copy()
    # Chosen: ever wider blurs (in bins) fill what narrower ones leave, where float32 still tells their weight.
    for sigma in (_BLUR, 2.0, 6.0, 20.0):
        weight = ndimage.gaussian_filter(known_mask.astype(np.float32), sigma)
        mean = ndimage.gaussian_filter(np.where(known_mask, values, 0.0).astype(np.float32), sigma)
        newly_filled = ~filled_mask & (weight > 1e-3)
        result[newly_filled] = mean[newly_filled] / weight[newly_filled]
        filled_mask |= newly_filled
    result[~filled_mask] = float(np.median(values[known_mask]))
    return result


@dataclass(frozen=True)
class _Fit:
    """Fit of a stretch to a template: shift (m) and shear (m/m), and their normalised correlation, 0 to 1."""

    shift: float
    shear: float
    score: float


def register_path(path: CloudPath, profiles: Profiles) -> CloudPath:
    """Return the path shifted so that it runs parallel to the lines and edges that its profiles show.

    Stretches of 20 m are sheared and shifted against the mean of those before them, beginning with the most usual one.
    Without lines and edges the path stays as it is.
    """
    signal = registration_signal(profiles)
    starts = np.arange(0, max(1, len(signal) - WINDOW + 1), STEP)
    blocks = [_shear_profiles(signal[row : row + WINDOW]) for row in starts]
    energy = np.array([float((block**2).sum(axis=1).max()) for block in blocks])
    if energy.max() <= 0.0:
        return path
    reference = _reference_stretch(blocks)
    fits = [_Fit(0.0, 0.0, 0.0)] * len(blocks)
    fits[reference] = _self_fit(blocks[reference])
    _fit_in_order(blocks, fits, range(reference + 1, len(blocks)), reference)
    _fit_in_order(blocks, fits, range(reference - 1, -1, -1), reference)
    middles = SPACING * (starts + 0.5 * min(WINDOW, len(signal)))
    weights = np.array([fit.score for fit in fits])
    if len(fits) < 5 or (weights > 0).sum() < 5:
        return path
    shifts = np.where(weights > 0, [fit.shift for fit in fits], np.nan)
    shift = smooth(shifts, np.ones(len(shifts)), STEP * SPACING, _WAVELENGTH, usual_std=ACROSS).values
    path_distance = path.stations - path.start
    # Beyond the outermost stretches the path goes on as straight as these lead.
    ends = np.gradient(shift, middles)
    shift_along = np.interp(path_distance, middles, shift)
    shift_along += np.where(path_distance < middles[0], (path_distance - middles[0]) * ends[0], 0.0)
    shift_along += np.where(path_distance > middles[-1], (path_distance - middles[-1]) * ends[-1], 0.0)
    return path.shift_by(shift_along)


def _self_fit(block: Float) -> _Fit:
    """Return the fit of a stretch to itself: the shear under which its rows coincide best."""
    return _Fit(0.0, float(_SHEARS[int((block**2).sum(axis=1).argmax())]), 1.0)


def _reference_stretch(blocks: list[Float]) -> int:
    """Return the index of the stretch most like both its neighbours: it has no hatching, arrows or bridge."""
    likeness = np.zeros(len(blocks) + 1)
    for number in range(len(blocks) - 1):
        fit = _fit_to(blocks[number + 1], _shift_profile(blocks[number], _self_fit(blocks[number])), 0.0, 2.0 * _REACH)
        likeness[number + 1] = fit.score if fit is not None else 0.0
    return int(np.minimum(likeness[:-1], likeness[1:]).argmax())


def registration_signal(profiles: Profiles) -> Grid:
    """Return the signal (S, U) by which profiles are registered: paint and the pavement's edges; 0 without points."""
    paint = np.clip(np.nan_to_num(profiles.paint), 0.0, 1.0)
    # Chosen: blurs of one to two bins, so that lines a bin beside each other still match.
    signal = ndimage.gaussian_filter1d(paint, 1.5, axis=1)
    if profiles.paved is not None:
        paved = ndimage.gaussian_filter(np.nan_to_num(profiles.paved), (1.0, 2.0))
        signal = signal + _EDGE * np.abs(np.gradient(paved, axis=1))
    return np.asarray(signal, dtype=np.float32)


def _shear_profiles(block: Grid) -> Float:
    """Return the mean profile (shears, U) of a stretch (rows, U) under each shear of `_SHEARS`."""
    middle = 0.5 * (len(block) - 1)
    result = np.zeros((len(_SHEARS), block.shape[1]))
    for number, shear in enumerate(_SHEARS):
        for row, values in enumerate(block):
            result[number] += np.roll(values, -round(shear * (row - middle) * SPACING / ACROSS))
    return result / len(block)


def _fit_in_order(blocks: list[Float], fits: list[_Fit], order: range, reference: int) -> None:
    """Fit stretch after stretch to a running template of those before, and write the fits into ``fits``, in place.

    Args:
        blocks: mean profiles (shears, U) of each stretch.
        fits: fit of each stretch, filled here.
        order: indices of the stretches, outwards from the reference.
        reference: index of the stretch that the template begins with.
    """
    if not len(order):
        return
    sign = order.step
    template = _shift_profile(blocks[reference], fits[reference])
    latest_fit, search_reach = fits[reference], _REACH
    distance = 0
    for index in order:
        distance += 1
        expected_shift = latest_fit.shift + sign * distance * STEP * SPACING * latest_fit.shear
        fit = _fit_to(blocks[index], template, expected_shift, search_reach)
        if fit is None:
            search_reach = min(search_reach + _LOOSE, 3.0 * _REACH)
            continue
        fits[index] = fit
        template = _MEMORY * template + (1.0 - _MEMORY) * _shift_profile(blocks[index], fit)
        latest_fit, search_reach, distance = fit, _REACH, 0


def _shift_profile(block: Float, fit: _Fit) -> Float:
    """Return a stretch's mean profile (U,) under a fit's shear, moved back by the fit's shift."""
    number = int(np.abs(_SHEARS - fit.shear).argmin())
    return np.roll(block[number], -round(fit.shift / ACROSS))


def _fit_to(block: Float, template: Float, expected_shift: float, reach: float) -> _Fit | None:
    """Return the shift and shear that fit a stretch to a template best; None if both aren't alike.

    Args:
        block: (shears, U) mean profiles of the stretch.
        template: (U,) profile to fit to.
        expected_shift: m.
        reach: distance from it within which shifts are tried, m.
    """
    bins = int(np.ceil(reach / ACROSS))
    middle = round(expected_shift / ACROSS)
    shifts = np.arange(middle - bins, middle + bins + 1)
    # Cross-correlation of the profile under each shear with the template, at each shift.
    scores = np.array([np.roll(block, -shift, axis=1) @ template for shift in shifts])
    relative_distance = (shifts * ACROSS - expected_shift) / reach
    # A parabola in the distance from what was expected: of places as good the nearest is taken.
    penalised_scores = scores - _PRIOR * float(scores.max()) * relative_distance[:, None] ** 2
    best_shift, shear = np.unravel_index(int(penalised_scores.argmax()), penalised_scores.shape)
    # Normalised cross-correlation: scores / (|block| |template|). Below 0.3 (chosen) both aren't alike.
    size = float(np.sqrt((block[shear] ** 2).sum() * (template**2).sum()))
    if size <= 0.0 or scores[best_shift, shear] < 0.3 * size:
        return None
    return _Fit(float(shifts[best_shift] * ACROSS), float(_SHEARS[shear]), float(scores[best_shift, shear] / size))


def median_profile(values: Grid | Float, stretch: int) -> Float:
    """Return the median profile (U,) of the rows about a stretch's middle; NaN where too few have points."""
    middle = stretch * STRETCH + STRETCH // 2
    return median_of_rows(values[max(0, middle - ROWS) : middle + ROWS + 1].astype(np.float64))


def median_of_rows(rows: Float) -> Float:
    """Return the median profile (U,) of some rows (R, U); NaN where too few have points."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # bins without points
        median = np.nanmedian(rows, axis=0)
    return np.where(np.isfinite(rows).sum(axis=0) >= _FEWEST_ROWS, median, np.nan)


def remove_grade(height: Grid) -> Float:
    """Return heights (S, U) less their row's median, which removes the road's grade."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # rows without points
        return np.asarray(height - np.nanmedian(height, axis=1)[:, None], dtype=np.float64)
