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
"""Edge of the squares, m."""
FEWEST = 16
"""Points of a square that is looked at."""
_FEWEST_SQUARES = 20
_LEVELS = 12
"""Groups of brightness between which the range noise is compared."""
_DECIBEL = np.log(10.0) / 10.0
_COEFFICIENTS = 6
_FULL = 65_535.0
_MOST_BITS = 16
_RANGE_FACTOR = 1.5
_PAUSE = 5.0
"""Strips are parted by so many seconds without a point of the pavement."""
_FEWEST_OF_STRIP = 6
_MOST_STRIPS = 100_000
_LEAST_COSINE = 0.02
_RING_DEG = 0.1
"""Rings of a head are told apart by this much of their elevation."""
_FEWEST_OF_RING, _FEWEST_RINGS = 30, 6
_OUTLIER, _LARGEST_DELAY = 4.0, 0.9
"""Residuals beyond so many interquartile ranges are of kerbs and cars, not of the sensor; largest share of a delay."""
_SPEED_OF_PULSES = 2.0
"""Consecutive pulses lie nearer to each other than so many times their usual distance."""


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
    time = road.time
    strip = None if time is None else _strips(time)
    rows, squares = _squares_of(road.place, level, np.zeros(len(level), dtype=np.int64) if strip is None else strip)
    cosine = np.cos(np.broadcast_to(incidence, len(level)))[rows]
    ranged = squares.height / np.maximum(cosine, _LEAST_COSINE)
    told = strip_pairs(road.place[rows, :2], squares.owner, ranged, squares.level, EDGE) if strip is None else None
    # What the parabola follows of a point's own deviation is lost to the covariance with its brightness.
    shared = float(np.mean(ranged * squares.level)) / np.sqrt(1.0 - squares.fitted)
    strips = 1 if strip is None else int(strip.max()) + 1
    if told is not None:
        step, speckle = told.gain_step, float(np.sqrt(told.noise)) * _DECIBEL
        strips, shared = told.strips, told.covariance
    else:
        step, speckle = _gain_and_speckle(road.place[rows], squares, strip is None)
    if strip is not None:
        step = _gain_step(road.place, level, strip)
    azimuth_step, gains = (None, None) if scanner is None else _rings(road.place - scanner, level)
    steady, faint = _range_noise(ranged, squares)
    walk = shared / max((speckle / _DECIBEL) ** 2, 1e-12)
    density = _density(road.place)
    known = np.broadcast_to(np.asarray(distance, dtype=np.float64), len(level))
    return SensorEstimate(
        squares=squares.count,
        range_sigma=steady,
        faint_range_sigma=faint,
        range_walk=max(walk, 0.0),
        range_delay=_range_delay(ranged, squares.fitted),
        speckle=speckle,
        gain_step_db=step,
        range_exponent=_range_exponent(level, known),
        bits=number_bits(road.intensity),
        zeros=road.zeros / max(road.zeros + len(level), 1),
        density=density,
        strips=strips,
        distance=float(np.median(known)) if np.isfinite(known).all() else None,
        incidence=float(np.median(incidence)),
        pulse_spacing=_pulse_spacing(road.place, time, density, strips) if scanner is None else None,
        azimuth_step=azimuth_step,
        laser_gain_db=gains,
    )


def _strips(time: Float) -> Index:
    """Return the strip (N,) of points by their times, s: strips are parted by pauses."""
    order = np.argsort(time, kind="stable")
    strip = np.empty(len(time), dtype=np.int64)
    strip[order] = np.cumsum(np.diff(time[order], prepend=time[order[0]]) > _PAUSE)
    return strip


def _squares_of(place: Float, level: Float, strip: Index) -> tuple[Index, _Squares]:
    """Return the points of one strip each in squares of `FEWEST` or more, and what is left of them there."""
    cell = np.column_stack([np.floor(place[:, :2] / EDGE).astype(np.int64), strip])
    _, owner, count = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    owner = owner.ravel()
    order = np.argsort(owner, kind="stable")
    groups = [rows for rows in np.split(order, np.cumsum(count)[:-1]) if len(rows) >= FEWEST]
    if len(groups) < _FEWEST_SQUARES:
        found = f"{len(groups)} squares of {EDGE:g} m with {FEWEST} points of pavement"
        allowed = f"has {found}; {_FEWEST_SQUARES} are needed"
        raise InputError("--real", None, allowed)
    height = [_about_parabola(place[rows]) for rows in groups]
    levels = [(level[rows] - level[rows].mean()) * np.sqrt(len(rows) / (len(rows) - 1.0)) for rows in groups]
    number = np.repeat(np.arange(len(groups)), [len(rows) for rows in groups])
    fitted = _COEFFICIENTS * len(groups) / len(number)
    return np.concatenate(groups), _Squares(number, np.concatenate(height), np.concatenate(levels), len(groups), fitted)


