"""Figures as JSON, text and Markdown: mean (standard deviation over seeds, ddof 1) of each."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from synthroads_addon.base.files import write_file
from synthroads_addon.base.schema import canonical_json
from synthroads_addon.base.text_table import text_table


@dataclass(frozen=True)
class Spread:
    """A figure over several seeds: mean, standard deviation (ddof 1; NaN for one seed), number of seeds."""

    mean: float
    std: float
    count: int

    @classmethod
    def over(cls, values: Sequence[float]) -> Spread:
        """Return the spread of values; NaN without any, and where one of them is NaN."""
        known = np.asarray(values, dtype=np.float64)
        std = float(known.std(ddof=1)) if len(known) > 1 else math.nan
        return cls(float(known.mean()) if len(known) else math.nan, std, len(known))

    def text(self, decimals: int, missing: str, factor: float = 1.0) -> str:
        """Return ``mean (std)`` times a factor; the mean alone where there is no deviation, else what is missing."""
        if math.isnan(self.mean):
            return missing
        mean = f"{factor * self.mean:,.{decimals}f}"
        return mean if math.isnan(self.std) else f"{mean} ({factor * self.std:,.{decimals}f})"


def defined(values: Sequence[float | None]) -> list[float]:
    """Return those of some values that are finite numbers."""
    return [float(value) for value in values if value is not None and math.isfinite(value)]


Measured = Mapping[str, Mapping[str, Mapping[str, Spread]]]
"""Figures by predictor, road (or `all`) and name, as `evaluation.measure` returns them."""


@dataclass(frozen=True)
class TableColumn:
    """A figure in a table: its name in the data, the column's title, factor and decimals."""

    figure: str
    title: str
    factor: float = 1.0
    decimals: int = 3


COLUMNS = (
    TableColumn("mae", "MAE (m)"),
    TableColumn("distance_95", "95 % (m)", decimals=2),
    TableColumn("lateral", "lateral (m)"),
    TableColumn("bias", "bias (m)"),
    TableColumn("chamfer_full", "Chamfer, full (m)"),
    TableColumn("chamfer_common", "Chamfer, common (m)"),
    TableColumn("coverage_68", "in 68 % (%)", 100.0, 1),
    TableColumn("coverage_95", "in 95 % (%)", 100.0, 1),
    TableColumn("found", "found (%)", 100.0, 1),
)
ROAD_COLUMNS = (TableColumn("mae", "MAE (m)"), TableColumn("chamfer_full", "Chamfer (m)"))
"""Columns of each road in a table that has several side by side."""
TARGETS_SHOWN = {
    "center": ("centre (m)", 1.0),
    "left_edge": ("left edge (m)", 1.0),
    "right_edge": ("right edge (m)", 1.0),
    "lanes": ("lanes", 1.0),
    "lane_width": ("lane width (m)", 1.0),
    "heading": ("heading (mrad)", 1000.0),
    "height": ("height (m)", 1.0),
}
"""Targets of the corridor: title and factor."""
CORRIDOR_COLUMNS = (
    TableColumn("mae", "mean error"),
    TableColumn("right", "right when rounded (%)", 100.0, 1),
    TableColumn("interval_68", "in 68 % (%)", 100.0, 1),
    TableColumn("interval_95", "in 95 % (%)", 100.0, 1),
)
COVERAGE_COLUMNS = tuple(column for column in COLUMNS if column.figure in ("coverage_68", "coverage_95"))


def table(measured: Measured, road: str = "all", columns: Sequence[TableColumn] = COLUMNS) -> str:
    """Return a Markdown table of all predictors on one road, or on all; columns that nobody fills are left out."""
    return _markdown(*_cells({name: rows.get(road, {}) for name, rows in measured.items()}, columns))


def report(result: Mapping[str, Any]) -> str:
    """Return what `measuring.measure_run` found as tables: all predictors, each road, the corridor."""
    measured = _from_data(result["tables"])
    model = next(iter(measured))
    roads = {road: rows for road, rows in measured[model].items() if road != "all"}
    together = {name: rows.get("all", {}) for name, rows in measured.items()}
    parts = [f"{len(roads)} road{'s' if len(roads) > 1 else ''}:", *text_table(*_cells(together, COLUMNS))]
    if len(roads) > 1:
        parts += ["", f"{model}, by road:", *text_table(*_cells(roads, COLUMNS))]
    corridor = {}
    for target, figures in result["corridor"].items():
        title, factor = TARGETS_SHOWN[target]
        scaled = {name: value if value is None or name != "mae" else factor * value for name, value in figures.items()}
        corridor[title] = {name: Spread(_number(value), math.nan, 1) for name, value in scaled.items()}
    return "\n".join([*parts, "", f"{model}, the corridor:", *text_table(*_cells(corridor, CORRIDOR_COLUMNS))])


def _cells(
    rows: Mapping[str, Mapping[str, Spread]], columns: Sequence[TableColumn]
) -> tuple[list[str], list[list[str]]]:
    """Return head and body of a table with a row of figures for each name; columns that nobody fills are left out."""
    used = [column for column in columns if any(column.figure in row for row in rows.values())]
    body = [[name, *(cell(row.get(column.figure), column) for column in used)] for name, row in rows.items()]
    return ["", *(column.title for column in used)], body


