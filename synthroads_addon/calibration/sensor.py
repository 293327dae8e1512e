"""A sensor's response, noise and point spacing from a cloud of pavement: what the materials don't explain.

Pavement is even within a metre or two, so that what varies there is the sensor's. All estimates are moments of the
points within squares of `EDGE`, whose parabola and mean brightness are taken off:

- **range noise**: the residuals' variance over 1 / power^2, a straight line: the sum of a part that all echoes have and
  one that grows as they fade (`scanning.receiving.range_noise`). Residuals are along the vertical; they are the range's
  over the cosine of the incidence angle.
- **speckle**: half the mean squared difference of neighbours' brightness in dB. Points with times are compared within
  their strip, which ends where nothing is recorded for `_PAUSE`, and the gain's step between strips is how far their
  means in one square differ. Without times the pairs of points say how many strips there are, how far these differ,
  and what is left to single echoes (`strip_pairs`). Where points lie at random, the step follows from the kurtosis of
  the brightness: two normal distributions apart by G have an excess kurtosis of -2 (G / 2)^4 over their variance
  squared.
- **range walk**: the residuals' covariance with the brightness over the speckle's variance.
- **range delay**: the residuals' skewness, -2 q^3 with the share q of their standard deviation that is a delay.
- **range exponent**: the slope of the median brightness over the logarithm of the range, where ranges differ by a
  factor of 1.5; it tells numbers that are compensated for the range from the received power.
- **steps**: the bits of the numbers, from the smallest step between those that occur.
- **zeros**: the share of points without a number, of the nearer half of all.
- **spacing**: points to the square metre; the distance between consecutive pulses, by times or by lines
  (`pulse_lines`); of a head that turns about one place, the median step of the azimuth within rings of like
  elevation, and by how much the brightness of rings differs: the gains of its lasers.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..base.arrays import AnyArray, Float, Index
from ..base.errors import InputError
from ..cloud.selection.classes import RealClass
from .pulse_lines import pulse_step
from .strip_pairs import strip_pairs

EDGE = 1.5
"""Edge of the squares, m. Chosen: pavement is a parabola, and even in brightness, over so little."""
FEWEST = 16
"""Points of a square that is looked at. Chosen: well over the six coefficients of its parabola."""
_FEWEST_SQUARES = 20
"""Squares that are needed. Chosen: moments of 320 points or more."""
_LEVELS = 12
"""Groups of brightness between which the range noise is compared. Chosen: enough for a straight line through them."""
_DECIBEL = np.log(10.0) / 10.0
"""Natural logarithm of the power's factor in one dB, by which small deviations in dB become relative ones."""
_NORMAL_IQR = 1.349
"""Interquartile range of a normal distribution over its standard deviation: 2 x 0.6745."""
_COEFFICIENTS = 6
"""Of a parabola over x and y: 1, x, y, x^2, x y, y^2."""
_FULL = 65_535.0
"""Largest number of LAS intensities, which have 16 bits."""
_MOST_BITS = 16
"""Bits of LAS intensities."""
_RANGE_FACTOR = 1.5
"""Factor that the 95th percentile of the ranges must be over the 5th for their exponent. Chosen: 3.5 dB for 1 / r^2."""
_PAUSE = 5.0
"""Strips are parted by so many seconds without a point of the pavement. Chosen: a turn takes longer."""
_FEWEST_OF_STRIP = 6
"""Points of a strip in a square whose mean is compared with another strip's. Chosen: speckle averages out in them."""
_MOST_STRIPS = 100_000
"""Strips that have numbers. Chosen: two of them make one integer."""
_LEAST_COSINE = 0.02
"""Least cosine of an incidence angle. Chosen: 89 degrees, beyond which no pavement is seen."""
_RING_DEG = 0.1
"""Rings of a head are told apart by this much of their elevation, deg. Chosen: those of most heads are farther
apart."""
_FEWEST_OF_RING, _FEWEST_RINGS = 30, 6
"""Points of a ring, and rings, that are needed. Chosen: for a median of each, and for second differences of these."""
_OUTLIER = 4.0
"""Residuals beyond so many interquartile ranges are of kerbs and cars. Chosen: 5.4 standard deviations of a
sensor's."""
_LARGEST_DELAY = 0.9
"""Largest share of the range's deviation that is a delay. Chosen: some of every range noise is symmetric."""
_SPEED_OF_PULSES = 2.0
"""Times of consecutive pulses differ by less than so many times the usual interval. Chosen: one missing is twice."""
_STEP_QUANTILE = 0.05
"""Quantile of the steps between stored numbers that is one step. Chosen: where some values don't occur steps are
longer."""
_INTERVAL_QUANTILE = 0.1
"""Quantile of the intervals between times that is one pulse's. Chosen: gaps make others longer."""


