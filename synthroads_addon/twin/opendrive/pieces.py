"""Functions of the station as OpenDRIVE holds them: cubics or straight lines, piece by piece."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]
Function = Callable[[Float], Float]
"""Stations (N,) -> values (N, F)."""

CLOSE = 1e-6
"""Stations closer than this (m) are one, and widths (m) below it none: the standard's checker has the same limit."""
_EXACT = 1e-8  # m, of a cubic from the function that it stands for
_TAKEN_FOR_ONE = 1e-6
_SAME = 5e-7  # m, between a cubic and the one before it, if that is to go on in its place
_STEP_DIGITS = 10  # decimals (m) of what a coefficient adds to a width
_SHORTEST = 1e-4  # m
_LONGEST = 8.0  # m, of a chord before it is looked at: a wave isn't to be met at its nodes only
_SHARES = np.array([0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0, 0.08, 0.5, 0.92])


@dataclass(frozen=True)
class Cubics:
    """Piecewise cubic polynomials of the station, F functions on common pieces.

    Attributes:
        borders: (P + 1,) stations at which pieces begin, and the end of the last.
        coefficients: (P, F, 4) a, b, c, d over the distance from a piece's beginning.
    """

    borders: Float
    coefficients: Float

    def at(self, station: Float) -> Float:
        """Return the values (N,) of the first function at stations (N,)."""
        piece = self._piece(station)
        return value_of_cubic(self.coefficients[piece, 0], station - self.borders[piece])

    def slope(self, station: Float) -> Float:
        """Return the derivatives (N,) of the first function at stations (N,), at a border the next piece's."""
        piece = self._piece(station)
        _, b, c, d = self.coefficients[piece, 0].T
        u = station - self.borders[piece]
        return np.asarray(b + u * (2.0 * c + 3.0 * d * u))

    def _piece(self, station: Float) -> NDArray[np.intp]:
        """Return the index (N,) of the piece at each station, the first or last piece beyond the ends."""
        return np.clip(np.searchsorted(self.borders, station, side="right") - 1, 0, len(self.borders) - 2)

    def at_end(self, piece: int) -> Float:
        """Return the values (F,) of all functions at the end of a piece."""
        return value_of_cubic(self.coefficients[piece], self.borders[piece + 1] - self.borders[piece])


def merged_stations(stations: Iterable[float], start: float, end: float) -> Float:
    """Return `start`, `end` and the stations between, sorted, without those closer than `CLOSE` to another."""
    inner_stations = sorted(s for s in stations if start + CLOSE < s < end - CLOSE)
    merged = [start]
    for station in inner_stations:
        if station - merged[-1] > CLOSE:
            merged.append(station)
    return np.array([*merged, end])


def fit_cubics(function: Function, borders: Float) -> Cubics:
    """Fit piecewise cubics to functions, halving pieces until they agree within 1e-8.

    Args:
        function: the function; where it jumps it has the value of the piece that begins there.
        borders: (P + 1,) stations, increasing, between which it is expected to be smooth.
    """
    while True:
        lengths = np.diff(borders)
        stations = borders[:-1, None] + lengths[:, None] * _SHARES
        stations[:, _SHARES == 1.0] = np.nextafter(borders[1:, None], borders[:-1, None])  # within the piece
        values = function(stations.ravel())
        values = values.reshape(len(lengths), len(_SHARES), -1)
        coefficients = _fit_lowest_degree(values, lengths)
        is_off = np.abs(_sample_cubics(coefficients, lengths) - values).max(axis=(1, 2)) > _EXACT
        is_off &= lengths > _SHORTEST
        if not is_off.any():
            return Cubics(borders, coefficients)
        borders = np.sort(np.append(borders, (borders[:-1] + lengths / 2.0)[is_off]))


def fit_pieces(function: Callable[[Float, NDArray[np.intp]], Float], borders: Float) -> Cubics:
    """Fit one cubic per piece to a function that may jump at borders (P + 1,) and is told the piece's number."""
    lengths = np.diff(borders)
    stations = borders[:-1, None] + lengths[:, None] * _SHARES
    piece = np.repeat(np.arange(len(lengths)), len(_SHARES))
    values = function(stations.ravel(), piece).reshape(len(lengths), len(_SHARES), 1)
    return Cubics(borders, _fit_lowest_degree(values, lengths))