def road_table(measured: Measured, roads: Mapping[str, str], columns: Sequence[TableColumn] = ROAD_COLUMNS) -> str:
    """Return a Markdown table of all predictors with some columns per road.

    Args:
        measured: the figures.
        roads: title of each road to be shown, by name.
        columns: of each road.
    """
    head = ["", *(f"{title}: {column.title}" for title in roads.values() for column in columns)]
    body = [
        [name, *(cell(rows.get(road, {}).get(column.figure), column) for road in roads for column in columns)]
        for name, rows in measured.items()
    ]
    return _markdown(head, body)


def cell(spread: Spread | None, column: TableColumn) -> str:
    """Return ``mean (std)``; the mean alone where there is one seed or nothing differs, a dash where there is none."""
    if spread is None:
        return "–"
    told = Spread(spread.mean, spread.std or math.nan, spread.count)
    return told.text(column.decimals, "–", column.factor)


def as_data(measured: Measured) -> dict[str, Any]:
    """Return figures as JSON data: mean, std and number of seeds, None for what is undefined."""
    return {
        name: {
            road: {
                figure: {"mean": _plain(spread.mean), "std": _plain(spread.std), "seeds": spread.count}
                for figure, spread in figures.items()
            }
            for road, figures in rows.items()
        }
        for name, rows in measured.items()
    }


def _from_data(data: Mapping[str, Any]) -> Measured:
    """Return figures from the JSON data that `as_data` makes of them."""

    def spreads(figures: Mapping[str, Any]) -> dict[str, Spread]:
        return {name: Spread(_number(row["mean"]), _number(row["std"]), row["seeds"]) for name, row in figures.items()}

    return {name: {road: spreads(figures) for road, figures in rows.items()} for name, rows in data.items()}


def write_tables(folder: Path, name: str, measured: Measured) -> list[str]:
    """Write ``NAME.json`` and ``NAME.md``, the latter with one table for all roads together and one for each.

    Returns:
        the names of the files.

    Raises:
        OutputError: the folder can't be written.
    """
    write_file(folder / f"{name}.json", canonical_json(as_data(measured)).encode(), overwrite=True)
    roads = list(dict.fromkeys(road for rows in measured.values() for road in rows))
    parts = [f"## {road}\n\n{table(measured, road)}" for road in sorted(roads, key=lambda road: road != "all")]
    text = f"# {name}\n\nMean (standard deviation over seeds, ddof 1).\n\n" + "\n".join(parts)
    write_file(folder / f"{name}.md", text.encode(), overwrite=True)
    return [f"{name}.json", f"{name}.md"]


def _markdown(head: Sequence[str], body: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *body]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _plain(value: float) -> float | None:
    return None if math.isnan(value) else round(value, 6)


def _number(value: float | None) -> float:
    return math.nan if value is None else value


Scores = Mapping[str, Any]
"""Result of `Confusion.to_dict`."""
NOTE = "mean (standard deviation, ddof = 1) over seeds; - where undefined"


def by_test(results: Mapping[str, Mapping[str, Mapping[str, Scores]]], rows: Sequence[str] = ()) -> str:
    """Return for each test of an experiment a table: the IoU of each class and variant in percent.

    Args:
        results: variant -> seed -> test -> scores; variants without a seed are left out.
        rows: further rows, cells joined by ``|``, that the first test's table ends with.
    """
    done = {name: list(seeds.values()) for name, seeds in results.items() if seeds}
    lines = [f"IoU in %, {NOTE}.", ""]
    first = next(iter(done.values()))[0] if done else {}
    for place, (test, scores) in enumerate(first.items()):
        lines += [f"**{test}**", "", f"| class | points | {' | '.join(done)} |", "|---|--:|" + "--:|" * len(done)]
        for label, row in scores["classes"].items():
            cells = [percent([run[test]["classes"][label]["iou"] for run in runs]) for runs in done.values()]
            lines.append(f"| {label} | {row['support']:,} | {' | '.join(cells)} |")
        cells = [percent([run[test]["mean_iou"] for run in runs]) for runs in done.values()]
        lines.append(f"| mean | {scores['points']:,} | {' | '.join(cells)} |")
        lines += [*(rows if place == 0 else ()), ""]
    counts = ", ".join(f"{name} {len(runs)}" for name, runs in done.items())
    return "\n".join([*lines, f"Seeds: {counts}."])


def by_class(runs: Sequence[Scores]) -> str:
    """Return a table of precision, recall and IoU of each class that has points, in percent.

    Means stand below them where every class has points: what is predicted without occurring would count as 0.

    Args:
        runs: scores of one test, a run per seed.
    """
    lines = ["| class | points | precision | recall | IoU |", "|---|--:|--:|--:|--:|"]
    columns = ("precision", "recall", "iou")
    for label, row in runs[0]["classes"].items():
        if row["support"]:
            cells = [percent([run["classes"][label][column] for run in runs]) for column in columns]
            lines.append(f"| {label} | {row['support']:,} | {' | '.join(cells)} |")
    if all(row["support"] for row in runs[0]["classes"].values()):
        cells = [percent([run[f"mean_{column}"] for run in runs]) for column in columns]
        lines.append(f"| mean | {runs[0]['points']:,} | {' | '.join(cells)} |")
    return "\n".join(lines)


def percent(values: Sequence[float | None]) -> str:
    """Return shares as ``mean (standard deviation)`` in percent; None is undefined and left out."""
    return Spread.over([100.0 * value for value in defined(values)]).text(1, "-")
