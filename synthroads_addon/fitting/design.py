"""Elements of a design found again from points on it: pieces, joined, fitted together, repaired and simplified.

The model is a function whose second derivative (in plan, of the unrolled line: the curvature) or first one (in height:
the grade) is linear on each element; it may jump from one element to the next. See `fitting.pieces` for the function.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..base.arrays import Float, Int
from .chain import EQUAL, FREE, ZERO
from .pieces import Piece, border_between

_ROOM = 0.45
"""Share of an element's length that a knot may move in one step. Chosen: below a half, so that neighbours never
meet."""
_KINK = 2e-4
"""Change of direction (rad) between two pieces from which a short element is put between them. Chosen: 0.2 mm over a
metre, what files' rounding leaves."""
_STEPS = 25
"""Levenberg and Marquardt's steps at most. Chosen: bounds the work; most fits end by themselves."""
_ENOUGH = 1e-4
"""Share of its sum of squares that a step must win for another one. Chosen: less changes no coordinate that is
written."""
_UNDAMPED = 1e-11
"""Least damping. Chosen: Gauss and Newton's step, and a matrix of full rank."""
_REACH = 2
"""Elements on either side of an edit that are fitted anew with it. Chosen: what lies farther off hardly moves."""
_REPAIRS = 40
"""Edits of a repair at most. Chosen: bounds the work."""
_SHORT = 0.02
"""Shortest element, m. Chosen: less than any element of a design."""
_LIMIT = {1: 10.0, 2: 0.1}
"""Largest grade, and curvature (1/m). Chosen: beyond any road's; they keep steps of the fit in bounds."""
_KINDS = {1: ZERO, 2: EQUAL, 3: FREE}
"""Kind of element by the degree of a piece's polynomial, in plan."""


@dataclass(frozen=True)
class Model:
    """Elements with linear curvature (order 2) or grade (order 1).

    Attributes:
        start: (order,) the function's value at the first knot, and with order 2 its first derivative there.
        knots: (M + 1,) stations, m.
        values: (M, 2) curvature or grade at each element's start and end.
        kinds: (M,) FREE, EQUAL or ZERO.
        smooth: (M - 1,) whether curvature or grade is continuous at each inner knot.
    """

    start: Float
    knots: Float
    values: Float
    kinds: Int
    smooth: np.ndarray

    @property
    def size(self) -> int:
        """Return the number M of elements."""
        return len(self.kinds)

    @property
    def order(self) -> int:
        """Return the order of the derivative that the elements give."""
        return len(self.start)

    @cached_property
    def tie(self) -> Float:
        """Return the matrix (2 M, G) that gives the start and end values of all elements from the free values."""
        label = np.arange(2 * self.size)
        is_zero = np.zeros(2 * self.size, bool)
        for e, kind in enumerate(self.kinds):
            if e and self.smooth[e - 1]:
                label[2 * e] = label[2 * e - 1]
            if kind != FREE:
                label[2 * e + 1] = label[2 * e]
            if kind == ZERO:
                is_zero[label[2 * e]] = True
        is_fixed = is_zero[label]
        free_labels = np.unique(label[~is_fixed])
        return np.asarray(((label[:, None] == free_labels) & ~is_fixed[:, None]).astype(np.float64))

    def tie_values(self) -> Model:
        """Return the model with values that obey its elements' kinds: those tied together are set to their mean."""
        mean = self.tie.T @ self.values.ravel() / np.maximum(self.tie.sum(axis=0), 1.0)
        return replace(self, values=(self.tie @ mean).reshape(-1, 2))

    def freedom(self) -> int:
        """Return the number of free parameters."""
        return self.order + self.tie.shape[1] + self.size - 1

    def ramps(self, station: Float) -> tuple[Float, Float]:
        """Return the function at stations (N,) by unit values at each element's start, and at its end, (N, M) each.

        The integral (order 1) or double integral (order 2) of the falling and the rising ramp of each element.
        """
        length = np.diff(self.knots)
        is_first = np.arange(self.size) == 0
        is_last = np.arange(self.size) == self.size - 1
        distance = station[:, None] - self.knots[:-1]
        inner_distance = np.where(is_first, np.minimum(distance, length), np.clip(distance, 0.0, length))
        inner_distance = np.where(
            is_last, np.where(distance > 0.0, distance, 0.0) if self.size > 1 else distance, inner_distance
        )
        distance_beyond = np.where(is_last, 0.0, np.maximum(distance - length, 0.0))
        if self.order == 1:
            rise = inner_distance**2 / (2.0 * length)
            return inner_distance - rise, rise
        rise = inner_distance**3 / (6.0 * length) + 0.5 * length * distance_beyond
        return 0.5 * inner_distance**2 + length * distance_beyond - rise, rise

    def evaluate(self, station: Float) -> Float:
        """Return the function (N,) at stations (N,), m."""
        fall, rise = self.ramps(station)
        straight_part = self.start[0] + (self.start[1] * (station - self.knots[0]) if self.order == 2 else 0.0)
        return np.asarray(straight_part + fall @ self.values[:, 0] + rise @ self.values[:, 1])

    def jacobian(self, station: Float) -> Float:
        """Return the derivatives (N, P) of the function by start, free values and inner knots."""
        fall, rise = self.ramps(station)
        end_ramps = np.stack((fall, rise), axis=2).reshape(len(station), -1)
        slope = np.diff(self.values)[:, 0] / np.diff(self.knots)
        distance_past = station[:, None] - self.knots[1:-1]
        step = np.maximum(distance_past, 0.0) if self.order == 2 else (distance_past > 0.0).astype(np.float64)
        jump = self.values[:-1, 1] - self.values[1:, 0]
        knots = -slope[:-1] * rise[:, :-1] - slope[1:] * fall[:, 1:] + jump * step
        head = [np.ones((len(station), 1))]
        if self.order == 2:
            head.append((station - self.knots[0])[:, None])
        return np.hstack((*head, end_ramps @ self.tie, knots))

    def apply_step(self, step: Float) -> Model:
        """Return the model after a step (P,) of its parameters, limited so that knots keep their order."""
        count = self.tie.shape[1]
        values = self.values + (self.tie @ step[self.order : self.order + count]).reshape(-1, 2)
        values = np.clip(values, -_LIMIT[self.order], _LIMIT[self.order])
        room = _ROOM * np.maximum(np.diff(self.knots) - _SHORT, 0.0)
        knots = self.knots.copy()
        knots[1:-1] += np.clip(step[self.order + count :], -room[:-1], room[1:])
        return replace(self, start=self.start + step[: self.order], values=values, knots=knots)