def _fit_lowest_degree(values: Float, length: Float) -> Float:
    """Fit polynomials (P, F, 4 coefficients) of the lowest degree that matches the values, cubic at most."""
    f = values[:, :4].transpose(0, 2, 1)
    f0, f1, f2, f3 = (f[..., i] for i in range(4))
    h = length[:, None]
    slope = (f3 - f0) / h
    zero = np.zeros(f0.shape)
    cubics = _cubic_through(values, length)
    # From the highest degree to the lowest, so that the lowest that fits is left: parabola, line, constant. The
    # parabola's quadratic term is the mean of the second differences of the values at 0, 1/3, 2/3 and 1.
    quadratic = 4.5 * (f0 - f1 - f2 + f3) / (2.0 * h**2)
    for candidate in ((f0, slope - quadratic * h, quadratic, zero), (f0, slope, zero, zero), (f0, zero, zero, zero)):
        trials = np.stack(candidate, axis=-1)
        fits = np.abs(_sample_cubics(trials, length) - values).max(axis=1) <= _EXACT / 10.0
        cubics = np.where(fits[..., None], trials, cubics)
    return _round_coefficients(cubics, length)


def _cubic_through(values: Float, length: Float) -> Float:
    """Return the coefficients (P, F, 4) of the cubics through the values (P, S, F) at each piece's first 4 shares.

    The shares are 0, 1/3, 2/3 and 1 of the piece's length h; the formula is Lagrange's interpolation written out.
    """
    f = values[:, :4].transpose(0, 2, 1)
    f0, f1, f2, f3 = (f[..., i] for i in range(4))
    h = length[:, None]
    cubic = (
        f0,
        (-11.0 * f0 + 18.0 * f1 - 9.0 * f2 + 2.0 * f3) / (2.0 * h),
        9.0 * (2.0 * f0 - 5.0 * f1 + 4.0 * f2 - f3) / (2.0 * h**2),
        9.0 * (f3 - f0 + 3.0 * (f1 - f2)) / (2.0 * h**3),
    )
    return np.stack(cubic, axis=-1)


def _round_coefficients(coefficients: Float, length: Float) -> Float:
    """Round cubic coefficients (P, F, 4) so that each changes the value by 1e-10 at most at a piece's end."""
    result = coefficients.copy()
    for power in (1, 2, 3):
        decimals = np.ceil(_STEP_DIGITS + power * np.log10(length)).astype(np.int64)
        for piece, digits in enumerate(decimals.tolist()):
            result[piece, :, power] = [round(value, digits) for value in coefficients[piece, :, power].tolist()]
    return result


def _sample_cubics(coefficients: Float, length: Float) -> Float:
    """Return the cubics' values (P, S, F) at the shares `_SHARES` of their pieces."""
    return value_of_cubic(coefficients[:, None], (length[:, None] * _SHARES)[..., None])


def value_of_cubic(coefficients: Float, u: Float | float) -> Float:
    """Return a + b u + c u^2 + d u^3 for coefficients (..., 4), by Horner's scheme."""
    a, b, c, d = (coefficients[..., i] for i in range(4))
    return np.asarray(a + u * (b + u * (c + u * d)))


def join_cubics(borders: Float, coefficients: Float) -> list[tuple[float, list[float]]]:
    """Merge cubics (P, 4) of one function that continue each other; return (start, coefficients) of each run.

    A run has the coefficients of its longest piece: those of a short one are known to few digits.
    """
    length = np.diff(borders)
    joined: list[tuple[float, list[float]]] = []
    first_piece = 0
    while first_piece < len(length):
        end_piece = first_piece + 1
        joined_cubic = coefficients[first_piece]
        while end_piece < len(length):
            longest_piece = first_piece + int(np.argmax(length[first_piece : end_piece + 1]))
            candidate = shift_cubic(coefficients[longest_piece], borders[first_piece] - borders[longest_piece])
            if not _continues(candidate, borders, coefficients, (first_piece, end_piece + 1)):
                break
            joined_cubic, end_piece = candidate, end_piece + 1
        joined_length = np.array([borders[end_piece] - borders[first_piece]])
        joined.append(
            (float(borders[first_piece]), _round_coefficients(joined_cubic[None, None], joined_length)[0, 0].tolist())
        )
        first_piece = end_piece
    return joined


