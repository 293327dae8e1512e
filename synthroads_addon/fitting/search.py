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
        """Return the first and the last element that the edit changes."""
        return (self.index - 1, self.index) if self.kind == "merge" else (self.index, self.index)


#: An edit, the linear conditions (C, P) that it imposes on the free parameters, and by how much each is violated (C,).
Condition = tuple[Edit, Float, Float]


@dataclass(frozen=True)
class Goal:
    """Bounds of a fit and scoring of chains in the search.

    Attributes:
        rms, p95: bounds of the residuals' root mean square and 95th percentile, m.
        floor: residual below which no improvement is worth an element, m.
        count: number of observations that the score counts as independent.
        max_elements: largest number of elements that is wanted.
    """

    rms: float
    p95: float
    floor: float
    count: float
    max_elements: int

    def is_met(self, fit: ChainFit) -> bool:
        """Return whether a fit's residuals keep the bounds."""
        return fit.rms <= self.rms and fit.p95 <= self.p95

    def score(self, fit: ChainFit) -> float:
        """Return the score of a fit, see `expected_score`."""
        return self.expected_score(fit.sum_of_squares, fit.chain, len(fit.residuals))

    def expected_score(self, square: float, chain: Chain, points: int) -> float:
        """Return the score (BIC, least is best) of a chain with a sum of squares, m^2; elements cost extra."""
        # Schwarz 1978: BIC = n ln(RSS / n) + k ln n, here of n independent observations, with half a parameter more for
        # each element (chosen: of two chains as free the one with fewer elements).
        misfit = np.log(max(square, 0.0) / points + self.floor**2)
        return self.count * misfit + (chain.freedom() + 0.5 * chain.size) * np.log(self.count)

    def rank(self, fit: ChainFit) -> tuple[bool, bool, float]:
        """Return a sort key, least for the best fit: bounds first, then the number of elements, then the score."""
        return (not self.is_met(fit), fit.chain.size > self.max_elements, self.score(fit))


def independent_count(length: float, points: int) -> float:
    """Return the number of observations that count as independent along a length (m), at least 4."""
    return max(4.0, min(float(points), max(10.0, length / _CORRELATED)))


def apply_edits(chain: Chain, edits: Sequence[Edit]) -> tuple[Chain, list[int]]:
    """Return the chain after edits, with unchanged values, and the indices of the knots that stay.

    Constant elements that come to lie side by side become one.
    """
    removed_knots = {edit.index for edit in edits if edit.kind == "merge"}
    snapped_kinds = {edit.index: edit.kind for edit in edits if edit.kind != "merge"}
    kept_indices, merged_kinds = [0], set()
    kinds: list[int] = []
    for e, kind in enumerate(chain.kinds.tolist()):
        merged_kinds.add(snapped_kinds.get(e, kind))
        if e + 1 in removed_knots:
            continue
        merged_kind = merged_kinds.pop() if len(merged_kinds) == 1 else FREE
        merged_kinds = set()
        if merged_kind != FREE and kinds and kinds[-1] != FREE:
            kinds[-1] = max(merged_kind, kinds[-1])  # a line beside an arc is one with it
            kept_indices[-1] = e + 1
        else:
            kinds.append(merged_kind)
            kept_indices.append(e + 1)
    return replace(
        chain, knots=chain.knots[kept_indices], values=chain.values[kept_indices], kinds=np.array(kinds)
    ), kept_indices


def _interpolation(chain: Chain, keep: list[int]) -> tuple[Float, Float]:
    """Return the derivatives of a chain's values interpolated between the knots that stay.

    Those by the values at the knots that stay, (M + 1, K), and those by all knots' stations, (M + 1, M + 1).
    """
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


def _lift_matrix(chain: Chain, edited_chain: Chain, keep: list[int]) -> Float:
    """Return the matrix from changes of an edited chain's parameters to changes of all the chain's parameters."""
    weights, shifts = _interpolation(chain, keep)
    inner_knots = [i for i in keep if 0 < i < chain.size]
    old_knots, new_knots = chain.value_columns.stop, edited_chain.value_columns.stop
    lift = np.zeros((old_knots + chain.size - 1, new_knots + edited_chain.size - 1))
    lift[: chain.pose_size, : chain.pose_size] = np.eye(chain.pose_size)
    lift[chain.value_columns, edited_chain.value_columns] = weights
    lift[chain.value_columns, new_knots:] = shifts[:, inner_knots]
    lift[[old_knots + i - 1 for i in inner_knots], range(new_knots, new_knots + len(inner_knots))] = 1.0
    return lift


