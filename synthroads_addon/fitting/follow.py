"""Points of a design followed exactly: their elements found in the unrolled line, then fitted to the points themselves.

Long lines are taken in windows: elements of one that lie well before its end are kept, and the next one begins with
the first that isn't.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import Bool, Float
from ..road.alignment import Alignment, Element
from ..road.profile import IntersectionPoint, Profile
from .between import calm_swings
from .chain import EQUAL, FREE, NEAR, Chain, quadrature_grid, ramp_integrals
from .design import Match, Model, match, model_of_pieces, repair_match, simplify_match
from .pieces import Piece, cut_into_pieces, noise_std, unroll_points

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
_SPARSE_HEIGHTS = 2 * _SPARSE
"""The same number for heights. Chosen: twice that of points in plan."""
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
class DesignFit:
    """A model fitted to points of a plan.

    Attributes:
        model: the elements; stations count from the first point.
        pose: (3,) x, y (m) and heading (rad) at the first knot.
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
        """Return a sort key, least for the best fit: whether it misses the tolerance, its deviation, its parameters.

        Half of the tolerance (m) applies at the points (N, 2), m, all of it to the bend between points.
        """
        bend = excess_bend(self.alignment, points, self.stations - self.model.knots[0])
        misses_tolerance = self.worst > 0.5 * tolerance or bend > tolerance
        deviation = max(self.worst, bend) if misses_tolerance else round(self.worst / _ALLOWED) * _ALLOWED
        return misses_tolerance, deviation, self.model.freedom()

    @property
    def alignment(self) -> Alignment:
        """Return the elements as an alignment."""
        return _alignment(self.model, self.pose)


def _alignment(model: Model, pose: Float) -> Alignment:
    """Return a model's elements as an alignment that starts at a pose (x, y in m, heading in rad)."""
    rows = zip(np.diff(model.knots).tolist(), model.values.tolist(), strict=True)
    return Alignment([Element(length, *ends) for length, ends in rows], *(float(v) for v in pose))


def excess_bend(alignment: Alignment, points: Float, stations: Float) -> float:
    """Return the largest distance, m, by which an alignment bends off chords of points (N, 2) more than they suggest.

    Args:
        alignment: alignment along the points.
        points: (N, 2) m.
        stations: (N,) of the points on the alignment, m.
    """
    chord_vectors = np.diff(points, axis=0)
    chord = np.hypot(*chord_vectors.T)
    bend = np.diff(np.unwrap(np.arctan2(chord_vectors[:, 1], chord_vectors[:, 0]))) / (0.5 * (chord[1:] + chord[:-1]))
    padded_bend = np.pad(bend, 2, mode="edge") if len(bend) else np.zeros(len(chord) + 3)
    around = np.lib.stride_tricks.sliding_window_view(padded_bend, 4)[: len(chord)]
    chord_deviation = alignment.position(0.5 * (stations[1:] + stations[:-1])) - 0.5 * (points[1:] + points[:-1])
    sagitta = (chord_vectors[:, 1] * chord_deviation[:, 0] - chord_vectors[:, 0] * chord_deviation[:, 1]) / chord
    lower_limit, upper_limit = (0.125 * chord**2 * limit for limit in (around.min(axis=1), around.max(axis=1)))
    return float(np.maximum(np.maximum(lower_limit - sagitta, sagitta - upper_limit), 0.0).max(initial=0.0))


def rounding_unit(coordinates: Float) -> float:
    """Return the unit (m) that all coordinates are rounded to: 1 cm, 1 mm or 0.1 mm; 0 if it is none of these."""
    for unit in _UNITS:
        in_units = coordinates / unit
        if np.abs(in_units - np.round(in_units)).max(initial=0.0) < 1e-3:
            return unit
    return 0.0


def find_elements(station: Float, values: Float, order: int, values_error: float = 0.0, rounding: float = 0.0) -> Model:
    """Return the model of values (N,) at stations (N,): the unrolled line (order 2) or heights (order 1), in m.

    Args:
        station, values: m.
        order: order of the derivative that is linear on an element.
        values_error: error of the values beside their noise, m.
        rounding: unit that the coordinates of a plan's points are rounded to, m; 0 if they aren't.
    """
    noise = noise_std(station, values, order + 1)
    # Rounding moves a point by half a unit along both axes: no more, where normal noise has no bound.
    largest_move = 0.5 * rounding * np.sqrt(2.0)
    spread = largest_move if noise <= _OF_ROUNDING * rounding else _NOISES * noise
    piece_tolerance = max(spread, _FINE, values_error)
    parts: list[Model] = []
    first_point, width = 0, _WINDOW
    while True:
        end = min(first_point + width, len(station))
        window_station, window_values = station[first_point:end], values[first_point:end]
        model = _window(window_station, window_values, order, piece_tolerance).model
        if end == len(station):
            parts.append(model)
            return _chain_models(parts)
        keep = _count_kept_elements(model, window_station)
        if keep == 0:
            width *= 2
            continue
        parts.append(_first_elements(model, keep))
        first_point, width = int(np.searchsorted(station, model.knots[keep])), _WINDOW


