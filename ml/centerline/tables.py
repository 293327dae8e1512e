"""Figures of predictors as JSON and as Markdown tables: mean (standard deviation over seeds, ddof 1)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from synthroads_addon.core.files import write_file
from synthroads_addon.core.schema import canonical_json

from .metrics import Spread

Measured = Mapping[str, Mapping[str, Mapping[str, Spread]]]
"""Figures by predictor, road (or `all`) and name, as `evaluation.measure` returns them."""


@dataclass(frozen=True)
class Column:
    """A figure in a table: its name in the data, the column's title, factor and decimals."""

    figure: str
    title: str
    factor: float = 1.0
    decimals: int = 3


COLUMNS = (
    Column("mae", "MAE (m)"),
    Column("distance_95", "95 % (m)", decimals=2),
    Column("lateral", "lateral (m)"),
    Column("bias", "bias (m)"),
    Column("chamfer_full", "Chamfer, full (m)"),
    Column("chamfer_common", "Chamfer, common (m)"),
    Column("coverage_68", "in 68 % (%)", 100.0, 1),
    Column("coverage_95", "in 95 % (%)", 100.0, 1),
    Column("found", "found (%)", 100.0, 1),
)
ROAD_COLUMNS = (Column("mae", "MAE (m)"), Column("chamfer_full", "Chamfer (m)"))
"""Columns of each road in a table that has several side by side."""
COVERAGE_COLUMNS = tuple(column for column in COLUMNS if column.figure in ("coverage_68", "coverage_95"))


def table(measured: Measured, road: str = "all", columns: Sequence[Column] = COLUMNS) -> str:
    """Return a Markdown table of all predictors on one road, or on all; columns that nobody fills are left out."""
    used = [column for column in columns if any(column.figure in rows.get(road, {}) for rows in measured.values())]
    head = ["", *(column.title for column in used)]
    body = [
        [name, *(cell(rows.get(road, {}).get(column.figure), column) for column in used)]
        for name, rows in measured.items()
    ]
    return _markdown(head, body)


def road_table(measured: Measured, roads: Mapping[str, str], columns: Sequence[Column] = ROAD_COLUMNS) -> str:
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


def cell(spread: Spread | None, column: Column) -> str:
    """Return ``mean (std)``; the mean alone where there is one seed or nothing differs, a dash where there is none."""
    if spread is None or math.isnan(spread.mean):
        return "–"
    mean = f"{column.factor * spread.mean:.{column.decimals}f}"
    if math.isnan(spread.std) or spread.std == 0.0:
        return mean
    return f"{mean} ({column.factor * spread.std:.{column.decimals}f})"


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


def write_tables(folder: Path, name: str, measured: Measured) -> None:
    """Write ``NAME.json`` and ``NAME.md``, the latter with one table for all roads together and one for each.

    Raises:
        OutputError: the folder can't be written.
    """
    write_file(folder / f"{name}.json", canonical_json(as_data(measured)).encode(), overwrite=True)
    roads = list(dict.fromkeys(road for rows in measured.values() for road in rows))
    parts = [f"## {road}\n\n{table(measured, road)}" for road in sorted(roads, key=lambda road: road != "all")]
    text = f"# {name}\n\nMean (standard deviation over seeds, ddof 1).\n\n" + "\n".join(parts)
    write_file(folder / f"{name}.md", text.encode(), overwrite=True)


def _markdown(head: Sequence[str], body: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *body]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _plain(value: float) -> float | None:
    return None if math.isnan(value) else round(value, 6)


def _number(value: float | None) -> float:
    return math.nan if value is None else value