def predict_edits(fit: ChainFit, edits: Sequence[Edit], free_knots: bool, goal: Goal) -> tuple[Chain, float]:
    """Return the edited chain at the optimum of the linearised problem, and the sum of squares (m^2) expected there."""
    edited_chain, keep = apply_edits(fit.chain, edits)
    edited_chain = edited_chain.tie_values()
    basis, lift = edited_chain.basis(free_knots), _lift_matrix(fit.chain, edited_chain, keep)
    start = np.zeros(len(lift))  # change of the parameters by the edits themselves
    values = fit.chain.value_columns
    start[values] = lift[values, edited_chain.value_columns] @ edited_chain.values - fit.chain.values
    upper_factor, projected_residuals = fit.linear
    matrix, target = upper_factor @ (lift @ basis), -(projected_residuals + upper_factor @ start)
    knot_rows = (
        _allowance(fit, goal) * knot_penalty(fit.data, edited_chain, basis.shape[1]) if free_knots else matrix[:0]
    )
    scale = column_scale(matrix)
    rows = np.vstack((matrix / scale, knot_rows / scale, 1e-6 * np.eye(len(scale))))
    scaled_step = least_squares(rows, np.concatenate((target, np.zeros(len(rows) - len(target)))))
    residuals = rows @ scaled_step
    residuals[: len(target)] -= target
    square = float(residuals @ residuals) - float(projected_residuals @ projected_residuals) + fit.sum_of_squares
    return apply_step(fit.data, edited_chain, basis @ (scaled_step / scale)), square


def _allowance(fit: ChainFit, goal: Goal) -> float:
    """Return the cost of a knot's step over its whole room, m: the root of the sum of squared residuals and floors."""
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
    chain, current_score = fit.chain, goal.score(fit)
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
            result.append((score - current_score, edit))
    return sorted(result, key=lambda pair: pair[0])


def _merges(chain: Chain, basis: Float, free_knots: bool) -> Iterator[Condition]:
    """Yield the removal of each inner knot, on condition that its value is interpolated between its neighbours'."""
    rows, knots, values = basis[chain.value_columns], chain.knots, chain.values
    first_knot_column = basis.shape[1] - chain.size  # + i: the column of inner knot i
    for i in range(1, chain.size):
        length, change = knots[i + 1] - knots[i - 1], values[i + 1] - values[i - 1]
        share = (knots[i] - knots[i - 1]) / length
        condition = rows[i] - (1.0 - share) * rows[i - 1] - share * rows[i + 1]
        if free_knots and i > 1:
            condition[first_knot_column + i - 1] += change * (1.0 - share) / length
        if free_knots and i < chain.size - 1:
            condition[first_knot_column + i + 1] += change * share / length
        if condition.any():
            yield Edit("merge", i), condition[None], np.array([values[i] - values[i - 1] - share * change])


def _snaps(data: AxisData, chain: Chain, basis: Float) -> Iterator[Condition]:
    """Yield the snaps of each element, on condition that the values at its ends are equal, or that they are zero."""
    rows = basis[chain.value_columns]
    for e, kind in enumerate(chain.kinds):
        pair, ends = rows[[e, e + 1]], chain.values[[e, e + 1]]
        is_constant = kind != FREE or bool((pair[0] == pair[1]).all())
        if EQUAL in data.snaps and not is_constant:
            yield Edit(EQUAL, e), pair[1:] - pair[:1], ends[1:] - ends[:1]
        if ZERO in data.snaps and kind != ZERO:
            is_free = pair.any(axis=1)
            if is_constant:
                is_free[1] = False  # one condition says it all
            fixed_values = ends[~pair.any(axis=1)]  # zero already, or pinned
            if is_free.any() and not fixed_values.any():
                yield Edit(ZERO, e), pair[is_free], ends[is_free]


def _disjoint_edits(
    ranked_edits: list[tuple[float, Edit]], largest_number: int, gain: float
) -> list[tuple[float, Edit]]:
    """Return (change of score, edit) of edits that lower the score by a gain and don't touch each other, best first."""
    used_elements: set[int] = set()
    chosen_edits: list[tuple[float, Edit]] = []
    for change, edit in ranked_edits:
        first_element, last_element = edit.span
        if len(chosen_edits) >= largest_number or change > -gain:
            break
        if used_elements.isdisjoint(range(first_element - 1, last_element + 2)):
            used_elements.update(range(first_element, last_element + 1))
            chosen_edits.append((change, edit))
    return chosen_edits


