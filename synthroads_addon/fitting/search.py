"""Which elements an axis is made of: knots and kinds of a chain, found by trying, scored, and refined at every step.

Starting from more knots than needed, `search` takes away what the data can spare (a knot; the freedom of an element to
be no arc, or no line), first with the knots where they are, then with knots that move. Costs of a removal are predicted
by the linearised problem, in which all other parameters give way, and then measured by a refinement. From the best
chain found on the way down it goes on in both directions until nothing helps.

A chain is scored by the Bayesian information criterion, with one independent observation per `_CORRELATED` metres
(errors of measured axes hang together) and a floor under the residual: what lies far below the tolerance is not worth
an element, unless the data are exact.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..base.arrays import Float, Int
from .chain import (
    EQUAL,
    FREE,
    ZERO,
    AxisData,
    Chain,
    ChainFit,
    apply_step,
    column_scale,
    knot_penalty,
    least_squares,
    refine,
)

_CORRELATED = 20.0
"""Distance of independent errors of a measured axis, m. Chosen: a car's sway and a smoothed track's."""
_TRIALS, _STEPS = 3, 12
"""Refinements per decision, and the steps of each. Chosen: bounds the work; predictions are mostly right in their
order."""
_PARTS = 4
"""Parts at one of whose inner borders an element is split. Chosen: the knot moves to its place afterwards."""
_WORTH = 0.05
"""Least gain of score for which an edit is made. Chosen: far below the cost of an element, ln n."""
_HOPELESS = 10.0
"""Times the bound at which a descent ends. Chosen: no later edit makes that good."""


@dataclass(frozen=True)
class Edit:
    """One simplification: take knot `index` away, or snap element `index` to a kind."""

    kind: Literal["merge"] | int
    index: int

    @property
    def span(self) -> tuple[int, int]:
        """Return the first and the last element concerned."""
        return (self.index - 1, self.index) if self.kind == "merge" else (self.index, self.index)


#: An edit, the linear conditions (C, P) that it imposes on the free parameters, and how far they are from true (C,).
Condition = tuple[Edit, Float, Float]


@dataclass(frozen=True)
class Goal:
    """Bounds of a fit and scoring of chains in the search.

    Attributes:
        rms, p95: bounds of the residuals, m.
        floor: residual below which nothing is worth an element, m.
        count: observations that the score counts as independent.
        most: elements wanted at most.
    """

    rms: float
    p95: float
    floor: float
    count: float
    most: int

    def is_met(self, fit: ChainFit) -> bool:
        return fit.rms <= self.rms and fit.p95 <= self.p95

    def score(self, fit: ChainFit) -> float:
        return self.expected_score(fit.sum_of_squares, fit.chain, len(fit.residuals))

    def expected_score(self, square: float, chain: Chain, points: int) -> float:
        """Return the score (BIC, least is best) of a chain with a sum of squares, m^2; elements cost extra."""
        # Schwarz 1978: BIC = n ln(RSS / n) + k ln n, here of n independent observations, with half a parameter more for
        # each element (chosen: of two chains as free the one with fewer elements).
        misfit = np.log(max(square, 0.0) / points + self.floor**2)
        return self.count * misfit + (chain.freedom() + 0.5 * chain.size) * np.log(self.count)

    def rank(self, fit: ChainFit) -> tuple[bool, bool, float]:
        """Return a sort key, least for the best fit: bounds first, then the number of elements, then the score."""
        return (not self.is_met(fit), fit.chain.size > self.most, self.score(fit))


def independent_count(length: float, points: int) -> float:
    """Return the number of observations that count as independent along a length (m), at least 4."""
    return max(4.0, min(float(points), max(10.0, length / _CORRELATED)))


def apply_edits(chain: Chain, edits: Sequence[Edit]) -> tuple[Chain, list[int]]:
    """Return the chain after edits, its values as they are, and the indices of the knots that stay.

    Constant elements that come to lie side by side are one.
    """
    gone = {edit.index for edit in edits if edit.kind == "merge"}
    snapped = {edit.index: edit.kind for edit in edits if edit.kind != "merge"}
    keep, merged_kinds = [0], set()
    kinds: list[int] = []
    for e, kind in enumerate(chain.kinds.tolist()):
        merged_kinds.add(snapped.get(e, kind))
        if e + 1 in gone:
            continue
        new = merged_kinds.pop() if len(merged_kinds) == 1 else FREE
        merged_kinds = set()
        if new != FREE and kinds and kinds[-1] != FREE:
            kinds[-1] = max(new, kinds[-1])  # a line beside an arc is one with it
            keep[-1] = e + 1
        else:
            kinds.append(new)
            keep.append(e + 1)
    return replace(chain, knots=chain.knots[keep], values=chain.values[keep], kinds=np.array(kinds)), keep


def _interpolation(chain: Chain, keep: list[int]) -> tuple[Float, Float]:
    """Return matrices from the kept values, (M + 1, K), and from the knots, (M + 1, M + 1), to the old values."""
    weights = np.zeros((chain.size + 1, len(keep)))
    weights[keep, np.arange(len(keep))] = 1.0
    shifts = np.zeros((chain.size + 1, chain.size + 1))
    for i in set(range(chain.size + 1)) - set(keep):
        j = int(np.searchsorted(keep, i))
        a, b = keep[j - 1], keep[j]
        length = chain.knots[b] - chain.knots[a]
        share, change = (chain.knots[i] - chain.knots[a]) / length, chain.values[b] - chain.values[a]
        weights[i, j - 1], weights[i, j] = 1.0 - share, share
        shifts[i, a], shifts[i, b] = -change * (1.0 - share) / length, -change * share / length
    return weights, shifts


def _lift_matrix(chain: Chain, new: Chain, keep: list[int]) -> Float:
    """Return the matrix that gives all parameters of the chain from those of the edited one."""
    weights, shifts = _interpolation(chain, keep)
    inner = [i for i in keep if 0 < i < chain.size]
    old_knots, new_knots = chain.value_columns.stop, new.value_columns.stop
    lift = np.zeros((old_knots + chain.size - 1, new_knots + new.size - 1))
    lift[: chain.pose_size, : chain.pose_size] = np.eye(chain.pose_size)
    lift[chain.value_columns, new.value_columns] = weights
    lift[chain.value_columns, new_knots:] = shifts[:, inner]
    lift[[old_knots + i - 1 for i in inner], range(new_knots, new_knots + len(inner))] = 1.0
    return lift


def predict_edits(fit: ChainFit, edits: Sequence[Edit], free_knots: bool, goal: Goal) -> tuple[Chain, float]:
    """Return the edited chain at the optimum of the linearised problem, and the sum of squares expected there."""
    new, keep = apply_edits(fit.chain, edits)
    new = new.tie_values()
    basis, lift = new.basis(free_knots), _lift_matrix(fit.chain, new, keep)
    start = np.zeros(len(lift))  # the jump to the new chain's values
    values = fit.chain.value_columns
    start[values] = lift[values, new.value_columns] @ new.values - fit.chain.values
    r, projected = fit.linear
    matrix, target = r @ (lift @ basis), -(projected + r @ start)
    held = _allowance(fit, goal) * knot_penalty(fit.data, new, basis.shape[1]) if free_knots else matrix[:0]
    scale = column_scale(matrix)
    rows = np.vstack((matrix / scale, held / scale, 1e-6 * np.eye(len(scale))))
    scaled = least_squares(rows, np.concatenate((target, np.zeros(len(rows) - len(target)))))
    rest = rows @ scaled
    rest[: len(target)] -= target
    square = float(rest @ rest) - float(projected @ projected) + fit.sum_of_squares
    return apply_step(fit.data, new, basis @ (scaled / scale)), square


def _allowance(fit: ChainFit, goal: Goal) -> float:
    """Return the cost of a knot's step over its whole room, m: the root of all squared residuals, floors included."""
    return float(np.sqrt(fit.sum_of_squares + len(fit.residuals) * goal.floor**2))


