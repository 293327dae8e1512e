"""Points of a design followed exactly: their elements found in the unrolled line, then fitted to the points themselves.

Long lines are taken in windows: elements of one that lie well before its end are kept, and the next one begins with
the first that isn't.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import Float
from ..road.alignment import Alignment, Element
from ..road.profile import IntersectionPoint, Profile
from .between import without_swings
from .chain import EQUAL, FREE, NEAR, Chain, quadrature_grid, ramp_integrals
from .design import Match, Model, joined, match, repaired, simplified
from .pieces import Piece, cut_into_pieces, noise_of, unrolled

_WINDOW = 400
"""Points of a window. Chosen: bounds the work, which grows with its square."""
_TRUSTED = 0.6
"""Share of a window in which its elements don't depend on what comes behind it. Chosen: elements near the end may go on
beyond it."""
_OWN = 5
"""Points of the element that another window begins with, at least. Chosen: more than the coefficients of a piece."""
_ELEMENTS, _KEPT = 36, 24
"""Most elements that are fitted together, and how many of them are kept if others follow. Chosen: bounds the work; a
third of them give way to what follows."""
_STEPS = 12
"""Steps of a fit at most. Chosen: bounds the work; it begins near its end."""
_FINE = 5e-5
"""Least distance (m) within which points count as on a piece. Chosen: half of the rounding of files with four
decimals."""
_ALLOWED = 2.5e-4
"""Least distance (m) that points may be off elements fitted together: files' own gaps are as large."""
_PLAY = 2.0
"""Times the distance from pieces that points may be off elements fitted together. Chosen: elements together have less
freedom than pieces."""
_COARSE = (5e-3, 1e-2, 2e-2)
"""Distances (m) in place of the fine one where finer pieces would be many: curves that are none of ours. Chosen: by
factors of 2, up to what is seen of no road."""
_TRUST = (5e-3, 2e-2)
"""Least distances (m) of points from pieces that are tried in turn where none is not good enough. Chosen: files'
rounding, then a curve's approximation by others."""
_SPARSE = 60
"""Points up to which nothing tells noise from elements too short for them: they are trusted. Chosen: a few points to
each element."""
_NOISY = 2e-3
"""Standard deviation (m) of points that are no design's. Chosen: files of designs round to 1 mm."""
_PASSES = 2
"""Times that unrolling and fitting go in turn. Chosen: the second begins from the first's elements."""
_CUBIC = 0.02
"""Share of a chord's length times the third power of its turn, by which unrolling is off at most."""
_NOISES = 6.0
"""Standard deviations of the points' noise that they may be off. Chosen: none of some hundred million normal points is
farther off."""
_UNITS = (1e-2, 1e-3, 1e-4)
"""Units (m) that files round coordinates to."""
_OF_ROUNDING = 0.5
"""Units up to which the noise of rounded coordinates is that of rounding. Chosen: its standard deviation is 0.29."""
_SHARE = 0.45
"""Freedom of the pieces over the points from which on there are too many. Chosen: then each follows its own points."""
_DOUBTFUL = 0.5
"""Share of the allowed swing that elements may have which miss their points. Chosen: they are hardly the design's."""
_FLAT = 1e-10
"""Change of grade below which none is seen. Chosen: a nanometre over 10 m."""
_MANY = 2.0
"""Times as many pieces as with the coarse tolerance are too many for the fine one. Chosen: a design's pieces are as
many with either."""


@dataclass(frozen=True)
class Followed:
    """A model fitted to points of a plan.

    Attributes:
        model: elements, stations from the first point.
        pose: x, y (m) and heading (rad) at the first knot.
        stations, offsets: (N,) of the points, m.
    """

    model: Model
    pose: Float
    stations: Float
    offsets: Float

    @property
    def worst(self) -> float:
        """Return the largest offset, m."""
        return float(np.abs(self.offsets).max())

    def rank(self, points: Float, tolerance: float) -> tuple[bool, float, int]:
        """Return a sort key, least for the best: whether it misses the tolerance, how far off it is, parameters.

        Half of the tolerance counts at the points (N, 2), m, the whole one between them.
        """
        between = bend_between(self.alignment, points, self.stations - self.model.knots[0])
        missed = self.worst > 0.5 * tolerance or between > tolerance
        off = max(self.worst, between) if missed else round(self.worst / _ALLOWED) * _ALLOWED
        return missed, off, self.model.freedom()

    @property
    def alignment(self) -> Alignment:
        """Return the elements as an alignment."""
        return _alignment(self.model, self.pose)


