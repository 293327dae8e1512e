"""Metrics: how a figure is made and shown, and its mean over several seeds."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np


@dataclass(frozen=True)
class Metric:
    """A named figure of predictions: how it is computed, and how tables show it.

    Attributes:
        value: function that computes the figure of a comparison; None as its result: there is none.
        title: title of the figure's column in tables; empty for none.
        factor: factor on the figure in tables.
        decimals: decimals in tables.
        place: order of the column: ascending.
        summed: whether the figure of several roads is their sum instead of a mean.
    """

    value: Callable[[Any], Any]
    title: str = ""
    factor: float = 1.0
    decimals: int = 3
    place: int = 0
    summed: bool = False


def in_tables(metrics: Mapping[str, Metric]) -> dict[str, Metric]:
    """Return the metrics that have a title, in the order of the tables' columns."""
    titled_metrics = {name: metric for name, metric in metrics.items() if metric.title}
    return dict(sorted(titled_metrics.items(), key=lambda item: item[1].place))


def figures(metrics: Mapping[str, Metric], comparison: object) -> dict[str, float]:
    """Return the values of all metrics of a comparison by name, without those that are None."""
    values = {name: metric.value(comparison) for name, metric in metrics.items()}
    return {name: float(value) for name, value in values.items() if value is not None}


@dataclass(frozen=True)
class Spread:
    """A figure over several seeds: mean, standard deviation (ddof 1; NaN for one seed), number of seeds."""

    mean: float
    std: float
    count: int

    @classmethod
    def over(cls, values: Iterable[float]) -> Self:
        """Return mean, deviation and count of values; the mean is NaN without any or where one is NaN."""
        numbers = np.array([*values], dtype=np.float64)
        std = float(numbers.std(ddof=1)) if len(numbers) > 1 else math.nan
        return cls(float(numbers.mean()) if len(numbers) else math.nan, std, len(numbers))

    def text(self, decimals: int, nan_text: str, factor: float = 1.0) -> str:
        """Return the text ``mean (std)``, times a factor; the mean alone if std is NaN, `nan_text` if the mean is."""
        if math.isnan(self.mean):
            return nan_text
        mean = f"{factor * self.mean:,.{decimals}f}"
        return mean if math.isnan(self.std) else f"{mean} ({factor * self.std:,.{decimals}f})"


def finite_values(values: Sequence[float | None]) -> list[float]:
    """Return the finite numbers among some values, without None, NaN and infinity."""
    return [float(value) for value in values if value is not None and math.isfinite(value)]


def over_seeds(rows: Sequence[Mapping[str, float]]) -> dict[str, Spread]:
    """Return mean and standard deviation (ddof 1) of each figure over runs with several seeds, by name.

    A figure that is NaN or missing in one of them has a NaN mean: nothing is left out silently.
    """
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: Spread.over(row.get(name, math.nan) for row in rows) for name in names}


def nan_to_none(value: float | None, digits: int | None = None) -> float | None:
    """Return a number for JSON, perhaps rounded to `digits`; None for NaN and None."""
    if value is None or math.isnan(value):
        return None
    return float(value) if digits is None else round(value, digits)


def markdown(head: Sequence[str], body: Iterable[Sequence[str]], rule: Sequence[str] | None = None) -> str:
    """Return a Markdown table as text that ends with a line break.

    Args:
        head: titles of the columns.
        body: rows of cells.
        rule: what stands below the titles; three dashes each if not given.
    """
    dash_cells = " | ".join(["---"] * len(head))
    separator = f"| {dash_cells} |" if rule is None else f"|{'|'.join(rule)}|"
    return "".join(f"{line}\n" for line in (_row(head), separator, *map(_row, body)))


def _row(cells: Sequence[str]) -> str:
    """Return a row of a Markdown table."""
    return f"| {' | '.join(cells)} |"