def simplify_fit(fit: ChainFit, free_knots: bool, goal: Goal) -> ChainFit | None:
    """Return the fit after the cheapest edit, or several cheap edits at once; None if no edit is possible."""
    ranked_edits = rank_edits(fit, free_knots, goal)
    batch = _disjoint_edits(ranked_edits, max(1, fit.chain.size // 3), 0.5 * np.log(goal.count))
    current_score = goal.score(fit)
    while len(batch) > 1:
        chain, _ = predict_edits(fit, [edit for _, edit in batch], free_knots, goal)
        trial = refine(fit.data, chain, fit.stations, free_knots, _STEPS)
        if goal.score(trial) - current_score <= 0.5 * math.fsum(change for change, _ in batch):
            return trial
        batch = batch[: len(batch) // 2]
    trials = []
    for trial in _trials(fit, [edit for _, edit in ranked_edits[: 3 * _TRIALS]], free_knots, goal):
        if goal.score(trial) < current_score:
            return trial
        trials.append(trial)
    return min(trials, key=goal.score, default=None)


def _trials(fit: ChainFit, edits: list[Edit], free_knots: bool, goal: Goal) -> Iterator[ChainFit]:
    """Yield the refined fits of the `_TRIALS` edits that are expected to score best, in that order."""
    predictions = [predict_edits(fit, [edit], free_knots, goal) for edit in edits]
    scores = [goal.expected_score(square, chain, len(fit.residuals)) for chain, square in predictions]
    for i in np.argsort(scores, kind="stable")[:_TRIALS]:
        yield refine(fit.data, predictions[i][0], fit.stations, free_knots, _STEPS)


def descent(fit: ChainFit, goal: Goal) -> list[ChainFit]:
    """Return all fits on the way from a chain of many elements down to few: with fixed knots, then with free ones.

    The descent goes on past the goal's bounds, as the next removal may make a poor one good, but not hopelessly far.
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
    fine_knots = np.append((chain.knots[:-1, None] + np.diff(chain.knots)[:, None] * cuts).ravel(), chain.knots[-1])
    fine_chain = replace(chain, knots=fine_knots, values=np.interp(fine_knots, chain.knots, chain.values))
    fine_chain = replace(fine_chain, kinds=np.full(len(fine_knots) - 1, FREE))
    hats = data.jacobian(fine_chain, fit.stations)[:, fine_chain.value_columns]
    chain_jacobian = data.jacobian(chain, fit.stations)
    matrix = chain_jacobian @ chain.basis(True)
    q, _ = np.linalg.qr(matrix / column_scale(matrix))
    residuals = fit.residuals - q @ (q.T @ fit.residuals)
    candidates = []
    for e, kind in enumerate(chain.kinds):
        freed_kinds = chain.kinds.copy()
        freed_kinds[e] = FREE
        ends = [] if kind == FREE else list(chain_jacobian[:, chain.value_columns][:, e : e + 2].T)
        if ends:
            candidates.append((_square_gain(ends, q, residuals), replace(chain, kinds=freed_kinds)))
        for knot in fine_knots[e * _PARTS + 1 : (e + 1) * _PARTS]:
            if min(knot - chain.knots[e], chain.knots[e + 1] - knot) >= data.min_length:
                hat = hats @ np.interp(fine_knots, [chain.knots[e], knot, chain.knots[e + 1]], [0.0, 1.0, 0.0])
                candidates.append(
                    (_square_gain([hat, *ends], q, residuals), _split_element(chain, freed_kinds, e, knot))
                )
    return [split_chain for _, split_chain in sorted(candidates, key=lambda candidate: -candidate[0])]


def _split_element(chain: Chain, freed: Int, e: int, knot: float) -> Chain:
    """Return the chain with a knot at a station (m) in element e, both parts of which are free."""
    values = np.insert(chain.values, e + 1, np.interp(knot, chain.knots, chain.values))
    return replace(chain, knots=np.insert(chain.knots, e + 1, knot), values=values, kinds=np.insert(freed, e, FREE))


def _square_gain(columns: list[Float], q: Float, residuals: Float) -> float:
    """Return the decrease (m^2) of the sum of squares by further columns (N,) of a linear problem.

    Args:
        columns: the new columns.
        q: (N, P) orthonormal basis of the present ones.
        rest: (N,) residuals that the present ones leave.
    """
    new_columns = np.stack(columns, axis=1)
    new_columns = new_columns - q @ (q.T @ new_columns)
    new_columns /= column_scale(new_columns)
    solution = np.linalg.lstsq(new_columns, residuals, rcond=1e-6)[0]
    return float(residuals @ (new_columns @ solution))


def improve_fit(fit: ChainFit, goal: Goal, steps: int = 60) -> ChainFit:
    """Return a fit grown until it meets the bounds, then edited while its rank falls, in at most ``steps`` rounds."""
    for _ in range(steps):
        while goal.is_met(fit):
            edits = [edit for _, edit in rank_edits(fit, True, goal)[: 3 * _TRIALS]]
            best_fit = min(_trials(fit, edits, True, goal), key=goal.rank, default=None)
            if best_fit is None or not _better(best_fit, fit, goal):
                break
            fit = best_fit
        grown_fits = [refine(fit.data, chain, fit.stations, True, _STEPS) for chain in split_chains(fit)[:_TRIALS]]
        best_fit = min(grown_fits, key=goal.score, default=None)
        if best_fit is None:
            return fit
        if goal.is_met(fit) and not _better(best_fit, fit, goal):
            # A split may pay only together with the removal that it makes possible.
            edits = [edit for _, edit in rank_edits(best_fit, True, goal)[: 3 * _TRIALS]]
            best_fit = min(_trials(best_fit, edits, True, goal), key=goal.rank, default=None)
            if best_fit is None or not _better(best_fit, fit, goal):
                return fit
        fit = best_fit
    return fit


def _better(new_fit: ChainFit, old_fit: ChainFit, goal: Goal) -> bool:
    """Return whether a new fit beats an old one: by bounds or number of elements, or by `_WORTH` of score."""
    new_rank, old_rank = goal.rank(new_fit)[:2], goal.rank(old_fit)[:2]
    return new_rank < old_rank or (new_rank == old_rank and goal.score(new_fit) < goal.score(old_fit) - _WORTH)