def _alignment(model: Model, pose: Float) -> Alignment:
    rows = zip(np.diff(model.knots).tolist(), model.values.tolist(), strict=True)
    return Alignment([Element(length, *ends) for length, ends in rows], *(float(v) for v in pose))


def bend_between(alignment: Alignment, points: Float, stations: Float) -> float:
    """Return how much farther from the chords of points (N, 2) an alignment bends than the points around suggest, m.

    Args:
        alignment: along the points.
        points: m.
        stations: (N,) of the points on it, m.
    """
    move = np.diff(points, axis=0)
    chord = np.hypot(*move.T)
    bend = np.diff(np.unwrap(np.arctan2(move[:, 1], move[:, 0]))) / (0.5 * (chord[1:] + chord[:-1]))
    padded = np.pad(bend, 2, mode="edge") if len(bend) else np.zeros(len(chord) + 3)
    around = np.lib.stride_tricks.sliding_window_view(padded, 4)[: len(chord)]
    out = alignment.position(0.5 * (stations[1:] + stations[:-1])) - 0.5 * (points[1:] + points[:-1])
    sagitta = (move[:, 1] * out[:, 0] - move[:, 0] * out[:, 1]) / chord
    low, high = (0.125 * chord**2 * limit for limit in (around.min(axis=1), around.max(axis=1)))
    return float(np.maximum(np.maximum(low - sagitta, sagitta - high), 0.0).max(initial=0.0))


def rounding_of(coordinates: Float) -> float:
    """Return the unit (m) that all coordinates are rounded to: 1 cm, 1 mm or 0.1 mm; 0 if it is none of these."""
    for unit in _UNITS:
        in_units = coordinates / unit
        if np.abs(in_units - np.round(in_units)).max(initial=0.0) < 1e-3:
            return unit
    return 0.0


def elements_of(station: Float, values: Float, order: int, unsure: float = 0.0, rounding: float = 0.0) -> Model:
    """Return the model of values (N,) at stations (N,): the unrolled line (order 2) or heights (order 1), in m.

    Args:
        station, values: m.
        order: of the derivative that is linear on an element.
        unsure: what the values may be off, beside noise, m.
        rounding: unit that the coordinates of a plan's points are rounded to, m; 0 if they aren't.
    """
    noise = noise_of(station, values, order + 1)
    # Rounding moves a point by half a unit along both axes: no more, where normal noise has no bound.
    farthest = 0.5 * rounding * np.sqrt(2.0)
    spread = farthest if noise <= _OF_ROUNDING * rounding else _NOISES * noise
    fine = max(spread, _FINE, unsure)
    parts: list[Model] = []
    first, width = 0, _WINDOW
    while True:
        end = min(first + width, len(station))
        here, there = station[first:end], values[first:end]
        model = _window(here, there, order, fine).model
        if end == len(station):
            parts.append(model)
            return _chained(parts)
        keep = _cut_after(model, here)
        if keep == 0:
            width *= 2
            continue
        parts.append(_first_elements(model, keep))
        first, width = int(np.searchsorted(station, model.knots[keep])), _WINDOW


def _window(station: Float, values: Float, order: int, fine: float) -> Match:
    degrees = tuple(range(1, order + 2))
    coarser = _COARSE if order == 2 else _COARSE[:1]
    tolerance = min(fine, coarser[-1])
    pieces = cut_into_pieces(station, values, degrees, tolerance)
    for coarse in coarser:
        # Of a plan elements are wanted as they are, unless the points don't tell them; of heights as few as will do.
        if coarse <= tolerance or (order == 2 and not _too_many(pieces, len(station))):
            continue
        rough = cut_into_pieces(station, values, degrees, coarse)
        if order == 2 or len(pieces) > _MANY * len(rough) + 2:
            pieces, tolerance = rough, coarse
    allowed = max(_PLAY * tolerance, _ALLOWED)
    fit = match(joined(pieces, station, order), station, values, 0.1 * tolerance)
    return simplified(repaired(fit, station, values, allowed), station, values, allowed)