def _covariance_root(fit: ChainFit, free_knots: bool, goal: Goal) -> Float:
    """Return a matrix W with W.T @ W the covariance of the free parameters for unit noise."""
    basis = fit.chain.basis(free_knots)
    rows = fit.linear[0] @ basis
    if free_knots:
        rows = np.vstack((rows, _allowance(fit, goal) * knot_penalty(fit.data, fit.chain, basis.shape[1])))
    scale = column_scale(rows)
    root = np.linalg.qr(np.vstack((rows / scale, 1e-6 * np.eye(len(scale)))), mode="r")
    return np.linalg.solve(root, np.eye(len(scale))).T / scale


def rank_edits(fit: ChainFit, free_knots: bool, goal: Goal) -> list[tuple[float, Edit]]:
    """Return (expected change of score, edit) for all single edits, cheapest first, by their Wald statistics."""
    chain, present = fit.chain, goal.score(fit)
    root = _covariance_root(fit, free_knots, goal)
    basis = chain.basis(free_knots)
    conditions = list(_merges(chain, basis, free_knots))
    if free_knots:
        conditions += _snaps(fit.data, chain, basis)
    result = []
    for edit, rows, violation in conditions:
        spread = root @ rows.T
        if edit.kind == "merge" and free_knots:  # the knot itself stays where it is until it is gone
            knot_column = root[:, basis.shape[1] - chain.size + edit.index]
            spread = spread - knot_column[:, None] * (knot_column @ spread) / (knot_column @ knot_column)
        square = spread.T @ spread
        square[np.diag_indices(len(square))] *= 1.0 + 1e-9
        if (np.diag(square) > 0).all():
            cost = float(violation @ np.linalg.solve(square, violation))
            score = goal.expected_score(fit.sum_of_squares + cost, apply_edits(chain, [edit])[0], len(fit.residuals))
            result.append((score - present, edit))
    return sorted(result, key=lambda pair: pair[0])