def _window(station: Float, values: Float, order: int, piece_tolerance: float) -> Match:
    """Return the model of one window's values (N,) at stations (N,), m: cut into pieces, joined, repaired, simplified.

    Args:
        station, values: m.
        order: 2 in plan, 1 in height.
        piece_tolerance: distance of a value from its piece's polynomial, m, unless coarser pieces do.
    """
    degrees = tuple(range(1, order + 2))
    coarse_tolerances = _COARSE if order == 2 else _COARSE[:1]
    tolerance = min(piece_tolerance, coarse_tolerances[-1])
    pieces = cut_into_pieces(station, values, degrees, tolerance)
    for coarse_tolerance in coarse_tolerances:
        # Of a plan elements are wanted as they are, unless the points don't tell them; of heights as few as will do.
        if coarse_tolerance <= tolerance or (order == 2 and not _too_many(pieces, len(station))):
            continue
        coarse_pieces = cut_into_pieces(station, values, degrees, coarse_tolerance)
        if order == 2 or len(pieces) > _MANY * len(coarse_pieces) + 2:
            pieces, tolerance = coarse_pieces, coarse_tolerance
    fit_tolerance = max(_PLAY * tolerance, _ALLOWED)
    fit = match(model_of_pieces(pieces, station, order), station, values, 0.1 * tolerance)
    return simplify_match(repair_match(fit, station, values, fit_tolerance), station, values, fit_tolerance)


def _count_kept_elements(model: Model, station: Float) -> int:
    """Return the number of a window's elements to keep: up to the last well before its end that `_OWN` points follow.

    0 if none does; the window must then be longer.
    """
    latest_station = station[0] + _TRUSTED * (station[-1] - station[0])
    point_counts = np.diff(np.searchsorted(station, model.knots))
    candidates = [e for e in range(1, model.size) if model.knots[e] <= latest_station and point_counts[e] >= _OWN]
    return candidates[-1] if candidates else 0


def _too_many(pieces: list[Piece], count: int) -> bool:
    """Return whether pieces have so many coefficients that each follows the ``count`` points' own errors."""
    return sum(piece.degree for piece in pieces) > _SHARE * count


def _first_elements(model: Model, count: int) -> Model:
    """Return the model of a model's first elements alone."""
    return replace(
        model,
        knots=model.knots[: count + 1],
        values=model.values[:count],
        kinds=model.kinds[:count],
        smooth=model.smooth[: count - 1],
    )


def _chain_models(parts: list[Model]) -> Model:
    """Return consecutive parts joined as one model, smooth where values at a joint differ by at most 2 % (chosen)."""
    chained_model = parts[0]
    for part in parts[1:]:
        is_smooth = FREE in (chained_model.kinds[-1], part.kinds[0]) and bool(
            abs(chained_model.values[-1, 1] - part.values[0, 0])
            <= 0.02 * max(np.abs(chained_model.values[-1]).max(), 1e-6)
        )
        chained_model = replace(
            chained_model,
            knots=np.concatenate([chained_model.knots, part.knots[1:]]),
            values=np.concatenate([chained_model.values, part.values]),
            kinds=np.concatenate([chained_model.kinds, part.kinds]),
            smooth=np.concatenate([chained_model.smooth, [is_smooth], part.smooth]),
        )
    return chained_model.tie_values()


def follow_points(points: Float, tolerance: float) -> DesignFit | None:
    """Return the fit of the elements that points (N, 2), m, of a design lie on; None for points with noise.

    Unrolling takes every chord for an arc's: it is corrected by the elements found, which are then found again; where
    they keep the tolerance neither at the points nor between them, elements are looked for again with less trust in
    single points, and clothoids from point to point stand in for elements too short to be seen.
    """
    station, values = unroll_points(points)
    if len(points) > _SPARSE and noise_std(station, values, 3) > _NOISY:
        return None
    best_fit = _search_elements(points, 0.0, tolerance)
    if best_fit.rank(points, tolerance)[0] and len(points) <= _SPARSE:
        best_fit = min(best_fit, clothoids_through(points), key=lambda candidate: candidate.rank(points, tolerance))
    for values_error in _TRUST if len(points) > _SPARSE else ():
        if not best_fit.rank(points, tolerance)[0]:
            break
        best_fit = min(
            best_fit,
            _search_elements(points, values_error, tolerance),
            key=lambda candidate: candidate.rank(points, tolerance),
        )
    return replace(best_fit, model=_move_end(best_fit.model, float(best_fit.stations[-1])))


