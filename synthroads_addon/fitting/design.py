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
        start: (order,) value at the first knot, and with order 2 the first derivative there.
        knots: (M + 1,) stations, m.
        values: (M, 2) at the elements' starts and ends.
        kinds: (M,) FREE, EQUAL or ZERO.
        smooth: (M - 1,) whether the value of the element before a knot goes on in the one after it.
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
        """Return the matrix (2 M, G) that gives all elements' values from the free ones."""
        label = np.arange(2 * self.size)
        fixed = np.zeros(2 * self.size, bool)
        for e, kind in enumerate(self.kinds):
            if e and self.smooth[e - 1]:
                label[2 * e] = label[2 * e - 1]
            if kind != FREE:
                label[2 * e + 1] = label[2 * e]
            if kind == ZERO:
                fixed[label[2 * e]] = True
        held = fixed[label]
        names = np.unique(label[~held])
        return np.asarray(((label[:, None] == names) & ~held[:, None]).astype(np.float64))

    def tied(self) -> Model:
        """Return the model with values that obey its kinds: those tied together are set to their mean."""
        mean = self.tie.T @ self.values.ravel() / np.maximum(self.tie.sum(axis=0), 1.0)
        return replace(self, values=(self.tie @ mean).reshape(-1, 2))

    def freedom(self) -> int:
        """Return the number of free parameters."""
        return self.order + self.tie.shape[1] + self.size - 1

    def ramps(self, station: Float) -> tuple[Float, Float]:
        """Return what values of 1 at each element's start and end, alone, give at stations: twice (N, M)."""
        length = np.diff(self.knots)
        first = np.arange(self.size) == 0
        last = np.arange(self.size) == self.size - 1
        u = station[:, None] - self.knots[:-1]
        inside = np.where(first, np.minimum(u, length), np.clip(u, 0.0, length))
        inside = np.where(last, np.where(u > 0.0, u, 0.0) if self.size > 1 else u, inside)
        beyond = np.where(last, 0.0, np.maximum(u - length, 0.0))
        if self.order == 1:
            rise = inside**2 / (2.0 * length)
            return inside - rise, rise
        rise = inside**3 / (6.0 * length) + 0.5 * length * beyond
        return 0.5 * inside**2 + length * beyond - rise, rise

    def evaluate(self, station: Float) -> Float:
        """Return the function (N,) at stations (N,), m."""
        fall, rise = self.ramps(station)
        level = self.start[0] + (self.start[1] * (station - self.knots[0]) if self.order == 2 else 0.0)
        return np.asarray(level + fall @ self.values[:, 0] + rise @ self.values[:, 1])

    def jacobian(self, station: Float) -> Float:
        """Return the derivatives (N, P) of the function by start, free values and inner knots."""
        fall, rise = self.ramps(station)
        both = np.stack((fall, rise), axis=2).reshape(len(station), -1)
        slope = np.diff(self.values)[:, 0] / np.diff(self.knots)
        past = station[:, None] - self.knots[1:-1]
        step = np.maximum(past, 0.0) if self.order == 2 else (past > 0.0).astype(np.float64)
        jump = self.values[:-1, 1] - self.values[1:, 0]
        knots = -slope[:-1] * rise[:, :-1] - slope[1:] * fall[:, 1:] + jump * step
        head = [np.ones((len(station), 1))]
        if self.order == 2:
            head.append((station - self.knots[0])[:, None])
        return np.hstack((*head, both @ self.tie, knots))

    def moved(self, step: Float) -> Model:
        """Return the model after a step (P,) of its parameters, its knots kept in order."""
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
        rest: (N,) values less the model's, m.
    """

    model: Model
    rest: Float

    @property
    def square(self) -> float:
        """Return the sum of squares, m^2."""
        return float(self.rest @ self.rest)

    @property
    def worst(self) -> float:
        """Return the largest distance, m."""
        return float(np.abs(self.rest).max())


def match(model: Model, station: Float, values: Float, enough: float = 0.0) -> Match:
    """Return a model fitted to values (N,) at stations (N,) by Levenberg and Marquardt's steps.

    Args:
        model: to begin with.
        station, values: m.
        enough: largest distance (m) at which it is good enough to stop.
    """
    model = _started(model, station, values)
    best = Match(model, values - model.evaluate(station))
    damping, matrix = 1e-6, model.jacobian(station)
    for _ in range(_STEPS):
        if best.worst <= enough:
            break
        scale = np.maximum(np.sqrt((matrix**2).sum(axis=0)), 1e-12)
        normal = np.vstack((matrix / scale, np.sqrt(damping) * np.eye(len(scale))))
        step = np.linalg.lstsq(normal, np.append(best.rest, np.zeros(len(scale))), rcond=None)[0] / scale
        model = best.model.moved(step)
        trial = Match(model, values - model.evaluate(station))
        if trial.square < best.square:
            gain = 1.0 - trial.square / best.square
            best, damping, matrix = trial, max(0.1 * damping, _UNDAMPED), trial.model.jacobian(station)
            if gain < _ENOUGH and damping <= _UNDAMPED:
                break
        else:
            damping *= 10.0
            if damping > 1e3:
                break
    return best


def _started(model: Model, station: Float, values: Float) -> Model:
    """Return a model with start and values from a linear fit, its knots as they are."""
    model = replace(model, values=np.zeros_like(model.values))
    matrix = model.jacobian(station)[:, : model.order + model.tie.shape[1]]
    scale = np.maximum(np.sqrt((matrix**2).sum(axis=0)), 1e-12)
    solution = np.linalg.lstsq(matrix / scale, values, rcond=1e-12)[0] / scale
    ends = np.clip((model.tie @ solution[model.order :]).reshape(-1, 2), -_LIMIT[model.order], _LIMIT[model.order])
    return replace(model, start=solution[: model.order], values=ends)


def joined(pieces: Sequence[Piece], station: Float, order: int) -> Model:
    """Return the model of pieces, with short elements between those that meet at an angle (order 2)."""
    knots, kinds = [float(station[0])], [_kind(pieces[0], order)]
    smooth: list[bool] = []
    for before, after in itertools.pairwise(pieces):
        low, high = float(station[before.last]), float(station[after.first])
        wide = high - low
        least = 0.5 * (float(station[before.first]) + low) if before.first < before.last else low
        most = 0.5 * (high + float(station[after.last])) if after.first < after.last else high
        border = border_between(before, after, max(low - wide, least), min(high + wide, most))
        border = max(border, knots[-1] + _SHORT)
        kind = _kind(after, order)
        turn = before.at(border, order - 1) - after.at(border, order - 1)
        if order == 2 and abs(turn) > _KINK:
            half = 0.25 * wide
            start = max(border - half, 0.5 * (knots[-1] + border))
            knots += [start, border + half]
            kinds += [EQUAL, kind]
            smooth += [False, False]
            continue
        free = FREE in (kind, kinds[-1])
        knots.append(border)
        kinds.append(kind)
        smooth.append(free and (order == 2 or abs(turn) < _KINK))
    end = float(station[-1])
    knots.append(max(end, knots[-1] + _SHORT))
    count = len(kinds)
    return Model(np.zeros(order), np.array(knots), np.zeros((count, 2)), np.array(kinds), np.array(smooth, bool))


def _kind(piece: Piece, order: int) -> int:
    return _KINDS[piece.degree] if order == 2 else (EQUAL if piece.degree == 1 else FREE)


def repaired(fit: Match, station: Float, values: Float, allowed: float) -> Match:
    """Return a match with elements freed, borders opened and elements put in where it is farther off than allowed."""
    for _ in range(_REPAIRS):
        if fit.worst <= allowed:
            return fit
        at = float(station[int(np.abs(fit.rest).argmax())])
        model = fit.model
        element = int(np.clip(np.searchsorted(model.knots, at, "right") - 1, 0, model.size - 1))
        part = _Part.about(model, element, station, values)
        best, price = None, part.price(part.match(part.model, allowed), allowed)
        for trial in _richer(part.model, element - part.first, at):
            tried = part.match(trial, allowed)
            if part.price(tried, allowed) < price:
                best, price = tried, part.price(tried, allowed)
        if best is None:
            return fit
        whole = _placed(part.put_back(model, best.model), station, values)
        if whole.square >= fit.square * (1.0 - 1e-3):
            whole = match(whole.model, station, values, 0.1 * allowed)
            if whole.square >= fit.square * (1.0 - 1e-3):
                return fit
        fit = whole
    return match(fit.model, station, values, 0.1 * allowed)


def _placed(model: Model, station: Float, values: Float) -> Match:
    """Return the match of a model whose knots stay where they are."""
    model = _started(model, station, values)
    return Match(model, values - model.evaluate(station))


@dataclass(frozen=True)
class _Part:
    """A stretch of a model, to try edits on.

    Attributes:
        first, last: its elements.
        model: of the stretch.
        station, values: of its points, m.
    """

    first: int
    last: int
    model: Model
    station: Float
    values: Float

    @classmethod
    def about(cls, model: Model, element: int, station: Float, values: Float) -> _Part:
        first, last = max(0, element - _REACH), min(model.size - 1, element + _REACH)
        low = 0 if first == 0 else int(np.searchsorted(station, model.knots[first]))
        high = len(station) if last == model.size - 1 else int(np.searchsorted(station, model.knots[last + 1], "right"))
        part = replace(
            model,
            knots=model.knots[first : last + 2],
            values=model.values[first : last + 1],
            kinds=model.kinds[first : last + 1],
            smooth=model.smooth[first:last],
        )
        return cls(first, last, part, station[low:high], values[low:high])

    def match(self, model: Model, allowed: float) -> Match:
        return match(model, self.station, self.values, 0.1 * allowed)

    def price(self, fit: Match, allowed: float) -> float:
        """Return what a match costs: least for the nearest that has few free parameters."""
        square = max(fit.square, len(fit.rest) * (0.3 * allowed) ** 2)
        return 4.0 * float(np.log(max(square, 1e-30))) + fit.model.freedom()

    def put_back(self, model: Model, part: Model) -> Model:
        """Return a model with the elements of this stretch replaced."""
        first, last = self.first, self.last
        return replace(
            model,
            knots=np.concatenate([model.knots[:first], part.knots, model.knots[last + 2 :]]),
            values=np.concatenate([model.values[:first], part.values, model.values[last + 1 :]]),
            kinds=np.concatenate([model.kinds[:first], part.kinds, model.kinds[last + 1 :]]),
            smooth=np.concatenate([model.smooth[:first], part.smooth, model.smooth[last:]]),
        )


def _richer(model: Model, element: int, place: float) -> Iterator[Model]:
    """Yield models with one freedom more about an element: a border open, a kind freed, or an element put in."""
    for knot in (element - 1, element):
        if 0 <= knot < model.size - 1 and model.smooth[knot]:
            smooth = model.smooth.copy()
            smooth[knot] = False
            yield replace(model, smooth=smooth)
    for near in range(max(0, element - 1), min(model.size, element + 2)):
        yield from (_of_kind(model, near, kind) for kind in (EQUAL, FREE) if kind < model.kinds[near])
    for knot in (element, element + 1):
        if 0 < knot < model.size:
            kinds = (ZERO, EQUAL, FREE) if model.order == 2 else (EQUAL, FREE)
            yield from (_put_in(model, knot, kind) for kind in kinds)
    if model.knots[element] + _SHORT < place < model.knots[element + 1] - _SHORT:
        yield from (_split(model, element, place, smooth_there) for smooth_there in (False, True))


def _put_in(model: Model, knot: int, kind: int) -> Model:
    """Return the model with a short element put in at an inner knot."""
    before, after = np.diff(model.knots)[[knot - 1, knot]]
    half = min(1.0, 0.2 * min(before, after))
    knots = np.insert(model.knots, knot, model.knots[knot] - half)
    knots[knot + 1] += half
    kinds = np.insert(model.kinds, knot, kind)
    values = np.insert(model.values, knot, [model.values[knot - 1, 1], model.values[knot, 0]], axis=0)
    free = kind == FREE
    smooth = np.insert(model.smooth, knot - 1, free)
    smooth[knot] = free
    return replace(model, knots=knots, kinds=kinds, values=values, smooth=smooth)


def _split(model: Model, element: int, place: float, smooth_there: bool) -> Model:
    knots = np.insert(model.knots, element + 1, place)
    kinds = np.insert(model.kinds, element, model.kinds[element])
    if smooth_there:
        kinds[element : element + 2] = FREE
    elif model.order == 2:
        kinds[element : element + 2] = np.minimum(kinds[element : element + 2], EQUAL)
    first, last = model.values[element]
    share = (place - model.knots[element]) / (model.knots[element + 1] - model.knots[element])
    middle = first + share * (last - first)
    values = np.insert(model.values, element, [first, middle], axis=0)
    values[element + 1] = [middle, last]
    smooth = np.insert(model.smooth, element, smooth_there)
    return replace(model, knots=knots, kinds=kinds, values=values, smooth=smooth)


def simplified(fit: Match, station: Float, values: Float, allowed: float) -> Match:
    """Return a match with what it can spare taken away: elements, their freedom, open borders."""
    element = 0
    while element < fit.model.size:
        part = _Part.about(fit.model, element, station, values)
        # A stretch without points, between two that lie far apart, tells nothing of what would do there.
        simpler = sorted(_simpler(part.model, element - part.first), key=Model.freedom) if len(part.station) else ()
        for trial in simpler:
            tried = part.match(trial, allowed)
            if tried.worst <= allowed and tried.model.freedom() < part.model.freedom():
                whole = _placed(part.put_back(fit.model, tried.model), station, values)
                if whole.worst > allowed:
                    whole = match(whole.model, station, values, 0.1 * allowed)
                if whole.worst <= allowed:
                    fit, element = whole, max(-1, element - _REACH - 1)
                    break
        element += 1
    return fit


def _simpler(model: Model, element: int) -> Iterator[Model]:
    """Yield models with less freedom about an element: without it, a clothoid, of a simpler kind, smooth at its end."""
    kinds = model.kinds
    if model.size > 1:
        yield _without(model, element)
    if 0 < element < model.size - 1:
        for kind in {int(kinds[element - 1]), int(kinds[element]), int(kinds[element + 1])}:
            yield _as_one(model, element, kind)
        if model.order == 2 and kinds[element] == EQUAL and FREE not in kinds[[element - 1, element + 1]]:
            yield _eased(model, element)
    for kind in (ZERO, EQUAL) if model.order == 2 else (EQUAL,):
        if kinds[element] < kind or (kinds[element] == EQUAL and kind == ZERO):
            yield _of_kind(model, element, kind)
    if element < model.size - 1 and not model.smooth[element] and FREE in kinds[element : element + 2]:
        smooth = model.smooth.copy()
        smooth[element] = True
        yield replace(model, smooth=smooth)


def _of_kind(model: Model, element: int, kind: int) -> Model:
    """Return the model with an element of another kind; borders of lines and arcs alone are open."""
    kinds, smooth = model.kinds.copy(), model.smooth.copy()
    kinds[element] = kind
    for knot in (element - 1, element):
        if 0 <= knot < model.size - 1 and FREE not in kinds[knot : knot + 2]:
            smooth[knot] = False
    return replace(model, kinds=kinds, smooth=smooth)


def _eased(model: Model, element: int) -> Model:
    """Return the model with a clothoid, continuous at both ends, in place of an arc between two lines or arcs."""
    kinds, smooth = model.kinds.copy(), model.smooth.copy()
    kinds[element] = FREE
    smooth[[element - 1, element]] = True
    return replace(model, kinds=kinds, smooth=smooth)


def _as_one(model: Model, element: int, kind: int) -> Model:
    """Return the model with an element and both of its neighbours as one of a kind."""
    part = slice(element, element + 2)
    one = replace(
        model,
        knots=np.delete(model.knots, part),
        kinds=np.delete(model.kinds, part),
        values=np.delete(model.values, part, axis=0),
        smooth=np.delete(model.smooth, slice(element - 1, element + 1)),
    )
    return _of_kind(one, element - 1, kind)


def _without(model: Model, element: int) -> Model:
    """Return the model with an element left out, its neighbours prolonged to its middle."""
    middle = 0.5 * (model.knots[element] + model.knots[element + 1])
    kinds = np.delete(model.kinds, element)
    values = np.delete(model.values, element, axis=0)
    if element == 0:
        return replace(model, knots=np.delete(model.knots, 1), kinds=kinds, values=values, smooth=model.smooth[1:])
    if element == model.size - 1:
        return replace(model, knots=np.delete(model.knots, -2), kinds=kinds, values=values, smooth=model.smooth[:-1])
    knots = np.delete(model.knots, element + 1)
    knots[element] = middle
    smooth = np.delete(model.smooth, element)
    smooth[element - 1] = FREE in kinds[element - 1 : element + 1]
    return replace(model, knots=knots, kinds=kinds, values=values, smooth=smooth)