def _about_parabola(place: Float) -> Float:
    """Return the heights (N,) of points (N, 3) about their parabola, m, scaled to the variance of single points."""
    x, y, z = (place - place.mean(axis=0)).T
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)
    rest = z - terms @ np.linalg.lstsq(terms, z, rcond=None)[0]
    return np.asarray(rest * np.sqrt(len(z) / (len(z) - float(_COEFFICIENTS))))


def _range_noise(ranged: Float, squares: _Squares) -> tuple[float, float]:
    """Return the standard deviations of a range: of bright echoes, and what one of the median power has besides, m.

    A residual's variance is that of its own point to the share 1 - h, and the mean of all to the share h that the
    parabola follows: the slope over 1 / power^2 is too small by 1 - h.
    """
    level = squares.level
    edges = np.quantile(level, np.linspace(0.0, 1.0, _LEVELS + 1))
    group = np.clip(np.searchsorted(edges, level, side="right") - 1, 0, _LEVELS - 1)
    power = 10.0 ** (-2.0 * level / 10.0)
    weakness = np.bincount(group, power) / np.bincount(group)
    # Deviations by quartiles: single points on kerbs and cars don't count.
    spread = [float(np.subtract(*np.quantile(ranged[group == number], (0.75, 0.25)))) for number in range(_LEVELS)]
    variance = (np.array(spread) / 1.349) ** 2
    # Of as many points each, a variance is known to a share of itself.
    slope = float(np.polyfit(weakness, variance, 1, w=1.0 / np.maximum(variance, 1e-18))[0])
    slope = min(max(slope / (1.0 - squares.fitted), 0.0), float(np.mean(variance)))
    steady = max(float(np.mean(variance - slope * weakness)), 0.0)
    return float(np.sqrt(steady)), float(np.sqrt(slope))


def _range_delay(ranged: Float, fitted: float) -> float:
    """Return the share of the residuals' (N,) standard deviation that is an exponential delay, by their skewness.

    Of a point's own deviation the share ``fitted`` is lost to the parabola: of its cube three times as much as of its
    square.
    """
    quartiles = np.quantile(ranged, (0.25, 0.75))
    inner = ranged[np.abs(ranged) < _OUTLIER * float(np.diff(quartiles)[0])]
    skew = float(np.mean((inner - inner.mean()) ** 3)) / max(float(inner.std()) ** 3, 1e-30) / (1.0 - fitted) ** 1.5
    return float(np.clip(np.cbrt(-skew / 2.0), 0.0, _LARGEST_DELAY))


def _gain_step(place: Float, level: Float, strip: Index) -> float:
    """Return how far the brightness of two strips differs in one square, root mean square, dB; 0 of a single strip."""
    cell = np.floor(place[:, :2] / EDGE).astype(np.int64)
    rows, owner, count = np.unique(np.column_stack([cell, strip]), axis=0, return_inverse=True, return_counts=True)
    mean = np.bincount(owner.ravel(), level) / count
    many = count >= _FEWEST_OF_STRIP
    rows, mean = rows[many], mean[many]
    same = np.flatnonzero((np.diff(rows[:, :2], axis=0) == 0).all(axis=1))
    if not len(same):
        return 0.0
    apart = np.diff(mean)[same]
    pairs = rows[same, 2] * _MOST_STRIPS + rows[same + 1, 2]
    steps = [float(np.median(apart[pairs == pair])) for pair in np.unique(pairs)]
    return float(np.sqrt(np.mean(np.square(steps))))


def _gain_and_speckle(place: Float, squares: _Squares, mixed: bool) -> tuple[float, float]:
    """Return the step of the gain between strips, dB, and the relative standard deviation of the speckle.

    Args:
        place: (N, 3) m.
        squares: with the points' brightness.
        mixed: whether squares hold points of several strips, for all that is known.
    """
    variance = float(np.mean(squares.level**2))
    excess = float(np.mean(squares.level**4)) / variance**2 - 3.0
    half = (max(-excess, 0.0) / 2.0) ** 0.25 * np.sqrt(variance) if mixed else 0.0
    apart = _neighbour_steps(place, squares)
    noise = max(0.5 * float(np.mean(apart**2)) - half**2, 0.0)
    return 2.0 * float(half), float(np.sqrt(noise)) * _DECIBEL