def _search_elements(points: Float, values_error: float, tolerance: float) -> DesignFit:
    """Return the best fit of some passes of unrolling and fitting points (N, 2), m.

    Args:
        points: m.
        values_error: least distance that points may be off pieces, m.
        tolerance: of the fit, m.
    """
    station, values = unroll_points(points)
    piece_error = max(_unrolling_error(points), values_error)
    rounding = rounding_unit(points)
    best_fit: DesignFit | None = None
    for _ in range(1 if values_error else _PASSES):
        model = find_elements(station, values, 2, piece_error, rounding)
        trial = refine_design(points, DesignFit(model, _pose(points, model), station, np.zeros(len(station))))
        if best_fit is None or trial.rank(points, tolerance) < best_fit.rank(points, tolerance):
            best_fit = trial
        if trial.worst <= _ALLOWED or (np.diff(trial.stations) <= 0.0).any():
            break
        station, piece_error = trial.stations, values_error
        values = trial.model.evaluate(station) + trial.offsets
    assert best_fit is not None  # nosec B101 (there is one pass at least)
    return best_fit


def clothoids_through(points: Float) -> DesignFit:
    """Return the fit of clothoids from point to point of points (N, 2), m, with continuous curvature."""
    station, values = unroll_points(points)
    count = len(points) - 1
    kinds = np.full(count, FREE)
    kinds[[0, -1]] = EQUAL  # else two parameters more than points
    model = Model(np.zeros(2), station, np.zeros((count, 2)), kinds, np.ones(count - 1, bool))
    model = match(model, station, values).model
    return refine_design(points, DesignFit(model, _pose(points, model), station, np.zeros(len(station))), False)


def _unrolling_error(points: Float) -> float:
    """Return the largest error of the unrolled line, m, where its curvature changes between two points (N, 2)."""
    chord_vectors = np.diff(points, axis=0)
    turn = np.diff(np.unwrap(np.arctan2(chord_vectors[:, 1], chord_vectors[:, 0])))
    chord = np.hypot(*chord_vectors.T)
    return float((np.minimum(chord[1:], chord[:-1]) * np.abs(turn) ** 3).max(initial=0.0)) * _CUBIC


def _pose(points: Float, model: Model) -> Float:
    """Return the pose (3,) at the first point: the first chord's direction less half of the first element's turn."""
    first_chord = points[1] - points[0]
    return np.array(
        [*points[0], np.arctan2(first_chord[1], first_chord[0]) - 0.5 * model.values[0, 0] * np.hypot(*first_chord)]
    )


def refine_design(points: Float, initial_fit: DesignFit, free_knots: bool = True) -> DesignFit:
    """Return elements fitted to points (N, 2), m, by the exact alignment's offsets, a part of `_ELEMENTS` at a time.

    Args:
        points: m.
        initial_fit: elements to begin with.
        free_knots: whether knots may move.
    """
    model, pose, station = initial_fit.model, initial_fit.pose, initial_fit.stations
    first_element, part_pose = 0, pose
    fitted_parts: list[Model] = []
    stations, offsets = station.copy(), np.zeros(len(station))
    while True:
        # Fit the next part to the points along it; it starts at the pose at which the part before ends.
        end_element = min(first_element + _ELEMENTS, model.size)
        part = _slice(model, first_element, end_element)
        value_is_fixed = bool(first_element and model.smooth[first_element - 1])
        part_points = slice(
            int(np.searchsorted(stations, model.knots[first_element])) if first_element else 0,
            len(station) if end_element == model.size else int(np.searchsorted(stations, model.knots[end_element])),
        )
        fit = _fit_part(
            points[part_points], part, part_pose, stations[part_points], first_element == 0, value_is_fixed, free_knots
        )
        stations[part_points], offsets[part_points] = fit.stations, fit.offsets
        if first_element == 0:
            pose = fit.pose
        if end_element == model.size:
            fitted_parts.append(fit.model)
            break
        # Keep the first elements; the others, which the points that follow change, are fitted again in the next part.
        kept_elements = _first_elements(fit.model, _KEPT)
        fitted_parts.append(kept_elements)
        end_point, heading, _ = _alignment(kept_elements, fit.pose).frame(
            float(kept_elements.knots[-1] - kept_elements.knots[0])
        )
        part_pose = np.array([*end_point, heading])
        first_element += _KEPT
        knots = model.knots.copy()
        knots[first_element : end_element + 1] = fit.model.knots[_KEPT:]
        values = model.values.copy()
        values[first_element:end_element] = fit.model.values[_KEPT:]
        model = replace(model, knots=knots, values=values)
    return DesignFit(_join_parts(fitted_parts, model.smooth), pose, stations, offsets)