def merge_similar(rows: list[tuple[float, list[float]]], end: float) -> list[tuple[float, list[float]]]:
    """Merge neighbouring cubics that the standard's checker takes for one; return (start, coefficients) of each.

    The standard's checker takes two for one if, counted from place 0, their coefficients differ by less than a
    millionth. Such are replaced by one through both.

    Args:
        rows: place (m) from which a cubic holds, and its coefficients.
        end: place at which the last ends, m.
    """
    merged = rows[:1]
    ends = [start for start, _ in rows[1:]] + [end]
    for (start, coefficients), end_station in zip(rows[1:], ends[1:], strict=True):
        previous_start, previous = merged[-1]
        difference = shift_cubic(np.array(previous), -previous_start) - shift_cubic(np.array(coefficients), -start)
        if np.abs(difference).max() >= _TAKEN_FOR_ONE:
            merged.append((start, coefficients))
            continue
        places = previous_start + (end_station - previous_start) * _SHARES[:4]
        previous_values, own_values = (
            value_of_cubic(np.array(previous), places - previous_start),
            value_of_cubic(np.array(coefficients), places - start),
        )
        values = np.where(places < start, previous_values, own_values)[None, :, None]
        merged[-1] = (previous_start, _cubic_through(values, np.array([end_station - previous_start]))[0, 0].tolist())
    return merged


def _continues(cubic: Float, borders: Float, coefficients: Float, pieces: tuple[int, int]) -> bool:
    """Return whether one cubic, counted from the first piece's start, reproduces a range of pieces within 5e-7."""
    first_piece, end = pieces
    places = np.diff(borders[first_piece : end + 1])[:, None] * np.array([0.0, 0.3, 0.7, 1.0])
    values = value_of_cubic(coefficients[first_piece:end, None], places)
    places_from_start = borders[first_piece:end, None] - borders[first_piece] + places
    return bool(np.abs(value_of_cubic(cubic, places_from_start) - values).max() <= _SAME)


def shift_cubic(cubic: Float, distance: float) -> Float:
    """Return the coefficients (4,) of a cubic whose origin is moved ahead by a distance (m)."""
    a, b, c, d = cubic.tolist()
    return np.array(
        [
            a + distance * (b + distance * (c + distance * d)),
            b + distance * (2.0 * c + 3.0 * distance * d),
            c + 3.0 * distance * d,
            d,
        ]
    )


def chord_stations(function: Function, borders: Float, tolerance: float, shortest: float = 1e-3) -> Float:
    """Return stations (N,) between which a function is linear within a tolerance, borders only where needed.

    Args:
        function: the function.
        borders: (P + 1,) stations at which it may bend.
        tolerance: largest distance of its values from the chords.
        shortest: no chord that isn't between two borders is made shorter than this, m.
    """
    shares = np.array([0.0, 0.23, 0.5, 0.71, 1.0])
    borders = _divide_long(borders, _LONGEST)
    stations_so_far, starts, lengths = [borders], borders[:-1], np.diff(borders)
    while len(starts):
        values = function((starts[:, None] + lengths[:, None] * shares).ravel()).reshape(len(starts), 5, -1)
        on_chord = values[:, :1] + shares[:, None] * (values[:, -1:] - values[:, :1])
        is_off = (np.abs(values - on_chord).max(axis=(1, 2)) > tolerance) & (lengths > 2.0 * shortest)
        half_lengths = lengths[is_off] / 2.0
        starts = np.concatenate([starts[is_off], starts[is_off] + half_lengths])
        lengths = np.concatenate([half_lengths, half_lengths])
        stations_so_far.append(starts[len(half_lengths) :])
    stations = np.sort(np.concatenate(stations_so_far))
    return _drop_straight_stations(stations, function(stations))


def _divide_long(borders: Float, longest: float) -> Float:
    """Return the borders with intervals longer than `longest` (m) divided evenly."""
    count = np.maximum(1, np.ceil(np.diff(borders) / longest)).astype(np.int64)
    number_in_interval = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    return np.append(
        np.repeat(borders[:-1], count) + number_in_interval * np.repeat(np.diff(borders) / count, count), borders[-1]
    )


def _drop_straight_stations(stations: Float, values: Float) -> Float:
    """Return the stations without those at which the values are linear between their neighbours."""
    indices = [0]
    for i in range(1, len(stations) - 1):
        previous, following = indices[-1], i + 1
        share = (stations[i] - stations[previous]) / (stations[following] - stations[previous])
        chord = values[previous] + share * (values[following] - values[previous])
        if np.abs(values[i] - chord).max() > _EXACT:
            indices.append(i)
    return stations[[*indices, len(stations) - 1]]