def _neighbour_steps(place: Float, squares: _Squares) -> Float:
    """Return the difference (N,) of each point's brightness to that of its nearest one in the same square, dB."""
    begins = np.flatnonzero(np.diff(squares.owner, prepend=-1))
    steps = []
    for first, end in zip(begins, np.append(begins[1:], len(squares.owner)), strict=True):
        x, y = (place[first:end, axis] - place[first, axis] for axis in (0, 1))
        apart = (x[:, None] - x) ** 2 + (y[:, None] - y) ** 2
        np.fill_diagonal(apart, np.inf)
        level = squares.level[first:end]
        steps.append(level[apart.argmin(axis=1)] - level)
    return np.concatenate(steps)


def _rings(place: Float, level: Float) -> tuple[float | None, float | None]:
    """Return a head's step of the azimuth, rad, and the standard deviation of its lasers' gains, dB; None of too few.

    Args:
        place: (N, 3) from the scanner, m.
        level: (N,) brightness, dB.
    """
    azimuth, flat = np.arctan2(place[:, 1], place[:, 0]), np.hypot(place[:, 0], place[:, 1])
    ring = np.floor(np.rad2deg(np.arctan2(place[:, 2], flat)) / _RING_DEG).astype(np.int64)
    steps, middles = [], []
    for number in np.unique(ring):
        mine = np.flatnonzero(ring == number)
        if len(mine) >= _FEWEST_OF_RING:
            steps.append(np.diff(np.sort(azimuth[mine])))
            middles.append(float(np.median(level[mine])))
    if len(middles) < _FEWEST_RINGS:
        return None, None
    # Neighbouring rings differ by their lasers; how the brightness goes with the range is taken off.
    apart = np.diff(np.array(middles), 2) / np.sqrt(6.0)
    return float(np.median(np.concatenate(steps))), float(np.sqrt(np.mean(apart**2)))


def _range_exponent(level: Float, distance: Float) -> float | None:
    """Return the power of the range that the brightness goes with; None where ranges hardly differ."""
    low, high = np.quantile(distance, (0.05, 0.95))
    if not np.isfinite(distance).all() or high < _RANGE_FACTOR * low:
        return None
    return float(np.polyfit(np.log10(distance), level, 1)[0] / 10.0)


def number_bits(stored: Float) -> int | None:
    """Return the bits of stored numbers (N,), shares of 65535, by the steps between those that occur; None if 16."""
    values = np.unique(np.rint(stored))
    steps = np.diff(values)
    if len(steps) < 2:
        return None
    step = float(np.quantile(steps, 0.05))
    bits = round(float(np.log2(_FULL / max(step, 1.0) + 1.0)))
    return bits if bits < _MOST_BITS else None


def _density(place: Float) -> float:
    """Return the points to the m2 of cells of 1 m whose neighbours hold points as well."""
    cell = np.floor(place[:, :2]).astype(np.int64)
    cells, count = np.unique(cell, axis=0, return_counts=True)
    keys = {tuple(row) for row in cells.tolist()}
    around = ((1, 0), (-1, 0), (0, 1), (0, -1))
    inner = [all((x + a, y + b) in keys for a, b in around) for x, y in cells.tolist()]
    return float(count[np.array(inner)].mean()) if any(inner) else float(count.mean())


def _pulse_spacing(place: Float, time: Float | None, density: float, strips: int) -> float | None:
    """Return the distance on the ground between consecutive pulses, m; None where neither times nor places tell."""
    by_time = None if time is None else pulse_spacing(place, time)
    return pulse_step(place, density, strips) if by_time is None else by_time


def pulse_spacing(place: AnyArray, time: Float) -> float | None:
    """Return the distance on the ground between consecutive pulses, m; None where times don't tell."""
    order = np.argsort(time, kind="stable")
    interval = np.diff(time[order])
    positive = interval[interval > 0.0]
    if len(positive) < FEWEST:
        return None
    usual = float(np.quantile(positive, 0.1))
    next_ = np.flatnonzero((interval > 0.0) & (interval < _SPEED_OF_PULSES * usual))
    step = np.linalg.norm(np.diff(place[order, :2], axis=0)[next_], axis=1)
    return float(np.median(step)) if len(step) >= FEWEST else None