def _cut_after(model: Model, station: Float) -> int:
    """Return how many elements of a window to keep: those before one with points of its own, well before the end."""
    latest = station[0] + _TRUSTED * (station[-1] - station[0])
    inside = np.diff(np.searchsorted(station, model.knots))
    good = [e for e in range(1, model.size) if model.knots[e] <= latest and inside[e] >= _OWN]
    return good[-1] if good else 0


def _too_many(pieces: list[Piece], count: int) -> bool:
    return sum(piece.degree for piece in pieces) > _SHARE * count


def _first_elements(model: Model, count: int) -> Model:
    return replace(
        model,
        knots=model.knots[: count + 1],
        values=model.values[:count],
        kinds=model.kinds[:count],
        smooth=model.smooth[: count - 1],
    )


def _chained(parts: list[Model]) -> Model:
    """Return parts that follow each other as one model."""
    whole = parts[0]
    for part in parts[1:]:
        smooth = FREE in (whole.kinds[-1], part.kinds[0]) and bool(
            abs(whole.values[-1, 1] - part.values[0, 0]) <= 0.02 * max(np.abs(whole.values[-1]).max(), 1e-6)
        )
        whole = replace(
            whole,
            knots=np.concatenate([whole.knots, part.knots[1:]]),
            values=np.concatenate([whole.values, part.values]),
            kinds=np.concatenate([whole.kinds, part.kinds]),
            smooth=np.concatenate([whole.smooth, [smooth], part.smooth]),
        )
    return whole.tied()


def followed(points: Float, tolerance: float) -> Followed | None:
    """Return the elements that points (N, 2), m, of a design lie on; None for points with noise.

    What unrolling takes for arcs is corrected by what was found, and the elements are found again; where they keep the
    tolerance neither at the points nor between them, they are looked for again with less trust in single points, and
    clothoids from point to point stand in for elements too short to be seen.
    """
    station, values = unrolled(points)
    if len(points) > _SPARSE and noise_of(station, values, 3) > _NOISY:
        return None
    best = _searched(points, 0.0, tolerance)
    if best.rank(points, tolerance)[0] and len(points) <= _SPARSE:
        best = min(best, through(points), key=lambda one: one.rank(points, tolerance))
    for least in _TRUST if len(points) > _SPARSE else ():
        if not best.rank(points, tolerance)[0]:
            break
        best = min(best, _searched(points, least, tolerance), key=lambda one: one.rank(points, tolerance))
    return replace(best, model=_with_end(best.model, float(best.stations[-1])))


def _searched(points: Float, least: float, tolerance: float) -> Followed:
    """Return the elements found in points that may be off pieces by a least distance (m), the best of some passes."""
    station, values = unrolled(points)
    unsure = max(_unrolling_error(points), least)
    rounding = rounding_of(points)
    best: Followed | None = None
    for _ in range(1 if least else _PASSES):
        model = elements_of(station, values, 2, unsure, rounding)
        trial = refined(points, Followed(model, _pose(points, model), station, np.zeros(len(station))))
        if best is None or trial.rank(points, tolerance) < best.rank(points, tolerance):
            best = trial
        if trial.worst <= _ALLOWED or (np.diff(trial.stations) <= 0.0).any():
            break
        station, unsure = trial.stations, least
        values = trial.model.evaluate(station) + trial.offsets
    assert best is not None  # nosec B101 (there is one pass at least)
    return best


def through(points: Float) -> Followed:
    """Return clothoids from point to point, their curvatures continuous, that pass through points (N, 2), m."""
    station, values = unrolled(points)
    count = len(points) - 1
    kinds = np.full(count, FREE)
    kinds[[0, -1]] = EQUAL  # else two parameters more than points
    model = Model(np.zeros(2), station, np.zeros((count, 2)), kinds, np.ones(count - 1, bool))
    model = match(model, station, values).model
    return refined(points, Followed(model, _pose(points, model), station, np.zeros(len(station))), False)


def _unrolling_error(points: Float) -> float:
    """Return what the unrolled line may be off, m, where its curvature changes between two points."""
    move = np.diff(points, axis=0)
    turn = np.diff(np.unwrap(np.arctan2(move[:, 1], move[:, 0])))
    chord = np.hypot(*move.T)
    return float((np.minimum(chord[1:], chord[:-1]) * np.abs(turn) ** 3).max(initial=0.0)) * _CUBIC


def _pose(points: Float, model: Model) -> Float:
    move = points[1] - points[0]
    return np.array([*points[0], np.arctan2(move[1], move[0]) - 0.5 * model.values[0, 0] * np.hypot(*move)])