def _join_parts(parts: list[Model], smooth: Bool) -> Model:
    """Return consecutive parts as one model; ``smooth`` says at which of its inner knots values are continuous."""
    joined_model = parts[0]
    for part in parts[1:]:
        joint = joined_model.size
        joined_model = replace(
            joined_model,
            knots=np.concatenate([joined_model.knots, part.knots[1:]]),
            values=np.concatenate([joined_model.values, part.values]),
            kinds=np.concatenate([joined_model.kinds, part.kinds]),
            smooth=np.concatenate([joined_model.smooth, smooth[joint - 1 : joint], part.smooth]),
        )
    return joined_model


def _slice(model: Model, first_element: int, end_element: int) -> Model:
    """Return the model of the elements from a first one to before an end."""
    return replace(
        model,
        knots=model.knots[first_element : end_element + 1],
        values=model.values[first_element:end_element],
        kinds=model.kinds[first_element:end_element],
        smooth=model.smooth[first_element : end_element - 1],
    )


def _fit_part(
    points: Float, model: Model, pose: Float, station: Float, free_pose: bool, value_is_fixed: bool, free_knots: bool
) -> DesignFit:
    """Return the fit of consecutive elements to the points (N, 2), m, along them.

    Args:
        points: (N, 2) m.
        model: elements to begin with.
        pose: (3,) x, y (m), heading (rad) at their start.
        station: (N,) approximate stations of the points, m.
        free_pose: whether the pose may change; if not, the part goes on from the one before.
        value_is_fixed: whether the first element's start value may not change.
        free_knots: whether knots may move.
    """

    def measure(model: Model, pose: Float, approximate_stations: Float) -> tuple[Float, Float]:
        """Return the points' stations and offsets (N,), m, on a model's elements, near approximate stations."""
        feet, lateral_offsets = _alignment(model, pose).project_near(
            points, approximate_stations - model.knots[0], NEAR
        )
        return feet + model.knots[0], lateral_offsets

    feet, offsets = measure(model, pose, station)
    matrix = _jacobian(model, pose, feet)
    # Parameters in order: the pose's two, the free values from the start's on, the knots between elements.
    first_free = 0 if free_pose else 3 if value_is_fixed else 2
    end_free = matrix.shape[1] if free_knots else matrix.shape[1] - model.size + 1
    # Levenberg-Marquardt; the factors of the damping are chosen.
    damping = 1e-6
    for _ in range(_STEPS):
        free_columns = matrix[:, first_free:end_free]
        scale = np.maximum(np.sqrt((free_columns**2).sum(axis=0)), 1e-12)
        rows = np.vstack((free_columns / scale, np.sqrt(damping) * np.eye(len(scale))))
        step = np.linalg.lstsq(rows, np.append(offsets, np.zeros(len(scale))), rcond=None)[0] / scale
        full_step = np.zeros(matrix.shape[1])
        full_step[first_free:end_free] = step
        lateral_step, turn = full_step[0], full_step[1]
        trial_model = model.apply_step(full_step)
        trial_pose = pose + np.array([-np.sin(pose[2]) * lateral_step, np.cos(pose[2]) * lateral_step, turn])
        new_feet, new_offsets = measure(trial_model, trial_pose, feet)
        if new_offsets @ new_offsets < offsets @ offsets:
            gain = 1.0 - (new_offsets @ new_offsets) / (offsets @ offsets)
            model, pose, feet, offsets = trial_model, trial_pose, new_feet, new_offsets
            if gain < 1e-3 or np.abs(offsets).max() < 1e-6:
                break
            damping = max(0.01 * damping, 1e-12)
            matrix = _jacobian(model, pose, feet)
        else:
            damping *= 30.0
            if damping > 1e3:
                break
    return DesignFit(model, pose, feet, offsets)


