"""Scores of a segmentation, all from one confusion matrix that is summed over the whole test set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from synthroads_addon.base.errors import InputError
from synthroads_addon.base.text_table import text_table

from ..data.classes import IGNORED

FloatArray = NDArray[np.float64]


class Confusion:
    """Counts of points by true and predicted class.

    With tp, fp and fn the points rightly, wrongly and not given to a class, precision is tp / (tp + fp), recall is
    tp / (tp + fn) and IoU is tp / (tp + fp + fn). What would be 0 / 0 is NaN and left out of means: the recall of a
    class without true points, the precision of one that is never predicted, the IoU of one that is neither.

    Args:
        names: of the classes, whose numbers are their places.

    Attributes:
        counts: (C, C) int64, rows by truth, columns by prediction.
        ignored: points that were handed in without a truth.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self.names = tuple(names)
        self.counts = np.zeros((len(self.names), len(self.names)), dtype=np.int64)
        self.ignored = 0

    def add(self, truth: NDArray[np.integer[Any]], predicted: NDArray[np.integer[Any]]) -> None:
        """Count points (N,); those whose truth is `IGNORED` are left out whatever was predicted for them.

        Raises:
            InputError: the lengths differ, or a class is out of range.
        """
        if truth.shape != predicted.shape:
            raise InputError("predicted", predicted.shape, f"must be of the truth's shape, {truth.shape}")
        known = truth != IGNORED
        self.ignored += int(np.count_nonzero(~known))
        rows, columns = truth[known].astype(np.int64), predicted[known].astype(np.int64)
        count = len(self.names)
        for name, values in (("truth", rows), ("predicted", columns)):
            if len(values) and (values.min() < 0 or values.max() >= count):
                worst = int(values.min() if values.min() < 0 else values.max())
                raise InputError(name, worst, f"must be a class from 0 to {count - 1}")
        self.counts += np.bincount(rows * count + columns, minlength=count * count).reshape(count, count)

    @property
    def support(self) -> NDArray[np.int64]:
        """Return the number of true points of each class (C,)."""
        return self.counts.sum(axis=1)

    @property
    def precision(self) -> FloatArray:
        """Return the share of each class's predicted points that are right (C,)."""
        return _ratio(self.counts.diagonal(), self.counts.sum(axis=0))

    @property
    def recall(self) -> FloatArray:
        """Return the share of each class's true points that are found (C,)."""
        return _ratio(self.counts.diagonal(), self.support)

    @property
    def iou(self) -> FloatArray:
        """Return intersection over union of each class (C,)."""
        right = self.counts.diagonal()
        return _ratio(right, self.support + self.counts.sum(axis=0) - right)

    @property
    def accuracy(self) -> float:
        """Return the share of all points that are right; NaN without any."""
        return float(_ratio(self.counts.trace(), self.counts.sum()))

    def to_dict(self) -> dict[str, Any]:
        """Return everything as JSON data; NaN becomes None."""
        columns = {"precision": self.precision, "recall": self.recall, "iou": self.iou}
        rows = {
            name: {**{what: _or_none(values[place]) for what, values in columns.items()}, "support": int(support)}
            for place, (name, support) in enumerate(zip(self.names, self.support, strict=True))
        }
        return {
            "classes": rows,
            "mean_precision": _or_none(mean(self.precision)),
            "mean_recall": _or_none(mean(self.recall)),
            "mean_iou": _or_none(mean(self.iou)),
            "accuracy": _or_none(self.accuracy),
            "points": int(self.counts.sum()),
            "ignored": self.ignored,
            "confusion": self.counts.tolist(),
        }


def score_table(scores: Mapping[str, Any]) -> str:
    """Return the scores that `Confusion.to_dict` has as a table for people, in percent."""
    columns = ("precision", "recall", "iou")
    rows = [
        [name, *(_percent(row[column]) for column in columns), f"{row['support']:,}"]
        for name, row in scores["classes"].items()
    ]
    rows.append(["mean", *(_percent(scores[f"mean_{column}"]) for column in columns), f"{scores['points']:,}"])
    lines = text_table(["class", "precision", "recall", "IoU", "points"], rows)
    unlabelled = f", {scores['ignored']:,} without a class left out" if scores["ignored"] else ""
    return "\n".join([*lines, f"{_percent(scores['accuracy'])} % of the points are right{unlabelled}"])


def mean(values: FloatArray) -> float:
    """Return the mean of what is defined; NaN if nothing is."""
    defined = values[np.isfinite(values)]
    return float(defined.mean()) if len(defined) else float("nan")


def _ratio(part: Any, whole: Any) -> Any:
    whole = np.asarray(whole, dtype=np.float64)
    return np.divide(part, whole, out=np.full_like(whole, np.nan), where=whole > 0)


def _or_none(value: float) -> float | None:
    return None if np.isnan(value) else float(value)


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.1f}"