@dataclass(frozen=True)
class Match:
    """A model fitted to values.

    Attributes:
        model: the model.
        rest: (N,) residuals: values less the model's, m.
    """

    model: Model
    rest: Float

    @property
    def square(self) -> float:
        """Return the sum of squares, m^2."""
        return float(self.rest @ self.rest)

    @property
    def worst(self) -> float:
        """Return the largest absolute residual, m."""
        return float(np.abs(self.rest).max())


def match(model: Model, station: Float, values: Float, close_enough: float = 0.0) -> Match:
    """Return a model fitted to values (N,) at stations (N,) by Levenberg and Marquardt's steps.

    Args:
        model: model whose kinds and knots the fit begins with.
        station, values: (N,) m.
        close_enough: largest residual (m) at which the fit stops.
    """
    model = _fit_linearly(model, station, values)
    best_match = Match(model, values - model.evaluate(station))
    damping, matrix = 1e-6, model.jacobian(station)
    for _ in range(_STEPS):
        if best_match.worst <= close_enough:
            break
        scale = np.maximum(np.sqrt((matrix**2).sum(axis=0)), 1e-12)
        normal = np.vstack((matrix / scale, np.sqrt(damping) * np.eye(len(scale))))
        step = np.linalg.lstsq(normal, np.append(best_match.rest, np.zeros(len(scale))), rcond=None)[0] / scale
        model = best_match.model.apply_step(step)
        trial = Match(model, values - model.evaluate(station))
        if trial.square < best_match.square:
            gain = 1.0 - trial.square / best_match.square
            best_match, damping, matrix = trial, max(0.1 * damping, _UNDAMPED), trial.model.jacobian(station)
            if gain < _ENOUGH and damping <= _UNDAMPED:
                break
        else:
            damping *= 10.0
            if damping > 1e3:
                break
    return best_match


def _fit_linearly(model: Model, station: Float, values: Float) -> Model:
    """Return the model with start and values fitted linearly to values (N,) at stations (N,), m; its knots stay."""
    model = replace(model, values=np.zeros_like(model.values))
    matrix = model.jacobian(station)[:, : model.order + model.tie.shape[1]]
    scale = np.maximum(np.sqrt((matrix**2).sum(axis=0)), 1e-12)
    solution = np.linalg.lstsq(matrix / scale, values, rcond=1e-12)[0] / scale
    ends = np.clip((model.tie @ solution[model.order :]).reshape(-1, 2), -_LIMIT[model.order], _LIMIT[model.order])
    return replace(model, start=solution[: model.order], values=ends)