def _jacobian(model: Model, pose: Float, station: Float) -> Float:
    """Return the derivatives (N, P) of the alignment's lateral position at stations (N,) by the model's parameters.

    A change of curvature at s' turns the rest about the place there, which moves it by t(s) . (z(s) - z(s')) across.
    """
    alignment = _alignment(model, pose)
    shift = model.knots[0]
    chain = Chain(pose, model.knots - shift, np.append(model.values[:, 0], 0.0), model.kinds)
    chain_stations = station - shift
    grid = quadrature_grid(chain, chain_stations)
    origin = np.array([alignment.x, alignment.y])
    position, heading, _ = alignment.frame(chain_stations)
    tangent = np.exp(-1j * heading)
    z = (position - origin) @ np.array([1.0, 1j])
    weight = (alignment.position(0.5 * (grid[1:] + grid[:-1])) - origin) @ np.array([1.0, 1j])
    lever = (tangent * z).real
    ramp_sums = ramp_integrals(chain, chain_stations, grid, np.ones(len(weight)))
    ramp_moments = ramp_integrals(chain, chain_stations, grid, weight)
    rise, fall = (
        lever[:, None] * a - (tangent[:, None] * b).real for a, b in zip(ramp_sums, ramp_moments, strict=True)
    )
    end_ramps = np.stack((fall, rise), axis=2).reshape(len(chain_stations), -1)
    slope = np.diff(model.values)[:, 0] / np.diff(model.knots)
    borders = (alignment.position(chain.knots[1:-1]) - origin) @ np.array([1.0, 1j])
    jump_effect = (chain_stations[:, None] > chain.knots[1:-1]) * (lever[:, None] - (tangent[:, None] * borders).real)
    jump = model.values[:-1, 1] - model.values[1:, 0]
    knots = -slope[:-1] * rise[:, :-1] - slope[1:] * fall[:, 1:] + jump * jump_effect
    start_shift = (tangent * np.exp(1j * alignment.start_heading)).real
    return np.hstack((start_shift[:, None], lever[:, None], end_ramps @ model.tie, knots))


def follow_heights(station: Float, heights: Float, length: float, tolerance: float = np.inf) -> Profile | None:
    """Return the profile on which heights (N,) of a design lie, over a road's length; None for heights with noise.

    Args:
        station, heights: (N,) of the points, m.
        length: length of the road, m.
        tolerance: largest swing of the heights between two points, m (`fitting.between`).
    """
    # On grades and vertical curves, which are parabolas, the grade (the first derivative) is linear and heights are
    # polynomials of degree 2.
    grade_order, heights_degree = 1, 2
    if len(station) > _SPARSE_HEIGHTS and noise_std(station, heights, heights_degree) > _NOISY:
        return None
    fit = match(find_elements(station, heights, grade_order), station, heights)
    limit = tolerance if fit.worst <= _ALLOWED else _DOUBTFUL * tolerance
    return profile_from_grades(calm_swings(fit.model, station, heights, limit), length)


def profile_from_grades(model: Model, length: float) -> Profile:
    """Return the profile of a model of grades from 0 to a length, m: parabolas and the kinks between grades."""
    model = _move_end(model, length)
    knots = model.knots
    knot_heights = model.evaluate(knots)
    rows = [(0.0, float(knot_heights[0] - model.values[0, 0] * knots[0]), 0.0)]  # station, elevation, tangent
    for e, (start_grade, end_grade) in enumerate(model.values.tolist()):
        element_length = float(knots[e + 1] - knots[e])
        if e and abs(start_grade - model.values[e - 1, 1]) > _FLAT:
            rows.append((float(knots[e]), float(knot_heights[e]), 0.0))
        if abs(end_grade - start_grade) > _FLAT:
            rows.append(
                (
                    float(knots[e]) + 0.5 * element_length,
                    float(knot_heights[e]) + 0.5 * element_length * start_grade,
                    0.5 * element_length,
                )
            )
    rows.append((length, float(knot_heights[-1]), 0.0))
    station, height, tangent = np.array(rows).T
    grades = np.diff(height) / np.diff(station)
    change = np.abs(np.concatenate([[0.0], np.diff(grades), [0.0]]))
    radius = np.where(tangent > 0.0, (2.0 - 1e-6) * tangent / np.where(change > 0.0, change, np.inf), 0.0)
    return Profile([IntersectionPoint(*(float(v) for v in row)) for row in zip(station, height, radius, strict=True)])


def _move_end(model: Model, end: float) -> Model:
    """Return a model whose last element is cut or prolonged to a station (m)."""
    knots, values = model.knots.copy(), model.values.copy()
    last_length = knots[-1] - knots[-2]
    # Chosen: a tenth of the last element stays.
    end = max(end, knots[-2] + 0.1 * last_length)
    values[-1, 1] = values[-1, 0] + (values[-1, 1] - values[-1, 0]) * (end - knots[-2]) / last_length
    knots[-1] = end
    return replace(model, knots=knots, values=values)