def refined(points: Float, found: Followed, free_knots: bool = True) -> Followed:
    """Return the elements fitted to the points themselves, by the exact alignment."""
    model, pose, station = found.model, found.pose, found.stations
    first, here = 0, pose
    done: list[Model] = []
    stations, offsets = station.copy(), np.zeros(len(station))
    while True:
        last = min(first + _ELEMENTS, model.size)
        part = _slice(model, first, last)
        held = bool(first and model.smooth[first - 1])
        inside = slice(
            int(np.searchsorted(stations, model.knots[first])) if first else 0,
            len(station) if last == model.size else int(np.searchsorted(stations, model.knots[last])),
        )
        part, here, feet, off = _fit_part(points[inside], part, here, stations[inside], first == 0, held, free_knots)
        stations[inside], offsets[inside] = feet, off
        if first == 0:
            pose = here
        if last == model.size:
            done.append(part)
            break
        kept = _first_elements(part, _KEPT)
        done.append(kept)
        there, heading, _ = _alignment(kept, here).frame(float(kept.knots[-1] - kept.knots[0]))
        here = np.array([*there, heading])
        first += _KEPT
        knots = model.knots.copy()  # the rest begins where this part ends
        knots[first : last + 1] = part.knots[_KEPT:]
        values = model.values.copy()
        values[first:last] = part.values[_KEPT:]
        model = replace(model, knots=knots, values=values)
        stations[stations > knots[last]] = np.maximum(stations[stations > knots[last]], knots[last])
    whole = done[0]
    for part in done[1:]:
        joint = whole.size
        whole = replace(
            whole,
            knots=np.concatenate([whole.knots, part.knots[1:]]),
            values=np.concatenate([whole.values, part.values]),
            kinds=np.concatenate([whole.kinds, part.kinds]),
            smooth=np.concatenate([whole.smooth, model.smooth[joint - 1 : joint], part.smooth]),
        )
    return Followed(whole, pose, stations, offsets)


def _slice(model: Model, first: int, last: int) -> Model:
    return replace(
        model,
        knots=model.knots[first : last + 1],
        values=model.values[first:last],
        kinds=model.kinds[first:last],
        smooth=model.smooth[first : last - 1],
    )


def _fit_part(
    points: Float, model: Model, pose: Float, station: Float, free_pose: bool, held: bool, free_knots: bool
) -> tuple[Model, Float, Float, Float]:
    """Return elements fitted to points from a pose on, that pose, and the points' stations and offsets (N,), m."""

    def measure(model: Model, pose: Float, near: Float) -> tuple[Float, Float]:
        feet, off = _alignment(model, pose).project_near(points, near - model.knots[0], NEAR)
        return feet + model.knots[0], off

    feet, off = measure(model, pose, station)
    damping = 1e-6
    matrix = _jacobian(model, pose, feet)
    for _ in range(_STEPS):
        used = matrix if free_pose else matrix[:, 2:]
        if held:
            used = used[:, 1:] if not free_pose else used
        if not free_knots:
            used = used[:, : used.shape[1] - model.size + 1]
        scale = np.maximum(np.sqrt((used**2).sum(axis=0)), 1e-12)
        rows = np.vstack((used / scale, np.sqrt(damping) * np.eye(len(scale))))
        step = np.linalg.lstsq(rows, np.append(off, np.zeros(len(scale))), rcond=None)[0] / scale
        full = np.zeros(matrix.shape[1])
        end = matrix.shape[1] if free_knots else matrix.shape[1] - model.size + 1
        full[end - len(step) : end] = step
        across, turn = full[0], full[1]
        moved = model.moved(full)
        there = pose + np.array([-np.sin(pose[2]) * across, np.cos(pose[2]) * across, turn])
        new_feet, new_off = measure(moved, there, feet)
        if new_off @ new_off < off @ off:
            gain = 1.0 - (new_off @ new_off) / (off @ off)
            model, pose, feet, off = moved, there, new_feet, new_off
            if gain < 1e-3 or np.abs(off).max() < 1e-6:
                break
            damping = max(0.01 * damping, 1e-12)
            matrix = _jacobian(model, pose, feet)
        else:
            damping *= 30.0
            if damping > 1e3:
                break
    return model, pose, feet, off