def _merges(chain: Chain, basis: Float, free_knots: bool) -> Iterator[Condition]:
    """Yield for each inner knot its removal, on condition that its value is that of the straight past it."""
    rows, knots, values = basis[chain.value_columns], chain.knots, chain.values
    first = basis.shape[1] - chain.size  # + i: the column of inner knot i
    for i in range(1, chain.size):
        length, change = knots[i + 1] - knots[i - 1], values[i + 1] - values[i - 1]
        share = (knots[i] - knots[i - 1]) / length
        condition = rows[i] - (1.0 - share) * rows[i - 1] - share * rows[i + 1]
        if free_knots and i > 1:
            condition[first + i - 1] += change * (1.0 - share) / length
        if free_knots and i < chain.size - 1:
            condition[first + i + 1] += change * share / length
        if condition.any():
            yield Edit("merge", i), condition[None], np.array([values[i] - values[i - 1] - share * change])


def _snaps(data: AxisData, chain: Chain, basis: Float) -> Iterator[Condition]:
    """Yield for each element its snaps, on condition that its ends' values are equal, or that they are zero."""
    rows = basis[chain.value_columns]
    for e, kind in enumerate(chain.kinds):
        pair, ends = rows[[e, e + 1]], chain.values[[e, e + 1]]
        tied = kind != FREE or bool((pair[0] == pair[1]).all())
        if EQUAL in data.snaps and not tied:
            yield Edit(EQUAL, e), pair[1:] - pair[:1], ends[1:] - ends[:1]
        if ZERO in data.snaps and kind != ZERO:
            free = pair.any(axis=1)
            if tied:
                free[1] = False  # one condition says it all
            given = ends[~pair.any(axis=1)]  # zero already, or pinned
            if free.any() and not given.any():
                yield Edit(ZERO, e), pair[free], ends[free]


def _disjoint_edits(ways: list[tuple[float, Edit]], most: int, gain: float) -> list[tuple[float, Edit]]:
    """Return (change of score, edit) of edits that pay and don't touch each other, cheapest first."""
    taken: set[int] = set()
    chosen: list[tuple[float, Edit]] = []
    for change, edit in ways:
        low, high = edit.span
        if len(chosen) >= most or change > -gain:
            break
        if taken.isdisjoint(range(low - 1, high + 2)):
            taken.update(range(low, high + 1))
            chosen.append((change, edit))
    return chosen


