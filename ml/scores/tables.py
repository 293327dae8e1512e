"""Figures of predicted roads as JSON, text and Markdown: mean (standard deviation over seeds, ddof 1) of each."""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from synthroads_addon.base.files import write_file
from synthroads_addon.base.schema import canonical_json
from synthroads_addon.base.text.table import text_table

from .distances import METRICS, TARGET_METRICS
from .metrics import Metric, Spread, in_tables, markdown, nan_to_none

Measured = Mapping[str, Mapping[str, Mapping[str, Spread]]]
"""Figures by predictor, road (or `all`) and name, as `evaluation.measure` returns them."""
Columns = Mapping[str, Metric]

COLUMNS = in_tables(METRICS)
CORRIDOR_COLUMNS = in_tables(TARGET_METRICS)
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


def table(spreads: Measured, road: str = "all", columns: Columns = COLUMNS) -> str:
    """Return a Markdown table of all predictors on one road, or on `all` combined; empty columns are left out."""
    return markdown(*_cells({name: rows.get(road, {}) for name, rows in spreads.items()}, columns))


def report(spreads: Measured, corridor: Mapping[str, Mapping[str, float | None]]) -> str:
    """Return text tables: all predictors, the first one road by road, and its corridor errors by target."""
    model = next(iter(spreads))
    roads = {road: rows for road, rows in spreads[model].items() if road != "all"}
    combined = {name: rows.get("all", {}) for name, rows in spreads.items()}
    parts = [f"{len(roads)} road{'s' if len(roads) > 1 else ''}:", *text_table(*_cells(combined, COLUMNS))]
    if len(roads) > 1:
        parts += ["", f"{model}, by road:", *text_table(*_cells(roads, COLUMNS))]
    targets = {
        TARGETS_SHOWN[target][0]: {name: Spread.over([value]) for name, value in shown_figures(target, figures).items()}
        for target, figures in corridor.items()
    }
    return "\n".join([*parts, "", f"{model}, the corridor:", *text_table(*_cells(targets, CORRIDOR_COLUMNS))])


def shown_figures(target: str, figures: Mapping[str, float | None]) -> dict[str, float]:
    """Return a corridor target's figures with the mean error in the unit of `TARGETS_SHOWN`; NaN for None."""
    numbers = {name: math.nan if figure is None else figure for name, figure in figures.items()}
    return numbers | {"mae": TARGETS_SHOWN[target][1] * numbers["mae"]}


def _cells(rows: Mapping[str, Mapping[str, Spread]], columns: Columns) -> tuple[list[str], list[list[str]]]:
    """Return head and body of a table with a row of figures per name; columns that no row has are left out."""
    used_columns = {figure: metric for figure, metric in columns.items() if any(figure in row for row in rows.values())}
    body = [
        [name, *(cell(row.get(figure), metric) for figure, metric in used_columns.items())]
        for name, row in rows.items()
    ]
    return ["", *(metric.title for metric in used_columns.values())], body


def cell(spread: Spread | None, metric: Metric) -> str:
    """Return a table cell ``mean (std)``; the mean alone where std is 0 or NaN, a dash for None or NaN."""
    if spread is None:
        return "–"
    return replace(spread, std=spread.std or math.nan).text(metric.decimals, "–", metric.factor)


def as_data(spreads: Measured) -> dict[str, Any]:
    """Return measured figures as JSON data (mean, std, seeds), rounded to 6 decimals; None where undefined."""
    return {
        name: {
            road: {
                figure: {"mean": nan_to_none(spread.mean, 6), "std": nan_to_none(spread.std, 6), "seeds": spread.count}
                for figure, spread in figures.items()
            }
            for road, figures in rows.items()
        }
        for name, rows in spreads.items()
    }


def write_tables(folder: Path, name: str, spreads: Measured) -> list[str]:
    """Write figures as ``NAME.json`` and as tables in ``NAME.md``, overwriting; return the two files' names.

    Raises:
        OutputError: the folder can't be written.
    """
    write_file(folder / f"{name}.json", canonical_json(as_data(spreads)).encode(), overwrite=True)
    roads = dict.fromkeys(road for rows in spreads.values() for road in rows)
    parts = [f"## {road}\n\n{table(spreads, road)}" for road in sorted(roads, key=lambda road: road != "all")]
    text = f"# {name}\n\nMean (standard deviation over seeds, ddof 1).\n\n" + "\n".join(parts)
    write_file(folder / f"{name}.md", text.encode(), overwrite=True)
    return [f"{name}.json", f"{name}.md"]
