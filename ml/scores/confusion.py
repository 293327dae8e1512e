"""Scores of a segmentation, all from one confusion matrix that is summed over the whole test set."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from synthroads_addon.base.arrays import Float, Int
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.schema import is_number
from synthroads_addon.base.text.table import text_table

from ..data.classes import IGNORED
from .metrics import Metric, Spread, finite_values, markdown, nan_to_none


class Confusion:
    """Confusion matrix of points by true and predicted class, and the scores that follow from it.

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

    def add(self, truth: NDArray[np.integer[Any]], prediction: NDArray[np.integer[Any]]) -> None:
        """Add points' true and predicted classes (N,) to the matrix, in place; those with `IGNORED` truth don't count.

        Raises:
            InputError: the lengths differ, or a class is out of range.
        """
        if truth.shape != prediction.shape:
            raise InputError("predicted", prediction.shape, f"must be of the truth's shape, {truth.shape}")
        has_label = truth != IGNORED
        self.ignored += int(np.count_nonzero(~has_label))
        rows, columns = truth[has_label].astype(np.int64), prediction[has_label].astype(np.int64)
        count = len(self.names)
        for name, values in (("truth", rows), ("predicted", columns)):
            if len(values) and (values.min() < 0 or values.max() >= count):
                invalid_class = int(values.min() if values.min() < 0 else values.max())
                raise InputError(name, invalid_class, f"must be a class from 0 to {count - 1}")
        self.counts += np.bincount(rows * count + columns, minlength=count * count).reshape(count, count)

    @property
    def true_positives(self) -> Int:
        """Return the true positives of each class (C,)."""
        return self.counts.diagonal()

    @property
    def predicted_counts(self) -> Int:
        """Return the number of points predicted as each class (C,)."""
        return self.counts.sum(axis=0)

    @property
    def support(self) -> Int:
        """Return the number of true points of each class (C,)."""
        return self.counts.sum(axis=1)

    def values(self, metric: str) -> Float:
        """Return one of `METRICS` per class (C,), as a share; NaN where undefined."""
        return np.asarray(METRICS[metric].value(self), dtype=np.float64)

    def mean(self, metric: str) -> float:
        """Return the mean of one of `METRICS` over the classes for which it is defined; NaN if there is none."""
        return Spread.over(finite_values(self.values(metric).tolist())).mean

    @property
    def accuracy(self) -> float:
        """Return the overall accuracy, the share of points with the right class; NaN without points."""
        return float(_ratio(self.counts.trace(), self.counts.sum()))

    def to_dict(self) -> dict[str, Any]:
        """Return per-class scores, means, accuracy, counts and the matrix as JSON data; NaN becomes None."""
        columns = {metric: self.values(metric) for metric in METRICS}
        rows = {
            name: {metric: nan_to_none(values[class_index]) for metric, values in columns.items()}
            | {"support": int(support)}
            for class_index, (name, support) in enumerate(zip(self.names, self.support, strict=True))
        }
        return {
            "classes": rows,
            **{f"mean_{metric}": nan_to_none(self.mean(metric)) for metric in METRICS},
            "accuracy": nan_to_none(self.accuracy),
            "points": int(self.counts.sum()),
            "ignored": self.ignored,
            "confusion": self.counts.tolist(),
        }


def _ratio(numerator: Any, denominator: Any) -> Any:
    """Return a quotient element by element; NaN where the denominator is 0."""
    denominator = np.asarray(denominator, dtype=np.float64)
    return np.divide(numerator, denominator, out=np.full_like(denominator, np.nan), where=denominator > 0)


METRICS = {
    "precision": Metric(lambda of: _ratio(of.true_positives, of.predicted_counts), "precision", 100.0, 1),
    "recall": Metric(lambda of: _ratio(of.true_positives, of.support), "recall", 100.0, 1),
    "iou": Metric(
        lambda of: _ratio(of.true_positives, of.support + of.predicted_counts - of.true_positives), "IoU", 100.0, 1
    ),
}
"""Metrics of each class (C,) of a `Confusion`; what is here is in its data and in all tables."""
Scores = Mapping[str, Any]
"""Result of `Confusion.to_dict`."""