def simplify_fit(fit: ChainFit, free_knots: bool, goal: Goal) -> ChainFit | None:
    """Return the fit after the edit, or the edits at once, that cost least; None if there is nothing to take away."""
    ways = rank_edits(fit, free_knots, goal)
    batch = _disjoint_edits(ways, max(1, fit.chain.size // 3), 0.5 * np.log(goal.count))
    present = goal.score(fit)
    while len(batch) > 1:
        chain, _ = predict_edits(fit, [edit for _, edit in batch], free_knots, goal)
        trial = refine(fit.data, chain, fit.stations, free_knots, _STEPS)
        if goal.score(trial) - present <= 0.5 * math.fsum(change for change, _ in batch):
            return trial
        batch = batch[: len(batch) // 2]
    trials = []
    for trial in _trials(fit, [edit for _, edit in ways[: 3 * _TRIALS]], free_knots, goal):
        if goal.score(trial) < present:
            return trial
        trials.append(trial)
    return min(trials, key=goal.score, default=None)


def _trials(fit: ChainFit, edits: list[Edit], free_knots: bool, goal: Goal) -> Iterator[ChainFit]:
    """Yield the refined fits of the edits that are expected to score best, in that order."""
    predicted = [predict_edits(fit, [edit], free_knots, goal) for edit in edits]
    scores = [goal.expected_score(square, chain, len(fit.residuals)) for chain, square in predicted]
    for i in np.argsort(scores, kind="stable")[:_TRIALS]:
        yield refine(fit.data, predicted[i][0], fit.stations, free_knots, _STEPS)


def descent(fit: ChainFit, goal: Goal) -> list[ChainFit]:
    """Return all fits on the way from a rich chain down to few elements: with fixed knots, then with free ones.

    It goes on past the bounds, since a poor removal may be made good by the next, but not hopelessly far.
    """
    path, free_knots = [fit], False
    while fit.rms < _HOPELESS * max(goal.rms, path[0].rms):
        trial = simplify_fit(fit, free_knots, goal)
        if not free_knots and (trial is None or goal.score(trial) > goal.score(fit)):
            free_knots = True
            trial = refine(fit.data, fit.chain, fit.stations, True, 20)
        elif trial is None:
            return path
        fit = trial
        path.append(fit)
    return path


def split_chains(fit: ChainFit) -> list[Chain]:
    """Return chains with one element more, or one freed from being an arc or line, the most helpful first."""
    chain, data = fit.chain, fit.data
    cuts = np.linspace(0.0, 1.0, _PARTS + 1)[:-1]
    fine = np.append((chain.knots[:-1, None] + np.diff(chain.knots)[:, None] * cuts).ravel(), chain.knots[-1])
    dense = replace(chain, knots=fine, values=np.interp(fine, chain.knots, chain.values))
    dense = replace(dense, kinds=np.full(len(fine) - 1, FREE))
    hats = data.jacobian(dense, fit.stations)[:, dense.value_columns]
    full = data.jacobian(chain, fit.stations)
    matrix = full @ chain.basis(True)
    q, _ = np.linalg.qr(matrix / column_scale(matrix))
    rest = fit.residuals - q @ (q.T @ fit.residuals)
    ways = []
    for e, kind in enumerate(chain.kinds):
        freed = chain.kinds.copy()
        freed[e] = FREE
        ends = [] if kind == FREE else list(full[:, chain.value_columns][:, e : e + 2].T)
        if ends:
            ways.append((_square_gain(ends, q, rest), replace(chain, kinds=freed)))
        for knot in fine[e * _PARTS + 1 : (e + 1) * _PARTS]:
            if min(knot - chain.knots[e], chain.knots[e + 1] - knot) >= data.least:
                hat = hats @ np.interp(fine, [chain.knots[e], knot, chain.knots[e + 1]], [0.0, 1.0, 0.0])
                ways.append((_square_gain([hat, *ends], q, rest), _split_element(chain, freed, e, knot)))
    return [new for _, new in sorted(ways, key=lambda way: -way[0])]


def _split_element(chain: Chain, freed: Int, e: int, knot: float) -> Chain:
    """Return the chain with a knot at a station (m) in element e, both parts of which are free."""
    values = np.insert(chain.values, e + 1, np.interp(knot, chain.knots, chain.values))
    return replace(chain, knots=np.insert(chain.knots, e + 1, knot), values=values, kinds=np.insert(freed, e, FREE))


def _square_gain(columns: list[Float], q: Float, rest: Float) -> float:
    """Return by how much (m^2) new columns, beside the old ones q, would lower the sum of squares."""
    new = np.stack(columns, axis=1)
    new = new - q @ (q.T @ new)
    new /= column_scale(new)
    solution = np.linalg.lstsq(new, rest, rcond=1e-6)[0]
    return float(rest @ (new @ solution))


def improve_fit(fit: ChainFit, goal: Goal, steps: int = 60) -> ChainFit:
    """Return a fit grown until the bounds are met, then edited while its rank falls, in at most ``steps`` rounds."""
    for _ in range(steps):
        while goal.is_met(fit):
            ways = [edit for _, edit in rank_edits(fit, True, goal)[: 3 * _TRIALS]]
            best = min(_trials(fit, ways, True, goal), key=goal.rank, default=None)
            if best is None or not _better(best, fit, goal):
                break
            fit = best
        grown = [refine(fit.data, chain, fit.stations, True, _STEPS) for chain in split_chains(fit)[:_TRIALS]]
        best = min(grown, key=goal.score, default=None)
        if best is None:
            return fit
        if goal.is_met(fit) and not _better(best, fit, goal):
            # A split may pay only together with the removal that it makes possible.
            ways = [edit for _, edit in rank_edits(best, True, goal)[: 3 * _TRIALS]]
            best = min(_trials(best, ways, True, goal), key=goal.rank, default=None)
            if best is None or not _better(best, fit, goal):
                return fit
        fit = best
    return fit


def _better(new: ChainFit, old: ChainFit, goal: Goal) -> bool:
    """Return whether a fit beats another: by its bounds or number of elements, or by a score worth it."""
    coarse_new, coarse_old = goal.rank(new)[:2], goal.rank(old)[:2]
    return coarse_new < coarse_old or (coarse_new == coarse_old and goal.score(new) < goal.score(old) - _WORTH)
