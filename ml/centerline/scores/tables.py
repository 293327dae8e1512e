"""Figures of predictors as JSON and as Markdown tables: mean (standard deviation over seeds, ddof 1)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from synthroads_addon.base.files import write_file
from synthroads_addon.base.schema import canonical_json
from synthroads_addon.base.text_table import text_table

from ...results import Spread

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