def are_scores(data: Any, names: Sequence[str]) -> bool:
    """Return whether JSON data are scores of classes of these names, as `Confusion.to_dict` returns them."""
    if not isinstance(data, dict) or not isinstance(data.get("classes"), dict) or data["classes"].keys() != {*names}:
        return False
    rows = [*data["classes"].values(), {name: data.get(f"mean_{name}", "") for name in METRICS}]
    counts = [data.get("points"), *(row.get("support") for row in rows[:-1] if isinstance(row, dict))]
    of_metrics = [row.get(name, "") for row in rows if isinstance(row, dict) for name in METRICS]
    is_complete = all(isinstance(row, dict) for row in rows) and all(type(count) is int for count in counts)
    return is_complete and all(value is None or is_number(value) for value in of_metrics)


NOTE = "mean (standard deviation, ddof = 1) over seeds; - where undefined"


def score_table(scores: Scores) -> str:
    """Return a test's scores as an aligned text table of classes, in percent, with the accuracy below."""
    rows = [
        [label, *cells, f"{points:,}"] for label, points, cells in _class_rows([([scores], name) for name in METRICS])
    ]
    lines = text_table(["class", *(metric.title for metric in METRICS.values()), "points"], rows)
    ignored_text = f", {scores['ignored']:,} without a class left out" if scores["ignored"] else ""
    return "\n".join([*lines, f"{percent([scores['accuracy']])} % of the points are right{ignored_text}"])


def tables_by_test(results: Mapping[str, Mapping[str, Mapping[str, Scores]]], rows: Sequence[str] = ()) -> str:
    """Return Markdown with one table per test of an experiment: IoU by class and variant, %, mean (std) over seeds.

    Args:
        results: variant -> seed -> test -> scores; variants without a seed are left out.
        rows: further rows, cells joined by ``|``, that the first test's table ends with.
    """
    variant_runs = {name: list(seeds.values()) for name, seeds in results.items() if seeds}
    lines = [f"IoU in %, {NOTE}.", ""]
    for test_number, test in enumerate(next(iter(variant_runs.values()))[0] if variant_runs else ()):
        body = _class_rows([([run[test] for run in runs], "iou") for runs in variant_runs.values()])
        lines += [f"**{test}**", "", *_class_table(list(variant_runs), body), *(rows if test_number == 0 else ()), ""]
    counts = ", ".join(f"{name} {len(runs)}" for name, runs in variant_runs.items())
    return "\n".join([*lines, f"Seeds: {counts}."])


def table_by_class(runs: Sequence[Scores]) -> str:
    """Return a Markdown table of precision, recall and IoU by class, %, mean (std) over seeds; classes with points.

    Means stand below them where every class has points: what is predicted without occurring would count as 0.

    Args:
        runs: scores of one test, a run per seed.
    """
    *classes, mean = _class_rows([(runs, name) for name in METRICS])
    classes_with_points = [row for row in classes if row[1]]
    body = [*classes_with_points, mean] if len(classes_with_points) == len(classes) else classes_with_points
    return "\n".join(_class_table([metric.title for metric in METRICS.values()], body))


_ClassRow = tuple[str, int, list[str]]
"""A class, its points, and cells."""


def _class_rows(columns: Sequence[tuple[Sequence[Scores], str]]) -> list[_ClassRow]:
    """Return a row for each class and one for their mean, with a cell per column: a metric over some runs, %."""
    first_scores = columns[0][0][0]
    rows = [
        (label, row["support"], [percent([run["classes"][label][metric] for run in runs]) for runs, metric in columns])
        for label, row in first_scores["classes"].items()
    ]
    means = [percent([run[f"mean_{metric}"] for run in runs]) for runs, metric in columns]
    return [*rows, ("mean", first_scores["points"], means)]


def _class_table(titles: Sequence[str], rows: Sequence[_ClassRow]) -> list[str]:
    """Return the lines of a Markdown table with a row for each class."""
    body = [[label, f"{points:,}", *cells] for label, points, cells in rows]
    return markdown(["class", "points", *titles], body, ["---", "--:", *["--:"] * len(titles)]).splitlines()


def percent(values: Sequence[float | None]) -> str:
    """Return shares (0 to 1) as the text ``mean (standard deviation)`` in percent; None and NaN are left out."""
    return Spread.over([100.0 * value for value in finite_values(values)]).text(1, "-")