def model_of_pieces(pieces: Sequence[Piece], station: Float, order: int) -> Model:
    """Return the model with an element for each piece, and in plan short ones between pieces that meet at an angle.

    Args:
        pieces: consecutive pieces over all points.
        station: (N,) of the points, m.
        order: 2 in plan, 1 in height.
    """
    knots, kinds = [float(station[0])], [_kind(pieces[0], order)]
    is_smooth: list[bool] = []
    for piece_before, piece_after in itertools.pairwise(pieces):
        last_station, next_station = float(station[piece_before.last]), float(station[piece_after.first])
        gap = next_station - last_station
        # The border lies within a gap's length beside the gap, and not beyond the middles of both pieces.
        earliest = (
            0.5 * (float(station[piece_before.first]) + last_station)
            if piece_before.first < piece_before.last
            else last_station
        )
        latest = (
            0.5 * (next_station + float(station[piece_after.last]))
            if piece_after.first < piece_after.last
            else next_station
        )
        border = border_between(
            piece_before, piece_after, max(last_station - gap, earliest), min(next_station + gap, latest)
        )
        border = max(border, knots[-1] + _SHORT)
        kind = _kind(piece_after, order)
        turn = piece_before.at(border, order - 1) - piece_after.at(border, order - 1)
        # An angle between the pieces: a short arc around the border turns by it.
        if order == 2 and abs(turn) > _KINK:
            half_length = 0.25 * gap
            start = max(border - half_length, 0.5 * (knots[-1] + border))
            knots += [start, border + half_length]
            kinds += [EQUAL, kind]
            is_smooth += [False, False]
            continue
        has_free_element = FREE in (kind, kinds[-1])
        knots.append(border)
        kinds.append(kind)
        is_smooth.append(has_free_element and (order == 2 or abs(turn) < _KINK))
    end = float(station[-1])
    knots.append(max(end, knots[-1] + _SHORT))
    count = len(kinds)
    return Model(np.zeros(order), np.array(knots), np.zeros((count, 2)), np.array(kinds), np.array(is_smooth, bool))


def _kind(piece: Piece, order: int) -> int:
    """Return the kind of element that a piece's degree makes: in height degree 1 is a constant grade."""
    return _KINDS[piece.degree] if order == 2 else (EQUAL if piece.degree == 1 else FREE)


def repair_match(fit: Match, station: Float, values: Float, tolerance: float) -> Match:
    """Return a match improved where its residual exceeds a tolerance: elements freed or inserted, borders opened.

    Args:
        fit: match to begin with.
        station, values: (N,) m.
        tolerance: largest residual, m.
    """
    for _ in range(_REPAIRS):
        if fit.worst <= tolerance:
            return fit
        worst_station = float(station[int(np.abs(fit.rest).argmax())])
        model = fit.model
        element = int(np.clip(np.searchsorted(model.knots, worst_station, "right") - 1, 0, model.size - 1))
        part = _Part.about(model, element, station, values)
        best_trial, price = None, part.price(part.match(part.model, tolerance), tolerance)
        for trial in _richer_models(part.model, element - part.first, worst_station):
            trial_match = part.match(trial, tolerance)
            if part.price(trial_match, tolerance) < price:
                best_trial, price = trial_match, part.price(trial_match, tolerance)
        if best_trial is None:
            return fit
        whole_match = _match_fixed_knots(part.put_back(model, best_trial.model), station, values)
        if whole_match.square >= fit.square * (1.0 - 1e-3):
            whole_match = match(whole_match.model, station, values, 0.1 * tolerance)
            if whole_match.square >= fit.square * (1.0 - 1e-3):
                return fit
        fit = whole_match
    return match(fit.model, station, values, 0.1 * tolerance)


def _match_fixed_knots(model: Model, station: Float, values: Float) -> Match:
    """Return the match of a model with its start and values fitted and its knots fixed."""
    model = _fit_linearly(model, station, values)
    return Match(model, values - model.evaluate(station))