@dataclass(frozen=True)
class SensorEstimate:
    """Properties of a sensor, estimated from pavement.

    Attributes:
        squares: of pavement that were looked at.
        range_sigma: standard deviation of the range of bright echoes, m.
        faint_range_sigma: what the range of an echo at the median brightness has besides, m.
        range_walk: m by which an echo is ranged nearer for each dB of speckle.
        range_delay: share of the range's standard deviation that is an exponential delay.
        speckle: relative standard deviation of the power.
        gain_step_db: between overlapping strips, dB.
        range_exponent: power of the range that the brightness goes with; None where ranges hardly differ.
        bits: of the numbers; None where they have no steps.
        zeros: share of the points without a number.
        density: points to the m2.
        strips: that overlap, as times or pairs of points tell; 1 if neither does.
        distance: median range, m; None where unknown.
        incidence: median incidence angle, rad.
        pulse_spacing: between consecutive pulses on the ground, m, by times or by how points lie; None where neither
            tells, or of a head that stands.
        azimuth_step: of a head's firing sequences, rad; None where nobody says from where all was seen.
        laser_gain_db: standard deviation of the gains of a head's lasers, dB; likewise.
    """

    squares: int
    range_sigma: float
    faint_range_sigma: float
    range_walk: float
    range_delay: float
    speckle: float
    gain_step_db: float
    range_exponent: float | None
    bits: int | None
    zeros: float
    density: float
    strips: int
    distance: float | None
    incidence: float
    pulse_spacing: float | None
    azimuth_step: float | None = None
    laser_gain_db: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return the estimates as JSON data, numbers to four digits."""
        values = asdict(self)
        return {name: float(f"{value:.4g}") if isinstance(value, float) else value for name, value in values.items()}


@dataclass(frozen=True)
class _Squares:
    """Points (N,) of pavement in squares, with what is left of height and brightness there.

    Attributes:
        owner: (N,) square of each.
        height: (N,) residual about the square's parabola, m, with the variance of single points.
        level: (N,) brightness from the square's mean, dB, likewise.
        count: of squares.
        fitted: share of a point's deviation that the square's parabola follows: its coefficients over its points.
    """

    owner: Index
    height: Float
    level: Float
    count: int
    fitted: float


def estimate_sensor(
    road: RealClass,
    linear: Float,
    distance: Float,
    incidence: Float,
    scanner: Float | None = None,
) -> SensorEstimate:
    """Return what a pavement's points say about the sensor.

    Args:
        road: N points of pavement.
        linear: (N,) received power in any unit, times the squared range: as if all were seen from one range.
        distance: (N,) m, or one usual range.
        incidence: (N,) rad, or one usual angle.
        scanner: (3,) the one place that all was seen from, map, m; None if there is none.

    Raises:
        InputError: too little pavement.
    """
    level = 10.0 * np.log10(np.maximum(linear, 1e-300))
    strip = None if road.time is None else _strips(road.time)
    rows, squares = _squares_of(road.place, level, np.zeros(len(level), dtype=np.int64) if strip is None else strip)
    cosine = np.cos(np.broadcast_to(incidence, len(level)))[rows]
    range_residual = squares.height / np.maximum(cosine, _LEAST_COSINE)
    brightness = _brightness_noise(road.place, level, rows, squares, range_residual, strip)
    azimuth_step, laser_gain_db = (None, None) if scanner is None else _rings(road.place - scanner, level)
    range_sigma, faint_range_sigma = _range_noise(range_residual, squares)
    # Slope of the range over the brightness: cov(range, level) / var(level), of single echoes.
    range_walk = brightness.covariance / max((brightness.speckle / _DECIBEL) ** 2, 1e-12)
    density = _density(road.place)
    ranges = np.broadcast_to(np.asarray(distance, dtype=np.float64), len(level))
    pulses = None if scanner is not None else _pulse_spacing(road.place, road.time, density, brightness.strips)
    return SensorEstimate(
        squares=squares.count,
        range_sigma=range_sigma,
        faint_range_sigma=faint_range_sigma,
        range_walk=max(range_walk, 0.0),
        range_delay=_range_delay(range_residual, squares.fitted),
        speckle=brightness.speckle,
        gain_step_db=brightness.gain_step,
        range_exponent=_range_exponent(level, ranges),
        bits=number_bits(road.intensity),
        zeros=road.zeros / max(road.zeros + len(level), 1),
        density=density,
        strips=brightness.strips,
        distance=float(np.median(ranges)) if np.isfinite(ranges).all() else None,
        incidence=float(np.median(incidence)),
        pulse_spacing=pulses,
        azimuth_step=azimuth_step,
        laser_gain_db=laser_gain_db,
    )


@dataclass(frozen=True)
class _BrightnessNoise:
    """Variation of the brightness between single echoes and between strips.

    Attributes:
        strips: that overlap, as far as known.
        gain_step: between strips, dB.
        speckle: relative standard deviation of the power.
        covariance: of single echoes' range and brightness, m dB.
    """

    strips: int
    gain_step: float
    speckle: float
    covariance: float


def _brightness_noise(
    place: Float, level: Float, rows: Index, squares: _Squares, range_residual: Float, strip: Index | None
) -> _BrightnessNoise:
    """Return the noise of the brightness: by strips where times tell them, else by pairs of points, else by kurtosis.

    Args:
        place: (M, 3) of all points, m.
        level: (M,) brightness, dB.
        rows: (N,) of these in squares.
        squares: of these N points.
        range_residual: (N,) m.
        strip: (M,) of each point; None where times don't tell.
    """
    # What the parabola follows of a point's own deviation is lost to the covariance with its brightness.
    covariance = float(np.mean(range_residual * squares.level)) / np.sqrt(1.0 - squares.fitted)
    if strip is not None:
        _, speckle = _gain_and_speckle(place[rows], squares, False)
        return _BrightnessNoise(int(strip.max()) + 1, _gain_step(place, level, strip), speckle, covariance)
    pairs = strip_pairs(place[rows, :2], squares.owner, range_residual, squares.level, EDGE)
    if pairs is not None:
        return _BrightnessNoise(pairs.strips, pairs.gain_step, float(np.sqrt(pairs.noise)) * _DECIBEL, pairs.covariance)
    return _BrightnessNoise(1, *_gain_and_speckle(place[rows], squares, True), covariance)


def _strips(time: Float) -> Index:
    """Return the strip (N,) of points by their times (N,), s: a pause of `_PAUSE` parts two strips."""
    order = np.argsort(time, kind="stable")
    strip = np.empty(len(time), dtype=np.int64)
    strip[order] = np.cumsum(np.diff(time[order], prepend=time[order[0]]) > _PAUSE)
    return strip


def _squares_of(place: Float, level: Float, strip: Index) -> tuple[Index, _Squares]:
    """Return the rows (M,) of points in squares with `FEWEST` points of one strip or more, and their residuals.

    Args:
        place: (N, 3) m.
        level: (N,) brightness, dB.
        strip: (N,) of each point.

    Raises:
        InputError: there are too few such squares.
    """
    cell = np.column_stack([np.floor(place[:, :2] / EDGE).astype(np.int64), strip])
    _, owner, count = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    owner = owner.ravel()
    order = np.argsort(owner, kind="stable")
    groups = [rows for rows in np.split(order, np.cumsum(count)[:-1]) if len(rows) >= FEWEST]
    if len(groups) < _FEWEST_SQUARES:
        count_text = f"{len(groups)} squares of {EDGE:g} m with {FEWEST} points of pavement"
        raise InputError("--real", None, f"has {count_text}; {_FEWEST_SQUARES} are needed")
    height = [_about_parabola(place[rows]) for rows in groups]
    # n / (n - 1): the mean that is taken off is of the same points.
    levels = [(level[rows] - level[rows].mean()) * np.sqrt(len(rows) / (len(rows) - 1.0)) for rows in groups]
    number = np.repeat(np.arange(len(groups)), [len(rows) for rows in groups])
    parabola_share = _COEFFICIENTS * len(groups) / len(number)
    return np.concatenate(groups), _Squares(
        number, np.concatenate(height), np.concatenate(levels), len(groups), parabola_share
    )


def _about_parabola(place: Float) -> Float:
    """Return the heights (N,) of points (N, 3) about their parabola, m, scaled to the variance of single points."""
    x, y, z = (place - place.mean(axis=0)).T
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)
    residual = z - terms @ np.linalg.lstsq(terms, z, rcond=None)[0]
    # Var(residual) = sigma^2 (n - p) / n on average, of n points and p coefficients.
    return np.asarray(residual * np.sqrt(len(z) / (len(z) - float(_COEFFICIENTS))))


def _range_noise(range_residual: Float, squares: _Squares) -> tuple[float, float]:
    """Return the standard deviations of a range: of bright echoes, and what one of the median power has besides, m.

    A residual's variance is that of its own point to the share 1 - h, and the mean of all to the share h that the
    parabola follows: the slope over 1 / power^2 is too small by 1 - h.
    """
    level = squares.level
    edges = np.quantile(level, np.linspace(0.0, 1.0, _LEVELS + 1))
    group = np.clip(np.searchsorted(edges, level, side="right") - 1, 0, _LEVELS - 1)
    # sigma^2(range) = a^2 + b^2 / P^2, with the power P over its median.
    inverse_power2 = 10.0 ** (-2.0 * level / 10.0)
    inverse_power2 = np.bincount(group, inverse_power2) / np.bincount(group)
    # Deviations by quartiles: single points on kerbs and cars don't count.
    quartiles = [np.quantile(range_residual[group == number], (0.75, 0.25)) for number in range(_LEVELS)]
    iqr = [float(np.subtract(*pair)) for pair in quartiles]
    variance = (np.array(iqr) / _NORMAL_IQR) ** 2
    # Of as many points each, a variance is known to a share of itself.
    b2 = float(np.polyfit(inverse_power2, variance, 1, w=1.0 / np.maximum(variance, 1e-18))[0])
    b2 = min(max(b2 / (1.0 - squares.fitted), 0.0), float(np.mean(variance)))
    a2 = max(float(np.mean(variance - b2 * inverse_power2)), 0.0)
    return float(np.sqrt(a2)), float(np.sqrt(b2))


def _range_delay(range_residual: Float, parabola_share: float) -> float:
    """Return the share of the residuals' (N,) standard deviation that is an exponential delay, by their skewness.

    Of a point's own deviation the share ``parabola_share`` is lost to the parabola: of its cube three times as much as
    of its square.
    """
    iqr = float(np.diff(np.quantile(range_residual, (0.25, 0.75)))[0])
    inliers = range_residual[np.abs(range_residual) < _OUTLIER * iqr]
    third_moment = float(np.mean((inliers - inliers.mean()) ** 3))
    skewness = third_moment / max(float(inliers.std()) ** 3, 1e-30) / (1.0 - parabola_share) ** 1.5
    # An exponential distribution's third moment is twice its deviation cubed; late echoes lie lower: skewness = -2 q^3.
    return float(np.clip(np.cbrt(-skewness / 2.0), 0.0, _LARGEST_DELAY))


def _gain_step(place: Float, level: Float, strip: Index) -> float:
    """Return how far the brightness of two strips differs in one square, root mean square, dB; 0 of a single strip.

    Args:
        place: (N, 3) m.
        level: (N,) brightness, dB.
        strip: (N,) of each point.
    """
    cell = np.floor(place[:, :2] / EDGE).astype(np.int64)
    rows, owner, count = np.unique(np.column_stack([cell, strip]), axis=0, return_inverse=True, return_counts=True)
    mean = np.bincount(owner.ravel(), level) / count
    is_dense = count >= _FEWEST_OF_STRIP
    rows, mean = rows[is_dense], mean[is_dense]
    # Rows (x, y, strip) are sorted by square, then strip: neighbours in the same square are two strips in it.
    pair_rows = np.flatnonzero((np.diff(rows[:, :2], axis=0) == 0).all(axis=1))
    if not len(pair_rows):
        return 0.0
    difference = np.diff(mean)[pair_rows]
    # One number for each pair of strips, whose squares' median is taken.
    strip_pair = rows[pair_rows, 2] * _MOST_STRIPS + rows[pair_rows + 1, 2]
    steps = [float(np.median(difference[strip_pair == pair])) for pair in np.unique(strip_pair)]
    return float(np.sqrt(np.mean(np.square(steps))))


def _gain_and_speckle(place: Float, squares: _Squares, strips_mixed: bool) -> tuple[float, float]:
    """Return the step of the gain between strips, dB, and the relative standard deviation of the speckle.

    Args:
        place: (N, 3) m.
        squares: with the points' brightness.
        strips_mixed: whether squares hold points of several strips, for all that is known.
    """
    variance = float(np.mean(squares.level**2))
    excess_kurtosis = float(np.mean(squares.level**4)) / variance**2 - 3.0
    # Two normal distributions G apart: excess kurtosis = -2 (G / 2)^4 / variance^2.
    half_gain = (max(-excess_kurtosis, 0.0) / 2.0) ** 0.25 * np.sqrt(variance) if strips_mixed else 0.0
    difference = _neighbour_steps(place, squares)
    # Half the mean square difference is the speckle's variance, and (G / 2)^2 more where neighbours are of any strip.
    speckle_db2 = max(0.5 * float(np.mean(difference**2)) - half_gain**2, 0.0)
    return 2.0 * float(half_gain), float(np.sqrt(speckle_db2)) * _DECIBEL


def _neighbour_steps(place: Float, squares: _Squares) -> Float:
    """Return the difference (N,) of each point's brightness to that of its nearest one in the same square, dB.

    Args:
        place: (N, 3) of the squares' points, square by square, m.
        squares: with the points' brightness.
    """
    begins = np.flatnonzero(np.diff(squares.owner, prepend=-1))
    ends = np.append(begins[1:], len(squares.owner))
    steps = []
    for begin, end in zip(begins, ends, strict=True):
        # From the first point: map coordinates squared would leave few digits to their differences.
        x, y = (place[begin:end, axis] - place[begin, axis] for axis in (0, 1))
        distance2 = (x[:, None] - x) ** 2 + (y[:, None] - y) ** 2
        np.fill_diagonal(distance2, np.inf)
        level = squares.level[begin:end]
        steps.append(level[distance2.argmin(axis=1)] - level)
    return np.concatenate(steps)


def _rings(place: Float, level: Float) -> tuple[float | None, float | None]:
    """Return a head's step of the azimuth, rad, and the standard deviation of its lasers' gains, dB; None of too few.

    Args:
        place: (N, 3) from the scanner, m.
        level: (N,) brightness, dB.
    """
    azimuth, horizontal = np.arctan2(place[:, 1], place[:, 0]), np.hypot(place[:, 0], place[:, 1])
    ring = np.floor(np.rad2deg(np.arctan2(place[:, 2], horizontal)) / _RING_DEG).astype(np.int64)
    steps, medians = [], []
    for number in np.unique(ring):
        rows = np.flatnonzero(ring == number)
        if len(rows) >= _FEWEST_OF_RING:
            steps.append(np.diff(np.sort(azimuth[rows])))
            medians.append(float(np.median(level[rows])))
    if len(medians) < _FEWEST_RINGS:
        return None, None
    # Second differences take off how the brightness goes with the range; the variance of a - 2 b + c is six times that
    # of one laser's gain.
    gain = np.diff(np.array(medians), 2) / np.sqrt(6.0)
    return float(np.median(np.concatenate(steps))), float(np.sqrt(np.mean(gain**2)))


def _range_exponent(level: Float, distance: Float) -> float | None:
    """Return the power of the range that the brightness goes with; None where ranges hardly differ."""
    nearest_range, farthest_range = np.quantile(distance, (0.05, 0.95))
    if not np.isfinite(distance).all() or farthest_range < _RANGE_FACTOR * nearest_range:
        return None
    # level = 10 n log10(range) + constant.
    return float(np.polyfit(np.log10(distance), level, 1)[0] / 10.0)


def number_bits(stored_numbers: Float) -> int | None:
    """Return the bits of stored numbers (N,), shares of 65535, by the steps between those that occur; None if 16."""
    values = np.unique(np.rint(stored_numbers))
    steps = np.diff(values)
    if len(steps) < 2:
        return None
    step = float(np.quantile(steps, _STEP_QUANTILE))
    # Of b bits that fill 65535 the step is 65535 / (2^b - 1).
    bits = round(float(np.log2(_FULL / max(step, 1.0) + 1.0)))
    return bits if bits < _MOST_BITS else None


def _density(place: Float) -> float:
    """Return the points per m2 of cells of 1 m whose four neighbours hold points too, of all cells if there is none."""
    cell = np.floor(place[:, :2]).astype(np.int64)
    cells, count = np.unique(cell, axis=0, return_counts=True)
    keys = {tuple(row) for row in cells.tolist()}
    sides = ((1, 0), (-1, 0), (0, 1), (0, -1))
    is_inner = [all((x + a, y + b) in keys for a, b in sides) for x, y in cells.tolist()]
    return float(count[np.array(is_inner)].mean()) if any(is_inner) else float(count.mean())


def _pulse_spacing(place: Float, time: Float | None, density: float, strips: int) -> float | None:
    """Return the distance on the ground between consecutive pulses, m; None where neither times nor places tell it.

    Args:
        place: (N, 3) m.
        time: (N,) s; None without.
        density: of the points, 1/m2.
        strips: that overlap.
    """
    spacing = None if time is None else pulse_spacing(place, time)
    return pulse_step(place, density, strips) if spacing is None else spacing


def pulse_spacing(place: AnyArray, time: Float) -> float | None:
    """Return the distance on the ground between consecutive pulses, m; None where times don't tell it.

    Args:
        place: (N, 2 or more) m.
        time: (N,) s.
    """
    order = np.argsort(time, kind="stable")
    interval = np.diff(time[order])
    positive = interval[interval > 0.0]
    if len(positive) < FEWEST:
        return None
    pulse_interval = float(np.quantile(positive, _INTERVAL_QUANTILE))
    consecutive = np.flatnonzero((interval > 0.0) & (interval < _SPEED_OF_PULSES * pulse_interval))
    step = np.linalg.norm(np.diff(place[order, :2], axis=0)[consecutive], axis=1)
    return float(np.median(step)) if len(step) >= FEWEST else None