def _jacobian(model: Model, pose: Float, station: Float) -> Float:
    """Return the derivatives (N, P) of the alignment's place across itself at stations (N,), by `Model`'s parameters.

    A change of curvature at s' turns the rest about the place there: it moves by t(s) . (z(s) - z(s')) across.
    """
    alignment = _alignment(model, pose)
    shift = model.knots[0]
    chain = Chain(pose, model.knots - shift, np.append(model.values[:, 0], 0.0), model.kinds)
    at = station - shift
    grid = quadrature_grid(chain, at)
    origin = np.array([alignment.x, alignment.y])
    position, heading, _ = alignment.frame(at)
    tangent = np.exp(-1j * heading)
    z = (position - origin) @ np.array([1.0, 1j])
    weight = (alignment.position(0.5 * (grid[1:] + grid[:-1])) - origin) @ np.array([1.0, 1j])
    lever = (tangent * z).real
    plain = ramp_integrals(chain, at, grid, np.ones(len(weight)))
    turned = ramp_integrals(chain, at, grid, weight)
    rise, fall = (lever[:, None] * a - (tangent[:, None] * b).real for a, b in zip(plain, turned, strict=True))
    both = np.stack((fall, rise), axis=2).reshape(len(at), -1)
    slope = np.diff(model.values)[:, 0] / np.diff(model.knots)
    borders = (alignment.position(chain.knots[1:-1]) - origin) @ np.array([1.0, 1j])
    past = (at[:, None] > chain.knots[1:-1]) * (lever[:, None] - (tangent[:, None] * borders).real)
    jump = model.values[:-1, 1] - model.values[1:, 0]
    knots = -slope[:-1] * rise[:, :-1] - slope[1:] * fall[:, 1:] + jump * past
    across = (tangent * np.exp(1j * alignment.start_heading)).real
    return np.hstack((across[:, None], lever[:, None], both @ model.tie, knots))


def heights_followed(station: Float, heights: Float, length: float, tolerance: float = np.inf) -> Profile | None:
    """Return the profile that heights of a design lie on, over a road of a length; None for heights with noise.

    Args:
        station, heights: (N,) of the points, m.
        length: of the road, m.
        tolerance: distance (m) from which the heights between two points may not swing (`fitting.between`).
    """
    if len(station) > 2 * _SPARSE and noise_of(station, heights, 2) > _NOISY:
        return None
    fit = match(elements_of(station, heights, 1), station, heights)
    limit = tolerance if fit.worst <= _ALLOWED else _DOUBTFUL * tolerance
    return profile_of(without_swings(fit.model, station, heights, limit), length)


def profile_of(model: Model, length: float) -> Profile:
    """Return the profile of a model of grades from 0 to a length, m: parabolas and the kinks between grades."""
    model = _with_end(model, length)
    knots = model.knots
    level = model.evaluate(knots)
    rows = [(0.0, float(level[0] - model.values[0, 0] * knots[0]), 0.0)]  # station, elevation, tangent
    for e, (first, last) in enumerate(model.values.tolist()):
        long = float(knots[e + 1] - knots[e])
        if e and abs(first - model.values[e - 1, 1]) > _FLAT:
            rows.append((float(knots[e]), float(level[e]), 0.0))
        if abs(last - first) > _FLAT:
            rows.append((float(knots[e]) + 0.5 * long, float(level[e]) + 0.5 * long * first, 0.5 * long))
    rows.append((length, float(level[-1]), 0.0))
    station, height, tangent = np.array(rows).T
    grades = np.diff(height) / np.diff(station)
    change = np.abs(np.concatenate([[0.0], np.diff(grades), [0.0]]))
    radius = np.where(tangent > 0.0, (2.0 - 1e-6) * tangent / np.where(change > 0.0, change, np.inf), 0.0)
    return Profile([IntersectionPoint(*(float(v) for v in row)) for row in zip(station, height, radius, strict=True)])


def _with_end(model: Model, end: float) -> Model:
    """Return a model whose last element is cut or prolonged to a station (m)."""
    knots, values = model.knots.copy(), model.values.copy()
    long = knots[-1] - knots[-2]
    end = max(end, knots[-2] + 0.1 * long)
    values[-1, 1] = values[-1, 0] + (values[-1, 1] - values[-1, 0]) * (end - knots[-2]) / long
    knots[-1] = end
    return replace(model, knots=knots, values=values)