@dataclass(frozen=True)
class _Part:
    """A stretch of a model on which edits are tried.

    Attributes:
        first, last: indices of its first and last element.
        model: model of the stretch alone.
        station, values: (N,) of the stretch's points, m.
    """

    first: int
    last: int
    model: Model
    station: Float
    values: Float

    @classmethod
    def about(cls, model: Model, element: int, station: Float, values: Float) -> _Part:
        """Return the stretch of a model within `_REACH` elements of one, with its points."""
        first_element, last_element = max(0, element - _REACH), min(model.size - 1, element + _REACH)
        first_point = 0 if first_element == 0 else int(np.searchsorted(station, model.knots[first_element]))
        end_point = (
            len(station)
            if last_element == model.size - 1
            else int(np.searchsorted(station, model.knots[last_element + 1], "right"))
        )
        part = replace(
            model,
            knots=model.knots[first_element : last_element + 2],
            values=model.values[first_element : last_element + 1],
            kinds=model.kinds[first_element : last_element + 1],
            smooth=model.smooth[first_element:last_element],
        )
        return cls(first_element, last_element, part, station[first_point:end_point], values[first_point:end_point])

    def match(self, model: Model, tolerance: float) -> Match:
        """Return a model of the stretch fitted to the stretch's points, to a tenth of a tolerance, m."""
        return match(model, self.station, self.values, 0.1 * tolerance)

    def price(self, fit: Match, tolerance: float) -> float:
        """Return the price of a match, lower for small residuals and few free parameters.

        Residuals below 0.3 of the tolerance, m, gain nothing; halving their sum of squares is worth 2.8 parameters
        (chosen).
        """
        square = max(fit.square, len(fit.rest) * (0.3 * tolerance) ** 2)
        return 4.0 * float(np.log(max(square, 1e-30))) + fit.model.freedom()

    def put_back(self, model: Model, part: Model) -> Model:
        """Return a model with the elements of this stretch replaced."""
        first_element, last_element = self.first, self.last
        return replace(
            model,
            knots=np.concatenate([model.knots[:first_element], part.knots, model.knots[last_element + 2 :]]),
            values=np.concatenate([model.values[:first_element], part.values, model.values[last_element + 1 :]]),
            kinds=np.concatenate([model.kinds[:first_element], part.kinds, model.kinds[last_element + 1 :]]),
            smooth=np.concatenate([model.smooth[:first_element], part.smooth, model.smooth[last_element:]]),
        )


def _richer_models(model: Model, element: int, station: float) -> Iterator[Model]:
    """Yield models with more freedom around an element: a border opened, a kind freed, or an element inserted.

    Args:
        model: model of a stretch.
        element: index of the element.
        station: station (m) of the largest residual, at which the element may be split.
    """
    for knot in (element - 1, element):
        if 0 <= knot < model.size - 1 and model.smooth[knot]:
            is_smooth = model.smooth.copy()
            is_smooth[knot] = False
            yield replace(model, smooth=is_smooth)
    for neighbour in range(max(0, element - 1), min(model.size, element + 2)):
        yield from (_set_kind(model, neighbour, kind) for kind in (EQUAL, FREE) if kind < model.kinds[neighbour])
    for knot in (element, element + 1):
        if 0 < knot < model.size:
            kinds = (ZERO, EQUAL, FREE) if model.order == 2 else (EQUAL, FREE)
            yield from (_insert_element(model, knot, kind) for kind in kinds)
    if model.knots[element] + _SHORT < station < model.knots[element + 1] - _SHORT:
        yield from (_split_element(model, element, station, joins_smoothly) for joins_smoothly in (False, True))


def _insert_element(model: Model, knot: int, kind: int) -> Model:
    """Return the model with a short element of a kind, at most 2 m long, inserted at an inner knot."""
    length_before, length_after = np.diff(model.knots)[[knot - 1, knot]]
    half_length = min(1.0, 0.2 * min(length_before, length_after))
    knots = np.insert(model.knots, knot, model.knots[knot] - half_length)
    knots[knot + 1] += half_length
    kinds = np.insert(model.kinds, knot, kind)
    values = np.insert(model.values, knot, [model.values[knot - 1, 1], model.values[knot, 0]], axis=0)
    is_free = kind == FREE
    is_smooth = np.insert(model.smooth, knot - 1, is_free)
    is_smooth[knot] = is_free
    return replace(model, knots=knots, kinds=kinds, values=values, smooth=is_smooth)


def _split_element(model: Model, element: int, station: float, joins_smoothly: bool) -> Model:
    """Return the model with an element split at a station, m: smoothly into free ones, else by a jump into arcs."""
    knots = np.insert(model.knots, element + 1, station)
    kinds = np.insert(model.kinds, element, model.kinds[element])
    if joins_smoothly:
        kinds[element : element + 2] = FREE
    elif model.order == 2:
        kinds[element : element + 2] = np.minimum(kinds[element : element + 2], EQUAL)
    start_value, end_value = model.values[element]
    share = (station - model.knots[element]) / (model.knots[element + 1] - model.knots[element])
    middle = start_value + share * (end_value - start_value)
    values = np.insert(model.values, element, [start_value, middle], axis=0)
    values[element + 1] = [middle, end_value]
    is_smooth = np.insert(model.smooth, element, joins_smoothly)
    return replace(model, knots=knots, kinds=kinds, values=values, smooth=is_smooth)


def simplify_match(fit: Match, station: Float, values: Float, tolerance: float) -> Match:
    """Return a match simplified within a tolerance: elements removed, their freedom reduced, borders closed.

    Args:
        fit: match to begin with.
        station, values: (N,) m.
        tolerance: largest residual that is allowed, m.
    """
    element = 0
    while element < fit.model.size:
        part = _Part.about(fit.model, element, station, values)
        # A stretch without points, between two that lie far apart, tells nothing of what would do there.
        trial_models = (
            sorted(_simpler_models(part.model, element - part.first), key=Model.freedom) if len(part.station) else ()
        )
        for trial in trial_models:
            trial_match = part.match(trial, tolerance)
            if trial_match.worst <= tolerance and trial_match.model.freedom() < part.model.freedom():
                whole_match = _match_fixed_knots(part.put_back(fit.model, trial_match.model), station, values)
                if whole_match.worst > tolerance:
                    whole_match = match(whole_match.model, station, values, 0.1 * tolerance)
                if whole_match.worst <= tolerance:
                    fit, element = whole_match, max(-1, element - _REACH - 1)
                    break
        element += 1
    return fit


def _simpler_models(model: Model, element: int) -> Iterator[Model]:
    """Yield models with less freedom about an element: without it, a clothoid, of a simpler kind, smooth at its end."""
    kinds = model.kinds
    if model.size > 1:
        yield _remove_element(model, element)
    if 0 < element < model.size - 1:
        for kind in {int(kinds[element - 1]), int(kinds[element]), int(kinds[element + 1])}:
            yield _merge_with_neighbours(model, element, kind)
        if model.order == 2 and kinds[element] == EQUAL and FREE not in kinds[[element - 1, element + 1]]:
            yield _replace_by_clothoid(model, element)
    for kind in (ZERO, EQUAL) if model.order == 2 else (EQUAL,):
        if kinds[element] < kind or (kinds[element] == EQUAL and kind == ZERO):
            yield _set_kind(model, element, kind)
    if element < model.size - 1 and not model.smooth[element] and FREE in kinds[element : element + 2]:
        is_smooth = model.smooth.copy()
        is_smooth[element] = True
        yield replace(model, smooth=is_smooth)


def _set_kind(model: Model, element: int, kind: int) -> Model:
    """Return the model with an element of another kind; borders between lines and arcs become open."""
    kinds, is_smooth = model.kinds.copy(), model.smooth.copy()
    kinds[element] = kind
    for knot in (element - 1, element):
        if 0 <= knot < model.size - 1 and FREE not in kinds[knot : knot + 2]:
            is_smooth[knot] = False
    return replace(model, kinds=kinds, smooth=is_smooth)


def _replace_by_clothoid(model: Model, element: int) -> Model:
    """Return the model with a clothoid, continuous at both ends, in place of an arc between two lines or arcs."""
    kinds, is_smooth = model.kinds.copy(), model.smooth.copy()
    kinds[element] = FREE
    is_smooth[[element - 1, element]] = True
    return replace(model, kinds=kinds, smooth=is_smooth)


def _merge_with_neighbours(model: Model, element: int, kind: int) -> Model:
    """Return the model with an element and both of its neighbours merged into one element of a kind."""
    knot_pair = slice(element, element + 2)
    merged_model = replace(
        model,
        knots=np.delete(model.knots, knot_pair),
        kinds=np.delete(model.kinds, knot_pair),
        values=np.delete(model.values, knot_pair, axis=0),
        smooth=np.delete(model.smooth, slice(element - 1, element + 1)),
    )
    return _set_kind(merged_model, element - 1, kind)


def _remove_element(model: Model, element: int) -> Model:
    """Return the model without an element, its neighbours prolonged to its middle."""
    middle = 0.5 * (model.knots[element] + model.knots[element + 1])
    kinds = np.delete(model.kinds, element)
    values = np.delete(model.values, element, axis=0)
    if element == 0:
        return replace(model, knots=np.delete(model.knots, 1), kinds=kinds, values=values, smooth=model.smooth[1:])
    if element == model.size - 1:
        return replace(model, knots=np.delete(model.knots, -2), kinds=kinds, values=values, smooth=model.smooth[:-1])
    knots = np.delete(model.knots, element + 1)
    knots[element] = middle
    is_smooth = np.delete(model.smooth, element)
    is_smooth[element - 1] = FREE in kinds[element - 1 : element + 1]
    return replace(model, knots=knots, kinds=kinds, values=values, smooth=is_smooth)
